"""Every load at any moment, without a run: what enters is stored or lost, and no mode is faster than its bound."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.assembly.loads import Body, ChainLink, JointLoad, LinkChain, MomentArm, PlateLoad
from mckibben.assembly.loads.load import Restraint
from mckibben.bench.hardware import Motor
from mckibben.bench.hardware.stand import Frame, TestStand
from mckibben.engine.signals import Value


def arm(*coefficients, span=0.14):
    return MomentArm(coefficients=np.array(coefficients), span=span)


ARMS = {"a": arm(0.02, -0.004, 0.003), "b": arm(-0.015, 0.002, span=0.15)}
HINGE = {
    "damping": 0.03,
    "stiffness": 1.5,
    "spring_rest": 0.2,
    "lower_stop": -0.5,
    "upper_stop": 0.6,
    "stop_stiffness": 9.0,
}
LINK = {"length": 0.3, "mass": 0.5, "centre": 0.12, "inertia": 4e-3, "signal": "push"}
LOADS = {
    "body": Body(
        held=("a", "b"), start=0.13, mass=2.0, weight=15.0, stiffness=300.0, spring_rest=0.12, damping=4.0, signal="push"
    ),
    "joint": JointLoad(arms=ARMS, inertia=3e-3, gravity_moment=0.8, signal="push", **HINGE),
    "chain": LinkChain(
        links={"near": ChainLink(**LINK, **HINGE), "far": ChainLink(**LINK | {"mass": 0.2, "length": 0.2})},
        arms={"a": {"near": ARMS["a"]}, "b": {"near": ARMS["b"], "far": ARMS["b"]}}, order=("near", "far"), gravity=9.81,
    ),
    "plate": PlateLoad(held=("a", "b"), signal="push"),
    "stand": TestStand(held=("a",), start=0.14, frame=Frame(), motor=Motor(viscous=3.0, coulomb=0.0), signal="push"),
    "fixed": TestStand(held=("a",), start=0.14, frame=Frame()),
}  # fmt: skip
TENSIONS = {"a": 40.0, "b": 25.0}
INPUTS = {"push": Value(jnp.asarray(0.7), jnp.asarray(-0.2))}
STATES = [(one, seed) for one in LOADS for seed in range(3)]


def moving(load, seed):
    """A state of the load anywhere, in motion; of hinges also beyond either stop."""
    chance = np.random.default_rng(seed)
    scale = 1e-4 if isinstance(load, TestStand) else 1.0
    start = load.initial()
    return jax.tree.map(lambda x: jnp.asarray(float(x) + scale * chance.uniform(-1.0, 1.0)), start)


def springs(load, state, size=800.0, loss=6.0):
    """Tensions of springs and dampers in place of the muscles, and these as restraints."""
    tensions = {n: size * (s.span - 0.1) + loss * s.velocity for n, s in load.spans(state, INPUTS).items()}
    return tensions, {n: Restraint(jnp.asarray(size), jnp.asarray(loss)) for n in tensions}


@pytest.mark.parametrize(("name", "seed"), STATES)
def test_what_enters_a_load_is_stored_or_lost_and_the_rest_goes_into_its_muscles(name, seed):
    load = LOADS[name]
    state = moving(load, seed)
    rates = load.rates(state, TENSIONS, INPUTS)
    stored = jax.jvp(load.stored_energy, (state,), (rates,))[1] if jax.tree.leaves(state) else jnp.zeros(())
    outside, lost = load.powers(state, TENSIONS, INPUTS)
    into_muscles = sum(TENSIONS[n] * span.velocity for n, span in load.spans(state, INPUTS).items())
    size = abs(float(outside)) + abs(float(lost)) + abs(float(into_muscles))
    assert float(lost) >= 0.0
    assert float(stored) == pytest.approx(float(outside - lost - into_muscles), abs=1e-9 * size)  # rounding


@pytest.mark.parametrize(("name", "seed"), STATES)
def test_the_rate_of_a_span_is_how_fast_the_span_changes(name, seed):
    load = LOADS[name]
    state = moving(load, seed)
    if not jax.tree.leaves(state):
        assert {n: (float(s.span), float(s.velocity)) for n, s in load.spans(state, INPUTS).items()} == {
            "a": (0.7, pytest.approx(-0.2)), "b": (0.7, pytest.approx(-0.2)),
        }  # fmt: skip
        return
    rates = load.rates(state, TENSIONS, INPUTS)
    values, changes = jax.jvp(lambda s: {n: x.span for n, x in load.spans(s, INPUTS).items()}, (state,), (rates,))
    for n, span in load.spans(state, INPUTS).items():
        assert float(changes[n]) == pytest.approx(float(span.velocity), rel=1e-9, abs=1e-12)
        assert float(values[n]) == float(span.span)


@pytest.mark.parametrize(("name", "seed"), [one for one in STATES if one[0] in ("body", "joint", "chain")])
def test_no_mode_of_a_load_on_springs_is_faster_than_its_bound(name, seed):
    load = LOADS[name]
    state = moving(load, seed)
    leaves, structure = jax.tree.flatten(state)

    def rates(flat):
        at = jax.tree.unflatten(structure, list(flat))
        return jnp.stack(jax.tree.leaves(load.rates(at, springs(load, at)[0], INPUTS)))

    at_rest = jnp.stack([x if k < len(leaves) // 2 else jnp.zeros(()) for k, x in enumerate(leaves)])
    fastest = np.abs(np.linalg.eigvals(np.asarray(jax.jacfwd(rates)(at_rest)))).max()
    still = jax.tree.unflatten(structure, list(at_rest))
    bound = float(load.max_rate_bound(still, springs(load, still)[1]))
    # what the tensions themselves turn with the angle of an arm is no stiffness of the muscles: a tenth of theirs here
    assert fastest <= 1.1 * bound
    assert bound < 6.0 * fastest  # else steps would be shorter than needed; norms of a chain's matrices, and their sum


@pytest.mark.parametrize("name", ["body", "joint", "chain"])
def test_muscles_together_move_a_load_as_their_effort_does(name):
    load = LOADS[name]
    state = moving(load, 1)
    whole = load.rates(state, TENSIONS, INPUTS)
    together = load.collected().rates(state, load.effort(state, TENSIONS), INPUTS)
    for one, other in zip(jax.tree.leaves(whole), jax.tree.leaves(together), strict=True):
        assert float(one) == pytest.approx(float(other), rel=1e-12)
    alone = load.one_of("b", "m")
    assert alone.muscles() == ("m",)
    expected = load.rates(state, TENSIONS | {"a": 0.0}, INPUTS)
    for one, other in zip(
        jax.tree.leaves(expected), jax.tree.leaves(alone.rates(state, {"m": 25.0}, INPUTS)), strict=True
    ):
        assert float(one) == pytest.approx(float(other), rel=1e-12)


def test_the_tip_of_a_chain_is_where_its_links_lead_and_its_outputs_are_its_state():
    load = LOADS["chain"]
    state = moving(load, 2)
    first, second = (float(x) for x in state.angle)
    shown = {k: float(v) for k, v in load.outputs(state, TENSIONS, INPUTS).items()}
    assert shown["tip_across"] == pytest.approx(0.3 * np.sin(first) + 0.2 * np.sin(first + second), rel=1e-12)
    assert shown["tip_height"] == pytest.approx(-0.3 * np.cos(first) - 0.2 * np.cos(first + second), rel=1e-12)
    assert (shown["angle_near"], shown["angular_velocity_far"]) == (first, float(state.velocity[1]))
    moments = [float(m) for m in load.muscle_moments(state, TENSIONS)]
    assert [shown["moment_near"], shown["moment_far"]] == moments
    assert moments[1] == pytest.approx(float(ARMS["b"].arm(second)) * 25.0, rel=1e-12)
    assert load.signals() == ("push", "push")
