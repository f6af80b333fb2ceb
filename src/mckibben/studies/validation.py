"""Every tension law against every static data set, and the studies of loops, creep and air beside them.

A data set that is not there is named, not passed over in silence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import ConvergenceError, InputError, MissingDataError
from ..identification import Fit, fit
from ..identification.fit import SCHEMES, evaluate
from ..muscles import law_from_specimen
from ..muscles.laws import LAWS, law_type
from ..quantities import to_si
from ..recordings import ForceMap
from ..specimens import specimen
from .jumping_robot import robot_study
from .muscle_loops import STAGES as LOOP_STAGES
from .muscle_loops import LoopStudy, loop_study
from .validation_sets import Applied, StaticSet, branches_apart, measured_data, static_sets, was_fitted

TRAINED_BELOW = to_si(4.0, "bar", "Pa", field="pressure")
LOOPS, ROBOT = "loops", "robot"
LOOP_FOLDER, ROBOT_FOLDER = "dmsp_10_250_hysteresis", "gtdynamics_jumping_robot"
JUMPS = ("0p02_knee_80psi", "0p06_65psi", "0p09_65psi", "0p12_65psi")
EVALUATIONS = 20  # of the robot's circuit; its errors are those of 40 to three digits


class Unfitted(NamedTuple):
    """A law with numbers from elsewhere on a data set: title, where the numbers are from, errors at the taut points [N]."""

    title: str
    origin: str
    error: np.ndarray

    @property
    def rmse(self) -> float:
        """Root mean square error [N]."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def max_error(self) -> float:
        """Largest error [N]."""
        return float(np.abs(self.error).max())


@dataclass(frozen=True)
class StaticResult:
    """One data set: its points, every law fitted to it, best first, laws applied as they stand, and why one was left out.

    `apart` is half the gap between two measured branches, rms and largest [N].
    """

    of: StaticSet
    points: ForceMap
    fits: list[Fit]
    unfitted: list[Unfitted]
    skipped: dict[str, str]
    apart: tuple[float, float] | None

    def predicted(self, law: str) -> float | None:
        """Rms error of a law with one pressure left out [N], infinite where a fold failed; None if not fitted."""
        for f in self.fits:
            if f.law == law:
                return f.cv_rmse if f.cv_rmse is not None else f.rmse
        return None


def ordered_laws(static: Sequence[StaticResult]) -> list[str]:
    """The laws by the mean logarithm of their share of error with one pressure left out, best first.

    Where one could not be fitted, or errs by more, its error is taken as the largest tension itself.
    """

    def error(law: str) -> float:
        shares = [(one.predicted(law) or math.inf) / one.points.largest for one in static]
        return float(np.mean([math.log(min(s, 1.0)) for s in shares]))

    return sorted(dict.fromkeys(f.law for one in static for f in one.fits), key=error)


class Jump(NamedTuple):
    """One jump of the robot, predicted by a circuit fitted to the others; errors of its pressures [Pa], lead [s]."""

    name: str
    rms: float
    largest: float
    lead: float  # of all channels, that furthest from zero
    rms_others: float  # of the jumps that were fitted
    converged: bool


@dataclass(frozen=True)
class Validation:
    """All that was computed, and the data that were not there (what, file)."""

    static: tuple[StaticResult, ...]
    loops: LoopStudy | None = None
    jumps: tuple[Jump, ...] = ()
    absent: dict[str, str] = field(default_factory=dict)


def names() -> tuple[str, ...]:
    """What can be asked for by name."""
    return (*(s.name for s in static_sets()), LOOPS, ROBOT)


def stages(only: Iterable[str] = (), laws: Iterable[str] = ()) -> int:
    """How often `validation` reports progress at most."""
    chosen, count = _chosen(only), len(tuple(laws) or LAWS)
    more = LOOP_STAGES * (LOOPS in chosen) + len(JUMPS) * (ROBOT in chosen)
    return count * sum(s.name in chosen for s in static_sets()) + more


