"""Markdown page of the benchmark for the documentation."""

from __future__ import annotations

import math

from ..studies.validation import VARIABLE
from ..studies.validation_page import DASH, FRONT
from ..studies.validation_page import table as markdown_table
from .run import BenchmarkResult
from .scores import TaskScore
from .tasks import task

HEAD = "<!-- written by `mckibben benchmark`; do not edit -->"
COLUMNS = ("model", "rms", "95 % interval", "largest", "bias")
INTRO = f"""\
Models of muscles on measured tasks: each is trained on a part of the data and predicts a part that it was not shown. What is
left out follows from the data alone, and hashes tell whether the data are those for which the splits were made. One
command makes this page anew:

```sh
$ {VARIABLE}=/folder/of/measured/data mckibben benchmark --out docs/reference/benchmark.md
```

Without that folder it does the tasks whose data ship with the package, and names the others. A model of your own takes part
as `mckibben benchmark --model my.py:MyModel`: any class with the methods `fit` and `predict`, or a tension law.

All figures are shares of the largest measured tension of the muscle. *Rms* is the root mean square error of all predicted
points with tension, *largest* the largest single error, *bias* the mean signed error, positive where too much tension is
predicted; *over* is more than that tension. The interval of the rms error is by a bootstrap over muscles where there are
three or more, else over what is left out."""
END = """\
## What is not here

The competitors are tension laws. Neural networks, Gaussian processes and other models without physics have not been run on
these tasks, and no task is of a muscle in motion: loop, creep and a robot are on the [validation page](validation.md).
Venting is scored together with filling. Nothing here tells how far two muscles of one make differ."""


def page(result: BenchmarkResult, *, version: str = "") -> str:
    """Compose the page.

    Args:
        result: scores of all models on all tasks at hand.
        version: of the package that computed it.
    """
    parts = [FRONT, "# Benchmark", HEAD, INTRO]
    if version:
        parts.append(f"Computed with version {version}.")
    if result.absent:
        parts.append(
            "Not done, for their data are not at hand: " + "; ".join(f"`{name}`" for name in result.absent) + "."
        )
    for name in result.tasks:
        one = task(name)
        sources = "; ".join(dict.fromkeys(f"{data.source} ({data.licence})" for data in one.data))
        parts += [
            f"## {one.title}",
            f"`{name}`: {one.predicts}. Left out: {one.split}. Data: {sources}.",
            markdown_table(COLUMNS, [[f"`{cells[0]}`", *cells[1:]] for cells in rows(result, name)]),
        ]
        parts += [f"`{model}` has no result: {reason}." for model, reason in result.refused(name).items()]
        parts.append(one.note)
    return "\n\n".join([*parts, END]) + "\n"


def rows(result: BenchmarkResult, name: str) -> list[list[str]]:
    """Cells of the table of one task, best model first, in the order of `COLUMNS`."""
    return [
        [score.model, percent(score.rms()), interval(score), percent(score.largest()), percent(score.bias(), sign=True)]
        for score in result.of(name)
    ]


def interval(score: TaskScore) -> str:
    """The 95 % interval of the rms error as text."""
    low, high = score.interval()
    return DASH if math.isnan(low) else f"{percent(low)} to {percent(high)}"


def percent(share: float, *, sign: bool = False) -> str:
    """A share as text in per cent; more than the whole is ``over``."""
    return "over" if abs(share) > 1.0 else f"{100.0 * share:{'+' if sign else ''}.2f} %"
