"""Whether a machine's accounts close: end states against independent integrals, account by account."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from ..engine import Run
from ..muscles.stored import stored_change
from ..pneumatics.exergy import stored_exergy
from .machine import Machine
from .where_it_went import Gained, WhereItWent, where_it_went

LEAST = 1e-6  # [J]; of less work than this, rounding of what is stored is all that an account shows


class Accounts(NamedTuple):
    """What is missing in each account, over what went through; zero is perfect.

    Attributes:
        mass: of gas, over the mass that crossed the border; over the mass at the start where that is more.
        gas: energy of the gas, over the enthalpy that crossed the border; over the work in the muscles where that is more.
        muscle: energy stored in bladder and braid, over the work exchanged with them both ways.
        mechanics: kinetic and elastic energy and what friction took, over the work exchanged with braids and outside.
        energy: of the whole, over the same and the outside work; nothing that passes from part to part enters it.
        friction: work that friction and creep took [J], as their own ledger says.
        dissipated: what they turned into heat of it [J].
        exergy: of the whole in exergy, over the exergy that crossed the border, from the supply and to the room; over the
            work in the muscles where that is more.
        energy_parts: where exergy and energy went [J].
    """

    mass: float
    gas: float
    muscle: float
    mechanics: float
    energy: float
    friction: float
    dissipated: float
    exergy: float
    energy_parts: WhereItWent


def accounts(
    machine: Machine, start: tuple[Any, Any], run: Run, first: Mapping[str, Any], last: Mapping[str, Any]
) -> Accounts:
    """The accounts of a run.

    Args:
        machine: what was run.
        start: its state and memory at the start.
        run: as the engine returned it.
        first: inputs at the start.
        last: inputs at the end.
    """
    (begin, memory), end = start, run.state
    flow = {k: float(v) for k, v in run.integrals.items()}
    seen = [machine.with_lengths(s, i) for s, i in ((begin, first), (end, last))]
    (mass, before), (mass_after, after) = (
        machine.joined.stored(s["circuit"], i) for s, i in zip((begin, end), seen, strict=True)
    )
    room = [
        sum(float(v.value) for v in machine.joined.volumes(s["circuit"], i).values())
        for s, i in zip((begin, end), seen, strict=True)
    ]
    worth = [
        stored_exergy(machine.joined, s["circuit"], i, machine.environment)
        for s, i in zip((begin, end), seen, strict=True)
    ]
    taken, dissipated = (_ledger(run.memory, what) - _ledger(memory, what) for what in ("work", "dissipated"))
    got = Gained(
        gas=after - before,
        gas_exergy=worth[1] - worth[0],
        muscle=sum(_muscle_energy(machine, name, begin, end) for name in machine.units),
        tendon=_of_units(machine, end, last) - _of_units(machine, begin, first),
        load=float(machine.load.stored_energy(end["load"]) - machine.load.stored_energy(begin["load"])),
        friction=taken,
        dissipated=dissipated,
        # The atmosphere takes P0 dV of what the gas does in the muscles; other walls are moved from outside.
        lifted=sum(_atmosphere(machine, name, begin, end) for name in machine.units),
        swollen=float(machine.environment.pressure_abs) * (room[1] - room[0]),
    )
    moving = got.tendon + got.load
    entered = flow["enthalpy"] + flow["heat"] + flow["shaft"] - (flow["work"] - flow["muscle_work"])
    # With closed valves no enthalpy crosses the border, and the work in the muscles is what there is.
    crossed = max(flow["enthalpy_turnover"], flow["exchanged"], LEAST)
    whole = got.gas + got.muscle + got.lifted + moving + taken - entered - flow["outside"] + flow["lost"]
    parts = where_it_went(machine, flow, got)
    return Accounts(
        mass=abs(mass_after - mass - flow["mass"]) / max(flow["mass_turnover"], mass),
        gas=abs(got.gas - entered + flow["muscle_work"]) / crossed,
        muscle=abs(got.muscle - flow["braid"] - flow["filling"]) / max(flow["exchanged"], LEAST),
        mechanics=abs(moving + taken - (flow["outside"] - flow["lost"] - flow["braid"]))
        / max(flow["exchanged"] + flow["outside_turnover"], LEAST),
        energy=abs(whole) / (crossed + flow["outside_turnover"]),
        friction=taken,
        dissipated=dissipated,
        exergy=abs(parts.exergy.remainder) / max(parts.exergy.throughput, LEAST),
        energy_parts=parts,
    )


def _ledger(memory: Any, what: str) -> float:
    return sum(float(getattr(led, what)) for parts in memory["muscles"].values() for led in parts.values())


def _atmosphere(machine: Machine, name: str, start: Any, end: Any) -> float:
    """Work done on the surroundings by a muscle that swells [J]."""
    law = machine.units[name].law
    v0, v1 = (float(law.braid_volume(s["muscles"][name].length, machine.gauge(s, name))) for s in (start, end))
    return float(machine.environment.pressure_abs) * (v1 - v0)


def _muscle_energy(machine: Machine, name: str, start: Any, end: Any) -> float:
    """Gain of the energy stored in bladder and braid [J]."""
    ambient = float(machine.environment.pressure_abs)
    first, last = (
        (float(s["muscles"][name].length), float(s["circuit"]["pressure"][name]) - ambient) for s in (start, end)
    )
    return stored_change(machine.units[name].law, first, last)


def _of_units(machine: Machine, state: Any, inputs: Mapping[str, Any]) -> float:
    """Energy of end masses and tendons [J]."""
    spans = machine.load.spans(state["load"], inputs)
    return sum(float(u.kinetic_and_elastic(state["muscles"][n], spans[n].span)) for n, u in machine.units.items())
