"""Parameters of a circuit from records of its pressures, and how well they predict records that the fit did not see."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..analysis.frequency import time_lead
from ..components import paths
from ..engine import STEP, Run
from ..engine.rates import RK4_LIMIT
from ..errors import ConvergenceError, InputError
from ..quantities import Quantity
from ._checks import require_influence, require_progress
from .sampler import HostModel
from .trial import Trial, expand
from .uncertainty import Estimate, uncertainty, widening

if TYPE_CHECKING:
    from .record_posterior import RecordPosterior, RecordProblem

DELAY = Quantity("s", (0.0, 1.0), "delay of the signal", "", (1e-4, 2e-2))

EVALUATIONS = 60  # most of a fit, where nothing else is stated


@dataclass(frozen=True)
class CircuitProblem:
    """Least squares in scaled parameters: the logarithm of naturally positive ones, else their share."""

    trials: Sequence[Trial]
    paths: dict[str, tuple[str, ...]]
    quantities: tuple[Quantity, ...]
    first: np.ndarray
    size: np.ndarray
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
        quantities, first = [], []
        for name, many in spread.items():
            signal = many[0].startswith("signals.")
            quantities.append(DELAY if signal else paths.declaration(trials[0].circuit, many[0]))
            scale = 1e-3 if signal else float(paths.get(trials[0].circuit, many[0]))
            first.append(float(start.get(name, scale)))
            quantities[-1].check(name, first[-1])
        where = {p: first[i] for i, n in enumerate(spread) for p in spread[n]}
        groups = tuple(spread.values())
        models = []
        for trial in trials:
            run = trial.run(where, step=step)
            inner = max(1, int(np.ceil(trial.period / step - 1e-9)))
            # half of the limit is left for what the parameters will do on their way
            stiff = run.stiff or run.fastest * trial.period / inner > 0.5 * RK4_LIMIT
            models.append(trial.model(groups, inner, stiff))
        size = np.array(
            [abs(v) if v else max(abs(t) for t in q.typical) for v, q in zip(first, quantities, strict=True)]
        )
        return cls(trials, spread, tuple(quantities), np.asarray(first), size, tuple(models))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, in order."""
        return tuple(self.paths)

    def logarithmic(self, i: int) -> bool:
        """Whether a parameter is positive by nature."""
        return self.quantities[i].bounds[0] > 0.0 and self.first[i] > 0.0

    def scaled(self, i: int, value: float) -> float:
        """A parameter's value as the solver sees it."""
        share = value / self.size[i]
        return float(np.log(share) if self.logarithmic(i) else share)

    def value(self, i: int, x: float) -> float:
        """A parameter [SI] from what the solver sees."""
        with np.errstate(over="ignore"):
            return float(self.size[i] * (np.exp(x) if self.logarithmic(i) else x))

    def values(self, x: np.ndarray) -> list[float]:
        """Values of all parameters."""
        return [self.value(i, v) for i, v in enumerate(x)]

    @property
    def start(self) -> np.ndarray:
        """First guesses, scaled."""
        return np.array([self.scaled(i, v) for i, v in enumerate(self.first)])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Declared bounds, scaled."""
        both = np.array([[self.scaled(i, b) for b in q.bounds] for i, q in enumerate(self.quantities)])
        return both[:, 0], both[:, 1]

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Predictions minus measurements [SI], finite also where a run fails."""
        values = np.asarray(self.values(x))
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
        values = np.asarray(self.values(x))
        late = [n.endswith((".delay", ".dead_time")) for n in self.names]
        slopes = None if all(late) else np.concatenate([m.slopes(values).reshape(-1, len(values)) for m in self.models])
        columns = []
        for i in range(len(values)):
            if late[i] or slopes is None:
                columns.append(self._differenced(x, i))
            else:
                columns.append(slopes[:, i] * (self.value(i, x[i]) if self.logarithmic(i) else self.size[i]))
        jacobian: np.ndarray = np.nan_to_num(np.stack(columns, axis=1))
        return jacobian

    def _differenced(self, x: np.ndarray, i: int) -> np.ndarray:
        width = 0.5 * min(t.period for t in self.trials)
        value = self.value(i, x[i])
        low, high = (
            min(max(value + s * width, self.quantities[i].bounds[0]), self.quantities[i].bounds[1]) for s in (-1, 1)
        )
        ends = []
        for v in (low, high):
            moved = x.copy()
            moved[i] = self.scaled(i, v)
            ends.append(self.residual(moved))
        rate = (ends[1] - ends[0]) / (high - low)
        derivative: np.ndarray = rate * (value if self.logarithmic(i) else self.size[i])
        return derivative

    def solve(self, evaluations: int, progress: Callable[[str], None] | None) -> Any:
        """Least squares from the first guesses; SciPy's result."""
        from scipy import optimize

        low, high = self.bounds
        count = [0]

        def told(x: np.ndarray) -> np.ndarray:
            off = self.residual(x)
            count[0] += 1
            if progress is not None:
                progress(f"evaluation {count[0]}, rms {np.sqrt(np.mean(off**2)):.4g}")
            return off / scale

        scale = max(float(np.sqrt(np.mean(self.residual(self.start) ** 2))), 1e-12)
        if scale > 1e8:
            raise ConvergenceError("The circuit cannot be run with the first guesses; give others.")
        solution = optimize.least_squares(
            told,
            np.clip(self.start, low + 1e-9, high - 1e-9),
            jac=lambda x: self.jacobian(x) / scale,
            bounds=(low, high),
            x_scale="jac",
            max_nfev=evaluations,
            xtol=1e-7,
            ftol=1e-9,
            gtol=1e-10,
        )
        return solution


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
        from .record_posterior import check_converged, posterior_of_records

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
    if evaluations < 1:
        raise InputError("evaluations", evaluations, "must be at least one")
    _check_together([*trials, *predict], free)
    problem = CircuitProblem.of(trials, free, start or {}, step)
    solution = problem.solve(evaluations, progress)
    values = problem.values(solution.x)
    jacobian = problem.jacobian(solution.x)
    residual = problem.residual(solution.x)
    names = ", ".join(t.name for t in trials)
    require_influence(jacobian, problem.names, subject=names)
    if evaluations > 1:  # with one it may not move
        require_progress(problem.start, solution.x, jacobian, residual, problem.bounds, subject=names)
    known = uncertainty(jacobian, residual * widening(problem.split(residual)), problem.names)
    estimates, warnings = {}, list(known.warnings)
    for i, name in enumerate(problem.names):
        q = problem.quantities[i]
        spread = known.quantile * known.standard_error[i]
        ends = np.clip([problem.value(i, solution.x[i] + sign * spread) for sign in (-1.0, 1.0)], *q.bounds)
        estimates[name] = Estimate(values[i], float(ends[0]), float(ends[1]), q.unit)
        if spread > LOOSE:
            warnings.append(f"the data hardly determine {name}")
        for bound, edge in zip(problem.bounds, ("lower", "upper"), strict=True):
            if abs(solution.x[i] - bound[i]) < 1e-6:
                warnings.append(f"{name} ended at its {edge} bound")
    changes = {p: estimates[n].value for n in problem.names for p in problem.paths[n]}
    errors: list[ChannelError] = []
    predicted: dict[str, dict[str, np.ndarray]] = {}
    for trial in (*trials, *predict):
        outputs = run_trial(trial, changes, step=step).outputs
        predicted[trial.name] = {c: np.asarray(outputs[c]) for c in trial.channels}
        errors += _errors(trial, predicted[trial.name], fitted=any(trial is t for t in trials))
    return CircuitFit(
        parameters=estimates,
        paths=problem.paths,
        errors=tuple(errors),
        predicted=predicted,
        correlation=known.correlation,
        converged=bool(solution.status > 0),
        message=str(solution.message).replace("`", "").strip(" ."),
        evaluations=int(solution.nfev),
        warnings=tuple(warnings),
    )


def record_problem(fit: CircuitFit, trials: Sequence[Trial], *, step: float = STEP) -> RecordProblem:
    """What was fitted, for a posterior: scaled parameters with their bounds, and the prediction of the pressures.

    Args:
        fit: of the circuit.
        trials: records to which it was fitted.
        step: step of the integration [s].
    """
    from .record_posterior import RecordProblem

    names = tuple(fit.parameters)
    problem = CircuitProblem.of(trials, names, {n: e.value for n, e in fit.parameters.items()}, step)
    measured = np.concatenate([values for trial in trials for values in trial.measured.values()])
    low, high = problem.bounds
    return RecordProblem(
        names=names,
        units=tuple(q.unit for q in problem.quantities),
        low=low,
        high=high,
        start=problem.start,
        log=np.array([problem.logarithmic(i) for i in range(len(names))]),
        size=problem.size,
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
