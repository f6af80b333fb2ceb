"""Control tasks: a mechanism with its air, observations, goals and rewards.

Actions are the positions of the valves' spools for one control period: -1 vents fully, 0 is closed, 1 fills fully. Every
number of an observation is a quantity whose stated range is mapped to -1 to 1 and clipped there. Goals and disturbances are
drawn when an episode begins.

All functions take numbers of one environment, or arrays with the lanes of a vector environment as their last axis. They do
the same operations on both, so that their bits are equal.
"""

from __future__ import annotations

import abc
import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from mckibben.simulation import Air, Chain, Joint, Link, Plate, Simulation, Weight
from mckibben.simulation.mechanisms import Mechanism

SUPPLY = 6e5  # gauge pressure [Pa]
PERIOD = 10e-3  # of the control [s]
EFFORT = 0.02  # reward lost by fully open valves, per control period [1]
BROKEN = -100.0  # reward where the state is not possible any more, which ends an episode [1]
FULL_PRESSURE = 8e5  # at the end of the range of observed pressures [Pa]


class Sense(NamedTuple):
    """A number of an observation.

    Attributes:
        name: field of the simulation's observation, or ``goal``, ``goal_1`` and so on.
        unit: SI unit.
        low: value that is shown as -1.
        high: value that is shown as 1.
        meaning: one phrase.
    """

    name: str
    unit: str
    low: float
    high: float
    meaning: str


class Episode(NamedTuple):
    """What is drawn at its beginning, for each sample of `Task.samples`, after which it repeats.

    Attributes:
        goals: (goals, samples), in the units of the senses.
        disturbances: commands that the environment gives, (disturbances, samples) [SI].
    """

    goals: np.ndarray
    disturbances: np.ndarray