def validation(
    folder: str | Path | None = None,
    *,
    only: Iterable[str] = (),
    laws: Sequence[str] = (),
    schemes: Sequence[str] = SCHEMES,
    evaluations: int = EVALUATIONS,
    progress: Callable[[str], None] | None = None,
) -> Validation:
    """Hold the laws against the data sets.

    Args:
        folder: of measured data; the one that MCKIBBEN_DATA names where left out. Without either, only what ships is used.
        only: data sets by name, or ``loops``, ``robot``; all of them where left out.
        laws: by name; all of them where left out.
        schemes: cross-validations, as of `identification.fit`.
        evaluations: most of the robot's circuit.
        progress: is told what comes next, at most `stages` times.

    Raises:
        InputError: for an unknown name, a folder that is not there, a file that cannot be read.
    """
    chosen, tell = _chosen(only), progress or (lambda _: None)
    for law in laws:
        law_type(law)  # refuses a wrong word before anything is computed
    data, static = measured_data(folder), []
    absent: dict[str, str] = {}
    for one in static_sets():
        if one.name not in chosen:
            continue
        try:
            points = one.read(data)
        except MissingDataError:
            absent[one.title] = one.file
            continue
        static.append(_static(one, points, laws or tuple(LAWS), schemes, tell))
    loops: LoopStudy | None = None
    jumps: tuple[Jump, ...] = ()
    if LOOPS in chosen:
        if data is not None and (data / LOOP_FOLDER).is_dir():
            loops = loop_study(data / LOOP_FOLDER, progress=lambda words: tell(words))
        else:
            absent["Loop and creep of a DMSP-10-250"] = LOOP_FOLDER
    if ROBOT in chosen:
        if data is not None and (data / ROBOT_FOLDER).is_dir():
            jumps = _jumps(data / ROBOT_FOLDER, evaluations, tell)
        else:
            absent["Jumping robot"] = ROBOT_FOLDER
    return Validation(tuple(static), loops, jumps, absent)


def _chosen(only: Iterable[str]) -> tuple[str, ...]:
    known, wanted = names(), tuple(only)
    for name in wanted:
        if name not in known:
            raise InputError("data set", name, f"known are {', '.join(known)}")
    return wanted or known


def _static(
    one: StaticSet, points: ForceMap, laws: Sequence[str], schemes: Sequence[str], tell: Callable[[str], None]
) -> StaticResult:
    fits, skipped = [], {}
    for law in laws:
        tell(f"{one.name}, {law}")
        try:
            found = fit(law, points, known=one.known, schemes=_told(schemes, points), train_below=TRAINED_BELOW)
        except (InputError, ConvergenceError) as error:
            skipped[law] = str(error)
            continue
        fits.append(found)
    unfitted = [_applied(a, one, points) for a in one.applied if not laws or a.law in laws]
    return StaticResult(one, points, _by_prediction(fits), unfitted, skipped, branches_apart(points))


def _by_prediction(fits: Iterable[Fit]) -> list[Fit]:
    """Best first: by the error of points predicted with their pressure left out, which is what this study asks."""
    return sorted(fits, key=lambda f: (not f.converged, f.cv_rmse if f.cv_rmse is not None else f.rmse))


def _told(schemes: Sequence[str], points: ForceMap) -> tuple[str, ...]:
    """Of several muscles one is left out at a time, and no single length: it is another one for each of them."""
    several = points.rest_length is not None and len(np.unique(points.rest_length)) > 1
    return tuple(s for s in schemes if s not in (("length", "block") if several else ("rest_length",)))


def _applied(applied: Applied, one: StaticSet, points: ForceMap) -> Unfitted:
    """A law of a specimen on the points of a data set, muscle by muscle where it takes their rest lengths."""
    spec = specimen(applied.specimen)
    rests = np.unique(points.rest_length) if applied.scaled and points.rest_length is not None else [None]
    parts = []
    for rest in rests:
        some = points if rest is None else points.select(points.rest_length == rest)
        changes = {} if rest is None else {"rest_length": float(rest), "upper_length": float(some.length.max())}
        parts.append(evaluate(law_from_specimen(spec, applied.law, changes=changes), some))
    title = law_type(applied.law).title
    if not was_fitted(spec.id, applied.law):
        origin = "as published" if one.ships_with == spec.id else f"as published for {spec.id}"
    else:
        origin = f"fitted to the map of {spec.id}" + (", with these rest lengths" if applied.scaled else "")
    return Unfitted(title, origin, np.concatenate(parts))


def _jumps(folder: Path, evaluations: int, tell: Callable[[str], None]) -> tuple[Jump, ...]:
    """Each jump by a fit to the others."""
    found = []
    for name in JUMPS:
        tell(f"{ROBOT}, {name} from the others")
        others = [folder / j for j in JUMPS if j != name]
        fitted, _ = robot_study(others, [folder / name], evaluations=evaluations)
        unseen = [e for e in fitted.errors if not e.fitted]
        found.append(
            Jump(
                name=name,
                rms=fitted.rms(fitted=False),
                largest=max(e.largest for e in unseen),
                lead=max((e.lead for e in unseen if e.lead is not None), key=abs, default=float("nan")),
                rms_others=fitted.rms(),
                converged=fitted.converged,
            )
        )
    return tuple(found)
