"""Systems that the tests share: a mass that rubs, with memory and a linear system to solve, and three bodies in space."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

PERIOD = 0.01
STAGES = ((0.0, 0.0, 1.0 / 6.0), (0.5, 0.5, 1.0 / 3.0), (0.5, 0.5, 1.0 / 3.0), (1.0, 1.0, 1.0 / 6.0))
GAMMA = 1.0 - 0.5**0.5


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Slider:
    """A mass on a spring that rubs, with a yield that grows with a pressure of its own dynamics."""

    stiffness: jax.Array
    constant: jax.Array
    per_pressure: jax.Array
    mass: jax.Array

    def replace(self, **changes):
        return dataclasses.replace(self, **changes)

    def friction(self, memory):
        return jnp.sum(self.stiffness * memory)

    def rate(self, state, memory, drive):
        push = -200.0 * state["x"] - self.friction(memory) + drive
        return {
            "x": state["v"],
            "v": push / self.mass,
            "p": 40.0 * (2e5 + 3e4 * drive - state["p"]) / (1.0 + jnp.abs(state["v"])),
        }

    def advance_memory(self, memory, start, end):
        """Each element follows until it yields, at the mean of the yields at both ends."""
        pressure = 0.5 * (start["p"] + end["p"])
        largest = (self.constant + self.per_pressure * pressure) / (self.stiffness.size * self.stiffness)
        return jnp.clip(memory + end["x"] - start["x"], -largest, largest)


def axpy(a, x, y):
    return jax.tree.map(lambda u, v: v + a * u, x, y)


def runge_kutta(system, state, memory, drive, h):
    change, k = jax.tree.map(jnp.zeros_like, state), state
    for ahead, share, weight in STAGES:
        k = system.rate(axpy(ahead * h, k, state) if ahead else state, memory, drive(share))
        change = axpy(weight * h, k, change)
    return axpy(1.0, change, state)


def rosenbrock(system, state, memory, drive, h):
    """ROS2: two stages with a linear system each."""
    flat, back = ravel_pytree(state)

    def rate(v, share):
        return ravel_pytree(system.rate(back(v), memory, drive(share)))[0]

    first, rates = jax.linearize(lambda v: rate(v, 0.0), flat)
    matrix = jnp.eye(flat.size) - GAMMA * h * jax.vmap(rates, out_axes=1)(jnp.eye(flat.size))
    k1 = jnp.linalg.solve(matrix, first)
    k2 = jnp.linalg.solve(matrix, rate(flat + h * k1, 1.0) - 2.0 * k1)
    return back(flat + h * (1.5 * k1 + 0.5 * k2))


def march(system, state, memory, signals, inner, samples, stiff=False):
    """Positions at all samples, (samples + 1,)."""
    h, values = PERIOD / inner, signals["drive"]

    def sample(carry, index):
        def one(i, c):
            state, memory = c
            begin = i / inner

            def drive(share):
                low, high = values[index], values[index + 1]
                return low + (high - low) * (begin + share / inner)

            new = (rosenbrock if stiff else runge_kutta)(system, state, memory, drive, h)
            return new, system.advance_memory(memory, state, new)

        return jax.lax.fori_loop(0, inner, one, carry), carry[0]["x"]

    (last, _), seen = jax.lax.scan(sample, (state, memory), jnp.arange(samples))
    return jnp.concatenate([seen, last["x"][None]])


def rubbing(samples=40):
    """The system, its state, memory and signals."""
    stiffness = jnp.asarray(400.0 * 0.5 ** np.arange(4.0))
    state = {"x": jnp.asarray(0.02), "v": jnp.asarray(0.0), "p": jnp.asarray(2e5)}
    drive = {"drive": jnp.asarray(5.0 * np.sin(np.linspace(0.0, 9.0, samples + 1)))}
    slider = Slider(stiffness, jnp.asarray(0.5), jnp.asarray(4e-6), jnp.asarray(0.5))
    return slider, state, jnp.zeros(4), drive


def positions(samples=40, inner=20, stiff=False):
    """The run as a function of (system, state, memory, signals): positions at all samples."""
    return lambda *given: march(*given, inner, samples, stiff)


def per_lane(tree, lanes, chance, spread=0.2):
    """A tree with every number in every lane a little different."""
    return jax.tree.map(
        lambda leaf: np.asarray(leaf)[..., None] * (1.0 + spread * chance.uniform(-1, 1, (*np.shape(leaf), lanes))),
        tree,
    )


# ---- three bodies in a plane, one of which has an engine


def bodies():
    """Parameters and state."""
    parameters = {
        "bodies": {"sun": {"mass": 1.0}, "planet": {"mass": 0.3}, "ship": {"mass": 0.02}},
        "drag": 0.05,
        "softening": 0.01,
    }
    places = {"sun": (0.0, 0.0, 0.0, -0.25), "planet": (1.0, 0.0, 0.0, 0.85), "ship": (-1.6, 0.3, 0.1, -0.8)}
    state = {n: dict(zip(("x", "y", "u", "v"), map(jnp.asarray, p), strict=True)) for n, p in places.items()}
    return parameters, state


def body_rates(parameters, state, thrust):
    force = {n: [0.0, 0.0] for n in state}
    names = list(state)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            dx, dy = state[b]["x"] - state[a]["x"], state[b]["y"] - state[a]["y"]
            square = dx * dx + dy * dy + parameters["softening"]
            pull = parameters["bodies"][a]["mass"] * parameters["bodies"][b]["mass"] / (square * jnp.sqrt(square))
            for body, sign in ((a, 1.0), (b, -1.0)):
                force[body] = [force[body][0] + sign * pull * dx, force[body][1] + sign * pull * dy]
    rates = {}
    for n, body in state.items():
        mass, speed = parameters["bodies"][n]["mass"], jnp.sqrt(body["u"] ** 2 + body["v"] ** 2 + 1e-6)
        push = thrust / speed if n == "ship" else 0.0
        resist = parameters["drag"] * speed / (1.0 + speed)
        rates[n] = {
            "x": body["u"],
            "y": body["v"],
            "u": force[n][0] / mass + (push - resist) * body["u"],
            "v": force[n][1] / mass + (push - resist) * body["v"],
        }
    return rates


def body_step(parameters, state, thrust, h):
    k, change = state, jax.tree.map(jnp.zeros_like, state)
    for ahead, _, weight in STAGES:
        k = body_rates(parameters, axpy(ahead * h, k, state) if ahead else state, thrust)
        change = axpy(weight * h, k, change)
    return axpy(1.0, change, state)


def body_outputs(state):
    ship, planet = state["ship"], state["planet"]
    return {
        "distance": jnp.sqrt((ship["x"] - planet["x"]) ** 2 + (ship["y"] - planet["y"]) ** 2),
        "speed": jnp.sqrt(ship["u"] ** 2 + ship["v"] ** 2),
    }
