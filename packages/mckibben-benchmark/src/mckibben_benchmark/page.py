"""Markdown page of the benchmark for the documentation."""

from __future__ import annotations

from mckibben.muscles.laws import LAWS
from mckibben.quantities import from_si

from .datasets import FILLING, VENTING
from .run import COLUMNS, COMPETITORS, PHYSICS, BenchmarkResult, cells_of, interval, model_names, percent
from .tasks import READINGS, task
from .validation import VARIABLE
from .validation_page import FRONT
from .validation_page import table as markdown_table

HEAD = "<!-- written by `mckibben benchmark`; do not edit -->"
VERDICT = (
    "The best law or other model of muscles here against the best competitor that knows nothing of muscles. Both are the"
    " best by these same errors, which favours the laws, of which there are more. *Within its interval*: the rms error of"
    " the other lies in the 95 % interval of the muscle model."
)
VERDICT_COLUMNS = (
    "task",
    "muscle model",
    "rms",
    "95 % interval",
    "competitor",
    "rms",
    "95 % interval",
    "muscle model is",
)
PHASES = (FILLING, VENTING)
READING_COLUMNS = ("model", *(head for words in READINGS for head in (f"{words}, rms", "largest")))
PHASE_COLUMNS = ("model", "filling, rms", "bias", "venting, rms", "bias")
INTRO = f"""\
Models of muscles on measured tasks: each is trained on a part of the data and predicts a part that it was not shown. What is
left out follows from the data alone, and hashes tell whether the data are those for which the splits were made. One
command makes this page anew:

```sh needs=measured_data
$ export {VARIABLE}=/folder/of/measured/data
$ mckibben benchmark --all --out docs/reference/benchmark.md --out docs/reference/benchmark.json
```

Without that folder it does the tasks whose data ship with the package, and names the others; without `--all` the
competitors that know nothing of muscles stay away. All figures are in [`benchmark.json`](benchmark.json), with the processor
time and date of each; `--earlier benchmark.json` takes from there what need not be computed again. A model of your own takes
part as `mckibben benchmark --model my.py:MyModel`: any class with the methods `fit` and `predict`, or a tension law.

All figures are shares of the largest measured tension of the muscle; where something else than tension is predicted, of the
swing of what was measured. *Rms* is the root mean square error of all predicted samples, *largest* the largest single
error, *bias* the mean signed error, positive where too much is predicted; *over* is more than the whole. Tension is scored
where the muscle was taut. The interval of the rms error is by a bootstrap over muscles where there are three or more, else
over what is left out."""
COMPETITORS_TEXT = """\
## The competitors

They are given the same inputs, the contraction in place of the length, and the rest length where muscles differ in it; of
records in time those without a memory also get earlier inputs and the time. Their settings were chosen within the training
part of each fold only, on samples held back there: the last muscle, else the last record, else two of ten pieces of a
record, else a fifth of the points, drawn. One thing was changed after test errors had been seen, meant in their favour:
the first values of the outputs, which they are told, are scaled by the spread of the outputs, not by that between records.
On `robot` that took the Gaussian process from 18.6 to 14.5 %, and extended DMD from 24.8 to 32.6 %. Since then the
commands of three jumps come 1 ms earlier, at their own times, which took the Gaussian process to 21.8 %."""
COMPETITOR_ROWS = (
    (
        "`gaussian_process`",
        "linear and squared exponential kernel, a length for each input",
        "kernel and noise, by marginal likelihood of 500 samples; 1,500 are conditioned on",
    ),
    ("`perceptron`", "two hidden layers of 32, mean of three networks", "weight decay, of four"),
    ("`gru`", "24 gated recurrent units", "number of training steps, up to 300"),
    (
        "`neural_ode`",
        "state of the outputs and six more, rate by a hidden layer of 32, Heun's steps",
        "number of training steps, up to 300",
    ),
    (
        "`koopman`",
        "extended dynamic mode decomposition: a linear step of lifted outputs and inputs, run freely",
        "degree of the polynomials and ridge, of six",
    ),
)
COMPETITORS_END = """\
Models with a memory learn from at most 750 samples of each record. All are so small that they learn in minutes on one
processor; more time and larger networks may do better."""
END = """\
## What is not here

Nothing here tells how far two muscles of one make and length differ; each loop, robot and pair was measured once."""


