"""Encoder and motor: counts, limits of current and voltage, speed, and where the power goes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.bench.hardware import Encoder, Motor
from mckibben.bench.hardware.stand import TestStand
from mckibben.errors import InputError

H = 50e-6  # the physics' step [s]


@pytest.mark.parametrize("edges", [1, 2, 4])
def test_an_encoder_resolves_the_circumference_over_its_counts(edges):
    encoder = Encoder(edges=edges)
    resolution = 2.0 * np.pi * 0.02 / (1600 * edges)
    assert float(encoder.resolution) == pytest.approx(resolution, rel=1e-15)
    x = np.random.default_rng(2).uniform(0.05, 0.25, 20_000)
    count = np.asarray(encoder.count(x, 0.14))
    assert np.array_equal(count, np.round(count))
    error = np.abs(np.asarray(encoder.span(count, 0.14)) - x)
    assert error.max() <= 0.5 * resolution * (1.0 + 1e-9)
    assert error.max() > 0.49 * resolution
    turn = encoder.count(0.14 + 2.0 * np.pi * 0.02, 0.14)
    assert float(turn) == 1600 * edges


def test_the_24_bit_counter_wraps_in_twos_complement():
    encoder = Encoder()
    half = 2**23
    assert float(encoder.travel()) == pytest.approx(half * float(encoder.resolution), rel=1e-15)
    for turned, shown in (
        (half - 1, half - 1),
        (half, -half),
        (half + 1, 1 - half),
        (-half, -half),
        (-half - 1, half - 1),
    ):
        assert float(encoder.count(turned * float(encoder.resolution), 0.0)) == shown
    # and as NumPy's own wrapping of whole numbers does it, eight bits wide
    small = Encoder(counter_bits=8)
    turned = np.arange(-1000, 1001)
    found = np.asarray(small.count(turned * float(small.resolution), 0.0))
    assert np.array_equal(found, turned.astype(np.int8).astype(float))


def test_encoders_that_do_not_exist_are_refused():
    for changes in ({"edges": 3}, {"steps_per_turn": 0}, {"steps_per_turn": 1600.0}, {"counter_bits": 2}):
        (name,) = changes
        with pytest.raises(InputError, match=f"{name} must be"):
            Encoder(**changes)


# ---- the motor's own limits


def test_the_papers_motor_pulls_264_newton_at_24_ampere_and_no_more():
    motor = Motor()
    assert float(motor.largest_force) == pytest.approx(264.0, rel=1e-12)
    assert float(motor.pull(24.0, 0.0)) == pytest.approx(264.0, rel=1e-12)
    assert float(motor.force_to_current(264.0)) == pytest.approx(24.0, rel=1e-12)
    assert float(motor.force_to_current(1e4)) == 24.0
    assert float(motor.force_to_current(-1e4)) == -24.0
    assert float(motor.force_to_current(110.0)) == pytest.approx(10.0, rel=1e-12)
    assert float(motor.mass) == pytest.approx(0.075, rel=1e-12)


def test_a_weak_supply_limits_the_force_before_the_amplifier_does():
    motor = Motor(supply_voltage=12.0, speed_limit=100.0)
    assert float(motor.largest_force) == pytest.approx(12.0 / 0.8 * 11.0, rel=1e-12)
    _, i, _ = driven(motor, np.full(800, 24.0), blocked=True)
    assert i[-1] == pytest.approx(15.0, rel=1e-9)  # 160 time constants L/R later


def test_the_friction_of_the_motor_opposes_motion_and_is_none_at_rest():
    motor = Motor()
    v = np.array([-1.0, -1e-3, 0.0, 1e-3, 1.0])
    friction = np.asarray(motor.friction(v))
    assert friction[2] == 0.0
    assert np.array_equal(np.sign(friction), np.sign(v))
    assert friction[-1] == pytest.approx(0.2 + 1.0, rel=1e-4)  # 1 - (vs/v)^2/2 of the dry friction


@jax.jit
def run(motor, begin, asked, blocked, outside, h):
    """Speed, current and energies after every Runge-Kutta step of the motor alone, (steps, 7)."""

    def rate(y, wanted):
        v, i = y[0], y[1]
        dv = jnp.where(blocked, 0.0, (motor.pull(i, v) + outside) / motor.mass)
        p = motor.powers(i, v, wanted)
        energies = p.electrical, p.copper, p.mechanical, p.friction, outside * v
        return jnp.stack([dv, motor.rates(i, v, wanted), *energies])

    def one(y, wanted):
        k1 = rate(y, wanted)
        k2 = rate(y + 0.5 * h * k1, wanted)
        k3 = rate(y + 0.5 * h * k2, wanted)
        k4 = rate(y + h * k3, wanted)
        new = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return new, new

    return jax.lax.scan(one, begin, asked)[1]


def driven(motor, asked, *, blocked=False, outside=0.0, h=H):
    """The motor from rest; its pulley turns freely under a force that lengthens [N], or is blocked.

    Returns:
        speeds [m/s], currents [A] and energies [J] after every step, of a current asked for in each [A].
    """
    y = np.asarray(run(motor, jnp.zeros(7), jnp.asarray(asked, float), blocked, outside, h))
    return y[:, 0], y[:, 1], y[:, 2:]


def test_a_small_step_of_current_rises_with_the_bandwidth_of_the_loop():
    motor = Motor(current_bandwidth=400.0)
    _, i, _ = driven(motor, np.full(60, 2.0), blocked=True)  # 2 A over 0.2 mH at 400 Hz take 1 V
    t = H * (1 + np.arange(60))
    assert i == pytest.approx(2.0 * (1.0 - np.exp(-2.0 * np.pi * 400.0 * t)), rel=1e-5)  # (rate h)^4/120 = 2e-6


@pytest.mark.parametrize("frequency", [100.0, 400.0, 1600.0])
def test_a_sine_of_current_passes_as_through_one_pole_of_that_bandwidth(frequency):
    motor = Motor(current_bandwidth=400.0)
    h, steps = 5e-6, 8000  # held for each step of 5 us, which is a delay of half of it
    t = h * np.arange(steps)
    _, i, _ = driven(motor, np.sin(2.0 * np.pi * frequency * t), blocked=True, h=h)
    late = t[steps // 2 :] + h
    found = 2.0 * np.mean(i[steps // 2 :] * np.exp(-2j * np.pi * frequency * late)) * 1j
    exact = 1.0 / (1.0 + 1j * frequency / 400.0) * np.exp(-2j * np.pi * frequency * 0.5 * h)
    assert abs(found / exact - 1.0) < 1e-3  # holding a sine loses (pi f h)^2/6 = 1e-4 of it


def test_a_large_step_of_current_rises_only_as_fast_as_the_supply_allows():
    motor = Motor(inductance=2e-3)  # the loop would want 302 V for 24 A at once
    assert float(motor.rates(0.0, 0.0, 24.0)) == pytest.approx(48.0 / 2e-3, rel=1e-12)
    assert float(motor.rates(24.0, 0.0, -24.0)) == pytest.approx((-48.0 - 0.8 * 24.0) / 2e-3, rel=1e-12)
    assert float(motor.rates(0.0, 2.0, 24.0)) == pytest.approx((48.0 - 22.0) / 2e-3, rel=1e-12)  # less 11 N/A 2 m/s
    assert float(motor.rates(0.0, 0.0, 1.0)) == pytest.approx(2.0 * np.pi * 1000.0, rel=1e-12)  # it has enough for 1 A


# ---- speed


def test_the_back_emf_stops_a_free_pulley_at_the_no_load_speed():
    """Without friction, and with the watch over the speed out of the way: U r/k."""
    motor = Motor(viscous=0.0, coulomb=0.0, speed_limit=100.0)
    v, i, _ = driven(motor, np.full(2000, 24.0))
    assert v[-1] == pytest.approx(48.0 * 0.02 / 0.22, rel=1e-9)
    assert float(motor.largest_speed) == pytest.approx(v[-1], rel=1e-9)
    assert abs(i[-1]) < 1e-6
    back, _, _ = driven(motor, np.full(2000, -24.0))
    assert np.array_equal(back, -v)


def test_a_loaded_pulley_runs_on_its_speed_torque_line():
    motor = Motor(speed_limit=100.0)
    for load in (0.0, 40.0, 100.0):
        v, i, _ = driven(motor, np.full(3000, 24.0), outside=-load)
        need = (load + 0.2 * v[-1] + 1.0) / 11.0  # dry friction is full at metres a second, to 1e-5
        assert i[-1] == pytest.approx(need, rel=1e-4)
        assert v[-1] == pytest.approx((48.0 - 0.8 * need) / 11.0, rel=1e-4)


@pytest.mark.parametrize("asked", [24.0, -24.0, 5.0])
def test_a_free_pulley_exceeds_neither_its_speed_limit_nor_what_the_voltage_permits(asked):
    """Trap 4 of a free load: 264 N on 75 g would reach 7 m/s after 2 ms, and 100 m/s in the end."""
    motor = Motor()
    v, _, _ = driven(motor, np.full(1000, asked))
    assert np.abs(v).max() < float(motor.no_load_speed)
    assert np.abs(v).max() < 1.1 * float(motor.speed_limit)  # the current lags: half the band beyond, and no more
    assert abs(v[-1]) <= float(motor.largest_speed)
    assert abs(v[-1]) > 0.7 * float(motor.largest_speed)  # it is not braked below the band


def test_the_watch_over_the_speed_brakes_a_pulley_that_a_muscle_pulls():
    motor = Motor()
    v, i, _ = driven(motor, np.zeros(2000), outside=-110.0)
    assert v[-1] < -3.0
    assert v[-1] > -3.3  # 10 A of the 24 A that 0.6 m/s take
    assert i[-1] == pytest.approx((110.0 - 1.0 - 0.2 * abs(v[-1])) / 11.0, rel=1e-3)


def test_within_the_band_the_current_is_taken_back_and_the_other_way_stays_free():
    motor = Motor()
    assert float(motor.allowed_current(2.3, 24.0)) == 24.0  # 0.8 of 3 m/s are 2.4
    assert float(motor.allowed_current(2.7, 24.0)) == pytest.approx(12.0)
    assert float(motor.allowed_current(3.0, 24.0)) == pytest.approx(0.0, abs=1e-12)
    assert float(motor.allowed_current(2.9, -24.0)) == -24.0
    assert float(motor.allowed_current(-2.7, -24.0)) == pytest.approx(-12.0)
    assert float(motor.allowed_current(1e3, 24.0)) == -24.0


# ---- power


def test_the_electrical_power_goes_into_copper_motion_and_coil():
    """Over a run with the ceiling, the speed limit and reversals in it; the coil's energy from the end states."""
    motor = Motor()
    asked = np.concatenate([np.full(400, 24.0), np.full(300, -24.0), np.full(300, 8.0), np.zeros(200)])
    asked = np.repeat(asked, 5)
    v, i, sums = driven(motor, asked, outside=-20.0, h=1e-5)
    electrical, copper, mechanical, friction, outside = sums[-1]
    assert electrical > 1.0
    assert copper > 0.1
    assert friction > 0.0
    turnover = np.abs(np.diff(sums[:, 0])).sum()
    coil = 0.5 * float(motor.inductance) * i[-1] ** 2  # magnetic energy of the coil [J]
    # Each jump of the command and each corner of the ceiling costs the quadrature up to (rate h)^4 of a step's energy.
    assert abs(electrical - copper - mechanical - coil) < 1e-6 * turnover
    kinetic = 0.5 * 0.075 * v[-1] ** 2
    assert abs(mechanical + outside - friction - kinetic) < 1e-6 * turnover


