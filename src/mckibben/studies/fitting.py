"""Fits as questions: laws to measured tables, and a friction with memory to a loop; each with samples of its posterior."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

from .. import muscles, verbs
from ..accessors import implementation
from ..answers import Answer, Caution, Table, collect, estimates
from ..bench import rig_file
from ..bench.rig import Rig
from ..documents import JsonValue
from ..errors import InputError
from ..identification.fit import Fit, checked_length_error
from ..identification.hysteresis_fit import MODELS, SMOOTH, LoopFit, fit_loop, fit_loops
from ..identification.path_record import read_path
from ..identification.posterior import MapSensors, Posterior, check_draws
from ..identification.ranking import Ranking, load_table
from ..identification.ranking import fit as fit_laws
from ..identification.record_posterior import RecordPosterior
from ..identification.shared_hysteresis import read_recordings
from ..muscles.laws import LAWS, law_type
from ..quantities import declared, parse, with_unit
from ..recordings import ForceMap
from ..registry import named_by_person
from ..specimens import Specimen, muscle_specimen

ALL = "all"


@dataclass(frozen=True)
class FittedTables(Answer):
    """Laws that were fitted to measured tables, ranked for each: what `fit_tables` computes.

    Attributes:
        rankings: one for each table, or one of all runs of a muscle.
        posteriors: samples by the law, for each ranking; empty where none were asked for.
        cautions: about the tables: unusual pressures, and rows that were left out.
    """

    rankings: tuple[Ranking, ...]
    posteriors: tuple[Mapping[str, Posterior], ...] = ()
    cautions: tuple[Caution, ...] = ()

    units: ClassVar[Mapping[str, str]] = Ranking.units

    def to_dict(self) -> dict[str, JsonValue]:
        """The ranking of the one table, or several as ``maps``; samples beside the fits of their laws."""
        found = []
        for i, ranking in enumerate(self.rankings):
            content: dict[str, Any] = ranking.to_dict() | {"warnings": [one.text for one in ranking.cautions]}
            for one in content["fits"] if self.posteriors else ():
                if one["law"] in self.posteriors[i]:
                    one["posterior"] = self.posteriors[i][one["law"]].to_dict()
            found.append(content)
        return found[0] if len(found) == 1 else {"maps": found}

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per table and law."""
        return [row for ranking in self.rankings for row in ranking.rows()]

    def tables(self) -> list[Table]:
        """The tables of each ranking, and of its posteriors."""
        found: list[Table] = []
        for i, ranking in enumerate(self.rankings):
            samples = self.posteriors[i].values() if self.posteriors else ()
            found += [*ranking.tables(), *(table for one in samples for table in one.tables())]
        return found

    def remarks(self) -> list[str]:
        """What the laws assumed, which were left out, and where the data are from, each once."""
        return [*dict.fromkeys(said for ranking in self.rankings for said in ranking.remarks())]

    def bands(self) -> Posterior | None:
        """The samples of the best law of the one table, whose figure is that of the answer; None where there are others."""
        return self.posteriors[0][self.rankings[0].best.law] if len(self.posteriors) == 1 else None

    def report(self, path: str | Path) -> Path:
        """Write a report with tables and figures to an ``.html`` or ``.pdf`` file; returns its path."""
        return Path(implementation("write_fit_report")(self.rankings, Path(path)))


