"""Tangents and adjoints of runs against central differences of the same kernel, for systems of one to twelve states.

The system is a chain of orifices and volumes behind a supply that comes late; where it has friction, that holds its last
volume. JAX is asked for nothing but the graph, so that no second compiler is needed.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from lanewise import adjoint, lower, tangents
from mckibben.components import field
from mckibben.components.system import System
from mckibben.engine import Signal, march
from mckibben.muscles.hysteresis import FrictionLimit, MaxwellSlip

PERIOD, INNER, SAMPLES = 2e-2, 2, 8
LATE = 0.013  # dead time: half a sample and a little [s]
# Numbers of states that show nothing new, and cost seconds to compile: the most states are tried without a stiff method,
# eight with one.
DEAR = {False: (7, 8, 9, 10, 11), True: (7, 9, 10, 11, 12)}


class Chain(System):
    """Volumes behind one another, and the friction that holds the last one."""

    conductance: jax.Array
    friction: MaxwellSlip | None
    count: int = field(static=True)

    def rate(self, state, memory, inputs):
        levels = [inputs["supply"].value, *(state[f"p{i}"] for i in range(self.count))]
        flows = [
            self.conductance * a_to_b / jnp.sqrt(jnp.abs(a_to_b) + 0.1)
            for a_to_b in (a - b for a, b in zip(levels[:-1], levels[1:], strict=True))
        ]
        rates = [a - b for a, b in zip(flows, [*flows[1:], jnp.zeros(())], strict=True)]
        if self.friction is not None:
            rates[-1] = rates[-1] - self.friction.force(memory)
        return {f"p{i}": r for i, r in enumerate(rates)}

    def integrands(self, state, memory, inputs):
        return {}

    def advance_memory(self, memory, start, end, duration):
        if self.friction is None:
            return memory
        last = f"p{self.count - 1}"
        moved = end.state[last] - start.state[last]
        return self.friction.advance(memory, moved, start_pressure=0.0, end_pressure=0.0).state

    def outputs(self, state, memory, inputs):
        return {"all": sum((1.0 + i) * state[f"p{i}"] for i in range(self.count))}


def run(count, stiff, rubs=False, straight=True):
    """A sum over all pressures, at all samples, of (conductance, pressure at the start, dead time)."""
    limit = FrictionLimit(constant=0.3, per_pressure=0.0)
    friction = MaxwellSlip.geometric(limit, elements=6) if rubs else None
    memory = friction.initial() if friction is not None else ()
    supply = 2.0 + np.sin(np.arange(SAMPLES + 1.0))

    def levels(conductance, start, late):
        state = {f"p{i}": start / (1.0 + i) for i in range(count)}
        signals = {"supply": Signal(jnp.asarray(supply), straight, late)}
        system = Chain(conductance, friction, count)
        return march(system, state, memory, signals, PERIOD, INNER, SAMPLES, stiff, integrals=False)[1][2]["all"]

    return lower(levels, 3.0, 1.0, LATE)[0]


AT = np.array([3.0, 0.9, LATE])
WIDTH = 1e-5 * AT  # of the differences
WEIGHTS = np.sin(1.0 + np.arange(SAMPLES + 1.0))


def agree(program, places=(0, 1, 2)):
    """Tangents and adjoint at the same places in seven lanes, of which six are those of the differences."""
    places = list(places)
    lanes = np.stack([AT, *(AT + s * WIDTH * e for e in np.eye(3) for s in (1.0, -1.0))])
    values, changes = tangents(program, places, len(places)).call(
        [*lanes.T, *(np.eye(len(places))[k] for k in range(len(places)))], lanes=7
    )
    back = adjoint(program, places).call([*lanes.T, WEIGHTS], lanes=7)[1:]
    for k, place in enumerate(places):
        high, low = values[..., 1 + 2 * place], values[..., 2 + 2 * place]
        rough = (high - low) / (2.0 * WIDTH[place])
        # differences: rounding of all steps over the width, and its square, 1e-10, times some curvature
        allowed = 20.0 * np.finfo(float).eps * np.abs(values).max() / WIDTH[place] + 1e-8 * np.abs(rough).max()
        assert np.abs(rough).max() > 1e4 * allowed  # it does change, so that zeros would be seen
        np.testing.assert_allclose(changes[k, ..., 0], rough, rtol=0.0, atol=allowed)
        # the same sums in another order
        assert float(back[k][0]) == pytest.approx(float(WEIGHTS @ changes[k, ..., 0]), rel=1e-10, abs=1e-12)


STATES = [
    pytest.param(n, stiff, marks=pytest.mark.slow if n in DEAR[stiff] else ())
    for stiff in (False, True)
    for n in range(1, 13)
]


@pytest.mark.parametrize(("count", "stiff"), STATES)
def test_derivatives_of_a_chain_are_differences_however_many_states_it_has(count, stiff):
    agree(run(count, stiff), places=(0, 2) if count > 6 else (0, 1, 2))  # every further direction costs compilation


@pytest.mark.slow  # many compilations
@pytest.mark.parametrize("stiff", [False, True])
@pytest.mark.parametrize("count", [1, 5])
def test_derivatives_with_friction_and_a_held_signal_that_is_late_are_differences(count, stiff):
    # of a held signal the dead time has no derivative: the jump may move from one step to the next
    agree(run(count, stiff, rubs=True, straight=False), places=(0, 1))


@pytest.mark.slow  # many compilations
@pytest.mark.parametrize("derive", [lambda p: tangents(p, [0, 1, 2], 1), lambda p: adjoint(p, [0, 1, 2])])
def test_derivatives_of_a_lane_are_the_same_bits_among_any_number_of_lanes(derive):
    made = derive(run(5, True, rubs=True))
    more = [np.sin(1.0 + np.arange(np.prod(leaf.shape))).reshape(leaf.shape) for leaf in made.arguments[3:]]
    alone = [np.asarray(x) for x in made.call([*AT, *more])]
    for lanes in (1, 3, 11):  # one, an odd number, more than a vector holds
        spread = AT[:, None] * (1.0 + 0.01 * np.arange(lanes))
        for one, many in zip(alone, made.call([*spread, *more], lanes=lanes), strict=True):
            np.testing.assert_array_equal(one, many[..., 0])
            assert lanes == 1 or not np.array_equal(many[..., -1], one)
