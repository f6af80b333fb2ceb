"""Many simulations of one structure side by side: the verbs of `Simulation`, with arrays of one number per lane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._jax import Scalar, Tree
from ..answers import Caution, brief, collect
from ..components import paths
from ..errors import InputError
from ..quantities import in_si, random_generator, whole_number
from ..recordings.memory import SHARE, free_memory
from ..recordings.recording import Recording
from .kernel import SampleKernel, SteppedSimulation
from .mechanisms import StartPressure
from .recorded import record
from .stepping import BEHIND, SimulationState, unnamed_command


@dataclass(frozen=True)
class BatchState:
    """A batch at a moment, for `SimulationBatch.load_state`; it can be pickled.

    Attributes:
        sample: number of samples since the reset.
        carry: state, memory and past commands, (numbers, lanes).
        observed: the true observations with their rate bounds, (fields + 3, lanes).
        shown: the observations as they were returned, with noise, (fields, lanes).
        commands: in force, (commands, lanes).
        noise: state of the generator of the noise.
        structure: fingerprint of the simulation that made it.
        lines: what its readouts remember.
    """

    sample: int
    carry: np.ndarray
    observed: np.ndarray
    shown: np.ndarray
    commands: np.ndarray
    noise: Mapping[str, Any]
    structure: str
    lines: tuple[tuple[np.ndarray, ...], ...] = ()

    __repr__ = brief


class SimulationBatch:
    """Lanes of a simulation, each with its own state, commands and, where they differ, parameters.

    A lane does what its simulation does alone, bit for bit.

    Args:
        simulation: simulation of which these are lanes.
        lanes: how many.
        changes: parameters that differ, by dotted path, each (lanes,) [SI].

    Raises:
        InputError: names what does not fit.
    """

    def __init__(self, simulation: SteppedSimulation, lanes: int, changes: Mapping[str, Scalar]) -> None:
        lanes = whole_number(lanes, "lanes", least=1)
        need = (
            2 * 8 * (simulation.programs.layouts.carry.size + len(simulation.parameters))
        )  # bytes of one, old and new
        if need * lanes > SHARE * free_memory():
            most = int(SHARE * free_memory() / need)
            raise InputError("lanes", lanes, f"must be at most {most:,}, for which there is memory")
        self.simulation, self.lanes, self.period = simulation, lanes, simulation.period
        self.commands = simulation.commands
        self._units = {drive.command: drive.unit for drive in simulation.drives}
        self._changes = {path: self._checked(path, values) for path, values in changes.items()}
        self._parameters = simulation.parameters
        if self._changes:
            self._parameters = np.stack([self._lane(k).parameters for k in range(lanes)], axis=1)
        self.kernel = SampleKernel(simulation.programs, self._parameters, simulation.period, simulation.inner, lanes)
        self._low, self._high = (np.array([[e[k]] for e in simulation.command_entries.values()]) for k in (1, 2))
        self._readouts = simulation.readouts.copy()
        self._random = np.random.default_rng(0)
        self._sample = 0
        self._begin: BatchState | None = None
        self._log: list[np.ndarray] = []
        self._sensed: list[np.ndarray] = []
        self._last = np.zeros((0, lanes))

    def __repr__(self) -> str:
        return f"SimulationBatch({self.lanes} lanes of {self.simulation!r})"

    def __len__(self) -> int:
        return self.lanes

    @property
    def Observation(self) -> Any:  # noqa: N802 - the type of what `step` returns
        """Type of the observations, a named tuple."""
        return self.simulation.Observation

    @property
    def cautions(self) -> tuple[Caution, ...]:
        """Those of its simulation, with what was said of commands of the lanes."""
        return self.simulation.cautions

    @property
    def time(self) -> float:
        """Since the reset [s]."""
        return self._sample * self.period

    def _checked(self, path: str, values: Scalar) -> np.ndarray:
        stated = paths.declaration(self.simulation.machine, path)
        array = np.asarray(in_si(values, stated.unit, field=path), float)
        if array.shape[-1:] != (self.lanes,):
            raise InputError(path, None, f"must have a value for each of {self.lanes} lanes, got shape {array.shape}")
        stated.check(path, array)
        return array

    def changed_cautions(self) -> tuple[Caution, ...]:
        """What can hardly be meant of the parameters that differ; the lanes at their ends stand for those between."""
        flat = [values.reshape(-1, self.lanes) for values in self._changes.values()]
        ends = sorted({int(lane) for rows in flat for row in rows for lane in (row.argmin(), row.argmax())})
        said = (self._lane(k).changed_cautions(self._changes, f" of lane {k}") for k in ends)
        return collect(*(one for cautions in said for one in cautions))

    def _lane(self, lane: int) -> SteppedSimulation:
        """The simulation of one lane alone."""
        if not self._changes:
            return self.simulation
        return self.simulation.with_arrays({path: values[..., lane] for path, values in self._changes.items()})

    def reset(self, seed: int = 0, *, pressure: StartPressure | None = None) -> Any:
        """Begin at rest in all lanes; see `Simulation.reset`.

        Args:
            seed: seed of the noise, which differs from lane to lane.
            pressure: gauge pressure at the start [Pa], of all muscles or by muscle.

        Returns:
            The observation: a named tuple of arrays (lanes,), and the time.
        """
        commands = self.simulation.start_commands(pressure)
        number = self.lanes if self._changes else 1
        starts = [self._lane(k).rest_state(pressure) for k in range(number)]
        each = self.lanes // number
        carry, observed = (np.repeat(np.stack([s[i] for s in starts], axis=1), each, axis=1) for i in range(2))
        self._random = random_generator(seed)
        held = np.repeat(np.array([[commands[name]] for name in self.commands]), self.lanes, axis=1)
        shown = np.array(self._readouts.reset(self._with_noise(observed[:-BEHIND])))
        return self._go_on_from(self._state(0, carry, observed, shown, held))

    def _state(
        self, sample: int, carry: np.ndarray, observed: np.ndarray, shown: np.ndarray, commands: np.ndarray
    ) -> BatchState:
        noise, lines = self._random.bit_generator.state, tuple(map(tuple, self._readouts.lines))
        return BatchState(sample, carry, observed, shown, commands, noise, self.simulation.fingerprint, lines)

    def step(self, *unnamed: object, **commands: object) -> Tree:
        """Hold commands for one period in all lanes; a command that is left out stays as it was.

        Args:
            *unnamed: none; commands are given by name.
            **commands: by name, a number for all lanes or an array (lanes,) [SI, or words with a unit].

        Raises:
            InputError: names an unknown command, one that is given without its name, or an array of another shape.
            ConvergenceError: the state of a lane is not finite or not possible, or no step is short enough.
        """
        if unnamed:
            raise unnamed_command(unnamed, self.commands)
        if self._begin is None:
            self.reset()
        entries = self.simulation.command_entries
        for name, value in commands.items():
            if name not in entries:
                raise InputError("command", name, known=self.commands)
            array = np.asarray(in_si(value, self._units[name], field=name), float)
            if array.shape not in ((), (self.lanes,)):
                raise InputError(name, None, f"must be a number or {self.lanes} values, got shape {array.shape}")
            self.kernel.set_command(entries[name][0], array)
        held = self.kernel.commands
        if not ((held >= self._low) & (held <= self._high)).all():  # or one is no number
            assert self._begin is not None
            before = self._log[-1] if self._log else self._begin.commands
            for name, (place, _, _) in entries.items():
                self.simulation.check_held(name, held[place], before[place])
        self._log.append(self.kernel.commands.copy())
        self.kernel.step()
        self._sample += 1
        return self._observation()

    def _observation(self) -> Any:
        rows = self._with_noise(self.kernel.observation[:-BEHIND])
        if self._readouts:
            rows = np.array(self._readouts.read(rows))
        self._last = rows
        if self._senses:
            self._sensed.append(rows)
        return self.Observation(self.time, *rows)

    @property
    def _senses(self) -> bool:
        """Whether an observation is another than the true one."""
        return self.simulation.noise is not None or bool(self._readouts)

    def _with_noise(self, rows: np.ndarray) -> np.ndarray:
        noise = self.simulation.noise
        return rows.copy() if noise is None else rows + noise[:, None] * self._random.standard_normal(rows.shape)

    def save_state(self) -> BatchState:
        """The present moment of all lanes, from which `load_state` goes on bit for bit."""
        if self._begin is None:
            self.reset()
        kernel, many = self.kernel, slice(self.lanes)
        carry, observed = kernel.carry[:, many].copy(), np.array(kernel.observation)
        return self._state(self._sample, carry, observed, self._last, np.array(kernel.commands))

    def load_state(self, state: BatchState) -> Any:
        """Go on from a saved moment; a recording begins again there.

        Raises:
            InputError: it was saved by a batch of another kind or size.
        """
        fits = isinstance(state, BatchState) and state.structure == self.simulation.fingerprint
        if not fits or state.carry.shape[1] != self.lanes:
            raise InputError(
                "state", type(state).__name__, f"must be one that such a batch of {self.lanes} lanes saved"
            )
        return self._go_on_from(state)

    def load_states(self, states: SimulationState | Sequence[SimulationState]) -> Any:
        """Go on from moments of the simulation: one for all lanes, as a controller plans from the present, or one per lane.

        Returns:
            The observation there. Noise begins as that of the first state.

        Raises:
            InputError: they are none that such a simulation saved, or not one for each lane.

        Examples:
            >>> import mckibben as mk
            >>> sim = mk.Simulation(mk.Weight("nylon", mass="2 kg"), mk.Air(valve="regulator"), period="5 ms")
            >>> seen, many = sim.step(muscle=3e5), sim.batch(3)
            >>> many.load_states(sim.save_state()).pressure.tolist() == 3 * [seen.pressure]
            True
        """
        each = [states] * self.lanes if isinstance(states, SimulationState) else list(states)
        fits = all(isinstance(s, SimulationState) and s.structure == self.simulation.fingerprint for s in each)
        if not fits or len(each) != self.lanes:
            raise InputError("states", None, f"must be one or {self.lanes} that this kind of simulation saved")
        carry, observed, commands = (
            np.stack([getattr(s, n) for s in each], axis=1) for n in ("carry", "observed", "commands")
        )
        shown = np.stack([s.shown or s.observed[:-BEHIND] for s in each], axis=1)
        lines = tuple(
            tuple(map(np.array, zip(*line, strict=True))) for line in zip(*(s.lines for s in each), strict=True)
        )
        first = each[0]
        moment = first.sample, carry, observed, shown, commands, first.noise, first.structure, lines
        return self._go_on_from(BatchState(*moment))

    def _go_on_from(self, state: BatchState) -> Any:
        self._begin, self._sample = state, state.sample
        self.kernel.set_carry(state.carry, state.observed)
        for k, row in enumerate(state.commands):
            self.kernel.set_command(k, row)
        self._random.bit_generator.state = dict(state.noise)
        self._last = state.shown
        self._readouts.lines = [list(line) for line in state.lines]
        self._log, self._sensed = [], [state.shown] if self._senses else []
        return self.Observation(self.time, *state.shown)

    def recording(self, lane: int = 0) -> Recording:
        """All samples of a lane since the last reset or loaded state; see `Simulation.recording`."""
        if not 0 <= lane < self.lanes:
            raise InputError("lane", lane, f"must be between 0 and {self.lanes - 1}")
        if self._begin is None:
            self.reset()
        begin = self._begin
        assert begin is not None
        own = self._lane(lane)
        start = SimulationState(
            begin.sample,
            begin.carry[:, lane],
            begin.observed[:, lane],
            tuple(begin.shown[:, lane]),
            begin.commands[:, lane],
            begin.noise,
            begin.structure,
        )
        rows = np.array([values[:, lane] for values in self._log]).reshape(-1, len(self.commands))
        return record(own, start, rows, [values[:, lane].tolist() for values in self._sensed])
