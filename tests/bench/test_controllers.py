"""Controllers in closed loop: what they reach, what bounds them, how they begin, and where they become unstable.

The plants are those of the paper's rig as far as control sees it: 75 g at the pulley against a muscle that is a spring, a
sample of latency, filters before the converters, a coarse tension; and a valve with a dead time and a lag.
"""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.bench.software.controllers import (
    ForceControl,
    MotionEstimate,
    PositionControl,
    PressureControl,
    first_trim,
    next_trim,
)

DT = 1e-3
FINE = 20  # steps of the plant in a sample
MASS, SPRING, REST = 0.075, 2300.0, 0.10  # the nylon muscle at 5 bar
FILTER = 2.0 * math.pi * 200.0
COUNT = 2.0 * math.pi * 0.02 / 6400  # of the encoder [m]
CODE = 100.0 / 256  # of the tension [N]


@functools.partial(jax.jit, static_argnames=("mode", "coarse"))
def machine(control, set_points, start, spring, mode, missing=0.0, damping=0.0, coarse=True, active=None, inertial=0.0):
    """Motor, muscle and sensors under one controller; set-points (n,) give span, speed, tension and force asked (n,).

    The motor pulls less than asked by `missing` [N]; `inertial` is the share of the acceleration that is fed forward.
    """
    motion = MotionEstimate()
    active = jnp.ones(set_points.shape) if active is None else active
    speeds = jnp.append(jnp.diff(set_points), 0.0) / DT
    accelerations = inertial * jnp.append(jnp.diff(speeds), 0.0) / DT

    def sample(carry, now):
        x, v, seen, force, state, moved = carry
        wanted, speed, acceleration, on = now
        span = COUNT * jnp.floor(x / COUNT) if coarse else x
        tension = CODE * jnp.floor(jnp.clip(seen, 0.0, 100.0) / CODE) if coarse else seen
        moved, velocity = motion.step(moved, span, DT)
        if mode == "span":
            state, asked = control.step(state, wanted, speed, acceleration, span, velocity, tension, DT, on)
        else:
            state, asked = control.step(state, wanted, tension, velocity, DT, on)

        def fine(_, y):
            x, v, seen = y
            h = DT / FINE
            pull = jnp.maximum(spring * (x - REST), 0.0)
            v = v + h / MASS * (force - missing - pull - damping * v)  # the force asked a sample ago
            return x + h * v, v, seen + h * FILTER * (pull - seen)

        x, v, seen = jax.lax.fori_loop(0, FINE, fine, (x, v, seen))
        return (x, v, seen, asked, state, moved), (x, v, spring * (x - REST), asked)

    pull = jnp.maximum(spring * (start - REST), 0.0)
    first = control.initial(pull) if mode == "span" else control.initial()
    begin = (start, jnp.zeros(()), pull, pull, first, motion.initial(start))
    return jax.lax.scan(sample, begin, (set_points, speeds, accelerations, active))[1]


def run(control, set_points, start=0.12, spring=SPRING, **options):
    mode = "span" if isinstance(control, PositionControl) else "tension"
    points = jnp.asarray(set_points, float)
    return [np.asarray(y) for y in machine(control, points, start, spring, mode, **options)]


@jax.jit
def valve(control, set_points, share, lag):
    """A muscle behind a valve that gives a share of what it is asked for, late by 5 ms and a lag [s]."""

    def sample(carry, wanted):
        pressure, line, state = carry
        state, asked = control.step(state, wanted, pressure, DT, 1.0)
        pressure = pressure + (1.0 - jnp.exp(-DT / lag)) * (share * line[0] - pressure)
        return (pressure, jnp.append(line[1:], asked), state), (pressure, asked)

    return jax.lax.scan(sample, (jnp.zeros(()), jnp.zeros(5), control.initial()), set_points)[1]


# Steady errors


@pytest.mark.parametrize("spring", [0.0, 500.0, 2300.0, 8000.0])
def test_the_span_has_no_steady_error(spring: float) -> None:
    # slack, a soft, a stiff muscle and the Bridgestone one. The converters make it hunt: by two counts of the encoder,
    # and by what a code of the tension, 0.4 N, moves spring and controller
    x, *_ = run(PositionControl(), np.full(1500, 0.11), spring=spring)
    assert np.abs(x[-300:] - 0.11).max() <= 2.0 * COUNT + CODE / (spring + 3000.0)


