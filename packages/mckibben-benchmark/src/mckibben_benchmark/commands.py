"""Commands that this package adds to ``mckibben``: ``benchmark``, and the studies of a robot, loops and all laws."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mckibben._version import __version__
from mckibben.cli._outputs import FIGURE, OBJECT, OutputKinds, Paths
from mckibben.cli._progress import progress
from mckibben.cli._terminal import Json, print_json, table
from mckibben.cli._verb import VerbCommand
from mckibben.documents import write_text
from mckibben.report.figures import run_figures, style

from . import figures, muscle_loops, page, run, tasks, validation, validation_page

if TYPE_CHECKING:
    from .run import BenchmarkResult
    from .validation import Validation

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
        known = None if earlier is None else run.BenchmarkResult.read(earlier)
        count = run.stages(model or (), task or (), competitors=everything)
        with progress("benchmark", count) as advance:
            result = run.benchmark(
                model or (), tasks=task or (), folder=data, competitors=everything, earlier=known, progress=advance
            )
        files.write("page", lambda path: write_text(path, page.page(result, version=__version__)))
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
        print_json({"tasks": [{"name": n} | {f: getattr(t, f) for f in fields} for n, t in tasks.TASKS.items()]})
        return
    cells = [
        [name, one.predicts, one.split, "ships" if one.ships else "does not ship"] for name, one in tasks.TASKS.items()
    ]
    table("Tasks of the benchmark", ["task", "predicted", "left out", "data"], cells)


def _show(result: BenchmarkResult) -> None:
    """Print a table per task, with the models that have no result and the tasks without data."""
    for name in result.tasks:
        one = tasks.TASKS[name]
        table(
            f"{one.title}: errors as shares of {'the swing' if one.of_swing else 'the largest tension'}",
            list(page.COLUMNS),
            page.rows(result, name),
            right=range(1, 5),
        )
        for sentence in page.refusals(result, name):
            typer.echo(sentence.replace("`", ""))
        typer.echo(one.note)
        typer.echo("")
    for name, reason in result.absent.items():
        typer.echo(f"{name} was not run: {reason}.")


# ---- studies

STUDY = OutputKinds(figure=FIGURE, result=OBJECT)


def _write_page(answer: Validation, path: Path) -> list[Path]:
    figure = path.with_name(f"{path.stem}-errors.svg")
    if answer.static:
        style.save(figures.errors_figure(answer), figure)
    write_text(path, validation_page.page(answer, figure=figure.name if answer.static else "", version=__version__))
    return [path, figure] if answer.static else [path]


study_robot = VerbCommand(
    "mckibben_benchmark.jumping_robot:robot_fit",
    STUDY,
    ("study robot 0p02_knee_80psi 0p06_65psi --predict 0p09_65psi --out robot.svg",),
    required=("trials",),
    draw=lambda answer, path: style.save(run_figures.overview(answer.fit, answer.trials, title=answer.title), path),
    doing=("fitting", lambda given: None if given["each"] else int(given["evaluations"])),
)
study_loops = VerbCommand(
    "mckibben_benchmark.muscle_loops:loop_study",
    STUDY,
    ("study loops dmsp_10_250_hysteresis --out loops.svg",),
    options={"frictions": "friction"},
    draw=lambda answer, path: style.save(figures.loop_study_figure(answer), path),
    doing=("loops", lambda given: muscle_loops.STAGES),
)
study_validation = VerbCommand(
    "mckibben_benchmark.validation:validation",
    OutputKinds(page=(".md",), result=OBJECT),
    ("study validation --only DMSP-10-250 --law ideal --out validation.md",),
    options={"folder": "data", "laws": "law"},
    writes={"page": _write_page},
    doing=("validation", lambda given: validation.stages(given.get("only", ()), given.get("laws", ()))),
)
