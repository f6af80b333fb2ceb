"""A simulation near its present moment as a linear model on the clock of its samples.

    x[k + 1] = A x[k] + B u[k],   y[k] = C x[k]        (all of them deviations)

The state is all that goes from sample to sample: chambers, set-points and dead times of valves, creep, friction and motion.
So dead time is in the model as the samples that pass, and what a controller on this clock meets is what the model has.

A valve has a kink at rest: a regulator fills on one side of it and relieves on the other, and a spool does nothing within
its overlap. A derivative there says nothing of either side. The air is therefore linearised by its describing function: the
gain for the first harmonic of a sine of a stated amplitude, found by Gauss's quadrature of Chebyshev,

    N(a) = 2/(a m) sum f_odd(a sin t_k) sin t_k,   t_k = (k + 1/2) pi/(2 m),   f_odd(e) = (f(e) - f(-e))/2

exact for what is linear. The amplitudes of the chambers are those that a step of the commands by theirs brings about. All
else, which is smooth or held, is differenced over a thousandth of that. Range: amplitudes that move no chamber by more than
some per cent; a valve that goes on filling does so at low frequencies. Source: A. Gelb and W. E. Vander Velde,
Multiple-Input Describing Functions and Nonlinear System Design, McGraw-Hill, 1968.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .._jax import Scalar
from ..answers import Answer, Caution, Column, Table, brief, collect
from ..assembly.linearise import Mode, bandwidth_of, modes_of, state_names
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import with_unit
from .kernel import SampleKernel, SteppedSimulation
from .mechanisms import Amount, in_si
from .recorded import described
from .stepping import BEHIND

AMPLITUDES = {"Pa": 1e4, "1": 0.1, "N": 1.0, "N*m": 0.02, "m": 1e-4}  # of commands, where none is stated [SI]
POINTS = 3  # of the quadrature on either side
SMALL = 1e-3  # share of its amplitude over which what is smooth is differenced
HORIZON, FEWEST, MOST = 0.3, 20, 150  # of the run that finds amplitudes [s], and its samples
INSIDE = 1.0 - 1e-3  # of a stuck contact's deflection: on its limit it would slip to one side
KINK = 0.1  # share by which a gain may differ from side to side before it is said
ADRIFT = 0.1  # share of the amplitude that the outputs may move of themselves before it is said
CHAMBER = (
    0.05  # most of a chamber's pressure and mass that is its amplitude: where valves go on filling, steps end far off
)
NOTHING = 1e-9  # share of its size by which an output that is moved at least changes


@dataclass(frozen=True)
class SampledModel(Answer):
    """A linear model on a sample clock; see `Simulation.linearise`.

    Attributes:
        A: state by state, (n, n) [SI].
        B: state by input, (n, m).
        C: output by state, (p, n).
        D: output by input, (p, m): zero, for a command acts after the sample that it follows.
        period: of the samples [s].
        states: names of the states that inputs move and outputs show.
        inputs: names of the commands.
        outputs: names of the fields of the observation.
        units_of: SI units of inputs and outputs, by name.
        commands: at the operating point, by input [SI].
        values: of the outputs there [SI].
        amplitudes: of the inputs for which the gain holds [SI].
        friction: whether friction and creep are ``stuck``, springs as in small motion, or ``held``, their force constant.
        cautions: kinks, and motion of its own, about this point.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    period: float
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units_of: Mapping[str, str]
    commands: Mapping[str, float]
    values: Mapping[str, float]
    amplitudes: Mapping[str, float]
    friction: str
    cautions: tuple[Caution, ...] = ()

    __repr__ = brief

    @property
    def poles(self) -> np.ndarray:
        """Eigenvalues as rates [1/s], the slowest first; without those at zero that dead time has on the sample clock."""
        values = np.linalg.eigvals(self.A).astype(complex)
        # a chain of n samples of dead time has its n eigenvalues within the n-th root of rounding about zero
        chain = max(2, sum(name.startswith("past ") for name in self.states) + 1)
        rates = np.log(values[np.abs(values) > np.finfo(float).eps ** (1.0 / chain)]) / self.period
        return np.asarray(rates[np.argsort(np.abs(rates))])

    def modes(self, slowest: float = 1e-3) -> list[Mode]:
        """The modes faster than `slowest` [1/s], a complex pair once, the slowest first."""
        return modes_of(self.poles, slowest)

    def response(self, source: str, target: str, frequency: Scalar) -> np.ndarray:
        """Complex response of an output to an input [output/input] at frequencies [Hz].

        Raises:
            InputError: names the names that there are, or a frequency that no sample clock of this period shows.
        """
        f, highest = np.atleast_1d(np.asarray(frequency, float)), 0.5 / self.period
        if not np.all((f > 0.0) & (f <= highest)):
            raise InputError("frequency", str(frequency), f"must be above 0 Hz and up to {highest:g} Hz, half a sample")
        for name, known, kind in ((source, self.inputs, "input"), (target, self.outputs, "output")):
            if name not in known:
                raise InputError(kind, name, known=known, where="linear model")
        row, column = self.outputs.index(target), self.inputs.index(source)
        z = np.exp(2j * np.pi * f * self.period)[:, None, None]
        states = np.linalg.solve(
            z * np.eye(len(self.A)) - self.A, np.broadcast_to(self.B[:, [column]], (f.size, len(self.A), 1))
        )
        return np.asarray((self.C[[row]] @ states)[:, 0, 0] + self.D[row, column])

    def gain(self, source: str, target: str, frequency: float = 1e-3) -> float:
        """Size of the response at a frequency [Hz], by default one at which the air has come to rest [output/input].

        Raises:
            InputError: see `response`.
        """
        return float(np.abs(self.response(source, target, frequency))[0])

    def bandwidth(self, source: str, target: str, *, lowest: float = 0.01) -> float:
        """Lowest frequency [Hz] at which the response has fallen by 3 dB from its value at `lowest`.

        Raises:
            UnreachableError: if it does not fall so far up to half a sample.
        """
        highest = 0.5 / self.period
        return bandwidth_of(
            functools.partial(self.response, source, target), f"{target} over {source}", lowest, highest
        )

    def bode(self, source: str, target: str, frequency: Scalar | None = None) -> Table:
        """Size and phase of a response by frequency.

        Args:
            source: input.
            target: output.
            frequency: frequencies (n,) [Hz]; ten a decade from 0.1 Hz to half a sample where left out.
        """
        highest = 0.5 / self.period
        f = (
            np.geomspace(0.1, highest, max(2, math.ceil(10 * math.log10(10.0 * highest))))
            if frequency is None
            else frequency
        )
        f = np.minimum(np.atleast_1d(np.asarray(f, float)), highest) if frequency is None else np.atleast_1d(f)
        response = self.response(source, target, f)
        size, phase = np.abs(response), np.unwrap(np.angle(response))
        unit = f"{self.units_of[target]} per {self.units_of[source]}"
        rows = [
            {"frequency": a, "gain": b, "phase": c}
            for a, b, c in zip(f.tolist(), size.tolist(), phase.tolist(), strict=True)
        ]
        columns = (
            Column("frequency", unit="Hz"),
            Column("gain", f"gain, {unit}", unit="1"),
            Column("phase", unit="rad", shown="deg", places=".1f"),
        )
        return Table(f"{target} over {source}", columns, rows, tuple(map(str, self.cautions)))

    def to_dict(self) -> dict[str, JsonValue]:
        """Matrices, names and operating point as plain values [SI]."""
        matrices: dict[str, JsonValue] = {name: getattr(self, name).tolist() for name in "ABCD"}
        return matrices | {
            "period": self.period,
            "states": list(self.states),
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "commands": dict(self.commands),
            "values": dict(self.values),
            "amplitudes": dict(self.amplitudes),
            "friction": self.friction,
            "poles": [[value.real, value.imag] for value in self.poles.tolist()],
        }

    def rows(self) -> list[dict[str, JsonValue]]:
        """The modes: natural frequency [Hz] and damping over critical [1]."""
        return [{"frequency": mode.frequency, "damping": mode.damping} for mode in self.modes()]

    def tables(self) -> list[Table]:
        """The modes, with what the gain holds for."""
        columns = Column("frequency", unit="Hz"), Column("damping", unit="1", places=".3g")
        return [Table("Modes", columns, self.rows(), tuple(self.remarks()))]

    def remarks(self) -> list[str]:
        """For which amplitude the gain holds, and what friction does."""
        at = ", ".join(f"{with_unit(a, self.units_of[name])} of {name}" for name, a in self.amplitudes.items())
        motion = "springs, as in motion within their yield travel" if self.friction == "stuck" else "constant forces"
        return [f"The gain is the describing function at an amplitude of {at}; friction and creep are {motion}."]


