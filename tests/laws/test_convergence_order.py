"""The engine's orders: 4 without memory, 2 with friction whose yield depends on the pressure, 2 for the stiff method."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mckibben.components.system import System
from mckibben.engine import Result, held, integrate, march, ramped, step
from mckibben.errors import ConvergenceError, InputError
from mckibben.muscles.hysteresis import FrictionLimit, MaxwellSlip

PERIOD = 0.01


class Pendulum(System):
    """A nonlinear oscillator driven by a signal; its integral is the work done on it."""

    def rate(self, state, memory, inputs):
        return {"x": state["v"], "v": -400.0 * jnp.sin(state["x"]) - 2.0 * state["v"] + inputs["drive"].value}

    def integrands(self, state, memory, inputs):
        return {"work": inputs["drive"].value * state["v"], "loss": 2.0 * state["v"] ** 2}

    def advance_memory(self, memory, start, end, duration):
        return memory

    def outputs(self, state, memory, inputs):
        return {"x": state["x"]}


class Rubbing(System):
    """A mass on a spring that rubs, with a yield that grows with a pressure of its own dynamics."""

    friction: MaxwellSlip

    def rate(self, state, memory, inputs):
        push = -200.0 * state["x"] - self.friction.force(memory) + inputs["drive"].value
        return {"x": state["v"], "v": push / 0.5, "p": 40.0 * (2e5 + 1.5e5 * inputs["drive"].value / 5.0 - state["p"])}

    def integrands(self, state, memory, inputs):
        return {}

    def advance_memory(self, memory, start, end, duration):
        begin, last = start.state, end.state
        moved = last["x"] - begin["x"]
        return self.friction.advance(memory, moved, start_pressure=begin["p"], end_pressure=last["p"]).state

    def outputs(self, state, memory, inputs):
        return {"x": state["x"]}


START = {"x": jnp.asarray(0.5), "v": jnp.asarray(0.0)}
DRIVE = {"drive": ramped(50.0 * np.sin(np.linspace(0.0, 6.0, 51)))}


def ends(system, state, signals, steps, method="rk4", memory=()):
    runs = [integrate(system, state, signals, period=PERIOD, step_size=h, method=method, memory=memory) for h in steps]
    return np.array([float(r.outputs["x"][-1]) for r in runs]), runs


def orders(values):
    differences = np.abs(np.diff(values))
    return np.log2(differences[:-1] / differences[1:])


def test_runge_kutta_converges_with_order_4_on_a_smooth_problem():
    values, _ = ends(Pendulum(), START, DRIVE, [2e-3, 1e-3, 5e-4, 2.5e-4])
    assert np.all(orders(values) > 3.8)  # asymptotically 4; the coarsest step is not yet asymptotic


def test_rosenbrock_converges_with_order_2():
    values, _ = ends(Pendulum(), START, DRIVE, [5e-4, 2.5e-4, 1.25e-4], method="ros2")
    assert np.all(np.abs(orders(values) - 2.0) < 0.2)


def test_friction_with_pressure_dependent_yield_converges_with_order_2():
    friction = MaxwellSlip.geometric(FrictionLimit(constant=0.5, per_pressure=4e-6), elements=4)
    state = {"x": jnp.asarray(0.02), "v": jnp.asarray(0.0), "p": jnp.asarray(2e5)}
    drive = {"drive": ramped(5.0 * np.sin(np.linspace(0.0, 9.0, 51)))}
    steps = [1e-3 / 2**k for k in range(6)]
    values, _ = ends(Rubbing(friction), state, drive, steps, memory=friction.initial())
    # Yield corners fall anywhere in a step, so single ratios scatter; over 32-fold refinement the slope is 2.
    errors = np.abs(values[:-1] - values[-1])
    slope = np.polyfit(np.log2(steps[:-1]), np.log2(errors), 1)[0]
    assert slope > 1.8


def test_independent_integrals_close_the_energy_of_the_pendulum():
    _, (run,) = ends(Pendulum(), START, DRIVE, [2.5e-4])
    energy = lambda s: 0.5 * float(s["v"]) ** 2 - 400.0 * np.cos(float(s["x"]))  # noqa: E731
    gained = energy(run.state) - energy(START)
    # fourth-order truncation at 0.25 ms against an exchange of about 100 J/kg
    assert gained == pytest.approx(float(run.integrals["work"] - run.integrals["loss"]), abs=1e-6)


def test_agreement_with_radau_on_a_smooth_input():
    _, (run,) = ends(Pendulum(), START, DRIVE, [50e-6])
    time, values = PERIOD * np.arange(51), np.asarray(DRIVE["drive"].values)
    rate = lambda t, y: [y[1], -400.0 * np.sin(y[0]) - 2.0 * y[1] + np.interp(t, time, values)]  # noqa: E731
    # Interval by interval: the input has corners at the samples, which a variable step would step over.
    y = [0.5, 0.0]
    for a, b in zip(time[:-1], time[1:], strict=True):
        y = solve_ivp(rate, (a, b), y, method="Radau", rtol=1e-10, atol=1e-12).y[:, -1]
    assert float(run.outputs["x"][-1]) == pytest.approx(y[0], abs=1e-6)


def test_stages_in_a_loop_and_written_out_are_the_same(monkeypatch):
    """Large systems run the loop and small ones run the stages in a row; the suite runs the loop, which compiles sooner."""
    friction = MaxwellSlip.geometric(FrictionLimit(constant=0.5, per_pressure=4e-6), elements=4)
    rest = {"x": jnp.asarray(0.02), "v": jnp.asarray(0.0), "p": jnp.asarray(2e5)}
    for system, state, memory in ((Pendulum(), START, ()), (Rubbing(friction), rest, friction.initial())):
        found, written = [], []
        for most in (0, 100):
            monkeypatch.setattr(step, "UNROLLED", most)
            fresh = jax.jit(lambda *a: march(*a, False), static_argnums=(6,))  # a known function is not traced anew
            arguments = system, state, memory, DRIVE, PERIOD, 10, 50
            written.append(str(fresh.trace(*arguments).jaxpr).count("scan["))
            found.append(jax.tree.leaves(fresh(*arguments)))
        assert written[0] == written[1] + 1  # else one variant would be compared with itself
        for a, b in zip(*found, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12 * np.abs(b).max())  # rounding of 500 steps


class Fast(System):
    """Hides an unstable step behind a saturation, as an orifice on a small volume does."""

    def rate(self, state, memory, inputs):
        return {"x": jnp.clip(1e5 * (inputs["drive"].value - state["x"]), -50.0, 50.0)}

    def integrands(self, state, memory, inputs):
        return {}

    def advance_memory(self, memory, start, end, duration):
        return memory

    def outputs(self, state, memory, inputs):
        return {"x": state["x"]}


def test_a_step_too_long_is_reported_with_the_step_it_needs():
    signals = {"drive": held(np.ones(21))}
    with pytest.raises(ConvergenceError, match="2.78e-05 s or less"):
        integrate(Fast(), {"x": jnp.asarray(1.0)}, signals, period=1e-3, method="rk4")
    run = integrate(Fast(), {"x": jnp.asarray(1.0)}, signals, period=1e-3, method="rk4", raises=False)
    assert run.result is Result.TOO_STIFF


def test_auto_takes_the_stiff_method_where_the_rates_ask_for_it():
    run = integrate(Fast(), {"x": jnp.asarray(0.9999)}, {"drive": held(np.ones(21))}, period=1e-3)
    assert run.stiff and run.result is Result.DONE
    assert float(run.outputs["x"][-1]) == pytest.approx(1.0, abs=1e-9)  # L-stable: the fast mode is damped at once


def test_a_state_that_is_not_finite_is_reported():
    with pytest.raises(ConvergenceError, match="not finite"):
        integrate(Pendulum(), START | {"x": jnp.asarray(np.nan)}, DRIVE, period=PERIOD, method="rk4")


class Bounded(Pendulum):
    """A pendulum that cannot be beyond one place, and breaks beyond another."""

    furthest: float
    strength: float

    def admissible(self, state):
        return state["x"] > -self.furthest

    def overloaded(self, outputs):
        return {"x": outputs["x"] < -self.strength}


@pytest.mark.parametrize(
    ("system", "result", "says"),
    [
        (Bounded(9.0, 9.0), Result.DONE, "reached its end"),
        (Bounded(0.3, 9.0), Result.IMPOSSIBLE, "The step of 0.001 s is too long for it"),
        (Bounded(9.0, 0.3), Result.BROKEN, "threads"),
        (Bounded(0.3, 0.3), Result.IMPOSSIBLE, "beyond what the physics allows"),
    ],
)
def test_a_run_through_what_cannot_be_or_breaks_ends_with_its_code(system, result, says):
    """From 0.5 it swings to -0.4 or further within a sixth of its time."""
    run = integrate(system, START, DRIVE, period=PERIOD, step_size=1e-3, method="rk4", raises=False)
    assert run.result is result and says in run.message
    assert run.outputs["x"].min() < -0.3


def test_a_stable_step_that_is_too_coarse_is_reported_with_one_that_is_not():
    rough = 4.0 * PERIOD  # 0.8 of a radian of its motion
    coarse = integrate(Pendulum(), START, DRIVE, period=rough, step_size=rough, method="ros2", raises=False)
    assert (
        coarse.result is Result.TOO_COARSE
        and "x changes by" in coarse.message
        and "instead of 0.04 s" in coarse.message
    )
    stated = float(coarse.message.rpartition("; try ")[2].split()[0])
    fine = integrate(Pendulum(), START, DRIVE, period=rough, step_size=stated, method="ros2")
    assert fine.result is Result.DONE and fine.step <= stated < rough


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"step_size": 0.0}, "step_size must be a time above 0 s"),
        ({"step_size": np.inf}, "step_size"),
        ({"period": np.inf}, "period must be a time above 0 s"),
        ({"method": "rk5"}, "Unknown method 'rk5'. Did you mean 'rk4'?"),
        ({"signals": {"drive": held(np.ones(3)), "more": held(np.ones(4))}}, "equal lengths"),
    ],
)
def test_options_of_a_run_that_cannot_be_are_refused_by_name(options, says):
    with pytest.raises(InputError) as refused:
        integrate(Pendulum(), START, **{"signals": DRIVE, "period": PERIOD} | options)
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("signals", "period", "says"),
    [({}, 1e-3, "signals"), ({"drive": held([1.0])}, 1e-3, "signals"), ({"drive": held(np.ones(3))}, 0.0, "period")],
)
def test_senseless_runs_are_refused(signals, period, says):
    with pytest.raises(InputError, match=says):
        integrate(Pendulum(), START, signals, period=period)
