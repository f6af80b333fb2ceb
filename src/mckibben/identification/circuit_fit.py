"""Parameters of a circuit from records of its pressures, and how well they predict records that the fit did not see."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..analysis.frequency import time_lead
from ..answers import Column, Table, estimates
from ..components import paths
from ..documents import JsonValue
from ..engine import STEP, Run
from ..engine.rates import RK4_LIMIT
from ..errors import ConvergenceError, InputError
from ..estimation import AT_BOUND, Descent, Estimate, Estimation, Parameter, Search, bounds_of, conclude, widening
from ..quantities import Quantity, whole_number
from .record_posterior import RecordPosterior, RecordProblem, check_converged, posterior_of_records
from .sampler import HostModel
from .trial import Trial, expand

DELAY = Quantity("s", (0.0, 1.0), "delay of the signal", "", (1e-4, 2e-2))

EVALUATIONS = 60  # most of a fit, where nothing else is stated


@dataclass(frozen=True)
class CircuitProblem:
    """Least squares of a circuit's pressures: free parameters by name, and the dotted paths that each stands for."""

    trials: Sequence[Trial]
    paths: dict[str, tuple[str, ...]]
    parameters: dict[str, Parameter]
    models: tuple[Any, ...]

    @classmethod
    def of(
        cls, trials: Sequence[Trial], free: Sequence[str], start: Mapping[str, float], step: float
    ) -> CircuitProblem:
        """Set up from trials of one circuit, the free paths, first guesses [SI] and the step [s]; runs each trial once."""
        spread = expand(free, trials[0])
        for name in start:
            if name not in spread:
                raise InputError("start", name, f"it is not free; free are {', '.join(spread)}")
        parameters = {}
        for name, many in spread.items():
            signal = many[0].startswith("signals.")
            q = DELAY if signal else paths.declaration(trials[0].circuit, many[0])
            first = float(start.get(name, 1e-3 if signal else float(paths.get(trials[0].circuit, many[0]))))
            q.check(name, first)
            size = abs(first) or max(abs(t) for t in q.typical)
            search: Search = "log" if q.bounds[0] > 0.0 and first > 0.0 else "share"
            parameters[name] = Parameter(first, *q.bounds, q.unit, size, search)
        where = {p: parameters[n].start for n, many in spread.items() for p in many}
        models = []
        for trial in trials:
            run = trial.run(where, step=step)
            inner = max(1, int(np.ceil(trial.period / step - 1e-9)))
            # half of the limit is left for what the parameters will do on their way
            stiff = run.stiff or run.fastest * trial.period / inner > 0.5 * RK4_LIMIT
            models.append(trial.model(tuple(spread.values()), inner, stiff))
        return cls(trials, spread, parameters, tuple(models))

    @property
    def start(self) -> np.ndarray:
        """First guesses, scaled."""
        return np.array([p.scaled(p.start) for p in self.parameters.values()])

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Predictions minus measurements [SI], finite also where a run fails."""
        values = np.array([p.value(v) for p, v in zip(self.parameters.values(), x, strict=True)])
        off = [
            m.predict(values) - np.stack(list(t.measured.values()))
            for m, t in zip(self.models, self.trials, strict=True)
        ]
        # a run that fails may be finite and beyond what can be squared
        residuals: np.ndarray = np.clip(np.nan_to_num(np.concatenate([o.ravel() for o in off]), nan=1e9), -1e9, 1e9)
        return residuals

    def split(self, residual: np.ndarray) -> list[np.ndarray]:
        """The residual by trial and channel."""
        lengths = [t.samples + 1 for t in self.trials for _ in t.channels]
        return np.split(residual, np.cumsum(lengths)[:-1])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Derivative of the residual to the scaled parameters.

        By forward tangents; delays are differenced over half a sample, because the instant of a switch has no derivative.
        """
        values = np.array([p.value(v) for p, v in zip(self.parameters.values(), x, strict=True)])
        late = [n.endswith((".delay", ".dead_time")) for n in self.parameters]
        slopes = None if all(late) else np.concatenate([m.slopes(values).reshape(-1, len(values)) for m in self.models])
        width = 0.5 * min(t.period for t in self.trials)
        columns = []
        for i, p in enumerate(self.parameters.values()):
            if late[i] or slopes is None:
                low, high = (min(max(values[i] + side * width, p.low), p.high) for side in (-1, 1))
                ends = [self.residual(np.where(np.arange(len(x)) == i, p.scaled(v), x)) for v in (low, high)]
                column = (ends[1] - ends[0]) / (high - low)
            else:
                column = slopes[:, i]
            columns.append(column * (values[i] if p.search == "log" else p.size))
        jacobian: np.ndarray = np.nan_to_num(np.stack(columns, axis=1))
        return jacobian

    def solve(self, evaluations: int, progress: Callable[[str], None] | None) -> Descent:
        """Descend from the first guesses."""
        scale = max(float(np.sqrt(np.mean(self.residual(self.start) ** 2))), 1e-12)
        if scale > 1e8:
            raise ConvergenceError("The circuit cannot be run with the first guesses; give others.")
        count = itertools.count(1)

        def scaled(x: np.ndarray) -> np.ndarray:
            off = self.residual(x)
            if progress is not None:
                progress(f"evaluation {next(count)}, rms {np.sqrt(np.mean(off**2)):.4g}")
            return off / scale

        options = {"max_nfev": evaluations, "xtol": 1e-7, "ftol": 1e-9, "gtol": 1e-10}
        estimation = Estimation(self.parameters, scaled, lambda x: self.jacobian(x) / scale, options=options)
        return estimation.descend(self.start)