@dataclass(frozen=True)
class Task(abc.ABC):
    """A mechanism to be controlled, with rewards; an environment also takes a subclass of your own.

    The reward of a control period is -error / `tolerance`, less `EFFORT` times the mean opening of the valves.

    Attributes:
        title: one phrase.
        actions: commands of the valves, in the order of the action.
        senses: numbers of an observation, in order.
        wanted: fields of the simulation's observation for which the goals are, in order.
        disturbed: commands that the environment gives.
        tolerance: error that costs 1 per control period, in `error_unit`.
        error_unit: SI unit of the error.
        samples: control periods of an episode.
        dwell: control periods for which a goal stays.
        pressure: gauge pressure of all muscles at the start [Pa]; None for that which carries the load.
    """

    title: ClassVar[str]
    actions: ClassVar[tuple[str, ...]]
    senses: ClassVar[tuple[Sense, ...]]
    wanted: ClassVar[tuple[str, ...]]
    tolerance: ClassVar[float]
    error_unit: ClassVar[str]
    disturbed: ClassVar[tuple[str, ...]] = ()
    samples: ClassVar[int] = 200
    dwell: ClassVar[int] = 100
    pressure: ClassVar[float | None] = 2e5

    @abc.abstractmethod
    def system(self) -> Mechanism:
        """The mechanism."""

    @abc.abstractmethod
    def draw(self, random: np.random.Generator) -> Episode:
        """What an episode asks for."""

    @abc.abstractmethod
    def error(self, readings: Mapping[str, np.ndarray], goal: np.ndarray) -> np.ndarray:
        """Distance from a goal, 0 or more, in `error_unit`.

        Args:
            readings: fields of the simulation's observation.
            goal: (goals,), or (goals, lanes).
        """

    def hold(self, goals: np.ndarray) -> np.ndarray:
        """Goals (goals, stretches), each held for `dwell` samples."""
        return np.repeat(goals, self.dwell, axis=1)[:, : self.samples]

    @property
    def stretches(self) -> int:
        """Number of goals in an episode, one after the other."""
        return -(-self.samples // self.dwell)

    @property
    def undisturbed(self) -> np.ndarray:
        """Disturbances of a task without any."""
        return np.zeros((0, self.samples))

    def simulation(self) -> Simulation:
        """A simulation of the mechanism with its air, whose programs all environments of the task share."""
        return _simulation(self).with_parameters({})

    def observation(self, readings: Mapping[str, np.ndarray], goal: np.ndarray) -> np.ndarray:
        """The observation, (senses,) or (lanes, senses), as float32 from -1 to 1.

        Args:
            readings: fields of the simulation's observation.
            goal: (goals,), or (goals, lanes).
        """
        low, high, places = _ranges(type(self))
        pairs = zip(self.senses, places, strict=True)
        values = np.array([readings[sense.name] if place is None else goal[place] for sense, place in pairs]).T
        scaled: np.ndarray = np.clip(2.0 * (values - low) / (high - low) - 1.0, -1.0, 1.0).astype(np.float32)
        return scaled

    def reward(self, error: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Reward of one control period [1]: minus the error in tolerances, minus a price of open valves.

        Args:
            error: distance from the goal at its end [unit of the tolerance], a number or (lanes,).
            action: as it was taken, from -1 to 1, (actions,) or (lanes, actions).
        """
        opening = np.abs(action[..., 0])
        for k in range(1, len(self.actions)):
            opening = opening + np.abs(action[..., k])
        rewards: np.ndarray = -error / self.tolerance - EFFORT * opening / len(self.actions)
        return rewards


@functools.cache
def _simulation(task: Task) -> Simulation:
    air = Air(supply=SUPPLY, valve="MPYE-5-1-8-LF", tube=("50 cm", "4 mm"))
    return Simulation(task.system(), air, period=PERIOD, title=task.title)


@functools.cache
def _ranges(kind: type[Task]) -> tuple[np.ndarray, np.ndarray, tuple[int | None, ...]]:
    """Ends of the senses' ranges, and for each sense the goal that it shows, None for a field of the simulation."""
    goals = [s.name for s in kind.senses if s.name.startswith("goal")]
    places = tuple(goals.index(s.name) if s.name in goals else None for s in kind.senses)
    return np.array([s.low for s in kind.senses]), np.array([s.high for s in kind.senses]), places


def _pressure(name: str, muscle: str) -> Sense:
    return Sense(name, "Pa", 0.0, FULL_PRESSURE, f"gauge pressure of the {muscle}")


class LiftTask(Task):
    """A muscle holds a hanging mass at wanted heights."""

    title = "A muscle lifts a mass of 3 kg to wanted spans"
    actions = ("muscle",)
    senses = (
        Sense("position", "m", 0.10, 0.15, "span of the muscle, at whose end the mass hangs"),
        Sense("velocity", "m/s", -1.0, 1.0, "velocity of the mass, positive downwards"),
        _pressure("pressure", "muscle"),
        Sense("goal", "m", 0.10, 0.15, "wanted span"),
    )
    wanted = ("position",)
    tolerance = 5e-3
    error_unit = "m"
    pressure = None

    def system(self) -> Mechanism:
        """A mass of 3 kg on a nylon muscle."""
        return Weight("nylon", mass="3 kg", start="13 cm", damping="5 N*s/m")

    def draw(self, random: np.random.Generator) -> Episode:
        """Spans that the muscle holds at pressures below that of the supply."""
        return Episode(self.hold(random.uniform(0.112, 0.135, (1, self.stretches))), self.undisturbed)

    def error(self, readings: Mapping[str, np.ndarray], goal: np.ndarray) -> np.ndarray:
        """Distance from the wanted span [m]."""
        error: np.ndarray = np.abs(readings["position"] - goal[0])
        return error


class JointTask(Task):
    """Two muscles turn a joint to wanted angles."""

    title = "Two muscles turn a joint to wanted angles"
    actions = ("flexor", "extensor")
    senses = (
        Sense("angle", "rad", -1.5, 1.5, "angle of the joint"),
        Sense("velocity", "rad/s", -15.0, 15.0, "angular velocity"),
        _pressure("flexor_pressure", "flexor"),
        _pressure("extensor_pressure", "extensor"),
        Sense("goal", "rad", -1.5, 1.5, "wanted angle"),
    )
    wanted = ("angle",)
    tolerance = 0.1
    error_unit = "rad"

    def system(self) -> Mechanism:
        """A hinge with an inertia of 20 kg cm^2 between two nylon muscles."""
        return Joint("nylon", arm="2 cm", inertia="20 kg*cm^2", damping=0.02)

    def draw(self, random: np.random.Generator) -> Episode:
        """Angles that the muscles reach."""
        return Episode(self.hold(random.uniform(-0.6, 0.6, (1, self.stretches))), self.undisturbed)

    def error(self, readings: Mapping[str, np.ndarray], goal: np.ndarray) -> np.ndarray:
        """Distance from the wanted angle [rad]."""
        error: np.ndarray = np.abs(readings["angle"] - goal[0])
        return error


class ReachTask(Task):
    """Four muscles bring the tip of an arm with two joints to wanted points."""

    title = "Four muscles bring the tip of an arm with two joints to wanted points"
    actions = ("flexor_1", "extensor_1", "flexor_2", "extensor_2")
    senses = (
        Sense("angle_1", "rad", -1.5, 1.5, "angle of the first joint"),
        Sense("angle_2", "rad", -1.5, 1.5, "angle of the second joint"),
        Sense("velocity_1", "rad/s", -15.0, 15.0, "angular velocity of the first joint"),
        Sense("velocity_2", "rad/s", -25.0, 25.0, "angular velocity of the second joint"),
        _pressure("flexor_1_pressure", "first flexor"),
        _pressure("extensor_1_pressure", "first extensor"),
        _pressure("flexor_2_pressure", "second flexor"),
        _pressure("extensor_2_pressure", "second extensor"),
        Sense("tip_across", "m", -0.4, 0.4, "tip, across from the first joint"),
        Sense("tip_height", "m", -0.4, 0.4, "tip, above the first joint"),
        Sense("goal_1", "m", -0.4, 0.4, "wanted place across"),
        Sense("goal_2", "m", -0.4, 0.4, "wanted height"),
    )
    wanted = ("tip_across", "tip_height")
    tolerance = 0.02
    error_unit = "m"

    def system(self) -> Mechanism:
        """Links of 20 cm and 16 cm that hang down, each joint between two nylon muscles."""
        upper = Link("20 cm", "0.3 kg", arm="2 cm", damping=0.03)
        return Chain(upper, Link("16 cm", "0.15 kg", arm="1.5 cm", damping=0.02))

    def draw(self, random: np.random.Generator) -> Episode:
        """Places of the tip, by distance and direction from the first joint."""
        distance = random.uniform(0.335, 0.357, self.stretches)
        direction = random.uniform(-0.6, 0.6, self.stretches)
        places = np.array([distance * np.sin(direction), -distance * np.cos(direction)])
        return Episode(self.hold(places), self.undisturbed)

    def error(self, readings: Mapping[str, np.ndarray], goal: np.ndarray) -> np.ndarray:
        """Distance of the tip from the wanted place [m]."""
        across, height = readings["tip_across"] - goal[0], readings["tip_height"] - goal[1]
        distance: np.ndarray = np.sqrt(across * across + height * height)
        return distance


class PressureTask(Task):
    """A valve holds wanted pressures in a muscle whose span is moved from outside."""

    title = "A valve holds wanted pressures in a muscle that is moved"
    actions = ("muscle",)
    senses = (
        _pressure("pressure", "muscle"),
        Sense("span", "m", 0.10, 0.15, "span of the muscle, which a plate moves"),
        Sense("tension", "N", 0.0, 300.0, "tension at the plate"),
        Sense("goal", "Pa", 0.0, FULL_PRESSURE, "wanted gauge pressure"),
    )
    wanted = ("pressure",)
    disturbed = ("span",)
    tolerance = 0.5e5
    error_unit = "Pa"
    dwell = 50

    def system(self) -> Mechanism:
        """A nylon muscle on a plate."""
        return Plate("nylon", span="13 cm")

    def draw(self, random: np.random.Generator) -> Episode:
        """Gauge pressures, and a sine of the span of up to 1 cm at 0.5 to 3 Hz."""
        goals = random.uniform(0.5e5, 5e5, (1, self.stretches))
        size, rate = random.uniform(0.0, 0.01), random.uniform(0.5, 3.0)
        span = 0.13 + size * np.sin(2.0 * np.pi * rate * PERIOD * np.arange(1, self.samples + 1))
        return Episode(self.hold(goals), span[None])

    def error(self, readings: Mapping[str, np.ndarray], goal: np.ndarray) -> np.ndarray:
        """Distance from the wanted pressure [Pa]."""
        error: np.ndarray = np.abs(readings["pressure"] - goal[0])
        return error


TASKS: dict[str, Task] = {
    "mckibben/Lift-v0": LiftTask(),
    "mckibben/Joint-v0": JointTask(),
    "mckibben/Reach-v0": ReachTask(),
    "mckibben/Pressure-v0": PressureTask(),
}
