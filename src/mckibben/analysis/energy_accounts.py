"""Where the exergy of a run went: supply, valve, tube, dead volume, exhaust, friction, shaft work, and all between.

    supply + machines + walls = valve + tube + dead volume + exhaust + leak + mixing + heat + friction + viscous
                                + shaft work + gain of what is stored + remainder

against the recording's own room. Of a simulated run the parts are independent integrals, which the run itself kept; single
cycles and stretches are summed from samples; of a measured recording there is an estimate (`energy_measured`). `origin` says
which, and what is left is a remainder: it is folded into no part. Shaft work is what the muscles do on their load over the
whole path, lengthening counted against it; ``work_out`` counts what they do while they shorten.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import InputError
from ..recordings import Recording
from .cycles import find_cycles
from .energy_measured import estimate
from .energy_parts import CycleEnergy, EnergyAccount, Part, Saving
from .energy_samples import Flows, whole_pieces

__all__ = ["CycleEnergy", "EnergyAccount", "Part", "Saving", "energy_account"]

MOVES = 1e-2  # share of a span from which its cycles are those of the run


def energy_account(
    record: Recording, *, start: float | None = None, end: float | None = None, cycle: str | None = None,
    measured: bool = False, **options: Any,
) -> EnergyAccount:  # fmt: skip
    """The account of a recording; of all that a simulation ran, or of a stretch of what is recorded.

    Args:
        record: of a test machine or a joint.
        start: of the stretch [s].
        end: of the stretch [s].
        cycle: channel whose cycles are told apart; the first muscle's span where that moves, else its pressure.
        measured: use measured channels although the recording has true ones.
        **options: of `energy_measured.estimate`.

    Raises:
        InputError: names the channel or the parameter that the account needs and the recording has not.
    """
    part = record if start is None and end is None else record.select(start, end)
    about = record.meta.get("energy")
    if measured or not about:
        return estimate(part, cycle=cycle, **options)
    if options:
        raise InputError(next(iter(options)), "given", "allowed with measured channels only")
    pieces = [Flows(part.select(part.time[p.start], part.time[p.stop - 1])) for p in whole_pieces(part)]
    if not pieces:
        raise InputError("samples", len(part), "needed are two or more without a gap between them")
    notes: list[str] = []
    tried = [c for piece in pieces for c in _cycles(piece, cycle, notes)]
    summed = _summed(pieces)
    room = pieces[0].machine.room
    whole = part is record
    exergy = _ledger(about["exergy"]) if whole else summed
    return EnergyAccount(
        kind="simulated", parts=exergy, energy=_ledger(about["energy"]) if whole else (),
        load=_ledger(about["load"]) if whole else (),
        throughput=float(about["exergy"]["throughput"]) if whole else _of(summed, "supply"),
        air=float(about["air"]) if whole else sum(float(p.air[-1]) for p in pieces),
        compressor=dict(about["compressor"]) if whole else _compressor(pieces),
        cycles=tuple(tried), unknown=(), notes=tuple(dict.fromkeys(notes)), room_pressure=float(room.pressure_abs),
        caught=lambda p: _caught(pieces, p, summed),
    )  # fmt: skip


def _ledger(stated: Mapping[str, Any]) -> tuple[Part, ...]:
    """The parts as a run kept them."""
    ends = {"atmosphere", "friction"}  # of what flows, these two come from states and ledgers
    parts = [
        Part(name, float(value), side, "end states" if side == "stored" or name in ends else "integral")
        for side in ("into", "out", "stored")
        for name, value in stated[side].items()
    ]
    return (*parts, Part("remainder", float(stated["remainder"]), "remainder", "remainder"))


def _between(piece: Flows, first: int, last: int) -> tuple[Part, ...]:
    """The parts from one sample to another."""
    sides = {"into": piece.into, "out": piece.out, "stored": piece.stored}
    parts = [
        Part(name, float(v[last] - v[first]), side, "from samples")
        for side, own in sides.items()
        for name, v in own.items()
    ]
    return (*parts, _left(parts))


def _left(parts: list[Part]) -> Part:
    value = sum(p.value if p.side == "into" else -p.value for p in parts)
    return Part("remainder", value, "remainder", "remainder")


def _summed(pieces: list[Flows]) -> tuple[Part, ...]:
    ledgers = [_between(p, 0, -1) for p in pieces]
    return tuple(a._replace(value=sum(one[i].value for one in ledgers)) for i, a in enumerate(ledgers[0]))


def _of(parts: tuple[Part, ...], name: str) -> float:
    return next(p.value for p in parts if p.name == name)


def _compressor(pieces: list[Flows]) -> dict[str, float]:
    return {
        how: sum(float(p.air[-1] * p.dead.compression(p.supply_pressure(), cooled=how == "isothermal")) for p in pieces)
        for how in ("isothermal", "adiabatic")
    }


def _cycles(piece: Flows, channel: str | None, notes: list[str]) -> list[CycleEnergy]:
    record, muscles = piece.record, piece.machine.muscles()
    drive = channel
    if drive is None and muscles:
        span = record[f"{muscles[0]}.span"]
        drive = f"{muscles[0]}.span" if np.ptp(span) > MOVES * span.mean() else f"{muscles[0]}.pressure"
    if drive is None:
        return []
    try:
        found = find_cycles(record[drive], what=f"channel {drive}")
    except InputError as error:
        if channel is not None:
            raise
        notes.append(f"no cycles: {error}")
        return []
    pressure = piece.supply_pressure()
    each = float(piece.dead.compression(pressure, cooled=False)) if np.isfinite(pressure) else np.nan
    cycles = []
    for c in found:
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
            )  # fmt: skip
        )
    return cycles


def _caught(pieces: list[Flows], pressure_abs: float, parts: tuple[Part, ...]) -> tuple[float, float, float, float]:
    air = sum(float(mass[before > pressure_abs].sum()) for p in pieces for before, mass in p.vented)
    worth = float(pieces[0].dead.compression(pressure_abs, cooled=True))
    return air, air * worth, _of(parts, "supply"), _of(parts, "shaft_work")
