"""Interface of tension laws: two formulas, from which tension, volume, stiffness and free length follow for all laws.

A law gives the tension of the empty braid, ``elastic_tension(L)``, and the gas energy ``gas_energy(L, P')``. Then

    F = elastic_tension - d gas_energy/dL          V = d gas_energy/dP'

so that dF/dP' = -dV/dL everywhere and no closed cycle yields work. A braid cannot push: seen from its anchors, the muscle
pulls with max(F, 0), and where F would be negative it hangs slack at its free length.

Outside of its range of lengths no formula is asked. There the threads hold: pulled straight they get hardly longer, and side
by side they let the braid get no shorter. See `threads`: the law goes on from one potential, continuously differentiable,
its tension rises with the threads' stiffness, and its gas is not squeezed out any further. Within the range
F and V are those of the law to the last bit; beyond it they are those of threads that hold, and no measured muscle's.
"""

from __future__ import annotations

import abc
import dataclasses
import inspect
import math
from typing import Any, ClassVar, NamedTuple

import numpy as np

from .._jax import Array, Scalar, jax, jnp
from ..components import Module, derivative
from ..components.programs import evaluated
from ..errors import InputError, NoVolumeError, UnreachableError
from ..quantities import declared, quantity, with_unit
from ..registry import registered_name
from . import threads
from .plausible import HIGHEST_PRESSURE

# A seventh of the 3.5 % at which aramid yarn breaks (Teijin, Tensile properties of Technora, table 3).
THREAD_STRAIN = 0.005
LOOKS, HALVINGS = 1000, 40  # of `pressures_for`: pieces in which a crossing is sought, and halvings of that piece
PUSHES = 1e-13  # of its free length, by which a braid is shorter where the slope of that length is taken
LEAST_PULL = 1.0  # of a law that hardly pulls there, so that its threads hold too [N]


class LawState(NamedTuple):
    """State of a law at one span and pressure; arrays broadcast alike."""

    tension: Scalar  # [N], >= 0
    passive: Scalar  # [N], signed, without gas
    active: Scalar  # [N], signed, due to the gas
    volume: Scalar  # [m^3], NaN where the law has none
    stiffness: Scalar  # [N/m], zero when slack
    braid_length: Scalar  # [m], the span when taut, the free length when slack
    slack: Scalar  # bool, never together with overstretched
    overstretched: Scalar  # bool; longer than the law is made for, the threads hold


