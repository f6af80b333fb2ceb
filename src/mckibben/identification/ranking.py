"""Laws that were fitted to one table, ranked: one value for tables, figures and reports; and the verb that makes it."""

from __future__ import annotations

import inspect
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, overload

import numpy as np

from ..accessors import Accessor, implementation
from ..answers import Answer, Caution, Column, Table, collect, estimates, warn
from ..citations import reference
from ..documents import JsonValue, path_text
from ..errors import InputError
from ..extras import library
from ..muscles.build import law_from_specimen
from ..muscles.law import TensionLaw
from ..muscles.laws import LAWS, law_key, law_type
from ..quantities import declared, in_si, named_values, with_unit
from ..recordings import ForceMap, read_force_map
from ..registry import is_reference, named_by_person
from ..specimens import Specimen, find_specimen, map_file, muscle_specimen, save_specimen
from .fit import Fit, bound_of, degenerate_words, evaluate, fit_all, fitted_specimen
from .fit import fit as fit_law

if TYPE_CHECKING:
    import pandas

    from ..accessors import RankingPlots
    from ..recordings import Recording
    from .shared_hysteresis import Source

MeasuredTable = ForceMap | str | os.PathLike[str]

# Open-access tables that ship with the package, by the key of their paper.
ATTRIBUTIONS = {"martens2017": "M. Martens, I. Boblan, Actuators 2017, 6(4), 33, CC BY 4.0"}
SCHEMES = {"pressure": "pressure", "length": "length", "block": "block", "rest_length": "muscle"}
ERRS = 0.2  # of the largest tension: a prediction that errs by more does not extrapolate


def _error(key: str, title: str) -> Column:
    """Column of an error [N]."""
    return Column(key, title, "N", places=".2f", missing="-", failed="fails", beside=True)


def _share(key: str, title: str) -> Column:
    """Column of an error as a share of the largest tension."""
    return Column(key, title, "1", shown="%", places=".2f", missing="-", failed="fails", most=1.0, beside=True)


# Columns of a ranking by the keys of `Ranking.ranked`: how each of its numbers is read wherever it is shown.
COLUMNS = {
    one.key: one
    for one in (
        Column("law"), Column("title", "law"), Column("place", "", right=True), Column("free", right=True),
        _error("rmse", "rmse"), _error("max_error", "largest"), _share("share", "largest"),
        _error("left_out_rmse", "left out, rms"), _share("left_out_share", "left out"),
        _share("score", "left out, rms"),
        *(_error(f"{key}_rmse", f"{word} out, rms") for key, word in SCHEMES.items()),
        *(_share(f"{key}_share", f"{word} out") for key, word in SCHEMES.items()),
        _error("above_rmse", "above, rms"), _share("above_share", "above"),
        Column("aicc", "AICc", "1", places=".1f", missing="-"),
        Column("distance", "\u0394AICc", "1", places=".1f", missing="-", failed="-"), Column("verdict", ""),
    )
}  # fmt: skip
CHECKS = ("converged", "determined", "misses", "unchecked")  # of a fit, beside its numbers
FIRST = ("law", "free", "rmse", "share")  # columns that a table has whatever was asked for
LEFT_OUT = ("score", *(f"{key}_share" for key in SCHEMES), "above_share")
SHOWN = (*FIRST, *LEFT_OUT, "aicc", "verdict")


