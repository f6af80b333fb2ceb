"""Calibrations as files, what they hold, and recordings with another one.

A calibration is kept as a TOML file (schema 1): one table per channel, every value as text with its unit.

    schema = 1
    rig = "modern"
    created = "2026-03-31T12:00:00+00:00"
    [channels.tension]
    unit = "N"
    sensor = "S/N 123"
    correlation = 0.4                  # of gain and zero
    linearity = "0.02 N"               # largest departure of a point from the line
    [channels.tension.gain]            # also zero and skew, those that were determined
    value = 1.0023
    uncertainty = 0.0002               # standard
    degrees = 14.2                     # of freedom of that; infinitely many by default
    method = "weights"
    date = "2026-03-31T12:00:00+00:00"
    reference = "M1 masses"
    reference_uncertainty = "0.01 N"   # standard, of each of its values
    scale_uncertainty = 0.0015         # standard, of all of them alike
    valid_for = "365 day"              # for ever by default
    points = 7

The terms of a channel may come from different days; each says where it comes from.
"""

from __future__ import annotations

import datetime
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from ..answers import Answer, Column, Table
from ..documents import JsonValue, path_text, read_toml, write_text
from ..errors import InputError
from ..quantities import with_unit
from ..verbs import CalibrationFile, ParameterType, RecordingFile, verb
from .calibration import (
    DAY,
    TERMS,
    UNITS,
    Calibration,
    Correction,
    carried,
    correction_table,
    moment,
    read_plain,
    recalibrate,
)
from .files import read_recording
from .provenance import created
from .recording import Recording

CalibrationOrRecording = Annotated[Any, ParameterType("CALIBRATION|RECORDING")]

VALUES = (Column("value", right=True), Column("half", "+- 95 %", right=True))


