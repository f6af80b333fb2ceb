"""The Prandtl-Ishlinskii operators: stops in parallel as a friction, plays in parallel as a map from input to output.

    stop   z' = clip(z + dx, -r, r)        friction  F = sum w_i z_i
    play   y = x - z                       map       y = S(sum w_i (x - z_i)),   S(h) = h + sum g_j max(h - h_j, 0)

A stop is a Maxwell-slip element: with stiffness w_i and yield travel r_i the two frictions are the same, number for
number. `PrandtlIshlinskii` is that friction given by thresholds and weights, as the density of an identification
comes out; `MaxwellSlip` is given by forces and stiffnesses. A play is what remains of the input when its stop is
taken away, so the map carries the same memory, closed minor loops and wiped-out turning points included. It is for
loops between two quantities that are not conjugate, such as pressure and stroke at constant load: it holds no energy
and claims no passivity. The one-sided hinges S are Kuhnen's superposition operator: they bend the symmetric loop into
an asymmetric one; thresholds that grow with the input widen it. Range: quasi-static, rate-independent. With every w_i
>= 0 and every slope of S >= 0 the output never falls while the input rises.
Sources: M. A. Krasnosel'skii and A. V. Pokrovskii, Systems with Hysteresis, Springer 1989,
doi:10.1007/978-3-642-61302-9; K. Kuhnen, European Journal of Control 9(4), 2003 (the modified operator).
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Module, Scalar
from ...components.element import Advanced, Hysteresis
from ...quantities import quantity
from .slip import advanced, contact_energy, contact_force, per_contact, require_each, slip


class PrandtlIshlinskii(Hysteresis):
    """Stop operators in parallel, a friction; the state is the deflection of each stop [m], shape (..., stops)."""

    weight: Scalar = quantity(
        "N/m", (0.0, 1e9), "weight of each stop, shape (stops,)", symbol="w_i", typical=(1e1, 1e5)
    )
    threshold: Scalar = quantity(
        "m", (0.0, 1.0), "threshold of each stop without pressure", symbol="r_i", typical=(1e-4, 1e-2)
    )
    threshold_per_pressure: Scalar = quantity(
        "m/Pa",
        (0.0, 1e-3),
        "growth of each threshold with gauge pressure",
        symbol="q_i",
        typical=(0.0, 2e-8),
        default=0.0,
    )

    title = "Prandtl-Ishlinskii"
    cites = ("krasnoselskii1989", "kuhnen2003")

    def __check_init__(self) -> None:
        """Weights are those of each stop."""
        require_each(type(self).__name__, {"weight": self.weight}, self.threshold, self.threshold_per_pressure)

    def initial(self) -> Scalar:
        """State without deflections, shape (stops,) [m]."""
        return jnp.zeros(jnp.broadcast_shapes(jnp.shape(self.weight), jnp.shape(self.threshold), (1,)))

    def advance(
        self,
        state: Scalar,
        displacement: Scalar,
        *,
        start_pressure: Scalar,
        end_pressure: Scalar,
        duration: Scalar = 0.0,
    ) -> Advanced:
        """Move along a straight piece of path, then limit once with the thresholds at its end."""
        dx = per_contact(displacement)
        return advanced(self.weight, state, dx, slip(state, dx, self.travel(end_pressure)))

    def force(self, state: Scalar, velocity: Scalar = 0.0, pressure: Scalar = 0.0) -> Scalar:
        """Weighted sum of the stops [N]."""
        return contact_force(self.weight, state)

    def stored_energy(self, state: Scalar) -> Scalar:
        """Elastic energy of the stops [J]."""
        return contact_energy(self.weight, state)

    def travel(self, pressure: Scalar) -> Scalar:
        """Threshold of each stop at a gauge pressure [Pa] [m]."""
        return self.threshold + self.threshold_per_pressure * jnp.maximum(per_contact(pressure), 0.0)

    def largest_force(self, pressure: Scalar) -> Scalar:
        """Weighted sum of the thresholds [N]."""
        return contact_force(self.weight, self.travel(pressure))

    def lubricated(self, factor: float = 0.9) -> PrandtlIshlinskii:
        """Return the friction with every threshold scaled."""
        return self.replace(
            threshold=factor * self.threshold, threshold_per_pressure=factor * self.threshold_per_pressure
        )


class PlayMap(Module):
    """Play operators from pressure to stroke; the state is the stop of each play [Pa], shape (..., plays).

    A play with threshold zero is the straight line of the map. The thresholds grow by ``1 + widening P'``; while
    ``widening r_i < 1`` a monotone piece of path gives the same result in one step as in many.
    """

    weight: Scalar = quantity(
        "m/Pa", (0.0, 1e-3), "weight of each play, shape (plays,)", symbol="w_i", typical=(1e-9, 1e-7)
    )
    threshold: Scalar = quantity(
        "Pa", (0.0, 5e6), "half the width of each play at zero pressure", symbol="r_i", typical=(0.0, 2e5)
    )
    widening: Scalar = quantity(
        "1/Pa",
        (0.0, 1e-3),
        "growth of all thresholds with gauge pressure",
        symbol="a",
        typical=(0.0, 1e-5),
        default=0.0,
    )
    hinge: Scalar = quantity(
        "m", (-10.0, 10.0), "output from which each hinge acts, shape (hinges,)", symbol="h_j", default=()
    )
    bend: Scalar = quantity(
        "1",
        (-10.0, 10.0),
        "change of slope at each hinge, shape (hinges,)",
        symbol="g_j",
        typical=(-1.0, 1.0),
        default=(),
    )

    def __check_init__(self) -> None:
        """Weights are those of each play, bends those of each hinge."""
        require_each(type(self).__name__, {"weight": self.weight}, self.threshold)
        require_each(type(self).__name__, {"bend": self.bend}, self.hinge)

    def initial(self, pressure: Scalar = 0.0) -> Scalar:
        """State after a long fall to a gauge pressure [Pa]: every play at its lower side; the output lags above."""
        return -jnp.broadcast_to(
            self.width(pressure),
            jnp.shape(pressure) + jnp.broadcast_shapes(jnp.shape(self.weight), jnp.shape(self.threshold), (1,)),
        )

    def advance(self, state: Scalar, *, start_pressure: Scalar, end_pressure: Scalar) -> Scalar:
        """The stops after a monotone change of the gauge pressure [Pa]."""
        start, end = jnp.asarray(start_pressure, float), jnp.asarray(end_pressure, float)
        return slip(state, per_contact(end - start), self.width(end))

    def output(self, state: Scalar, pressure: Scalar) -> Scalar:
        """Stroke [m] at a gauge pressure [Pa]."""
        plays = jnp.sum(self.weight * (per_contact(pressure) - state), axis=-1)
        return plays + jnp.sum(self.bend * jnp.maximum(plays[..., None] - self.hinge, 0.0), axis=-1)

    def width(self, pressure: Scalar) -> Scalar:
        """Half the width of each play at a gauge pressure [Pa] [Pa]."""
        return self.threshold * (1.0 + self.widening * jnp.maximum(per_contact(pressure), 0.0))
