"""A muscle without a tendon is tied to its anchors: taut as long as its span, slack at its free length, always passive."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mckibben as mk
from mckibben.assembly.build import rig_cord, several, unit_from_muscle, unit_from_specimen
from mckibben.assembly.linearise import linearise
from mckibben.assembly.loads import Body, ChainLink, JointLoad, LinkChain, MomentArm
from mckibben.assembly.muscle_unit import Clamp, MusclePath, TiedState, UnitState
from mckibben.engine.signals import Value
from mckibben.errors import InputError
from mckibben.muscles.hysteresis import Coulomb, FrictionLimit

ROOM = 101325.0


@functools.cache
def unit(rubs=True, muscle="nylon"):
    return unit_from_specimen(muscle, rubs=rubs)


def dragged(muscle, displacement, pressure):
    """Memory after a motion [m] at a gauge pressure [Pa]."""
    path = MusclePath(displacement, 0.0, pressure, pressure, lambda _: 0.0)
    return muscle.advance_memory(muscle.initial_memory(), path, 0.0)


def draws(count=400):
    """Spans [m], rates [m/s], sags [m], gauge pressures [Pa] and displacements of the friction before [m]."""
    rng = np.random.default_rng(7)
    sags = np.where(rng.random(count) < 0.5, 0.0, rng.uniform(0.0, 0.02, count))
    return np.stack(
        [rng.uniform(0.1, 0.16, count), rng.normal(0.0, 1.0, count), sags, rng.uniform(0.0, 7e5, count),
         rng.uniform(-0.01, 0.01, count)], axis=1,
    )  # fmt: skip


def motions(muscle, rows):
    def one(row):
        span, rate, sag, pressure, moved = row
        memory = dragged(muscle, moved, pressure)
        at = muscle.motion(TiedState(sag), memory, pressure, span, rate)
        return at, muscle.lost(at, span, rate)

    return jax.jit(jax.vmap(one))(jnp.asarray(rows))


def test_a_tied_muscle_never_pushes_and_never_gives_more_than_it_gets():
    at, lost = motions(unit(), draws())
    taut = np.asarray(at.tension) > 0.0
    assert 0.2 < taut.mean() < 0.8
    assert np.all(np.asarray(at.tension) >= 0.0)
    assert np.asarray(lost).min() > -1e-12  # rounding of some 10 W


@pytest.mark.parametrize("muscle", ["nylon", "DMSP-40-400"])
def test_at_rest_and_taut_its_tension_is_that_of_its_law_to_the_last_bit(muscle):
    own = unit(rubs=False, muscle=muscle)
    rows = draws() * [1.0, 0.0, 0.0, 1.0, 0.0]
    rows[:, 0] *= float(own.law.rest_length) / 0.14
    at, _ = motions(own, rows)
    law = jax.jit(jax.vmap(own.law.tension))(rows[:, 0], rows[:, 3])
    assert np.asarray(at.tension) == pytest.approx(np.asarray(law), rel=1e-14)  # of two compilations
    assert np.array_equal(np.asarray(at.length)[np.asarray(law) > 0.0], rows[np.asarray(law) > 0.0, 0])


def test_tension_is_continuous_where_a_taut_braid_begins_to_sag():
    """Along a rate that changes, at one length: no step of the tension is larger than the slope 2 eta allows."""
    for gauge in (1e5, 1.5e5, 3e5):
        rates = np.linspace(-6.0, 6.0, 12001)  # at 3 bar it begins to sag at -4.8 m/s
        rows = np.stack([np.full(12001, 0.14), rates, np.zeros(12001), np.full(12001, gauge), np.zeros(12001)], axis=1)
        tension = np.asarray(motions(unit(), rows)[0].tension)
        assert (tension == 0.0).any() and tension.max() > 1.0
        assert np.abs(np.diff(tension)).max() < 2.01 * float(unit().slack_damping) * 1e-3
        assert np.diff(tension).min() > -1e-12  # the faster it lengthens, the more it resists


def test_a_braid_shortens_alone_no_faster_than_its_own_damping_lets_it_whatever_slack_damping_is_stated():
    viscosity = 50.0  # [N s/m], of the taut braid; slack it resists no less
    damped = unit(rubs=False).replace(viscosity=viscosity, slack_damping=1.0)
    alone = -float(damped.law.tension(0.13, 3e5)) / viscosity
    at = damped.motion(TiedState(0.0), damped.initial_memory(), 3e5, 0.13, 2.0 * alone)
    assert float(at.tension) == 0.0  # its span comes towards it faster: it sags
    assert float(at.velocity) == pytest.approx(alone, rel=1e-14)  # rounding of a quotient


def test_what_sags_by_a_hair_goes_on_as_what_does_not_sag():
    """One future for each state: just below zero and just above, the sag changes the same way, or goes back to zero."""
    rows = draws()
    rows[:, 2] = 0.0
    flat, _ = motions(unit(), rows)
    rows[:, 2] = 1e-12
    sagging, _ = motions(unit(), rows)
    opening = np.asarray(sagging.velocity) - rows[:, 1]
    taut = np.asarray(flat.velocity) == rows[:, 1]
    assert 0.2 < taut.mean() < 0.95
    assert np.all(opening[taut] <= 1e-9)
    assert np.all(opening[~taut] > -1e-9)


def test_a_slack_muscle_settles_at_its_free_length():
    law = unit().law
    for gauge in (1e5, 3e5, 6e5):
        free, rest = float(law.free_length(gauge)), float(law.rest_length)
        if not 0.1 < free < rest:
            continue
        sim = mk.Simulation(mk.Plate(unit(rubs=False), span=free - 0.01), mk.Air(supply=8e5, valve="regulator"))
        sim.reset(pressure=gauge + 1e5, span=free - 0.01)
        for _ in range(1000):  # 2 s: where it is soft, it takes longer than `SLACK_TIME`
            seen = sim.step(muscle=gauge, span=free - 0.01)
        assert seen.tension == 0.0
        assert seen.length == pytest.approx(float(law.free_length(seen.pressure)), abs=1e-6)  # the gas still creeps


def cycles(step="0.1 ms", muscle="nylon", tendon=None):
    """Two cycles of a plate through slack and snap, at a held pressure."""
    sim = mk.Simulation(
        mk.Plate(muscle, span=0.13, tendon=tendon), mk.Air(supply="6 bar", valve="regulator"), period="5 ms", step=step
    )
    sim.reset(pressure=3e5)
    for k in range(100):
        sim.step(muscle=3e5, span=0.13 - 0.02 * np.sin(2.0 * np.pi * (k + 1) / 50.0))
    return sim.recording()


def test_through_slack_and_snap_accounts_close_with_the_order_of_the_steps():
    coarse, fine = (cycles(step).meta["balance"] for step in ("0.2 ms", "50 us"))
    for name in ("gas", "muscle", "mechanics", "energy", "exergy"):
        assert coarse[name] < 1e-6, coarse  # as with the cord of a test machine at 50 us
        assert fine[name] < coarse[name] / 3.0, (
            name,
            coarse,
            fine,
        )  # 4 to the order 2 is 16; jumps fall anywhere in a step


def test_the_state_after_slack_and_snap_converges():
    ends = [cycles(step) for step in ("0.2 ms", "0.1 ms", "50 us", "12.5 us")]
    tension = np.array([one["muscle.tension"][-1] for one in ends])
    errors = np.abs(tension[:-1] / tension[-1] - 1.0)
    assert errors[0] < 1e-7
    assert errors[2] < errors[0] / 4.0  # of order 1 at least, where the time of an event counts


def test_in_a_closed_cycle_the_work_of_the_loop_is_what_friction_and_dampers_took():
    """At one pressure the law gives back all work, so that the loop of the second cycle is the friction's ledger."""
    record = cycles("50 us")
    again = slice(50, 101)
    assert (record["muscle.slack"][again] == 1.0).sum() > 5
    moved, friction = record["muscle.length"][again], record["muscle.friction"][again]
    assert moved[0] == pytest.approx(moved[-1], abs=1e-6)
    assert friction[0] == pytest.approx(friction[-1], abs=1e-3)  # its memory comes back with the length
    meta = record.meta["friction"]
    assert 0.0 < meta["dissipated"] <= meta["work"] * (1.0 + 1e-12)
    parts = record.meta["energy"]["energy"]
    assert abs(parts["remainder"]) < 1e-6 * parts["throughput"]


