"""Fits of several laws to one table, as one value for tables, figures and reports."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from .. import __version__
from ..documents import write_text
from ..errors import ConvergenceError
from ..identification import Fit, evaluate
from ..muscles.build import law_from_specimen
from ..muscles.laws import law_type
from ..quantities import declared
from ..recordings import ForceMap
from ..registry import is_reference
from ..specimens import Specimen


@dataclass(frozen=True)
class Study:
    """A force map and all fits to it, best law first.

    `published` holds laws with printed coefficients as (title, error at the taut points [N]); `skipped` says why a law
    could not be fitted.
    """

    title: str
    specimen: Specimen | None
    points: ForceMap
    fits: list[Fit]
    published: list[tuple[str, np.ndarray]] = field(default_factory=list)
    skipped: dict[str, str] = field(default_factory=dict)


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
    errors = []
    for name in spec.laws if spec is not None and spec.map else ():
        if spec is not None and not any(p.note.startswith("fitted") for p in spec.laws[name].values()):
            built = law_from_specimen(spec, name)
            errors.append((f"{built.title}, as published", evaluate(built, points)))
    return errors


def write_specimen(fits: list[Fit], like: Specimen | None, path: Path) -> None:
    """Write all converged fits as one specimen; the first is its default law.

    Args:
        fits: ranked, of one table.
        like: specimen whose properties are known for this muscle, if any.
        path: path of the TOML file; written whole or not at all.

    Raises:
        ConvergenceError: if no fit converged.
    """
    good = [f for f in fits if f.converged]
    if not good:
        raise ConvergenceError(f"{path}: not written, because no fit converged")
    out = tomlkit.document()
    out.add(tomlkit.comment(f"fitted by mckibben {__version__} to {good[0].points.name}, {datetime.now(UTC):%Y-%m-%d}"))
    out["schema"] = 1
    out["id"] = re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-.") or "fitted"
    out["kind"] = "mckibben"
    out["title"] = f"fitted to {good[0].points.name}"
    out["sources"] = list(dict.fromkeys(k for f in good for k in law_type(f.law).cites))
    out["law"] = _law_key(good[0].law, path)
    laws = tomlkit.table(is_super_table=True)
    for f in good:
        laws[_law_key(f.law, path)] = _law_table(f)
    if like is not None and like.properties:
        out["properties"] = {k: _plain(p.stated()) for k, p in like.properties.items()}
    out["laws"] = laws
    write_text(path, tomlkit.dumps(out))


def _law_key(law: str, path: Path) -> str:
    """The name of a law in a file; the path of a reference such as ``my.py:MyLaw`` begins at the folder of that file."""
    if not is_reference(law):
        return law
    source, _, name = law.rpartition(":")
    return f"{Path(os.path.relpath(source, path.absolute().parent)).as_posix()}:{name}"


def _law_table(f: Fit) -> Any:
    group = tomlkit.table()
    units = declared(law_type(f.law))
    for name, e in f.parameters.items():
        note = f"fitted, rmse {f.rmse:.3g} N"
        if name in f.degenerate:
            note += "; at its bound" if name in f.at_bound else "; not in the data"
        entry: dict[str, Any] = {"value": e.value, "unit": e.unit, "note": note}
        if name not in f.degenerate and np.isfinite([e.low, e.high]).all():
            entry["range"] = [e.low, e.high]
        group[name] = entry
    for name, value in f.known.items():
        group[name] = {"value": float(np.max(value)), "unit": units[name].unit, "note": "known"}
    return group


def _plain(entry: dict[str, Any]) -> dict[str, Any]:
    return {k: list(v) if isinstance(v, tuple) else v for k, v in entry.items()}
