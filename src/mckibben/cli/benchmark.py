"""``benchmark``: models of muscles on measured tasks with frozen splits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .. import benchmarking
from .._version import __version__
from ..documents import write_text
from ._outputs import OBJECT, OutputKinds, Paths
from ._progress import progress
from ._terminal import Json, print_json, table

if TYPE_CHECKING:
    from ..benchmarking import BenchmarkResult

OUT = OutputKinds(page=(".md",), result=OBJECT)


def run_benchmark(
    task: Annotated[
        list[str] | None, typer.Option(metavar="TASK", help="Task, such as map-above-4-bar; all by default.")
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LAW|FILE.py:CLASS",
            help="Law, other model, or one of your own such as my.py:MyModel; all by default.",
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder of measured data; by default the one that MCKIBBEN_DATA names."),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Run the competitors without physics too, which takes a quarter of an hour.")
    ] = False,
    earlier: Annotated[
        Path | None,
        typer.Option(metavar="SCORES", help="Earlier result whose scores are not computed again."),
    ] = None,
    list_tasks: Annotated[bool, typer.Option("--list", help="List the tasks without running them.")] = False,
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Train models on measured tasks, and score their predictions of what they were not shown.

    A model of your own is a class with the methods fit(train) and predict(record), or a tension law. Tasks
    whose data are not at hand are named. All laws on all tasks take some minutes; with --all, models without
    physics take part: a Gaussian process, a perceptron, a gated recurrent unit, a neural ODE and Koopman's operator.

    $ mckibben benchmark --task map-above-4-bar --model ideal
    """
    if list_tasks:
        _list(as_json=as_json)
        return
    with OUT.files(out) as files:
        known = None if earlier is None else benchmarking.BenchmarkResult.read(earlier)
        count = benchmarking.run.stages(model or (), task or (), competitors=everything)
        with progress("benchmark", count) as advance:
            result = benchmarking.benchmark(
                model or (), tasks=task or (), folder=data, competitors=everything, earlier=known, progress=advance
            )
        files.write("page", lambda path: write_text(path, benchmarking.page.page(result, version=__version__)))
        words = [*(["--all"] if everything else []), *([f"--earlier {earlier.name}"] if earlier else [])]
        words += [f"--task {one}" for one in task or ()]
        command = " ".join(["mckibben benchmark", *words, *(f"--model {one}" for one in model or ())])
        minutes = {"processor_minutes": result.seconds / 60.0}
        content = {"command": command, "version": __version__, **minutes, **result.to_dict()}
        files.write_result(content)
        if as_json:
            print_json(content)
            return
        _show(result)
        files.say()


def _list(*, as_json: bool) -> None:
    if as_json:
        fields = ("title", "predicts", "split", "ships", "note")
        print_json({"tasks": [{"name": n} | {f: getattr(t, f) for f in fields} for n, t in benchmarking.TASKS.items()]})
        return
    cells = [
        [name, one.predicts, one.split, "ships" if one.ships else "does not ship"]
        for name, one in benchmarking.TASKS.items()
    ]
    table("Tasks of the benchmark", ["task", "predicted", "left out", "data"], cells)


def _show(result: BenchmarkResult) -> None:
    """Print a table per task, with the models that have no result and the tasks without data."""
    for name in result.tasks:
        one = benchmarking.TASKS[name]
        table(
            f"{one.title}: errors as shares of {'the swing' if one.of_swing else 'the largest tension'}",
            list(benchmarking.page.COLUMNS),
            benchmarking.page.rows(result, name),
            right=range(1, 5),
        )
        for sentence in benchmarking.page.refusals(result, name):
            typer.echo(sentence.replace("`", ""))
        typer.echo(one.note)
        typer.echo("")
    for name, reason in result.absent.items():
        typer.echo(f"{name} was not run: {reason}.")