@dataclass(frozen=True, repr=False)
class Ranking(Answer):
    """One table of length, pressure and tension, and every law that was fitted to it, best first.

    Attributes:
        title: of the muscle, or of the table.
        specimen: whose known dimensions were used, if any.
        points: the table.
        fits: one per law, ranked by how well they predict points that were left out, see `rank`.
        published: laws with printed coefficients: title, and error at the taut points [N].
        skipped: why a law could not be fitted, by its name.
        cautions: about the table: unusual pressures, and rows that were left out.

    Examples:
        >>> import mckibben as mk
        >>> ranking = mk.fit("DMSP-20-300", law=["ideal", "sarosi"], schemes=())
        >>> ranking.best.law, len(ranking)
        ('sarosi', 2)
        >>> ranking.best.muscle
        Muscle('fitted', sarosi, 30 cm at rest)
    """

    title: str
    specimen: Specimen | None
    points: ForceMap
    fits: list[Fit]
    published: list[tuple[str, np.ndarray]] = field(default_factory=list)
    skipped: dict[str, str] = field(default_factory=dict)
    cautions: tuple[Caution, ...] = ()

    units: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("rmse", "max_error", "left_out_rmse", "left_out_max_error", "cv_rmse", "cv_max_error"), "N"
    )
    plot: ClassVar[Accessor[RankingPlots]] = Accessor("RankingPlots")

    @property
    def best(self) -> Fit:
        """The fit that predicts points that were left out best; where none were, that with the least AICc."""
        return self.fits[0]

    def __len__(self) -> int:
        return len(self.fits)

    def __iter__(self) -> Iterator[Fit]:
        return iter(self.fits)

    def __getitem__(self, law: str) -> Fit:
        """The fit of a law, by its name."""
        for fitted in self.fits:
            if fitted.law == law:
                return fitted
        if law in self.skipped:
            raise InputError("law", law, self.skipped[law])
        raise InputError("law", law, known=[fitted.law for fitted in self.fits])

    def __repr__(self) -> str:
        return f"Ranking({self.title!r}, {len(self)} laws, best {self.best.law}: rmse {self.best.rmse:.3g} N)"

    def to_dict(self) -> dict[str, JsonValue]:
        """Every fit, published law and skipped law as plain values [SI], for JSON."""
        return {
            "map": self.points.name,
            "fits": [f.to_dict() for f in self.fits],
            "published": [
                {"law": title, "rmse": float((error**2).mean() ** 0.5), "max_error": float(abs(error).max())}
                for title, error in self.published
            ],
            "skipped": self.skipped,
            "largest_tension": self.points.largest,
        }

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per fitted law: errors [N], criterion, and its parameters in words."""
        return [
            {
                "table": self.title,
                **{name: getattr(f, name) for name in ("law", *self.units, "aicc", *CHECKS)},
                "parameters": [f"{name} = {with_unit(e.value, e.unit)}" for name, e in f.parameters.items()],
            }
            for f in self.fits
        ]

    def ranked(self) -> list[dict[str, Any]]:
        """One row per law, best first, and published ones below, by the keys of `COLUMNS`: what every face shows.

        Errors in N, shares of the largest tension; infinite where a prediction failed, missing where none was asked for.
        """
        largest, fitted = self.points.largest, [f.aicc for f in self.fits if f.converged]
        rows: list[dict[str, Any]] = []
        for place, f in enumerate(self.fits, 1):
            row: dict[str, Any] = {"law": f.law, "title": law_title(f), "place": place if f.converged else "-"}
            row |= {"free": len(f.parameters), "aicc": f.aicc, "verdict": "; ".join(verdict(f, largest)), "fit": f}
            row |= {"distance": f.aicc - min(fitted, default=math.nan)}
            predicted = {key: (of.rmse, of.max_error) for key, of in f.cross.items()}
            if f.left_out_rmse is not None and f.left_out_max_error is not None:
                predicted["left_out"] = f.left_out_rmse, f.left_out_max_error
            if f.holdout is not None:
                predicted["above"] = f.holdout.rmse, f.holdout.max_error
            for key, (rms, most) in predicted.items():
                errors = (rms, most / largest)
                row |= zip((f"{key}_rmse", f"{key}_share"), (e if e == e else math.inf for e in errors), strict=True)
            row["score"] = None if f.left_out_rmse is None else f.left_out_rmse / largest
            rows.append(row | {"rmse": f.rmse, "max_error": f.max_error, "share": f.max_error / largest})
        for title, error in self.published:
            rms, most = float((error**2).mean() ** 0.5), float(abs(error).max())
            row = {"law": title, "title": title, "free": 0, "rmse": rms, "max_error": most, "share": most / largest}
            rows.append(row | {"verdict": "not fitted here"})
        return rows

    def tables(self) -> list[Table]:
        """The ranking, the parameters of the best law, errors of set lengths, and what recordings tell of hysteresis."""
        best, ranked, n = self.best, self.ranked(), int(self.points.taut.sum())
        heading = f"{self.title}: {n} points with tension, largest {self.points.largest:.1f} N"
        columns = [
            COLUMNS[key]
            for key in SHOWN
            if key in FIRST or any(row.get(key) not in (None, "", "not fitted here") for row in ranked)
        ]
        by = "AICc, as nothing was left out" if all(f.left_out_rmse is None for f in self.fits) else "left out, rms"
        counted = f"ranked by {by}; a parameter at its bound, or not in the data, is not counted"
        below = (counted,) if len(self.fits) > 1 else ()
        at_bound = {n: best.parameters[n]._replace(value=bound_of(best, n)) for n in best.at_bound}
        bounds = dict.fromkeys(at_bound, "at its bound")
        notes = [f"note: {best.law}: {one}" for one in cautions_of(best, self.points.largest, alone=False)]
        # what the verdicts of others say is not said once more
        notes += [f"note: {f.law}: did not converge: {f.message}" for f in self.fits[1:] if not f.converged]
        if best.effective is not None:
            notes.insert(0, f"{best.effective:.1f} of these are determined by the data rather than their priors")
        found = [
            Table(f"{heading}; errors are the largest, of that", tuple(columns), ranked, below),
            estimates(best.law, best.parameters | at_bound, () if best.length_errors else notes, more=bounds),
        ]
        if best.length_errors:
            ends = (Column(key, title, "m", "mm", "+.2f") for key, title in
                    (("added", "added"), ("low", "95 %: from"), ("high", "to")))  # fmt: skip
            lengths = (
                Column("rest_length", unit="m", shown="mm", places=".6g"),
                Column("length", "set to", "m", "mm", ".6g"),
            )
            rows = [error._asdict() for error in best.length_errors]
            found.append(Table("Errors of the set lengths", (*lengths, *ends), rows, tuple(notes)))
        found += [] if best.hysteresis is None else best.hysteresis.tables()
        return found + self._inseparable()

    def _inseparable(self) -> list[Table]:
        """Parameters that the data do not tell apart, of all laws; no table where they tell all."""
        rows: list[dict[str, Any]] = [
            {"law": f.law, "parameters": ", ".join(names), "correlation": correlation}
            for f in self.fits
            for names, correlation in f.inseparable
        ]
        undetermined = Column("correlation", "largest correlation", "1", places="+.4f", missing="not determined")
        said = "trust what such a law predicts near the data, not these values"
        title = "Parameters that the data do not tell apart"
        return [Table(title, (Column("law"), Column("parameters"), undetermined), rows, (said,))] if rows else []

    def remarks(self) -> list[str]:
        """Sizes that laws took from their defaults, laws that were left out, and where the data are from."""
        said = assumptions(self.fits)
        short = [name for name, why in self.skipped.items() if f"law {name} needs the rest length" in why]
        said += [f"left out without {{rest_length}}, or a column rest_length: {', '.join(short)}"] if short else []
        said += [f"left out: {name}: {why}" for name, why in self.skipped.items() if name not in short]
        sources = [ATTRIBUTIONS[key] for key in getattr(self.specimen, "sources", ()) if key in ATTRIBUTIONS]
        return said + ([f"data: {'; '.join(sources)}"] if sources else [])

    def data_source(self) -> str:
        """Who measured the table, and its licence; empty where no specimen ships with it."""
        keys = getattr(self.specimen, "sources", ())
        noted = [ATTRIBUTIONS[key] for key in keys if key in ATTRIBUTIONS]
        return "" if self.specimen is None else "; ".join(noted or [reference(self.specimen.source())])

    def papers(self) -> list[str]:
        """Keys of the papers that the table and its laws rest on."""
        of_laws = (key for f in self.fits for key in law_type(f.law).cites)
        return [*dict.fromkeys((*getattr(self.specimen, "sources", ()), *of_laws))]

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per law, best first: number of parameters, errors [N], criterion and what was checked.

        Raises:
            MissingLibraryError: pandas is not installed; it comes with the extra ``data``.
        """
        names = ("law", *self.units, "aicc", "n", *CHECKS)
        rows = [{name: row[name] for name in names} | {"parameters": len(row["parameters"])}
                for row in map(Fit.to_dict, self.fits)]  # fmt: skip
        frame: pandas.DataFrame = library("pandas", "Data frames need").DataFrame(rows)
        return frame.set_index("law")

    def report(self, path: str | os.PathLike[str]) -> Path:
        """Write a report with tables and figures to an ``.html`` or ``.pdf`` file; returns its path."""
        return Path(implementation("write_fit_report")([self], Path(path)))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the fitted laws as a specimen, a ``.toml`` file that every command takes; returns its path.

        The first law is the one that is used where none is named. The file says of each law that was not checked, or that
        misses what was left out, that it is so, and of the first a `PlausibilityWarning` does where a check was asked for.

        Raises:
            ConvergenceError: no fit converged.
        """
        path = Path(path)
        name = re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-.") or "fitted"
        heading = f"fitted by mckibben {version('mckibben')} to {self.points.name}, {datetime.now(UTC):%Y-%m-%d}"
        made = self.to_specimen(name)
        laws, errors = (
            {_law_key_beside(path, law): numbers for law, numbers in group.items()}
            for group in (made.laws, made.errors)
        )
        made = replace(made, law=_law_key_beside(path, made.law), laws=laws, errors=errors)
        save_specimen(made, path, heading=heading)
        warn(collect(self.doubt()))
        return path

    def doubt(self) -> Caution | None:
        """Caution where a check speaks against the law that a file takes, or failed; None where nobody asked for one."""
        return next((f.caution for f in self.fits if f.converged), None)

    def saved_laws(self) -> str:
        """Which laws a saved file holds, which of them it takes, and which passed no check; empty where there is one."""
        named: list[str] = []
        for f in self.fits:
            doubt = "misses what was left out" if f.misses else "could not be checked" if f.unchecked else ""
            named += [f"{f.law} ({doubt})" if f.cross and doubt else f.law] if f.converged else []
        if len(named) < 2:
            return ""
        return f"its law is {named[0]}, the first of the ranking; {{law}} takes another: {', '.join(named[1:])}"

    def to_specimen(self, name: str = "fitted") -> Specimen:
        """The fitted laws as a specimen; raises `ConvergenceError` if no fit converged."""
        return fitted_specimen(self.fits, self.specimen, name=name)


@overload
def fit(table: MeasuredTable, law: str | type[TensionLaw], **options: JsonValue) -> Fit: ...
@overload
def fit(table: MeasuredTable, law: Iterable[str | type[TensionLaw]] | None = None, **options: JsonValue) -> Ranking: ...
@overload
def fit(table: str, law: ForceMap, **options: JsonValue) -> Fit: ...
def fit(
    table: MeasuredTable,
    law: str | type[TensionLaw] | Iterable[str | type[TensionLaw]] | ForceMap | None = None,
    *,
    known: Mapping[str, JsonValue] | None = None,
    like: Specimen | str | None = None,
    rest_length: float | str | None = None,
    train_below: float | str | None = None,
    hysteresis: Mapping[str, Recording] | Iterable[Source] | Source | None = None,
    progress: Callable[[str], None] | None = None,
    **options: JsonValue,
) -> Fit | Ranking:
    """Fit tension laws to a table of length, pressure and tension.

    Args:
        table: a table that was read, a file, or the id of a specimen that ships with one. The name of a law may stand here
            and the table in the place of the law.
        law: name of a law, one of your own as ``my.py:MyLaw``, or its class; several of them; or all laws where left out.
        known: parameters that are not fitted, by name: numbers [SI] or text with a unit.
        like: specimen whose known dimensions are used.
        rest_length: of the muscle [m], for a file that does not state it.
        train_below: also fit to gauge pressures up to this one [Pa] and predict those above.
        hysteresis: recordings of the same muscles in motion, or their files; one friction with memory and one creep of all
            muscles are fitted to them beside the law, or the best of several, see `Fit.with_hysteresis`.
        progress: called with a few words after each piece of work.
        **options: ``free``, ``slack``, ``schemes`` and ``length_error`` of `fit_law`; ``beside``: laws of your own to rank
            beside all others.

    Returns:
        The fit of the one law; else the ranking of all that could be fitted.

    Raises:
        InputError: the table cannot be read, is too small, or lacks what a law that was named needs.
        ConvergenceError: the fit of the one law ended where it began.

    Examples:
        >>> import mckibben as mk
        >>> found = mk.fit("DMSP-20-300", law="sarosi", schemes=())
        >>> found.law, round(found.rmse, 1)
        ('sarosi', 6.2)
    """
    if isinstance(law, ForceMap):
        table, law = law, str(table)
    if law is not None and not isinstance(law, str | type):
        if not isinstance(law, Iterable):
            raise InputError("law", None, f"must be the name of a law, its class, or several of them, got {law!r}")
        law = list(law)
    named_by_person(*([law] if isinstance(law, str | type) else law or ()), *options.get("beside", ()))
    points, spec = load_table(table, like=like, rest_length=rest_length)
    dimensions = known_of(spec) | known_in_si(named_values(known or {}, "known"), law)
    if train_below is not None:
        options["train_below"] = float(in_si(train_below, "Pa", field="train_below"))
    several = {} if isinstance(law, str | type) else inspect.signature(fit_all).parameters  # hands the rest to each fit
    takes = {**several, **inspect.signature(fit_law).parameters}
    for name in options:
        if name not in takes:
            raise InputError("option", name, known=[key for key, one in takes.items() if one.kind is one.KEYWORD_ONLY])
    if isinstance(law, str | type):
        one = fit_law(law, points, known=dimensions, progress=progress, **options)
        return one if hysteresis is None else one.with_hysteresis(hysteresis, progress=progress)
    skipped: dict[str, str] = {}
    fits = fit_all(points, laws=law, known=dimensions, skipped=skipped, progress=progress, **options)
    if hysteresis is not None:
        fits[0] = fits[0].with_hysteresis(hysteresis, progress=progress)
    title = points.name if spec is None else spec.title
    return Ranking(title, spec, points, fits, published_of(spec, points), skipped)


def load_table(
    table: MeasuredTable,
    *,
    like: Specimen | str | None = None,
    rest_length: float | str | None = None,
    **reading: JsonValue,
) -> tuple[ForceMap, Specimen | None]:
    """A table to fit to, and the specimen whose dimensions are known for it.

    Args:
        table: a table that was read, a file, or the id of a specimen that ships with one.
        like: a specimen with the same dimensions.
        rest_length: of the muscle [m]; that of the specimen which the table ships with where left out.
        **reading: of `recordings.read_force_map`.

    Raises:
        InputError: the file cannot be read, or a specimen is unknown or ships without a table.
    """
    if not (like is None or isinstance(like, str | Specimen)):
        raise InputError("like", None, f"must be the name of a muscle, or a specimen, got {like!r}")
    spec = muscle_specimen(like) if isinstance(like, str) else like
    rest = None if rest_length is None else float(in_si(rest_length, "m", field="rest_length"))
    if isinstance(table, ForceMap):
        return (table if rest is None else table.with_rest_length(rest)), spec
    untyped: object = table  # of a caller whose types nobody checked
    if not isinstance(untyped, str | os.PathLike):
        wanted = "a table that was read, its file, or the id of a specimen that ships with one"
        problem = f"is missing: {wanted}" if untyped is None else f"must be {wanted}, got {type(untyped).__name__}"
        raise InputError("table", None, problem)
    name = path_text(table, "table")
    if not Path(name).suffix and (shipped := find_specimen(name)) is not None:
        rest = rest or shipped.property_si("rest_length", "m")
        return read_force_map(map_file(shipped), rest_length=rest, **reading), shipped
    return read_force_map(name, rest_length=rest, **reading), spec


def known_in_si(
    known: Mapping[str, JsonValue], laws: str | type[TensionLaw] | Iterable[str | type[TensionLaw]] | None
) -> dict[str, JsonValue]:
    """Parameters that are not to be fitted, in SI; raises `InputError` for one that no law has."""
    given = [law_key(law) for law in ([laws] if isinstance(laws, str | type) else laws or ())]
    names = dict.fromkeys([*LAWS, *given])  # one table of dimensions may serve several laws, also those not fitted here
    fields = {key: q for name in names for key, q in declared(law_type(name)).items()} if known else {}
    values = {}
    for name, value in known.items():
        if name not in fields:
            raise InputError(f"known.{name}", None, "the parameters are", known=sorted(fields))
        values[name] = in_si(value, fields[name].unit, field=f"known.{name}")
        fields[name].check(f"known.{name}", values[name])
    return values


def known_of(spec: Specimen | None) -> dict[str, float]:
    """Dimensions of a specimen that its laws need and a fit does not determine [SI], by the parameter's name."""
    places = {"rest_inner_diameter": ("rest_diameter", "m"), "wall_thickness": ("wall_thickness", "m")}
    properties = {} if spec is None else spec.properties
    return {
        parameter: spec.property_si(name, unit)  # type: ignore[union-attr]
        for name, (parameter, unit) in places.items()
        if name in properties
    }