def test_friction_that_depends_on_velocity_holds_a_slack_braid_or_slows_it_and_never_turns_it_back():
    limit = FrictionLimit(constant=4.0, per_pressure=0.0)
    muscle = unit_from_muscle(mk.Muscle(unit().law, Coulomb(limit=limit, smoothing_velocity=1e-3)))
    memory, law = muscle.initial_memory(), muscle.law
    free = float(law.free_length(3e5))
    for off in (-2e-3, -2e-5, 2e-5, 2e-3):
        at = muscle.motion(TiedState(free + off - 0.1), memory, 3e5, 0.1, 0.0)
        pull = float(law.braid_tension(free + off, 3e5))
        assert float(at.velocity) * pull <= 0.0
        held = abs(pull) < 4.0 * np.tanh(abs(pull) / float(muscle.slack_damping) / 1e-3)
        assert (float(at.velocity) == 0.0) == held or abs(pull) < 4.0


def test_a_clamp_needs_a_tendon_and_numbers_of_the_other_kind_are_refused():
    with pytest.raises(InputError, match="clamp needs a tendon that it holds, and the muscle has none"):
        unit().replace(clamp=Clamp(grip=50.0))
    with pytest.raises(InputError, match="end_mass must be left out: a muscle without tendon has none"):
        unit_from_specimen("nylon", end_mass=0.1)
    with pytest.raises(InputError, match="slack_damping must be left out: a muscle with a tendon has none"):
        unit_from_specimen("nylon", tendon=rig_cord(), slack_damping=3.0)
    corded = unit().replace(tendon=rig_cord())
    assert corded.slack_damping is None
    assert float(corded.end_mass) == 0.02
    assert corded.replace(tendon=None).end_mass is None
    assert isinstance(corded.resting(UnitState(0.14, 0.0), 0.141), UnitState)


