"""Parameters of a simulation from a record of its commands and sensors, while it moves.

The simulation runs free under the recorded commands, from rest at the recorded pressure; what it shows is compared with
the sensors at every sample that the fit is shown. Derivatives are central differences: all parameters and either side are
lanes of one batch, so that a step of the search costs one run. The search, its intervals and what the data cannot tell are
those of all fits (`estimation`). Range: parameters that act smoothly beside the noise; from far off the search may end at
another minimum.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import numpy as np

from ..answers import Answer, Caution, Column, Table, brief, collect, estimates, warn
from ..assembly.machine import Machine
from ..components import paths
from ..documents import JsonValue
from ..errors import ConvergenceError, InputError
from ..estimation import Descent, Estimate, Estimation, Parameter, Search, at_bounds, bounds_of, conclude, misfit
from ..quantities import Quantity, named_values, whole_number, with_unit
from ..recordings.recording import Recording
from ..slips import likely_unit, size_caution
from .batch import SimulationBatch
from .kernel import SteppedSimulation
from .mechanisms import Amount, in_si
from .recorded import described
from .stepping import BEHIND

Free = Mapping[str, tuple[Amount, Amount] | None]
Train = slice | tuple[Amount, Amount] | np.ndarray | None

REST = 1.0  # time that a real machine has rested before its record begins [s]
LONGEST_REST = 1e3  # [s]; every run of the record goes through it
USUAL_REST = 1e-3, 60.0  # [s]
STEP = 1e-4  # of the differences, of scaled parameters
FACTORS = (0.01, 100.0)  # of what an array of numbers is scaled by
DELAYS = (0.0, 0.5)  # of a sensor [s]
PRIOR = 0.1  # by which a weight of a table is held at zero, over its size and the noise
LOST = 1e3  # stands for an error of a lane that cannot go on, over the spread of its field
BEYOND = 2.0  # of its duration, behind which an end is said to be beyond a record
LOOSE = 1.0  # half an interval of this share of a parameter says little about it
LEAST = 1e-6  # share of a field's spread below which its error is rounding
SAME_CLOCK = 1e-3  # share of a period by which a clock may be off


class FieldError(NamedTuple):
    """Errors of a field of the observation [unit], on samples that the fit was shown or on the others."""

    field: str
    unit: str
    shown: bool
    samples: int
    rms: float
    largest: float


@dataclass(frozen=True)
class SimulationFit(Answer):
    """A simulation fitted to a record; see `Simulation.fit`.

    Attributes:
        estimates: parameters with their 95 % intervals [SI], by the names by which they were freed.
        simulation: a `Simulation` with the fitted parameters.
        errors: of every field that was compared.
        correlation: of the parameters (p, p).
        converged: whether the search came to its end.
        message: of the solver.
        evaluations: runs of the record.
        cautions: what the record cannot tell, and what ended at a bound.
    """

    estimates: Mapping[str, Estimate]
    simulation: Any
    errors: tuple[FieldError, ...]
    correlation: np.ndarray
    converged: bool
    message: str
    evaluations: int
    cautions: tuple[Caution, ...] = ()

    __repr__ = brief

    def rms(self, field: str, *, shown: bool = True) -> float:
        """Root mean square error of a field [SI], on samples that the fit was shown or on the others; NaN of none."""
        known = [error.field for error in self.errors]
        if field not in known:
            raise InputError("field", field, known=known)
        return next((e.rms for e in self.errors if e.field == field and e.shown == shown), math.nan)

    def predict(
        self, record: Recording, *, channels: Mapping[str, str] | None = None, settle: Amount | None = None
    ) -> Any:
        """What the fitted simulation shows under the commands of a record: an observation of arrays (n,).

        Args:
            record: whose commands are carried out.
            channels: see `Simulation.fit`.
            settle: see `Simulation.fit`.

        Raises:
            InputError: see `Simulation.fit`.
            ConvergenceError: the simulation cannot go through the record.
        """
        run = RecordedDrive.of(self.simulation, record, channels, settle, None)
        seen = run.predict(self.simulation, {}, len(record.time), 1)[:, :, 0]
        if not np.isfinite(seen).all():
            raise ConvergenceError("The simulation cannot go through this record.")
        sensors = {name: e.value for name, e in self.estimates.items()}
        fields = self.simulation.programs.fields
        columns = [_sensed(seen[:, k], name, sensors, self.simulation.period) for k, name in enumerate(fields)]
        return self.simulation.Observation(record.time, *columns)

    def to_dict(self) -> dict[str, JsonValue]:
        """Parameters with their intervals, and errors, as plain values [SI]."""
        return {
            "parameters": {name: e._asdict() for name, e in self.estimates.items()},
            "errors": [e._asdict() for e in self.errors],
            "correlation": self.correlation.tolist(),
            "converged": self.converged,
            "message": self.message,
            "evaluations": self.evaluations,
        }

    def rows(self) -> list[dict[str, JsonValue]]:
        """A row for each parameter: name, value, ends of the interval, unit."""
        return [{"name": name, **e._asdict()} for name, e in self.estimates.items()]

    def tables(self) -> list[Table]:
        """Parameters with their intervals, and errors by field."""
        rows = [{**e._asdict(), "used": "fitted" if e.shown else "not shown"} for e in self.errors]
        columns = (Column("field"), Column("used", ""), Column("rms", own="unit"), Column("largest", own="unit"))
        notes = () if self.converged else (f"The search did not converge: {self.message}.",)
        return [estimates("Parameters", self.estimates), Table("Errors", columns, rows, notes)]


class RecordedDrive(NamedTuple):
    """Commands of a record, and where a run under them begins."""

    commands: np.ndarray  # (samples, commands) [SI]
    pressure: dict[str, Amount]  # at the start, of muscles whose pressure is known
    held: dict[str, float]  # commands before the first sample
    settle: int  # samples before it
    cautions: tuple[Caution, ...] = ()  # about the time of these

    @classmethod
    def of(
        cls,
        simulation: SteppedSimulation,
        record: Recording,
        channels: Mapping[str, str] | None,
        settle: Amount | None,
        shown: np.ndarray | None,
    ) -> RecordedDrive:
        """Read commands and start; of the sensors only a first sample that is shown counts."""
        time, period = record.time, simulation.period
        if len(time) < 2 or np.abs(np.diff(time) - period).max() > SAME_CLOCK * period:
            problem = (
                f"must be sampled every {with_unit(period, 's')}, as the simulation is: use record.uniform({period:g})"
            )
            raise InputError("record", None, problem)
        for name in channels or ():
            if name not in (known := (*simulation.commands, *simulation.programs.fields)):
                raise InputError("channels", name, known=known)
        found = {
            name: _channel(simulation, record, [f"{name}.command", name], channels, name)
            for name in simulation.commands
        }
        driven = {drive.command: drive.unit for drive in simulation.air.drives}
        if not any(found[name] is not None for name in driven):
            raise InputError(
                "record", None, f"has no command of {', '.join(sorted(driven))}; name its channels by channels=.."
            )
        pressure: dict[str, Amount] = {}
        commands = {name: record[channel] for name, channel in found.items() if channel is not None}
        for name, values in commands.items():
            if not np.isfinite(values).all():
                raise InputError("record", None, f"{found[name]} must be finite at every sample")
            if driven.get(name) == "Pa":  # small ones beside others are its sensor's zero, and no slips of a unit
                values = values[(values < 0.0) | (values == values.max())]
            simulation.check_held(name, values, values)
        first = shown is None or bool(shown[0])
        for muscle in simulation.units:
            field = next(name for name, output in simulation.plant.shown if output == f"{muscle}.pressure")
            sensor = _channel(simulation, record, _sensors(simulation, field), channels, field)
            asked = next((c for c, of in simulation.air.settles.items() if of == muscle and c in commands), None)
            if first and sensor is not None and math.isfinite(record[sensor][0]):
                pressure[muscle] = float(record[sensor][0])
            elif asked is not None:
                pressure[muscle] = float(commands[asked][0])
        held = simulation.start_commands(pressure or None)
        held |= {name: float(values[0]) for name, values in commands.items() if name not in driven}
        rows = np.stack([commands.get(name, np.full(len(time), held[name])) for name in simulation.commands], axis=1)
        if settle is None:  # what a simulation recorded from its reset on began there
            rest = 0.0 if record.meta.get("first_sample") == 0 and "timing" in record.meta else REST
        else:
            rest = in_si(settle, "s", "settle")
        if not 0.0 <= rest <= LONGEST_REST:
            raise InputError("settle", f"{rest:g} s", f"must be from 0 s to {LONGEST_REST:g} s")
        said = collect(None if settle is None else size_caution(settle, "s", name="settle", usual=USUAL_REST))
        warn(said, stacklevel=4)  # before the runs, which all go through it
        return cls(rows, pressure, held, round(rest / period), said)

    def predict(
        self, simulation: SteppedSimulation, changes: Mapping[str, np.ndarray], samples: int, lanes: int
    ) -> np.ndarray:
        """Observations (samples, fields, lanes) of lanes whose parameters differ; NaN from where one cannot go on."""
        batch = SimulationBatch(simulation, lanes, changes)
        batch.reset(pressure=self.pressure or None)
        kernel, fields = batch.kernel, len(simulation.programs.fields)
        seen, lost = np.empty((samples, fields, lanes)), np.zeros(lanes, bool)
        for place, name in enumerate(simulation.commands):
            kernel.set_command(place, self.held[name])
        for k in range(-self.settle, samples):
            if k >= 0:
                seen[k] = kernel.observation[:-BEHIND]
                seen[k][:, lost] = np.nan
                for place, value in enumerate(self.commands[k]):
                    kernel.set_command(place, value)
            if k < samples - 1:
                for lane in kernel.step_lanes():
                    lost[lane] = True
        return seen


def _sensors(simulation: SteppedSimulation, field: str) -> list[str]:
    """Names that a channel of a field may have: as measured, or true."""
    return [f"measured.{field}", field, described(dict(simulation.plant.shown)[field])[1]]


def _channel(
    simulation: SteppedSimulation, record: Recording, names: Sequence[str], channels: Mapping[str, str] | None, of: str
) -> str | None:
    """The channel of a command or a field: as it is stated, or the first of some names; None where there is none."""
    if channels is not None and of in channels:
        if channels[of] not in record.channels:
            raise InputError("channels", channels[of], known=list(record.channels))
        units = {drive.command: drive.unit for drive in simulation.drives}
        unit = units.get(of) or described(dict(simulation.plant.shown)[of])[0]
        has = record.unit(channels[of])
        if has not in ("", "1", unit):
            raise InputError(f"channel of {of}", channels[of], f"must be one in {unit}, as {of} is, not in {has}")
        return channels[of]
    return next((name for name in names if name in record.channels), None)


def _sensed(values: np.ndarray, field: str, sensors: Mapping[str, float], period: float) -> np.ndarray:
    """A field as a sensor with a delay and a zero of its own shows it."""
    delay = sensors.get(f"{field}.delay", 0.0)
    if delay:
        at = np.arange(len(values)) * 1.0
        values = np.interp(at - delay / period, at, values)
    return values + sensors.get(f"{field}.offset", 0.0)


def _samples_of(train: Train, time: np.ndarray) -> np.ndarray:
    """Which samples are shown (n,), bool."""
    mask = np.zeros(len(time), bool)
    if train is None:
        mask[:] = True
    elif isinstance(train, slice):
        mask[train] = True
    elif isinstance(train, tuple) and len(train) == 2:
        begin, end = (in_si(one, "s", "train") for one in train)
        mask = (time - time[0] >= begin) & (time - time[0] < end)
    elif np.shape(train) == mask.shape and np.asarray(train).dtype == bool:
        mask = np.asarray(train).copy()
    else:
        problem = f"must be a slice, a pair of times or {len(time)} truth values, one for each sample"
        raise InputError("train", None, problem)
    if mask.sum() < 2:
        raise InputError("train", None, "must show two samples or more")
    return mask


def _beyond(train: Train, time: np.ndarray) -> tuple[Caution, ...]:
    """What is said of times that end long after the record."""
    lasts = float(time[-1] - time[0])
    if not isinstance(train, tuple) or in_si(train[1], "s", "train") <= BEYOND * lasts:
        return ()
    end = train[1] if isinstance(train[1], str) else f"{float(train[1]):g} s"
    meant = likely_unit(end, "s", ("ms", "us"), 0.01 * lasts, BEYOND * lasts, lasts)
    return (
        Caution(f"train ends at {end}, and the record at {with_unit(lasts, 's')}: all of it is shown{meant}", "train"),
    )


def find_parameters(machine: Machine, name: str, argument: str, others: Sequence[str] = ()) -> list[str]:
    """Where a parameter is in a machine: its path, the end of one, or a pattern with ``*`` for many.

    Args:
        machine: that has it.
        name: as it was given.
        argument: that a complaint names.
        others: further names that would do.

    Raises:
        InputError: there is none, or more than one without a pattern; names those that there are.
    """
    known = [p for p, _ in paths.parameters(machine)]
    if "*" in name:
        found = [p for p in known if fnmatchcase(p, name) or fnmatchcase(p, f"*.{name}")]
    else:
        found = [p for p in known if p == name] or [p for p in known if p.endswith(f".{name}")]
        if len(found) > 1:
            raise InputError(argument, name, f"is one of {', '.join(found)}: name one, or all by a pattern with *")
    if not found:
        raise InputError(argument, name, known=[*known, *others])
    return found


class _Unknowns:
    """Free parameters: their places in the machine, and how they are searched."""

    def __init__(self, simulation: SteppedSimulation, free: Free) -> None:
        self.simulation = simulation
        self.places: dict[str, list[str]] = {}
        self.parameters: dict[str, Parameter] = {}
        self.sensors: list[str] = []
        self.begins: dict[str, np.ndarray] = {}
        self.elements: dict[str, tuple[str, int]] = {}  # of tables of weights, which are searched one by one
        fields = simulation.programs.fields
        if not named_values(free, "free"):
            raise InputError("free", None, "must be at least one parameter")
        for name, stated in free.items():
            field, _, kind = name.rpartition(".")
            if field in fields and kind in ("delay", "offset"):
                unit = "s" if kind == "delay" else described(dict(simulation.plant.shown)[field])[0]
                begin, bounds, size = 0.0, DELAYS if kind == "delay" else (-math.inf, math.inf), simulation.period
                search: Search = "share"
                if kind == "offset":
                    size = {"m": 1e-3, "Pa": 1e4, "rad": 1e-2}.get(unit, 1.0)
                self.sensors.append(name)
            else:
                self.places[name] = find_parameters(
                    simulation.machine, name, "free", [f"{f}.{k}" for f in fields for k in ("delay", "offset")]
                )
                declared = paths.declaration(simulation.machine, self.places[name][0])
                value = np.asarray(paths.get(simulation.machine, self.places[name][0]), float)
                many = {p: np.asarray(paths.get(simulation.machine, p), float) for p in self.places[name]}
                if value.ndim > 0 and min(declared.bounds) < 0.0:
                    self._free_elements(self.places.pop(name), many, declared, stated)
                    continue
                # numbers that differ are scaled together
                scaled = value.ndim > 0 or any(one.ndim or one != value for one in many.values())
                self.begins |= many if scaled else {}
                begin, bounds, unit = (1.0, FACTORS, "1") if scaled else (float(value), declared.bounds, declared.unit)
                size = abs(begin) or max(abs(t) for t in declared.typical)
                search = "log" if begin > 0.0 and bounds[0] >= 0.0 else "share"
                if search == "log":
                    bounds = (max(bounds[0], 1e-3 * begin), min(bounds[1], 1e3 * begin))
            if stated is not None:
                if not (isinstance(stated, tuple | list) and len(stated) == 2):
                    raise InputError("free", name, "must be None or a pair, the least and the largest value")
                bounds = tuple(in_si(one, unit, name) for one in stated)  # type: ignore[assignment]
                search = search if bounds[0] > 0.0 else "share"
            if not bounds[0] < bounds[1]:
                ends = " and ".join(with_unit(end, unit) for end in bounds)
                raise InputError(f"free {name}", ends, "must be a least value and then a larger one")
            self.parameters[name] = Parameter(min(max(begin, bounds[0]), bounds[1]), *bounds, unit, size, search)

    def _free_elements(
        self, places: list[str], many: dict[str, np.ndarray], declared: Quantity, stated: tuple[Amount, Amount] | None
    ) -> None:
        """Free each number of tables of weights, which may have either sign and begin at zero: no share scales them."""
        size = max(abs(end) for end in declared.typical)
        ends = declared.bounds if stated is None else tuple(in_si(one, declared.unit, "free") for one in stated)
        for path in places:
            self.begins[path] = many[path]
            for k, index in enumerate(np.ndindex(many[path].shape)):
                name = f"{path}[{','.join(map(str, index))}]"
                self.elements[name] = path, k
                begin = float(many[path][index])
                self.parameters[name] = Parameter(begin, float(ends[0]), float(ends[1]), declared.unit, size, "share")

    @property
    def held(self) -> np.ndarray:
        """Rows of the prior, of scaled parameters (k, p): each weight of a table is held at zero, nothing else is.

        A potential between the places where a record was tells nothing of its own; ten sizes are its prior's deviation.
        """
        return PRIOR * np.eye(len(self.parameters))[[name in self.elements for name in self.parameters]]

    def changes(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Parameters of the machine, with an axis of lanes behind, from values (p, lanes) [unit]."""
        changes: dict[str, np.ndarray] = {}
        for (path, k), row in zip(
            self.elements.values(),
            (r for n, r in zip(self.parameters, values, strict=True) if n in self.elements),
            strict=True,
        ):
            table = changes.setdefault(path, np.empty((*self.begins[path].shape, values.shape[1])))
            table.reshape(-1, values.shape[1])[k] = row
        for name, row in zip(self.parameters, values, strict=True):
            for path in self.places.get(name, ()):
                changes[path] = self.begins[path][..., None] * row if path in self.begins else row
        return changes

    def values(self, x: np.ndarray) -> np.ndarray:
        """Values [unit] of scaled parameters (p, lanes)."""
        return np.array([p.value(row) for p, row in zip(self.parameters.values(), x, strict=True)])