def published_of(spec: Specimen | None, points: ForceMap) -> list[tuple[str, np.ndarray]]:
    """Title and error at the taut points [N] of each law with published coefficients for this map."""
    values = []
    for name in spec.laws if spec is not None and spec.map else ():
        if spec is not None and not any(p.note.startswith("fitted") for p in spec.laws[name].values()):
            built = law_from_specimen(spec, name)
            values.append((f"{built.title}, as published", evaluate(built, points)))
    return values


# ---- what is said of a fit


def law_title(f: Fit) -> str:
    """Title of a law, or its name in code where it is one's own."""
    return str(law_type(f.law).title)


def verdict(f: Fit, largest: float) -> list[str]:
    """What a ranking says against a law, in a few words each; empty if nothing is to be said.

    Args:
        f: its fit.
        largest: tension of the table, to which shares refer [N].
    """
    if not f.converged:
        return ["did not converge"]
    hard = "parameters hard to tell apart" if f.determined else "parameters not determined"
    words = [hard] if f.inseparable else []
    words += degenerate_words(f)
    if f.holdout is not None and not f.holdout.max_error < ERRS * largest:
        words.append("does not extrapolate in pressure")
    if any(c.failed for c in f.cross.values()):
        return [*words, "some points could not be predicted"]
    return [*words, "misses what is left out"] if f.misses else words