def test_a_pulley_that_is_braked_gives_power_back():
    motor = Motor()
    powers = motor.powers(-10.0, 2.0, -10.0)
    assert float(powers.mechanical) == pytest.approx(-220.0)
    assert float(powers.copper) == pytest.approx(80.0)
    assert float(powers.electrical) == pytest.approx(-140.0)
    assert float(powers.friction) > 0.0


def test_motors_that_cannot_be_are_refused():
    for changes in ({"torque_constant": 0.0}, {"resistance": -1.0}, {"inductance": 0.0}, {"speed_limit": np.nan}):
        (name,) = changes
        with pytest.raises(InputError, match=f"{name} must be"):
            Motor(**changes)


def test_a_stand_has_a_signal_if_it_has_a_motor_and_stands_where_it_begins_without_one():
    fixed, driven = TestStand(held=("m",), start=0.13), TestStand(held=(), motor=Motor(), start=0.14, signal="pull")
    assert (fixed.signals(), driven.signals()) == ((), ("pull",)) and (fixed.muscles(), driven.muscles()) == (
        ("m",),
        (),
    )
    assert [float(one.position(one.initial())) for one in (fixed, driven)] == [0.13, 0.14]
    state = fixed.initial()._replace(deflection=jnp.asarray(1e-3), deflection_velocity=jnp.asarray(2e-3))
    assert [float(x) for x in fixed.spans(state, {})["m"]] == pytest.approx([0.129, -2e-3], rel=1e-12)
    moved = driven.replace(held=("m",)).initial()._replace(velocity=jnp.asarray(0.5))
    assert [float(x) for x in driven.replace(held=("m",)).spans(moved, {})["m"]] == [0.14, 0.5]
    assert float(fixed.asked_current({})) == 0.0
    for changes, said in (({"held": ("a", "b")}, "must be one muscle or none"), ({"signal": None}, "needs the name")):
        with pytest.raises(InputError, match=said):
            driven.replace(**changes)
