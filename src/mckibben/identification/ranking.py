"""Laws that were fitted to one table, ranked: one value for tables, figures and reports; and the verb that makes it."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, overload

import numpy as np

from ..accessors import Accessor, implementation
from ..documents import JsonValue
from ..errors import InputError
from ..extras import library
from ..muscles.build import law_from_specimen
from ..muscles.law import TensionLaw
from ..muscles.laws import LAWS, law_key, law_type
from ..quantities import declared, in_si, named_values
from ..recordings import ForceMap, read_force_map
from ..registry import is_reference, named_by_person
from ..specimens import Specimen, map_file, muscle_specimen, save_specimen, specimen_ids
from .fit import Fit, evaluate, fit_all, fitted_specimen
from .fit import fit as fit_law

if TYPE_CHECKING:
    import pandas

    from ..accessors import RankingPlots
    from ..recordings import Recording
    from .shared_hysteresis import Source

Table = ForceMap | str | os.PathLike[str]


@dataclass(frozen=True, repr=False)
class Ranking:
    """One table of length, pressure and tension, and every law that was fitted to it, best first.

    Attributes:
        title: of the muscle, or of the table.
        specimen: whose known dimensions were used, if any.
        points: the table.
        fits: one per law, ranked by Akaike's criterion.
        published: laws with printed coefficients: title, and error at the taut points [N].
        skipped: why a law could not be fitted, by its name.

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

    plot: ClassVar[Accessor[RankingPlots]] = Accessor("RankingPlots")

    @property
    def best(self) -> Fit:
        """The fit that describes the table best for its number of parameters."""
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

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per law, best first: number of parameters, errors [N] and criterion.

        Raises:
            MissingLibraryError: pandas is not installed; it comes with the extra ``data``.
        """
        names = ("law", "rmse", "max_error", "cv_rmse", "cv_max_error", "aicc", "n", "converged")
        rows = [{name: row[name] for name in names} | {"parameters": len(row["parameters"])}
                for row in map(Fit.to_dict, self.fits)]  # fmt: skip
        frame: pandas.DataFrame = library("pandas", "Data frames need").DataFrame(rows)
        return frame.set_index("law")

    def report(self, path: str | os.PathLike[str]) -> Path:
        """Write a report with tables and figures to an ``.html`` or ``.pdf`` file; returns its path."""
        return Path(implementation("write_fit_report")([self], Path(path)))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the fitted laws as a specimen, a ``.toml`` file that every command takes; returns its path.

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
        return path

    def to_specimen(self, name: str = "fitted") -> Specimen:
        """The fitted laws as a specimen; raises `ConvergenceError` if no fit converged."""
        return fitted_specimen(self.fits, self.specimen, name=name)

    def _repr_html_(self) -> str:
        return str(implementation("ranking_html")(self))


@overload
def fit(table: Table, law: str | type[TensionLaw], **options: JsonValue) -> Fit: ...
@overload
def fit(table: Table, law: Iterable[str | type[TensionLaw]] | None = None, **options: JsonValue) -> Ranking: ...
@overload
def fit(table: str, law: ForceMap, **options: JsonValue) -> Fit: ...
def fit(
    table: Table,
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
    table: Table, *, like: Specimen | str | None = None, rest_length: float | str | None = None, **reading: JsonValue
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
    name = os.fspath(table)
    if not Path(name).suffix and name.lower() in [known.lower() for known in specimen_ids()]:
        spec = muscle_specimen(name)
        rest = rest or spec.property_si("rest_length", "m")
        return read_force_map(map_file(spec), rest_length=rest, **reading), spec
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


def _law_key_beside(path: Path, law: str) -> str:
    """The name of a law in a file; the path of a reference such as ``my.py:MyLaw`` begins at the folder of that file."""
    if not is_reference(law):
        return law
    source, _, name = law.rpartition(":")
    return f"{Path(os.path.relpath(source, path.absolute().parent)).as_posix()}:{name}"
