"""A run under a policy as a function of the policy's parameters, with its gradient.

The physics of a sample is a native kernel, and so are its derivatives; policy and cost are JAX functions of the user. The
samples are a `jax.lax.scan`: XLA compiles nothing of the physics, and a changed policy compiles in a moment.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .._jax import Scalar, Tree, jax, jnp
from ..components import paths
from ..engine.native import differentiable
from ..engine.rates import RK4_LIMIT
from ..engine.soundness import SOUND, SWITCHED, unsound_sentence
from ..errors import ConvergenceError, InputError
from .fit import find_parameters
from .kernel import MODE, SteppedSimulation
from .stepping import BEHIND, step_vectors

SHIFT = 1e-6  # share of a parameter over which its places in the kernel are found


class Rollout:
    """A run of some samples from the present moment of a simulation, commanded by a policy.

        def policy(parameters, seen):                       # JAX
            return {"flexor": parameters["gain"] * (0.3 - seen.angle), "extensor": -0.1}

        def cost(seen, commands):
            return (seen.angle - 0.3) ** 2

        rollout = sim.rollout(policy, steps=500, cost=cost)
        value, slope = rollout.value_and_grad({"gain": 1.0})

    The value is the mean of the cost over the samples [unit of the cost]. The derivatives are those of the steps that were
    taken, friction and flow that chokes included; where a command is clipped, its derivative is zero. There is no noise.
    No sample is repeated with shorter steps: the moment at which a muscle gets slack or taut is met to a usual step, and a
    pull that snaps may be off by some per cent of what `Simulation.step` gives.

    Args:
        simulation: from whose present moment each run begins.
        policy: policy of (parameters, observation), returns the commands by name; what it leaves out stays as it is.
        steps: samples.
        cost: cost of (observation, commands) at the end of a sample; None if the policy returns (commands, cost).

    Raises:
        InputError: the number of steps is none.
    """

    def __init__(
        self, simulation: SteppedSimulation, policy: Callable[..., Tree], steps: int, cost: Callable[..., Any] | None
    ) -> None:
        if not (isinstance(steps, int) and steps >= 1):
            raise InputError("steps", steps, "must be a whole number of 1 or more")
        if not callable(policy):
            raise InputError("policy", type(policy).__name__, "must be a function of (parameters, observation)")
        self.simulation, self.policy, self.steps, self.cost = simulation, policy, steps, cost
        programs = simulation.programs
        self._fields = len(programs.fields)
        step = functools.partial(
            step_vectors, programs.layouts, False, period=simulation.period, inner=simulation.inner
        )
        self._step = differentiable(step, *programs.examples, mode=MODE, threads=1, title="a simulation")
        self._run = jax.jit(self._trajectory)
        self._slope = jax.jit(jax.value_and_grad(self._mean_cost, has_aux=True))
        self._both = jax.jit(jax.value_and_grad(self._mean_cost, argnums=(0, 1), has_aux=True))

    def __repr__(self) -> str:
        return f"Rollout({self.steps} steps of {self.simulation!r})"

    def __call__(self, parameters: Any) -> float:
        """The mean cost of a run.

        Raises:
            ConvergenceError: a mode is too fast for the step of the simulation, or a state is not possible.
        """
        _, held, costs, observed = self._run(parameters, self.simulation.parameters, *self._start())
        self._check(held, observed)
        return float(jnp.mean(costs))

    def value_and_grad(self, parameters: Tree) -> tuple[float, Tree]:
        """The mean cost of a run, and its derivative by each of the parameters, a tree like them.

        Raises:
            ConvergenceError: a mode is too fast for the step of the simulation, or a state is not possible.
        """
        (value, run), slopes = self._slope(parameters, self.simulation.parameters, *self._start())
        self._check(*run)
        return float(value), jax.tree.map(np.asarray, slopes)

    def machine_gradient(self, parameters: Tree, names: Sequence[str]) -> tuple[float, Tree, dict[str, np.ndarray]]:
        """The mean cost of a run, and its derivatives by the policy's parameters and by some of the machine.

        The run begins at the present moment whatever the parameters of the machine.

        Args:
            parameters: of the policy.
            names: parameters of the machine, by path or the end of one, such as ``load.damping``.

        Returns:
            The value; a tree like the parameters; and by path a derivative of the shape of the parameter [cost/SI].

        Raises:
            InputError: names what is no parameter.
            ConvergenceError: see `value_and_grad`.
        """
        simulation = self.simulation
        places = [path for name in names for path in find_parameters(simulation.machine, name, "names")]
        (value, run), (slopes, plant) = self._both(parameters, simulation.parameters, *self._start())
        self._check(*run)
        gradient, by_machine = np.asarray(plant), {}
        for path in places:
            stated = np.asarray(paths.get(simulation.machine, path), float)
            high = max(paths.declaration(simulation.machine, path).bounds)
            by_machine[path] = np.empty(stated.shape)
            for index in np.ndindex(stated.shape):
                # a number of the machine may stand in the kernel more than once
                moved, size = stated.copy(), SHIFT * max(abs(float(stated[index])), 1e-3)
                size = size if stated[index] + size <= high else -size
                moved[index] += size
                change = simulation.with_arrays({path: moved}).parameters - simulation.parameters
                by_machine[path][index] = gradient @ change / (moved[index] - stated[index])
        return float(value), jax.tree.map(np.asarray, slopes), by_machine

    def as_function(self) -> Callable[[Tree], Scalar]:
        """The mean cost of a run from the present moment, as a JAX function of the parameters for `vmap`, `grad` and `jit`.

            costs = jax.vmap(rollout.as_function())(goals)

        Runs that are mapped over are lanes of the kernels. Nothing is raised or said, of commands neither: a cost is NaN
        where a mode is too fast for the step of the simulation, or a state is not possible.
        """
        start = self.simulation.parameters, *self._start()
        usual = self.simulation.period / self.simulation.inner

        def mean_cost(parameters: Tree) -> Scalar:
            value, (_, behind) = self._mean_cost(parameters, *start)
            sound = (behind[:, -2] * usual <= RK4_LIMIT) & ((behind[:, -1] == SOUND) | (behind[:, -1] == SWITCHED))
            cost: Scalar = jnp.where(sound.all(), value, jnp.nan)
            return cost

        return mean_cost

    def trajectory(self, parameters: Tree) -> tuple[Tree, dict[str, np.ndarray]]:
        """The observations (steps + 1,), a named tuple of arrays, and the commands by name (steps,)."""
        seen, commands, _, observations = self._run(parameters, self.simulation.parameters, *self._start())
        self._check(commands, observations)
        carry, observed, _, sample = self._start()
        names = self.simulation.programs.fields
        first = [float(observed[k]) for k in range(len(names))]
        time = self.simulation.period * (int(sample) + np.arange(self.steps + 1))
        columns = [np.concatenate([[a], np.asarray(b)]) for a, b in zip(first, seen, strict=True)]
        held = {name: np.asarray(commands)[:, k] for k, name in enumerate(self.simulation.commands)}
        return self.simulation.Observation(time, *columns), held

    def _start(self) -> tuple[Tree, Tree, Tree, Tree]:
        state = self.simulation.save_state()
        return state.carry, state.observed, state.commands, np.float64(state.sample)

    def _trajectory(self, parameters: Any, plant: Any, carry: Tree, observed: Any, held: Any, sample: Any) -> Any:
        simulation, plant = self.simulation, jnp.asarray(plant)

        def one(now: Any, index: Scalar) -> tuple[Tree, Tree]:
            carry, observed, held = now
            seen = self._observation(observed, (sample + index) * simulation.period)
            decided = self.policy(parameters, seen)
            if self.cost is None and not (isinstance(decided, tuple | list) and len(decided) == 2):
                raise InputError(
                    "policy", type(decided).__name__, "must return (commands, cost) where no cost is stated"
                )
            commands, price = decided if self.cost is None else (decided, None)
            held = self._held(held, commands)
            carry, observed = self._step(plant, carry, held)
            if self.cost is not None:
                named = {name: held[k] for k, name in enumerate(simulation.commands)}
                price = self.cost(self._observation(observed, (sample + index + 1.0) * simulation.period), named)
            numbers = [observed[k] for k in range(self._fields)]
            return (carry, observed, held), (numbers, held, jnp.asarray(price, float), observed)

        begin = (jnp.asarray(carry), jnp.asarray(observed), jnp.asarray(held))
        _, kept = jax.lax.scan(one, begin, jnp.arange(float(self.steps)))
        return kept

    def _mean_cost(self, parameters: Any, *start: Any) -> tuple[Tree, Tree]:
        _, held, costs, observed = self._trajectory(parameters, *start)
        return jnp.mean(costs), (held, observed)

    def _observation(self, observed: Any, time: Scalar) -> Any:
        return self.simulation.Observation(time, *(observed[k] for k in range(self._fields)))

    def _held(self, held: Any, commands: Any) -> Any:
        known = self.simulation.commands
        if not isinstance(commands, Mapping):
            shown = f"must return its commands by name, as in {{{known[0]!r}: 0.0}}"
            raise InputError("policy", type(commands).__name__, shown)
        for name in commands:
            if name not in known:
                raise InputError("command", name, known=known)
        return jnp.stack([jnp.asarray(commands.get(name, held[k]), float) for k, name in enumerate(known)])

    def _check(self, held: Any, observed: Any) -> None:
        every = np.concatenate([self.simulation.save_state().commands[None], np.asarray(held)])
        for name, column in zip(self.simulation.commands, every.T, strict=True):
            self.simulation.check_held(name, column[1:], column[:-1])
        rows, usual = np.asarray(observed), self.simulation.period / self.simulation.inner
        fastest = float(np.max(rows[:, -2]))
        if np.isfinite(fastest) and fastest * usual > RK4_LIMIT:
            raise ConvergenceError(
                f"The step of {usual:.3g} s is too long for this run. It needs {RK4_LIMIT / fastest:.2g} s or less: "
                "give the simulation another step."
            )
        unsound = np.flatnonzero(~np.isin(rows[:, -1], (SOUND, SWITCHED)))
        if unsound.size:  # a run with derivatives repeats no sample, one in which a muscle gets slack or taut neither
            row = rows[unsound[0]]
            imbalance, _, code = row[-BEHIND:].tolist()
            said = unsound_sentence(
                code, imbalance, usual, self.simulation.programs.overloaded(self.simulation.parameters, row)
            )
            raise ConvergenceError(f"Sample {unsound[0]} is not sound. {said}")
