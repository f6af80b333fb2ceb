"""Fitting tension laws to a force map, and ranking them by how well they predict points that were left out.

Akaike's criterion stands beside it. It takes the errors of a law as independent noise, which they are not, so that on real
muscles it pays parameters that bend a law to its own table and to nothing else.

A parameter that ended at a bound, or that the data do not contain, describes nothing: the law with it is the simpler law
without it. Such parameters are counted out of the criterion, and the law that has them has to be better than a law with
fewer parameters by more than either number can tell.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import estimation
from .._jax import Scalar
from ..accessors import Accessor
from ..answers import Caution, collect, warn
from ..documents import JsonValue
from ..errors import ConvergenceError, InputError, each_once, refuse_unknown
from ..muscles.build import build_law, cut_parameters, default_parameters
from ..muscles.evidence import is_other_bore
from ..muscles.law import TensionLaw
from ..muscles.laws import LAWS, law_key, law_type
from ..muscles.muscle import Muscle
from ..quantities import declared, in_si, with_unit
from ..recordings import ForceMap
from ..specimens import Specimen, SpecimenNumber
from .between import Between, NewMuscle, PredictedTension
from .calibration import CalibratedFit, muscle_of_fit
from .discrepancy import LawError
from .posterior import MapSensors, Posterior, posterior_of_fit
from .problem import (
    SAME_LENGTH,
    CrossValidation,
    ErrorMeasures,
    FittedLaw,
    LengthError,
    Problem,
    Solution,
    cross_validate,
    solve,
)
from .shared_hysteresis import SharedHysteresis, Source, fit_shared_hysteresis

if TYPE_CHECKING:
    from ..accessors import FitPlots
    from ..recordings import Recording

SCHEMES = ("pressure", "length", "block", "rest_length")
# Share of the largest tension below which no sensor resolves an error: below it, laws differ by rounding only.
RESOLUTION = 1e-6
ALIKE = 0.05  # share by which errors of prediction may differ between laws that predict alike
MOST_LENGTH_ERROR = 0.01  # a ruler that errs by more measures no muscle [m]
SIZE_UNITS = ("m", "m^2", "m^3", "rad")
STEP_SHARE = 0.01  # of an interval, over which a prediction is taken as straight


@dataclass(frozen=True, repr=False)
class Fit(FittedLaw):
    """Result of a fit of one law; errors in newton, of the tension that a sensor would measure.

    Attributes:
        law: name of the law.
        parameters: that were fitted, with their intervals [SI].
        known: that were not [SI].
        points: with tension, to which it was fitted.
        error: error of the tension at them [N].
        converged: whether the solver reached its tolerance.
        message: message of the solver.
        warnings: as text.
        cross: cross-validations by scheme.
        correlation: correlation of the parameters.
        holdout: prediction of points above the pressures of a separate fit.
        at_bound: parameters that ended at a bound.
        not_contained: parameters without influence on the tension at any point.
        effective: number of parameters and length errors that the data determine rather than their priors; None where
            there are no priors, and every parameter counts.
        length_errors: how far each set length was off, of a fit with such errors.
        length_error: standard deviation of these errors [m]; zero for none.
        length_reach: half width of the 95 % interval of a length that is yet to be set, of a fitted muscle and of one of
            another rest length [m]; zeros for none.
        hysteresis: friction with memory and creep from recordings, see `with_hysteresis`; None without recordings.
        between: how far muscles of the kind differ, where the table has several; None where it has one.
        inseparable: parameters that the data do not tell apart.

    Examples:
        >>> import mckibben as mk
        >>> found = mk.fit("DMSP-20-300", law="ideal", schemes=())
        >>> isinstance(found, mk.Fit), found.converged, sorted(found.parameters)
        (True, True, ['thread_length', 'turns'])
    """

    law: str
    parameters: dict[str, estimation.Estimate]
    known: dict[str, Any]
    points: ForceMap
    error: np.ndarray
    converged: bool
    message: str
    warnings: tuple[str, ...]
    cross: dict[str, CrossValidation] = field(default_factory=dict)
    correlation: np.ndarray | None = None
    holdout: Holdout | None = None
    at_bound: tuple[str, ...] = ()
    not_contained: tuple[str, ...] = ()
    effective: float | None = None
    length_errors: tuple[LengthError, ...] = ()
    length_error: float = 0.0
    length_reach: tuple[float, float] = (0.0, 0.0)
    hysteresis: SharedHysteresis | None = None
    between: Between | None = None
    inseparable: tuple[estimation.Inseparable, ...] = ()

    plot: ClassVar[Accessor[FitPlots]] = Accessor("FitPlots")
    """Plots: called, the law through the points; ``plot.residuals`` what it leaves."""

    @property
    def degenerate(self) -> tuple[str, ...]:
        """Fitted parameters that describe nothing: at a bound, or without influence."""
        return (*self.at_bound, *self.not_contained)

    @property
    def assumed(self) -> dict[str, float]:
        """Sizes, and parameters that a fit usually finds, which were neither stated nor fitted: the law's defaults [SI].

        A default of zero assumes nothing. What was assumed is not in the errors or the intervals: a wall of another
        thickness gives another diameter and another modulus at nearly the same tension.

        Examples:
            >>> import mckibben as mk
            >>> table = mk.specimen("DMSP-20-300").force_map()
            >>> mk.fit(table, law="seated_braid", schemes=(), rest_length="30 cm").assumed
            {'wall_thickness': 0.0018}
        """
        kind = law_type(self.law)
        values = default_parameters(kind)
        return {
            name: value
            for name, value in values.items()
            if value != 0.0
            and name not in self.parameters
            and name not in self.known
            and (declared(kind)[name].unit in SIZE_UNITS or name in kind.fitted)
        }

    @property
    def cv_rmse(self) -> float | None:
        """Root mean square error of points predicted with their pressure left out [N]."""
        return self.cross["pressure"].rmse if "pressure" in self.cross else None

    @property
    def cv_max_error(self) -> float | None:
        """Largest of those errors [N]."""
        return self.cross["pressure"].max_error if "pressure" in self.cross else None

    @property
    def left_out_rmse(self) -> float | None:
        """Root mean square error of all predictions of points that were left out, by any scheme [N]: what ranks laws.

        Infinite where a fold failed, so that the law could not be checked; None where nothing was left out.
        """
        if not self.cross:
            return None
        return float(np.sqrt(np.mean([np.square(one.rmse) for one in self.cross.values()])))

    @property
    def left_out_max_error(self) -> float | None:
        """Largest of those errors [N]."""
        return max((one.max_error for one in self.cross.values()), default=None)

    @property
    def determined(self) -> bool:
        """Whether the data tell every parameter that describes something: none has an interval without end."""
        spans = [e.high - e.low for name, e in self.parameters.items() if name not in self.degenerate]
        return bool(np.isfinite(spans).all())

    @property
    def misses(self) -> bool:
        """Whether points that were left out were predicted, but missed by more than tensions scatter about their mean."""
        error = self.left_out_rmse
        return error is not None and self._scatter < error < np.inf

    @property
    def _scatter(self) -> float:
        """Standard deviation of the tensions of the table about their mean [N]."""
        return float(np.std(self.points.tension[self.points.taut]))

    @property
    def doubt(self) -> str:
        """Why not to trust the law at points that it was not fitted to: it misses them, or is `unchecked`; else empty."""
        error = self.left_out_rmse
        if error is None or not self.misses:
            return self.unchecked
        return (
            f"points left out of the fit are missed by {with_unit(error, 'N', 3)} rms, more than the "
            f"{with_unit(self._scatter, 'N', 3)} by which tensions scatter about their mean"
        )

    @property
    def caution(self) -> Caution | None:
        """Caution where a check speaks against the law, or failed; None where nobody asked for one."""
        if not self.cross or not self.doubt:
            return None
        said = f"{self.points.name}: {self.law}"
        if self.misses:
            return Caution(f"{said} describes the table and predicts nothing beside it: {self.doubt}", "law")
        said += f" could not be checked: {self.doubt}"
        return Caution(f"{said}, so that nothing says how far it is off where it was not fitted", "law")

    @property
    def unchecked(self) -> str:
        """Why nothing says how well the law predicts points that it was not fitted to; empty if something does."""
        failed = [f"{one.failed} of {one.groups} by {scheme}" for scheme, one in self.cross.items() if one.failed]
        if failed:
            return f"fits with points left out failed, {', '.join(failed)}"
        return "" if self.cross else "no points were left out of the fit"

    @property
    def aicc(self) -> float:
        """Akaike's criterion with the correction for small samples.

        The noise level counts as a parameter; degenerate parameters do not. Where parameters have priors, the effective
        number of parameters counts: one that the data determine is 1, one that keeps its prior is 0.
        """
        counted = len(self.parameters) - len(self.degenerate) if self.effective is None else self.effective
        return estimation.akaike(np.asarray(self.error), counted + 1, resolution=RESOLUTION * self.points.largest)

    @property
    def muscle(self) -> Muscle:
        """A muscle with the fitted law, and with the friction and creep of recordings; static points say nothing of them.

        A `PlausibilityWarning` says where a check of the law failed or speaks against it.
        """
        warn(collect(self.caution))
        friction, creep = (None, None) if self.hysteresis is None else (self.hysteresis.friction, self.hysteresis.creep)
        return Muscle(self.build(), friction, creep, specimen=fitted_specimen([self]) if self.converged else None)

    def with_hysteresis(
        self,
        recordings: Mapping[str, Recording] | Iterable[Source] | Source,
        *,
        progress: Callable[[str], None] | None = None,
    ) -> Fit:
        """Return the fit with one friction and one creep of all its muscles, as far as recordings of them show either.

        Args:
            recordings: of the muscles in motion, or at constant length while the pressure changes, or their files, see
                `fit_shared_hysteresis`.
            progress: called with a few words after each form that was fitted.

        Raises:
            InputError: a recording lacks a channel, or is of a muscle or of lengths that the table does not have.
            ConvergenceError: the fit of the law did not converge.
        """
        if not self.converged:
            raise ConvergenceError(f"{self.law}: the fit did not converge, so that friction has no law to stand on")
        return replace(self, hysteresis=fit_shared_hysteresis(self, recordings, progress=progress))

    def __repr__(self) -> str:
        counts = f"{len(self.parameters)} parameters, {len(self.points)} points"
        return f"Fit({self.law!r}, {counts}, rmse {self.rmse:.3g} N)"

    def to_dict(self) -> dict[str, JsonValue]:
        """Parameters with their intervals, errors [N] and warnings as plain values [SI], for JSON."""
        whole = {k: v for k, v in self.known.items() if np.ndim(v) == 0 or len(set(np.ravel(v))) == 1}
        held = self.holdout
        return {
            "law": self.law,
            "parameters": {name: e._asdict() for name, e in self.parameters.items()},
            "known": {name: float(np.max(v)) if name in whole else None for name, v in self.known.items()},
            "assumed": self.assumed,
            "rmse": self.rmse,
            "max_error": self.max_error,
            "cv_rmse": self.cv_rmse,
            "cv_max_error": self.cv_max_error,
            "left_out_rmse": self.left_out_rmse,
            "left_out_max_error": self.left_out_max_error,
            "aicc": self.aicc,
            "n": len(self.points),
            "converged": self.converged,
            "at_bound": list(self.at_bound),
            "not_contained": list(self.not_contained),
            "determined": self.determined,
            "misses": self.misses,
            "unchecked": self.unchecked or None,
            "inseparable": [{"parameters": list(names), "correlation": r} for names, r in self.inseparable],
            "effective": self.effective,
            "length_errors": [e._asdict() for e in self.length_errors],
            "hysteresis": None if self.hysteresis is None else self.hysteresis.to_dict(),
            "warnings": list(self.warnings),
            "cross_validation": {
                name: {"groups": c.groups, "rmse": c.rmse, "max_error": c.max_error} for name, c in self.cross.items()
            },
            "holdout": None
            if held is None
            else {"trained_on": held.trained_on, "rmse": held.rmse, "max_error": held.max_error},
        }

    def posterior(self, *, sensors: MapSensors | None = None, **options: JsonValue) -> Posterior:
        """Draw from the posterior of the parameters, with a discrepancy for what the law has no parameter for.

        Args:
            sensors: standard uncertainties of the map's values; found from the data where left out.
            **options: ``draws``, ``seed``, ``slack``, ``discrepancy``, ``runs``, ``chains`` and ``warm_up`` of
                `posterior_of_fit`.

        Raises:
            ConvergenceError: the fit did not converge.
            MissingLibraryError: NumPyro is not installed; it comes with the extra ``posterior``.
        """
        return posterior_of_fit(self, sensors=sensors, **options)

    def build(self, **changes: JsonValue) -> TensionLaw:
        """The fitted law; `changes` replace parameters, such as the rest length of another muscle of the kind.

        Fitted parameters that go with the length are those of the measured muscle, and are scaled with it.
        """
        changes = self._in_si(changes)
        known = {k: (float(np.max(v)) if np.ndim(v) else v) for k, v in self.known.items()}
        rests = np.unique(np.ravel(self.known.get("rest_length", ())))
        if "rest_length" in changes and rests.size > 1 and "upper_length" in self.known:
            # A muscle of another length is used as far, in proportion, as those that were measured.
            reach = float(np.max(self.known["upper_length"] / np.asarray(self.known["rest_length"])))
            known["upper_length"] = reach * float(changes["rest_length"])
        fitted = {n: float(changes.get(n, e.value)) for n, e in self.parameters.items()}
        changes = {n: v for n, v in changes.items() if n not in fitted}
        return build_law(self.law, cut_parameters(self.law, known | fitted, changes, rests.tolist()) | changes)

    def calibrate(self, readings: Any, *, rest_length: float | str, elsewhere: bool = False) -> CalibratedFit:
        """Readings of one more muscle of the kind, which narrow the interval of its tension.

        One at rest and one 4 % shortened, at 5 to 6 bar, leave about a third of it; of a muscle from elsewhere the second is
        taken at the most contracted length that is used.

        Args:
            readings: one to three, each a length, a gauge pressure and a tension: ``"126.75 mm, 5.5 bar, 140 N"``.
            rest_length: of that muscle [m].
            elsewhere: it is not measured on the rig of the table.

        Raises:
            InputError: a reading is refused, or the fit knows no differences between muscles.
            ConvergenceError: the fit did not converge.
        """
        return CalibratedFit(self, self.one_more(elsewhere=elsewhere, rest_length=rest_length).conditioned(readings))

    def one_more(self, *, elsewhere: bool = False, **changes: Any) -> NewMuscle:
        """One more muscle of the kind as a Gaussian over its tensions, which readings condition.

        Args:
            elsewhere: it is not measured on the rig of the table.
            changes: parameters of its law, such as ``rest_length``; of another bore its gain is known less.

        Raises:
            InputError: a parameter is refused, or the fit knows no differences between muscles.
            ConvergenceError: the fit did not converge.
        """
        if not self.converged:
            raise ConvergenceError(f"{self.law}: the fit did not converge, so that no interval follows")
        if self.between is None:
            problem = "is not known of this fit: give a table of two or more rest lengths"
            raise InputError("between", None, problem, where=self.points.name)
        changes = self._in_si(changes)
        free = [name for name in self.parameters if name not in (*changes, *self.not_contained)]
        new = muscle_of_fit(self, self.between, self.build(**changes), free, elsewhere=elsewhere)
        own = getattr(self.build(), "rest_diameter", None)
        if own is None or not is_other_bore(changes.get("rest_diameter", own), own):
            return new
        return replace(new, between=new.between.at_other_bore(), other_bore=True)

    def between_numbers(self) -> dict[str, SpecimenNumber]:
        """How far muscles of the kind differ, as numbers of a specimen; empty where the fit does not tell it."""
        return {} if self.between is None or not self.converged else self.between.numbers()

    def predict(self, length: Any, pressure: Any, *, elsewhere: bool = False, **changes: JsonValue) -> PredictedTension:
        """Predict the tension of a muscle with a 95 % interval, also of a muscle that was not measured.

        The interval is of a further reading. Where the table has several rest lengths, it is that of one more muscle of the
        kind (`between`), on the rig of the table or elsewhere. Of a single muscle, or with ``between=False``, it holds the
        noise, the parameters, linearised at the fit, and how far the law is wrong, as far as the points tell
        (`discrepancy`): narrow near the points, wide away from them. It lies around the law, which is not corrected, and in
        proportion to the bore where that differs. Where the fit had `length_error`, it sums up three independent errors
        instead: of the parameters; of the length to which the muscle is set, as large as stated or as found where that is
        more (`length_reach`); and what the law left of the points. The error of the length of a muscle that was not
        measured holds how far muscles differ as a whole, as far as the muscles of the table tell, in their length;
        how far they differ in material is not in it. A muscle of another rest length is used as far, in proportion,
        as those of the table, unless ``upper_length`` is stated.

        Args:
            length: of the muscle, [m] or text with a unit, broadcast with the pressure.
            pressure: gauge pressure, [Pa] or text with a unit.
            elsewhere: the muscle is not measured on the rig of the table; matters where it has several rest lengths.
            **changes: of parameters, as for `build`, such as ``rest_length=0.12``; one that is changed has no error. Another
                bore than the table's has a wider interval, of which a `PlausibilityWarning` says where it is from.

        Raises:
            ConvergenceError: the fit did not converge, or an interval of its parameters is infinite.

        Examples:
            >>> import mckibben as mk
            >>> found = mk.fit("DMSP-20-300", law="hyperelastic_braid", schemes=())
            >>> one = found.predict(0.27, 3e5)
            >>> bool(one.low < one.tension < one.high)
            True
            >>> bool(found.predict("27 cm", "3 bar").tension == one.tension)
            True
        """
        changes = self._in_si(changes)
        names = [n for n in self.parameters if n not in (*changes, *self.not_contained)]
        spread = np.array([0.5 * (self.parameters[n].high - self.parameters[n].low) for n in names])
        if not self.converged or not np.isfinite(spread).all():
            raise ConvergenceError(
                f"{self.law}: the table does not determine all parameters, so that no interval follows"
            )
        given = in_si(length, "m", field="length"), in_si(pressure, "Pa", field="pressure")
        at = tuple(np.broadcast_arrays(*(np.asarray(values, float) for values in given)))

        def tension(shift: float = 0.0, **moved: float) -> np.ndarray:
            return np.asarray(self.build(**changes | moved).tension(at[0] + shift, at[1]))

        if self.between is not None:
            new = self.one_more(elsewhere=elsewhere, **changes)
            warn(new.cautions())
            return new.predicted(at[0], at[1], tension())
        columns = [self._half_width(tension, name, width) for name, width in zip(names, spread, strict=True)]
        moves = np.reshape(np.array(columns), (len(names), *at[0].shape))
        reach, bore = self._reach(changes), self.known.get("rest_diameter")
        # errors go with the bore where the law has a diameter and another is asked for
        ratio = 1.0
        if bore is not None and "rest_diameter" in changes:
            ratio = float((changes["rest_diameter"] / np.max(bore)) ** 2)
        if reach:
            index = [list(self.parameters).index(n) for n in names]
            whole = np.eye(len(self.parameters)) if self.correlation is None else self.correlation
            variance = np.einsum("i...,ij,j...->...", moves, whole[np.ix_(index, index)], moves)
            variance = variance + (0.5 * (tension(reach) - tension(-reach))) ** 2
            half = np.sqrt(np.maximum(variance, 0.0) + (estimation.NORMAL_QUANTILE * self.rmse * ratio) ** 2)
        else:
            slopes = np.zeros((at[0].size, len(self.parameters)))
            for name, width, move in zip(names, spread, moves, strict=True):
                if width > 0.0:
                    slopes[:, list(self.parameters).index(name)] = np.ravel(move) / (width * ratio)
            there, rest, own = at[0], changes.get("rest_length"), self.known.get("rest_length")
            if own is not None and rest is not None and self.points.rest_length is None:
                # the points know one length only: another muscle is compared at the same contraction
                there = np.asarray(at[0] * float(np.max(own)) / float(rest))
            half = ratio * self._law_error.half_width(np.ravel(there), np.ravel(at[1]), slopes, rest)
            half = half.reshape(at[0].shape)
        most = tension()
        return PredictedTension(most, np.maximum(most - half, 0.0), most + half)

    def _in_si(self, changes: dict[str, JsonValue]) -> dict[str, JsonValue]:
        """Changes of parameters with texts such as ``"12 cm"`` in SI; unknown names are left to the law."""
        units = declared(law_type(self.law))
        texts = {n: v for n, v in changes.items() if n in units and isinstance(v, str)}
        return changes | {n: float(in_si(v, units[n].unit, field=n)) for n, v in texts.items()}

    @functools.cached_property
    def _law_error(self) -> LawError:
        return LawError.of(self)

    def _reach(self, changes: Mapping[str, Any]) -> float:
        """Half width of the 95 % interval of a length that is yet to be set [m]; zero without errors of lengths.

        At least what the stated deviation says; wider where the set lengths of the table scatter by more, and for a
        muscle whose rest length is none of the table's.
        """
        rest = changes.get("rest_length")
        fitted = rest is None or bool(
            (np.abs(np.asarray(self.known.get("rest_length", rest)) - float(rest)) < SAME_LENGTH).any()
        )
        return max(estimation.NORMAL_QUANTILE * self.length_error, self.length_reach[0 if fitted else 1])

    def _half_width(self, tension: Callable[..., np.ndarray], name: str, width: float) -> np.ndarray:
        """Half the change of the tension over the interval of a parameter, from a small step within its bounds [N]."""
        value, bounds = self.parameters[name].value, declared(law_type(self.law))[name].bounds
        step = STEP_SHARE * width
        ends = np.clip([value - step, value + step], *bounds)
        change: np.ndarray = tension(**{name: float(ends[1])}) - tension(**{name: float(ends[0])})
        return change * (width / (ends[1] - ends[0])) if ends[1] > ends[0] else 0.0 * change


@dataclass(frozen=True)
class Holdout(ErrorMeasures):
    """Errors on points that a separate fit was not shown [N]."""

    what: str
    trained_on: int
    error: np.ndarray


def fit(
    law: str | type[TensionLaw],
    points: ForceMap,
    *,
    known: Mapping[str, JsonValue] | None = None,
    free: tuple[str, ...] | None = None,
    slack: bool = True,
    schemes: Iterable[str] = SCHEMES,
    train_below: float | None = None,
    length_error: Scalar | str | None = None,
    between: Between | bool | None = None,
    progress: Callable[[str], None] | None = None,
) -> Fit:
    """Fit one law.

    Args:
        law: its name, such as ``ideal`` or ``my.py:MyLaw``, or its class.
        points: the measured table.
        known: parameters that are not fitted [SI], by name; those the law does not have are passed over.
        free: which parameters to fit; the law's own choice by default.
        slack: also use the slack points that say where the law may not pull, see `ForceMap.informative_slack`; their
            errors are not counted.
        schemes: cross-validations to run, of ``pressure``, ``length``, ``block``, ``rest_length``.
        train_below: also fit to gauge pressures up to this one [Pa] and predict those above.
        length_error: standard deviation of the error of each set length [m], such as ``"0.5 mm"``: at one length a muscle is
            off by one distance at all pressures, which is found with the parameters. None by default.
        between: how far one more muscle of the kind differs, from which its interval follows. By default `Between()` where
            the table has two or more rest lengths and no `length_error` is stated; False for none.
        progress: called with a few words after each piece of work.

    Raises:
        InputError: if the table is too small, a needed parameter unknown, or the table does not depend on a free one.
        ConvergenceError: the fit ended where it began.
    """
    tell = progress or (lambda _: None)
    law = law_key(law)
    spread_of_lengths = checked_length_error(length_error)
    problem = Problem.of(law, points, known=known, free=free, slack=slack, length_error=spread_of_lengths)
    solution = solve(problem)
    tell(f"{law}: fitted")
    title = f"{problem.points.name} by the law {law}"
    estimation.require_influence(solution.jacobian, problem.free, subject=title)
    estimation.require_progress(
        solution.start,
        solution.scaled,
        solution.jacobian,
        solution.tension - problem.points.tension,
        problem.bounds,
        subject=title,
    )
    taut = problem.points.taut
    error = (solution.tension - problem.points.tension)[taut]
    posterior = solution.posterior
    if posterior is None:
        spread = estimation.uncertainty(solution.jacobian[taut], error, problem.free)
    else:
        spread = estimation.posterior_uncertainty(posterior.covariance, problem.free)
    bound, none = _degenerate(problem, solution, taut)
    values = solution.scaled * problem.scale
    half = spread.quantile * spread.standard_error * problem.scale
    crossed = {}
    for scheme in each_once("schemes", schemes):
        result = cross_validate(problem, scheme) if solution.converged else None
        if result is not None:
            crossed[scheme] = result
        tell(f"{law}: {scheme} left out")
    return Fit(
        law=law,
        parameters={
            name: estimation.Estimate(float(v), float(v - h), float(v + h), q.unit)
            for (name, q), v, h in zip(problem.quantities.items(), values, half, strict=True)
        },
        known={k: v[taut] if np.ndim(v) else v for k, v in problem.known.items()},
        points=problem.points.select(taut),
        error=error,
        converged=solution.converged,
        message=solution.message,
        warnings=(
            *([] if solution.converged else [f"did not converge: {solution.message}"]),
            *spread.warnings,
            *(f"{name} lies on its bound" for name in bound),
        ),
        cross=crossed,
        correlation=spread.correlation,
        holdout=_hold_out(law, points, train_below, known, slack, spread_of_lengths),
        at_bound=bound,
        not_contained=none,
        effective=None if posterior is None else posterior.effective,
        length_errors=_length_errors(problem, solution),
        length_error=problem.length_error,
        length_reach=(0.0, 0.0) if posterior is None or posterior.lengths is None else posterior.lengths.reach(),
        between=_between(between, problem),
        inseparable=spread.inseparable,
    )


def _between(between: Between | bool | None, problem: Problem) -> Between | None:
    """How far muscles of a table differ; None where it has one rest length, or errors of lengths say it."""
    rests = problem.points.rest_length
    several = rests is not None and bool(np.ptp(rests) > SAME_LENGTH) and "rest_length" in problem.known
    if isinstance(between, Between):
        if several:
            return between
        said = "needs a table of two or more rest lengths, of a law that has one"
        raise InputError("between", None, said, where=problem.points.name)
    return Between() if several and not problem.length_error and between is not False else None


def fit_all(
    points: ForceMap,
    *,
    laws: Iterable[str | type[TensionLaw]] | None = None,
    beside: Iterable[str | type[TensionLaw]] = (),
    known: Mapping[str, JsonValue] | None = None,
    skipped: dict[str, str] | None = None,
    **options: JsonValue,
) -> list[Fit]:
    """Fit several laws and rank them, best first.

    Args:
        points: the measured table.
        laws: their names or classes; all of them by default, and then a law that the table cannot feed is passed over
            with its reason in `skipped`. So is one whose fit fails.
        beside: further laws of one's own, names or classes, to rank beside all others where `laws` is left out.
        known: as for `fit`.
        skipped: filled with reasons by name.
        **options: as for `fit`.

    Examples:
        >>> import mckibben as mk
        >>> points = mk.specimen("DMSP-20-300").force_map()
        >>> [found.law for found in mk.fit_all(points, laws=["ideal", "sarosi"], schemes=())]
        ['sarosi', 'ideal']
    """
    refuse_unknown(options, fit.__kwdefaults__ or ())
    further = [law_key(law) for law in beside]
    names = [*(name for name in LAWS if name not in further), *further]
    fits = []
    for name in names if laws is None else each_once("law", map(law_key, laws)):
        try:
            fits.append(fit(name, points, known=known, **options))
        except (InputError, ConvergenceError) as error:
            if laws is not None or name in further:
                raise
            if skipped is not None:
                skipped[name] = str(error)
    if not fits:
        raise InputError(
            "points",
            None,
            f"are too few: {int(points.taut.sum())} of them have tension, and no law can be fitted to so few",
            where=points.name,
        )
    return rank(fits)


def rank(fits: Iterable[Fit]) -> list[Fit]:
    """Sort fits, best first: by the error of points that were left out, among the laws that were checked and are determined.

    Behind them stand laws of which the data leave a parameter undetermined, then those that fail the check: a fit with
    points left out failed, or misses them by more than the tensions of the table scatter about their mean. Last are those
    that did not converge. Where nothing was left out, AICc decides. A fit with
    degenerate parameters comes behind any other that predicts no worse than it by more than `ALIKE`, or whose AICc is larger
    by `INDIFFERENT` or less; of two that are equal the one with fewer parameters comes first.
    """

    def key(f: Fit) -> tuple[bool, bool, bool, float, int, float]:
        error, empty = f.left_out_rmse, bool(f.degenerate)
        criterion = f.aicc + estimation.INDIFFERENT * empty
        # what an exact fit leaves is rounding, whose size says nothing
        score = criterion if error is None else max(error, RESOLUTION * f.points.largest) * (1.0 + ALIKE * empty)
        return not f.converged, bool(f.doubt), not f.determined, score, len(f.parameters), criterion

    return sorted(fits, key=key)


def degenerate_words(fit: Fit) -> list[str]:
    """Describe the parameters that do not count in the criterion, one phrase each."""
    return [f"{name} at its bound" for name in fit.at_bound] + [f"{name} not in the data" for name in fit.not_contained]


def bound_of(fit: Fit, name: str) -> float:
    """The declared bound at which a parameter ended [SI]."""
    value, bounds = fit.parameters[name].value, declared(law_type(fit.law))[name].bounds
    return min(bounds, key=lambda b: abs(value - b))


def evaluate(law: TensionLaw, points: ForceMap) -> np.ndarray:
    """Error of a law with given parameters at the taut points [N]."""
    taut = points.select(points.taut)
    residuals: np.ndarray = np.asarray(law.tension(taut.length, taut.pressure)) - taut.tension
    return residuals


def checked_length_error(length_error: Scalar | str | None, *, field: str = "length_error") -> float:
    """Standard deviation of the errors of set lengths [m]; zero for none.

    Args:
        length_error: a number [m], a text with a unit, or None for none.
        field: how errors name it.

    Raises:
        InputError: it is not above zero, or more than 10 mm.
    """
    if length_error is None:
        return 0.0
    value = float(in_si(length_error, "m", field=field))
    if not 0.0 < value <= MOST_LENGTH_ERROR:
        allowed = f"must be above 0 m and at most {with_unit(MOST_LENGTH_ERROR, 'm')}"
        raise InputError(field, with_unit(value, "m"), allowed)
    return value


def _length_errors(problem: Problem, solution: Solution) -> tuple[LengthError, ...]:
    if solution.posterior is None or not problem.length_error:
        return ()
    points, curves = problem.points, problem.curves
    added, sd = solution.posterior.shifts
    first = [int(np.flatnonzero(curves == c)[0]) for c in np.unique(curves[points.taut])]
    rest = np.full(len(points), np.nan) if points.rest_length is None else points.rest_length
    return tuple(
        LengthError(
            float(rest[i]),
            float(points.length[i]),
            float(added[curves[i]]),
            *(float(added[curves[i]] + side * estimation.NORMAL_QUANTILE * sd[curves[i]]) for side in (-1.0, 1.0)),
        )
        for i in first
    )


def _degenerate(problem: Problem, solution: Solution, taut: np.ndarray) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The parameters at a bound, and those without influence.

    At a bound is also what could be moved there without changing any tension by more than `RESOLUTION`.
    """
    low, high = problem.bounds
    influence = np.abs(solution.jacobian[taut]).max(axis=0)
    room = np.minimum(solution.scaled - low, high - solution.scaled)
    close = room < 1e-6 * np.maximum(np.abs(solution.scaled), 1e-3)
    close |= room * influence < RESOLUTION * problem.points.largest
    none = influence == 0.0
    named = np.array(problem.free)
    return tuple(map(str, named[close & ~none])), tuple(map(str, named[none]))


