"""What ``fit`` prints: the ranking for a person, and the same as one JSON object."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import typer

from .words import table

if TYPE_CHECKING:
    from ..identification import Fit


def as_json(study: Any) -> dict[str, Any]:
    """The study as the object of the CLI's contract."""
    return {
        "map": study.points.name,
        "fits": [fit_json(f) for f in study.fits],
        "published": [
            {"law": title, "rmse": float((error**2).mean() ** 0.5), "max_error": float(abs(error).max())}
            for title, error in study.published
        ],
        "skipped": study.skipped,
        "largest_tension": study.points.largest,
    }


def fit_json(f: Fit) -> dict[str, Any]:
    """One fit as the object of the CLI's contract."""
    import numpy as np

    known = {
        k: (float(np.max(v)) if np.ndim(v) == 0 or len(set(np.ravel(v))) == 1 else None) for k, v in f.known.items()
    }
    return {
        "law": f.law,
        "parameters": {k: e._asdict() for k, e in f.parameters.items()},
        "known": known,
        "rmse": f.rmse,
        "max_error": f.max_error,
        "cv_rmse": f.cv_rmse,
        "cv_max_error": f.cv_max_error,
        "aicc": f.aicc,
        "n": len(f.points),
        "converged": f.converged,
        "at_bound": list(f.at_bound),
        "not_contained": list(f.not_contained),
        "warnings": list(f.warnings),
        "cross_validation": {
            k: {"groups": c.groups, "rmse": c.rmse, "max_error": c.max_error} for k, c in f.cross.items()
        },
        "holdout": None
        if f.holdout is None
        else {"trained_on": f.holdout.trained_on, "rmse": f.holdout.rmse, "max_error": f.holdout.max_error},
    }


def _share(largest: float, newton: float | None) -> str:
    """An error as a share of the largest tension, for a person."""
    if newton is None:
        return "-"
    if not newton < 1e9:
        return "fails"
    return "> 100 %" if newton > largest else f"{100 * newton / largest:.2f} %"


def show(study: Any) -> None:
    """Print the ranking of one table, the best law's parameters, and what is to be noted."""
    from ..identification.fit import bound_of, degenerate_words

    largest = study.points.largest
    n = int(study.points.taut.sum())
    share = functools.partial(_share, largest)
    rows = []
    for f in study.fits:
        held = f.holdout.max_error if f.holdout else None
        rows.append(
            [
                f.law,
                str(len(f.parameters)),
                f"{f.rmse:.2f} N",
                share(f.max_error),
                share(f.cv_max_error),
                *(share(f.cross[s].max_error if s in f.cross else None) for s in ("length", "block", "rest_length")),
                share(held),
                f"{f.aicc:.1f}",
                "; ".join([*([] if f.converged else ["did not converge"]), *degenerate_words(f)]),
            ]
        )
    for title, error in study.published:
        rows.append(
            [
                title,
                "0",
                f"{(error**2).mean() ** 0.5:.2f} N",
                share(float(abs(error).max())),
                "-",
                "-",
                "-",
                "-",
                "-",
                "-",
                "",
            ]
        )
    columns = [
        "law",
        "free",
        "rmse",
        "largest",
        "pressure out",
        "length out",
        "block out",
        "muscle out",
        "above",
        "AICc",
        "",
    ]
    keep = [i for i in range(len(columns)) if i < 5 or any(r[i] not in ("-", "") for r in rows)]
    table(
        f"{study.title}: {n} points with tension, largest {largest:.1f} N; errors are the largest, of that",
        [columns[i] for i in keep],
        [[r[i] for i in keep] for r in rows],
        right=[j for j, i in enumerate(keep) if 0 < i < 10],
    )
    best = study.fits[0]
    from ..quantities import with_unit

    typer.echo(f"\n{best.law}:")
    for name, e in best.parameters.items():
        if name in best.at_bound:
            typer.echo(f"  {name} = {with_unit(bound_of(best, name), e.unit)}  (at its bound)")
            continue
        typer.echo(
            f"  {name} = {with_unit(e.value, e.unit)}  (95 %: {with_unit(e.low, e.unit)} to {with_unit(e.high, e.unit)})"
        )
    for f in study.fits:
        for warning in f.warnings:
            typer.echo(f"note: {f.law}: {warning}")
    for name, why in study.skipped.items():
        typer.echo(f"left out: {name}: {why}")
    if study.specimen is not None and "martens2017" in study.specimen.sources:
        typer.echo("data: M. Martens, I. Boblan, Actuators 2017, 6(4), 33, CC BY 4.0")
    if len(study.fits) > 1:
        typer.echo("ranked by AICc; a parameter at its bound, or not in the data, is not counted")
    typer.echo("")