class TensionLaw(Module):
    """A static tension law F(L, P') of one muscle; elementwise in length [m] and gauge pressure [Pa].

    A law of your own states the tension of its walls and the energy of its gas; tension, volume, stiffness and free
    length follow from these two.

    Examples:
        >>> import mckibben as mk
        >>> class GasSpring(mk.TensionLaw):
        ...     title, cites, fitted = "gas spring", (), ("gain",)
        ...     gain = mk.quantity("m", (0.0, 1.0), "force per pressure and length")
        ...     shortest = mk.quantity("m", (1e-3, 10.0), "length without pull")
        ...     def elastic_tension(self, length):
        ...         return 0.0 * length
        ...     def gas_energy(self, length, pressure):
        ...         return -0.5 * pressure * self.gain * (length - self.shortest) ** 2
        ...     def length_range(self):
        ...         return self.shortest, 2.0 * self.shortest
        >>> round(float(GasSpring(gain=0.004, shortest=0.1).tension(0.12, 5e5)), 3)
        40.0
    """

    title: ClassVar[str]
    cites: ClassVar[tuple[str, ...]]
    # Whether the law holds for the same muscle cut to another rest length, with each parameter as its `along` says.
    any_length: ClassVar[bool] = False
    # What an identification frees unless told otherwise; all other fields must be known.
    fitted: ClassVar[tuple[str, ...]]
    # A dimension that may be unknown: it is then fitted, in place of parameters that the data could no longer tell from it.
    fitted_if_unknown: ClassVar[dict[str, tuple[str, ...]]] = {}
    # Parameters that stay at their default where tension was measured at fewer lengths than this.
    lengths_needed: ClassVar[dict[str, int]] = {}
    # Parameters of one muscle alone, such as the error of its ruler: at their default where muscles differ in rest length.
    of_one_muscle: ClassVar[tuple[str, ...]] = ()
    # Gaussian priors of fitted parameters, mean and standard deviation [SI], for what one table cannot tell.
    priors: ClassVar[dict[str, tuple[float, float]]] = {}

    thread_strain: Scalar = quantity(
        "1",
        (1e-4, 0.02),
        "strain of the threads under the tension at the longest length and 10 bar",
        symbol="e",
        default=THREAD_STRAIN,
    )

    def __init_subclass__(cls, **options: object) -> None:
        """Refuse parameters that hide what every law has; see `Module`."""
        for name, value in vars(cls).items():
            if isinstance(value, dataclasses.Field) and hasattr(TensionLaw, name):
                said = f"{cls.__name__}.{name} hides what every law has of that name; choose another, as wall_{name}"
                raise InputError(name, "a parameter", "must have another name", sentence=said)
        super().__init_subclass__(**options)

    @abc.abstractmethod
    def elastic_tension(self, length: Scalar) -> Scalar:
        """Tension of the braid without gas [N]; negative where it resists shortening."""

    @abc.abstractmethod
    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Integral of the gas volume over the gauge pressure [J]."""

    @abc.abstractmethod
    def length_range(self) -> tuple[Scalar, Scalar]:
        """Shortest and longest braid length that the formulas are made for [m]; beyond the longest it is overstretched.

        They are asked up to 1.6 e of the longest length beyond, 0.8 % by default, and never further, see `threads`.
        """

    def has_volume(self) -> bool:
        """Whether the law determines the volume itself and not only its change."""
        return True

    # ---- the braid: signed forces at its own length

    @evaluated
    def passive_tension(self, length: Scalar) -> Scalar:
        """The part of the braid's force that is there without gas: wall, and threads beyond the range [N]."""
        at = _within(self, length)
        return at.share * self.elastic_tension(at.length) + self.thread_stiffness() * at.stretch

    @evaluated
    def active_tension(self, length: Scalar, pressure: Scalar) -> Scalar:
        """The part of the braid's force that the gas causes [N]."""
        length, pressure = _together(length, pressure)
        at = _within(self, length)
        return at.share * _active(self, at.length, pressure)

    @evaluated
    def braid_tension(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Signed force of the braid [N]; what a fit and an equation of motion use."""
        length, pressure = _together(length, pressure)
        at = _within(self, length)
        return at.share * self.formula_tension(at.length, pressure) + self.thread_stiffness() * at.stretch

    @evaluated
    def braid_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Integral of the braid's gas volume over the gauge pressure [J]; within the range it is `gas_energy`."""
        length, pressure = _together(length, pressure)
        return self.gas_energy(_within(self, length).length, pressure)

    @evaluated
    def braid_volume(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas volume at a braid length [m^3]; up to a constant where `has_volume` is false."""
        length, pressure = _together(length, pressure)
        return _volume(self, _within(self, length).length, pressure)

    @evaluated
    def braid_stiffness(self, length: Scalar, pressure: Scalar) -> Scalar:
        """D braid_tension / dL at constant pressure [N/m]."""
        length, pressure = _together(length, pressure)
        return derivative(lambda x: self.braid_tension(x, pressure), length)

    def thread_stiffness(self) -> Scalar:
        """Stiffness of the threads beyond the range [N/m]: tension at the longest length and 10 bar over their stretch."""
        longest = jnp.asarray(self.length_range()[1], float)
        full = self.formula_tension(longest, jnp.full_like(longest, HIGHEST_PRESSURE))
        return jnp.maximum(full, LEAST_PULL) / (self.thread_strain * longest)

    def formula_tension(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Signed force of walls and gas as the formulas give it, threads left out [N]; one that is costly is asked once."""
        return self.elastic_tension(length) + _active(self, length, pressure)

    # ---- the muscle between its anchors: unilateral

    @evaluated
    def tension(self, span: Scalar, pressure: Scalar) -> Scalar:
        """Tension on the anchors [N], never negative."""
        force = self.braid_tension(span, pressure)
        return jnp.where(force <= 0.0, 0.0, force)  # what is no number stays none

    @evaluated
    def volume(self, span: Scalar, pressure: Scalar) -> Scalar:
        """Gas volume [m^3], with the braid at its free length when slack.

        Raises:
            NoVolumeError: if the law knows only how the volume changes.
        """
        if not self.has_volume():
            raise NoVolumeError(f"the law '{law_name(self)}' knows how the volume changes but not how large it is")
        span, pressure = _together(span, pressure)
        return self.braid_volume(self._braid_length(span, pressure), pressure)

    @evaluated
    def volume_change(self, span: Scalar, pressure: Scalar) -> Scalar:
        """dV/dL at constant pressure [m^2]; known for every law, zero when slack."""
        span, pressure = _together(span, pressure)
        slack = self.braid_tension(span, pressure) <= 0.0
        return jnp.where(slack, 0.0, derivative(lambda x: self.braid_volume(x, pressure), span))

    @evaluated
    def stiffness(self, span: Scalar, pressure: Scalar) -> Scalar:
        """dF/dL at constant pressure [N/m], zero when slack."""
        slack = self.braid_tension(span, pressure) <= 0.0
        return jnp.where(slack, 0.0, self.braid_stiffness(span, pressure))

    @evaluated
    def state(self, span: Scalar, pressure: Scalar) -> LawState:
        """Evaluate the complete state."""
        span, pressure = _together(span, pressure)
        passive, active = self.passive_tension(span), self.active_tension(span, pressure)
        force = self.braid_tension(span, pressure)  # the sum of both, to rounding
        slack, overstretched = force <= 0.0, self.overstretched(span)
        braid_length = self._braid_length(span, pressure)
        volume = self.braid_volume(braid_length, pressure) if self.has_volume() else jnp.full_like(passive, jnp.nan)
        return LawState(
            tension=jnp.where(slack, 0.0, force),
            passive=passive,
            active=active,
            volume=volume,
            stiffness=self.stiffness(span, pressure),
            braid_length=jnp.where(overstretched, span, braid_length),
            slack=slack & ~overstretched,
            overstretched=overstretched,
        )

    def overstretched(self, span: Scalar) -> Array:
        """Whether the span lies beyond the longest braid length that the law is made for."""
        return jnp.asarray(span, float) > self.length_range()[1]

    @evaluated
    def free_length(self, pressure: Scalar) -> Scalar:
        """Length at which the unloaded muscle settles [m], within `length_range` and what its threads yield beyond."""
        pressure = jnp.asarray(pressure, float)
        shortest, longest = self.length_range()
        yielding = threads.REACH * threads.travel(self.thread_strain, longest)
        low, high = (
            jnp.broadcast_to(end, jnp.broadcast_shapes(pressure.shape, jnp.shape(end)))
            for end in (shortest - yielding, longest + yielding)
        )
        pressure = jnp.broadcast_to(pressure, low.shape)

        def halve(_: int, ends: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
            middle = 0.5 * (ends[0] + ends[1])
            pulls = self.braid_tension(middle, pressure) > 0.0
            return jnp.where(pulls, ends[0], middle), jnp.where(pulls, middle, ends[1])

        # 60 halvings reach the last bit; the Newton step after them carries the derivative by the implicit function. It
        # begins where the braid pushes: ends that settle with the root of the load have no stiffness where they begin to.
        found = jax.lax.stop_gradient(sum(jax.lax.fori_loop(0, 60, halve, jax.lax.stop_gradient((low, high)))) * 0.5)
        start = (1.0 - PUSHES) * found
        force, stiffness = jax.jvp(lambda x: self.braid_tension(x, pressure), (start,), (jnp.ones_like(start),))
        stiffness = jax.lax.stop_gradient(stiffness)
        inside = (start > low) & (start < high) & (stiffness > 0.0) & (jnp.abs(force) < 1e-6 * stiffness * start)
        length: Scalar = jnp.where(inside, start - force / jnp.where(inside, stiffness, 1.0), found)
        return jnp.where(jnp.isnan(pressure), jnp.nan, length)

    def pressure_for(self, tension: float, span: float, *, highest: float = 10e5) -> float:
        """The lowest gauge pressure [Pa] from zero up to `highest` at which the muscle pulls with a tension.

        Args:
            tension: wanted tension [N], not negative.
            span: distance between the anchors [m].
            highest: where the search ends [Pa].

        Raises:
            UnreachableError: if no pressure in that range gives the tension; the sentence says what the range gives.
        """
        if not (math.isfinite(tension) and tension >= 0.0):
            raise InputError("tension", None, f"must be 0 N or more, got {tension:.6g} N")
        for name, value, unit in (("span", span, "m"), ("highest", highest, "Pa")):
            if not math.isfinite(value):
                raise InputError(name, None, f"must be a number, got {value} {unit}")
        found = float(self.pressures_for(float(tension), float(span), float(highest)))
        if math.isfinite(found):
            return found
        pulls = np.asarray(self.tension(float(span), np.linspace(0.0, highest, LOOKS + 1)))
        raise UnreachableError(
            f"{tension:.4g} N at {with_unit(float(span), 'm')} is not reached between 0 and "
            f"{with_unit(highest, 'Pa')}: the muscle pulls with {pulls.min():.4g} to {pulls.max():.4g} N there"
        )

    @evaluated
    def pressures_for(self, tension: Scalar, span: Scalar, highest: Scalar = HIGHEST_PRESSURE) -> Scalar:
        """The lowest gauge pressures [Pa] from zero up to `highest` that give tensions, of arrays at once.

        Differentiable by all arguments. Two crossings within a thousandth of the range count as none; `pressure_for` says
        why there is no answer.

        Args:
            tension: wanted tensions [N], not negative.
            span: distances between the anchors [m].
            highest: where the search ends [Pa].

        Returns:
            Elementwise; NaN where no pressure in that range gives the tension.
        """
        tension, span = _together(tension, span)
        fixed = jax.lax.stop_gradient(tension)
        step = jnp.broadcast_to(jax.lax.stop_gradient(jnp.asarray(highest, float)) / LOOKS, jnp.shape(tension))
        law, at = jax.lax.stop_gradient((self, span))
        begin = law.tension(at, jnp.zeros_like(at)) - fixed

        def look(i: Any, carry: tuple[Scalar, Scalar, Scalar]) -> tuple[Scalar, Scalar, Scalar]:
            low, before, found = carry
            now = law.tension(at, step * (i + 1.0)) - fixed
            crosses = ((before < 0.0) & (now >= 0.0)) | ((before > 0.0) & (now <= 0.0)) | (before == 0.0)
            new = crosses & (found == 0.0)
            return jnp.where(new, step * i, low), now, jnp.where(new, 1.0, found)

        low, _, found = jax.lax.fori_loop(0, LOOKS, look, (jnp.zeros_like(at), begin, jnp.zeros_like(at)))
        first = law.tension(at, low) - fixed
        sign = jnp.where(first <= 0.0, 1.0, -1.0)

        def halve(_: int, ends: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
            middle = 0.5 * (ends[0] + ends[1])
            above = sign * (law.tension(at, middle) - fixed) >= 0.0
            return jnp.where(above, ends[0], middle), jnp.where(above, middle, ends[1])

        # halvings to the last bits; the Newton step after them carries the derivative by the implicit function
        halved = jax.lax.fori_loop(0, HALVINGS, halve, (low, low + step))[1]
        start = jax.lax.stop_gradient(jnp.where(first == 0.0, low, halved))
        force, slope = jax.jvp(lambda p: self.tension(span, p), (start,), (jnp.ones_like(start),))
        slope = jax.lax.stop_gradient(slope)
        move = jnp.where(slope != 0.0, (force - tension) / jnp.where(slope != 0.0, slope, 1.0), 0.0)
        return jnp.where(found > 0.0, jnp.maximum(start - jnp.where(jnp.abs(move) < 1.0, move, 0.0), 0.0), jnp.nan)

    def _braid_length(self, span: Scalar, pressure: Scalar) -> Scalar:
        force, free = self.braid_tension(span, pressure), self.free_length(pressure)
        # Where nothing pulls and nothing pushes, as beyond the threads' length, the braid is as long as its span.
        return jnp.where(force > 0.0, span, jnp.where(force < 0.0, free, jnp.maximum(span, free)))


_NODES, _WEIGHTS = (tuple(map(float, one)) for one in np.polynomial.legendre.leggauss(8))
_STEPS = 8  # of Newton's method; each doubles the digits once it is near


class PressureLaw(TensionLaw):
    """A law published as the gauge pressure that a force needs at a contraction, P(F, eps); a law of your own states that.

    The tension is the force at which the pressure is needed, found by Newton's method from no force on; the gas energy is
    the integral of what the gas adds to it over the contraction, by the quadrature of Gauss at 8 nodes, so that tension
    and volume come from one potential as of every law. Range: a pressure that rises with the force, smoothly and without
    bound, also below zero force. Its first evaluation compiles for some seconds.

    Args:
        rest_length: at which the contraction is zero [m].
        rest_volume: gas volume there [m^3]; forces do not depend on it.

    Examples:
        >>> import mckibben as mk
        >>> class Published(mk.PressureLaw):
        ...     title, cites, fitted = "published", (), ("per_force", "stiffening")
        ...     per_force = mk.quantity("1/m^2", (1.0, 1e9), "pressure per force at rest")
        ...     stiffening = mk.quantity("Pa", (0.0, 1e9), "pressure per contraction of the walls")
        ...     def pressure(self, force, contraction):
        ...         return self.per_force * force * (1.0 + 4.0 * contraction) + self.stiffening * contraction
        ...     def length_range(self):
        ...         return 0.7 * self.rest_length, self.rest_length
        >>> law = Published(per_force=3000.0, stiffening=5e5, rest_length=0.3)
        >>> round(float(law.pressure(law.braid_tension(0.27, 3e5), 0.1)))
        300000
    """

    rest_length: Scalar = quantity("m", (1e-3, 10.0), "rest length, at which the contraction is zero", symbol="L0")
    rest_volume: Scalar = quantity("m^3", (1e-8, 1.0), "gas volume at the rest length", symbol="V0", default=1e-4)

    @abc.abstractmethod
    def pressure(self, force: Scalar, contraction: Scalar) -> Scalar:
        """Gauge pressure that a force [N] needs at a contraction [1], as published [Pa]."""

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Force that needs no pressure [N]."""
        return _force_for(self, 1.0 - length / self.rest_length, 0.0 * length)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Work of the gas from the rest length on, and that of the volume there [J]."""
        contraction = 1.0 - length / self.rest_length
        added: Scalar = 0.0 * contraction
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            at = 0.5 * contraction * (1.0 + node)
            added = added + 0.5 * weight * (_force_for(self, at, pressure) - _force_for(self, at, 0.0 * pressure))
        return pressure * self.rest_volume + self.rest_length * contraction * added


def _force_for(law: PressureLaw, contraction: Scalar, pressure: Scalar) -> Scalar:
    force: Scalar = 0.0 * (contraction + pressure)
    for _ in range(_STEPS):
        slope = derivative(lambda x: law.pressure(x, contraction), force)
        force = force + (pressure - law.pressure(force, contraction)) / slope
    return force


def law_name(law: object) -> str:
    """The name under which a law is addressed: that of its registration, such as ``my.py:MyLaw``, or its module's."""
    kind = law if isinstance(law, type) else type(law)
    return registered_name(kind) or kind.__module__.rsplit(".", 1)[-1]


def required_of_law(kind: object) -> str | None:
    """What something must be to be a law; None where it is one."""
    if not (isinstance(kind, type) and issubclass(kind, TensionLaw)):
        return "a class derived from mckibben.TensionLaw"
    stated = {"title": "title", "cites": "cites (references, () where there are none)", "fitted": "fitted"}
    missing = [words for name, words in stated.items() if not hasattr(kind, name)]
    missing += sorted(getattr(kind, "__abstractmethods__", ()))
    if missing:
        return f"complete; missing: {', '.join(missing)}"
    unknown = [name for name in kind.fitted if name not in declared(kind)]
    if unknown:
        return f"consistent; fitted names no parameter of it: {', '.join(unknown)}"
    for name in sorted(TensionLaw.__abstractmethods__):
        arguments = [*inspect.signature(getattr(TensionLaw, name)).parameters]
        try:
            inspect.signature(getattr(kind, name)).bind(*arguments)
        except TypeError:
            return f"consistent; {name} must take ({', '.join(arguments)})"
    return None


# Functions and no methods, for a law of one's own may have methods of these names.


def _active(law: TensionLaw, length: Scalar, pressure: Scalar) -> Scalar:
    return -derivative(lambda x: law.gas_energy(x, pressure), length)


def _volume(law: TensionLaw, length: Scalar, pressure: Scalar) -> Scalar:
    """The formula's gas volume [m^3]."""
    return derivative(lambda p: law.gas_energy(length, p), pressure)


def _within(law: TensionLaw, length: Scalar) -> threads.HeldLength:
    """The length at which the formulas are asked, and how far the threads are stretched."""
    shortest, longest = law.length_range()
    return threads.hold(length, shortest, longest, threads.travel(law.thread_strain, longest))


def _together(length: Scalar, pressure: Scalar) -> tuple[Scalar, Scalar]:
    return tuple(jnp.broadcast_arrays(jnp.asarray(length, float), jnp.asarray(pressure, float)))  # type: ignore[return-value]


# ---- energy stored in bladder and braid, by motion and filling: a law has one potential
#
# U(L, P') = E(L) + P' V - G(L, P'),   dU = F dL + P' dV,   E' the tension without gas, G the gas energy

# Nodes of the quadrature of a law's elastic tension over a piece of length; its kinks are parabolas, met within 1e-8.
NODES, PIECES = 8, 256


def stored_change(law: TensionLaw, start: tuple[float, float], end: tuple[float, float]) -> float:
    """Gain of the energy stored in bladder and braid [J] between two states: braid length [m] and gauge pressure [Pa]."""
    (l0, p0), (l1, p1) = start, end
    elastic = float(_elastic(law, np.linspace(l0, l1, PIECES + 1))[-1])
    return elastic + float(_of_gas(law, l1, p1) - _of_gas(law, l0, p0))


def stored_along(law: TensionLaw, length: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Energy stored in bladder and braid (n,) [J], less that of the first state.

    Between the edges of a thousand pieces of length the elastic part is interpolated, within a millionth of its range.

    Args:
        law: law of the muscle.
        length: length of the braid (n,) [m].
        pressure: gauge (n,) [Pa].
    """
    low, high = float(np.min(length)), float(np.max(length))
    edges = np.linspace(low, high if high > low else low + 1e-9, 4 * PIECES + 1)
    energy = np.interp(length, edges, _elastic(law, edges)) + np.asarray(_of_gas(law, length, pressure))
    return np.asarray(energy - energy[0])


def _elastic(law: TensionLaw, edges: np.ndarray) -> np.ndarray:
    """Integral of the tension without gas from the first edge to every edge [J]."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    half = 0.5 * np.diff(edges)
    at = 0.5 * (edges[1:] + edges[:-1])[:, None] + half[:, None] * nodes
    pieces = np.sum(half[:, None] * weights * np.asarray(_without_gas(law, at)), axis=1)
    return np.concatenate([[0.0], np.cumsum(pieces)])


@evaluated
def _without_gas(law: TensionLaw, length: Scalar) -> Any:
    return law.passive_tension(length)


@evaluated
def _of_gas(law: TensionLaw, length: Scalar, pressure: Scalar) -> Any:
    return pressure * law.braid_volume(length, pressure) - law.braid_energy(length, pressure)
