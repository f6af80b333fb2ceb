"""The energy flow of a recording: streams whose width is their energy, and a table of the parts.

The account is that of `analysis.energy_accounts`, its streams those of the reports' figure.
"""

from __future__ import annotations

import functools
import math
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

from ....analysis.energy_accounts import CycleEnergy, EnergyAccount, EnergyPart, energy_account
from ....documents import JsonValue
from ....errors import InputError
from ....quantities import with_unit
from ....recordings import read_recording
from ....report.figures.energy_figures import IN_MUSCLE, LEAST, Streams, streams
from ...reader import read_outside

_ONE = threading.Lock()
KINDS = ("simulated", "measured")
SIDES = {"into": "in", "out": "out", "stored": "gained", "remainder": "left"}
WAY = ("valve", "tube", "way_in", "machine")  # lost before the air is in the volumes
ORIGINS = {
    "integral": "the parts are integrated one by one by the run itself, none is found by subtraction",
    "from samples": "the parts are integrated one by one from the samples, none is found by subtraction",
    "estimate": "estimated from pressure, tension and length alone, with the law's volume",
}


@functools.lru_cache(maxsize=6)
def _account(path: str, changed: int, kind: str, muscle: str) -> tuple[EnergyAccount, str, bool]:
    record = read_outside(read_recording, Path(path))
    simulated = bool(record.meta.get("energy"))
    measured = kind == "measured"
    options: dict[str, Any] = {"muscle": muscle} if muscle and (measured or not simulated) else {}
    title = str(record.meta.get("title") or "")
    return energy_account(record, measured=measured, **options), title, simulated


def account(path: Path, kind: str = "", muscle: str = "") -> tuple[EnergyAccount, str, bool]:
    """Account of a recording, its title, and whether the run recorded one.

    Args:
        path: path of the recording.
        kind: ``measured`` for an estimate although the run kept an account.
        muscle: id of the specimen whose law gives the volume, where the recording does not say.

    Raises:
        InputError: it is no recording, or lacks what an account needs; says what.
    """
    if kind and kind not in KINDS:
        raise InputError("account", kind, known=KINDS)
    with _ONE:  # of two visitors who ask for the same, the second finds it made
        return _account(str(path), path.stat().st_mtime_ns, kind, muscle)


def stretch(account: EnergyAccount, part: str) -> tuple[EnergyAccount, CycleEnergy | None]:
    """Account of the whole recording (empty text), or of a cycle by its number from 1."""
    if not part:
        return account, None
    if not part.isdigit() or not 1 <= int(part) <= len(account.cycles):
        raise InputError("cycle", part, f"the recording has {len(account.cycles)} of them")
    one = account.cycles[int(part) - 1]
    return replace(account, parts=one.parts), one


def flow_document(account: EnergyAccount, part: str, accumulator: float | None) -> dict[str, JsonValue]:
    """Compute the drawing.

    Args:
        account: from `account`.
        part: number of a cycle from 1, or nothing for the whole.
        accumulator: gauge pressure of an exhaust accumulator [Pa], whose saving is shown; None for none.
    """
    one, cycle = stretch(account, part)
    supply = one.value("supply")
    known = math.isfinite(supply)
    gas, muscle = streams(one if known else replace(one, parts=()))
    said = [f"Remainder {_joules(one.remainder)}: {ORIGINS.get(one.parts[0].origin, 'summed from samples')}."]
    if not known:
        said = ["The pressure of the supply is not known from this recording, and nothing that is counted against it."]
    if account.unknown:
        said.append(f"Unknown, and not zero: {', '.join(account.unknown)}.")
    said += [f"{note[:1].upper()}{note[1:]}." for note in account.notes]
    if accumulator is not None and accumulator > 0.0 and known and not part:
        saving = account.saved_by_accumulator(accumulator)
        said.append(
            f"An exhaust accumulator at {with_unit(saving.pressure, 'Pa', 3)} would keep at most {saving.exergy:.3g} J, "
            f"{100.0 * saving.share:.3g} % of the supply's."
        )
    air = account.air if cycle is None else cycle.air
    work = one.value("shaft_work")
    return {
        "supply": supply if known else None,
        "efficiency": work / supply if supply > 0.0 else None,
        "least": LEAST,
        "air": 1e3 * air,
        "gas": _plain(gas),
        "muscle": _plain(muscle),
        "hub": IN_MUSCLE,
        "way": WAY,
        "say": said,
        "parts": [_row(p, supply) for p in one.parts if p.value or p.name in ("supply", "shaft_work", "remainder")],
    }


def _row(part: EnergyPart, supply: float) -> dict[str, JsonValue]:
    known = math.isfinite(part.value)
    return {
        "side": SIDES[part.side],
        "name": part.name.replace("_", " "),
        "value": part.value if known else None,
        "share": part.value / supply if known and supply > 0.0 else None,
        "origin": part.origin,
        "meaning": part.meaning,
    }


def cycle_names(account: EnergyAccount) -> dict[str, str]:
    """Cycles to choose from: value and label."""
    names = {"": "Whole recording"}
    for i, c in enumerate(account.cycles, 1):
        names[str(i)] = f"Cycle {i}, {c.start:.4g} to {c.end:.4g} s"
    return names


def _joules(value: float) -> str:
    return f"{0.0 if abs(value) < 5e-3 else value:.2f} J"


def _plain(streams: Streams) -> dict[str, JsonValue]:
    return {side: [s._asdict() for s in getattr(streams, side)] for side in ("into", "out")}
