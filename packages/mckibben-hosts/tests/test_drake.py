"""Muscles in Drake: the same motion as a loop of ours in every kind of plant, equal bits in copies, and what is refused."""

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.simulation.air import Air
from mckibben_hosts import Part
from mckibben_hosts.conformance import STATE_CHECKS, adapter

pytest.importorskip("pydrake", reason="Drake is not installed")
SPAN, MASS, STEP, COUNT, VALVE = 0.14, 4.0, 1e-3, 60, 0.3


@pytest.fixture(scope="module")
def part() -> Part:
    return Part("nylon", Air(supply="6 bar"), span=SPAN)


def diagram(part: Part, *, step: float, sampled: bool = True, joint: str = "height"):
    """A weight on a slider, whose position is its height over the start."""
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia
    from pydrake.systems.framework import DiagramBuilder

    from mckibben_hosts.drake import add_muscles

    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(step))
    if step:
        plant.SetUseSampledOutputPorts(sampled)
    body = plant.AddRigidBody("weight", SpatialInertia(MASS, [0.0, 0.0, 0.0], UnitInertia.SolidSphere(0.03)))
    plant.AddJoint(PrismaticJoint("height", plant.world_frame(), body.body_frame(), [0.0, 0.0, 1.0]))
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -9.81])
    plant.Finalize()
    muscles = add_muscles(builder, plant, part, arms={"muscle": {joint: 1.0}}, spans={"muscle": SPAN}, period=STEP)
    builder.ExportInput(muscles.GetInputPort("command"), "valve")
    return builder.Build(), plant, muscles


@pytest.mark.parametrize(
    ("step", "sampled"),
    [(STEP, True), (STEP, False), (0.0, False)],
    ids=["discrete, sampled", "discrete", "continuous"],
)
def test_drake_moves_a_weight_as_a_loop_of_the_same_kind_does(part, step, sampled):
    from pydrake.systems.analysis import Simulator

    built, plant, muscles = diagram(part, step=step, sampled=sampled)
    simulator = Simulator(built)
    context = simulator.get_mutable_context()
    built.GetInputPort("valve").FixValue(context, [VALVE])
    simulator.AdvanceTo(COUNT * STEP)
    span, rate, state = SPAN, 0.0, part.rest(SPAN, muscle=VALVE)
    for _ in range(COUNT):
        state, seen = part.step(state, period=STEP, span=span, rate=rate, staggered=step > 0.0, muscle=VALVE)
        before = rate
        rate += STEP * (9.81 - seen.tension / MASS)
        span += STEP * (rate if step else 0.5 * (before + rate))
    assert abs(span - SPAN) > 5e-3
    # the same equations: rounding, and for the continuous plant the accuracy of an integrator of third order on a parabola
    assert plant.GetPositions(plant.GetMyContextFromRoot(context))[0] == pytest.approx(SPAN - span, abs=1e-9)
    inside = muscles.GetMyContextFromRoot(context)
    np.testing.assert_allclose(muscles.shown(inside, "pressure"), [seen.pressure], rtol=1e-7)
    np.testing.assert_allclose(muscles.shown(inside, "work"), [seen.work], atol=1e-6)


def test_contexts_of_drake_keep_their_bits_when_saved_copied_reset_and_on_threads():
    host = adapter("drake")
    assert {name: check(host) for name, check in STATE_CHECKS.items()} == dict.fromkeys(STATE_CHECKS, True)
    host.close()


def test_joints_that_a_muscle_cannot_move_are_refused(part):
    with pytest.raises(InputError, match="height"):
        diagram(part, step=STEP, joint="heights")
    with pytest.raises(InputError, match="must be greater than 0 s"):
        from mckibben_hosts.drake import MuscleSystem

        MuscleSystem(part, 0.0)
