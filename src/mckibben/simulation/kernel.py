"""Compiled samples of a simulation: native kernels on fixed places in memory, found on disk where they were compiled before.

A `SampleKernel` steps one machine or many lanes. It has two vectors for what goes from sample to sample and goes to and fro
between them: a step that turns out too coarse is done again from the same state.
"""

from __future__ import annotations

import abc
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from .._jax import Tree
from ..answers import Caution
from ..assembly.build import Assumption
from ..assembly.machine import Machine
from ..assembly.muscle_unit import MuscleUnit
from ..components.module import map_leaves
from ..documents import JsonValue
from ..engine.native import EngineFunction, compile_function
from ..engine.packed import Layout
from ..engine.rates import RK4_LIMIT
from ..engine.sampled import Steps
from ..engine.soundness import SOUND, Soundness, overloaded_parts, unsound_sentence
from ..errors import ConvergenceError
from . import stepping
from .air import AirCircuit
from .mechanisms import Mechanism, StartPressure
from .readouts import ReadoutLines

MODE = "default"  # of the compiler: the same bits alone and in every lane of a batch
BLOCK = 64  # lanes of a batch are padded to a multiple of this where there is no kernel: XLA compiles each number anew
ONE_THREAD = 1000  # lanes times steps of a sample up to which handing them to other threads takes longer than they do
FEW = 8  # lanes below this number that need shorter steps are stepped one by one


