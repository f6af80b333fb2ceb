"""What a controller is told of the machine that it drives, and what a machine asks of a controller."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol, runtime_checkable

import numpy as np

from ..answers import Caution, collect, warn
from ..errors import InputError
from ..quantities import named_values, whole_number, with_unit
from ..simulation import Simulation
from ..simulation.mechanisms import Amount, ends_in_si, in_si
from ..simulation.recorded import described
from ..simulation.stepping import CommandInput
from ..slips import size_caution

RANGES = {"m": 27e-3, "rad": 0.6}  # usual ranges of outputs [unit]
LEAST_SHARE = 1e-2  # of the range of a command, that a controller moves


@dataclass(frozen=True)
class ControlTask:
    """One output that a controller moves by one number: a stroke by a pressure, or an angle by a difference of two.

        output = sign (field - zero),   command of an actuator = offset + slope u,   low <= u <= high

    Attributes:
        model: machine as its controller believes it to be, without noise; to be stepped as one likes.
        field: of the observation, from which the output follows.
        zero: value of the field at which the output is zero [SI].
        sign: 1 or -1.
        actuators: offset [SI] and slope [1] of each command of the machine, by its name.
        limits: smallest and largest u [SI, or words with a unit]; beyond, the machine acts as there.
        unit: SI unit of the output.
        cautions: what can hardly be meant of these numbers.

    Raises:
        InputError: names what the model does not have, or a number that is none.
    """

    model: Simulation
    field: str
    zero: float
    sign: float
    actuators: Mapping[str, tuple[float, float]]
    limits: tuple[float, float]
    unit: str = "m"
    cautions: tuple[Caution, ...] = dataclasses.field(init=False, default=())

    def __post_init__(self) -> None:
        if not isinstance(self.model, Simulation):
            raise InputError("model", type(self.model).__name__, "must be a Simulation")
        if self.field not in self.model.programs.fields:
            raise InputError("field", self.field, known=self.model.programs.fields)
        unit = described(dict(self.model.plant.shown)[self.field])[0]
        if self.unit != unit:
            raise InputError("unit", self.unit, f"must be that of the field {self.field}, {unit}")
        if self.sign not in (1, -1):
            raise InputError("sign", self.sign, "must be 1 or -1")
        drives = {drive.command: drive for drive in self.model.drives}
        driven = dict[str, tuple[float, float]]()
        for name, pair in named_values(self.actuators, "actuators").items():
            if name not in drives:
                raise InputError("actuators", name, known=drives)
            if not isinstance(pair, tuple | list) or len(pair) != 2:
                raise InputError(f"actuators {name}", str(pair), "must be a pair, offset and slope")
            unit_of_command = drives[name].unit
            driven[name] = in_si(pair[0], unit_of_command, f"offset of {name}"), in_si(pair[1], "1", f"slope of {name}")
            if driven[name][1] == 0.0:
                raise InputError(f"slope of {name}", 0, "must not be 0: the command would never change")
        if not driven:
            raise InputError("actuators", None, f"must name one command or more of {', '.join(drives)}")
        of = drives[next(iter(driven))].unit
        zero, limits = in_si(self.zero, unit, "zero"), ends_in_si(self.limits, of, "limits")
        said = collect(
            size_caution(zero, unit, name="zero"),
            *(size_caution(u, of, name="limit") for u in limits),
            *(one for name, pair in driven.items() for one in _actuator_cautions(drives[name], *pair, limits)),
        )
        for key, value in {"zero": zero, "limits": limits, "actuators": driven, "cautions": said}.items():
            object.__setattr__(self, key, value)
        warn(said, stacklevel=4)

    def of_one_muscle(self) -> ControlTask:
        """Return the task to a controller of the stroke of one muscle whose pressure is measured.

        Raises:
            InputError: it is another.
        """
        if self.unit != "m" or "pressure" not in self.model.programs.fields:
            driven = ", ".join(self.actuators)
            raise InputError("task", None, f"must be the stroke of one muscle for this controller; it drives {driven}")
        return self

    @property
    def period(self) -> float:
        """Period of the samples [s]."""
        return self.model.period

    def output(self, observation: Any) -> Any:
        """The output that an observation shows [unit]; of lanes, an array."""
        return self.sign * (getattr(observation, self.field) - self.zero)

    def commands(self, number: Any) -> dict[str, Any]:
        """Commands of `Simulation.step` for the controller's number u, or for one number per lane [SI]."""
        return {name: offset + slope * number for name, (offset, slope) in self.actuators.items()}

    def saturated(self, number: float) -> float:
        """The number that acts, within the limits [SI]."""
        low, high = self.limits
        return min(max(number, low), high)


def _actuator_cautions(
    drive: CommandInput, offset: float, slope: float, limits: tuple[float, float]
) -> Iterator[Caution | None]:
    """What can hardly be meant of the commands to which an offset and a slope turn the limits: a slip of the slope."""
    ends = sorted(offset + slope * u for u in limits)
    name = f"slope of {drive.command}"
    shown = f"{with_unit(ends[0], drive.unit)} to {with_unit(ends[1], drive.unit)}"
    from_limits = f"a {name} of {slope:g} makes commands of {shown} from the limits"
    for end in ends:
        unusual = drive.check(end)
        yield unusual and Caution(f"{from_limits}: {unusual}", name)
    low, high = drive.range
    if math.isfinite(high - low) and ends[1] - ends[0] < LEAST_SHARE * (high - low):
        yield Caution(f"{from_limits}, hardly any of its range", name)


