"""Laws of the steps that a simulation chooses: by the modes that are known, and by the balances where that is not enough."""

import jax.numpy as jnp
import numpy as np
import pytest

import mckibben as mk
from mckibben.engine import sampled
from mckibben.engine.rates import RK4_LIMIT
from mckibben.errors import ConvergenceError

ALL = ("mass", "gas", "muscle", "mechanics", "energy")  # exergy closes where these do


STEP = 1.3e-4  # which the bounds of the modes allow for the plate, and its balances do not [s]


def fast_plate(step=STEP):
    """A nylon muscle whose plate jumps by a centimetre at 5 m/s while its valve fills and vents: hard on any step."""
    return mk.Simulation(mk.Plate("nylon", span=0.13), mk.Air(supply="6 bar"), period=2e-3, step=step)


def commands(k):
    """Of sample k."""
    return {"muscle": 1.0 if k % 4 < 2 else -1.0, "span": 0.13 + (0.01 if k % 2 else 0.0)}


def run(sim, samples=20):
    """Observations of some samples."""
    sim.reset(pressure=2e5)
    return np.array([sim.step(**commands(k)) for k in range(samples)])


@pytest.fixture
def balances_alone(monkeypatch):
    """The plate's muscle gets slack as well, which asks for shorter steps before its balances do."""
    monkeypatch.setattr(sampled, "PLACING", 1)


@pytest.mark.usefixtures("balances_alone")
def test_a_sample_whose_balance_does_not_close_is_done_again_with_shorter_steps():
    sim = fast_plate()
    rows = run(sim)
    meta = sim.recording().meta
    assert sim._kernel.rate_bound * meta["timing"]["step"] < RK4_LIMIT  # no bound asks for less
    assert meta["timing"]["shortest_step"] == 0.5 * meta["timing"]["step"]
    assert max(meta["balance"][name] for name in ALL) < 1e-3
    fine = run(fast_plate(step=2e-5))
    # the limit of the trial: pressures and tensions within 1 % of a tenth of the step, here at every sample
    scale = np.abs(fine).max(axis=0)
    assert (np.abs(rows - fine) <= 0.01 * scale).all()


@pytest.mark.parametrize("step", [2e-4, 1e-4])
def test_a_muscle_that_gets_taut_with_a_snap_pulls_as_with_a_tenth_of_the_step(step):
    """A light load is thrown up and falls back; a step that misses the moment of taut is off by 2 to 4 % of the pull."""

    def tensions(step):
        system = mk.Weight("SM40", mass=0.578, start="19.4 cm")
        sim = mk.Simulation(system, mk.Air(supply="5 bar", valve="MHE2-3-2"), period=5e-3, step=step)
        sim.reset(pressure=1e5)
        return np.array([sim.step(muscle=1.0 if k < 40 else 0.0).tension for k in range(80)])

    usual, fine = tensions(step), tensions(2e-5)
    assert (usual == 0.0).any() and (usual > 0.0).any()
    # the limit of the trial, of the largest
    assert usual.max() == pytest.approx(fine.max(), rel=0.01)
    assert usual[-1] == pytest.approx(fine[-1], rel=0.01, abs=0.01 * fine.max())


def test_a_lane_chooses_its_steps_as_it_would_alone_and_a_recording_chooses_them_again():
    sim = fast_plate()
    alone = run(sim)
    many = sim.batch(3)
    many.reset(pressure=2e5)
    calm = dict(span=np.full(3, 0.13), muscle=np.zeros(3))
    rows = []
    for k in range(len(alone)):
        for name, value in commands(k).items():
            calm[name][1] = value  # the lanes beside it stay at rest, and take the usual steps
        rows.append([field[1] for field in many.step(**calm)[1:]])
    assert np.array_equal(np.array(rows), alone[:, 1:])
    assert np.array_equal(sim.recording()["muscle.pressure"][1:], alone[:, sim.Observation._fields.index("pressure")])
    shortest = [many.recording(lane).meta["timing"]["shortest_step"] for lane in range(2)]
    assert shortest[0] == many.recording(0).meta["timing"]["step"] == sampled.PLACING * shortest[1]


def test_a_sample_that_shorter_steps_do_not_help_ends_with_the_balance_and_what_would_do(monkeypatch):
    monkeypatch.setattr(sampled, "MOST_HALVED", 1)
    sim = fast_plate()
    with pytest.raises(
        ConvergenceError, match=r"balance of the (gas|mechanics) does not close: it is off by .* shorter step"
    ):
        run(sim)
    seen = sim.save_state()  # the simulation stays where it was
    assert np.isfinite(seen.carry).all()
    many = sim.batch(2)
    many.reset(pressure=2e5)
    with pytest.raises(ConvergenceError, match="Lane 0 cannot go on. The energy balance"):
        for k in range(20):
            many.step(**commands(k))


def test_a_rollout_says_where_a_balance_does_not_close():
    def policy(parameters, seen):
        sample = jnp.round(seen.time / 2e-3)
        return {
            "muscle": parameters["valve"] * jnp.where(sample % 4 < 2, 1.0, -1.0),
            "span": 0.13 + 0.01 * (sample % 2),
        }

    sim = fast_plate()
    sim.reset(pressure=2e5)
    rollout = sim.rollout(policy, steps=12, cost=lambda seen, commands: seen.pressure)
    with pytest.raises(ConvergenceError, match="Sample .* is not sound. The energy balance"):
        rollout({"valve": 1.0})
    assert np.isnan(rollout.as_function()({"valve": 1.0}))