def _hold_out(
    law: str,
    points: ForceMap,
    train_below: float | None,
    known: Mapping[str, Any] | None,
    slack: bool,
    length_error: float,
) -> Holdout | None:
    """Fit to the points below a pressure as if there were no others, and predict those above."""
    if train_below is None:
        return None
    train = points.pressure <= train_below
    asked = points.select(~train & points.taut)
    if not len(asked) or not (points.taut & train).any():
        allowed = f"must be a pressure with points on both sides, got {train_below:.6g} Pa"
        raise InputError("train_below", None, allowed, where=points.name)
    error = np.full(len(asked), np.inf)
    trained = int((points.taut & train).sum())
    if trained >= len(law_type(law).fitted) + 2:
        problem = Problem.of(law, points.select(train), known=known, slack=slack, length_error=length_error)
        solution = solve(problem)
        if solution.converged:
            built = Problem.of(law, points, known=known, free=problem.free, slack=slack)
            pull = np.maximum(built.functions()[0](solution.scaled), 0.0) - built.points.tension
            error = pull[built.points.taut & (built.points.pressure > train_below)]
    return Holdout(what=f"trained up to {train_below / 1e5:g} bar", trained_on=trained, error=error)


def fitted_specimen(fits: Iterable[Fit], like: Specimen | None = None, *, name: str = "fitted") -> Specimen:
    """All converged fits as one specimen; the first is its default law.

    Args:
        fits: fits to one table, ranked.
        like: specimen whose properties are known for this muscle, if any.
        name: id of the specimen.

    Raises:
        ConvergenceError: if no fit converged.
    """
    good = [f for f in fits if f.converged]
    if not good:
        raise ConvergenceError("no fit converged, so that there is no law to keep")
    title = f"fitted to {good[0].points.name}"
    friction, creep = ({}, {}) if good[0].hysteresis is None else good[0].hysteresis.numbers()
    return Specimen(
        id=name,
        kind="mckibben",
        title=title,
        sources=list(dict.fromkeys(key for f in good for key in law_type(f.law).cites)),
        law=good[0].law,
        properties=({} if like is None else like.properties) | measured_range(good[0].points) | creep,
        friction=friction,
        laws={f.law: _numbers(f) for f in good},
        errors={f.law: _errors(f) for f in good},
        between=good[0].between_numbers(),
    )


