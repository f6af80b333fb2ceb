"""Whether a machine's accounts close: end states against independent integrals, account by account and part by part.

Exergy is measured against the room. Its ledger ends where the load begins: what the muscles did there is ``shaft_work``, and
`Load` says result of it. Every part is an integral or a difference of end states; what is left is a remainder.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, Tree, jnp
from ..answers import brief
from ..documents import JsonValue
from ..engine import Run
from ..engine.native import call_compiled
from ..muscles.law import law_name, stored_change
from ..pneumatics.circuit import ROOM, DeadState, kind_of, lines_of, paths_of, stored_exergy
from ..pneumatics.volume import Chamber, Reservoir, WallHeat
from .machine import Machine

SAME = 1e-9  # share by which a reservoir's pressure may be off the room's


class StoredChange(NamedTuple):
    """Change of stored energies between end states [J]."""

    gas: float  # gain of internal energy of the gas
    gas_exergy: float  # gain of exergy of the gas
    muscle: float  # gain of elastic energy of bladder and braid
    tendon: float  # gain of energy of end masses and tendons
    load: float  # gain of energy of the load
    friction: float  # work taken up by friction and creep
    dissipated: float  # part of `friction` that became heat
    lifted: float  # work on the atmosphere by muscles that swell
    swollen: float  # work on the atmosphere by all volumes


class ExergyLedger(NamedTuple):
    """Exergy input, output and increase of storage, by name [J]; errors are relative to `throughput`."""

    into: dict[str, float]
    out: dict[str, float]
    stored: dict[str, float]
    throughput: float

    def __repr__(self) -> str:
        return brief(self)

    @property
    def remainder(self) -> float:
        """Input that no part accounts for [J]."""
        return sum(self.into.values()) - sum(self.out.values()) - sum(self.stored.values())

    def plus(self, other: ExergyLedger) -> ExergyLedger:
        """Return the sum of both ledgers."""
        into, out, stored = (
            {k: a.get(k, 0.0) + b.get(k, 0.0) for k in {**a, **b}}
            for a, b in ((self.into, other.into), (self.out, other.out), (self.stored, other.stored))
        )
        return ExergyLedger(into, out, stored, self.throughput + other.throughput)

    def document(self) -> dict[str, JsonValue]:
        """Ledger as a table of a recording's metadata."""
        return {**self._asdict(), "remainder": self.remainder}


@dataclass(frozen=True)
class ExergyBalance:
    """The accounts of a run in parts.

    Attributes:
        exergy: exergy of gas and muscles.
        energy: the same by the first law.
        load: what the muscles did to the load, and result of that.
        air: drawn from supplies [kg]; NaN if a signal gives a supply's pressure.
        compressor: least work to compress that air from the room, cooled (``isothermal``) or not (``adiabatic``) [J].
    """

    exergy: ExergyLedger
    energy: ExergyLedger
    load: ExergyLedger
    air: float
    compressor: Mapping[str, float]

    __repr__ = brief

    def plus(self, other: ExergyBalance) -> ExergyBalance:
        """Return the sum of both balances."""
        work = {k: v + other.compressor[k] for k, v in self.compressor.items()}
        ledgers = self.exergy.plus(other.exergy), self.energy.plus(other.energy), self.load.plus(other.load)
        return ExergyBalance(*ledgers, self.air + other.air, work)


def exergy_balance(machine: Machine, flow: Mapping[str, float], got: StoredChange) -> ExergyBalance:
    """The parts from the integrals of a run, as `Machine.integrands` names them, and from its end states."""
    load = ExergyLedger(
        {"shaft_work": flow["delivered"], "outside": flow["outside"]},
        {"load_losses": flow["lost"] - flow["viscous"]},
        {"load": got.load},
        max(flow["outside_turnover"], flow["exchanged"]),
    )
    muscle = {
        "out": {"friction": got.dissipated, "viscous": flow["viscous"], "shaft_work": flow["delivered"]},
        "stored": {"muscle": got.muscle, "friction": got.friction - got.dissipated, "tendon": got.tendon},
    }
    turnover, walls = flow["enthalpy_turnover"], {"other_walls": flow["work"] - flow["muscle_work"]}
    energy = ExergyLedger(
        {"enthalpy": 0.5 * (turnover + flow["enthalpy"]), "heat": flow["heat"], "machines": flow["shaft"]},
        {"enthalpy": 0.5 * (turnover - flow["enthalpy"]), "atmosphere": got.lifted, **walls, **muscle["out"]},
        {"gas": got.gas, **muscle["stored"]},
        max(turnover, flow["exchanged"]),
    )
    air, compressor = _supplies(machine, flow)
    return ExergyBalance(_exergy(machine, flow, got, muscle), energy, load, air, compressor)