# ---- bounds of rates

ARM = MomentArm(coefficients=np.array([0.02]), span=0.135)
BACK = MomentArm(coefficients=np.array([-0.02]), span=0.135)
LINK = {"length": 0.3, "mass": 0.6, "centre": 0.15, "inertia": 4.5e-3, "damping": 0.01, "stop_stiffness": 2e4}
LOADS = {
    "body": Body(held=("a", "b"), start=0.135, mass=0.05, stiffness=3e3, spring_rest=0.1, damping=4.0),
    "joint": JointLoad(arms={"a": ARM, "b": BACK}, inertia=1e-4, damping=0.02, stiffness=2.0, gravity_moment=0.4),
    "joint at its stop": JointLoad(arms={"a": ARM, "b": BACK}, inertia=2e-3, start=0.11, upper_stop=0.1),
    "chain": LinkChain(
        {"1": ChainLink(**LINK), "2": ChainLink(**{**LINK, "mass": 0.05, "inertia": 1e-5, "start": 0.3})},
        {"a": {"1": ARM}, "b": {"1": BACK, "2": BACK}}, order=("1", "2"), gravity=9.81,
    ),
}  # fmt: skip


@pytest.mark.parametrize("load", LOADS)
def test_no_mode_is_faster_than_the_bound_and_the_bound_is_no_larger_than_it_needs_to_be(load):
    machine = several({"a": unit(), "b": unit()}, LOADS[load], supply=6e5)
    inputs = {name: Value(jnp.zeros(()), jnp.zeros(())) for name in machine.signals()}
    state, memory = machine.initial(dict.fromkeys(machine.circuit.chambers, ROOM + 4e5), inputs)
    model = linearise(machine, state, memory, inputs, inputs_by_name=(), outputs=(), friction="stuck")
    fastest = float(np.abs(model.eigenvalues()).max())
    bound = float(machine.max_rate_bound(state, memory, inputs))
    assert fastest <= bound * (1.0 + 1e-9)
    assert bound < 20.0 * fastest
