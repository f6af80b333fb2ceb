"""Validation of all laws: static data sets, loops and jumps, fits and predictions, and their errors.

Two force maps ship with the package. The others ship with nothing, for their licences do not say that they may: they are
looked for below a folder of measured data, which the environment variable ``MCKIBBEN_DATA`` names.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mckibben.answers import Answer, Table
from mckibben.documents import JsonValue
from mckibben.errors import ConvergenceError, InputError, MissingDataError, not_found
from mckibben.identification import Fit, fit
from mckibben.identification.fit import SCHEMES, evaluate
from mckibben.identification.problem import ErrorMeasures
from mckibben.identification.ranking import COLUMNS
from mckibben.muscles import law_from_specimen
from mckibben.muscles.laws import LAWS, law_type
from mckibben.quantities import from_si, to_si
from mckibben.recordings import ForceMap, read_force_map
from mckibben.specimens import map_file, specimen
from mckibben.verbs import DataFolder, DataSet, LawName, verb

from .jumping_robot import robot_study
from .muscle_loops import STAGES as LOOP_STAGES
from .muscle_loops import LoopStudy, loop_study

VARIABLE = "MCKIBBEN_DATA"
MARTENS = "M. Martens, I. Boblan, Actuators 2017, 6(4), 33, doi:10.3390/act6040033"
AARL = "public repository Agile-and-Adaptive-Robotics/Muscle_Sensory, Portland State University"
NO_LICENCE = "none stated: read, not copied"
PLATEAUS = "aarl_10mm_isometric/quasistatic_plateaus.csv"
AARL_ZERO = to_si(9.2, "kPa", "Pa", field="pressure")  # what the sensor of those runs reads at rest


class Applied(NamedTuple):
    """A law of a specimen that is applied unchanged; `scaled` gives it the muscles' rest lengths.

    One that goes with the length is cut to them; coefficients of one length stay, to show how far they are off.
    """

    specimen: str
    law: str
    scaled: bool = False


class StaticSet(NamedTuple):
    """A static data set: lengths, pressures and tensions of one muscle, or of several of a kind."""

    name: str  # in tables and figures
    title: str
    source: str
    licence: str
    known: Mapping[str, float]  # dimensions of the muscle [SI]
    file: str = ""  # below the folder of measured data; a map that ships has none
    ships_with: str = ""  # the specimen
    rest_length: float | None = None  # of a table without one [m]
    muscle: float | None = None  # keep the muscle of this rest length only [m]
    pressure_zero: float = 0.0  # [Pa]
    applied: tuple[Applied, ...] = ()
    note: str = ""

    def read(self, folder: Path | None) -> ForceMap:
        """Read the points.

        Raises:
            MissingDataError: if the file is not there.
            InputError: names file and column.
        """
        if self.ships_with:
            return read_force_map(map_file(specimen(self.ships_with)), rest_length=self.rest_length)
        if folder is None or not (folder / self.file).is_file():
            raise MissingDataError(f"{self.name}: no {self.file}; {VARIABLE} names the folder of measured data")
        points = read_force_map(folder / self.file, rest_length=self.rest_length, pressure_zero=self.pressure_zero)
        if self.muscle is None:
            return points
        assert points.rest_length is not None
        return points.select(np.isclose(points.rest_length, self.muscle))


def static_sets() -> tuple[StaticSet, ...]:
    """All static data sets, those that ship with the package first."""
    maps = tuple(_map(name) for name in ("DMSP-10-250", "DMSP-20-300"))
    large = specimen("DMSP-20-300")
    sheet = StaticSet(
        name="DMSP-20 sheet",
        title="Festo DMSP-20, the maker's curves",
        source="data sheet of the maker, read off by hand",
        licence=NO_LICENCE,
        known=cross_section("DMSP-20-300"),
        file="festo_datasheet/DMSP-20_force_contraction.csv",
        rest_length=large.property_si("rest_length", "m"),
        applied=tuple(Applied(large.id, law) for law in large.laws),
        note="The curves reach 4 % beyond the rest length, where the map of DMSP-20-300 has no points: there its laws are "
        "asked for more than they were made for.",
    )
    lengths = (0.083, 0.182, 0.281)
    return (*maps, sheet, *(_isometric(length) for length in lengths), _isometric(None))


def measured_data(folder: str | Path | None = None) -> Path | None:
    """Folder of measured data: the given one, else that of the environment variable, else none.

    Raises:
        InputError: if the folder is not there.
    """
    named = folder if folder is not None else os.environ.get(VARIABLE) or None
    if named is None:
        return None
    if not Path(named).is_dir():
        raise not_found(named, "folder", where=None if folder is not None else VARIABLE)
    return Path(named)


def branches_apart(points: ForceMap) -> tuple[float, float] | None:
    """Half of the gap between the rising and the falling branch, rms and largest [N]; None if only one was measured.

    A law without friction lies at best in the middle, so that its error on both branches cannot be smaller. At each
    length the falling branch is read by straight lines between its points.
    """
    if points.branch is None or len(set(points.branch)) < 2:
        return None
    rest = np.zeros(len(points)) if points.rest_length is None else points.rest_length
    gaps = []
    for one in np.unique(np.stack([rest, points.length]), axis=1).T:
        selected = (rest == one[0]) & (points.length == one[1]) & points.taut
        up, down = (points.select(selected & (points.branch == b)) for b in ("inflate", "deflate"))
        if len(down) < 2 or not len(up):
            continue
        order = np.argsort(down.pressure)
        both = (up.pressure >= down.pressure.min()) & (up.pressure <= down.pressure.max())
        falling = np.interp(up.pressure[both], down.pressure[order], down.tension[order])
        gaps.append(0.5 * (falling - up.tension[both]))
    distances = np.concatenate(gaps) if gaps else np.zeros(0)
    return (float(np.sqrt(np.mean(distances**2))), float(np.abs(distances).max())) if len(distances) else None


def _map(name: str) -> StaticSet:
    spec = specimen(name)
    return StaticSet(
        name=name,
        title=spec.title,
        source=MARTENS,
        licence="CC BY 4.0; ships",
        known=cross_section(name),
        ships_with=name,
        rest_length=spec.property_si("rest_length", "m"),
        applied=tuple(Applied(name, law) for law in spec.laws if not was_fitted(name, law)),
    )


def _isometric(muscle: float | None) -> StaticSet:
    which = "all" if muscle is None else f"{muscle * 1e3:.0f} mm"
    return StaticSet(
        name=f"AARL {which}",
        title=f"Festo 10 mm, {'three rest lengths at once' if muscle is None else f'{which} at rest'}",
        source=AARL,
        licence=NO_LICENCE,
        known=cross_section("DMSP-10-250"),
        file=PLATEAUS,
        muscle=muscle,
        pressure_zero=AARL_ZERO,
        applied=(Applied("DMSP-10-250", "hyperelastic_braid", True), Applied("DMSP-10-250", "sarosi", True)),
    )


def cross_section(name: str) -> dict[str, float]:
    """Diameter and wall of a specimen, as its laws take them [m]."""
    spec = specimen(name)
    return {
        "rest_diameter": spec.property_si("rest_inner_diameter", "m"),
        "wall_thickness": spec.property_si("wall_thickness", "m"),
    }


def was_fitted(name: str, law: str) -> bool:
    """Whether the numbers of a specimen's law were fitted by this project, not printed by its source."""
    return any(p.note.startswith("fitted") for p in specimen(name).laws[law].values())


