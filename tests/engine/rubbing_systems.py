"""Systems that the tests of the lowering share: small enough to compile at once, with everything that a machine has."""

import jax
import jax.numpy as jnp
import numpy as np

from mckibben.components.system import System
from mckibben.engine import march, ramped
from mckibben.muscles.hysteresis import FrictionLimit, MaxwellSlip

PERIOD = 0.01


class Rubbing(System):
    """A mass on a spring that rubs, with a yield that grows with a pressure of its own dynamics."""

    friction: MaxwellSlip
    mass: jax.Array

    def rate(self, state, memory, inputs):
        push = -200.0 * state["x"] - self.friction.force(memory) + inputs["drive"].value
        return {
            "x": state["v"],
            "v": push / self.mass,
            "p": 40.0 * (2e5 + 3e4 * inputs["drive"].value - state["p"]) / (1.0 + jnp.abs(state["v"])),
        }

    def integrands(self, state, memory, inputs):
        return {"work": inputs["drive"].value * state["v"], "loss": self.friction.force(memory) * state["v"]}

    def advance_memory(self, memory, start, end, duration):
        begin, last = start.state, end.state
        moved = last["x"] - begin["x"]
        return self.friction.advance(memory, moved, start_pressure=begin["p"], end_pressure=last["p"]).state

    def outputs(self, state, memory, inputs):
        return {"x": state["x"], "force": self.friction.force(memory)}


def rubbing(samples=40):
    """The system, its state, memory and signals."""
    friction = MaxwellSlip.geometric(FrictionLimit(constant=0.5, per_pressure=4e-6), elements=4)
    state = {"x": jnp.asarray(0.02), "v": jnp.asarray(0.0), "p": jnp.asarray(2e5)}
    drive = {"drive": ramped(5.0 * np.sin(np.linspace(0.0, 9.0, samples + 1)))}
    return Rubbing(friction, jnp.asarray(0.5)), state, friction.initial(), drive


def positions(samples=40, inner=20):
    """The run as a function of (system, state, memory, signals): positions at all samples."""
    return lambda *given: march(*given, PERIOD, inner, samples, False)[1][2]["x"]


def per_lane(tree, lanes, chance, spread=0.2):
    """A tree with every number in every lane a little different."""
    return jax.tree.map(
        lambda leaf: np.asarray(leaf)[..., None] * (1.0 + spread * chance.uniform(-1, 1, (*np.shape(leaf), lanes))),
        tree,
    )