def linearise(
    simulation: SteppedSimulation,
    inputs: Sequence[str] | None,
    outputs: Sequence[str] | None,
    amplitude: Amount | Mapping[str, Amount] | None,
    friction: str,
) -> SampledModel:
    """The linear model of a simulation about its present moment; see `Simulation.linearise`."""
    if friction not in ("held", "stuck"):
        raise InputError("friction", friction, "must be held or stuck", where="linearise")
    commands, fields = simulation.commands, simulation.programs.fields
    chosen = tuple(commands if inputs is None else (inputs,) if isinstance(inputs, str) else inputs)
    shown = tuple(fields if outputs is None else (outputs,) if isinstance(outputs, str) else outputs)
    for name in chosen:
        if name not in commands:
            raise _no_input(simulation, name)
    for name in shown:
        if name not in fields:
            raise InputError("output", name, known=fields, where="linearise")
    amplitudes = _amplitudes(simulation, chosen, amplitude)
    state = simulation.save_state()
    names = _carry_names(simulation, state.carry)
    x = np.array(state.carry)
    contacts = np.array([name.startswith("memory.muscles.") for name in names])
    x[contacts] *= INSIDE
    ranges, moved, drift = _ranges(simulation, x, np.array(state.commands), amplitudes)
    idle = [name for name, change in zip(commands, moved, strict=True) if name in chosen and not change.max() > NOTHING]
    if idle:
        acting = [name for name, change in zip(commands, moved, strict=True) if change.max() > NOTHING]
        would = f"; {', '.join(acting)} would do" if acting else ""
        size = with_unit(amplitudes[idle[0]], _unit(simulation, idle[0]))
        raise InputError("inputs", idle[0], f"moves nothing by {size} about this point: give a larger amplitude{would}")

    air = np.array([name.startswith(("circuit.", "memory.circuit.", "past ")) for name in names])
    steps = _steps(simulation, x, names, air, ranges, amplitudes)
    steps = np.concatenate([steps, [amplitudes[name] for name in chosen]])
    # a tied muscle that is taut has no state of its own
    taut = np.array([name.endswith(".sag") and value <= 0.0 for name, value in zip(names, x, strict=True)])
    free = np.flatnonzero(~taut & (~contacts | (friction == "stuck")))
    columns = np.concatenate([free, len(x) + np.arange(len(chosen))])
    after, seen, kinks = _responses(simulation, x, np.array(state.commands), chosen, columns, steps)
    n = len(free)
    a, b, c = after[free, :n], after[free, n:], seen[:, :n][[fields.index(name) for name in shown]]
    kept = _minimal(a, b, c, np.maximum(steps[free], 1e-300))
    a, b, c = a[np.ix_(kept, kept)], b[kept], c[:, kept]
    observed = dict(zip(fields, state.observed[:-BEHIND].tolist(), strict=True))
    units = {name: _unit(simulation, name) for name in commands}
    units |= {name: described(output)[0] for name, output in simulation.plant.shown}
    held = dict(zip(commands, state.commands.tolist(), strict=True))
    states = tuple(names[free[k]] for k in kept)
    said = [
        _kink_caution([*names, *chosen], [k for k in kinks if k[0] >= len(x) or (air[k[0]] and names[k[0]] in states)])
    ]
    if drift > ADRIFT:
        said.append(
            Caution(
                f"the simulation is not at rest: within {HORIZON:g} s it moves by {100.0 * drift:.0f} % of what "
                "these amplitudes do; deviations are from that path"
            )
        )
    return SampledModel(
        A=a, B=b, C=c, D=np.zeros((len(shown), len(chosen))), period=simulation.period,
        states=states, inputs=chosen, outputs=shown, units_of={name: units[name] for name in (*chosen, *shown)},
        commands={name: held[name] for name in chosen}, values={name: observed[name] for name in shown},
        amplitudes={name: amplitudes[name] for name in chosen}, friction=friction, cautions=collect(*said),
    )  # fmt: skip