def read_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Read a calibration.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed; a newer schema is refused.
    """
    where = path_text(path, "calibration")
    return read_plain(read_toml(path, field="calibration"), where=where, bare=False)


def write_calibration(calibration: Calibration, path: str | os.PathLike[str]) -> Path:
    """Write a calibration, atomically; it reads back exactly.

    Raises:
        InputError: the file cannot be written.
    """
    import tomlkit

    return write_text(path, tomlkit.dumps(document(calibration)), field="calibration")


def merged(path: Path, rig: str, corrections: Mapping[str, Correction], date: str) -> Calibration:
    """Return the calibration of a file, updated with new corrections; a new calibration if there is no such file.

    Raises:
        InputError: the file is of another rig, or cannot be read.
    """
    before = read_calibration(path) if path.exists() else Calibration(rig=rig, created=date)
    if before.rig != rig:
        raise InputError("rig", rig, f"the calibration is of {before.rig}; choose another file", where=str(path))
    return before.updated(corrections, date)


def document(calibration: Calibration) -> dict[str, JsonValue]:
    """Tables of a calibration file."""
    channels = {name: correction_table(one, bare=False) for name, one in calibration.corrections.items()}
    for table in channels.values():
        for term in TERMS:
            if term in table and "valid_for" in table[term]:
                days = float(table[term]["valid_for"].removesuffix(" s")) / DAY
                if days == round(days):
                    table[term]["valid_for"] = f"{days:.0f} day"
    return {**calibration.plain(), "channels": channels}


# ---- what one holds, and recordings with another


def shown_term(one: Correction, key: str) -> dict[str, str]:
    """Value of a term and half its interval, as a person reads them."""
    term = one.terms[key]
    low, high = term.interval()
    if key == "skew":
        return {"value": f"{1e6 * term.value:.5g} us", "half": f"{5e5 * (high - low):.2g} us"}
    unit = UNITS.get(key, one.unit)
    return {"value": with_unit(term.value, unit, 7), "half": with_unit(0.5 * (high - low), unit, 2)}


def correction_dict(one: Correction, at: datetime.datetime) -> dict[str, JsonValue]:
    """Every term of a correction with its interval, its origin and whether it has expired."""
    over = one.expired(at)
    content: dict[str, Any] = {name: getattr(one, name) for name in ("unit", "sensor", "correlation", "linearity")}
    for key, term in one.terms.items():
        number = {name: getattr(term, name) for name in ("value", "uncertainty", "degrees")}
        number |= dict(zip(("low", "high"), term.interval(), strict=True))
        origin = {} if term.origin is None else dict(vars(term.origin))
        content[key] = {**number, "unit": UNITS.get(key, one.unit), "expired": key in over, **origin}
    return content


@dataclass(frozen=True)
class CalibrationDescription(Answer):
    """What a calibration holds: what `describe_calibration` finds.

    Attributes:
        calibration: values by channel.
        file: of it, or of the recording that carries it.
        at: time for which ages are stated.
    """

    calibration: Calibration
    file: str
    at: datetime.datetime

    def to_dict(self) -> dict[str, JsonValue]:
        """Every term with its interval, its origin and whether it has expired."""
        return {
            "file": self.file,
            "rig": self.calibration.rig,
            "created": self.calibration.created,
            "expired": list(self.calibration.expired(self.at)),
            "channels": {name: correction_dict(one, self.at) for name, one in self.calibration.corrections.items()},
        }

    def tables(self) -> list[Table]:
        """Values, 95 % intervals, origin and age."""
        rows = []
        for name, one in self.calibration.corrections.items():
            over = one.expired(self.at)
            for key, term in one.terms.items():
                row = {"channel": name, "term": key, "sensor": one.sensor, "over": "EXPIRED" if key in over else ""}
                if (origin := term.origin) is not None:
                    days = (self.at - moment(origin.date)).total_seconds() / 86400.0
                    row |= {"age": f"{days:.0f} days", "by": ", ".join(filter(None, (origin.method, origin.reference)))}
                    row |= {"until": "for ever" if origin.expires is None else f"{origin.expires:%Y-%m-%d}"}
                rows.append(row | shown_term(one, key))
        origins = (Column("by"), Column("sensor"), Column("age"), Column("until", "valid until"), Column("over", ""))
        title = f"Calibration of the rig {self.calibration.rig}, {self.calibration.created}"
        return [Table(title, (Column("channel"), Column("term", ""), *VALUES, *origins), rows)]

    def remarks(self) -> list[str]:
        """What has expired."""
        return [f"Note: {sentence}" for sentence in self.calibration.expired(self.at)]


@verb
def describe_calibration(file: CalibrationOrRecording) -> CalibrationDescription:
    """Show a calibration: values, 95 % intervals, origin and age.

    Values that have expired are marked.

    Args:
        file: calibration file (.toml), or a recording that carries a calibration.

    Raises:
        InputError: the file cannot be read, or the recording carries none.
    """
    where, known = "" if isinstance(file, Calibration | Recording) else str(file), file
    if where.lower().endswith(".toml"):
        known = read_calibration(where)
    try:
        known = known if isinstance(known, Calibration) else read_recording(known)
        known = carried(known) if isinstance(known, Recording) else known
    except InputError as error:
        raise error if error.where == (where or None) else error.at(where) from None
    if known is None:
        raise InputError("calibration", None, "is not in the recording", where=where or None)
    return CalibrationDescription(known, where, moment(created()))


@dataclass(frozen=True)
class RecalibratedRecording(Answer):
    """A recording with another calibration: what `apply_calibration` computes.

    Attributes:
        recording: the new one.
        source: file of the one before.
        changed: measured channels whose values are others now.
        notes: what the calibration has to be said of.
    """

    recording: Recording
    source: str
    changed: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """Changed channels, and all of them in numbers [SI]."""
        meta = self.recording.meta
        return {
            "source": self.source,
            "changed": list(self.changed),
            "skew_corrected": meta.get("skew_corrected") or [],
            "warnings": list(self.notes),
            "summary": self.recording.summary(),
            "saturation": meta.get("saturation") or {},
        }

    def remarks(self) -> list[str]:
        """Which channels are others now, and what has to be said of the calibration."""
        changed = f"Against {self.source} changed are {', '.join(self.changed) or 'no channels'}."
        return [changed, *(f"Note: {note}" for note in self.notes)]


@verb
def apply_calibration(
    recording: RecordingFile, *, calibration: CalibrationFile | None = None, off: bool = False, skew: bool = False
) -> RecalibratedRecording:
    """Apply a calibration to a recording in place of the one it carries.

    The raw values can always be recovered.

    Args:
        recording: recording, with or without a calibration.
        calibration: calibration file to apply.
        off: remove the calibration that the recording carries.
        skew: also shift the channels by their skews.

    Raises:
        InputError: a file cannot be read, or the calibration is of another rig.
    """
    if off == (calibration is not None):
        problem = "is missing: give a file, or {off}" if calibration is None else "must be a file, or {off}"
        raise InputError("calibration", None if calibration is None else str(calibration), problem)
    if off and skew:
        raise InputError("skew", None, "is allowed only beside {calibration}")
    new = calibration if calibration is None or isinstance(calibration, Calibration) else read_calibration(calibration)
    known, source = recording, "the recording"
    if not isinstance(recording, Recording):
        known, source = read_recording(recording), str(recording)
    try:
        done = recalibrate(known, new, skew=skew)
    except InputError as error:
        raise error.at(source) from None
    before = known.meta.get("warnings") or []
    notes = [w for w in done.meta.get("warnings") or [] if w not in before]
    if new is not None:
        notes += [s for s in new.expired(moment(created())) if s not in notes]
    changed = tuple(n for n in known.names("measured") if n in done and (done[n] != known[n]).any())
    return RecalibratedRecording(done, source, changed, tuple(notes))