def measured_range(points: ForceMap, lengths: tuple[float, float] | None = None) -> dict[str, SpecimenNumber]:
    """Highest pressure and shortest and longest length of measured points, as properties of a specimen.

    Args:
        points: to which a law was fitted.
        lengths: shortest and longest measured length [m]; those of the points by default.
    """
    shortest, longest = lengths or (float(points.length.min()), float(points.length.max()))
    measured = {
        "highest_measured_pressure": (float(points.pressure.max()), "Pa"),
        "shortest_measured_length": (shortest, "m"),
        "longest_measured_length": (longest, "m"),
    }
    note = "of the points to which the laws were fitted"
    properties = {
        name: SpecimenNumber(value=float(f"{value:.6g}"), unit=unit, note=note)
        for name, (value, unit) in measured.items()
    }
    if points.rest_length is None:
        return properties
    rests = [float(rest) for rest in np.unique(points.rest_length)]
    # Not those of the specimen whose other dimensions are taken: it may be of another length.
    ends = {"rest_length": rests[-1], "upper_length": max(rests[-1], longest)}
    rest = {name: SpecimenNumber(value=value, unit="m", note=note) for name, value in ends.items()}
    return rest | properties | {"measured_rest_lengths": SpecimenNumber(value=rests, unit="m", note=note)}