@verbs.verb
def fit_tables(
    *tables: verbs.MeasuredTable,
    rig: verbs.RigName | None = None,
    law: Sequence[verbs.LawName] | None = None,
    rest_length: verbs.Length | None = None,
    like: verbs.MuscleName | None = None,
    known: verbs.Changes | None = None,
    read: verbs.MapReading | None = None,
    slack: bool = True,
    train_below: verbs.Pressure | None = None,
    posterior: bool = False,
    draws: verbs.Count = 2000,
    runs: bool = False,
    length_error: verbs.SmallLength | None = None,
    hysteresis: verbs.RecordFiles | None = None,
    progress: Callable[[str], None] | None = None,
) -> FittedTables:
    """Fit tension laws to a measured table of length, pressure and tension, and rank them.

    Args:
        tables: tables of any format, specimens that ship with a force map, or a .toml file of constraints.
        rig: test machine whose sensors measured the table, for their noise.
        law: law to fit, or one of your own as my.py:MyLaw; 'all', and by default, all laws.
        rest_length: rest length of the muscle [m], such as '300 mm'.
        like: take known dimensions from this specimen.
        known: known parameter that is not fitted, such as wall_thickness='1.8 mm'.
        read: how the file of another program is understood: parameters of `describe_file`.
        slack: use slack points to say where a law may not pull.
        train_below: also fit up to this gauge pressure [Pa], such as '4 bar', and predict the points above it.
        posterior: draw from the posterior of the best law, or of each of several named laws: joint intervals, and bands
            that allow for a law that is wrong.
        draws: number of samples of the posterior.
        runs: fit the tables together, as runs of one muscle; each run has an error.
        length_error: standard deviation of the error of each set length [m], such as '0.5 mm', to find these errors too.
        hysteresis: recordings of the same muscles in motion, a folder of them, or a quoted pattern: also fit one friction
            with memory and one creep of all muscles, as far as these tell of them.
        progress: called with a few words after each piece of work.

    Raises:
        InputError: a table cannot be read, is too small, or lacks what a law that was named needs.
        ConvergenceError: samples are asked for of a fit that did not converge.
        MissingLibraryError: samples need NumPyro, which the extra ``posterior`` brings.

    Examples:
        >>> from mckibben.studies.fitting import fit_tables
        >>> answer = fit_tables("DMSP-20-300", law=["ideal"])
        >>> [row["law"] for row in answer.rows()]
        ['ideal']
    """
    if posterior:
        check_draws(draws)
    elif rig is not None:
        raise InputError("rig", str(rig), "is allowed only with {posterior=True}")
    if not tables:
        raise InputError("tables", None, "must be one table or more")
    if hysteresis and len(tables) > 1 and not runs:
        problem = "is allowed only with one table, which may hold several muscles, or {runs=True}"
        raise InputError("hysteresis", None, problem)
    if runs and len(tables) < 2:
        raise InputError("runs", None, "is allowed only with two tables or more")
    checked_length_error(length_error)
    zero = 0.0 if (read or {}).get("pressure_zero") is None else float((read or {})["pressure_zero"])
    reading: dict[str, Any] = {**(read or {}), "pressure_zero": zero}
    recordings = read_recordings(hysteresis, pressure_zero=zero) if hysteresis else None
    loaded = [load_table(table, rest_length=rest_length, like=like, **reading) for table in tables]
    if runs:
        loaded = [(ForceMap.joined([points for points, _ in loaded], f"{len(loaded)} runs"), loaded[0][1])]
    named_by_person(*(law or ()))
    every, named = not law or ALL in law, [name for name in law or () if name != ALL]
    laws = [*LAWS, *named] if every else named
    units = {key: q.unit for name in laws for key, q in declared(law_type(name)).items()}
    stated = {name: _stated(name, value, units) for name, value in (known or {}).items()}
    rankings: list[Ranking] = []
    for points, spec in loaded:
        found = fit_laws(
            points,
            None if every else named,
            beside=named if every else (),
            like=spec,
            known=stated,
            train_below=train_below,
            slack=slack,
            length_error=length_error,
            hysteresis=recordings,
            progress=progress,
        )
        unusual = muscles.plausible.pressure_caution(float(points.pressure.max()), spec)
        said = (*points.remarks, *(() if unusual is None else (unusual.text,)))
        about = (Caution(f"{points.name}: {one}") for one in said)
        rankings.append(replace(found, cautions=collect(*about, found.doubt())))
    samples: list[Mapping[str, Posterior]] = []
    if posterior:
        sensors = None if rig is None else map_sensors(rig if isinstance(rig, Rig) else rig_file.rig(rig))
        samples = [_posteriors(one, sensors, draws, every=len(law or ()) > 1, progress=progress) for one in rankings]
    return FittedTables(
        tuple(rankings), tuple(samples), collect(*(caution for one in rankings for caution in one.cautions))
    )


def map_sensors(rig: Rig) -> MapSensors:
    """Standard uncertainties of a value that a rig's sensors have read once.

    A count of a converter or an encoder adds the standard deviation of its rounding, 1/sqrt(12) of it.
    """
    rounding = 12.0**-0.5
    noise = {name: math.hypot(float(one.noise), rounding * float(one.resolution)) for name, one in rig.sensors.items()}
    for name in ("tension", "pressure"):
        if name not in noise:
            raise InputError("rig", rig.name, f"has no sensor of the {name}")
    length = 0.0 if rig.encoder is None else rounding * float(rig.encoder.resolution)
    return MapSensors(tension=noise["tension"], pressure=noise["pressure"], length=length)


def _posteriors(
    ranking: Ranking,
    sensors: MapSensors | None,
    draws: int,
    *,
    every: bool,
    progress: Callable[[str], None] | None = None,
) -> dict[str, Posterior]:
    """Samples of the best law of a table, or of every law that converged; what least squares say is told before."""

    def sampled(fit: Fit) -> Posterior:
        if progress is not None:
            ends = [(name, *(with_unit(x, e.unit, 3) for x in (e.low, e.high))) for name, e in fit.parameters.items()]
            said = ", ".join(f"{name} {low} to {high}" for name, low, high in ends)
            progress(f"samples of {fit.law}; by least squares alone {said}")
        return fit.posterior(sensors=sensors, slack=slack if len(slack) else None, draws=draws)

    slack = ranking.points.select(ranking.points.informative_slack)
    fits: list[Fit] = [f for f in ranking.fits if f.converged or f is ranking.best] if every else [ranking.best]
    return {f.law: sampled(f) for f in fits}