class Setting(NamedTuple):
    """What a number of a controller may be; a truth value where its unit is ``flag``, and from 1 where it is ``count``.

    Attributes:
        unit: SI unit, ``y`` for that of the output.
        usual: sizes of which it usually is [unit], for an output in units of its usual range.
        power: of that range in the unit.
        zero: whether it may be zero.
    """

    unit: str
    usual: tuple[float, float] = (0.0, np.inf)
    power: int = 0
    zero: bool = True

    def read(self, value: Any, name: str, output: str) -> tuple[Any, Caution | None]:
        """The number [SI] of a task whose output has a unit, and what is said of it.

        Raises:
            InputError: it is none, negative, or zero where it may not be.
        """
        if self.unit == "flag":
            if not isinstance(value, bool):
                raise InputError(name, repr(value), "must be True or False")
            return value, None
        if self.unit == "count":
            return whole_number(value, name, least=1), None
        unit = self.unit.replace("y", output)
        number = in_si(value, unit, name)
        if number < 0.0 or not (number or self.zero):
            raise InputError(name, number, f"must be {'zero or more' if self.zero else 'above zero'} [{unit}]")
        least, most = (RANGES[output] ** self.power * end for end in self.usual)
        return number, size_caution(value, unit, name=name.replace("_", " "), usual=(least, most))


GAIN, TIME, WEIGHT = Setting("Pa/y", (1e4, 5e7), -1), Setting("s", (1e-3, 2.0)), Setting("y/Pa", (1e-8, 1e-4), 1)
SETTINGS = {
    "proportional": GAIN, "integral": Setting("Pa/(y*s)", (1e4, 1e9), -1), "derivative": Setting("Pa*s/y", (1e2, 1e7), -1),
    "gain": GAIN, "velocity_lag": Setting("s", (1e-4, 2.0)), "lead": TIME, "ahead": TIME, "width": TIME,
    "rate": Setting("y/s", (0.03, 300.0), 1, zero=False), "horizon": Setting("s", (1e-2, 5.0), zero=False),
    "perturb": Setting("Pa", (1e3, 2e6), zero=False), "trust": Setting("Pa", (1e3, 1e7), zero=False), "weight": WEIGHT,
    "effort": WEIGHT._replace(zero=False), "share": Setting("1", (1e-3, 1.0)), "memory": Setting("flag"),
    "feedback": Setting("flag"), "repeats": Setting("count"), "moves": Setting("count"), "every": Setting("count"),
}  # fmt: skip


class TaskControl:
    """What the controllers that ship have in common: a task, and numbers that are read with their units and judged.

    Attributes:
        task: what is driven.
        cautions: what can hardly be meant of the task or the numbers.
    """

    task: ControlTask
    cautions: tuple[Caution, ...]
    settings: ClassVar[Mapping[str, Setting]] = SETTINGS

    def _take(
        self, task: ControlTask, usual: Mapping[str, Mapping[str, float]], **stated: Amount | None
    ) -> dict[str, Any]:
        """The numbers that were stated, or by the unit of the output those that are usual [SI]."""
        if not isinstance(task, ControlTask):
            raise InputError("task", type(task).__name__, "must be a ControlTask, such as control_task('B1')")
        if task.unit not in RANGES:
            raise InputError("task", None, f"must have a stroke or an angle as its output, not one in {task.unit}")
        self.task, numbers, said = task, dict[str, Any](), list[Caution | None]()
        for name, value in stated.items():
            taken = usual[name][task.unit] if value is None else value
            numbers[name], one = self.settings[name].read(taken, name, task.unit)
            said.append(one)
        new = collect(*said)
        self.cautions = collect(*task.cautions, *new)
        warn(new, stacklevel=4)
        return numbers


@runtime_checkable
class Controller(Protocol):
    """A controller: pure steps on the sample clock. One's own class needs no base; it is made by ``Class(task)``.

        class Own:
            preview = 0

            def __init__(self, task): self.task = task
            def reset(self, measured, window): self.sum = 0.0
            def step(self, measured, window): return 2e5 + 1e7 * (window[0] - self.task.output(measured))

    A controller with `repeats` above one goes through the reference so many times, and `learn` is told between two of them
    the errors of all samples of the last, wanted less measured [SI], shape (samples,).

    Attributes:
        preview: samples of the reference ahead of the present one that a window has.
    """

    preview: int

    def reset(self, measured: Any, window: np.ndarray) -> None:
        """Begin at rest.

        Args:
            measured: the first observation.
            window: wanted outputs now and in the next `preview` samples [SI], shape (preview + 1,).
        """

    def step(self, measured: Any, window: np.ndarray) -> float:
        """The number u for the next period [SI]; beyond the limits of the task it acts as there."""
