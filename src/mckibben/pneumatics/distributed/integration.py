"""Integration of the distributed tube in time, and its recording.

Heun's method (the strong-stability-preserving Runge-Kutta method of second order) with a step chosen from the state: the
waves, the wall and the vessels bound it, and it divides the rest of the sample period. Friction and heat are part of every
stage, so that a steady state does not depend on the step. Source: S. Gottlieb, C.-W. Shu and E. Tadmor, SIAM Review 43,
2001, doi:10.1137/S003614450036757X.
"""

from __future__ import annotations

import numpy as np

from ..._jax import jax, jnp
from ...components import Scalar, jit_arrays
from ...errors import ConvergenceError, InputError
from ...quantities import declared
from .ends import End, ReservoirEnd
from .equations import Primitive
from .result import Sample, TubeResult, assemble
from .tube import DistributedTube, TubeState, end_faces, hold_temperature, largest_step, rates


def simulate(
    tube: DistributedTube,
    left: End,
    right: End,
    *,
    duration: float,
    sample_period: float,
    pressure_abs: Scalar,
    temperature: Scalar = 293.15,
    velocity: Scalar = 0.0,
    most_steps: int = 20_000_000,
) -> TubeResult:
    """Integrate a tube and record it.

    Args:
        tube: the tube.
        left: end at x = 0.
        right: end at x = length.
        duration: time to simulate [s].
        sample_period: time between two recorded states, a whole part of the duration [s].
        pressure_abs: absolute pressure at the start, one value or one per cell [Pa].
        temperature: temperature at the start, likewise [K]; an isothermal wall sets its own.
        velocity: velocity at the start, likewise [m/s].
        most_steps: where the integration gives up.

    Raises:
        InputError: for values that are not allowed, or when more than `most_steps` steps would be needed.
        ConvergenceError: when the solution stopped being finite.
    """
    samples = _sample_count(duration, sample_period)
    start = _start(tube, left, right, pressure_abs, temperature, velocity)
    step = float(largest_step(tube, left, right, start))
    if duration / step > most_steps:
        raise InputError(
            "duration", duration, f"the step is {step:.3g} s, which allows up to {step * most_steps:.4g} s"
        )
    (end, steps), recorded = _integrate(
        tube, left, right, start, samples, jnp.asarray(sample_period, float), most_steps
    )
    result = assemble(tube, (left, right), (start, end), recorded, np.arange(samples + 1) * sample_period, int(steps))
    if int(steps) >= most_steps:
        raise InputError("duration", duration, f"must be what {most_steps} steps reach; the flow needs more")
    if not np.all(np.isfinite(result.pressure)) or np.any(result.pressure <= 0.0):
        bad = ~np.all(np.isfinite(result.pressure) & (result.pressure > 0.0), axis=1)
        raise ConvergenceError(
            f"the tube has no finite state from {result.times[bad][0]:.4g} s on; the scheme is made for pressures within "
            "a factor of 1000 of each other"
        )
    return result


def _sample_count(duration: float, period: float) -> int:
    for name, value in (("duration", duration), ("sample_period", period)):
        if not np.isfinite(value) or value <= 0.0:
            raise InputError(name, value, "must be a time above 0 s")
    count = round(duration / period)
    if count < 1 or abs(duration / period - count) > 1e-6 * count:
        raise InputError("sample_period", period, f"must be a whole part of the duration, {duration:g} s")
    return count


def _start(
    tube: DistributedTube, left: End, right: End, pressure_abs: Scalar, temperature: Scalar, velocity: Scalar
) -> TubeState:
    limits = declared(ReservoirEnd)
    values = {"pressure_abs": pressure_abs, "temperature": temperature, "velocity": velocity}
    for name, value in values.items():
        if np.shape(value) not in ((), (tube.cells,)):
            raise InputError(
                name, None, f"must be one, or one for each of {tube.cells} cells, got {np.shape(value)} values"
            )
        if name in limits:
            limits[name].check(name, value)
        elif not np.all(np.isfinite(value)):
            raise InputError(name, value, "must be finite values")
    if tube.wall == "isothermal":
        values["temperature"] = tube.wall_temperature
    full = (jnp.broadcast_to(jnp.asarray(value, float), (tube.cells,)) for value in values.values())
    pressure, warmth, speed = full
    cells = tube.medium.conserved(Primitive(pressure, speed, warmth))
    zero = jnp.zeros(())
    return TubeState(cells, left.initial(tube.gas), right.initial(tube.gas), zero, (zero, zero))


@jit_arrays
def _integrate(
    tube: DistributedTube, left: End, right: End, start: TubeState, samples: int, period: Scalar, most_steps: int
) -> tuple[tuple[TubeState, Scalar], Sample]:
    def euler_step(state: TubeState, time: Scalar, step: Scalar) -> TubeState:
        slope = rates(tube, left, right, state, time)
        return hold_temperature(tube, jax.tree.map(lambda value, rate: value + step * rate, state, slope))

    def heun_step(state: TubeState, time: Scalar, step: Scalar) -> TubeState:
        # the mean of the start and of two Euler steps on; a loop, so that the rates are compiled once
        twice = jax.lax.fori_loop(0, 2, lambda k, ahead: euler_step(ahead, time + k * step, step), state)
        return hold_temperature(tube, jax.tree.map(lambda a, b: 0.5 * (a + b), state, twice))

    def going(inner: tuple[TubeState, Scalar, Scalar, Scalar]) -> Scalar:
        _, _, left_over, steps = inner
        return (left_over > 0.0) & (steps < most_steps)

    def advance(inner: tuple[TubeState, Scalar, Scalar, Scalar]) -> tuple[TubeState, Scalar, Scalar, Scalar]:
        state, until, left_over, steps = inner
        parts = jnp.ceil(left_over / largest_step(tube, left, right, state))
        step = left_over / parts
        state = heun_step(state, until - left_over, step)
        return state, until, jnp.where(parts > 1.0, left_over - step, 0.0), steps + 1

    def one_sample(carry: tuple[TubeState, Scalar], index: Scalar) -> tuple[tuple[TubeState, Scalar], Sample]:
        state, steps = carry
        recorded = _sample(tube, left, right, state, index * period)
        wait = jnp.where(index < samples, period, 0.0)  # nothing follows the last sample
        inner: tuple[TubeState, Scalar, Scalar, Scalar] = state, (index + 1) * period, wait, steps
        state, _, _, steps = jax.lax.while_loop(going, advance, inner)
        return (state, steps), recorded

    return jax.lax.scan(one_sample, (start, jnp.zeros((), int)), jnp.arange(samples + 1))


def _sample(tube: DistributedTube, left: End, right: End, state: TubeState, time: Scalar) -> Sample:
    at_left, at_right, _, _ = end_faces(tube, left, right, state, time)
    behind = (left.outside(tube.gas, state.left, time), right.outside(tube.gas, state.right, time))
    return Sample(
        tube.medium.primitive(state.cells), (at_left, at_right), behind, (state.left, state.right), state.heat
    )