def cautions_of(f: Fit, largest: float, *, alone: bool = True) -> list[str]:
    """Cautions about a fit, in sentences.

    Args:
        f: the fit.
        largest: tension of the table, to which shares refer [N].
        alone: also what tables, remarks and cautions of a `Ranking` say: inseparable parameters, assumed sizes, a doubt.
    """
    elsewhere = [] if alone else [str(group) for group in f.inseparable]
    said = [_sentence(one) for one in f.warnings if not one.startswith("did not converge") and one not in elsewhere]
    if not f.converged:
        said = [
            f"The fit did not converge ({f.message}). Its numbers are not to be used, and it is ranked last.",
            *said,
        ]
    if f.degenerate:
        rest, verb = len(f.parameters) - len(f.degenerate), "describes" if len(f.degenerate) == 1 else "describe"
        said.append(
            f"{_listed(f.degenerate)} {verb} nothing here, so the criterion counts {rest} of {len(f.parameters)} "
            "parameters. A simpler law may say the same."
        )
    if f.inseparable and alone:
        said.append(
            "Where two parameters cannot be told apart, trust what the law predicts near the data, not these values."
        )
    if f.misses and alone:
        said.append(_sentence(f.doubt))
    for scheme, cross in f.cross.items():
        if cross.failed:
            said.append(
                f"With one {SCHEMES.get(scheme, scheme)} left out, {cross.failed} of {cross.groups} fits had too few points "
                "or did not converge; no error is stated for that column."
            )
    if f.holdout and not f.holdout.max_error < ERRS * largest:
        share = COLUMNS["above_share"].text(f.holdout.max_error / largest)
        how = "without bound" if share == "fails" else f"by {share.replace('> ', 'more than ')}"
        above = _sentence(f.holdout.what)[:-1]
        said.append(f"{above}, it misses what lies above {how}. Do not use it beyond the pressures measured.")
    across = [n for n, e in f.parameters.items() if math.isfinite(e.high - e.low) and e.low < 0.0 < e.high]
    said += [f"The interval of {_listed(across)} includes zero."] if across else []
    if f.assumed and alone:
        fields = declared(law_type(f.law))
        sizes = "; ".join(f"{fields[n].doc} {with_unit(v, fields[n].unit)} ({n})" for n, v in f.assumed.items())
        said.append(
            f"Assumed, as not stated: {sizes}. Other values change the fitted parameters, in ways that their "
            "intervals do not include."
        )
    return said


