"""A system that one steps: mechanism, muscles and air behind one's own controller.

    sim = mk.Simulation(mk.Joint("nylon", arm="2 cm"), mk.Air(supply="6 bar"), period=2e-3)
    seen = sim.reset(seed=0)
    for _ in range(500):
        seen = sim.step(flexor=0.5 * (0.3 - seen.angle), extensor=-0.1)
    recording = sim.recording()

The physics is the state equation of `assembly`, integrated by the steps of `engine`. One step is one call of a native
kernel, which is compiled when a structure is first stepped, and found on disk from then on.
"""

from __future__ import annotations

import functools
import keyword
import math
from collections import namedtuple
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from .._jax import Scalar, Tree
from ..answers import Caution, collect, warn
from ..assembly.machine import Machine
from ..components import paths
from ..components.system import Value
from ..errors import InputError
from ..muscles.plausible import BEYOND, parameter_caution, span_cautions, start_pressure_caution
from ..quantities import named_values, random_generator, with_unit
from ..recordings.recording import Recording
from ..slips import noise_caution, size_caution
from ..specimens import Specimen
from .air import AirCircuit, air_circuit
from .batch import SimulationBatch
from .estimator import LANES, Estimator
from .fit import Free, SimulationFit, Train, fit
from .kernel import Programs, SampleKernel, SteppedSimulation
from .linear import SampledModel, linearise
from .mechanisms import Amount, Mechanism, StartPressure, ends_in_si, in_si, published
from .readouts import Readout, ReadoutLines
from .recorded import described, record
from .rollout import Rollout
from .stepping import BEHIND, CommandedMachine, CommandInput, SaidCommands, SimulationState, rest_carry, unnamed_command

MOST_STEPS = 100_000  # of the physics in one period; more are a slip of units, and take forever
LONGEST_PERIOD = 10.0  # of the samples [s]; longer ones are frequencies in Hz
STEP = 2e-4  # largest step of the physics unless stated otherwise [s]
USUAL_PERIODS, USUAL_STEPS = (1e-5, 0.5), (1e-6, 2e-2)  # [s]
MEANT_IN_BAR = 100.0  # [Pa]; a smaller pressure that is commanded was meant in another unit
OF_MUSCLES = ("pressure", "tension", "length")  # outputs of a muscle that an observation shows