def test_what_the_motor_lacks_leaves_no_steady_error_of_the_tension() -> None:
    # 3 N: the proportional part leaves 3 N/(1 + kp), which the integral takes away with (1 + kp)/ki = 0.13 s, e^-23 in
    # 3 s; what is left is the swing of the first jump, which dies with 4 1/s where no friction helps
    points = np.full(3000, 30.0)
    _, _, tension, _ = run(ForceControl(), points, missing=3.0, coarse=False)
    assert abs(tension[-1] - 30.0) < 1e-4
    _, _, tension, _ = run(ForceControl(ki=0.0), points, missing=3.0, coarse=False)
    assert 30.0 - tension[-1] == pytest.approx(3.0 / 1.3, rel=1e-3)


def test_a_valve_that_gives_too_little_is_corrected_within_the_limit_of_the_trim() -> None:
    points = jnp.full(4000, 3e5)
    pressure, _ = valve(PressureControl(ki=5.0), points, 0.95, 0.01)
    assert float(pressure[-1]) == pytest.approx(3e5, rel=1e-6)
    pressure, asked = valve(PressureControl(ki=5.0), points, 0.5, 0.01)
    assert float(asked[-1]) == pytest.approx(3.5e5)  # set-point and 0.5 bar of trim, no more
    assert float(pressure[-1]) == pytest.approx(0.5 * 3.5e5)


def test_without_a_gain_the_valve_gets_the_set_point_alone() -> None:
    # as the paper's machine did; nothing of the measured pressure may pass
    points = jnp.asarray(np.linspace(0.0, 5e5, 200))
    for share in (0.5, 1.0, jnp.nan):
        assert np.array_equal(valve(PressureControl(), points, share, 0.01)[1], points)


# Following


def test_a_triangle_of_the_span_is_followed() -> None:
    # the paper's 1 Hz loops: 4 cm in half a second, 184 N/s of a stiff muscle. The tenth that is not fed forward needs
    # 0.18 mm of the integral, 0.1 * 184/1e5; as much again covers a count and the ripple
    t = DT * np.arange(2000)
    points = 0.14 - 0.04 * (1.0 - np.abs(1.0 - 2.0 * (t % 1.0)))
    x, *_ = run(PositionControl(), points, start=0.14)
    turns = np.abs((t + 0.25) % 0.5 - 0.25) < 0.05  # the corners of the triangle are left out
    assert np.abs(x - points)[(t > 0.2) & ~turns].max() < 3.6e-4


def test_a_sine_of_ten_hertz_is_followed() -> None:
    # 2.2 mm at 10 Hz is one rest length a second. The forces fed forward are late by 3 ms, 0.2 rad, of which the feedback
    # lets half through at most
    t = DT * np.arange(1500)
    points = 0.12 + 2.2e-3 * np.sin(2.0 * np.pi * 10.0 * t)
    x, *_ = run(PositionControl(), points)
    wave = np.exp(-2j * np.pi * 10.0 * t[500:])
    gain = 2.0 * np.mean((x[500:] - 0.12) * wave) / (2.2e-3 / 1j)
    assert 0.9 < abs(gain) < 1.1
    assert abs(np.angle(gain)) < 0.1


def test_the_acceleration_fed_forward_makes_up_for_the_inertia() -> None:
    # a free mass at 5 Hz. What is left is the lag of the measured velocity, 1.3 ms, which looks like kd 1.3 ms = 0.02 kg,
    # and that of the force; by itself the mass of 0.075 kg comes on top
    t = DT * np.arange(1200)
    points = 0.12 + 0.01 * np.sin(2.0 * np.pi * 5.0 * t)
    without, with_it = (
        np.abs(run(PositionControl(), points, spring=0.0, coarse=False, inertial=share)[0] - points)[600:].max()
        for share in (0.0, 1.0)
    )
    assert with_it < 0.75 * without


def test_a_growing_set_point_holds_a_velocity() -> None:
    # velocity mode: 0.5 m/s over 3 cm; the mean over 20 ms, over which counts make less than 1 mm/s of ripple
    t = DT * np.arange(120)
    x, *_ = run(PositionControl(), 0.11 + 0.5 * t, start=0.11, spring=500.0)
    assert (x[100] - x[60]) / (40 * DT) == pytest.approx(0.5, rel=0.1)