def _errors(f: Fit) -> dict[str, SpecimenNumber]:
    """Errors of a fitted law over the largest measured tension, of points that were left out where there are such."""
    held = f.cross.get("pressure")
    left_out = held is not None and not held.failed
    worst = held if held is not None and left_out else f
    said = "predicted with their pressure left out" if left_out else "to which it was fitted"
    said += f"; {'not checked: ' if f.unchecked else ''}{f.doubt}" if f.doubt else ""
    numbers = {"rms": (worst.rmse, f"of the points, {said}"), "largest": (worst.max_error, f"of the points, {said}")}
    if "rest_length" in f.cross and not f.cross["rest_length"].failed:
        numbers["other_length"] = (f.cross["rest_length"].max_error, "each rest length left out in turn")
    top = float(f.points.tension.max())
    errors = {n: SpecimenNumber(value=float(f"{v / top:.3g}"), unit="1", note=note) for n, (v, note) in numbers.items()}
    if "other_length" in errors and f.points.rest_length is not None:
        at = f.points.rest_length[f.points.taut][np.argmax(np.abs(f.cross["rest_length"].error))]
        errors["other_length_at"] = SpecimenNumber(
            value=float(at), unit="m", note="the one left out that it was found on"
        )
    return errors


def _numbers(f: Fit) -> dict[str, SpecimenNumber]:
    units, group = declared(law_type(f.law)), {}
    for name, e in f.parameters.items():
        note = f"fitted, rmse {f.rmse:.3g} N"
        if name in f.degenerate:
            note += "; at its bound" if name in f.at_bound else "; not in the data"
        known = name not in f.degenerate and bool(np.isfinite([e.low, e.high]).all())
        group[name] = SpecimenNumber(value=e.value, unit=e.unit, note=note, range=(e.low, e.high) if known else None)
    for name, value in f.known.items():
        group[name] = SpecimenNumber(value=float(np.max(value)), unit=units[name].unit, note="known")
    return group