def _steps(
    simulation: SteppedSimulation,
    x: np.ndarray,
    names: Sequence[str],
    air: np.ndarray,
    ranges: np.ndarray,
    amplitudes: Mapping[str, float],
) -> np.ndarray:
    """Amplitude of each number (n,): of the air that which commands give it, of all else a small share of it."""
    chamber = np.array([name.startswith(("circuit.mass.", "circuit.pressure.")) for name in names])
    ranges = np.where(chamber, np.minimum(ranges, CHAMBER * np.abs(x)), ranges)
    command = {drive.signal: drive.command for drive in simulation.drives}
    for k, name in enumerate(names):
        signal = name.removeprefix("past ").rpartition(" ")[0]
        if name.startswith("past ") and signal in command:
            ranges[k] = amplitudes[command[signal]]
    return np.asarray(np.maximum(np.where(air, 1.0, SMALL) * ranges, np.maximum(1e-6 * np.abs(x), 1e-9)))


def _kink_caution(names: Sequence[str], kinks: Sequence[tuple[int, int, float]]) -> Caution | None:
    """What to say of the worst kink; None where there is none."""
    if not kinks:
        return None
    column, row, rise = max(kinks, key=lambda kink: abs(math.log(max(abs(kink[2]), 1e-9))))
    words = f"a rise of {names[column]} moves {names[row]} {rise:.3g} times as much as a fall"
    return Caution(f"{words}: the gain is the describing function of both sides", "amplitude")


