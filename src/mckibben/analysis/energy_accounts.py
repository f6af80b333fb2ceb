"""Exergy accounts of runs: supply, valve, tube, dead volume, exhaust, friction, shaft work, and others.

    supply + machines + walls = valve + tube + dead volume + exhaust + leak + mixing + heat + friction + viscous
                                + shaft work + gain of what is stored + remainder

against the recording's own room. Of a simulated run the parts are independent integrals, which the run itself kept; single
cycles and stretches are summed from samples; of a measured recording there is an estimate (`energy_measured`). `origin` says
which, and what is left is a remainder: it is folded into no part. Shaft work is what the muscles do on their load over the
whole path, lengthening counted against it; ``work_out`` counts what they do while they shorten.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..answers import Caution, collect
from ..components import Environment
from ..components.gas import AIR
from ..documents import JsonValue
from ..errors import InputError
from ..muscles.build import law_from_specimen
from ..muscles.law import TensionLaw, stored_along
from ..pneumatics.circuit import DeadState
from ..quantities import with_unit
from ..recordings import Recording, read_recording
from ..recordings.files import path_of, select_between
from ..specimens import Specimen, muscle_specimen
from ..verbs import BarePressure, MuscleName, RecordingFile, Time, verb
from ._energy_samples import Flows, RecordedMachine, whole_pieces
from .channels import Cycle, closed_cycles, find_cycles, known
from .energy_parts import CycleEnergy, EnergyAccount, EnergyPart, Saving

__all__ = ["CycleEnergy", "EnergyAccount", "EnergyPart", "Saving", "energy_account"]

MOVES = 1e-2  # share of a span from which its cycles are those of the run


@verb
def energy_account(
    record: RecordingFile,
    *,
    start: Time | None = None,
    end: Time | None = None,
    measured: bool = False,
    muscle: MuscleName | None = None,
    accumulator_pressure: BarePressure | None = None,
    cycle: str | None = None,
    **options: JsonValue,
) -> EnergyAccount:
    """Account for the exergy of a recording: supply, losses and shaft work.

    Args:
        record: recording of mckibben (.nc, .csv or .mcap).
        start: time from which on samples are used [s], such as '2 s'.
        end: time up to which samples are used [s], such as '5 s'.
        measured: estimate from measured channels alone.
        muscle: specimen whose law gives the volume for measured channels.
        accumulator_pressure: gauge pressure of an exhaust accumulator whose saving is computed [Pa], such as '1 bar'.
        cycle: channel whose cycles are told apart; the first muscle's span where that moves, else its pressure.
        **options: of `estimate`, the account of measured channels.

    Raises:
        InputError: names the channel or the parameter that the account needs and the recording has not.
    """
    whole = read_recording(record)
    part = select_between(whole, start, end)
    stated = options if muscle is None else {"muscle": muscle} | options
    about = whole.meta.get("energy")
    if measured or not about:
        account = estimate(part, cycle=cycle, **stated)
    else:
        for name in stated:
            raise InputError(name, None, "is allowed only with {measured}, for the recording carries its own law")
        account = _simulated(part, about, whole=part is whole, cycle=cycle)
    saving = None if accumulator_pressure is None else account.saved_by_accumulator(float(accumulator_pressure))
    return replace(account, file=path_of(record), title=str(whole.meta.get("title") or ""), saving=saving)


def _simulated(part: Recording, about: Mapping[str, Any], *, whole: bool, cycle: str | None) -> EnergyAccount:
    """The account of a simulation: what the run kept of all of it, and sums over samples of a stretch."""
    pieces = [Flows(part.select(part.time[p.start], part.time[p.stop - 1])) for p in whole_pieces(part)]
    if not pieces:
        raise InputError("samples", len(part), "must be two or more without a gap between them")
    cautions: list[Caution] = []
    tried = [c for piece in pieces for c in _cycles(piece, cycle, cautions)]
    ledgers = [_between(p, 0, -1) for p in pieces]
    summed = tuple(a._replace(value=sum(one[i].value for one in ledgers)) for i, a in enumerate(ledgers[0]))
    room = pieces[0].machine.room
    exergy = _ledger(about["exergy"]) if whole else summed
    return EnergyAccount(
        kind="simulated",
        parts=exergy,
        energy=_ledger(about["energy"]) if whole else (),
        load=_ledger(about["load"]) if whole else (),
        throughput=float(about["exergy"]["throughput"]) if whole else _of(summed, "supply"),
        air=float(about["air"]) if whole else sum(float(p.air[-1]) for p in pieces),
        compressor=dict(about["compressor"]) if whole else _compressor(pieces),
        cycles=tuple(tried),
        unknown=(),
        cautions=collect(*cautions),
        room_pressure=float(room.pressure_abs),
        caught=lambda p: _caught(pieces, p, summed),
    )


def _ledger(stated: Mapping[str, Any]) -> tuple[EnergyPart, ...]:
    """Parts as a run recorded them."""
    ends = {"atmosphere", "friction"}  # of what flows, these two come from states and ledgers
    parts = [
        EnergyPart(name, float(value), side, "end states" if side == "stored" or name in ends else "integral")
        for side in ("into", "out", "stored")
        for name, value in stated[side].items()
    ]
    return (*parts, EnergyPart("remainder", float(stated["remainder"]), "remainder", "remainder"))


def _between(piece: Flows, first: int, last: int) -> tuple[EnergyPart, ...]:
    """The parts from one sample to another."""
    sides = {"into": piece.into, "out": piece.out, "stored": piece.stored}
    parts = [
        EnergyPart(name, float(v[last] - v[first]), side, "from samples")
        for side, parts_of_side in sides.items()
        for name, v in parts_of_side.items()
    ]
    left = sum(p.value if p.side == "into" else -p.value for p in parts)
    return (*parts, EnergyPart("remainder", left, "remainder", "remainder"))


def _of(parts: tuple[EnergyPart, ...], name: str) -> float:
    return next(p.value for p in parts if p.name == name)


def _compressor(pieces: list[Flows]) -> dict[str, float]:
    return {
        how: sum(float(p.air[-1] * p.dead.compression(p.supply_pressure(), cooled=how == "isothermal")) for p in pieces)
        for how in ("isothermal", "adiabatic")
    }


def _cycles(piece: Flows, channel: str | None, cautions: list[Caution]) -> list[CycleEnergy]:
    record, muscles = piece.record, piece.machine.muscles()
    drive = channel
    if drive is None and muscles:
        span = record[f"{muscles[0]}.span"]
        drive = f"{muscles[0]}.span" if np.ptp(span) > MOVES * span.mean() else f"{muscles[0]}.pressure"
    if drive is None:
        return []
    try:
        all_cycles = find_cycles(record[drive], subject=f"channel {drive}")
        held = {f"{m}.pressure": record[f"{m}.pressure"] for m in muscles}
        all_cycles, caution = closed_cycles(all_cycles, record.time, held)
        cautions += [caution] if caution else []
    except InputError:
        if channel is not None:
            raise
        return []
    pressure = piece.supply_pressure()
    each = float(piece.dead.compression(pressure, cooled=False)) if np.isfinite(pressure) else np.nan
    cycles = []
    for c in all_cycles:
        parts = _between(piece, c.start, c.end)
        air = float(piece.air[c.end] - piece.air[c.start])
        cycles.append(
            CycleEnergy(
                float(piece.time[c.start]),
                float(piece.time[c.end]),
                air,
                _of(parts, "supply"),
                air * each,
                _of(parts, "shaft_work"),
                float(piece.work_out[c.end] - piece.work_out[c.start]),
                parts,
            )
        )
    return cycles


def _caught(
    pieces: list[Flows], pressure_abs: float, parts: tuple[EnergyPart, ...]
) -> tuple[float, float, float, float]:
    air = sum(float(mass[before > pressure_abs].sum()) for p in pieces for before, mass in p.vented)
    worth = float(pieces[0].dead.compression(pressure_abs, cooled=True))
    return air, air * worth, _of(parts, "supply"), _of(parts, "shaft_work")


UNKNOWN = ("tube", "mixing", "heat", "leak", "friction", "viscous")


class _Known(NamedTuple):
    """Basis of the estimate."""

    law: TensionLaw
    dead: DeadState
    supply_abs: float  # [Pa], NaN where it is not known
    idle: float  # volume that does no work [m^3], NaN where it is not known


class _Piece(NamedTuple):
    """A section of a recording: arrays (n,) [SI] and its cycles of the mass."""

    time: np.ndarray
    pressure_abs: np.ndarray
    span: np.ndarray
    tension: np.ndarray
    mass: np.ndarray
    stored: np.ndarray
    cycles: tuple[Cycle, ...]
    caution: Caution | None  # where some are left out


def estimate(
    record: Recording,
    *,
    muscle: Specimen | TensionLaw | str | None = None,
    pressure: str = "pressure",
    tension: str = "tension",
    span: str = "span",
    supply: float | None = None,
    dead_volume: float | None = None,
    cycle: str | None = None,
) -> EnergyAccount:
    """The account of the full cycles of the gas.

    Args:
        record: with the three channels.
        muscle: its law, a specimen or its id; what the recording's parameters say by default.
        pressure: name of the gauge pressure in the muscle [Pa].
        tension: name of the tension [N].
        span: name of the span [m].
        supply: gauge pressure of the supply [Pa]; what the parameters say by default.
        dead_volume: dead volume of ports, tubes and fittings [m^3]; likewise.
        cycle: channel whose low turns part the cycles instead of the mass.

    Raises:
        InputError: names the channel that is missing, the muscle that is not known, or that no cycle is complete.
    """
    for name, unit, quantity in ((pressure, "Pa", "pressure"), (tension, "N", "tension"), (span, "m", "span")):
        if name not in record:
            has = ", ".join(record.channels) or "none"
            problem = f"is missing: the account needs the {quantity} [{unit}]; the recording has {has}"
            raise InputError(f"channel {name}", None, problem)
    basis = _known(record, muscle, supply, dead_volume)
    pieces = [_piece(record, p, basis, (pressure, tension, span), cycle) for p in whole_pieces(record)]
    pairs = [(p, c) for p in pieces for c in p.cycles]
    if not pairs:
        raise InputError("cycles", None, "must have one in which the muscle is filled and emptied, or stretched")
    cycles = tuple(_one(p, c, basis) for p, c in pairs)
    parts = tuple(a._replace(value=sum(c.parts[i].value for c in cycles)) for i, a in enumerate(cycles[0].parts))
    air = sum(c.air for c in cycles)
    work = {
        how: air * float(basis.dead.compression(basis.supply_abs, cooled=how == "isothermal"))
        for how in ("isothermal", "adiabatic")
    }
    unknown = [
        *UNKNOWN,
        *(["dead_volume"] if np.isnan(basis.idle) else []),
        *(["supply"] if np.isnan(basis.supply_abs) else []),
    ]
    cautions = collect(*(p.caution for p in pieces))
    means = sorted(float(p.pressure_abs[c.start : c.end].mean() - basis.dead.pressure_abs) for p, c in pairs)
    if means[-1] - means[0] > 0.02 * abs(means[-1]):
        words = " to ".join(with_unit(mean, "Pa") for mean in (means[0], means[-1]))
        cautions += (Caution(f"the parts are sums over cycles at different mean pressures ({words})", "pressure"),)
    return EnergyAccount(
        kind="measured",
        parts=parts,
        energy=(),
        load=(),
        throughput=sum(c.supply for c in cycles),
        air=air,
        compressor=work,
        cycles=cycles,
        unknown=tuple(unknown),
        cautions=cautions,
        room_pressure=float(basis.dead.pressure_abs),
        caught=lambda p: _caught_in_cycles(pairs, cycles, basis, p),
    )


def _known(record: Recording, muscle: Any, supply: float | None, dead_volume: float | None) -> _Known:
    machine = RecordedMachine(record) if record.meta.get("parameters") else None
    room = machine.room if machine else Environment(**dict(record.meta.get("environment") or {}))
    law: TensionLaw
    if isinstance(muscle, TensionLaw):
        law = muscle
    elif muscle is not None:
        law = law_from_specimen(muscle if isinstance(muscle, Specimen) else muscle_specimen(muscle))
    elif machine is not None and machine.muscles():
        law = machine.law(machine.muscles()[0])
    else:
        raise InputError("muscle", None, "must be a specimen, its id, or a recording that carries its law")
    if not law.has_volume():
        raise InputError("muscle", None, "must have a law that knows the volume of the gas")
    source = None if supply is None else supply + float(room.pressure_abs)
    if source is None and machine is not None:
        source = machine.find("circuit.nodes.supply.pressure_abs")
    idle = dead_volume
    if idle is None and machine is not None:
        nodes, elements = machine.below("circuit.nodes"), machine.below("circuit.elements")
        sizes = [float(v) for k, v in nodes.items() if k.endswith((".volume", ".dead_volume"))]
        bores = [k.removesuffix(".diameter") for k in elements if k.endswith(".diameter") and "tube" in k]
        tubes = [0.25 * np.pi * elements[f"{b}.diameter"] ** 2 * elements[f"{b}.length"] for b in bores]
        idle = sum(sizes) + sum(tubes) if sizes else None
    unknown = float("nan")
    return _Known(
        law,
        DeadState.of(machine.gas if machine else AIR, room),
        unknown if source is None else float(source),
        unknown if idle is None else float(idle),
    )


def _piece(record: Recording, where: slice, given: _Known, names: tuple[str, str, str], cycle: str | None) -> _Piece:
    gauge, tension, span = (known(record.pick([n]), n)[where] for n in names)
    volume = np.asarray(given.law.volume(span, gauge))
    at = gauge + float(given.dead.pressure_abs)
    mass = np.asarray(given.dead.gas.mass(at, volume, given.dead.temperature))
    cycles: tuple[Cycle, ...] = ()
    # Between two low turns the muscle is filled and emptied; where it is only stretched, its span goes to and fro.
    for drive in [mass, span] if cycle is None else [record[cycle][where]]:
        if not cycles:
            with contextlib.suppress(InputError):
                cycles = find_cycles(drive)
            cycles = tuple(c for c in cycles if drive is span or not c.begins_high)
    cycles, caution = closed_cycles(cycles, record.time[where], {names[0]: gauge})
    stored = stored_along(given.law, span, gauge)
    return _Piece(record.time[where], at, span, tension, mass, stored, cycles, caution)


def _one(piece: _Piece, cycle: Cycle, known: _Known) -> CycleEnergy:
    first, turn, last = cycle.start, cycle.turn, cycle.end
    dead, room = known.dead, float(known.dead.temperature)
    source = known.supply_abs
    top = float(dead.compression(source, cooled=True)) if np.isfinite(source) else float("nan")
    worth = np.asarray(dead.flowing(dead.see(piece.pressure_abs, room)))
    fills, empties = (slice(first, turn + 1), slice(turn, last + 1))
    filled = float(piece.mass[turn] - piece.mass[first])
    swing = float(piece.pressure_abs[turn] - piece.pressure_abs[first])
    idle = known.idle * swing / (float(dead.gas.gas_constant) * room) if np.isfinite(known.idle) else 0.0
    shaft = -np.trapezoid(piece.tension[first : last + 1], piece.span[first : last + 1])
    power = -piece.tension[first:last] * np.diff(piece.span[first : last + 1])
    air = filled + idle

    def exergy(i: int) -> float:
        at, mass = float(piece.pressure_abs[i]), float(piece.mass[i])
        return float(dead.stored(at, mass * float(dead.gas.gas_constant * dead.temperature) / at, mass))

    values = {
        ("supply", "into"): top * air,
        ("way_in", "out"): top * filled - float(np.trapezoid(worth[fills], piece.mass[fills])),
        ("dead_volume", "out"): top * idle,
        ("exhaust", "out"): -float(np.trapezoid(worth[empties], piece.mass[empties])),
        ("shaft_work", "out"): float(shaft),
        # the gas that is stored: over a cycle as near to nothing as its ends are alike
        ("gas", "stored"): exergy(last) - exergy(first),
        ("muscle", "stored"): float(piece.stored[last] - piece.stored[first]),
    }
    if not np.isfinite(known.idle):
        del values["dead_volume", "out"]
    left = sum(v if side == "into" else -v for (_, side), v in values.items())
    parts = [EnergyPart(name, value, side, "estimate") for (name, side), value in values.items()]
    parts.append(EnergyPart("remainder", left, "remainder", "remainder"))
    work = air * float(dead.compression(source, cooled=False))
    return CycleEnergy(
        float(piece.time[first]),
        float(piece.time[last]),
        air,
        top * air,
        work,
        float(shaft),
        float(power[power > 0.0].sum()),
        tuple(parts),
    )


def _caught_in_cycles(
    pairs: list[tuple[_Piece, Cycle]], cycles: tuple[CycleEnergy, ...], known: _Known, pressure_abs: float
) -> tuple[float, float, float, float]:
    """Part of the muscle's own air that remains until its pressure has fallen to that of the accumulator."""
    air = 0.0
    for piece, c in pairs:
        below = np.flatnonzero(piece.pressure_abs[c.turn : c.end + 1] <= pressure_abs)
        if below.size == 0 or below[0] > 0:
            until = c.turn + int(below[0]) if below.size else c.end
            air += float(piece.mass[c.turn] - piece.mass[until])
    worth = float(known.dead.compression(pressure_abs, cooled=True))
    return air, air * worth, sum(c.supply for c in cycles), sum(c.shaft_work for c in cycles)
