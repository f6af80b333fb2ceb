"""The muscle of a working cycle, with one of two gas volumes.

    paper       V(L) of eq. 38b at every pressure, tension of eq. 12 with its sharp threshold
    potential   V(L, P') and tension of the law's own potential, dF/dP' = -dV/dL everywhere

With the first, a cycle that passes below the threshold loses (P_th - P_x) times the change of volume without a trace, where
P_x is the gauge pressure that it returns to. The paper's numbers rest on it, and it is kept for them. Both leave out the
stop at the end of the stroke and the threads that hold beyond it, which eq. 13 does not have: an isotonic load between the
tensions of a cycle that begins in the stop would be a load on that spring.
"""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import Any

import numpy as np

from ..._jax import jnp
from ...components import Module, Scalar, derivative, jit_arrays
from ...components.programs import evaluated
from ...errors import InputError, NoVolumeError
from ...muscles.law import TensionLaw, law_name
from ...muscles.laws.gas_spring import spring_volume

VOLUMES = ("paper", "potential")
_LINE = ("stiffness_per_pressure", "shortest_length", "rest_length", "rest_volume")


class CycleMuscle(Module):
    """Signed tension of the braid and volume of its gas; elementwise in length [m] and gauge pressure [Pa]."""

    law: TensionLaw

    @abc.abstractmethod
    def tension(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Tension inside the braid, without friction [N]."""

    @abc.abstractmethod
    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Integral of the volume over the gauge pressure, up to a function of the length [J]."""

    @abc.abstractmethod
    def volume(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas volume [m^3]."""

    def threshold(self) -> Scalar:
        """Gauge pressure from which the gas pulls, zero for a law without one [Pa]."""
        return jnp.asarray(getattr(self.law, "threshold_pressure", 0.0), float)

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Shortest braid length in which an end of a stroke is sought, and the longest that the law is made for [m]."""
        return self.law.length_range()


class PaperMuscle(CycleMuscle):
    """Eq. 12 with the volume of eq. 38b, as printed."""

    def volume(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Eq. 38b, whatever the pressure [m^3]."""
        return self._line(length) + 0.0 * pressure

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Pressure times volume [J]."""
        return self._line(length) * pressure

    def tension(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Eqs. 12a and 12b, the slope of the volume taken from eq. 38b (eq. 36) [N]."""
        length, pressure = jnp.broadcast_arrays(jnp.asarray(length, float), jnp.asarray(pressure, float))
        above = jnp.where(pressure > self.threshold(), pressure - self.threshold(), 0.0)
        return self.law.elastic_tension(length) - above * derivative(self._line, length)

    def _line(self, length: Scalar) -> Scalar:
        law: Any = self.law
        return spring_volume(
            length,
            rest_length=law.rest_length,
            rest_volume=law.rest_volume,
            shortest_length=law.shortest_length,
            per_pressure=law.stiffness_per_pressure,
        )


class PotentialMuscle(CycleMuscle):
    """Any law with its own volume: its formulas themselves, whose threads do not hold where a cycle stretches it further."""

    def volume(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Volume of the law [m^3]."""
        length, pressure = jnp.broadcast_arrays(jnp.asarray(length, float), jnp.asarray(pressure, float))
        return derivative(lambda p: self.law.gas_energy(length, p), pressure)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy of the law [J]."""
        length, pressure = jnp.broadcast_arrays(jnp.asarray(length, float), jnp.asarray(pressure, float))
        return self.law.gas_energy(length, pressure)

    def tension(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Tension of the law [N]."""
        length, pressure = jnp.broadcast_arrays(jnp.asarray(length, float), jnp.asarray(pressure, float))
        return self.law.elastic_tension(length) - derivative(lambda x: self.law.gas_energy(x, pressure), length)


def has_paper_volume(law: TensionLaw) -> bool:
    """Whether eq. 38b can be written with the parameters of a law."""
    return all(hasattr(law, name) for name in _LINE)


def cycle_muscle(law: TensionLaw, volume: str = "potential") -> CycleMuscle:
    """A law as the muscle of a working cycle.

    Args:
        law: with a volume.
        volume: ``paper`` or ``potential``.

    Raises:
        NoVolumeError: if the law knows only how its volume changes.
        InputError: if the name is unknown, or the law does not have the parameters of eq. 38b.
    """
    if volume not in VOLUMES:
        raise InputError("volume", volume, known=VOLUMES)
    if volume == "paper" and not has_paper_volume(law):
        raise InputError(
            "volume", volume, f"must be potential for the law '{law_name(law)}'; eq. 38b is not written for it"
        )
    if not law.has_volume():
        raise NoVolumeError(
            f"the law '{law_name(law)}' knows how the volume changes but not how large it is, so the work of the "
            "compressor is not known; state its rest_volume"
        )
    bare = law.replace(stop_stiffness=0.0) if hasattr(law, "stop_stiffness") else law
    return PaperMuscle(bare) if volume == "paper" else PotentialMuscle(bare)


# ---- in numbers


class Probe:
    """A muscle in plain arrays; length [m] and gauge pressure [Pa] broadcast."""

    def __init__(self, muscle: CycleMuscle) -> None:
        self.muscle = muscle

    def tension(self, length: Scalar, pressure: Scalar) -> np.ndarray:
        """Tension inside the braid, without friction [N]."""
        return np.asarray(self._ask(_tension, length, pressure))

    def volume(self, length: Scalar, pressure: Scalar) -> np.ndarray:
        """Gas volume [m^3]."""
        return np.asarray(self._ask(_gas, length, pressure)[0])

    def gas_energy(self, length: Scalar, pressure: Scalar) -> np.ndarray:
        """Integral of the volume over the gauge pressure [J]."""
        return np.asarray(self._ask(_gas, length, pressure)[1])

    def slopes(self, length: Scalar, pressure: Scalar) -> list[np.ndarray]:
        """Slope of the tension by length and by pressure, and of the volume by length and by pressure [SI]."""
        return list(map(np.asarray, self._ask(_slopes, length, pressure)))

    def _ask(self, function: Callable[..., Any], length: Scalar, pressure: Scalar) -> Any:
        return function(self.muscle, np.asarray(length, float), np.asarray(pressure, float))


@evaluated
@jit_arrays
def _tension(muscle: CycleMuscle, length: Scalar, pressure: Scalar) -> Scalar:
    return muscle.tension(length, pressure)


@evaluated
@jit_arrays
def _gas(muscle: CycleMuscle, length: Scalar, pressure: Scalar) -> tuple[Scalar, Scalar]:
    return muscle.volume(length, pressure), muscle.gas_energy(length, pressure)


@evaluated
@jit_arrays
def _slopes(muscle: CycleMuscle, length: Scalar, pressure: Scalar) -> tuple[Scalar, ...]:
    by_length = [derivative(lambda x: f(x, pressure), length) for f in (muscle.tension, muscle.volume)]  # noqa: B023
    by_pressure = [derivative(lambda p: f(length, p), pressure) for f in (muscle.tension, muscle.volume)]  # noqa: B023
    return by_length[0], by_pressure[0], by_length[1], by_pressure[1]