def _exergy(machine: Machine, flow: Mapping[str, float], got: StoredChange, muscle: Mapping[str, Any]) -> ExergyLedger:
    # Temperature that all walls have [K], None if they differ
    heats = [node.heat for node in machine.circuit.nodes.values() if isinstance(node, Chamber)]
    temperatures = {float(h.wall_temperature) for h in heats if isinstance(h, WallHeat)}
    wall = temperatures.pop() if len(temperatures) == 1 else None
    walls = 0.0 if wall is None else flow["heat"] * (1.0 - float(machine.environment.temperature) / wall)
    into = {"supply": 0.0, "machines": flow["shaft"], "walls": walls}
    lost = dict.fromkeys(("valve", "tube", "dead_volume", "exhaust", "leak", "machine"), 0.0)
    for name, value in flow.items():
        what, _, role = name.partition(".")
        kind, _, border = role.partition(".")
        to_room = bool(border) and is_room(machine, border)
        where = kind if kind in ("tube", "leak", "machine") else "exhaust" if to_room else "valve"
        if what in ("throttled", "thrown"):
            lost[where] += value
        elif what == "entered" and to_room:  # of a room that is not called so
            lost[where] -= value
        elif what == "entered":
            into["supply"] += value
        elif what == "idle":
            lost["dead_volume"] += value
            lost[where] -= value
        if name == f"thrown.machine.{ROOM}":  # its shaft's power is in what the gas has when it arrives
            lost[where] += flow["shaft"]
    # what passed the border both ways, as it is counted for the enthalpy
    crossed = sum(abs(v) for v in (*into.values(), lost["exhaust"], lost["dead_volume"], lost["leak"]))
    gas = {
        "mixing": flow["mixed"],
        "heat": walls - flow["heat_worth"],
        "other_walls": flow["work"] - flow["muscle_work"] - (got.swollen - got.lifted),
    }
    return ExergyLedger(
        into,
        {**lost, **gas, **muscle["out"]},
        {"gas": got.gas_exergy, **muscle["stored"]},
        max(crossed, flow["exchanged"]),
    )


def is_room(machine: Machine, node: str) -> bool:
    """Whether a node is the ambient air."""
    reservoir = machine.circuit.nodes[node]
    if not isinstance(reservoir, Reservoir) or reservoir.signal is not None:
        return False
    return bool(abs(float(reservoir.pressure_abs / machine.environment.pressure_abs) - 1.0) < SAME)


def _supplies(machine: Machine, flow: Mapping[str, float]) -> tuple[float, dict[str, float]]:
    """Air that was drawn [kg], and the work of compressing it [J]."""
    dead = DeadState.of(machine.circuit.gas, machine.environment)
    air, work = 0.0, {"isothermal": 0.0, "adiabatic": 0.0}
    for name, entered in flow.items():
        end = name.partition(".")[2].partition(".")[2]
        if name.startswith("entered.") and not is_room(machine, end):
            node = machine.circuit.nodes[end]
            assert isinstance(node, Reservoir)
            worth, isothermal, adiabatic = map(float, call_compiled(_worth, dead, node.pressure_abs, node.temperature))
            mass = np.nan if node.signal else entered / worth
            air += mass
            work["isothermal"] += mass * isothermal
            work["adiabatic"] += mass * adiabatic
    return air, work


def _worth(dead: DeadState, pressure_abs: Scalar, temperature: Scalar) -> tuple[Scalar, ...]:
    """Exergy of a supply's gas, and the least work to compress it isothermally and adiabatically [J/kg]."""
    compression = (dead.compression(pressure_abs, cooled=cooled) for cooled in (True, False))
    return dead.flowing(dead.see(pressure_abs, temperature)), *compression


def document(machine: Machine, parts: Sequence[ExergyBalance]) -> dict[str, JsonValue]:
    """Balances as tables of a recording's metadata, with what is needed to find the parts again in its channels.

    Args:
        machine: the last one.
        parts: parts of the run.
    """
    whole, circuit = parts[0], machine.circuit
    for other in parts[1:]:
        whole = whole.plus(other)
    nodes = {
        n: "chamber" if not isinstance(v, Reservoir) else "room" if is_room(machine, n) else "supply"
        for n, v in circuit.nodes.items()
    }
    return {
        "exergy": whole.exergy.document(),
        "energy": whole.energy.document(),
        "load": whole.load.document(),
        "air": whole.air,
        "compressor": dict(whole.compressor),
        "paths": {n: [kind_of(circuit.elements[e]), *ends] for n, (e, ends) in paths_of(circuit).items()},
        "lines": [sorted(line) for line in lines_of(circuit)],
        "nodes": nodes,
        "laws": {name: law_name(unit.law) for name, unit in machine.units.items()},
    }


# ---- whether the accounts close


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
    """Contents of a machine in one state."""

    mass: Any  # mass of all gas [kg]
    gas: Any  # its internal energy [J]
    exergy: Any  # exergy of it [J]
    tendon: Any  # energy of end masses and tendons [J]
    load: Any  # energy of the load [J]
    friction: Any  # work that friction and creep took until then [J]
    dissipated: Any  # what they turned into heat of it [J]
    room: Any  # volume of all gas [m^3]
    muscles: Any  # volume of the braids [m^3]


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