def _unit(simulation: SteppedSimulation, command: str) -> str:
    return next(drive.unit for drive in simulation.drives if drive.command == command)


def _no_input(simulation: SteppedSimulation, name: str) -> InputError:
    """The error for what is no command; says which command drives a signal of that name."""
    for drive in simulation.drives:
        if name in (drive.signal, f"{drive.signal}.command"):
            return InputError("input", name, f"is no command; {drive.command} drives it", where="linearise")
    return InputError("input", name, known=simulation.commands, where="linearise")


def _amplitudes(
    simulation: SteppedSimulation, chosen: Sequence[str], stated: Amount | Mapping[str, Amount] | None
) -> dict[str, float]:
    """Amplitude of every command [SI]: what is stated of the chosen ones, else the usual one of its unit."""
    if stated is not None and not isinstance(stated, Mapping):
        units = {_unit(simulation, name) for name in chosen}
        if len(units) != 1:
            problem = "must be one for each input, as {'muscle': '0.1 bar'}: their units differ"
            raise InputError("amplitude", str(stated), problem, where="linearise")
        stated = dict.fromkeys(chosen, stated)
    amplitudes = {name: AMPLITUDES.get(_unit(simulation, name), 1e-3) for name in simulation.commands}
    for name, value in (stated or {}).items():
        if name not in amplitudes:
            raise _no_input(simulation, name)
        amplitudes[name] = in_si(value, _unit(simulation, name), f"amplitude of {name}")
        if not amplitudes[name] > 0.0:
            raise InputError("amplitude", str(value), "must be above zero", where="linearise")
    return amplitudes


def _carry_names(simulation: SteppedSimulation, carry: np.ndarray) -> list[str]:
    """A name for each number that goes from sample to sample; past commands by signal and age in samples."""
    state, memory, history = simulation.programs.layouts.carry.unpack(carry)
    names = [*state_names(state), *(f"memory.{name}" for name in state_names(memory))]
    for signal, values in sorted(history.items()):
        names += [f"past {signal} {k - len(values)}" for k in range(len(values))]
    return names


class _Lanes:
    """A simulation at many states at once, each for one sample or more."""

    def __init__(self, simulation: SteppedSimulation, carry: np.ndarray, commands: np.ndarray) -> None:
        count = carry.shape[1]
        self.kernel = SampleKernel(
            simulation.programs, simulation.parameters, simulation.period, simulation.inner, count
        )
        self.kernel.set_carry(carry, simulation.programs.observe(simulation.parameters, carry))
        for place, values in enumerate(commands):
            self.kernel.set_command(place, values)
        self.fields, self.count = len(simulation.programs.fields), count

    def step(self) -> tuple[np.ndarray, np.ndarray]:
        """Carries and fields of the observation at the end of a sample, (numbers, lanes) each."""
        self.kernel.step()
        return self.kernel.carry[:, : self.count].copy(), self.kernel.observation[: self.fields].copy()


