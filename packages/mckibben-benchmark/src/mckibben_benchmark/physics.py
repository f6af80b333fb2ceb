"""Models with physics: a tension law, friction with memory, creep, the seated braid with both, and the circuit of a robot.

A law is fitted to static points; friction and creep by the fits of `mckibben.identification` to paths and steps.

A muscle between fixed anchors still moves inside: as the tension rises its ends settle, by u, and its braid shortens. Bouc
and Wen's friction and Maxwell elements resist that motion,

    F = F_law(L, P') + f(z) + sum k_i e_i,      both driven by -du

The law of `SeatedBraidMemory` is fitted first, to all samples; then friction, with or without the elements, to what it
leaves, as the muscle that is held back among those to train on says. What friction does to the settling itself is of second
order and left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mckibben.errors import InputError
from mckibben.estimation import descend
from mckibben.identification.between import Between
from mckibben.identification.circuit_fit import fit_circuit, run_trial
from mckibben.identification.creep_fit import LAWS, CreepFit, fit_creep
from mckibben.identification.fit import Fit
from mckibben.identification.fit import fit as fit_law
from mckibben.identification.hysteresis_fit import AREA, SMOOTH, fit_loops
from mckibben.identification.path_record import PathRecord
from mckibben.identification.problem import SAME_LENGTH, Problem, solve
from mckibben.identification.shared_hysteresis import NAMES, BraidPath, ResistanceProblem, braid_path, resistance
from mckibben.identification.trial import Trial
from mckibben.muscles.build import build_law
from mckibben.muscles.law import TensionLaw
from mckibben.muscles.laws import law_type
from mckibben.quantities import declared, to_si
from mckibben.recordings import Channel, ForceMap, Recording

from .datasets import BenchmarkRecord
from .jumping_robot import MUSCLES, robot_plan, trial_of_recording
from .learned import held_back

RULER = 3e-4  # standard deviation of a length set to the half millimetre: 0.5 mm over the square root of three [m]


class LawModel:
    """A tension law with its own choice of free parameters.

    Args:
        law: its name, such as ``seated_braid`` or ``my.py:MyLaw``.
        free: parameters that are fitted; as the law says by default.
        length_error: standard deviation of the error of each set length [m], used where muscles of several rest lengths are
            to train on; by default `RULER` for a law with priors, none for others.
    """

    def __init__(self, law: str, *, free: tuple[str, ...] | None = None, length_error: float | None = None) -> None:
        default = RULER if law_type(law).priors else 0.0
        self.free = free
        self.law, self.length_error = law, default if length_error is None else length_error

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit the free parameters, by a search from many starts.

        Raises:
            InputError: the records are not of tension over length and pressure, or too few.
            ConvergenceError: no fit converged.
        """
        train = thinned(train)
        self.points = joined(train)
        shared = dict(train[0].dimensions)
        for record in train[1:]:
            shared = {k: v for k, v in shared.items() if record.dimensions.get(k) == v}
        self.known = {k: v for k, v in shared.items() if k != "rest_length"}
        rest = self.points.rest_length
        errors = self.length_error if rest is not None and np.ptp(rest) > SAME_LENGTH else 0.0
        problem = Problem.of(self.law, self.points, known=self.known, free=self.free, length_error=errors)
        self.values = solve(problem).values(problem)

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Tension at the lengths and pressures of a record; the law knows no time."""
        length, pressure = record.inputs["length"], record.inputs["pressure"]
        return {"tension": np.asarray(self.law_for(record).tension(length, pressure))}

    def law_for(self, record: BenchmarkRecord) -> TensionLaw:
        """The fitted law with the dimensions of the muscle of a record."""
        length = record.inputs["length"]
        fields = declared(law_type(self.law))
        known: dict[str, float] = {k: v for k, v in record.dimensions.items() if k in fields and k not in self.values}
        if "upper_length" in fields:
            seen = self.points.length if self.points.rest_length is None else length
            known["upper_length"] = float(max(np.max(length), np.max(seen)))
        return build_law(self.law, known | self.values)


class ReadMuscle:
    """The law of muscles of several rest lengths, with the tension of one more conditioned by readings of it.

    The records to train on that are of the muscle to predict are its readings; see `identification.between`.
    """

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Keep the records: which are readings is known when a muscle is asked for.

        Raises:
            InputError: the records are not of static tension.
        """
        if not all(record.is_static for record in train):
            raise InputError("task", None, "must be of static points: readings are taken at rest")
        joined(train)
        self.train = train
        self.fits: dict[str, Fit] = {}

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Tension of the muscle of a record by the law of the others, and by its readings.

        Raises:
            InputError: the others are not of two or more rest lengths, or there are more than three readings.
        """
        length, pressure = record.inputs["length"], record.inputs["pressure"]
        fitted = self._of_others(record.muscle)
        own = {k: v for k, v in record.dimensions.items() if k in declared(law_type(fitted.law))}
        reach = max(float(np.max(length)), own["rest_length"])
        new = fitted.one_more(elsewhere=False, **(own | {"upper_length": reach}))
        read = [r for r in self.train if r.muscle == record.muscle]
        if read:
            points = joined(read)
            new = new.conditioned(list(zip(points.length, points.pressure, points.tension, strict=True)))
        return {"tension": new.predict(length, pressure)[0]}

    def _of_others(self, muscle: str) -> Fit:
        if muscle not in self.fits:
            others = [r for r in self.train if r.muscle != muscle]
            if len({r.dimensions.get("rest_length") for r in others}) < 2:
                raise InputError(
                    "task", None, "must have muscles of two or more rest lengths beside the one to predict"
                )
            known = {k: v for k, v in others[0].dimensions.items() if k != "rest_length"}
            self.fits[muscle] = fit_law(
                "seated_braid", joined(others), known=known, schemes=(), slack=False, between=Between()
            )
        return self.fits[muscle]


# What Kang's static part frees of the law of Tondu and Lopez, whose factor at high pressure it has at one.
KANG = ("rest_radius", "rest_angle", "end_factor_gain", "end_factor_pressure")
PATH = ("rest_length", "rest_angle", "gain", "rate", "load", "friction")  # of a path [m, rad, 1, 1/Pa, Pa, Pa]
PATH_STARTS = ((0.25, 0.4, 0.5, 1e-5, 1e5, 1e4), (0.25, 0.6, 2.0, 3e-6, 3e5, 3e3), (0.1, 0.5, -0.3, 1e-5, 2e5, 1e4))
PATH_BOUNDS = ((0.01, 0.05, -0.95, 1e-7, 0.0, 0.0), (3.0, 1.2, 50.0, 1e-3, 2e6, 1e6))


class KangModel:
    """Kang's muscle, as the repository jonreal/pneu-sim states it: Tondu and Lopez with a factor of its own, and friction.

        F = A0 p [3 (1 - q e)^2/tan^2 a - 1/sin^2 a] - c_c sgn(de/dt),      q = 1 + c_1 exp(-p/p_1)

    At a load F the contraction follows in closed form, between an end for each direction of the friction. What is viscous
    in the model is left out: the paths here are slow. Below the load the muscle hangs at its rest length, where the model
    has no rubber that would hold it.
    """

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit the law to points of tension, or load, friction and braid to the shown samples of a path of stroke.

        Raises:
            InputError: the records are neither.
        """
        record, *others = train
        if "stroke" not in record.outputs or others:
            self.law = LawModel("tondu_lopez", free=KANG)
            self.law.fit(train)
            return
        pressure, measured = record.inputs["pressure"], record.outputs["stroke"]
        if np.ptp(pressure) <= HELD:
            raise InputError("task", None, "must be of a path that turns: friction shows where the motion turns")
        shown = np.isfinite(measured)
        low, high = (np.array(ends) for ends in PATH_BOUNDS)
        size = np.abs(PATH_STARTS[0])

        def residual(scaled: np.ndarray) -> np.ndarray:
            off: np.ndarray = (self._path(scaled * size, record) - measured)[shown]
            return off

        ends = low / size, high / size
        found = [descend(residual, np.array(start) / size, bounds=ends) for start in PATH_STARTS]
        self.values = min(found, key=lambda one: one.cost).x * size

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Tension of points, or the stroke along the path that was shown in part."""
        if "stroke" in record.initial:
            return {"stroke": self._path(self.values, record)}
        return self.law.predict(record)

    @staticmethod
    def _path(values: np.ndarray, record: BenchmarkRecord) -> np.ndarray:
        rest, angle, gain, rate, load, friction = values
        pressure = np.maximum(record.inputs["pressure"], 1.0)
        factor = 1.0 + gain * np.exp(-rate * pressure)

        def held(force: float) -> np.ndarray:
            left = np.tan(angle) ** 2 / 3.0 * (1.0 / np.sin(angle) ** 2 + force / pressure)
            stroke: np.ndarray = np.maximum(rest * (1.0 - np.sqrt(left)) / factor, 0.0)
            return stroke

        least, most = held(load + friction), held(max(load - friction, 0.0))
        stroke, at = np.empty(len(pressure)), record.initial["stroke"]
        for i, ends in enumerate(zip(least, most, strict=True)):
            stroke[i] = at = min(max(at, ends[0]), ends[1])
        return stroke


MOST = 3000  # samples of records in time that a law is fitted to; more of them say the same


def thinned(train: Sequence[BenchmarkRecord], most: int = MOST) -> list[BenchmarkRecord]:
    """Static records as they are, and of records in time as many evenly spaced samples as sum up to `most`."""
    count = sum(len(record) for record in train if not record.is_static)
    step = -(-count // most)
    return [record if record.is_static else record.every(step) for record in train]


def joined(train: Sequence[BenchmarkRecord]) -> ForceMap:
    """The points of records as one force map.

    Raises:
        InputError: the records are not of tension over length and pressure.
    """
    for record in train:
        if "tension" not in record.outputs or not {"length", "pressure"} <= set(record.inputs):
            raise InputError("task", None, "must be of tension from length and pressure: a tension law knows no other")
    whole = np.concatenate([np.full(len(r), r.dimensions.get("rest_length", np.nan)) for r in train])
    return ForceMap(
        name="training data",
        length=np.concatenate([record.inputs["length"] for record in train]),
        pressure=np.concatenate([record.inputs["pressure"] for record in train]),
        tension=np.concatenate([record.outputs["tension"] for record in train]),
        rest_length=whole if np.isfinite(whole).all() else None,
    )


HELD = to_si(0.06, "bar", "Pa", field="pressure")  # of a pressure that is held, by a sensor of three digits
KNOTS = {"stroke": 9, "displacement": 5}  # of the curve; a pair moves by a tenth of a millimetre and is nearly linear
MOST_ON_PATH = 400  # samples of a path; a longer record is thinned, for quasi-static friction knows no time
DRIVES = {"stroke": "pressure", "displacement": "force"}  # what moves along the path, and what moves it


class FrictionModel:
    """A smooth monotone curve with Dahl's or Bouc and Wen's friction, with or without creep, as the shown samples say.

    For a pair of muscles the force takes the place of the pressure, and each pressure of the closed muscles follows the
    displacement by a straight line, as their volume does for small motions.
    """

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit curve and friction to the shown samples of one record.

        Raises:
            InputError: the record is not of one path of stroke and pressure, or of displacement and force.
            ConvergenceError: the fit ended where it began.
        """
        record, *others = train
        self.moved = next((name for name in DRIVES if name in record.outputs), "")
        if others or record.time is None or DRIVES.get(self.moved) not in record.inputs:
            raise InputError("task", None, "must be one path of stroke or displacement: this friction knows no other")
        if self.moved == "stroke" and np.ptp(record.inputs["pressure"]) <= HELD:
            raise InputError("task", None, "must be of a path that turns: friction shows where the motion turns")
        step = -(-len(record) // MOST_ON_PATH)
        path = record.every(step)
        measured = path.outputs[self.moved]
        shown = np.isfinite(measured)
        bridged = np.interp(np.arange(len(path)), np.flatnonzero(shown), measured[shown])  # only its range is read
        drive = path.inputs[DRIVES[self.moved]]
        self.fitted = fit_loops(
            PathRecord(drive if self.moved == "stroke" else drive / AREA, bridged, path.name, path.time),
            models=SMOOTH,
            train=shown,
            creeps=(0.0, float("nan")),
            known={"per_pressure": 0.0},
            knots=KNOTS[self.moved],
        )[0]
        self.lines = {
            name: np.polyfit(measured[shown], path.outputs[name][shown], 1)
            for name in record.outputs
            if name != self.moved
        }
        self.step = step

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """What moves along the path of the record that was shown in part, and what follows it."""
        return self.outputs(record, self.fitted.predicted)

    def outputs(self, record: BenchmarkRecord, path: np.ndarray) -> Mapping[str, np.ndarray]:
        """What moves along a record, of its values at the samples that the fit read, and what follows it."""
        at, every = np.arange(0, len(record), self.step), np.arange(len(record))
        moved = np.interp(every, at, path)
        return {self.moved: moved} | {name: np.polyval(line, moved) for name, line in self.lines.items()}


class FrictionDiscrepancy:
    """The curve with friction and creep of `FrictionModel`, and a discrepancy that is smooth along the path.

    Size and length of the discrepancy are found from the shown samples: see `identification.discrepancy`.
    """

    def __init__(self) -> None:
        self.friction = FrictionModel()

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit curve, friction and creep to the shown samples of one record, then the discrepancy.

        Raises:
            InputError: the record is not of one path of stroke and pressure, or of displacement and force.
            ConvergenceError: the fit ended where it began, or did not converge.
        """
        self.friction.fit(train)
        self.path = self.friction.fitted.with_discrepancy()

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """What moves along the path of the record that was shown in part, and what follows it."""
        return self.friction.outputs(record, self.path.predicted)


class CreepModel:
    """Kelvin-Voigt elements, free or alike; the shown samples choose by Akaike's criterion."""

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit to the shown samples of a step that is held.

        Raises:
            InputError: the record is not of stroke in time at a held pressure.
        """
        record, *others = train
        if others or record.time is None or "stroke" not in record.outputs:
            raise InputError("task", None, "must be the stroke after one step: creep knows no other")
        pressure, stroke = record.inputs["pressure"], record.outputs["stroke"]
        if np.ptp(pressure) > HELD:
            raise InputError("task", None, "must be of a held pressure: creep is what happens then")
        shown = np.isfinite(stroke)
        fits = [fit_creep(record.time, np.where(shown, stroke, 0.0), train=shown, law=law) for law in LAWS]
        self.fitted: CreepFit = min(fits, key=lambda fit: fit.aicc)

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Stroke at the times of the record."""
        if record.time is None:
            raise InputError("task", None, "must be the stroke after one step: creep knows no other")
        return {"stroke": self.fitted.predict(record.time)}


MOST_IN_TIME = 750  # samples of a record that friction is fitted to


class SeatedBraidMemory:
    """Law, friction with memory and creep, with the settling of the ends as the motion that both resist."""

    def __init__(self) -> None:
        self.static = LawModel("seated_braid")

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit the law, then friction and creep.

        Raises:
            InputError: the records are not of tension in time.
            ConvergenceError: the law could not be fitted.
        """
        if any(record.is_static for record in train):
            raise InputError("task", None, "must be of records in time: without time this is the law alone")
        self.static.fit(train)
        step = -(-max(len(record) for record in train) // MOST_IN_TIME)
        thin = [record.every(step) for record in train]
        held = [h[::step] for h in held_back(train)]
        paths = [self.path_of(record) for record in thin]
        left = [record.outputs["tension"] - path[0] for record, path in zip(thin, paths, strict=True)]
        taut = [record.outputs["tension"] > 0.0 for record in thin]
        errors, used = [], [t & ~h for t, h in zip(taut, held, strict=True)]
        for creeps in (False, True):
            values = fit_memory(paths, left, used, creeps)
            rest = np.concatenate(
                [(resistance(values, p) - r)[t & h] for p, r, t, h in zip(paths, left, taut, held, strict=True)]
            )
            errors.append(float(np.mean(rest**2)))
        self.creeps = errors[1] < errors[0]
        self.values = fit_memory(paths, left, taut, self.creeps)

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Tension over time from length and pressure, never a push."""
        path = self.path_of(record)
        return {"tension": np.maximum(path.tension + resistance(self.values, path), 0.0)}

    def path_of(self, record: BenchmarkRecord) -> BraidPath:
        """Path of the braid of a record, with the settling of its ends."""
        if record.time is None:
            raise InputError("task", None, "must be of records in time")
        law = self.static.law_for(record)
        return braid_path(law, record.inputs["length"], record.inputs["pressure"], record.time)


def fit_memory(
    paths: Sequence[BraidPath], left: Sequence[np.ndarray], used: Sequence[np.ndarray], creeps: bool
) -> np.ndarray:
    """Parameters by least squares of what the law leaves, without creep or with it."""
    return ResistanceProblem(paths, left, used).fit(NAMES if creeps else NAMES[:3])


EVALUATIONS = 40  # of each fit, as in the study


class RobotCircuit:
    """Tank, tubes, valves and muscles with volume and wall heat; the parameters that the circuit's file frees are fitted."""

    def __init__(self) -> None:
        self.plan = robot_plan()
        self.changes: dict[str, float] = {}

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit conductances, volumes, delays and heat to the pressures of all trials at once.

        Raises:
            InputError: the records are not of the robot.
            ConvergenceError: the circuit cannot be run.
        """
        trials = [self._trial(record) for record in train]
        self.changes = fit_circuit(trials, self.plan.fit.free, step=self.plan.step, evaluations=EVALUATIONS).changes

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Gauge pressures of tank and muscles [Pa], from those at the start, valve commands and angles."""
        outputs = run_trial(self._trial(record), self.changes, step=self.plan.step).outputs
        ambient = float(self.plan.environment.pressure_abs)
        return {name: np.asarray(outputs[f"{name}_abs"]) - ambient for name in record.initial}

    def _trial(self, record: BenchmarkRecord) -> Trial:
        needed = [f"{kind}_{muscle}" for kind in ("open", "angle") for muscle in MUSCLES]
        if record.time is None or not set(needed) <= set(record.inputs):
            raise InputError("task", None, "must be of the jumping robot: its circuit knows no other")
        count = len(record)
        # Where pressures are to be predicted, a trial still needs channels to compare: they hold their first value.
        pressures = {name: record.outputs.get(name, np.full(count, first)) for name, first in record.initial.items()}
        vented = np.median([first for name, first in record.initial.items() if name.startswith("muscle_")])
        channels = {name: Channel(values, "Pa", "measured") for name, values in pressures.items()}
        channels |= {name: Channel(record.inputs[name], "1", "measured") for name in needed}
        channels["room.pressure"] = Channel(np.full(count, vented), "Pa", "measured")
        return trial_of_recording(Recording(record.time, channels), self.plan, name=record.name)