def page(result: BenchmarkResult, *, version: str = "") -> str:
    """Compose the page.

    Args:
        result: scores of all models on all tasks at hand.
        version: of the package that computed it.
    """
    parts = [FRONT, "# Benchmark", HEAD, INTRO]
    if version:
        dates = sorted({score.date for score in result.scores if score.date})
        when = f" on {' and '.join(dates)}" if dates else ""
        minutes = from_si(result.seconds, "s", "min")
        parts.append(f"Computed with version {version}{when} in {minutes:.0f} minutes of one processor.")
    summary = [cells for name in result.tasks if (cells := verdict_row(result, name))]
    if summary:
        parts += ["## Who is first", VERDICT, markdown_table(VERDICT_COLUMNS, summary, right=())]
    if result.absent:
        parts.append(
            "Not done, for their data are not at hand: " + "; ".join(f"`{name}`" for name in result.absent) + "."
        )
    every = dict.fromkeys((*COMPETITORS, *model_names()))
    for name in result.tasks:
        one = task(name)
        sources = "; ".join(dict.fromkeys(f"{data.source} ({data.licence})" for data in one.data))
        parts += [
            f"## {one.title}",
            f"`{name}`: {one.predicts}. Left out: {one.split}. Data: {sources}.",
            markdown_table(COLUMNS, [[f"`{cells[0]}`", *cells[1:]] for cells in cells_of(result, name)]),
        ]
        phased = [
            [
                f"`{score.model}`",
                *(percent(f(p), sign=f == score.bias) for p in PHASES for f in (score.rms, score.bias)),
            ]
            for score in result.of(name)
            if set(PHASES) <= set(score.phases)
        ]
        if phased:
            parts += ["Filling and venting apart:", markdown_table(PHASE_COLUMNS, phased)]
        read = [
            [f"`{s.model}`", *(percent(f(p)) for p in READINGS for f in (s.rms, s.largest))]
            for s in result.of(name)
            if set(READINGS) <= set(s.phases)
        ]
        if read:
            parts += ["By readings of the muscle that is predicted:", markdown_table(READING_COLUMNS, read)]
        parts += result.refusals(name)
        missing = [f"`{model}`" for model in every if result.score(name, model) is None]
        if summary and missing:
            parts.append(f"Not run on this task: {', '.join(missing)}.")
        parts.append(one.note)
    if summary:
        table = markdown_table(("model", "what it is", "what is chosen"), COMPETITOR_ROWS, right=())
        parts += [COMPETITORS_TEXT, table, COMPETITORS_END]
    return "\n\n".join([*parts, END]) + "\n"


def verdict_row(result: BenchmarkResult, name: str) -> list[str] | None:
    """Cells of the summary for one task, in the order of `VERDICT_COLUMNS`; None unless both kinds of models took part."""
    scores = result.of(name)
    others = [s for s in scores if s.model in COMPETITORS]
    ours = [s for s in scores if s.model in (*LAWS, *PHYSICS)]
    if not ours or not others:
        return None
    best, other = ours[0], others[0]
    low, high = best.interval()
    ahead = best.rms() <= other.rms()
    within = low <= other.rms() <= high
    place = "first" if ahead else "**not first**"
    place += ", the other within its interval" if within else "" if ahead else ", the other outside its interval"
    one = [f"`{name}`", f"`{best.model}`", percent(best.rms()), interval(best)]
    return [*one, f"`{other.model}`", percent(other.rms()), interval(other), place]