TRAINED_BELOW = to_si(4.0, "bar", "Pa", field="pressure")
LOOPS, ROBOT = "loops", "robot"
LOOP_FOLDER, ROBOT_FOLDER = "dmsp_10_250_hysteresis", "gtdynamics_jumping_robot"
JUMP_TRIALS = ("0p02_knee_80psi", "0p06_65psi", "0p09_65psi", "0p12_65psi")
EVALUATIONS = 40  # of the robot's circuit, as `study robot` has it


@dataclass(frozen=True)
class Unfitted(ErrorMeasures):
    """A law with published parameters on a data set.

    Attributes:
        title: title of the law.
        origin: source of the parameters.
        error: at the taut points [N].
    """

    title: str
    origin: str
    error: np.ndarray


@dataclass(frozen=True)
class StaticResult:
    """Result for a data set: points, fitted laws, best first, published laws, and why a law was left out.

    `apart` is half the gap between two measured branches, rms and largest [N].
    """

    of: StaticSet
    points: ForceMap
    fits: list[Fit]
    unfitted: list[Unfitted]
    skipped: dict[str, str]
    apart: tuple[float, float] | None

    def to_dict(self) -> dict[str, JsonValue]:
        """The data set, its fits and what was applied unfitted, as plain values [SI]."""
        return {
            "name": self.of.name,
            "title": self.of.title,
            "source": self.of.source,
            "licence": self.of.licence,
            "points": len(self.points),
            "taut": int(self.points.taut.sum()),
            "largest_tension": self.points.largest,
            "branches_apart": None
            if self.apart is None
            else {"half_rms": self.apart[0], "half_largest": self.apart[1]},
            "fits": [f.to_dict() for f in self.fits],
            "unfitted": [
                {"law": u.title, "origin": u.origin, "rmse": u.rmse, "max_error": u.max_error} for u in self.unfitted
            ],
            "skipped": self.skipped,
        }

    def table(self) -> Table:
        """The fitted laws with their errors, then those with published numbers."""
        largest = self.points.largest
        rows: list[dict[str, Any]] = [
            {"law": u.title, "free": 0, "rmse": u.rmse, "share": u.max_error / largest, "verdict": u.origin}
            for u in self.unfitted
        ]
        fitted: list[dict[str, Any]] = []
        for f in self.fits:
            errors = {"rms_out": f.cv_rmse, "pressure_share": f.cv_max_error}
            errors |= {"share": f.max_error, "above_share": f.holdout.max_error if f.holdout else None}
            row = {key: None if error is None else error / largest for key, error in errors.items()}
            verdict = "" if f.converged else "did not converge"
            fitted.append(row | {"law": f.law, "free": len(f.parameters), "rmse": f.rmse, "verdict": verdict})
        out = replace(COLUMNS["pressure_share"], key="rms_out", title="pressure out, rms")
        above = replace(COLUMNS["above_share"], title="above 4 bar")
        first = (COLUMNS[key] for key in ("law", "free", "rmse", "share"))
        title = f"{self.of.title}: {int(self.points.taut.sum())} points with tension, largest {largest:.1f} N"
        return Table(title, (*first, out, COLUMNS["pressure_share"], above, COLUMNS["verdict"]), [*fitted, *rows])

    def predicted(self, law: str) -> float | None:
        """Rms error of a law with one pressure left out [N], infinite if a fold failed; None if not fitted."""
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
    """A jump of the robot, predicted by a circuit fitted to the others; errors of its pressures [Pa], lead [s]."""

    name: str
    rms: float
    largest: float
    lead: float  # of all channels, that furthest from zero
    rms_others: float  # of the jumps that were fitted
    converged: bool


