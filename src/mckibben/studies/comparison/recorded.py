"""Table 1 of a muscle from a recording: static rows from cycles at constant drive, power from any cycles.

What a recording does not show stays unknown: the range, stiffness and work are those of the lengths that were visited,
and the largest velocity is the largest that was seen. The tension of a cycle without its friction is the mean of the
rising and the falling path at the same length.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...analysis.channels import known
from ...analysis.loops import loop, peak_velocity
from ...analysis.paths import paths
from ...analysis.power import ShorteningPower, power_density, shortening_power
from ...analysis.segments import segments, steps_of
from ...errors import InputError
from ...quantities import with_unit
from ...recordings import Recording, read_recording
from .subject import Subject, subject
from .table import Column

LENGTHS = ("span", "muscle.length", "muscle.span", "length")
TENSIONS = ("tension", "muscle.tension")
PRESSURES = ("pressure", "muscle.pressure")
STEADY = 0.1  # of its mean: a drive that moves less is constant
NEAR_TOP = 0.9  # of the highest constant drive: cycles there are compared
SLACK = 0.02  # of the largest tension: shorter lengths carry none
GRID = 401


class _Piece(NamedTuple):
    """Cycles: the part of a recording, mean drive (0 where none is recorded), its movement, and the peak velocity [m/s]."""

    record: Recording
    drive: float
    moves: float
    velocity: float


def column_of(file: str | os.PathLike[str] | Recording, *, name: str | None = None) -> Column:
    """What a recording says of its muscle [SI].

    Args:
        file: a recording, or its file. Its meta must tell the rest length: ``rest_length`` [m], or a ``specimen`` that is
            known, which also tells the section.
        name: of the column; that of the file, or of the protocol, where left out.

    Raises:
        InputError: it cannot be read, has no length or no tension, tells no rest length, or has no full cycle.
    """
    if isinstance(file, Recording):
        record, where = file, str(file.meta.get("title", "recording"))
    else:
        record, where = read_recording(Path(file)), str(file)
    own = name or (where if isinstance(file, Recording) else Path(file).stem)
    try:
        return _column(record, own)
    except InputError as error:
        raise error if error.where else error.at(where) from None


def _column(record: Recording, name: str) -> Column:
    length, tension = _channel(record, LENGTHS, "length"), _channel(record, TENSIONS, "tension")
    muscle = _muscle(record)
    rest, area = _rest_length(record, muscle), None if muscle is None else muscle.section_area
    pieces = _pieces(record, length)
    values: dict[str, float] = {"rest_length": rest, "maximum_tension": float(known(record, tension).max())}
    notes = ["largest velocity is the largest seen"]
    steady = [p for p in pieces if p.moves <= STEADY]
    if steady:
        top = max(p.drive for p in steady)
        slowest = min((p for p in steady if p.drive >= NEAR_TOP * top), key=lambda p: p.velocity)
        found, said = _static(slowest.record, length, tension, rest)
        values, notes = values | found, [*notes, *said]
        if top > 0.0:
            notes.append(f"static rows at {with_unit(slowest.drive, 'Pa')}")
    else:
        notes.append("no cycle at constant drive: no static rows")
    powers = [shortening_power(p.record, length=length, tension=tension) for p in pieces]
    values["maximum_velocity"] = max(p.peak_velocity for p in powers) / rest
    if area is not None:
        values |= _per_volume(values, powers, area, rest)
    else:
        notes.append("no section is known: nothing per section or volume")
    title = str(record.meta.get("title") or name)
    return Column(name, title, "recording", values, tuple(notes))


def _static(record: Recording, length: str, tension: str, rest: float) -> tuple[dict[str, float], list[str]]:
    both = paths(record, length=length, tension=tension)
    ends = max(p.length[0] for p in both), min(p.length[-1] for p in both)
    at = np.linspace(*ends, GRID)
    mean = 0.5 * (both.rising.at(at) + both.falling.at(at))
    strongest = float(mean.max())
    pulls = mean > SLACK * strongest
    first = int(np.argmax(pulls))
    notes = (
        [] if first > 0 or mean[0] <= 2.0 * SLACK * strongest else ["zero tension was not reached: range as visited"]
    )
    low, high = float(at[first]), float(at[-1])
    found = {
        "shortest": low / rest, "longest": high / rest, "dynamic_range": (high - low) / rest,
        "maximum_tension": strongest, "stiffness": float(mean[-1] - mean[first]) / (high - low) * rest,
        "work": float(np.trapezoid(mean[first:], at[first:])) / rest,
        "coulomb_friction": loop(record, length=length, tension=tension).friction,
    }  # fmt: skip
    return found, notes


def _per_volume(values: dict[str, float], powers: list[ShorteningPower], area: float, rest: float) -> dict[str, float]:
    size: dict[str, Any] = {"section_area": area, "rest_length": rest}
    found = {
        "section_area": area, "tension_intensity": values["maximum_tension"] / area,
        "mean_power_density": power_density(max(p.mean_power for p in powers), **size),
        "peak_power_density": power_density(max(p.peak_power for p in powers), **size),
    }  # fmt: skip
    if "stiffness" in values:
        found |= {"stiffness_intensity": values["stiffness"] / area, "work_density": values["work"] / area}
    return found


def _channel(record: Recording, names: tuple[str, ...], what: str) -> str:
    for name in names:
        if name in record:
            return name
    raise InputError(
        f"channel of {what}", "missing",
        f"allowed is one of {', '.join(names)}; the recording has {', '.join(record.names()) or 'none'}",
    )  # fmt: skip


def _muscle(record: Recording) -> Subject | None:
    """The specimen that the recording names, where it is known."""
    name = record.meta.get("specimen")
    if not isinstance(name, str):
        return None
    try:
        return subject(name)
    except InputError:
        return None


def _rest_length(record: Recording, muscle: Subject | None) -> float:
    stated = record.meta.get("rest_length", None if muscle is None else muscle.rest_length)
    if isinstance(stated, bool) or not isinstance(stated, int | float) or not 0.0 < stated < 100.0:
        raise InputError(
            "rest_length", "missing" if stated is None else str(stated),
            "allowed is a length [m] in the meta of the recording, or the id of a known specimen under specimen",
        )  # fmt: skip
    return float(stated)


def _pieces(record: Recording, length: str) -> list[_Piece]:
    """The parts with full cycles of the length: the steps of the test machine, or the whole."""
    try:
        steps_of(record)
        parts = segments(record)
    except InputError:
        parts = [record]
    pressure = next((n for n in PRESSURES if n in record), None)
    found, last = [], None
    for part in parts:
        try:
            velocity = peak_velocity(part, length=length)
        except InputError as error:
            last = error
            continue
        drive = np.zeros(1) if pressure is None else known(part, pressure)
        mean = float(np.mean(drive))
        moves = float(np.ptp(np.quantile(drive, [0.01, 0.99]))) / mean if mean > 0.0 else 0.0
        found.append(_Piece(part, mean, moves, velocity))
    if not found:
        assert last is not None
        raise last
    return found