class Programs:
    """The functions of one structure of machines, each compiled when it is first asked for.

    Args:
        plant: an example of the machine.
        carry: an example of what goes from sample to sample.
        commands: names of the commands.
    """

    def __init__(self, plant: stepping.CommandedMachine, carry: Tree, commands: Sequence[str]) -> None:
        self.layouts = stepping.Layouts(Layout.of(plant), Layout.of(carry), tuple(commands))
        self.fields, self.shown = [name for name, _ in plant.shown], [output for _, output in plant.shown]
        self.examples = (np.zeros(self.layouts.plant.size), np.zeros(self.layouts.carry.size), np.zeros(len(commands)))
        self._compiled: dict[Any, EngineFunction] = {}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_compiled": {}}  # what is compiled belongs to this process; kernels lie on disk

    def __deepcopy__(self, _: dict[int, Any]) -> Programs:
        return self

    def step(self, stiff: bool) -> EngineFunction:
        """`step_vectors` of this structure."""
        bound = functools.partial(stepping.step_vectors, self.layouts, stiff)
        return self._function(("step", stiff), bound, *self.examples, np.float64(1e-3), np.int64(1))

    def recorded(self, stiff: bool) -> EngineFunction:
        """`recorded_vectors` of this structure."""
        bound = functools.partial(stepping.recorded_vectors, self.layouts, stiff)
        return self._function(("recorded", stiff), bound, *self.examples, np.float64(1e-3), np.int64(1))

    def overloaded(self, plant: np.ndarray, observed: np.ndarray) -> tuple[str, ...]:
        """Names of the muscles that an observation shows to be longer than their threads bear."""
        outputs = dict(zip(self.shown, observed, strict=False))
        return overloaded_parts(self.layouts.plant.unpack(plant), outputs)

    def padded(self, lanes: int) -> int:
        """Lanes that are computed for some: a kernel takes any whole number of its own blocks."""
        block = FEW if self.step(False).engine == "native" else BLOCK
        return -(-lanes // block) * block

    def observe(self, plant: np.ndarray, carry: np.ndarray) -> np.ndarray:
        """The observation in a carry, with what is `BEHIND` it; of lanes side by side, (fields + 3, lanes)."""
        return np.asarray(self._at("observe", stepping.observe_vectors, plant, carry))

    def outputs(self, plant: np.ndarray, carry: np.ndarray) -> dict[str, np.ndarray]:
        """All outputs in a carry, each (lanes,) of lanes side by side."""
        return dict(self._at("outputs", stepping.outputs_at, plant, carry))

    def _at(self, key: str, function: Callable[..., Tree], plant: np.ndarray, carry: np.ndarray) -> Tree:
        """What a function finds in a carry, or in each of lanes side by side."""
        run = self._function(key, functools.partial(function, self.layouts), *self.examples[:2])
        if carry.ndim == 1:
            return run(plant, carry, mode=MODE)
        lanes = carry.shape[1]
        more = (0, 0), (0, self.padded(lanes) - lanes)
        arrays = [x if x.ndim == 1 else np.pad(x[:, :lanes], more, "edge") for x in (plant, carry)]
        return map_leaves(lambda leaf: np.asarray(leaf)[..., :lanes], run(*arrays, lanes=self.padded(lanes), mode=MODE))

    def _function(self, key: Any, function: Callable[..., Tree], *examples: Tree) -> EngineFunction:
        if key not in self._compiled:
            self._compiled[key] = compile_function(function, *examples, title="a simulation")
        return self._compiled[key]


class SampleKernel:
    """A machine, or lanes of machines, that goes on sample by sample.

    Args:
        programs: programs of its structure.
        plant: its parameters as a vector; (numbers, lanes) where they differ from lane to lane.
        period: period of the samples [s].
        inner: steps of the physics per sample, where its modes allow them.
        lanes: how many; None for a single machine.

    Attributes:
        commands: vector to be set before a step; (commands, lanes) for lanes.
        observation: vector of the last sample, with what is `BEHIND` it.
        rate_bound: rate bound of the fastest mode at the present state [1/s].
        steps_taken: steps of the physics in the last sample.
        stiff: whether they were of the Rosenbrock method.
    """

    def __init__(
        self, programs: Programs, plant: np.ndarray, period: float, inner: int, lanes: int | None = None
    ) -> None:
        self.programs, self.plant, self.period, self.inner, self.lanes = programs, plant, period, inner, lanes
        self._padded = lanes if lanes is None else programs.padded(lanes)
        many = () if self._padded is None else (self._padded,)
        _, carry, commands = programs.examples
        self._carries = [np.zeros((*carry.shape, *many)) for _ in range(2)]
        self._now = 0  # which of the two is the present one
        self._commands = np.zeros((*commands.shape, *many))
        self._observed = np.zeros((len(programs.fields) + stepping.BEHIND, *many))
        self._before = np.zeros_like(self._observed)  # of the lanes, at the start of the sample
        self._inner = np.zeros((), np.int64)
        self._calls: dict[bool, list[Callable[[], None]]] = {}
        self.rate_bound, self.steps_taken, self.stiff = 0.0, inner, False
        own = slice(None) if lanes is None else slice(lanes)
        self.commands = self._commands if lanes is None else self._commands[:, own]
        self.observation = self._observed if lanes is None else self._observed[:, own]
        if lanes is not None and self._padded is not None and plant.ndim == 2:
            self.plant = np.ascontiguousarray(
                np.concatenate([plant, np.repeat(plant[:, -1:], self._padded - lanes, 1)], 1)
            )
        self._usual = period / inner

    def __reduce__(self) -> tuple[Any, ...]:
        own = slice(self.lanes)
        plant = self.plant[:, own] if self.plant.ndim == 2 else self.plant
        made = self.programs, plant, self.period, self.inner, self.lanes
        return _kernel_at, (*made, self.carry[..., own], self.observation, self.commands, self.rate_bound)

    @property
    def carry(self) -> np.ndarray:
        """What goes into the next sample; not to be changed."""
        return self._carries[self._now]

    def set_carry(self, carry: np.ndarray, observed: np.ndarray) -> None:
        """Go on from a carry, a single one or one per lane, with the observation that belongs to it."""
        for target, source in ((self._carries[self._now], carry), (self._observed, observed)):
            if target.ndim == 1:
                target[:] = source
            elif source.ndim == 1:
                target[:] = source[:, None]
            else:
                count = source.shape[1]
                target[:, :count] = source
                target[:, count:] = source[:, -1:]
        self.rate_bound = float(np.max(self._observed[-2]))

    def put_carry(self, lanes: np.ndarray, carry: np.ndarray, observed: np.ndarray) -> None:
        """Let some lanes go on from a carry, or one each, with the observation that belongs to it; the others stay."""
        for target, source in ((self._carries[self._now], carry), (self._observed, observed)):
            target[:, lanes] = source[:, None] if source.ndim == 1 else source

    def put_plant(self, lanes: np.ndarray, plant: np.ndarray) -> None:
        """Give some lanes other parameters, (numbers, lanes), where each has its own; the others keep theirs."""
        self.plant[:, lanes] = plant
        if self.lanes is not None:
            self.plant[:, self.lanes :] = self.plant[:, self.lanes - 1 : self.lanes]

    def set_command(self, place: int, value: Any) -> None:
        """Set a command in all lanes, also those that only fill the last block."""
        if self.lanes is None or np.ndim(value) == 0:
            self._commands[place] = value
            return
        self._commands[place, : self.lanes] = value
        self._commands[place, self.lanes :] = value[-1]

    def step(self) -> None:
        """Go on by one sample, in steps as short as the machine's own rates and balances ask for.

        Raises:
            ConvergenceError: a state is not finite or not possible, a balance does not close, or no step is short enough.
        """
        if self.lanes is not None:
            broken = self.step_lanes()
            if broken:
                self._now ^= 1
                self._observed[:] = self._before
                lane = min(broken)
                raise ConvergenceError(f"Lane {lane} cannot go on. {broken[lane]}")
            return
        usual = self.rate_bound * self._usual <= RK4_LIMIT  # nearly always
        if usual:
            self._run(self.inner, False)
            bound, sound = self._observed[-2], self._observed[-1] == SOUND
            if bound * self._usual <= RK4_LIMIT and sound:
                self.rate_bound = bound
                self._now ^= 1
                return
        self._careful_step(taken=usual)

    def step_lanes(self) -> dict[int, str]:
        """Go on by one sample in all lanes, each in steps as short as its own rates and balances ask for, as it would alone.

        Returns:
            Lanes that stay where they were, each with the sentence that says why.
        """
        assert self.lanes is not None
        before = self._before  # one place for it: new memory of this size costs more than the copy
        before[:] = self._observed
        self._run(self.inner, False)
        allowed = RK4_LIMIT / self._usual
        steady = (before[-2] <= allowed) & (self._observed[-2] <= allowed) & (self._observed[-1] == SOUND)
        broken: dict[int, str] = {}
        self._now ^= 1
        if not steady.all():
            broken = self._step_carefully(np.flatnonzero(~steady[: self.lanes]), before)
            for array in (self._carries[self._now], self._observed):
                array[:, self.lanes :] = array[:, self.lanes - 1 : self.lanes]
        return broken

    def _step_carefully(self, lanes: np.ndarray, before: np.ndarray) -> dict[int, str]:
        """Take a sample that was too coarse in some lanes again, those with equal steps together; what ends lanes."""
        source, target = self._carries[1 - self._now], self._carries[self._now]
        waiting, broken = {}, {}
        for lane in map(int, lanes):
            wanted = self._allowed_steps(float(before[-2, lane]))
            if wanted == Steps():  # those have been taken
                wanted = wanted.after(float(self._observed[-2, lane]), float(self._observed[-1, lane]), self._usual)
                if wanted is None:
                    broken[lane] = self._why(Steps(), self._observed[:, lane], lane)
            elif wanted is None:
                broken[lane] = self._why(None, before[:, lane], lane)
            waiting[lane] = wanted
        while waiting:
            groups: dict[Steps, list[int]] = {}
            for lane, wanted in waiting.items():
                if wanted is not None:
                    groups.setdefault(wanted, []).append(lane)
            waiting = {}
            for steps, members in groups.items():
                for lane, carry, observed in zip(members, *self._stepped(source, members, steps), strict=True):
                    again = steps.after(float(observed[-2]), observed[-1], self._usual)
                    if again == steps:
                        target[:, lane], self._observed[:, lane] = carry, observed
                    elif again is None:
                        broken[lane] = self._why(steps, observed, lane)
                    else:
                        waiting[lane] = again
        ended = list(broken)
        for array, old in ((target, source), (self._observed, before)):
            array[:, ended] = old[:, ended]
        return broken

    def _stepped(self, source: np.ndarray, lanes: list[int], steps: Steps) -> tuple[np.ndarray, np.ndarray]:
        """Carries and observations of some lanes after a sample, (lanes, numbers)."""
        function, size = self.programs.step(steps.stiff), len(lanes)
        timing = np.float64(self.period), np.int64(self.inner * steps.split)
        inputs = [x[:, lanes] if x.ndim == 2 else x for x in (self.plant, source, self._commands)]
        if size >= FEW:
            padded = self.programs.padded(size)  # each lane that only fills costs
            inputs = [np.pad(x, ((0, 0), (0, padded - size)), "edge") if x.ndim == 2 else x for x in inputs]
            carry, observed = function(*inputs, *timing, lanes=padded, mode=MODE)
            return carry.T[:size], observed.T[:size]
        each = [[x[:, k] if x.ndim == 2 else x for x in inputs] for k in range(size)]
        ends = [function(*one, *timing, mode=MODE) for one in each]
        return np.array([end[0] for end in ends]), np.array([end[1] for end in ends])

    def _allowed_steps(self, bound: float) -> Steps | None:
        """The first steps that a bound allows [1/s]; None where none is short enough."""
        steps: Steps | None = Steps()
        while steps is not None and not steps.short(bound, self._usual):
            steps = steps.shorter(bound, self._usual)
        return steps

    def _careful_step(self, *, taken: bool) -> None:
        """Take a sample in the steps that it asks for; `taken` says that the usual ones were, and did not do."""
        steps = self._allowed_steps(self.rate_bound)
        if taken and steps is not None:
            steps = steps.after(float(self._observed[-2]), float(self._observed[-1]), self._usual)
            if steps is None:
                raise ConvergenceError(self._why(Steps(), self._observed))
        while steps is not None:
            self._run(self.inner * steps.split, steps.stiff)
            bound = float(self._observed[-2])
            again = steps.after(bound, float(self._observed[-1]), self._usual)
            if again == steps:
                self.rate_bound = bound
                self._now ^= 1
                return
            if again is None:
                raise ConvergenceError(self._why(steps, self._observed))
            steps = again
        raise ConvergenceError(self._why(None, self._observed))

    def _why(self, steps: Steps | None, observed: np.ndarray, lane: int | None = None) -> str:
        """Why a sample cannot be taken: with the shortest steps that were tried, or none, and what they led to."""
        imbalance, bound, code = observed[-stepping.BEHIND :].tolist()
        if np.isfinite(bound) and (steps is None or not steps.short(bound, self._usual)):
            return f"A mode of the system is too fast ({bound:.3g} 1/s) for any step."
        tried = self._usual / (steps or Steps()).split
        plant = self.plant if self.plant.ndim == 1 else self.plant[:, lane]
        parts = self.programs.overloaded(plant, observed)
        return unsound_sentence(code if np.isfinite(bound) else Soundness.IMPOSSIBLE, imbalance, tried, parts)

    def _run(self, inner: int, stiff: bool) -> None:
        calls = self._calls.get(stiff)
        if calls is None:
            calls = self._calls[stiff] = [self._bound(stiff, k) for k in range(2)]
        self._inner[()] = inner
        self.steps_taken, self.stiff = inner, stiff
        calls[self._now]()

    def _bound(self, stiff: bool, source: int) -> Callable[[], None]:
        """A call that goes from one of the carries to the other."""
        function = self.programs.step(stiff)
        inputs = [self.plant, self._carries[source], self._commands, np.float64(self.period), self._inner]
        wanted = [self._carries[1 - source], self._observed]
        if function.engine != "native":
            return functools.partial(_by_xla, function, inputs, wanted, self._padded)
        arrays = [np.asarray(a) for a in inputs]
        few = self._padded is not None and self._padded * self.inner <= ONE_THREAD
        return function.program.bind(arrays, wanted, lanes=self._padded, mode=MODE, threads=1 if few else None)


def _kernel_at(
    programs: Programs, plant: np.ndarray, period: float, inner: int, lanes: int | None, *moment: Any
) -> SampleKernel:
    """A copy of a kernel at a moment; its calls are bound anew to its own places in memory."""
    kernel, (carry, observed, commands, bound) = SampleKernel(programs, plant, period, inner, lanes), moment
    kernel.set_carry(carry, observed)
    for place, value in enumerate(commands):
        kernel.set_command(place, value)
    kernel.rate_bound = bound
    return kernel


def _by_xla(function: EngineFunction, inputs: Sequence[Tree], wanted: Sequence[np.ndarray], lanes: int | None) -> None:
    """The same call where there is no kernel."""
    for target, value in zip(wanted, function(*inputs, lanes=lanes), strict=True):
        target[...] = value


class RecordingKernel:
    """The same samples once more, with all outputs and the integrals of the balances.

    Args:
        programs: programs of the machine's structure.
        plant: its parameters as a vector.
        period: period of the samples [s].
        inner: steps of the physics per sample, where modes and balances allow them.
    """

    def __init__(self, programs: Programs, plant: np.ndarray, period: float, inner: int) -> None:
        self.programs, self.plant, self.period, self.inner = programs, plant, period, inner
        self.most_steps = inner

    def replay(
        self, carry: np.ndarray, commands: np.ndarray, bound: float
    ) -> tuple[JsonValue, dict[str, JsonValue], dict[str, JsonValue]]:
        """Go through samples again.

        Args:
            carry: at the start.
            commands: commands of the samples, (samples, commands).
            bound: bound of the fastest mode at the start [1/s].

        The most steps that a sample took are then in `most_steps`.

        Returns:
            The carry at the end, the integrals over all samples, and the outputs (samples + 1,).
        """
        # the carries come from the kernel that stepped, so that its choice of steps is made again as it was
        pilot = SampleKernel(self.programs, self.plant, self.period, self.inner)
        pilot.set_carry(carry, np.zeros(len(self.programs.fields) + stepping.BEHIND))
        pilot.rate_bound = bound
        rows = [self.programs.outputs(self.plant, carry)]
        sums: dict[str, float] = {}
        for row in commands:
            before = pilot.carry.copy()
            pilot.commands[:] = row
            pilot.step()
            self.most_steps = max(self.most_steps, pilot.steps_taken)
            run = self.programs.recorded(pilot.stiff)
            _, integrals, outputs = run(
                self.plant, before, row, np.float64(self.period), np.int64(pilot.steps_taken), mode=MODE
            )
            for name, value in integrals.items():
                sums[name] = sums.get(name, 0.0) + float(value)
            rows.append(outputs)
        outputs = map_leaves(lambda *values: np.array(values, float), *rows)
        return pilot.carry, sums, outputs


class SteppedSimulation(abc.ABC):
    """What a simulation is beside its present moment, of which recordings, lanes and rollouts are made; see `Simulation`."""

    title: str
    system: Mechanism
    units: dict[str, MuscleUnit]
    air: AirCircuit
    machine: Machine
    plant: stepping.CommandedMachine
    drives: tuple[stepping.CommandInput, ...]
    commands: tuple[str, ...]
    Observation: Any
    noise: np.ndarray | None
    readouts: ReadoutLines
    programs: Programs
    parameters: np.ndarray
    period: float
    inner: int
    cautions: tuple[Caution, ...]

    @property
    def fingerprint(self) -> str:
        """Says which saved states fit."""
        return f"{self.plant.shown} {self.commands} {self.programs.layouts.carry.shapes}"

    @property
    def assumptions(self) -> tuple[Assumption, ...]:
        """The numbers of muscles, mechanism and air that nobody stated, each with where it comes from."""
        return (*self.system.assumptions(self.units), *self.air.assumptions)

    @abc.abstractmethod
    def start_commands(self, pressure: StartPressure | None = None) -> dict[str, float]:
        """Commands at the start [SI]."""

    @abc.abstractmethod
    def rest_state(self, pressure: StartPressure | None = None) -> tuple[np.ndarray, np.ndarray]:
        """What goes into the first sample, and the observation there, as vectors."""

    @abc.abstractmethod
    def save_state(self) -> stepping.SimulationState:
        """The present moment."""

    @property
    @abc.abstractmethod
    def command_entries(self) -> dict[str, tuple[int, float, float]]:
        """Of each command its place, and between which values there is nothing to say; `check_command` has the rest."""

    @abc.abstractmethod
    def check_command(self, name: str, value: float, *, lasting: bool = False) -> None:
        """Refuse what cannot be commanded, and say once what can hardly be meant."""

    @abc.abstractmethod
    def check_held(self, name: str, values: np.ndarray, before: np.ndarray) -> None:
        """`check_command` for the values that a command had, each with the one before it."""

    @abc.abstractmethod
    def changed_cautions(self, changes: Iterable[str], of: str = "") -> tuple[Caution, ...]:
        """What can hardly be meant of parameters that were changed."""

    @abc.abstractmethod
    def with_arrays(self, changes: Mapping[str, np.ndarray]) -> SteppedSimulation:
        """The same with parameters that have the type and shape of those that they replace [SI]."""