@dataclass(frozen=True)
class Validation(Answer):
    """All results, and the missing data (name, file)."""

    static: tuple[StaticResult, ...]
    loops: LoopStudy | None = None
    jumps: tuple[Jump, ...] = ()
    absent: dict[str, str] = field(default_factory=dict)

    def to_dict(self) -> dict[str, JsonValue]:
        """All results as plain values [SI]."""
        return {
            "static": [one.to_dict() for one in self.static],
            "loops": self.loops.to_dict() if self.loops else None,
            "jumps": [j._asdict() for j in self.jumps],
            "absent": self.absent,
        }

    def tables(self) -> list[Table]:
        """One table per data set of static points."""
        return [one.table() for one in self.static]

    def remarks(self) -> list[str]:
        """Errors of loops and jumps, and the data that are not at hand."""
        said = []
        if self.loops:
            missed = 100.0 * abs(self.loops.worst.error)
            said.append(f"Loop of a DMSP-10-250: width of the unseen loop off by at most {missed:.1f} % mid-range")
        said += [f"Jump {j.name} from the others: {from_si(j.rms, 'Pa', 'mbar'):.0f} mbar rms" for j in self.jumps]
        return said + [f"not at hand: {name} ({file})" for name, file in self.absent.items()]


def names() -> tuple[str, ...]:
    """Names of the available parts."""
    return (*(s.name for s in static_sets()), LOOPS, ROBOT)


def stages(only: Iterable[str] = (), laws: Iterable[str] = ()) -> int:
    """Largest number of progress reports of `validation`."""
    chosen, count = _chosen(only), len(tuple(laws) or LAWS)
    more = LOOP_STAGES * (LOOPS in chosen) + len(JUMP_TRIALS) * (ROBOT in chosen)
    return count * sum(s.name in chosen for s in static_sets()) + more


