"""Whether a machine's accounts close: end states against independent integrals, account by account."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..engine import Run
from ..pneumatics.circuit import balance
from .machine import Machine

# Nodes of the quadrature of a law's elastic tension over a piece of length; its kinks are parabolas, met within 1e-8.
NODES, PIECES = 8, 256


class Accounts(NamedTuple):
    """What is missing in each account, over what went through; zero is perfect.

    Attributes:
        mass: of gas, over the mass that crossed the border.
        gas: energy of the gas, over the enthalpy that crossed the border.
        muscle: energy stored in bladder and braid, over the work exchanged.
        mechanics: kinetic, elastic and frictional energy, over the work exchanged.
        energy: of the whole, over the enthalpy that crossed the border.
        friction: work that friction and creep took [J], as their own ledger says.
    """

    mass: float
    gas: float
    muscle: float
    mechanics: float
    energy: float
    friction: float


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
    state, _ = start
    end, integrals = run.state, {k: float(v) for k, v in run.integrals.items()}
    seen = [machine.with_lengths(s, i) for s, i in ((state, first), (end, last))]
    gas = balance(machine.circuit, state["circuit"], end["circuit"], seen[0], seen[1], run.integrals)
    stored = sum(_muscle_energy(machine, name, state, end) for name in machine.units)
    exchanged = max(abs(integrals["braid"]), abs(integrals["filling"]), 1e-12)
    muscle = stored - integrals["braid"] - integrals["filling"]
    taken = sum(float(led.work) for parts in run.memory["muscles"].values() for led in parts.values())
    moving = _mechanical(machine, end, last) - _mechanical(machine, state, first)
    mechanics = moving + taken - (integrals["outside"] - integrals["lost"] - integrals["braid"])
    # The atmosphere takes P0 dV of what the gas gives; the muscle and its load get the rest.
    turnover = max(integrals["enthalpy_turnover"], 1e-30)
    signed = _signed(machine, state["circuit"], end["circuit"], seen, integrals)
    return Accounts(
        mass=gas.mass,
        gas=gas.energy,
        muscle=abs(muscle) / exchanged,
        mechanics=abs(mechanics) / max(exchanged, abs(integrals["outside"])),
        energy=abs(signed + muscle + mechanics) / turnover,
        friction=taken,
    )


def _signed(machine: Machine, start: Any, end: Any, seen: list[Any], integrals: Mapping[str, float]) -> float:
    """What the gas's account lacks, with its sign [J]."""
    (_, before), (_, after) = (machine.circuit.stored(s, i) for s, i in zip((start, end), seen, strict=True))
    entered = integrals["enthalpy"] + integrals["heat"] + integrals["shaft"] - integrals["work"]
    return float(after - before - entered)


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