class _Comparison:
    """What is compared: errors of a simulation beside the samples that are shown, and their derivatives."""

    def __init__(
        self,
        unknowns: _Unknowns,
        drive: RecordedDrive,
        record: Recording,
        sensors: Mapping[str, str],
        shown: np.ndarray,
    ):
        self.unknowns, self.drive, self.simulation, self.runs = unknowns, drive, unknowns.simulation, 0
        # nothing behind the last sample that is shown is computed, or read
        self.last = int(np.flatnonzero(shown)[-1]) + 1
        self.target = {name: record[channel][: self.last] for name, channel in sensors.items()}
        self.used = {name: shown[: self.last] & np.isfinite(values) for name, values in self.target.items()}
        for name, mask in self.used.items():
            if mask.sum() < 2:
                raise InputError(
                    "record", None, f"{sensors[name]} has no two finite samples among those that are shown"
                )
        self.spread = {name: float(np.std(v[self.used[name]])) or 1.0 for name, v in self.target.items()}
        self.weights = dict(self.spread)
        self.progress: Callable[[str], None] | None = None
        self.errors = functools.lru_cache(maxsize=4)(self._errors)

    def _errors(self, key: bytes) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Errors by field [SI] (n,), and their derivatives by the scaled parameters (n, p), at parameters as bytes."""
        self.runs += 1
        unknowns, x = self.unknowns, np.frombuffer(key)
        p, (low, high) = len(x), bounds_of(unknowns.parameters)
        ends = np.clip(x[:, None] + STEP, None, high[:, None]), np.clip(x[:, None] - STEP, low[:, None], None)
        at = np.repeat(x[:, None], 2 * p + 1, axis=1)
        for side, values in enumerate(ends):
            at[np.arange(p), 1 + side * p + np.arange(p)] = values[:, 0]
        values = unknowns.values(at)
        seen = self.drive.predict(self.simulation, unknowns.changes(values), self.last, 2 * p + 1)
        off, slopes = {}, {}
        for name, used in self.used.items():
            rows = seen[:, self.simulation.programs.fields.index(name)]
            if any(sensor.startswith(f"{name}.") for sensor in unknowns.sensors):
                lanes = [dict(zip(unknowns.parameters, lane, strict=True)) for lane in values.T.tolist()]
                sensed = (_sensed(r, name, s, self.simulation.period) for r, s in zip(rows.T, lanes, strict=True))
                rows = np.stack([*sensed], axis=1)
            rows = rows[used]
            off[name] = np.nan_to_num(rows[:, 0] - self.target[name][used], nan=LOST * self.spread[name])
            slopes[name] = np.nan_to_num((rows[:, 1 : p + 1] - rows[:, p + 1 :]) / (ends[0] - ends[1])[:, 0])
        if self.progress is not None:
            self.progress(f"run {self.runs}: " + ", ".join(f"{n} {_rms(v):.4g}" for n, v in off.items()))
        return off, slopes

    def weighted(self, x: np.ndarray, which: int) -> np.ndarray:
        """Errors over their sizes, or their derivatives, of all fields one after the other, and those of the prior."""
        rows, held = self.errors(x.tobytes())[which], self.unknowns.held
        return np.concatenate([*(v / self.weights[name] for name, v in rows.items()), (held @ x, held)[which]])

    def weigh(self, x: np.ndarray) -> None:
        """Let the size of each field be its error at scaled parameters: the best that is known of its noise."""
        off, _ = self.errors(x.tobytes())
        self.weights |= {name: max(_rms(v), LEAST * self.spread[name]) for name, v in off.items()}

    def search(self, evaluations: int) -> Descent:
        """The least squares of all fields, each by the error that it is left with at the end.

        A prior holds by the noise, so that a search of weights begins with the error that the simulation has without them.
        """
        parameters = self.unknowns.parameters
        start = np.array([q.scaled(q.start) for q in parameters.values()])
        options = {"max_nfev": evaluations, "xtol": 1e-6, "ftol": 1e-6, "gtol": 1e-12}
        residual, jacobian = (functools.partial(self.weighted, which=k) for k in range(2))
        estimation = Estimation(parameters, residual, jacobian, margin=2.0 * STEP, options=options)
        if _rms(residual(start)) >= LOST:
            raise ConvergenceError("The simulation cannot go through the record with its parameters as they are.")
        if self.unknowns.elements:
            self.weigh(start)
        best = estimation.search([start])
        if len(self.target) > 1 or self.unknowns.elements:
            self.weigh(best.x)  # so that intervals are those of the noise of each field
            best = estimation.search([best.x])._replace(start=start)
        return best


def fit(
    simulation: SteppedSimulation,
    record: Recording,
    free: Free,
    *,
    train: Train,
    measured: Sequence[str] | None,
    channels: Mapping[str, str] | None,
    settle: Amount | None,
    evaluations: int,
    progress: Callable[[str], None] | None,
) -> SimulationFit:
    """Fit a simulation to a record; see `Simulation.fit`."""
    if not isinstance(record, Recording):
        raise InputError("record", type(record).__name__, "must be a Recording, as mk.load or sim.recording() gives it")
    evaluations = whole_number(evaluations, "evaluations", least=1)
    unknowns, shown = _Unknowns(simulation, free), _samples_of(train, record.time)
    sensors, parameters = sensor_channels(simulation, record, measured, channels), unknowns.parameters
    drive = RecordedDrive.of(simulation, record, channels, settle, shown)
    comparison = _Comparison(unknowns, drive, record, sensors, shown)
    comparison.progress = progress
    best = comparison.search(evaluations)
    off, _ = comparison.errors(best.x.tobytes())
    known = conclude(
        parameters,
        best,
        comparison.weighted(best.x, 1),
        comparison.weighted(best.x, 0),
        subject="the record",
        series=[values / comparison.weights[name] for name, values in off.items()],
        within=True,
    )
    said = [*drive.cautions, *_beyond(train, record.time), *(Caution(warning) for warning in known.warnings)]
    said += [Caution(f"{name} ended at a bound", name) for name in at_bounds(parameters, best.x)]
    for (name, q), half in zip(parameters.items(), known.half, strict=True):
        if half > LOOSE and q.search == "log":
            said.append(Caution(f"the record hardly determines {name}", name))
    if not best.converged:
        said.append(Caution(f"the search did not converge: {best.message}"))
    values = unknowns.values(best.x[:, None])
    fitted = simulation.with_arrays({path: row[..., 0] for path, row in unknowns.changes(values).items()})
    whole = drive.predict(fitted, {}, len(record.time), 1)[:, :, 0]
    errors = []
    for name, channel in sensors.items():
        seen = whole[:, simulation.programs.fields.index(name)]
        lag = dict(zip(parameters, values[:, 0].tolist(), strict=True))
        error = _sensed(seen, name, lag, simulation.period) - record[channel]
        unit = described(dict(simulation.plant.shown)[name])[0]
        for which in (True, False):
            some = error[(shown == which) & np.isfinite(record[channel])]
            if which:
                said += map(Caution, misfit(name, record[channel][shown & np.isfinite(record[channel])], some))
            if some.size:
                errors.append(FieldError(name, unit, which, some.size, _rms(some), float(np.abs(some).max())))
    rest = known.correlation, best.converged, best.message, comparison.runs, collect(*said)
    return SimulationFit(known.parameters, fitted, tuple(errors), *rest)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def sensor_channels(
    simulation: SteppedSimulation, record: Recording, measured: Sequence[str] | None, channels: Mapping[str, str] | None
) -> dict[str, str]:
    """The channel of each field that is compared: of those asked for, else all that were measured, else all there are."""
    fields = simulation.programs.fields
    if isinstance(measured, str) or (measured is not None and not measured):
        problem = f"must be names of one field or more of {', '.join(fields)}, such as ('{fields[0]}',)"
        raise InputError("measured", repr(measured), problem)
    for name in measured or ():
        if name not in fields:
            raise InputError("measured", name, known=fields)
    found = {
        name: _channel(simulation, record, _sensors(simulation, name), channels, name) for name in measured or fields
    }
    there = {name: channel for name, channel in found.items() if channel is not None}
    for name in measured or ():
        if name not in there:
            raise InputError("measured", name, f"has no channel in the record; it has {', '.join(record.channels)}")
    if not there:
        raise InputError("record", None, f"has no channel of {', '.join(fields)}; name its channels by channels=..")
    if measured is None:
        stated = {
            n: c for n, c in there.items() if c.startswith("measured.") or (channels is not None and n in channels)
        }
        there = stated or there
    return there
