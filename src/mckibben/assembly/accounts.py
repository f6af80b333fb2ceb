"""Whether a machine's accounts close: end states against independent integrals, account by account."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..engine import Run
from .machine import Machine

# Nodes of the quadrature of a law's elastic tension over a piece of length; its kinks are parabolas, met within 1e-8.
NODES, PIECES = 8, 256
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
    """

    mass: float
    gas: float
    muscle: float
    mechanics: float
    energy: float
    friction: float
    dissipated: float


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
    circuit, (begin, memory), end = machine.joined, start, run.state
    flow = {k: float(v) for k, v in run.integrals.items()}
    seen = [machine.with_lengths(s, i) for s, i in ((begin, first), (end, last))]
    (mass, before), (mass_after, after) = (
        circuit.stored(s["circuit"], i) for s, i in zip((begin, end), seen, strict=True)
    )
    stored = sum(_muscle_energy(machine, name, begin, end) for name in machine.units)
    taken, dissipated = (_ledger(run.memory, what) - _ledger(memory, what) for what in ("work", "dissipated"))
    moving = _mechanical(machine, end, last) - _mechanical(machine, begin, first)
    # The atmosphere takes P0 dV of what the gas does in the muscles; other walls are moved from outside.
    lifted = sum(_atmosphere(machine, name, begin, end) for name in machine.units)
    entered = flow["enthalpy"] + flow["heat"] + flow["shaft"] - (flow["work"] - flow["muscle_work"])
    # With closed valves no enthalpy crosses the border, and the work in the muscles is what there is.
    crossed = max(flow["enthalpy_turnover"], flow["exchanged"], LEAST)
    whole = float(after - before) + stored + lifted + moving + taken - entered - flow["outside"] + flow["lost"]
    return Accounts(
        mass=abs(mass_after - mass - flow["mass"]) / max(flow["mass_turnover"], mass),
        gas=abs(float(after - before) - entered + flow["muscle_work"]) / crossed,
        muscle=abs(stored - flow["braid"] - flow["filling"]) / max(flow["exchanged"], LEAST),
        mechanics=abs(moving + taken - (flow["outside"] - flow["lost"] - flow["braid"]))
        / max(flow["exchanged"] + flow["outside_turnover"], LEAST),
        energy=abs(whole) / (crossed + flow["outside_turnover"]),
        friction=taken,
        dissipated=dissipated,
    )


def _ledger(memory: Any, what: str) -> float:
    return sum(float(getattr(led, what)) for parts in memory["muscles"].values() for led in parts.values())


def _atmosphere(machine: Machine, name: str, start: Any, end: Any) -> float:
    """Work done on the surroundings by a muscle that swells [J]."""
    law = machine.units[name].law
    v0, v1 = (float(law.braid_volume(s["muscles"][name].length, machine.gauge(s, name))) for s in (start, end))
    return float(machine.environment.pressure_abs) * (v1 - v0)


def _muscle_energy(machine: Machine, name: str, start: Any, end: Any) -> float:
    """Gain of the energy stored in bladder and braid, E(L) + P' V - integral of V dP' [J]."""
    law = machine.units[name].law
    ambient = float(machine.environment.pressure_abs)
    (l0, p0), (l1, p1) = (
        (float(s["muscles"][name].length), float(s["circuit"]["pressure"][name]) - ambient) for s in (start, end)
    )
    edges = np.linspace(l0, l1, PIECES + 1)
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    half = 0.5 * np.diff(edges)
    at = 0.5 * (edges[1:] + edges[:-1])[:, None] + half[:, None] * nodes
    elastic = float(np.sum(half[:, None] * weights * np.asarray(law.elastic_tension(at))))

    def gas(length: float, pressure: float) -> float:
        return float(pressure * law.braid_volume(length, pressure) - law.gas_energy(length, pressure))

    return elastic + gas(l1, p1) - gas(l0, p0)


def _mechanical(machine: Machine, state: Any, inputs: Mapping[str, Any]) -> float:
    """Energy of end masses, tendons and load [J]."""
    spans = machine.load.spans(state["load"], inputs)
    own = sum(float(u.kinetic_and_elastic(state["muscles"][n], spans[n].span)) for n, u in machine.units.items())
    return own + float(machine.load.stored_energy(state["load"]))
