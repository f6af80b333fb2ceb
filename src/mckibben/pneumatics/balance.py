"""Whether the gas of a run is all there: end states against independent integrals over the border of its circuit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from .._jax import Scalar, Tree
from .circuit import Circuit

LEAST = 1e-6  # of what is stored


class RunBalance(NamedTuple):
    """Errors of the balances of a run, relative to the throughput; zero is perfect.

    Where next to nothing went through, it is over `LEAST` of what is stored, so that a circuit at rest shows the rounding
    of its stored energy and not a ratio of two roundings.
    """

    mass: float
    energy: float


def balance(
    circuit: Circuit, start: Scalar, end: Scalar, first: Tree, last: Tree, integrals: Mapping[str, Scalar]
) -> RunBalance:
    """Compare stored mass and energy of the end states with independent integrals over the border.

    Args:
        circuit: the circuit that was run.
        start: state at the start.
        end: state at the end.
        first: inputs at the start.
        last: inputs at the end.
        integrals: as `Circuit.integrands` names them, integrated over the run.
    """
    (m0, u0), (m1, u1) = (map(float, circuit.stored(*at)) for at in ((start, first), (end, last)))
    entered = float(integrals["enthalpy"]) + float(integrals["heat"]) - float(integrals["work"])
    entered += float(integrals["shaft"])
    mass = abs(m1 - m0 - float(integrals["mass"])) / max(float(integrals["mass_turnover"]), LEAST * abs(m1), 1e-30)
    energy = abs(u1 - u0 - entered) / max(float(integrals["enthalpy_turnover"]), LEAST * abs(u1), 1e-30)
    return RunBalance(mass, energy)
