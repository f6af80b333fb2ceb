"""A single environment, and a vector environment whose lanes are those of one native kernel."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple, TypedDict, Unpack

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from mckibben.answers import Caution, warn
from mckibben.batch.randomise import ends_of, randomise
from mckibben.documents import JsonValue
from mckibben.errors import ConvergenceError, InputError
from mckibben.quantities import whole_number
from mckibben.simulation.kernel import SampleKernel
from mckibben.simulation.mechanisms import Amount, in_si

from .tasks import BROKEN, TASKS, Episode, Task

Box = gymnasium.spaces.Box
RENDER_MODES = ["rgb_array"]
FAR_ACTION = 10.0  # beyond which an action was meant in another unit
PLANTS = 64  # that are drawn where some number differs
MOST_DELAY = 100  # of an action [control periods]


class Differs(TypedDict, total=False):
    """What differs from episode to episode, see `MuscleEnv`."""

    vary: Mapping[str, Any] | None
    muscles: Any
    noise: Mapping[str, Amount] | None
    offset: Mapping[str, Any] | None
    delay: int | tuple[int, int]
    plants: int
    plants_seed: int


class _Lane(NamedTuple):
    """What is drawn for an episode beside its goals.

    Attributes:
        plant: which of the plants.
        delay: control periods between an action and its effect.
        errors: what sensors add, (fields, samples + 1) [SI].
    """

    plant: int
    delay: int
    errors: np.ndarray


class _Plant:
    """The simulation of a task with its starts at rest, and the spaces of its environments."""

    def __init__(
        self,
        task: str | Task,
        *,
        vary: Mapping[str, Any] | None = None,
        muscles: Any = None,
        noise: Mapping[str, Amount] | None = None,
        offset: Mapping[str, Any] | None = None,
        delay: int | tuple[int, int] = 0,
        plants: int = PLANTS,
        plants_seed: int = 0,
    ) -> None:
        if isinstance(task, str) and task not in TASKS:
            raise InputError("task", task, known=tuple(TASKS))
        self.task = TASKS[task] if isinstance(task, str) else task
        self.simulation = self.task.simulation()
        self.varied = vary is not None or muscles is not None
        count = whole_number(plants, "plants", least=1) if self.varied else 1
        self.drawn: dict[str, np.ndarray] = {}
        sims = [self.simulation]
        if self.varied:
            self.drawn = randomise(self.simulation, count, vary, muscles=muscles, seed=plants_seed)
            sims = [self.simulation.with_arrays({p: v[..., k] for p, v in self.drawn.items()}) for k in range(count)]
        starts = [sim.rest_state(self.task.pressure) for sim in sims]
        self.starts = tuple(np.stack([start[i] for start in starts], axis=1) for i in range(2))
        self.parameters = np.stack([sim.parameters for sim in sims], axis=1)
        commands = self.simulation.start_commands(self.task.pressure)
        self.commands = np.array([commands[name] for name in self.simulation.commands])
        places = {name: k for k, name in enumerate(self.simulation.commands)}
        self.actions = [places[name] for name in self.task.actions]
        self.disturbed = [places[name] for name in self.task.disturbed]
        self.fields = self.simulation.programs.fields
        units = {s.name: s.unit for s in self.task.senses if s.name in self.fields}
        for name in {**(noise or {}), **(offset or {})}:
            if name not in units:
                raise InputError("noise" if name in (noise or {}) else "offset", name, known=tuple(units))
        self.noise = {n: in_si(amount, units[n], f"noise.{n}") for n, amount in (noise or {}).items()}
        self.offset = {n: ends_of(f"offset.{n}", spread, units[n], 0.0) for n, spread in (offset or {}).items()}
        self.delays = (delay, delay) if isinstance(delay, int) else tuple(delay)
        if not (len(self.delays) == 2 and 0 <= self.delays[0] <= self.delays[1] <= MOST_DELAY):
            raise InputError("delay", str(delay), f"must be control periods from 0 to {MOST_DELAY}, or a range of them")
        self._picture: Any = None
        self._said = False
        self.observation_space = Box(-1.0, 1.0, (len(self.task.senses),), np.float32)
        self.action_space = Box(-1.0, 1.0, (len(self.actions),), np.float32)

    def lane(self, random: np.random.Generator) -> _Lane:
        """Draw what differs in an episode; nothing is drawn of what does not differ."""
        count = self.parameters.shape[1]
        plant = int(random.integers(count)) if self.varied else 0
        low, high = self.delays
        delay = int(random.integers(low, high + 1)) if high > low else low
        errors = np.zeros((len(self.fields), self.task.samples + 1))
        for name, (least, most) in self.offset.items():
            errors[self.fields.index(name)] += random.uniform(least, most)
        for name, deviation in self.noise.items():
            errors[self.fields.index(name)] += deviation * random.standard_normal(self.task.samples + 1)
        return _Lane(plant, delay, errors)

    def start(self, plants: Any) -> tuple[np.ndarray, np.ndarray]:
        """What a plant, or some, goes on from at rest, and the observation there."""
        carry, observed = self.starts
        return carry[:, plants], observed[:, plants]

    def kernel(self, lanes: int | None = None) -> SampleKernel:
        sim = self.simulation
        first = self.parameters[:, 0].copy()
        if lanes is not None and self.varied:
            first = np.repeat(first[:, None], lanes, axis=1)
        kernel = SampleKernel(sim.programs, first, sim.period, sim.inner, lanes)
        kernel.set_carry(*self.start(0))
        for place, value in enumerate(self.commands):
            kernel.set_command(place, value)
        return kernel

    def clipped(self, actions: np.ndarray) -> np.ndarray:
        """Actions from -1 to 1; refuses what is no number, and says once of what no valve can do."""
        largest = float(np.abs(actions).max())
        if not np.isfinite(largest):
            raise InputError("action", largest, "must be finite numbers")
        if largest > FAR_ACTION and not self._said:
            self._said = True
            said = f"an action of {largest:g} is far from the positions of a valve, -1 to 1: it acts as the nearest"
            warn([Caution(said, "action")], stacklevel=4)
        clipped: np.ndarray = np.clip(actions, -1.0, 1.0)
        return clipped

    def seen(self, rows: np.ndarray) -> dict[str, Any]:
        return dict(zip(self.fields, rows, strict=False))

    def picture(self, readings: dict[str, Any], goal: np.ndarray, time: float) -> np.ndarray:
        if self._picture is None:
            from mckibben.report.figures.mechanism_picture import MechanismPicture  # loads what draws

            self._picture = MechanismPicture(self.simulation, self.task.title)
        drawn: np.ndarray = self._picture.frame(readings, dict(zip(self.task.wanted, goal, strict=True)), time)
        return drawn


def _checked_mode(render_mode: str | None) -> str | None:
    if render_mode is not None and render_mode not in RENDER_MODES:
        raise InputError("render_mode", render_mode, known=RENDER_MODES)
    return render_mode


class MuscleEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """One mechanism with its muscles, whose valves the actions move.

    Args:
        task: id of a task of this package, or a `Task`.
        render_mode: ``"rgb_array"`` for pictures of the mechanism; None for none.
        vary: numbers of the plant that differ from episode to episode, as `mckibben.batch.randomise` takes them.
        muscles: a posterior, a fit or draws of the muscles' law, drawn for each muscle, as there.
        noise: standard deviation of what a sensor adds at each control period, by name of a sense [SI, or text].
        offset: spread of what a sensor adds throughout an episode, ``"+-2 mm"`` or a range of two ends, by name of a sense.
        delay: control periods between an action and its effect; a range (least, most) is drawn from.
        plants: how many plants `vary` and `muscles` are drawn for; each episode has one of them.
        plants_seed: same seed, same plants; take another one to judge on plants that were not trained on.

    Attributes:
        task: what is to be controlled.

    Raises:
        InputError: an unknown task, mode, number or sense, or a spread that is none.

    The information of a step has the ``error`` in the unit of the task. An episode ends early only where the state is not
    possible any more.
    """

    metadata = {"render_modes": RENDER_MODES, "render_fps": 100}

    def __init__(
        self, task: str | Task = "mckibben/Lift-v0", render_mode: str | None = None, **differs: Unpack[Differs]
    ) -> None:
        self.render_mode = _checked_mode(render_mode)
        self._plant = _Plant(task, **differs)
        self.task = self._plant.task
        self.observation_space, self.action_space = self._plant.observation_space, self._plant.action_space
        self._kernel = self._plant.kernel()
        self._count = 0
        self._begun = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, JsonValue] | None = None
    ) -> tuple[np.ndarray, dict[str, JsonValue]]:
        """Begin an episode at rest, with goals drawn again.

        Args:
            seed: of the goals; the generator goes on where it is None.
            options: none are known.

        Returns:
            The observation, and where plants differ, which it is, as ``plant``.
        """
        super().reset(seed=seed)
        plant = self._plant
        self._episode = self.task.draw(self.np_random)
        self._lane = plant.lane(self.np_random)
        self._kernel.plant[:] = plant.parameters[:, self._lane.plant]
        self._kernel.set_carry(*plant.start(self._lane.plant))
        self._kernel.commands[:] = plant.commands
        self._late = deque([plant.commands[plant.actions]] * self._lane.delay)
        self._count, self._begun = 0, True
        return self._observation(), {"plant": self._lane.plant} if plant.varied else {}

    @property
    def plants(self) -> dict[str, np.ndarray]:
        """Numbers of the plants that differ, (plants,) by path [SI]."""
        return self._plant.drawn

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, JsonValue]]:
        """Hold positions of the valves, from -1 to 1, for one control period.

        Returns:
            Observation, reward, False, whether the simulation cannot go on, and the error; where it cannot, with the message
            that says why.
        """
        action = self._plant.clipped(np.asarray(action, float).reshape(self.action_space.shape))
        plant, place = self._plant, self._count % self.task.samples
        before = self._kernel.observation.copy()
        self._late.append(action)
        self._kernel.commands[plant.actions] = self._late.popleft()
        self._kernel.commands[plant.disturbed] = self._episode.disturbances[:, place]
        try:
            self._kernel.step()
        except ConvergenceError as error:
            self._kernel.observation[:] = before
            return self._observation(), BROKEN, False, True, {"error": np.inf, "message": str(error)}
        self._count += 1
        missed = self.task.error(self._seen(), self._episode.goals[:, place])
        return self._observation(), float(self.task.reward(missed, action)), False, False, {"error": float(missed)}

    def _seen(self) -> dict[str, Any]:
        return self._plant.seen(self._kernel.observation)

    @property
    def goal(self) -> np.ndarray:
        """What is asked for now, (goals,), in the units of the senses."""
        return self._episode.goals[:, self._count % self.task.samples]

    def _observation(self) -> np.ndarray:
        place = min(self._count, self.task.samples)
        sensed = self._kernel.observation[: len(self._plant.fields)] + self._lane.errors[:, place]
        return self.task.observation(self._plant.seen(sensed), self.goal)

    def render(self) -> np.ndarray | None:
        """A picture of the mechanism, its muscles to scale, (height, width, 3); None without a render mode."""
        if self.render_mode is None or not self._begun:
            return None
        return self._plant.picture(self._seen(), self.goal, self._count * self._plant.simulation.period)


class MuscleVectorEnv(gymnasium.vector.VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many muscle environments as lanes of one native kernel.

    A lane has the bits of a single environment with its seed. As in Gymnasium's own vector environments, lane i is seeded
    with ``seed + i``.

    Args:
        num_envs: number of lanes.
        task: id of a task of this package, or a `Task`.
        max_episode_steps: control periods after which an episode is truncated; those of the task by default.
        autoreset_mode: when an ended lane begins again: at the next step, which then ignores its action; at the same step,
            with the last observation in the information; or when it is reset with the option ``reset_mask``.
        render_mode: ``"rgb_array"`` for pictures of all lanes; None for none.
        **differs: ``vary``, ``muscles``, ``noise``, ``offset``, ``delay``, ``plants`` and ``plants_seed``, see `MuscleEnv`.

    Raises:
        InputError: an unknown task or mode, no lane, or as there.
    """

    def __init__(
        self,
        num_envs: int = 1,
        task: str | Task = "mckibben/Lift-v0",
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **differs: Unpack[Differs],
    ) -> None:
        if not (isinstance(num_envs, int) and num_envs >= 1):
            raise InputError("num_envs", num_envs, "must be 1 or more")
        self.num_envs, self.render_mode = num_envs, _checked_mode(render_mode)
        self._plant = _Plant(task, **differs)
        self.task = self._plant.task
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**MuscleEnv.metadata, "autoreset_mode": self.autoreset_mode}
        plant = self._plant
        self.single_observation_space, self.single_action_space = plant.observation_space, plant.action_space
        self.observation_space = batch_space(plant.observation_space, num_envs)
        self.action_space = batch_space(plant.action_space, num_envs)
        if max_episode_steps is not None and not (isinstance(max_episode_steps, int) and max_episode_steps >= 1):
            raise InputError("max_episode_steps", max_episode_steps, "must be a whole number from 1")
        self._limit = self.task.samples if max_episode_steps is None else max_episode_steps
        self._kernel = self._plant.kernel(num_envs)
        self._lanes = np.arange(num_envs)
        self._count = np.zeros(num_envs, int)
        self._ended = np.zeros(num_envs, bool)
        counts = len(self.task.draw(np.random.default_rng(0)).goals), len(self._plant.disturbed)
        # Of all lanes, (numbers, samples, lanes).
        self._episodes = Episode(*(np.zeros((count, self.task.samples, num_envs)) for count in counts))
        self._generators: list[np.random.Generator] = []
        self._which, self._delay = np.zeros(num_envs, int), np.zeros(num_envs, int)
        self._errors = (
            np.zeros((len(plant.fields), self.task.samples + 1, num_envs)) if (plant.noise or plant.offset) else None
        )
        self._late = np.zeros((plant.delays[1] + 1, len(plant.actions), num_envs))  # the newest actions, in turn

    @property
    def plants(self) -> dict[str, np.ndarray]:
        """Numbers of the plants that differ, (plants,) by path [SI]."""
        return self._plant.drawn

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, JsonValue] | None = None
    ) -> tuple[np.ndarray, dict[str, JsonValue]]:
        """Begin episodes at rest, with goals drawn again.

        Args:
            seed: lane i gets ``seed + i``, or its own of a list; the generators go on where it is None.
            options: ``reset_mask`` (lanes,) selects lanes that begin again while the others go on.

        Returns:
            The observations (lanes, senses), and where plants differ, which each lane has, as ``plant``.

        Raises:
            InputError: seeds or mask do not fit the lanes.
        """
        mask = np.ones(self.num_envs, bool) if not options else options.get("reset_mask", np.ones(self.num_envs, bool))
        if np.shape(mask) != (self.num_envs,) or np.asarray(mask).dtype != bool:
            raise InputError("reset_mask", None, f"must be {self.num_envs} booleans, got {np.shape(mask)}")
        seeds: list[int | None] = [None] * self.num_envs
        if isinstance(seed, int):
            seeds = [seed + i for i in range(self.num_envs)]
        elif seed is not None:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise InputError("seed", None, f"must be one number, or {self.num_envs} of them, got {len(seeds)}")
        if not self._generators:
            self._generators = [seeding.np_random(own)[0] for own in seeds]
        else:
            for lane, own in enumerate(seeds):
                if own is not None and mask[lane]:
                    self._generators[lane] = seeding.np_random(own)[0]
        self._begin(np.flatnonzero(mask))
        return self._observations(), {"plant": self._which.copy()} if self._plant.varied else {}

    def _begin(self, lanes: np.ndarray) -> None:
        plant = self._plant
        self._count[lanes], self._ended[lanes] = 0, False
        for lane in lanes:
            episode = self.task.draw(self._generators[lane])
            self._episodes.goals[:, :, lane], self._episodes.disturbances[:, :, lane] = episode
            self._which[lane], self._delay[lane], errors = plant.lane(self._generators[lane])
            if self._errors is not None:
                self._errors[:, :, lane] = errors
        if plant.varied:
            self._kernel.put_plant(lanes, plant.parameters[:, self._which[lanes]])
        self._kernel.put_carry(lanes, *plant.start(self._which[lanes]))
        self._late[:, :, lanes] = plant.commands[plant.actions][:, None]

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, JsonValue]]:
        """Hold positions of the valves, (lanes, valves) from -1 to 1, for one control period.

        Returns:
            Observations, rewards, terminations, truncations, and the errors with the mask of lanes that have one; for lanes
            that cannot go on, which are truncated, the message that says why.
        """
        actions = self._plant.clipped(np.asarray(actions, float).reshape(self.action_space.shape))
        again = self._ended.copy()
        if again.any() and self.autoreset_mode == AutoresetMode.DISABLED:
            said = "must be given to reset lanes that have ended, for autoreset is disabled"
            raise InputError("reset_mask", None, said)
        place = self._count % self.task.samples
        plant, kernel = self._plant, self._kernel
        late = len(self._late)
        self._late[self._count % late, :, self._lanes] = actions
        acting = self._late[(self._count - self._delay) % late, :, self._lanes]
        for k, command in enumerate(plant.actions):
            kernel.set_command(command, acting[:, k])
        for k, command in enumerate(plant.disturbed):
            kernel.set_command(command, self._episodes.disturbances[k, place, self._lanes])
        goal = self._episodes.goals[:, place, self._lanes]
        messages = kernel.step_lanes()
        broken = np.isin(self._lanes, list(messages))
        self._count += 1
        errors = self.task.error(plant.seen(kernel.observation), goal)
        rewards = self.task.reward(errors, actions)
        rewards[broken], errors[broken] = BROKEN, np.inf
        self._count[broken] -= 1
        terminations, truncations = np.zeros(self.num_envs, bool), broken | (self._count >= self._limit)
        if again.any():
            self._begin(np.flatnonzero(again))
            rewards[again], errors[again], terminations[again], truncations[again] = 0.0, 0.0, False, False
        self._ended = terminations | truncations
        observations = self._observations()
        infos: dict[str, Any] = {"error": errors, "_error": ~again}
        for lane in np.flatnonzero(broken & ~again):
            infos = self._add_info(infos, {"message": messages[int(lane)]}, int(lane))
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._ended.any():
            infos = self._begin_ended(observations, infos)
            observations = self._observations()
        return observations, rewards, terminations, truncations, infos

    def _begin_ended(self, observations: np.ndarray, infos: dict[str, Any]) -> dict[str, Any]:
        """Begin the lanes that ended in this step again; what they ended with goes to the information."""
        ended = np.flatnonzero(self._ended)
        added: dict[str, Any] = {}
        for lane in ended:
            final = {"final_obs": observations[lane].copy(), "final_info": {"error": float(infos["error"][lane])}}
            added = self._add_info(added, final, int(lane))
        self._begin(ended)
        infos["error"][ended], infos["_error"][ended] = 0.0, False
        return {**infos, **added}

    def _observations(self) -> np.ndarray:
        goal = self._episodes.goals[:, self._count % self.task.samples, self._lanes]
        sensed = self._kernel.observation
        if self._errors is not None:
            place = np.minimum(self._count, self.task.samples)
            sensed = sensed[: len(self._plant.fields)] + self._errors[:, place, self._lanes]
        return self.task.observation(self._plant.seen(sensed), goal)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A picture of each lane, (height, width, 3); None without a render mode."""
        if self.render_mode is None:
            return None
        goals = self._episodes.goals[:, self._count % self.task.samples, self._lanes]
        rows, period = self._kernel.observation, self._plant.simulation.period
        plant = self._plant
        return tuple(plant.picture(plant.seen(rows[:, k]), goals[:, k], self._count[k] * period) for k in self._lanes)
