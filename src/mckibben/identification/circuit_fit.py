"""Parameters of a circuit from records of its pressures, and how well they predict records that the fit did not see."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..analysis.timing import time_lead
from ..engine import STEP, Run
from ..errors import ConvergenceError, InputError
from .checks import require_influence, require_progress
from .circuit_problem import CircuitProblem
from .trial import Trial, expand
from .uncertainty import Estimate, uncertainty, widening

# Half an interval of this share of a parameter says little about it.
LOOSE = 1.0
HALVINGS = 4  # of the step, before a run with fitted parameters is given up


class ChannelError(NamedTuple):
    """How a predicted channel compares with the measured one [SI]."""

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
    evaluations: int = 60,
) -> CircuitFit:
    """Fit parameters of a circuit to all trials at once, by the least squares of all measured channels.

    Args:
        trials: records to fit; all with the same elements and channels.
        free: dotted paths, such as ``elements.tube.loss``; a pattern such as ``elements.valve_*.conductance`` is one
            value for all that it matches. ``signals.<name>.delay`` is the delay of an input.
        predict: records to predict without refitting.
        start: first guesses by the same names [SI]; the circuit's own values where left out.
        step: of the integration [s].
        progress: is told a sentence after every evaluation.
        evaluations: most of them.

    Returns:
        The fit. Intervals are linearised, 95 %, and widened for the correlation of neighbouring residuals.

    Raises:
        InputError: for an unknown path, trials that do not fit together, or a parameter on which no record depends.
        ConvergenceError: if the circuit cannot be run with the first guesses, or the fit ended where it began.
    """
    if not trials:
        raise InputError("trials", "none", "allowed is at least one record")
    if not free:
        raise InputError("free", "nothing", "allowed is at least one parameter")
    if evaluations < 1:
        raise InputError("evaluations", evaluations, "allowed is at least one")
    _check_together([*trials, *predict], free)
    problem = CircuitProblem.of(trials, free, start or {}, step)
    found = problem.solve(evaluations, progress)
    values = problem.values(found.x)
    jacobian = problem.jacobian(found.x)
    residual = problem.residual(found.x)
    what = ", ".join(t.name for t in trials)
    require_influence(jacobian, problem.names, what=what)
    if evaluations > 1:  # with one it may not move
        require_progress(problem.start, found.x, jacobian, residual, problem.bounds, what=what)
    known = uncertainty(jacobian, residual * widening(problem.split(residual)), problem.names)
    estimates, warnings = {}, list(known.warnings)
    for i, name in enumerate(problem.names):
        q = problem.quantities[i]
        spread = known.quantile * known.standard_error[i]
        ends = np.clip([problem.value(i, found.x[i] + sign * spread) for sign in (-1.0, 1.0)], *q.bounds)
        estimates[name] = Estimate(values[i], float(ends[0]), float(ends[1]), q.unit)
        if spread > LOOSE:
            warnings.append(f"the data hardly determine {name}")
        for bound, edge in zip(problem.bounds, ("lower", "upper"), strict=True):
            if abs(found.x[i] - bound[i]) < 1e-6:
                warnings.append(f"{name} ended at its {edge} bound")
    changes = {p: estimates[n].value for n in problem.names for p in problem.paths[n]}
    errors: list[ChannelError] = []
    predicted: dict[str, dict[str, np.ndarray]] = {}
    for trial in (*trials, *predict):
        outputs = _checked_run(trial, changes, step).outputs
        predicted[trial.name] = {c: np.asarray(outputs[c]) for c in trial.channels}
        errors += _errors(trial, predicted[trial.name], fitted=any(trial is t for t in trials))
    return CircuitFit(
        parameters=estimates, paths=problem.paths, errors=tuple(errors), predicted=predicted,
        correlation=known.correlation, converged=bool(found.status > 0),
        message=str(found.message).replace("`", "").strip(" ."),
        evaluations=int(found.nfev), warnings=tuple(warnings),
    )  # fmt: skip


def _checked_run(trial: Trial, changes: Mapping[str, float], step: float) -> Run:
    """The run by which a record is judged: fitted parameters may ask for a shorter step than the first guesses did."""
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
            raise InputError("records", trial.name, "it is there twice; allowed is each record once")
        names.add(trial.name)
        trial.check()
        found = expand(free, trial)
        if found != wanted:
            path = next(p for p in wanted if found[p] != wanted[p])
            told = f"there it is {', '.join(found[path])}, in {trials[0].name} {', '.join(wanted[path])}"
            raise InputError("free", path, told, where=trial.name)


def _errors(trial: Trial, predicted: Mapping[str, np.ndarray], *, fitted: bool) -> list[ChannelError]:
    found = []
    for channel, measured in trial.measured.items():
        off = predicted[channel] - measured
        try:
            lead = time_lead(
                predicted[channel], measured, period=trial.period, longest=min(0.1, trial.samples * trial.period / 10.0)
            ).time
        except InputError:
            lead = None
        found.append(
            ChannelError(trial.name, channel, fitted, float(np.sqrt(np.mean(off**2))), float(np.abs(off).max()), lead)
        )
    return found
