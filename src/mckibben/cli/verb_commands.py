"""Commands of verbs: what the command line adds to a public function, nearly all of it words."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ._outputs import FIGURE, OBJECT, TABLE, OutputKinds
from ._verb import Shorthand, VerbCommand

if TYPE_CHECKING:
    from ..analysis.energy import WorkingCycles


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
