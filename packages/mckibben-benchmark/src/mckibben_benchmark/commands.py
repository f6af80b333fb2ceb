"""Commands that this package adds to ``mckibben``: ``benchmark``, and the studies of a robot, loops and all laws."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from mckibben._version import __version__
from mckibben.cli._outputs import FIGURE, OBJECT, OutputKinds
from mckibben.cli._verb import Alternative, VerbCommand, VerbsCommand
from mckibben.documents import write_text
from mckibben.report.figures import run_figures, style

from . import figures, muscle_loops, page, run, validation, validation_page

if TYPE_CHECKING:
    from .validation import Validation


run_benchmark = VerbsCommand(
    VerbCommand(
        "mckibben_benchmark.run:benchmark",
        OutputKinds(page=(".md",), result=OBJECT),
        ("benchmark --task map-above-4-bar --model ideal",),
        options={"models": "model", "tasks": "task", "folder": "data", "competitors": "all"},
        writes={"page": lambda answer, path: write_text(path, page.page(answer, version=__version__))},
        doing=(
            "benchmark",
            lambda given: run.stages(given.get("models", ()), given.get("tasks", ()), competitors=given["competitors"]),
        ),
    ),
    (
        Alternative(
            VerbCommand("mckibben_benchmark.tasks:list_tasks", OutputKinds(result=OBJECT), ("benchmark --list",)),
            "--list",
            lambda given: bool(given["list"]),
            flag="List the tasks without running them.",
        ),
    ),
)


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
    draw=lambda answer: run_figures.overview(answer.fit, answer.trials, title=answer.title),
    doing=("fitting", lambda given: None if given["each"] else int(given["evaluations"])),
)
study_loops = VerbCommand(
    "mckibben_benchmark.muscle_loops:loop_study",
    STUDY,
    ("study loops dmsp_10_250_hysteresis --out loops.svg",),
    options={"frictions": "friction"},
    draw=lambda answer: figures.loop_study_figure(answer),
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
