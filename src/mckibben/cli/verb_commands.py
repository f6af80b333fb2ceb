"""Commands of verbs: what the command line adds to a public function, nearly all of it words."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ._outputs import FIGURE, OBJECT, REPORT, SPECIMEN, TABLE, OutputKinds
from ._verb import Shorthand, VerbCommand, Written

if TYPE_CHECKING:
    from ..analysis.energy import WorkingCycles
    from ..studies.comparison import MuscleTable
    from ..studies.sizing import Sizing


tension = VerbCommand(
    "studies.tension:tension",
    OutputKinds(table=TABLE, result=OBJECT),
    (
        "tension nylon --length '12 cm' --pressure '5 bar'",
        "tension nylon --contraction '0:20:5 %' --pressure '1:5 bar' --out map.csv",
    ),
    options={"target_tension": "for", "parameters": "set", "posterior": "from_posterior"},
)


def _draw_cycles(answer: WorkingCycles, path: Path) -> None:
    from ..report.figures import energy_figures, style

    title = answer.specimen.title
    lines = [energy_figures.EfficiencyLine(name, curve) for name, curve in answer.curves.items()]
    loops = energy_figures.loops_figure
    fig = energy_figures.efficiency_figure(lines, title=title) if lines else loops(answer.loops(), title=title)
    style.save(fig, path)


energy = VerbCommand(
    "analysis.energy.working_cycles:energy",
    OutputKinds(figure=FIGURE, table=TABLE, result=OBJECT),
    ("energy nylon --pressure '5 bar' --cycle maximal --curve --out efficiency.svg",),
    options={"cycles": "cycle", "stretched_length": "stretched", "curves": "curve", "parameters": "set"},
    shorthands={"no_friction": Shorthand("friction", "0 N", "Compute the cycles without friction.")},
    draw=_draw_cycles,
)


def _draw_sizing(answer: Sizing, path: Path) -> None:
    from ..report.figures import sizing_figures, style

    style.save(sizing_figures.design_map(answer, law=answer.law), path)


def _save_sized(answer: Sizing, path: Path) -> None:
    from .. import __version__
    from ..specimens import save_specimen

    save_specimen(answer.to_specimen(), path, heading=f"sized by mckibben {__version__}; not measured")


def _write_circuit(answer: Sizing, path: Path) -> None:
    from ..documents import write_text
    from ..studies.sizing import toml_of

    write_text(path, toml_of(answer.to_circuit()))


def _sizing_stages(given: Mapping[str, Any]) -> int:
    from ..studies.sizing import stages

    return stages(lines=bool(given["lines"]), speed="speed" in given)


size = VerbCommand(
    "studies.sizing.size:size",
    OutputKinds(figure=FIGURE, specimen=SPECIMEN, table=TABLE, result=OBJECT),
    ("size --force '50 N' --stroke '3 cm' --pressure '5 bar' --cycles '1 Hz' --working-time '8 h' --out map.svg",),
    options={"rate": "cycles", "tube_length": "tube", "posterior": "from_posterior"},
    required=("stroke", "pressure"),
    draw=_draw_sizing,
    writes={"specimen": _save_sized},
    written={
        "circuit": Written(
            ".toml", "Write the chosen muscle, valve and tube as a circuit into this .toml file.", _write_circuit
        )
    },
    top=5,
    doing=("sizing", _sizing_stages),
    failed=2,
)


diagnose = VerbCommand(
    "studies.diagnosis.fault_fit:diagnose",
    OutputKinds(table=TABLE, result=OBJECT),
    ("diagnose work-loop.nc",),
)


def _draw_compared(answer: MuscleTable, path: Path) -> None:
    from ..report.figures import comparison_figures, style

    if not answer.muscles:
        raise InputError("--out", None, "needs a specimen: a recording alone has no law to draw")
    style.save(comparison_figures.table_figure(answer), path)


def _compare_stages(given: Mapping[str, Any]) -> int | None:
    from ..specimens import muscle_specimen
    from ..studies.comparison import stages

    named = [muscle_specimen(name) for name in given.get("muscles", ())]
    return stages(named, protocols=given["protocols"], match=given.get("match")) or None


compare = VerbCommand(
    "studies.comparison.side_by_side:compare",
    OutputKinds(report=REPORT, figure=FIGURE, table=TABLE, result=OBJECT),
    ("compare nylon fast-fibre --out compared.csv --out compared.svg",),
    options={"recordings": "recording"},
    draw=_draw_compared,
    writes={"report": lambda answer, path: answer.report(path)},
    doing=("comparing", _compare_stages),
    pair="phase='60 deg' or duty=0.3",
)


conform = VerbCommand(
    "hosts.conformance:conform",
    OutputKinds(result=OBJECT),
    ("conform python --scenario hang --out python.json",),
    options={"scenarios": "scenario"},
    doing=("conforming", lambda given: None),
)