# Bounds


@pytest.mark.parametrize("control", [PositionControl(force_limit=20.0), ForceControl(force_limit=20.0)])
def test_no_more_than_the_limit_is_ever_asked(control: PositionControl | ForceControl) -> None:
    points = np.full(400, 0.5 if isinstance(control, PositionControl) else 300.0)
    *_, asked = run(control, points)
    assert np.abs(asked).max() <= 20.0
    assert np.abs(asked).max() == 20.0


def test_time_at_the_limit_does_not_wind_the_span_up() -> None:
    # The span asks for what the motor cannot, for 0.5 s or for 1.5 s; the plant rests long before (a damper of 5 N s/m
    # leaves e^-16 of a swing after 0.5 s). After that the way back is the same to what is left of the swing.
    motor = PositionControl(force_limit=60.0)
    short, long = (np.append(np.full(n, 0.16), np.full(400, 0.11)) for n in (500, 1500))
    a, b = (run(motor, points, damping=5.0, coarse=False)[0][-400:] for points in (short, long))
    assert np.abs(a - b).max() < 1e-6
    assert b.min() > 0.11 - 2e-3


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_trim_grows_only_where_the_output_can_follow_and_to_the_same_limit_either_way(side: float) -> None:
    """What holds above holds below: the law is odd."""
    low, high = sorted((side * -20.0, side * 60.0))  # beyond 60 on this side, beyond -20 on the other

    def after(trim: float, growth: float, wanted: float) -> float:
        state = first_trim(side * trim)
        grown = next_trim(state, side * growth, 1.0, wanted=side * wanted, low=low, high=high, limit=5.0)
        return side * float(grown.trim)

    assert after(1.0, 0.5, 59.0) == 1.5  # within
    assert after(1.0, 0.5, 61.0) == 1.0  # beyond: in vain
    assert after(1.0, -0.5, 61.0) == 0.5  # beyond, and on the way back
    assert after(1.0, 0.5, -21.0) == 1.5  # beyond the other end, and on the way back
    assert after(1.0, -0.5, -21.0) == 1.0
    assert after(4.8, 0.5, 0.0) == 5.0 and after(-4.8, -0.5, 0.0) == -5.0
    assert after(-3.0, 0.0, 0.0) == -3.0  # nothing changes by itself
    assert after(1.0, math.nan, 0.0) == after(1.0, math.inf, 0.0) == 1.0  # of a sensor that is lost


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_every_controller_stops_its_trim_at_the_limit_of_either_side(side: float) -> None:
    wide = {"low": -1e5, "high": 1e6}
    for control, error, limit in (
        (PressureControl(ki=5.0, trim_limit=2e4, **wide), 1e5, 2e4),
        (ForceControl(trim_limit=5.0), 10.0, 5.0),
        (PositionControl(force_limit=60.0), 0.01, 60.0),
    ):
        state = control.initial(0.0) if isinstance(control, PositionControl) else control.initial()
        step = jax.jit(control.step)
        base = 4e5 if isinstance(control, PressureControl) else 0.0
        rest = {"PressureControl": (base,), "ForceControl": (0.0, 0.0), "PositionControl": (0.0, 0.0, 0.0, 0.0, 0.0)}
        trims = []
        for _ in range(600):
            if isinstance(control, PositionControl):
                state, asked = step(state, side * error, 0.0, 0.0, 0.0, 0.0, 0.0, DT, 1.0)
            else:
                state, asked = step(state, base + side * error, *rest[type(control).__name__], DT, 1.0)
            trims.append(side * float(state.trim))
        assert np.diff(trims).min() >= 0.0  # it only grows
        # the span's output comes to its end first, within a sample's growth; the others' trim comes to its limit
        slack = control.ki * DT * error if isinstance(control, PositionControl) else 0.0
        most = limit - (control.kp * error if isinstance(control, PositionControl) else 0.0)
        assert most <= trims[-1] <= most + slack if slack else trims[-1] == limit


