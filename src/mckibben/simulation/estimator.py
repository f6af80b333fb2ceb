"""What no sensor shows, from those that there are: an ensemble Kalman filter over lanes of a simulation.

    x_i -> f(x_i, u, w_i),   K = cov(x, h)/(var(h) + R),   mean: x -> x + K (y - h),   spread: x' -> x' - K/(1 + r) h'

with r = sqrt(R/(var(h) + R)), sensor by sensor. Each lane is the whole simulation with a load and a muscle of its own. An
unknown load walks about zero; the muscles differ as the specimen says that muscles of the make do, so that the interval of a
length knows what is not known of the muscle, and the record goes on to tell them apart. What carries information from the
pressure to the rest is the spread of the lanes: nothing is linearised, neither friction nor flow that chokes. The state of a
lane is all that goes from sample to sample, its load and its muscle too. Range: loads of the stated size; while the muscle
hangs slack its pressure says nothing of the load; a leak or a muscle that no lane has is not found.
Sources: G. Evensen, Ocean Dynamics 53, 2003, doi:10.1007/s10236-003-0036-9; the spread without drawn noise: J. S. Whitaker
and T. M. Hamill, Monthly Weather Review 130, 2002.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..answers import Caution, brief, collect, warn
from ..assembly.linearise import state_names
from ..components import paths
from ..errors import ConvergenceError, InputError
from ..estimation import NORMAL_QUANTILE, Estimate
from ..muscles.evidence import make_spread
from ..muscles.plausible import LEAST_GAUGE
from ..quantities import declared, parse, random_generator, usual_units, with_unit
from ..recordings import Channel, Recording
from ..slips import MORE_UNITS, likely_unit, noise_caution, size_caution
from .batch import SimulationBatch
from .fit import RecordedDrive, find_parameters, sensor_channels
from .kernel import SteppedSimulation
from .mechanisms import Amount, StartPressure, in_si, published
from .recorded import described
from .stepping import BEHIND, unnamed_command

LANES = 128
LOADS = ("N", "N*m")  # units of the commands that are loads
# Noise of sensors where none is stated [SI].
SENSORS = {"Pa": 600.0, "m": 1e-5, "N": 0.5, "rad": 1e-3, "m/s": 1e-2, "rad/s": 1e-2}
LOAD = 0.1  # standard deviation of an unknown load where none is stated, as a share of the tension at 5 bar
ARM = 0.02  # of a moment beside a tension [m]
MAKE = 0.1  # half width of the 95 % interval of muscles of a make where the specimen states none [1]
FULL = 5e5  # pressure at which a muscle is judged [Pa]
LASTS = 2.0  # time in which a load is forgotten: it walks, and returns [s]
BEGIN = 0.3  # share of its standard deviation that a load has at the start, where a larger one would have been seen
SETTLE = 0.5  # in which the lanes come to rest, each under its own load [s]
FLOW = 1e-3  # of a chamber's mass, by which the simulated flow is off in a second: it keeps the lanes apart [1]
DRIFT = 0.1  # of their spread, by which the lanes' muscles go on to differ in a second
LOADED = (1e-4, 10.0)  # sizes of an unknown load that are usual, as shares of the tension at 5 bar
# What a sensor shows is far from all lanes beyond so many deviations of what they show; read in another unit it is near
# within this factor.
FAR, NEAR = 30.0, 2.0
FEWEST = 8  # lanes of which a spread can be told


@dataclass(frozen=True)
class Estimated:
    """What an estimator knows at a sample.

    Attributes:
        mean: an observation of the most probable values [SI].
        low: lower ends of their 95 % intervals.
        high: upper ends.
        unknown: the unknown loads and parameters, each with its interval.
    """

    mean: Any
    low: Any
    high: Any
    unknown: dict[str, Estimate]

    __repr__ = brief


class Estimator:
    """An observer of a simulation's real counterpart; see `Simulation.estimator`.

        observer = sim.estimator(measured=("pressure",), unknown={"force": "25 N"})
        observer.reset(pressure=seen.pressure)
        known = observer.step(pressure=seen.pressure, muscle=0.2)       # what was measured after what was commanded
        print(known.mean.length, known.low.length, known.high.length)

    Attributes:
        lanes: how many.
        spread: relative standard deviations of the lanes' parameters, by path [1].
        noise: standard deviations of the sensors [SI].
        loads: standard deviations of the unknown loads [SI].
        cautions: what was assumed where nothing was stated.
    """

    def __init__(
        self,
        simulation: SteppedSimulation,
        measured: Sequence[str],
        unknown: Sequence[str] | Mapping[str, Amount],
        *,
        spread: Mapping[str, float | str] | None,
        noise: Mapping[str, Amount] | None,
        lanes: int,
    ) -> None:
        fields, said, slips = simulation.programs.fields, list[Caution](), list[Caution | None]()
        if isinstance(measured, str) or not measured:
            raise InputError("measured", str(measured), "must be names of fields, such as ('pressure',)")
        units = {name: described(output)[0] for name, output in simulation.plant.shown}
        for name in (*measured, *(noise or {})):
            if name not in fields:
                raise InputError("measured", name, known=fields)
        if not (isinstance(lanes, int) and lanes >= FEWEST):
            raise InputError("lanes", lanes, f"must be a whole number of {FEWEST} or more")
        self.simulation, self.measured, self.lanes = simulation, tuple(measured), lanes
        self.noise = {}
        for name in measured:
            stated = (noise or {}).get(name)
            own = 0.0 if simulation.noise is None else float(simulation.noise[fields.index(name)])
            self.noise[name] = own if stated is None else in_si(stated, units[name], f"noise of {name}")
            slips.append(None if stated is None else noise_caution(stated, units[name], of=name))
            if self.noise[name] < 0.0:
                raise InputError("noise", name, "must be a standard deviation above zero")
            if not self.noise[name] > 0.0:
                self.noise[name] = SENSORS.get(units[name], 1e-3)
                said.append(
                    Caution(
                        f"the noise of {name} is taken as {self.noise[name]:g} {units[name]}: state noise=..", "noise"
                    )
                )
        self._units = units | {drive.command: drive.unit for drive in simulation.drives}
        self.loads = self._loads(unknown, slips)
        self.spread = (
            self._muscles(said) if spread is None else {_number(simulation, p): _share(v, p) for p, v in spread.items()}
        )
        self.cautions = collect(*said, *slips)
        warn(collect(*slips), stacklevel=3)
        self._told: set[str] = set()
        self._base = np.repeat(simulation.parameters[:, None], lanes, axis=1)
        # rows of the parameters in what a kernel takes: those that a change of theirs moves
        self._rows, self._values = [], np.array([float(paths.get(simulation.machine, path)) for path in self.spread])
        for path, value in zip(self.spread, self._values, strict=True):
            other = simulation.with_arrays({path: np.asarray(1.001 * value)})
            self._rows.append(np.flatnonzero(other.parameters != simulation.parameters))
        limits = [paths.declaration(simulation.machine, path).bounds for path in self.spread]
        self._bounds = np.array(limits).reshape(-1, 2).T[:, :, None]
        self._measured_rows = [fields.index(name) for name in measured]
        self._places = [simulation.command_entries[name][0] for name in self.loads]
        self._walk = np.array([*self.loads.values()])[:, None] * math.sqrt(2.0 * simulation.period / LASTS)
        self._sigma = [*self.noise.values()]
        state = state_names(simulation.programs.layouts.carry.unpack(simulation.programs.examples[1])[0])
        self._chamber_rows = {
            kind: {name: state.index(f"circuit.{kind}.{name}") for name in simulation.machine.circuit.chambers}
            for kind in ("mass", "pressure")
        }
        self._ready = False

    def __repr__(self) -> str:
        known = ", ".join(self.measured)
        return (
            f"Estimator({self.lanes} lanes of {self.simulation!r}; measured: {known}; unknown: {', '.join(self.loads)})"
        )

    def _loads(self, unknown: Sequence[str] | Mapping[str, Amount], said: list[Caution | None]) -> dict[str, float]:
        """Standard deviation of each unknown load [SI]."""
        simulation = self.simulation
        drives = {d.command: d.unit for d in simulation.system.drives(simulation.units) if d.unit in LOADS}
        names = [unknown] if isinstance(unknown, str) else list(unknown)
        # the largest tension of a muscle where it is mounted, at a usual pressure [N]
        mounted = simulation.system.spans(simulation.units)
        strongest = max(float(unit.law.tension(mounted[name], FULL)) for name, unit in simulation.units.items())
        loads: dict[str, float] = {}
        for name in names:
            meant = [*drives] if name == "load" else [name]
            if name == "load" and not meant:
                raise InputError("unknown", name, f"{type(simulation.system).__name__} has none")
            for one in meant:
                if one not in drives:
                    raise InputError("unknown", one, known=["load", *drives])
                stated = unknown[name] if isinstance(unknown, Mapping) else None
                pull = strongest * (1.0 if drives[one] == "N" else ARM)
                loads[one] = LOAD * pull if stated is None else in_si(stated, drives[one], f"size of {one}")
                if not loads[one] > 0.0:
                    raise InputError("unknown", one, "must have a standard deviation above zero")
                ends = LOADED[0] * pull, LOADED[1] * pull
                said.append(size_caution(loads[one] if stated is None else stated, drives[one], name=one, usual=ends))
        return loads

    def _muscles(self, said: list[Caution]) -> dict[str, float]:
        """By how much the lanes' muscles differ, as their specimens say: in what the pull by the gas depends on most."""
        simulation, spread = self.simulation, {}
        for name, unit in simulation.units.items():
            known = make_spread(published(simulation.system.muscles[name]), unit.law)
            share = None if known is None else known.calibrated or known.elsewhere
            if share is None:
                share = MAKE
                words = f"no spread of muscles like {name} is known: {100.0 * MAKE:g} % of the tension (95 %) is taken"
                said.append(Caution(words, "spread"))
            span, law = simulation.system.spans(simulation.units)[name], unit.law
            pull, effects = float(law.active_tension(span, FULL)), {}
            for parameter, q in declared(law).items():
                value = getattr(law, parameter)
                if np.ndim(value) == 0 and value and q.unit != "rad":
                    more = law.replace(**{parameter: np.asarray(1.001 * float(value))})
                    effect = abs(float(more.active_tension(span, FULL)) / pull - 1.0) / 1e-3
                    effects[parameter] = effect * (
                        q.along == 0 or 1e-3
                    )  # of muscles cut to one length, if there is one
            parameter = max(effects, key=lambda one: effects[one])
            spread[f"units.{name}.law.{parameter}"] = share / NORMAL_QUANTILE / max(effects[parameter], 1.0)
        return spread

    def reset(self, seed: int = 0, *, pressure: StartPressure | None = None) -> Estimated:
        """Begin at rest, each lane with a muscle and a load of its own.

        Args:
            seed: seed of the lanes.
            pressure: gauge pressure at the start [Pa], of all muscles or by muscle.
        """
        self._random = random_generator(seed)
        draws = self._random.standard_normal((len(self.spread), self.lanes))
        self._shares = np.array([*self.spread.values()]).reshape(-1, 1)
        changes = {}
        for path, value, row, ends in zip(
            self.spread, self._values, self._shares * draws, self._bounds.swapaxes(0, 1), strict=True
        ):
            changes[path] = np.clip(value * np.exp(row), *ends)
        self._parameters = np.array([*changes.values()]).reshape(-1, self.lanes)
        batch = SimulationBatch(self.simulation, self.lanes, changes)
        batch.reset(seed, pressure=pressure)
        self._kernel, self._time = batch.kernel, 0.0
        first = BEGIN * np.array([[*self.loads.values()]]).reshape(-1, 1)
        self._load = first * self._random.standard_normal((len(self.loads), self.lanes))
        self._ready = True
        # the chambers keep their pressures meanwhile: where a valve leaks, nobody knows which command has held them
        begin = self._kernel.carry[:, : self.lanes].copy()
        warm = self._temperatures(begin)
        for _ in range(round(SETTLE / self.simulation.period)):
            self._advance({})
            self._hold(begin, {})
        self._hold(
            begin, {name: values / warm[name] for name, values in self._temperatures(self._kernel.carry).items()}
        )
        return self._estimated()

    def step(self, *unnamed: object, **values: Amount) -> Estimated:
        """Go on by one sample: what was commanded during it, and what was measured at its end.

        Args:
            *unnamed: none; all is given by name.
            **values: commands, of which one that is left out stays, and measured fields, of which one may be missing or NaN
                [SI, or words with a unit].

        Raises:
            InputError: names what is neither, or a value that is no number of its unit or below vacuum.
            ConvergenceError: no lane can go on.
        """
        if unnamed:
            raise unnamed_command(unnamed, (*self.simulation.commands, *self.measured))
        if not self._ready:
            self.reset()
        commands = {name: value for name, value in values.items() if name not in self.measured}
        for name in commands:
            if name not in self.simulation.command_entries or name in self.loads:
                given = [n for n in self.simulation.commands if n not in self.loads]
                raise InputError("step", name, known=[*given, *self.measured])
        commanded = {name: in_si(value, self._units[name], name) for name, value in commands.items()}
        for name, number in commanded.items():
            _, low, high = self.simulation.command_entries[name]
            if not low <= number <= high:
                self.simulation.check_command(name, number)
        seen = {name: self._seen(name, values[name]) for name in self.measured if name in values}
        self._load *= math.exp(-self.simulation.period / LASTS)
        self._load += self._walk * self._random.standard_normal(self._load.shape)
        flow = FLOW * math.sqrt(self.simulation.period)
        for row in self._chamber_rows["mass"].values():
            self._kernel.carry[row, : self.lanes] *= 1.0 + flow * self._random.standard_normal(self.lanes)
        drift = self._shares * DRIFT * math.sqrt(self.simulation.period)
        self._parameters *= 1.0 + drift * self._random.standard_normal(self._parameters.shape)
        self._advance(commanded)
        self._time += self.simulation.period
        here = [k for k, name in enumerate(self.measured) if math.isfinite(seen.get(name, math.nan))]
        if here:
            self._correct({k: seen[self.measured[k]] for k in here})
        return self._estimated()

    def over(self, record: Recording, *, channels: Mapping[str, str] | None = None, seed: int = 0) -> Recording:
        """The recording with what its sensors say of the rest: ``estimated.length`` beside ``measured.length``, and so on.

        Each field and unknown load has its mean and the ends of its 95 % interval, ``.low`` and ``.high``; a command that is
        not in the recording keeps its value at the start. What is not among `measured` is not read.

        Args:
            record: commands and sensors, sampled as the simulation is.
            channels: names of channels by command or field, where they have others.
            seed: seed of the lanes.

        Raises:
            InputError: it has other samples, or no channel of a command or of a measured field.
            ConvergenceError: no lane can go on.
        """
        simulation = self.simulation
        sensors = sensor_channels(simulation, record, self.measured, channels)
        loads = {name for load in self.loads for name in (f"{load}.command", load)}  # which would be known then
        shown = record.pick([name for name in record.channels if name not in loads])
        drive = RecordedDrive.of(simulation, shown, channels, None, None)
        given = {n: drive.commands[:, k] for k, n in enumerate(simulation.commands) if n not in self.loads}
        given |= {name: record[channel] for name, channel in sensors.items()}
        rows = [self.reset(seed, pressure=drive.pressure or None)]
        for k in range(1, len(record)):  # a command holds from its sample on
            rows.append(self.step(**{n: float(v[k if n in sensors else k - 1]) for n, v in given.items()}))
        found = {}
        for which, words in (("mean", ""), ("low", ", low end of 95 %"), ("high", ", high end of 95 %")):
            end = f".{which}" * (which != "mean")
            for name, output in simulation.plant.shown:
                unit, _, meaning = described(output)
                values = np.array([getattr(getattr(row, which), name) for row in rows])
                found[f"estimated.{name}{end}"] = Channel(values, unit, "estimated", f"{meaning}, estimated{words}")
            for name in self.loads:
                place = ("mean", "low", "high").index(which)
                values = np.array([row.unknown[name][place] for row in rows])
                said = f"unknown {name}, estimated{words}"
                found[f"estimated.{name}{end}"] = Channel(values, rows[0].unknown[name].unit, "estimated", said)
        told = {
            "measured": sensors,
            "unknown": self.loads,
            "spread": self.spread,
            "noise": self.noise,
            "lanes": self.lanes,
        }
        warnings = [*record.meta.get("warnings", ()), *map(str, self.cautions)]
        return record.with_channels(found).with_meta(estimator=told | {"seed": seed}, warnings=warnings)

    def _seen(self, name: str, value: Amount) -> float:
        """What a sensor showed [SI]; NaN where it showed nothing."""
        if isinstance(value, float) and math.isnan(value):
            return math.nan
        number = in_si(value, self._units[name], name)
        if self._units[name] == "Pa" and number < LEAST_GAUGE:
            raise InputError(
                name, with_unit(number, "Pa"), "must be a gauge pressure above vacuum, or NaN where missing"
            )
        return number

    def _advance(self, commands: Mapping[str, float]) -> None:
        kernel = self._kernel
        for name, value in commands.items():
            kernel.set_command(self.simulation.command_entries[name][0], value)
        for place, row in zip(self._places, self._load, strict=True):
            kernel.set_command(place, row)
        broken = sorted(kernel.step_lanes())
        if len(broken) == self.lanes:
            raise ConvergenceError("No lane of the estimator can go on: what is measured is far from all that they do.")
        if broken:  # lanes that cannot go on begin again as others
            sound = np.setdiff1d(np.arange(self.lanes), broken)
            others = self._random.choice(sound, len(broken))
            for array in (self._load, self._parameters, kernel.carry, kernel.observation):
                array[:, broken] = array[:, others]
            self._put_parameters()

    def _temperatures(self, carry: np.ndarray) -> dict[str, np.ndarray]:
        """Temperature of every chamber in all lanes (lanes,) [K]."""
        simulation = self.simulation
        outputs = simulation.programs.outputs(self._kernel.plant, carry[:, : self.lanes])
        return {name: outputs[f"{name}.temperature"] for name in simulation.machine.circuit.chambers}

    def _hold(self, begin: np.ndarray, warmer: Mapping[str, np.ndarray]) -> None:
        """Put all chambers to the pressures of a carry, at the temperature that they have, less what is too much."""
        for name, row in self._chamber_rows["pressure"].items():
            pressures = self._kernel.carry[row, : self.lanes]
            masses = self._kernel.carry[self._chamber_rows["mass"][name]]
            masses[: self.lanes] *= begin[row] / pressures * warmer.get(name, 1.0)
            pressures[:] = begin[row]

    def _slipped(self, name: str, value: float, shown: float) -> None:
        """Say once of a sensor that what it showed is what the lanes show in another unit [SI]."""
        unit, near = self._units[name], abs(shown)
        units = (*usual_units(unit)[1:], *MORE_UNITS.get(unit, ()))
        meant = likely_unit(f"{value:g}", unit, units, near / NEAR, near * NEAR, near) if near else ""
        if meant and name not in self._told:
            self._told.add(name)
            words = f"{name} of {value:g} {unit} is far from what the lanes show, {with_unit(shown, unit)}{meant}"
            said = Caution(f"a measured {words}", name)
            self.cautions = collect(*self.cautions, said)
            warn((said,), stacklevel=4)

    def _put_parameters(self) -> None:
        """Give the lanes their parameters, within the bounds with which these are declared."""
        np.clip(self._parameters, *self._bounds, out=self._parameters)
        for rows, values in zip(self._rows, self._parameters, strict=True):
            self._kernel.plant[rows, : self.lanes] = values

    def _correct(self, measured: Mapping[int, float]) -> None:
        """Move the mean to what was measured, and draw the lanes together by what that says of each of their numbers."""
        carry, seen = self._kernel.carry[:, : self.lanes], self._kernel.observation[:-BEHIND]
        for k, value in measured.items():
            shown, variance = seen[self._measured_rows[k]], self._sigma[k] ** 2
            mean = shown.mean()
            apart = shown - mean
            whole = apart @ apart / (self.lanes - 1) + variance
            if (value - mean) ** 2 > FAR**2 * whole:
                self._slipped(self.measured[k], value, mean)
            # each lane goes less far than the mean, so that their spread is what is left to know
            moves = (value - mean - apart / (1.0 + math.sqrt(variance / whole))) / whole
            gain = apart / (self.lanes - 1)
            for rows in (carry, seen, self._load, self._parameters):
                rows += ((rows - rows.mean(axis=1, keepdims=True)) @ gain)[:, None] * moves
        self._put_parameters()

    def _estimated(self) -> Estimated:
        seen = self._kernel.observation[:-BEHIND]
        mean, half = seen.mean(axis=1), NORMAL_QUANTILE * seen.std(axis=1, ddof=1)
        make = self.simulation.Observation
        unknown = {}
        for name, row in zip(self.loads, self._load, strict=True):
            unit = next(d.unit for d in self.simulation.drives if d.command == name)
            value, width = float(row.mean()), NORMAL_QUANTILE * float(row.std(ddof=1))
            unknown[name] = Estimate(value, value - width, value + width, unit)
        low, high = (make(self._time, *values.tolist()) for values in (mean - half, mean + half))
        return Estimated(make(self._time, *mean.tolist()), low, high, unknown)


def _number(simulation: SteppedSimulation, name: str) -> str:
    """The path of a parameter that is one number."""
    path, *more = find_parameters(simulation.machine, name, "spread")
    if more or np.ndim(paths.get(simulation.machine, path)):
        raise InputError("spread", name, "must be one parameter that is a number")
    return path


def _share(value: float | str, name: str) -> float:
    share = parse(value, "1", field=name) if isinstance(value, str) else float(value)
    if not 0.0 < share < 1.0:
        raise InputError("spread", name, "must be a share between 0 and 1, a standard deviation over the value")
    return share