def assumptions(fits: list[Fit]) -> list[str]:
    """Sizes that laws took from their defaults, one line each, with how one states them or lets them be fitted."""
    laws: dict[tuple[str, str, str], list[str]] = {}
    for f in fits:
        kind = law_type(f.law)
        for name, value in f.assumed.items():
            beside = [size for size, of in kind.fitted_if_unknown.items() if name in of and size in f.parameters]
            fitted = "".join(f", or fit it by {{known}} {size}=.." for size in beside)
            laws.setdefault((name, with_unit(value, declared(kind)[name].unit), fitted), []).append(f.law)
    of = {key: "" if len(fits) == 1 else f" ({', '.join(names)})" for key, names in laws.items()}
    return [
        f"assumed, as not stated: {name} = {shown}{of[name, shown, fitted]}; state it by {{known}} {name}='{shown}'{fitted}"
        for name, shown, fitted in laws
    ]


def _sentence(text: str) -> str:
    return (text if "_" in text.split(" ", 1)[0] else text[:1].upper() + text[1:]).rstrip(".") + "."


def _listed(words: Iterable[str]) -> str:
    *before, last = words
    return f"{', '.join(before)} and {last}" if before else last


def _law_key_beside(path: Path, law: str) -> str:
    """The name of a law in a file; the path of a reference such as ``my.py:MyLaw`` begins at the folder of that file."""
    if not is_reference(law):
        return law
    source, _, name = law.rpartition(":")
    return f"{Path(os.path.relpath(source, path.absolute().parent)).as_posix()}:{name}"
