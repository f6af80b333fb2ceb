"""Options and tables of samples that were drawn from a posterior."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from ..errors import InputError
from ..extras import library
from ..quantities import with_unit
from ._terminal import table

if TYPE_CHECKING:
    from ..identification import Estimate
    from ..identification.record_posterior import RecordPosterior

FEWEST, MOST = 100, 100_000
HEADS = ["parameter", "median", "95 %: from", "to", "95 % of all at once: from", "to"]


def checked_draws(draws: int) -> None:
    """Refuse a count of samples that is out of range, and ask for the library that draws them, before anything else."""
    if not FEWEST <= draws <= MOST:
        raise InputError("--draws", draws, f"must be between {FEWEST} and {MOST}")
    library("numpyro", "Samples of a posterior need", where="--posterior")


def interval_rows(each: dict[str, Estimate], joint: dict[str, Estimate]) -> list[list[str]]:
    """Rows of the parameters: median, interval, and interval of all at once."""
    return [
        [name, *(with_unit(v, e.unit) for v in (e.value, e.low, e.high, joint[name].low, joint[name].high))]
        for name, e in each.items()
    ]


def show_samples(samples: RecordPosterior, subject: str) -> None:
    """Print median and intervals of the parameters of a record's posterior, its discrepancy, and cautions.

    Args:
        samples: of the parameters.
        subject: what has no parameter for the discrepancy, such as "the circuit".
    """
    rows = interval_rows(samples.intervals(), samples.joint_intervals())
    typer.echo("")
    table(f"posterior, {len(samples)} samples", HEADS, rows, right=range(1, 6))
    size, noise = (with_unit(value, samples.unit, 3) for value in (samples.discrepancy_size, samples.noise_size))
    typer.echo(f"What {subject} has no parameter for: {size}; noise of a reading: {noise}.")
    for warning in samples.warnings:
        typer.echo(f"note: {warning}")