class Simulation(SteppedSimulation):
    """Mechanism, muscles and air, advanced one sample at a time by commands.

    Args:
        system: what moves: a `Joint`, `Chain`, `Weight`, `Spring` or `Plate`. Its muscles are tied to their anchors, unless
            it states a tendon.
        air: an `Air`, or the path of a circuit file with the mechanism's muscles by name; `Air()` by default.
        period: period of the samples, during which commands hold [s].
        step: largest step of the physics [s]; shortened so that a whole number fits a period, and where a mode asks for it.
        noise: standard deviation of the noise on fields of the observation, by field [SI, or words with a unit]; none by
            default.
        readouts: how fields of the observation are read, by field: rounded, by a median, late, see `Readout`; as they are by
            default.
        limits: for commands the smallest and the largest value that acts, [SI] or in words; none by default.
        title: title of recordings; names the mechanism and its muscles by default.

    Attributes:
        commands: names of the commands of `step`.
        cautions: what was said of values that can hardly be meant, when they were first given; a recording keeps them.
        machine: the state equation, of `assembly`.
        period: period of the samples [s].

    Raises:
        InputError: names what does not fit.

    Examples:
        >>> import mckibben as mk
        >>> sim = mk.Simulation(mk.Weight("nylon", mass="2 kg"), mk.Air(valve="regulator"), period="5 ms")
        >>> seen = sim.reset()
        >>> for _ in range(20):
        ...     seen = sim.step(muscle=3e5)
        >>> seen.pressure > 2e5
        True
    """

    def __init__(
        self,
        system: Mechanism,
        air: Any = None,
        *,
        period: Amount = 2e-3,
        step: Amount = STEP,
        noise: Mapping[str, Amount] | None = None,
        readouts: Mapping[str, Readout] | None = None,
        limits: Mapping[str, tuple[Amount, Amount]] | None = None,
        title: str = "",
    ) -> None:
        if not isinstance(system, Mechanism):
            raise InputError("system", type(system).__name__, "must be a Joint, Chain, Weight, Spring or Plate")
        if not isinstance(title, str):
            raise InputError("title", None, f"must be text, got {title!r}")
        self.system, self.period = system, in_si(period, "s", "period")
        self.inner = _whole_steps(self.period, in_si(step, "s", "step"))
        times = (("period", period, USUAL_PERIODS), ("step", step, USUAL_STEPS))
        said = [size_caution(value, "s", name=name, usual=usual) for name, value, usual in times]
        units = self.units = system.units()
        self.air: AirCircuit = air_circuit(air, units)
        said += [*self.air.cautions, *system.cautions(units)]
        self.machine = Machine.of(self.air.circuit, units, system.load(units), self.air.environment)
        self.title = title or f"{type(system).__name__} with {' and '.join(units)}"
        self.drives = _limited((*self.air.drives, *system.drives(units)), limits or {})
        self.commands = tuple(dict.fromkeys(d.command for d in self.drives))
        self._start_commands = dict.fromkeys(self.commands, 0.0) | self.air.begins | system.start_commands(units)
        self._start_pressures = {n: self.air.starts.get(n, 0.0) for n in units} | system.start_pressures(units)
        fields = dict(system.fields())  # of an observation; a single muscle needs no name
        for name in units:
            for output in OF_MUSCLES:
                fields[output if len(units) == 1 else f"{name}_{output}"] = f"{name}.{output}"
        self.plant = CommandedMachine(self.machine, drives=self.drives, shown=tuple(fields.items()))
        units_of = {name: described(output)[0] for name, output in self.plant.shown}
        sizes = _noise_sizes(noise or {}, units_of)
        self.noise = np.array([sizes.get(name, 0.0) for name in units_of]) if sizes else None
        said += [noise_caution(size, units_of[name], of=name) for name, size in sizes.items()]
        self.readouts = ReadoutLines(readouts or {}, units_of, self.period)
        # Samples of past commands that the longest dead time needs
        delays = [e.delay() for e in self.machine.circuit.elements.values()]
        longest = max((float(np.max(d)) for d in delays if d is not None), default=0.0)
        self.depth = math.floor(longest / self.period + 1e-9) + 2
        example = self._carry(self._start_pressures, self.start_commands())
        self.programs = Programs(self.plant, example, self.commands)
        self.parameters = self.programs.layouts.plant.pack(self.plant)
        self._kernel = SampleKernel(self.programs, self.parameters, self.period, self.inner)
        self._said = SaidCommands()
        self.cautions: tuple[Caution, ...] = ()
        self.caution(*said, stacklevel=3)
        self._attach()
        self._rests: dict[Any, tuple[np.ndarray, np.ndarray]] = {}
        self._random = np.random.default_rng(0)
        self._fields = len(self.plant.shown)
        self._sample = self._first = 0
        self._begin: SimulationState | None = None
        self._log: list[float] = []
        self._sensed: list[list[float]] = []

    def __repr__(self) -> str:
        spans = self.system.spans(self.units)
        muscles = ", ".join(f"{n} of {with_unit(spans[n], 'm')} {unit.mounting}" for n, unit in self.units.items())
        timing = f"period={self.period:g} s, step={self.period / self.inner:g} s"
        system = f"{type(self.system).__name__} with {muscles}, {timing}"
        assumed = ", ".join(map(str, self.assumptions)) or "nothing"
        cautions = f"; {len(self.cautions)} cautions" if self.cautions else ""
        limits = {d.command: d.limits for d in self.drives if d.limits is not None}
        read = f"; readouts: {self.readouts.stated}" if self.readouts else ""
        read += f"; limits: {limits}" if limits else ""
        return f"Simulation({system}: {', '.join(self.commands)}{read}; assumed: {assumed}{cautions})"

    def _attach(self) -> None:
        """See the commands and the observation in the kernel's own memory."""
        self.Observation: Any = _observation_type(tuple(self.programs.fields))
        self._buffer: Any = memoryview(self._kernel.commands)
        self._seen: Any = memoryview(self._kernel.observation)
        self._make = self.Observation._make

    def __getstate__(self) -> dict[str, Any]:
        of_this_process = ("Observation", "_buffer", "_seen", "_make")
        return {name: value for name, value in self.__dict__.items() if name not in of_this_process}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._attach()

    def caution(self, *said: Caution | None, stacklevel: int = 2) -> None:
        """Keep cautions, and say as warnings those that were not said before."""
        new = tuple(one for one in collect(*said) if one not in self.cautions)
        self.cautions += new
        warn(new, stacklevel=stacklevel + 1)

    # ---- one sample after the other

    @property
    def time(self) -> float:
        """Since the reset [s]."""
        return self._sample * self.period

    @property
    def truth(self) -> Any:
        """The present observation as it is, without noise and readouts."""
        return self._make((self._sample * self.period, *self._seen.tolist()[: self._fields]))

    def reset(self, seed: int = 0, *, pressure: StartPressure | None = None, **commands: float) -> Any:
        """Begin at rest: friction relaxed, every braid in balance, commands as they lasted before.

        Args:
            seed: seed of the noise.
            pressure: gauge pressure at the start [Pa] of all muscles, or by muscle; that which the mechanism says where left
                out, else none.
            **commands: at the start; zero by default, and for a regulator the pressure of its muscle.

        Returns:
            The observation at the start.

        Raises:
            InputError: names an unknown muscle or command, or a pressure that is none.
        """
        starts = self._pressures(pressure)
        first = self._commands_at(starts)
        for name, value in commands.items():
            self._place(name)
            first[name] = in_si(value, self._unit(name), name)
            self.check_command(name, first[name], lasting=True)
        carry, observed = self._rest(starts, first)
        self._random = random_generator(seed)
        vector = np.array([first[name] for name in self.commands])
        shown = self._with_noise(observed[:-BEHIND].tolist()) if self.noise is not None else []
        if self.readouts:
            shown = self.readouts.reset(shown or observed[:-BEHIND].tolist())
        return self._go_on_from(self._state(0, carry, observed, shown, vector))

    def _state(
        self, sample: int, carry: np.ndarray, observed: np.ndarray, shown: Sequence[float], commands: np.ndarray
    ) -> SimulationState:
        noise, lines = self._random.bit_generator.state, tuple(map(tuple, self.readouts.lines))
        return SimulationState(sample, carry, observed, tuple(shown), commands, noise, self.fingerprint, lines)

    def step(self, *unnamed: float, **commands: float) -> Tree:
        """Hold commands for one period and go on to its end; a command that is left out stays as it was.

        Args:
            *unnamed: none; commands are given by name.
            **commands: by name, plain numbers [SI]; `commands` lists the names.

        Returns:
            The observation at the end: a named tuple of floats, ``time`` [s] first.

        Raises:
            InputError: names an unknown command, or says how to name one that is given without its name.
            ConvergenceError: the state is not finite or not possible, or no step is short enough.
        """
        if unnamed:
            raise unnamed_command(unnamed, self.commands)
        if self._begin is None:
            self.reset()
        buffer = self._buffer
        try:
            for name, value in commands.items():
                place, low, high = self.command_entries[name]
                if value is True or value is False:
                    raise TypeError(value)
                if not low <= value <= high:  # or it is no number
                    self.check_command(name, value)
                buffer[place] = value
        except (KeyError, TypeError, ValueError):  # words with a unit, or what is refused
            for name, value in commands.items():
                place, number = self._place(name), in_si(value, self._unit(name), name)
                self.check_command(name, number)
                buffer[place] = number
        self._log += buffer.tolist()
        self._kernel.step()
        self._sample += 1
        return self._observation()

    def _observation(self) -> Any:
        numbers: list[float] = self._seen.tolist()[: self._fields]
        if self.noise is not None:
            numbers = self._with_noise(numbers)
        if self.readouts:
            numbers = self.readouts.read(numbers)
        if self.noise is not None or self.readouts:
            self._sensed.append(numbers)
        return self._make((self._sample * self.period, *numbers))

    def _with_noise(self, numbers: list[float]) -> list[float]:
        draws = self._random.standard_normal(self._fields)
        sensed: list[float] = (np.asarray(numbers) + np.asarray(self.noise) * draws).tolist()
        return sensed

    def save_state(self) -> SimulationState:
        """The present moment, from which `load_state` goes on bit for bit."""
        if self._begin is None:
            self.reset()
        kernel = self._kernel
        shown = self._sensed[-1] if self._sensed else ()
        return self._state(
            self._sample, kernel.carry.copy(), np.array(kernel.observation), shown, np.array(kernel.commands)
        )

    def load_state(self, state: SimulationState) -> Any:
        """Go on from a saved moment; a recording begins again there.

        Returns:
            The observation at that moment.

        Raises:
            InputError: it was saved by a simulation of another kind.
        """
        if not isinstance(state, SimulationState) or state.structure != self.fingerprint:
            raise InputError("state", type(state).__name__, "must be one that this kind of simulation saved")
        return self._go_on_from(state)

    def _go_on_from(self, state: SimulationState) -> Any:
        self._begin, self._sample = state, state.sample
        self._kernel.set_carry(state.carry, state.observed)
        self._kernel.commands[:] = state.commands
        self._random.bit_generator.state = dict(state.noise)
        self.readouts.lines = [list(line) for line in state.lines]
        self._log, self._sensed = [], [list(state.shown)] if state.shown else []
        return self._make((self._sample * self.period, *(state.shown or state.observed[:-BEHIND].tolist())))

    # ---- what was, and more of the same

    def recording(self) -> Recording:
        """All samples since the last reset or loaded state, as a run on the bench gives them.

        The samples are computed once more with all outputs and balances; no step costs more for that. Channels: the true
        outputs of joint, muscles and air, the commands, and what an observation showed with its noise as measured.
        """
        if self._begin is None:
            self.reset()
        assert self._begin is not None
        return record(self, self._begin, np.array(self._log).reshape(-1, len(self.commands)), self._sensed)

    def batch(self, lanes: int, changes: Mapping[str, Scalar] | None = None) -> SimulationBatch:
        """Many such simulations side by side, each with its own state and commands.

        Args:
            lanes: how many.
            changes: parameters that differ, by dotted path in `machine` (`mckibben.components.paths`), each (lanes,) [SI].
        """
        batch = SimulationBatch(self, lanes, changes or {})
        self.caution(*batch.changed_cautions())
        return batch

    def rollout(self, policy: Callable[..., Tree], *, steps: int, cost: Callable[..., Scalar] | None = None) -> Rollout:
        """A run under a policy as a JAX function of the policy's parameters, with its gradient; see `Rollout`.

        Args:
            policy: policy of (parameters, observation), returns the commands by name.
            steps: samples.
            cost: cost of (observation, commands) at the end of a sample, whose mean the rollout is; by default, the policy
                returns (commands, cost).
        """
        return Rollout(self, policy, steps, cost)

    def linearise(
        self,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        *,
        amplitude: Amount | Mapping[str, Amount] | None = None,
        friction: str = "stuck",
    ) -> SampledModel:
        """The linear model about the present moment on the clock of the samples, dead time included; see `SampledModel`.

        A valve's gain at rest is that of a stated amplitude, by its describing function, and the answer says which.

        Args:
            inputs: commands; all by default.
            outputs: fields of the observation; all by default.
            amplitude: of the inputs [SI, or words with a unit], one or by input; by default 0.1 bar, a tenth of a valve's
                stroke, 1 N, 0.02 N m, 0.1 mm.
            friction: ``stuck``, friction and creep as springs, as in small motion, or ``held``, their force constant.

        Raises:
            InputError: names what is no command or field, or a command that moves nothing at this amplitude.
            ConvergenceError: the simulation cannot take a sample about this point.

        Examples:
            >>> import mckibben as mk
            >>> sim = mk.Simulation(mk.Weight("nylon", mass="2 kg"), mk.Air(valve="regulator"), period="5 ms")
            >>> model = sim.linearise("muscle", "pressure", amplitude="0.1 bar")
            >>> round(model.gain("muscle", "pressure"), 1)
            1.0
        """
        return linearise(self, inputs, outputs, amplitude, friction)

    def fit(
        self,
        record: Recording,
        free: Free,
        *,
        train: Train = None,
        measured: Sequence[str] | None = None,
        channels: Mapping[str, str] | None = None,
        settle: Amount | None = None,
        evaluations: int = 30,
        progress: Callable[[str], None] | None = None,
    ) -> SimulationFit:
        """Fit parameters of muscle, friction, creep, valve and load to a record of commands and sensors.

        The simulation runs free under the recorded commands; every sample that is shown counts.

        Args:
            record: commands and sensors, sampled at the period of the simulation.
            free: for each free parameter its bounds [SI, or words with a unit], None for those that it is declared with. A
                name is a dotted path in `machine` or the end of one, such as ``"muscle.law.rest_diameter"``, a pattern with
                ``*`` for one value of many, or a field of the observation with ``.delay`` or ``.offset`` for its sensor.
                Numbers of an array, or that differ, are scaled together by a factor.
            train: samples that the fit is shown: a slice, a pair of times from the first sample, or truth values (n,); all
                by default. What is not shown moves no bit.
            measured: fields of the observation that are compared; where left out those that were measured, else all.
            channels: channels of commands and fields whose names differ from the simulation's.
            settle: time at rest before the first sample [s]; 1 s by default, and none for what a simulation recorded from
                its reset on.
            evaluations: most runs of the record in each of the searches.
            progress: called with a sentence after each run.

        Raises:
            InputError: names an unknown parameter, channel or field, or a parameter on which the record does not depend.
            ConvergenceError: the simulation cannot go through the record, or the fit ended where it began.

        Examples:
            >>> import math
            >>> import mckibben as mk
            >>> sim = mk.Simulation(mk.Spring("nylon"), mk.Air(valve="regulator"), period="10 ms")
            >>> real = sim.with_parameters({"load.stiffness": "2.5 N/mm"})
            >>> for k in range(100):
            ...     seen = real.step(muscle=2e5 + 1e5 * math.sin(0.2 * k))
            >>> found = sim.fit(real.recording(), {"load.stiffness": ("1 N/mm", "5 N/mm")})
            >>> round(found.estimates["load.stiffness"].value, 1)
            2500.0
        """
        return fit(
            self, record, free, train=train, measured=measured, channels=channels, settle=settle,
            evaluations=evaluations, progress=progress,
        )  # fmt: skip

    def estimator(
        self,
        measured: Sequence[str] = ("pressure",),
        unknown: Sequence[str] | Mapping[str, Amount] = ("load",),
        *,
        spread: Mapping[str, float | str] | None = None,
        noise: Mapping[str, Amount] | None = None,
        lanes: int = LANES,
    ) -> Estimator:
        """An observer that finds what no sensor shows, such as length and tension from the pressure alone; see `Estimator`.

        Args:
            measured: fields of the observation that sensors show.
            unknown: commands that are unknown loads, ``load`` for all forces or moments from outside; perhaps each with its
                standard deviation [SI, or words with a unit], a tenth of the tension at 5 bar where left out.
            spread: relative standard deviations of parameters that differ from lane to lane, by path; by default what the
                specimens say of muscles of their make, and none with ``{}``.
            noise: standard deviations of the sensors [SI, or words with a unit]; those of the simulation by default.
            lanes: how many.

        Raises:
            InputError: names an unknown field, load or parameter.

        Examples:
            >>> import warnings
            >>> import mckibben as mk
            >>> sim = mk.Simulation(mk.Weight("nylon", mass="2 kg"), mk.Air(valve="regulator"), period="5 ms")
            >>> observer, seen = sim.estimator(("pressure",), {"force": "5 N"}, lanes=32), sim.reset()
            >>> known = observer.reset(pressure=seen.pressure)
            >>> for _ in range(100):
            ...     seen = sim.step(force=5.0)
            ...     known = observer.step(pressure=seen.pressure)
            >>> known.low.length < seen.length < known.high.length
            True
        """
        return Estimator(self, measured, unknown, spread=spread, noise=noise, lanes=lanes)

    # ---- details

    def start_commands(self, pressure: StartPressure | None = None) -> dict[str, float]:
        """Commands at the start [SI]; see `reset`."""
        return self._commands_at(self._pressures(pressure))

    def _commands_at(self, starts: Mapping[str, float]) -> dict[str, float]:
        return self._start_commands | {c: starts[muscle] for c, muscle in self.air.settles.items()}

    def rest_state(self, pressure: StartPressure | None = None) -> tuple[np.ndarray, np.ndarray]:
        """What goes into the first sample, and the observation there, as vectors; see `reset`."""
        starts = self._pressures(pressure)
        return self._rest(starts, self._commands_at(starts))

    def _rest(self, starts: Mapping[str, float], commands: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        key = tuple(starts.values()), tuple(commands[name] for name in self.commands)
        if key not in self._rests:
            if len(self._rests) > 64:
                self._rests.clear()
            carry = self.programs.layouts.carry.pack(self._carry(starts, commands))
            self._rests[key] = carry, self.programs.observe(self.parameters, carry)
        return self._rests[key]

    def _pressures(self, pressure: StartPressure | None) -> dict[str, float]:
        starts = dict(self._start_pressures)
        if pressure is None:
            return starts
        stated = pressure if isinstance(pressure, Mapping) else dict.fromkeys(starts, pressure)
        ambient = float(self.machine.environment.pressure_abs)
        for name, value in stated.items():
            if name not in starts:
                raise InputError("pressure", name, known=starts)
            starts[name] = in_si(value, "Pa", f"pressure of {name}")
            spec, called = published(self.system.muscles[name]), f"start pressure of {name}"
            said = start_pressure_caution(starts[name], ambient, spec, text=str(value), name=called)
            self.caution(said, stacklevel=4)
        return starts

    def _carry(self, starts: Mapping[str, float], commands: Mapping[str, float]) -> Any:
        """State, memory and past commands at rest."""
        own, feeding = self.air.starts, self.air.feeding
        room = float(self.machine.environment.pressure_abs)
        nodes = self.machine.circuit.chambers
        pressures = {node: room + starts.get(feeding.get(node, node), own.get(node, 0.0)) for node in nodes}
        return rest_carry(self.plant, pressures, commands, self.depth)

    def _unit(self, command: str) -> str:
        return self._drive(command).unit

    def _place(self, name: str) -> int:
        if name not in self.command_entries:
            raise InputError("command", name, known=self.commands)
        return self.command_entries[name][0]

    @functools.cached_property
    def command_entries(self) -> dict[str, tuple[int, float, float]]:
        """As of a `SteppedSimulation`."""
        drives = ((self._drive(name), self._specimen_of(name)) for name in self.commands)
        limits = (drive.silent(spec, reach=self._reach(drive)) for drive, spec in drives)
        return {name: (place, *pair) for place, (name, pair) in enumerate(zip(self.commands, limits, strict=True))}

    def _reach(self, drive: CommandInput) -> float:
        return drive.reach(self.machine.circuit, self.machine.environment)

    def _drive(self, command: str) -> CommandInput:
        return next(d for d in self.drives if d.command == command)

    def _specimen_of(self, command: str) -> Specimen | None:
        """The muscle whose pressure a command asks for, where it has the name of one."""
        return published(self.system.muscles[command]) if command in self.units else None

    def check_command(self, name: str, value: float, *, lasting: bool = False) -> None:
        """Say of a command that it can hardly be meant, unless `SaidCommands` has it.

        A pressure that inflates nothing is one that holds, or is so small that it was meant in bar: ramps begin at zero.

        Args:
            name: of the command.
            value: of it [SI].
            lasting: whether it holds from the start.

        Raises:
            InputError: it is no finite number, or no command that can be carried out.
        """
        place, low, high = self.command_entries[name]
        drive = self._drive(name)
        if value == 0.0 and drive.unit == "Pa":
            return
        farther = self._said.farther(name, value, high)
        if not farther and not drive.hard and math.isfinite(value):
            return
        said = drive.check(value, self._specimen_of(name), reach=self._reach(drive))
        begins = drive.unit == "Pa" and MEANT_IN_BAR < value < low and value != self._buffer[place]
        if said is not None and farther and (lasting or not begins):
            self._said.keep(name, value, high)
            self.caution(said, stacklevel=4)

    def check_held(self, name: str, values: np.ndarray, before: np.ndarray) -> None:
        """`check_command` for the values that a command had [SI], (n,), each with the one before it, (n,)."""
        _, low, high = self.command_entries[name]
        odd = ~((low <= values) & (values <= high))
        if self._unit(name) == "Pa":  # zero is at rest, and a ramp begins there
            odd &= (values != 0.0) & ~((MEANT_IN_BAR < values) & (values < low) & (values != before))
        for one in {float(values[odd].min()), float(values[odd].max())} if odd.any() else ():
            self.check_command(name, one, lasting=True)

    def with_parameters(self, changes: Mapping[str, Amount]) -> Simulation:
        """The same simulation with other parameters of its machine, by dotted path [SI, or words with a unit].

        Nothing is compiled again.

        Raises:
            InputError: names an unknown path, or a value out of bounds.
        """
        numbers, said = {}, []
        for path, value in named_values(changes, "changes").items():
            stated = paths.declaration(self.machine, path)
            numbers[path] = np.asarray(in_si(value, stated.unit, path))
            stated.check(path, numbers[path])
            said.append(size_caution(value, stated.unit, name=path))
        other = self.with_arrays(numbers)
        known = {one.parameter for one in said if one is not None}  # in the words in which it was typed
        other.caution(*said, *(one for one in other.changed_cautions(numbers) if one.parameter not in known))
        return other

    def changed_cautions(self, changes: Iterable[str], of: str = "") -> tuple[Caution, ...]:
        """What can hardly be meant of parameters that were changed, and of the spans at the start beside them.

        Args:
            changes: their paths.
            of: behind the name of each, such as a lane.
        """
        said: list[Caution] = []
        for path in changes:
            said += parameter_caution(
                f"{path}{of}", paths.declaration(self.machine, path), paths.get(self.machine, path)
            )
        load, commands = self.machine.load, self.start_commands()
        inputs = {drive.signal: Value(commands[drive.command], 0.0) for drive in self.drives}
        spans, single = load.spans(load.initial(), inputs), len(self.units) == 1
        for name, unit in self.machine.units.items():
            called = f"span{of}" if single else f"span of {name}{of}"
            longest = float(unit.law.length_range()[1])
            rest = float(getattr(unit.law, "rest_length", longest))
            if not 0.5 * longest <= rest <= (1.0 + BEYOND) * longest:
                shown, ends = with_unit(rest, "m"), f"{with_unit(0.5 * longest, 'm')} to {with_unit(longest, 'm')}"
                far = f"a rest length of {name}{of} of {shown} is far from the lengths of its law, {ends}"
                said.append(Caution(far, f"rest length of {name}{of}"))
            try:
                said += span_cautions(float(spans[name].span), unit.law, rest, self._specimen_of(name), name=called)
            except InputError as error:  # a span that comes may suit what is changed now
                said.append(Caution(str(error), called))
        return collect(*said)

    def with_arrays(self, changes: Mapping[str, np.ndarray]) -> Simulation:
        """The same with parameters that have the type and shape of those that they replace [SI]."""
        other = object.__new__(Simulation)
        other.__dict__.update(self.__dict__)
        other.readouts = self.readouts.copy()
        other._use(paths.put(self.machine, changes))
        return other

    def _use(self, machine: Machine) -> None:
        self.machine, self._said = machine, SaidCommands(self._said)
        self.plant = self.plant.replace(machine=machine)
        self.parameters = self.programs.layouts.plant.pack(self.plant)
        self._kernel = SampleKernel(self.programs, self.parameters, self.period, self.inner)
        self.__dict__.pop("command_entries", None)  # the supply may be another
        self._attach()
        self._rests, self._begin, self._log, self._sensed = {}, None, [], []


def _whole_steps(period: float, step: float) -> int:
    for name, value in (("period", period), ("step", step)):
        if not value > 0.0:
            raise InputError(name, None, f"must be a time above 0 s, got {value:g} s")
    if period > LONGEST_PERIOD:
        hint = f"; {period:g} Hz are a period of {with_unit(1.0 / period, 's')}"
        raise InputError("period", None, f"must be at most {LONGEST_PERIOD:g} s, got {period:g} s{hint}")
    if period > MOST_STEPS * step:
        problem = f"must be {with_unit(period / MOST_STEPS, 's')} or more at a period of {with_unit(period, 's')}"
        raise InputError("step", with_unit(step, "s"), f"{problem}: a period takes at most {MOST_STEPS:,} steps")
    return max(1, math.ceil(period / step - 1e-9))


def _noise_sizes(noise: Mapping[str, Amount], units_of: Mapping[str, str]) -> dict[str, float]:
    """Standard deviations of the noise on fields of the observation [SI]."""
    sizes = {}
    for name, value in named_values(noise, "noise").items():
        if name not in units_of:
            raise InputError("noise", name, known=units_of)
        sizes[name] = in_si(value, units_of[name], f"noise of {name}")
        if not sizes[name] >= 0.0:
            raise InputError(f"noise of {name}", value, "must be a standard deviation of 0 or more")
    return sizes


def _limited(drives: tuple[CommandInput, ...], limits: Mapping[str, tuple[Amount, Amount]]) -> tuple[CommandInput, ...]:
    """Commands with the limits within which they are held."""
    units, held = {d.command: d.unit for d in drives}, dict[str, tuple[float, float]]()
    for name, pair in named_values(limits, "limits").items():
        if name not in units:
            raise InputError("limits", name, known=units)
        held[name] = ends_in_si(pair, units[name], f"limits of {name}")
    return tuple(d._replace(limits=held.get(d.command)) for d in drives)


@functools.cache
def _observation_type(fields: tuple[str, ...]) -> Any:
    """The type of an observation, one for equal fields; type and values can be pickled though no module names it."""
    assert not any(keyword.iskeyword(name) for name in fields)
    make: Any = namedtuple
    kind = make("Observation", ["time", *fields])  # its fields are those of the mechanism
    kind.__reduce__ = _taken_apart
    return kind


def _observation(fields: tuple[str, ...], values: tuple[Any, ...]) -> Any:
    return _observation_type(fields)(*values)


def _taken_apart(seen: Any) -> tuple[Any, ...]:
    return _observation, (seen._fields[1:], tuple(seen))