def _stated(name: str, value: float | str, units: Mapping[str, str]) -> float:
    """A value of one of some parameters [SI]."""
    if name not in units:
        raise InputError(f"known.{name}", value, known=sorted(units))
    return parse(value, units[name], field=f"known.{name}", bare=True) if isinstance(value, str) else float(value)


@dataclass(frozen=True)
class FittedFriction(Answer):
    """A friction with memory that was fitted to a loop: what `fit_friction` computes.

    Attributes:
        fit: the friction, its curve and its prediction.
        name: of the loop.
        samples: of its posterior; None where none were asked for.
        cautions: about the fit.
    """

    fit: LoopFit
    name: str
    samples: RecordPosterior | None = None
    cautions: tuple[Caution, ...] = field(default=())

    def to_dict(self) -> dict[str, JsonValue]:
        """Parameters with their intervals, the curve, errors of the stroke [m] and samples."""
        found = self.fit
        return {
            "friction": found.model,
            "parameters": {name: e._asdict() for name, e in found.parameters.items()},
            "known": found.known,
            "curve": found.curve.tolist(),
            "rmse": found.rmse(seen=True),
            "max_error": found.max_error(seen=True),
            "n": len(found.record.stroke),
            "converged": found.converged,
            "warnings": list(found.warnings),
            "posterior": None if self.samples is None else self.samples.to_dict(),
        }

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per parameter."""
        return [{"parameter": name} | e._asdict() for name, e in self.fit.parameters.items()]

    def tables(self) -> list[Table]:
        """The parameters with the errors of the stroke below, and the samples."""
        found = self.fit
        title = f"{self.name}: {found.model}, {len(found.record.stroke)} samples of a loop"
        errors = [with_unit(value, "m", 3) for value in (found.rmse(seen=True), found.max_error(seen=True))]
        said = (f"Error of the stroke: {errors[0]} rms, {errors[1]} at most.",)
        samples = [] if self.samples is None else self.samples.tables("the friction")
        return [estimates(title, found.parameters, said), *samples]


@verbs.verb
def fit_friction(
    loop: verbs.LoopFile,
    *,
    model: verbs.FrictionModel,
    creep: bool = False,
    like: verbs.MuscleName | None = None,
    law: verbs.LawName | None = None,
    known: verbs.Changes | None = None,
    read: verbs.PathReading | None = None,
    posterior: bool = False,
    draws: verbs.Count = 2000,
) -> FittedFriction:
    """Fit a friction with memory to a loop of pressure and stroke.

    Args:
        loop: file of any format with a loop of pressure and stroke, or of pressure and length.
        model: fit a friction with memory to a loop of pressure and stroke instead: bouc_wen, dahl, maxwell_slip or all of
            those without kinks, of which the best is taken.
        creep: fit creep beside the friction, from the times of the samples.
        like: balance the loop by the law of this specimen, not by a smooth curve.
        law: law of that specimen; its default where left out.
        known: known parameter that is not fitted, such as stiffness='20 N/mm'.
        read: how the file of another program is understood: parameters of `describe_file`.
        posterior: draw from the posterior of the parameters.
        draws: number of samples of the posterior.

    Raises:
        InputError: the file holds no loop, or a name is unknown.
        ConvergenceError: the fit ended where it began, or samples are asked for of one that did not converge.
        MissingLibraryError: samples need NumPyro, which the extra ``posterior`` brings.
    """
    if posterior:
        check_draws(draws)
    reading = {key: value for key, value in (read or {}).items() if value is not None}
    record = read_path(loop, timed=creep, **reading)
    if model not in (*MODELS, ALL):
        raise InputError("model", model, known=[*MODELS, ALL])
    named = MODELS if model == ALL else {model: MODELS[model]}
    units = {name: free.unit for _, every in named.values() for name, free in every.items()}
    units |= {"load": "N", "start_length": "m", "spring": "N/m", "pressure_zero": "Pa", "creep": "N/m"}
    # NaN frees what is zero by default
    stated = {"creep": float("nan")} if creep else {}
    stated |= {name: _stated(name, value, units) for name, value in (known or {}).items()}
    if like is None and law is not None:
        raise InputError("law", None, "is allowed beside {model} only with {like}, the specimen that has it")
    spec = like if like is None or isinstance(like, Specimen) else muscle_specimen(like)
    balance = None if spec is None else muscles.build.law_from_specimen(spec, law)
    if model == ALL:
        found = fit_loops(record, models=SMOOTH, law=balance, known=stated)[0]
    else:
        found = fit_loop(record, model=model, law=balance, known=stated)
    samples = found.posterior(draws=draws) if posterior else None
    return FittedFriction(found, Path(str(loop)).name, samples, tuple(Caution(one) for one in found.warnings))