def test_a_slack_muscle_does_not_wind_the_tension_up() -> None:
    # held slack for two seconds the tension stays below its set-point; the trim ends at 5 N and not at 10 N * 10 1/s * 2 s
    force, state = ForceControl(trim_limit=5.0), ForceControl().initial()
    step = jax.jit(force.step)
    for _ in range(2000):
        state, asked = step(state, 10.0, 0.0, 0.0, DT, 1.0)
    assert float(state.trim) == 5.0
    assert float(asked) == pytest.approx(10.0 + 3.0 + 5.0)


def test_a_large_step_of_the_pressure_is_not_overshot_by_the_trim() -> None:
    # the muscle lags the step by 50 ms: an integral without a limit would go on for 5 bar * 5 1/s * 50 ms = 1.2 bar
    pressure, _ = valve(PressureControl(ki=5.0), jnp.full(3000, 5e5), 1.0, 0.05)
    assert float(pressure.max()) < 5e5 + 5e4
    assert float(pressure[-1]) == pytest.approx(5e5, rel=1e-4)


@pytest.mark.parametrize(("asked", "given"), [(-1e5, 0.0), (3e5, 3e5), (9e5, 6e5)])
def test_the_valve_is_asked_for_what_it_can(asked: float, given: float) -> None:
    control = PressureControl(high=6e5)
    assert float(control.step(control.initial(), asked, 0.0, DT, 1.0)[1]) == given


# Beginning


def test_an_inactive_controller_keeps_the_trim_it_begins_with() -> None:
    for control, arguments, rest in (
        (PressureControl(ki=5.0), (3e5, 1e5), 0.0),
        (PositionControl(), (0.12, 0.0, 0.0, 0.11, 0.0, 10.0), 0.1 * 10.0),  # what is not fed forward of 10 N
        (ForceControl(), (20.0, 10.0, 0.0), 0.0),
    ):
        state = control.initial()
        for _ in range(5):
            state, _ = control.step(state, *arguments, DT, 1.0)
        assert float(state.trim) > 0.0
        for off in (0.0, False, jnp.asarray(0)):
            assert float(control.step(state, *arguments, DT, off)[0].trim) == pytest.approx(rest, abs=1e-12)


def test_control_of_the_span_begins_with_the_tension_of_its_first_sample() -> None:
    # A simulation that knew the tension without its noise would differ from every machine that has to measure it.
    span = PositionControl()
    sample = (0.12, 0.0, 0.0, 0.12, 0.0, 40.0, DT)
    begun, known = span.step(span.initial(), *sample), span.step(span.initial(40.0), *sample)
    assert [float(x) for x in (begun[0].trim, begun[1])] == [float(x) for x in (known[0].trim, known[1])]
    assert float(begun[1]) == pytest.approx(40.0, rel=1e-12)  # it holds the muscle; two products are rounded


def test_a_change_of_mode_jumps_by_no_more_than_friction_inertia_and_motion() -> None:
    # The mode before asked for T + m a + friction. The next asks for T, less kd V where it wants to stand still: that is
    # the whole bound, whatever the gains, if it begins where the machine is.
    tension, friction, velocity, pull = 40.0, 2.0, 0.05, 0.075 * 3.0
    held = tension + friction + pull
    force = ForceControl()
    _, asked = force.step(force.initial(), tension, tension, velocity, DT, 1.0)
    assert abs(float(asked) - held) <= friction + pull + 3.0 * velocity + 1e-12
    for share in (0.0, 0.9, 1.0):
        span = PositionControl(tension_share=share)
        state, _ = span.step(span.initial(), 0.0, 0.0, 0.0, 0.12, velocity, tension, DT, 0.0)  # inactive so far
        _, asked = span.step(state, 0.12, 0.0, 0.0, 0.12, velocity, tension, DT, 1.0)
        assert abs(float(asked) - held) <= friction + pull + 16.0 * velocity + 1e-12


def test_going_over_to_the_span_moves_little() -> None:
    # 46 N held by the motor; then the span is to stay. The plant is alike whether the span was controlled before or not.
    points = np.full(400, 0.12)
    x, *_, asked = run(PositionControl(), points, coarse=False)
    assert np.abs(x - 0.12).max() < 1e-9  # nothing but rounding moves it
    assert np.abs(asked - SPRING * 0.02).max() < 1e-6