@verb
def validation(
    folder: DataFolder | None = None,
    *,
    only: Sequence[DataSet] | None = None,
    laws: Sequence[LawName] | None = None,
    schemes: Sequence[str] | None = None,
    evaluations: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Validation:
    """Fit every tension law to every data set, and cross-validate it.

    With all data it takes a quarter of an hour or more, two minutes of it for the robot. Data sets that
    are not at hand are named.

    Args:
        folder: folder of measured data; by default the one that MCKIBBEN_DATA names. Without either, what ships is used.
        only: data set, such as DMSP-20-300, loops or robot; all by default.
        laws: law to fit; all laws by default.
        schemes: cross-validations, as of `identification.fit`.
        evaluations: most of the robot's circuit.
        progress: called with a description of the next stage, at most `stages` times.

    Raises:
        InputError: for an unknown name, a folder that is not there, a file that cannot be read.
    """
    chosen, tell = _chosen(only or ()), progress or (lambda _: None)
    schemes, evaluations = SCHEMES if schemes is None else schemes, evaluations or EVALUATIONS
    for law in laws or ():
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
            loops = loop_study(data / LOOP_FOLDER, progress=tell)
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
            raise InputError("data set", name, known=known)
    return wanted or known


def _static(
    one: StaticSet, points: ForceMap, laws: Sequence[str], schemes: Sequence[str], tell: Callable[[str], None]
) -> StaticResult:
    fits, skipped = [], {}
    # of several muscles one is left out at a time, since their lengths differ
    several = points.rest_length is not None and len(np.unique(points.rest_length)) > 1
    told = tuple(s for s in schemes if s not in (("length", "block") if several else ("rest_length",)))
    for law in laws:
        tell(f"{one.name}, {law}")
        try:
            result = fit(law, points, known=one.known, schemes=told, train_below=TRAINED_BELOW)
        except (InputError, ConvergenceError) as error:
            skipped[law] = str(error)
            continue
        fits.append(result)
    unfitted = [_applied(a, one, points) for a in one.applied if not laws or a.law in laws]
    fits.sort(key=lambda f: (not f.converged, f.cv_rmse if f.cv_rmse is not None else f.rmse))
    return StaticResult(one, points, fits, unfitted, skipped, branches_apart(points))


def _applied(applied: Applied, one: StaticSet, points: ForceMap) -> Unfitted:
    """Errors of a specimen's law on the points of a data set, muscle by muscle if it is scaled."""
    spec = specimen(applied.specimen)
    rests = np.unique(points.rest_length) if applied.scaled and points.rest_length is not None else [None]
    parts = []
    for rest in rests:
        some = points if rest is None else points.select(points.rest_length == rest)
        changes = {} if rest is None else {"rest_length": float(rest), "upper_length": float(some.length.max())}
        cut = changes if law_type(applied.law).any_length else {}
        law = law_from_specimen(spec, applied.law, changes=cut).replace(**changes)
        parts.append(evaluate(law, some))
    title = law_type(applied.law).title
    if not was_fitted(spec.id, applied.law):
        origin = "as published" if one.ships_with == spec.id else f"as published for {spec.id}"
    else:
        origin = f"fitted to the map of {spec.id}" + (", with these rest lengths" if applied.scaled else "")
    return Unfitted(title, origin, np.concatenate(parts))


def _jumps(folder: Path, evaluations: int, tell: Callable[[str], None]) -> tuple[Jump, ...]:
    """Predict each jump by a fit to the others."""
    jumps = []
    for name in JUMP_TRIALS:
        tell(f"{ROBOT}, {name} from the others")
        others = [folder / j for j in JUMP_TRIALS if j != name]
        fitted, _ = robot_study(others, [folder / name], evaluations=evaluations)
        unseen = [e for e in fitted.errors if not e.fitted]
        jumps.append(
            Jump(
                name=name,
                rms=fitted.rms(fitted=False),
                largest=max(e.largest for e in unseen),
                lead=max((e.lead for e in unseen if e.lead is not None), key=abs, default=float("nan")),
                rms_others=fitted.rms(),
                converged=fitted.converged,
            )
        )
    return tuple(jumps)
