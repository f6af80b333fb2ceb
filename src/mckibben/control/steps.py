"""Controllers as pure steps on the sample clock, in JAX: run as a kernel, and written as C for a board.

    state, number = step(structure, parameters, state, sample)

The C is made of the program that Python runs, so that in float64 it returns the same bits, see `lanewise.to_c_library`. What
plans with a model in lanes, or learns from repeats, is no such step: a board would need the whole simulation, or a table of
all samples.
"""

from __future__ import annotations

import abc
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import lanewise

from .._jax import Scalar, Tree, jnp
from ..components import paths
from ..components.module import flatten
from ..components.programs import lower_or_load
from ..engine.native import as_package_errors
from ..engine.packed import Layout, compile_once
from .task import TaskControl

Step = Callable[..., tuple[Tree, Tree]]
MEANINGS = {
    "sample.wanted": "wanted output, as many samples ahead as the controller previews",
    "sample.output": "measured output",
    "sample.pressure": "measured gauge pressure [Pa]",
    "outputs.number": "number of the actuators, within its limits [Pa]",
}


class Sample(NamedTuple):
    """What a step is told: wanted and measured output [unit of the task], gauge pressure of a single muscle [Pa]."""

    wanted: Scalar
    output: Scalar
    pressure: Scalar


class Outputs(NamedTuple):
    """What a step returns: the number u of the task [Pa]."""

    number: Scalar


class StepControl(TaskControl, abc.ABC):
    """A controller of one pure step, whose memory is a state.

    Attributes:
        preview: samples of the reference ahead, see `Controller`.
    """

    preview: int

    @abc.abstractmethod
    def begin(self, output: float) -> Tree:
        """The state at rest at an output [unit]."""

    def _compile(self, step: Step, structure: tuple[Any, ...], parameters: Tree, output: float = 0.0) -> None:
        """Make the kernel of a step, a module's own function of (structure, parameters, state, sample)."""
        self._step, self._parameters = functools.partial(step, *structure), parameters
        state, sample = self.begin(output), Sample(0.0, 0.0, 0.0)
        self._layout, self._sample = Layout.of(state), np.zeros(len(sample))
        self._state = self._layout.pack(state)
        run = compile_once(step, structure, parameters, state, sample)
        self._call, (self._after, self._number) = run.bind(
            Layout.of(parameters).pack(parameters), self._state, self._sample
        )

    def reset(self, measured: Any, window: np.ndarray) -> None:
        """Begin at rest, at the output that is measured."""
        self._state[:] = self._layout.pack(self.begin(self.task.output(measured)))

    def step(self, measured: Any, window: np.ndarray) -> float:
        """The number for the next period."""
        self._sample[:] = window[-1], self.task.output(measured), getattr(measured, "pressure", 0.0)
        self._call()
        self._state[:] = self._after
        return float(self._number[0])

    def c_source(self, name: str, *, real: str = "float64", output: float | None = None) -> dict[str, str]:
        """The step in C99, for the program of a board: ``NAME.c`` and ``NAME.h``, which allocate nothing.

            NAME_state state = NAME_default_state;                   at rest at an output
            NAME_step(&NAME_default_parameters, &state, &sample, &outputs);       once in each period

        Args:
            name: beginning of all names.
            real: ``float64``, with the bits of Python, or ``float32``.
            output: at which it begins [unit]; where the model of the task begins by default.

        Raises:
            InputError: a name that C cannot have, or another type of numbers.

        Examples:
            >>> from mckibben.control import PID, control_task
            >>> sorted(PID(control_task("B1")).c_source("pid", real="float32"))
            ['pid.c', 'pid.h']
        """
        state = self.begin(self.task.output(self.task.model.reset()) if output is None else output)
        machine, sample = self.task.model.machine, Sample(*np.zeros(3))
        known = dict(paths.parameters(machine))

        def about(group: str, path: str) -> str:
            stated = known.get(path)
            if stated is None:
                return MEANINGS.get(f"{group}.{path}", path)
            return f"{path}{f' [{stated.unit}]' if stated.unit else ''}: {stated.doc}"

        with as_package_errors():
            program, _ = lower_or_load(self._step, self._parameters, state, sample, title=name)
            library = lanewise.to_c_library(
                {"step": lanewise.CFunction(program, ("parameters", "state", "sample"), ("state", "outputs"))},
                name,
                mode="strict",
                real=real,
                values={"parameters": flatten(self._parameters)[0], "state": flatten(state)[0]},
                about=about,
                title=f"{type(self).__name__}, a step every {self.task.period:g} s",
            )
        return {f"{name}.h": library.header, f"{name}.c": library.source}


def clip(value: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """A value, or the limit beyond which it is."""
    return jnp.minimum(jnp.maximum(value, low), high)


def shape(value: Scalar, wanted: Scalar, most: Scalar) -> tuple[Scalar, Scalar]:
    """Shape a reference to a rate that a machine can follow.

    Args:
        value: of the shaped reference, a sample ago.
        wanted: of the reference.
        most: largest change within a sample.

    Returns:
        The shaped reference, and whether it lags behind.
    """
    value = value + clip(wanted - value, -most, most)
    return value, jnp.abs(wanted - value) > 1e-3 * most


class RestingIntegral(NamedTuple):
    """Integral of an error that rests where the error says nothing of the plant: in steps and saturation, and a while after.

    Attributes:
        value: of it [unit s].
        rests: samples for which it goes on to rest.
    """

    value: Scalar
    rests: Scalar

    def add(self, error: Scalar, rests: Scalar, period: Scalar, xp: Any = jnp) -> RestingIntegral:
        """Take in the error of a sample, unless it rests, or has to for some samples from now on; by JAX or by NumPy."""
        rests = xp.maximum(self.rests - 1.0, rests)
        return RestingIntegral(xp.where(rests <= 0.0, self.value + error * period, self.value), rests)