def test_going_over_to_the_tension_moves_little() -> None:
    # 300 samples inactive, while the output holds the muscle all the same, then active: less than a count of the encoder
    force = ForceControl()
    points = np.full(1000, SPRING * 0.02)
    active = jnp.asarray(np.arange(1000) >= 300, float)
    x, *_ = run(force, points, coarse=False, active=active)
    assert np.abs(x - 0.12).max() < COUNT


# Stability


def swing(kp: float) -> float:
    """How the tension still swings [N] a second after a step from 46 N to 50 N."""
    _, _, tension, _ = run(ForceControl(kp=kp), np.full(1500, 50.0))
    return float(np.ptp(tension[-500:]))


def test_the_gain_of_the_force_is_limited_by_the_delay() -> None:
    # 75 g, 5 bar, a sample of latency, 8 bits and filters of 200 1/s: 0.3 is quiet to a few codes of 0.4 N, 1 is not stable
    assert swing(0.3) < 1.5
    assert swing(1.0) > 20.0


def test_without_damping_of_the_velocity_the_delay_wins() -> None:
    # then even 0.3 takes more than there is
    _, _, tension, _ = run(ForceControl(kd=0.0), np.full(1500, 50.0))
    assert np.ptp(tension[-500:]) > 20.0


# Velocity


def test_a_steady_motion_has_its_velocity() -> None:
    motion = MotionEstimate()
    state = motion.initial(0.1)
    for k in range(1, 60):
        state, velocity = motion.step(state, 0.1 + 0.3 * k * DT, DT)
    assert float(velocity) == pytest.approx(
        0.3, rel=1e-9
    )  # 60 samples are 75 times the filter's time: rounding is left


def test_the_velocity_filter_is_one_pole() -> None:
    motion = MotionEstimate(cutoff=20.0)
    state = motion.initial(0.0)
    for k in range(1, 11):
        state, velocity = motion.step(state, 1.0 * k * DT, DT)
        assert float(velocity) == pytest.approx(1.0 - math.exp(-2.0 * math.pi * 20.0 * k * DT), rel=1e-9)


def test_counts_ripple_no_more_than_the_filter_lets_through() -> None:
    motion = MotionEstimate()
    rng = np.random.default_rng(3)
    state, worst = motion.initial(0.0), 0.0
    step = jax.jit(motion.step)
    for count in rng.integers(0, 2, 300):
        state, velocity = step(state, COUNT * count, DT)
        worst = max(worst, abs(float(velocity)))
    assert 0.0 < worst <= COUNT / DT * (1.0 - math.exp(-FILTER * DT))


# Form


@pytest.mark.parametrize(
    ("control", "arguments"),
    [
        (PressureControl(ki=1.0), (3e5, 1e5, DT, 1.0)),
        (PositionControl(), (0.12, 0.0, 0.0, 0.11, 0.0, 10.0, DT, 1.0)),
        (ForceControl(), (20.0, 10.0, 0.0, DT, 1.0)),
        (MotionEstimate(), (0.1, DT)),
    ],
)
def test_a_step_is_straight_line_and_keeps_its_types(control, arguments) -> None:
    state = control.initial(0.1) if isinstance(control, MotionEstimate) else control.initial()
    traced = jax.make_jaxpr(control.step)(state, *arguments)
    text = str(traced)
    assert " where" in text or "select_n" in text or isinstance(control, MotionEstimate)
    assert not [name for name in ("while", "cond[", "scan", "gather", "scatter", "argmin") if name in text]
    after, output = control.step(state, *arguments)
    assert [(y.shape, y.dtype) for y in jax.tree.leaves(after)] == [(x.shape, x.dtype) for x in jax.tree.leaves(state)]
    assert output.shape == ()
    assert output.dtype == jnp.float64


def test_a_batch_is_the_same_as_one_after_the_other() -> None:
    control = ForceControl()
    states = jax.vmap(lambda _: control.initial())(jnp.arange(3))
    tensions = jnp.asarray([0.0, 20.0, 40.0])
    _, several = jax.vmap(lambda s, t: control.step(s, 20.0, t, 0.1, DT, 1.0))(states, tensions)
    alone = [float(control.step(control.initial(), 20.0, t, 0.1, DT, 1.0)[1]) for t in tensions]
    assert np.allclose(several, alone, rtol=1e-14)