def _ranges(
    simulation: SteppedSimulation, x: np.ndarray, held: np.ndarray, amplitudes: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray, float]:
    """How far steps of the commands by their amplitudes move every number, and each command the outputs.

    Returns:
        Of the numbers (n,); of the outputs by each command, as a share of their size, (commands, fields); and the most that
        an output moves without any, as a share of that.
    """
    sizes = np.array([amplitudes[name] for name in simulation.commands])
    lanes = 1 + 2 * len(sizes)
    commands = np.repeat(held[:, None], lanes, axis=1)
    commands[:, 1:] += np.concatenate([np.diag(sizes), -np.diag(sizes)], axis=1)
    run = _Lanes(simulation, np.repeat(x[:, None], lanes, axis=1), commands)
    carries, fields = zip(
        *(run.step() for _ in range(min(MOST, max(FEWEST, round(HORIZON / simulation.period))))), strict=True
    )
    rows, seen = np.array(carries), np.array(fields)
    apart = np.abs(seen[:, :, 1:] - seen[:, :, :1]).max(axis=0)
    own = np.abs(seen[:, :, 0] - seen[0, :, 0]).max(axis=0)
    size = np.abs(seen[:, :, 0]).max(axis=0) + 1e-6
    apart = np.maximum(apart[:, : len(sizes)], apart[:, len(sizes) :])
    most = apart.max(axis=1)
    drift = float(np.max(own / np.maximum(most, NOTHING * size), where=most > NOTHING * size, initial=0.0))
    return np.abs(rows[:, :, 1:] - rows[:, :, :1]).max(axis=(0, 2)), (apart / size[:, None]).T, drift


def _responses(
    simulation: SteppedSimulation,
    x: np.ndarray,
    held: np.ndarray,
    chosen: Sequence[str],
    columns: np.ndarray,
    steps: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, list[tuple[int, int, float]]]:
    """Gains of a sample by describing functions.

    Args:
        simulation: of which.
        x: the carry (n,).
        held: commands (m,).
        chosen: commands that are columns.
        columns: numbers of the carry, and n and more for the chosen commands, (k,).
        steps: amplitude of each number and chosen command (n + m,).

    Returns:
        Of the numbers (n, k) and of the fields (fields, k), and kinks: column, row, and rise over fall.
    """
    sines = np.sin((np.arange(POINTS) + 0.5) * np.pi / (2 * POINTS))
    moves = np.concatenate([sines, -sines])
    lanes, n = len(columns) * len(moves), len(x)
    change = np.zeros((n + len(held), len(columns), len(moves)))
    rows = [c if c < n else n + simulation.commands.index(chosen[c - n]) for c in columns]
    change[rows, np.arange(len(columns))] = steps[columns, None] * moves
    moved = change.reshape(len(change), lanes)
    # a lane without any change at the end, from which rises and falls are told
    carry = np.concatenate([x[:, None] + moved[:n], x[:, None]], axis=1)
    commands = np.concatenate([held[:, None] + moved[n:], held[:, None]], axis=1)
    shown = simulation.programs.observe(simulation.parameters, carry)[:-BEHIND]
    after, _ = _Lanes(simulation, carry, commands).step()

    def gains(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        apart = (values[:, :-1] - values[:, -1:]).reshape(len(values), len(columns), 2, POINTS)
        sides = 2.0 * (apart * sines).sum(axis=-1) / (POINTS * steps[columns, None])
        return 0.5 * (sides[:, :, 0] - sides[:, :, 1]), sides * [1.0, -1.0]

    whole, sides = gains(after)
    fields, _ = gains(shown)
    weight = np.abs(whole) * steps[columns] / np.maximum(steps[:n, None], 1e-300)
    kinks = []
    for k in range(len(columns)):
        row = int(np.argmax(np.where(np.arange(n) == columns[k], 0.0, weight[:, k])))
        rise, fall = sides[row, k]
        if weight[row, k] > KINK and min(abs(rise), abs(fall)) < (1.0 - KINK) * max(abs(rise), abs(fall)):
            kinks.append((int(columns[k]), row, float(rise / fall) if fall else math.inf))
    return whole, fields, kinks


def _minimal(a: np.ndarray, b: np.ndarray, c: np.ndarray, size: np.ndarray) -> list[int]:
    """States that an input reaches and an output shows; effects below rounding, in their amplitudes, are none."""
    acts = np.abs(a) * size / size[:, None] > NOTHING
    reached, shown = np.abs(b).max(axis=1, initial=0.0) > 0.0, np.abs(c).max(axis=0, initial=0.0) > 0.0
    for _ in range(len(a)):
        reached, shown = reached | (acts @ reached), shown | (acts.T @ shown)
    return np.flatnonzero(reached & shown).tolist()
