"""Markdown page of the benchmark for the documentation."""

from __future__ import annotations

import math

from ..studies.validation import VARIABLE
from ..studies.validation_page import DASH, FRONT
from ..studies.validation_page import table as markdown_table
from .moving import FILLING, VENTING
from .run import BenchmarkResult
from .scores import TaskScore
from .tasks import task

HEAD = "<!-- written by `mckibben benchmark`; do not edit -->"
COLUMNS = ("model", "rms", "95 % interval", "largest", "bias")
PHASES = (FILLING, VENTING)
PHASE_COLUMNS = ("model", "filling, rms", "bias", "venting, rms", "bias")
INTRO = f"""\
Models of muscles on measured tasks: each is trained on a part of the data and predicts a part that it was not shown. What is
left out follows from the data alone, and hashes tell whether the data are those for which the splits were made. One
command makes this page anew:

```sh
$ {VARIABLE}=/folder/of/measured/data mckibben benchmark --out docs/reference/benchmark.md
```

Without that folder it does the tasks whose data ship with the package, and names the others. A model of your own takes part
as `mckibben benchmark --model my.py:MyModel`: any class with the methods `fit` and `predict`, or a tension law.

All figures are shares of the largest measured tension of the muscle; where something else than tension is predicted, of the
swing of what was measured. *Rms* is the root mean square error of all predicted samples, *largest* the largest single
error, *bias* the mean signed error, positive where too much is predicted; *over* is more than the whole. Tension is scored
where the muscle was taut. The interval of the rms error is by a bootstrap over muscles where there are three or more, else
over what is left out."""
END = """\
## What is not here

Nothing here tells how far two muscles of one make differ, and each loop, robot and pair of muscles was measured once."""


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
        phased = phase_rows(result, name)
        if phased:
            parts += ["Filling and venting apart:", markdown_table(PHASE_COLUMNS, phased)]
        parts += refusals(result, name)
        parts.append(one.note)
    return "\n\n".join([*parts, END]) + "\n"


def rows(result: BenchmarkResult, name: str) -> list[list[str]]:
    """Cells of the table of one task, best model first, in the order of `COLUMNS`."""
    return [
        [score.model, percent(score.rms()), interval(score), percent(score.largest()), percent(score.bias(), sign=True)]
        for score in result.of(name)
    ]


def phase_rows(result: BenchmarkResult, name: str) -> list[list[str]]:
    """Cells of the table of filling and venting of one task, in the order of `PHASE_COLUMNS`; none without phases."""
    return [
        [f"`{score.model}`", *(percent(f(p), sign=f == score.bias) for p in PHASES for f in (score.rms, score.bias))]
        for score in result.of(name)
        if set(PHASES) <= set(score.phases)
    ]


def refusals(result: BenchmarkResult, name: str) -> list[str]:
    """A sentence for each reason why models have no result on a task."""
    reasons: dict[str, list[str]] = {}
    for model, reason in result.refused(name).items():
        reasons.setdefault(reason, []).append(f"`{model}`")
    return [f"No result of {', '.join(models)}: {reason}." for reason, models in reasons.items()]


def interval(score: TaskScore) -> str:
    """The 95 % interval of the rms error as text."""
    low, high = score.interval()
    return DASH if math.isnan(low) else f"{percent(low)} to {percent(high)}"


def percent(share: float, *, sign: bool = False) -> str:
    """A share as text in per cent; more than the whole is ``over``."""
    return "over" if abs(share) > 1.0 else f"{100.0 * share:{'+' if sign else ''}.2f} %"
