"""``fit --hysteresis``: friction with memory and creep of all muscles of a table, from recordings, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from .. import identification
from ..quantities import with_unit
from ._terminal import table

if TYPE_CHECKING:
    from ..identification import SharedHysteresis


def show_hysteresis(found: SharedHysteresis) -> None:
    """Print the forms that were fitted, the parameters of the chosen one, and what they predict."""
    muscles = len(found.muscles)
    title = (
        f"friction and creep, from {len(found.recordings)} recording{'s' * (len(found.recordings) > 1)} of "
        f"{muscles} muscle{'s' * (muscles > 1)}: {found.samples} samples, {found.independent} of them independent"
    )
    least = found.models[0].aicc
    rows = [
        [m.title, str(len(m.free)), f"{m.rmse:.3g} N", f"{m.aicc:.1f}", f"{m.aicc - least:+.1f}"] for m in found.models
    ]
    typer.echo("")
    table(title, ["form", "free", "rmse", "AICc", "above the least"], rows, right=range(1, 5))
    typer.echo(f"\n{found.title}:")
    for name, e in found.parameters.items():
        said = f"95 %: {with_unit(e.low, e.unit)} to {with_unit(e.high, e.unit)}"
        interval = "its size is not in the data" if found.is_open(name) else said
        typer.echo(
            f"  {identification.shared_hysteresis.MEANINGS[name]} ({name}) = {with_unit(e.value, e.unit)}  ({interval})"
        )
    for part in ("friction", "creep"):
        if not found.has(part):
            above = -found.difference(part)
            said = f"{above:.1f} higher" if above > 0.0 else f"only {-above:.1f} lower"
            typer.echo(f"  no {part}: with it AICc is {said}, so that these data do not tell of it")
    typer.echo(
        f"Error along the recordings: {found.uncorrected_rmse:.3g} N rms by the law; {found.law_rmse:.3g} N with errors "
        f"of the law, which only length and pressure tell; {found.rmse:.3g} N with this."
    )
    if found.held_back is not None and found.parameters:
        by, alone = found.held_back
        typer.echo(f"Recordings held back in turn: {by:.3g} N rms, {alone:.3g} N by the law alone.")
    for warning in found.warnings:
        typer.echo(f"note: {warning}")
