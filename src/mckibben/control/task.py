"""What a controller is told of the machine that it drives, and what a machine asks of a controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ..errors import InputError
from ..simulation import Simulation


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
        limits: smallest and largest u [SI]; beyond, the machine acts as there.
        unit: SI unit of the output.
    """

    model: Simulation
    field: str
    zero: float
    sign: float
    actuators: Mapping[str, tuple[float, float]]
    limits: tuple[float, float]
    unit: str = "m"

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
