"""The test stand: what the frame yields, and a machine whose muscle the motor drives keeps its accounts."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.assembly.accounts import accounts
from mckibben.assembly.build import rig_cord, single_muscle, unit_from_specimen
from mckibben.bench.hardware import Frame, FrameState, Motor, StandState, TestStand
from mckibben.engine import Result, Run, held, march
from mckibben.engine.signals import Value
from mckibben.errors import InputError
from mckibben.pneumatics.volume import WallHeat

PERIOD, SAMPLES, INNER = 1e-3, 250, 20
ROOM, SUPPLY = 101325.0, 6e5
compiled = jax.jit(march, static_argnums=(6, 7))  # one machine of one structure, whatever its parameters


@functools.cache
def nylon():
    return unit_from_specimen("nylon", tendon=rig_cord(), viscosity=1.0)


def machine(start=0.14, frame=None, heat=0.2, **motor):
    stand = TestStand(held=("m",), frame=frame or Frame(), motor=Motor(**motor), start=start)
    return single_muscle(nylon(), stand, supply=SUPPLY, heat=WallHeat(conductance=heat))


def switched(opening, begin, end):
    index = np.arange(SAMPLES + 1)
    return held(np.where((index >= begin) & (index < end), opening, 0.0))


NOTHING = switched(0.0, 0, 0)


def go(subject, signals, pressure=ROOM, inner=INNER):
    """A run from rest, with its accounts."""
    first, last = ({n: s.at(i, x, PERIOD) for n, s in signals.items()} for i, x in ((0, 0.0), (SAMPLES - 1, 1.0)))
    begin = subject.initial(dict.fromkeys(subject.circuit.chambers, pressure), first)
    carry, kept = jax.tree.map(np.asarray, compiled(subject, *begin, signals, PERIOD, inner, SAMPLES, False))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves((carry, kept)))
    known = {
        "time": PERIOD * np.arange(SAMPLES + 1), "outputs": kept[2], "state": carry[0], "memory": carry[1],
        "integrals": carry[2], "result": Result.DONE, "stiff": False, "step": PERIOD / inner,
    }  # fmt: skip
    run = Run(*(known.get(name) for name in Run._fields))
    return run, accounts(subject, begin, run, first, last)


def closes(account, within=1e-6):
    """All accounts at 50 us, as those of other machines close."""
    assert account.mass < 1e-12, account  # a sum of the same flows twice: rounding
    for name in ("gas", "muscle", "mechanics", "energy"):
        assert getattr(account, name) < within, account


# ---- the muscle on the motor


@pytest.mark.parametrize("heat", [0.0, 0.2])
def test_a_muscle_driven_by_motor_forces_keeps_its_accounts(heat):
    """Filled and vented while the motor's force goes up and down in jumps; the motor gives and takes energy."""
    force = np.repeat([20.0, 60.0, 35.0, 80.0, 10.0, 45.0, 25.0, 70.0, 15.0, 15.0], SAMPLES // 10)
    signals = {
        "m.fill": switched(1.0, 5, 100),
        "m.vent": switched(1.0, 130, 250),
        "motor": held(np.append(force, 15.0)),
    }
    run, account = go(machine(heat=heat), signals, 2e5)
    assert run.outputs["m.tension"].max() > 60.0
    assert np.ptp(run.outputs["load.position"]) > 0.02
    assert np.ptp(run.outputs["load.deflection"]) > 5e-5
    integrals = {k: float(v) for k, v in run.integrals.items()}
    assert integrals["outside_turnover"] > 1.5 * abs(integrals["outside"]) > 0.0
    closes(account)


def test_a_muscle_that_the_motor_makes_slack_and_meets_again_keeps_its_accounts():
    """The speed limit does it: the pulley meets the tendon at metres a second, and no faster."""
    whipped = np.concatenate([np.full(20, 20.0), np.tile(np.repeat([-60.0, 60.0], [12, 18]), 8)])
    signals = {"m.fill": NOTHING, "m.vent": NOTHING, "motor": held(np.resize(whipped, SAMPLES + 1))}
    subject = machine()
    run, account = go(subject, signals, 4e5)
    slack, tension = run.outputs["m.slack"], run.outputs["m.tension"]
    assert np.count_nonzero(np.diff(slack) < 0.0) >= 5  # met again and again
    assert tension.max() > 80.0
    speed = np.abs(run.outputs["load.velocity"]).max()
    assert 2.0 < speed < 1.1 * float(subject.load.motor.speed_limit)
    closes(account)
    unwatched, _ = go(machine(speed_limit=100.0, supply_voltage=500.0), signals, 4e5)
    assert np.abs(unwatched.outputs["load.velocity"]).max() > 3.0 * speed


def test_a_held_muscle_pulls_the_frame_by_its_tension_over_the_stiffness():
    frame = Frame(stiffness=2e5, mass=1.0, damping=400.0)
    signals = {"m.fill": NOTHING, "m.vent": NOTHING, "motor": held(np.full(SAMPLES + 1, 50.0))}
    run, _ = go(machine(frame=frame, viscous=100.0, coulomb=0.0), signals, 4e5)
    out = run.outputs
    assert np.abs(out["load.velocity"][-1]) < 1e-3
    assert out["m.tension"][-1] == pytest.approx(50.0, rel=2e-3)  # the rest is still friction of the motion
    assert out["load.deflection"][-1] == pytest.approx(out["m.tension"][-1] / 2e5, rel=2e-3)
    assert out["load.position"] - out["load.deflection"] == pytest.approx(out["m.span"], rel=1e-15)
    assert out["load.current"][-1] == pytest.approx(50.0 / 11.0, rel=1e-9)


# ---- the stand alone


def settle(stand, tension, force=0.0, steps=40_000, h=2.5e-5):
    """The state after a time under a constant tension, by Runge-Kutta steps."""
    inputs = {"motor": Value(jnp.asarray(force, float), jnp.zeros(()))}
    tensions = {"m": jnp.asarray(tension, float)}

    def add(y, k, a):
        return jax.tree.map(lambda u, v: u + a * v, y, k)

    def all_steps(state):
        def one(y, _):
            k1 = stand.rates(y, tensions, inputs)
            k2 = stand.rates(add(y, k1, 0.5 * h), tensions, inputs)
            k3 = stand.rates(add(y, k2, 0.5 * h), tensions, inputs)
            k4 = stand.rates(add(y, k3, h), tensions, inputs)
            new = jax.tree.map(lambda u, a, b, c, d: u + h / 6.0 * (a + 2.0 * b + 2.0 * c + d), y, k1, k2, k3, k4)
            return new, (new, stand.powers(y, tensions, inputs))

        return jax.lax.scan(one, state, None, length=steps)

    return jax.tree.map(np.asarray, jax.jit(all_steps)(stand.initial()))


@pytest.mark.parametrize("stiffness", [1e5, 1e6, 3e7])
def test_at_rest_a_frame_yields_by_force_over_stiffness(stiffness):
    stand = TestStand(held=("m",), frame=Frame(stiffness=stiffness, damping=500.0), start=0.14)
    end, _ = settle(stand, 110.0)
    assert isinstance(end, FrameState)
    assert end.deflection == pytest.approx(110.0 / stiffness, rel=1e-9)
    span = stand.spans(end, {})["m"]
    assert float(span.span) == pytest.approx(0.14 - 110.0 / stiffness, rel=1e-12)
    assert float(stand.position(end)) == 0.14


def test_the_frame_rings_at_its_own_frequency_and_loses_what_its_damper_takes():
    frame = Frame(stiffness=1e6, mass=2.0, damping=20.0)
    stand = TestStand(held=("m",), frame=frame, start=0.14)
    steps, h = 8000, 2.5e-5
    end, (along, powers) = settle(stand, 100.0, steps=steps, h=h)
    above = along.deflection > 1e-4
    crossings = np.flatnonzero(above[1:] & ~above[:-1])
    period = h * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    assert 1.0 / period == pytest.approx(np.sqrt(1e6 / 2.0) / (2.0 * np.pi), rel=1e-3)  # crossings known to a step
    work = 100.0 * end.deflection
    lost = h * powers[1].sum()  # by the rectangle rule, first order in h: 2 % of a quarter of the work
    assert lost == pytest.approx(work - float(stand.stored_energy(end)), rel=0.02)
    assert np.all(powers[0] == 0.0)


def test_a_fixed_end_has_neither_motor_nor_signal():
    stand = TestStand(held=("m",), start=0.14)
    assert stand.signals() == ()
    state = stand.initial()
    assert isinstance(state, FrameState)
    assert set(stand.outputs(state, {"m": 1.0}, {})) == {"deflection"}


def test_a_stand_with_a_motor_shows_what_a_recording_of_it_needs():
    stand = TestStand(held=("m",), motor=Motor(), start=0.13)
    assert stand.signals() == ("motor",)
    state = stand.initial()
    assert isinstance(state, StandState)
    assert set(stand.outputs(state, {"m": 0.0}, {})) == {"position", "velocity", "current", "deflection"}
    assert float(stand.spans(state, {})["m"].span) == 0.13


def test_a_muscle_shortens_and_the_motor_lengthens_the_span():
    stand = TestStand(held=("m",), motor=Motor(), start=0.14)
    pulled, _ = settle(stand, 50.0, steps=40)
    driven, _ = settle(stand, 0.0, force=50.0, steps=40)
    assert pulled.position < 0.14 < driven.position
    assert pulled.velocity < 0.0 < driven.velocity
    assert pulled.deflection > 0.0  # towards the motor


def test_a_stand_without_a_muscle_turns_freely():
    stand = TestStand(held=(), motor=Motor(coulomb=0.0), start=0.14)
    assert stand.muscles() == ()
    assert stand.spans(stand.initial(), {}) == {}
    end, _ = settle(stand, 0.0, force=22.0, steps=400)
    assert end.current == pytest.approx(2.0, rel=1e-6)  # 60 time constants of the current loop
    assert end.deflection == 0.0
    lag = 1.0 / (2.0 * np.pi * 1000.0)
    gone = 0.01 - lag  # the force comes later by the lag of the current
    assert end.velocity == pytest.approx(22.0 / 0.075 * gone, rel=0.03)  # less the viscous share, c t/2m = 1.3 %


def test_stands_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="held must be one muscle or none, got 'a, b'"):
        TestStand(held=("a", "b"), start=0.14)
    with pytest.raises(InputError, match="signal"):
        TestStand(held=("m",), motor=Motor(), start=0.14, signal=None)
    with pytest.raises(InputError, match="start must be"):
        TestStand(held=("m",), start=-1.0)