# Half an interval of this share of a parameter says little about it.
LOOSE = 1.0
HALVINGS = 4  # of the step, before a run with fitted parameters is given up


class ChannelError(NamedTuple):
    """Errors of a predicted channel [SI]."""

    trial: str
    channel: str
    fitted: bool
    rms: float
    largest: float
    lead: float | None  # time by which the model runs ahead [s]; None where a record is too short or constant


@dataclass(frozen=True)
class CircuitFit:
    """Fitted parameters of a circuit, with intervals, and the errors of every record."""

    parameters: dict[str, Estimate]
    paths: dict[str, tuple[str, ...]]
    errors: tuple[ChannelError, ...]
    predicted: dict[str, dict[str, np.ndarray]]
    correlation: np.ndarray
    converged: bool
    message: str
    evaluations: int
    warnings: tuple[str, ...]

    def to_dict(self) -> dict[str, JsonValue]:
        """Parameters with their intervals, and errors of every record, as plain values [SI]."""
        return {
            "parameters": {name: e._asdict() for name, e in self.parameters.items()},
            "errors": [e._asdict() for e in self.errors],
            "rms": {"fitted": self.rms(), "predicted": self.rms(fitted=False)},
            "converged": self.converged,
            "message": self.message,
            "evaluations": self.evaluations,
            "warnings": list(self.warnings),
        }

    def tables(self, title: str) -> list[Table]:
        """Parameters with their intervals, and the errors of every record, with cautions below."""
        rows = [
            {
                "record": Path(e.trial).name,
                "channel": e.channel.removesuffix(".pressure_abs"),
                "used": "fitted" if e.fitted else "predicted",
                "rms": e.rms,
                "largest": e.largest,
                "lead": e.lead,
            }
            for e in self.errors
        ]
        errors = (Column(key, unit="Pa", beside=True) for key in ("rms", "largest"))
        lead = Column("lead", "model leads", "s", shown="ms", places="+.1f", missing="-", beside=True)
        columns = (Column("record"), Column("channel", "pressure of"), Column("used", ""), *errors, lead)
        said = [] if self.converged else [f"The search did not converge: {self.message}."]
        said += [f"note: {warning}" for warning in self.warnings]
        return [estimates(title, self.parameters), Table("", columns, rows, tuple(said))]

    @property
    def changes(self) -> dict[str, float]:
        """The fitted values by full dotted path [SI]."""
        return {path: self.parameters[p].value for p, many in self.paths.items() for path in many}

    def posterior(
        self,
        trials: Sequence[Trial],
        *,
        noise: float | None = None,
        step: float = STEP,
        draws: int = 1000,
        seed: int = 0,
    ) -> RecordPosterior:
        """Draw from the posterior of the parameters.

        Args:
            trials: records to which the circuit was fitted.
            noise: standard deviation of the pressure sensors [Pa]; found from the data where left out.
            step: step of the integration [s].
            draws: count of the samples.
            seed: same seed, same samples.

        Raises:
            ConvergenceError: the fit did not converge.
            MissingLibraryError: NumPyro is not installed; it comes with the extra ``posterior``.
        """
        check_converged(self.converged, "The fit of the circuit")
        return posterior_of_records(record_problem(self, trials, step=step), noise=noise, draws=draws, seed=seed)

    def rms(self, *, fitted: bool = True, channel: str | None = None) -> float:
        """Root mean square error of the records that were fitted, or of those that were predicted [SI]."""
        some = [e.rms for e in self.errors if e.fitted == fitted and channel in (None, e.channel)]
        return float(np.sqrt(np.mean(np.square(some)))) if some else float("nan")


