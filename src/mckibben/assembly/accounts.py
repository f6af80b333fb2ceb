"""Whether a machine's accounts close: end states against independent integrals, account by account."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from .._jax import Scalar, Tree, jnp
from ..answers import brief
from ..engine import Run
from ..engine.native import call_compiled
from ..muscles.law import stored_change
from ..pneumatics.circuit import stored_exergy
from .exergy_balance import ExergyBalance, StoredChange, exergy_balance
from .machine import Machine

CLOSED = ("mass", "gas", "muscle", "mechanics", "energy", "exergy")  # accounts that a recording states
LEAST = 1e-6  # [J]; of less work than this, rounding of what is stored is all that an account shows


class Accounts(NamedTuple):
    """Relative errors of each balance, over the throughput; zero is perfect.

    Attributes:
        mass: mass of gas, over the mass that crossed the border; over the mass at the start where that is more.
        gas: energy of the gas, over the enthalpy that crossed the border; over the work in the muscles where that is more.
        muscle: energy stored in bladder and braid, over the work exchanged with them both ways.
        mechanics: kinetic and elastic energy and what friction took, over the work exchanged with braids and outside.
        energy: energy of the whole, over the same and the outside work; nothing that passes from part to part enters it.
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
    energy_parts: ExergyBalance

    def __repr__(self) -> str:
        return brief(self)


def accounts(
    machine: Machine, start: tuple[Tree, Tree], run: Run, first: Mapping[str, Scalar], last: Mapping[str, Scalar]
) -> Accounts:
    """The accounts of a run.

    Args:
        machine: the machine that was run.
        start: state and memory at the start.
        run: as the engine returned it.
        first: inputs at the start.
        last: inputs at the end.
    """
    (begin, memory), end = start, run.state
    flow = {k: float(v) for k, v in run.integrals.items()}
    (before, braids), (after, moved) = (
        call_compiled(_held, machine, state, z, dict(inputs))
        for state, z, inputs in ((begin, memory, first), (end, run.memory, last))
    )
    before, after = (_Held(*map(float, held)) for held in (before, after))
    more = _Held(*(b - a for a, b in zip(before, after, strict=True)))
    ambient = float(machine.environment.pressure_abs)
    got = StoredChange(
        gas=more.gas,
        gas_exergy=more.exergy,
        muscle=sum(stored_change(unit.law, _floats(braids[n]), _floats(moved[n])) for n, unit in machine.units.items()),
        tendon=more.tendon,
        load=more.load,
        friction=more.friction,
        dissipated=more.dissipated,
        # The atmosphere takes P0 dV of what the gas does in the muscles; other walls are moved from outside.
        lifted=ambient * more.muscles,
        swollen=ambient * more.room,
    )
    moving = got.tendon + got.load
    entered = flow["enthalpy"] + flow["heat"] + flow["shaft"] - (flow["work"] - flow["muscle_work"])
    # With closed valves no enthalpy crosses the border, and the work in the muscles is what there is.
    crossed = max(flow["enthalpy_turnover"], flow["exchanged"], LEAST)
    whole = got.gas + got.muscle + got.lifted + moving + got.friction - entered - flow["outside"] + flow["lost"]
    parts = exergy_balance(machine, flow, got)
    return Accounts(
        mass=abs(more.mass - flow["mass"]) / max(flow["mass_turnover"], before.mass),
        gas=abs(got.gas - entered + flow["muscle_work"]) / crossed,
        muscle=abs(got.muscle - flow["braid"] - flow["filling"]) / max(flow["exchanged"], LEAST),
        mechanics=abs(moving + got.friction - (flow["outside"] - flow["lost"] - flow["braid"]))
        / max(flow["exchanged"] + flow["outside_turnover"], LEAST),
        energy=abs(whole) / (crossed + flow["outside_turnover"]),
        friction=got.friction,
        dissipated=got.dissipated,
        exergy=abs(parts.exergy.remainder) / max(parts.exergy.throughput, LEAST),
        energy_parts=parts,
    )


class _Held(NamedTuple):
    """Contents of a machine in one state.

    Attributes:
        mass: mass of all gas [kg].
        gas: its internal energy [J].
        exergy: exergy of it [J].
        tendon: energy of end masses and tendons [J].
        load: energy of the load [J].
        friction: work that friction and creep took until then [J].
        dissipated: what they turned into heat of it [J].
        room: volume of all gas [m^3].
        muscles: volume of the braids [m^3].
    """

    mass: Any
    gas: Any
    exergy: Any
    tendon: Any
    load: Any
    friction: Any
    dissipated: Any
    room: Any
    muscles: Any


def _held(
    machine: Machine, state: Tree, memory: Tree, inputs: dict[str, Any]
) -> tuple[_Held, dict[str, tuple[Scalar, Scalar]]]:
    """Contents, and the length [m] and gauge pressure [Pa] of every braid."""
    motions, circuit, units = machine.motions(state, memory, inputs), state["circuit"], machine.units
    inputs_with_lengths = machine.with_lengths(state, memory, inputs)
    mass, energy = machine.joined.stored(circuit, inputs_with_lengths)
    tendon, load, friction = machine.mechanical_energies(state, memory, inputs)
    kept = [ledger for parts in memory["muscles"].values() for ledger in parts.values()]
    held = _Held(
        mass,
        energy,
        stored_exergy(machine.joined, circuit, inputs_with_lengths, machine.environment),
        tendon,
        load,
        friction,
        sum((ledger.dissipated for ledger in kept), jnp.zeros(())),
        sum(v.value for v in machine.joined.volumes(circuit, inputs_with_lengths).values()),
        sum(u.law.braid_volume(motions[n].length, machine.gauge(state, n)) for n, u in units.items()),
    )
    return held, {n: (motions[n].length, machine.gauge(state, n)) for n in units}


def _floats(braid: tuple[Scalar, Scalar]) -> tuple[float, float]:
    length, gauge = braid
    return float(length), float(gauge)