def fit_circuit(
    trials: Sequence[Trial],
    free: Sequence[str],
    *,
    predict: Sequence[Trial] = (),
    start: Mapping[str, float] | None = None,
    step: float = STEP,
    progress: Callable[[str], None] | None = None,
    evaluations: int = EVALUATIONS,
) -> CircuitFit:
    """Fit parameters of a circuit to all trials at once, by the least squares of all measured channels.

    Args:
        trials: records to fit; all with the same elements and channels.
        free: dotted paths, such as ``elements.tube.loss``; a pattern such as ``elements.valve_*.conductance`` is one
            value for all that it matches. ``signals.<name>.delay`` is the delay of an input.
        predict: records to predict without refitting.
        start: first guesses by the same names [SI]; the circuit's own values by default.
        step: step of the integration [s].
        progress: called with a sentence after every evaluation.
        evaluations: most of them.

    Returns:
        The fit. Intervals are linearised, 95 %, and widened for the correlation of neighbouring residuals.

    Raises:
        InputError: for an unknown path, trials that do not fit together, or a parameter on which no record depends.
        ConvergenceError: if the circuit cannot be run with the first guesses, or the fit ended where it began.
    """
    if not trials:
        raise InputError("trials", None, "must be at least one record")
    if not free:
        raise InputError("free", None, "must be at least one parameter")
    evaluations = whole_number(evaluations, "evaluations", least=1)
    _check_together([*trials, *predict], free)
    problem = CircuitProblem.of(trials, free, start or {}, step)
    best = problem.solve(evaluations, progress)
    residual = problem.residual(best.x)
    known = conclude(
        problem.parameters,
        best,
        problem.jacobian(best.x),
        residual * widening(problem.split(residual)),
        subject=", ".join(t.name for t in trials),
        within=True,
        may_stand=evaluations == 1,
    )
    warnings = list(known.warnings)
    bounds = bounds_of(problem.parameters)
    for i, name in enumerate(problem.parameters):
        if known.half[i] > LOOSE:
            warnings.append(f"the data hardly determine {name}")
        for bound, edge in zip(bounds, ("lower", "upper"), strict=True):
            if abs(best.x[i] - bound[i]) < AT_BOUND:
                warnings.append(f"{name} ended at its {edge} bound")
    changes = {path: known.parameters[n].value for n, many in problem.paths.items() for path in many}
    errors: list[ChannelError] = []
    predicted: dict[str, dict[str, np.ndarray]] = {}
    for trial in (*trials, *predict):
        outputs = run_trial(trial, changes, step=step).outputs
        predicted[trial.name] = {c: np.asarray(outputs[c]) for c in trial.channels}
        errors += _errors(trial, predicted[trial.name], fitted=any(trial is t for t in trials))
    return CircuitFit(
        parameters=known.parameters,
        paths=problem.paths,
        errors=tuple(errors),
        predicted=predicted,
        correlation=known.correlation,
        converged=best.converged,
        message=best.message,
        evaluations=best.evaluations,
        warnings=tuple(warnings),
    )


def record_problem(fit: CircuitFit, trials: Sequence[Trial], *, step: float = STEP) -> RecordProblem:
    """What was fitted, for a posterior: scaled parameters with their bounds, and the prediction of the pressures.

    Args:
        fit: of the circuit.
        trials: records to which it was fitted.
        step: step of the integration [s].
    """
    values = {n: e.value for n, e in fit.parameters.items()}
    problem = CircuitProblem.of(trials, tuple(values), values, step)
    measured = np.concatenate([values for trial in trials for values in trial.measured.values()])
    return RecordProblem(
        parameters=problem.parameters,
        start=problem.start,
        model=HostModel(lambda x: problem.residual(x) + measured, problem.jacobian),
        measured=measured,
        group=np.concatenate([np.full(len(part), i) for i, part in enumerate(problem.split(measured))]),
        used=np.ones(len(measured), bool),
        unit="Pa",
    )


def run_trial(trial: Trial, changes: Mapping[str, float], *, step: float = STEP) -> Run:
    """Run a trial with fitted parameters, which may ask for a shorter step than the first guesses did.

    Args:
        trial: the trial.
        changes: parameters by dotted path [SI], such as `CircuitFit.changes`.
        step: of the integration [s]; halved up to four times.

    Raises:
        ConvergenceError: the circuit cannot be run with these parameters.
    """
    for halved in range(HALVINGS):
        try:
            return trial.run(changes, step=step / 2**halved)
        except ConvergenceError:
            continue
    return trial.run(changes, step=step / 2**HALVINGS)


def _check_together(trials: Sequence[Trial], free: Sequence[str]) -> None:
    """Refuse trials that share no parameters, and two of one name: a record that counts twice makes intervals too narrow."""
    wanted = expand(free, trials[0])
    names: set[str] = set()
    for trial in trials:
        if trial.name in names:
            raise InputError("records", trial.name, "must be each record once; it is there twice")
        names.add(trial.name)
        trial.check()
        paths = expand(free, trial)
        if paths != wanted:
            path = next(p for p in wanted if paths[p] != wanted[p])
            difference = f"there it is {', '.join(paths[path])}, in {trials[0].name} {', '.join(wanted[path])}"
            raise InputError("free", path, difference, where=trial.name)


def _errors(trial: Trial, predicted: Mapping[str, np.ndarray], *, fitted: bool) -> list[ChannelError]:
    errors = []
    for channel, measured in trial.measured.items():
        off = predicted[channel] - measured
        try:
            lead = time_lead(
                predicted[channel], measured, period=trial.period, longest=min(0.1, trial.samples * trial.period / 10.0)
            ).time
        except InputError:
            lead = None
        errors.append(
            ChannelError(trial.name, channel, fitted, float(np.sqrt(np.mean(off**2))), float(np.abs(off).max()), lead)
        )
    return errors
