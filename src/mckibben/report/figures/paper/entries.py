"""What every figure of the papers states about itself, and what figures of both papers share."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from matplotlib.figure import Figure

JOURNAL, CONFERENCE = "chou1996", "chou1994"


class PaperFigure(NamedTuple):
    """One figure or table of a paper.

    Attributes:
        id: its key in `FIGURES`.
        paper: citation key.
        part: ``I`` to ``IV`` or ``discussion``.
        title: in a few words.
        caption: what is shown, of what it was computed, and what differs from the paper.
        rows: identifiers of the printed numbers that it shows.
        draw: draws it; computes what it needs.
        recordings: whether that takes recordings of the simulated test machine.
    """

    id: str
    paper: str
    part: str
    title: str
    caption: str
    rows: tuple[str, ...]
    draw: Callable[[], Figure]
    recordings: bool = False


def later(module: str, function: str, *arguments: str) -> Callable[[], Figure]:
    """A drawing function of a module beside this one that is loaded when it is called."""

    def draw() -> Figure:
        found: Figure = getattr(importlib.import_module(f"{__package__}.{module}"), function)(*arguments)
        return found

    return draw


GEOMETRY = (
    "The nylon muscle to scale at rest and shortened, and one thread unrolled. Thread length and turns are "
    "not printed: they follow from the printed Kg and D0."
)
MACHINE = (
    "Hardware and software of the simulated machine, as its rig file has them; a star marks what the paper "
    "does not print. The paper shows blocks without numbers."
)
LOOPS = (
    "Recordings of the simulated machine, all cycles faint and their mean drawn; open circles are Table 1 at "
    "5 bar. The paper's stroke is not printed, and it took another one at each pressure."
)
MODEL = (
    "Terms of eq. 12a at 5 bar with the printed numbers; open circles are Table 1. The non-linear term is not "
    "printed: ours is a stop beyond 1.1 L0."
)
FIT = (
    "Eq. 13 through ten points of our quasi-static recordings, their friction averaged out; dashed is eq. 13 "
    "with the printed numbers. Which ten points the paper took is not printed."
)
SINES = (
    "Recorded loops of twelve sines at 5 bar, and their widths over the peak velocity with that at 40 Hz. The "
    "ten frequencies between 1 and 10 Hz are not printed; the lower panel is ours."
)
MODEL_ROWS = (
    "static.stiffness_5bar", "static.stiffness_5bar_per_length", "static.max_tension",
    "static.zero_tension_length", "static.work_per_cycle",
    "static.threshold_pressure", "static.passive_stiffness",
)  # fmt: skip
FIT_ROWS = ("static.fit_Kg", "static.fit_Pa", "static.fit_Lmin", "static.fit_Fa")
SINE_ROWS = ("loop.sine_width_spread", "loop.max_velocity")
INFERRED_LAW = " The law of this muscle is inferred from two printed constraints."
FIBERGLASS_ROWS = ("loop.width_fiberglass", "friction.fiberglass", "table1.fiberglass.max_tension")
TABLE = (
    "Ours in bold, the printed values in brackets; static numbers from the laws, friction, velocity and "
    "powers from recordings of the simulated machine. The highest printed efficiency is a misprint, and the "
    "peak power depends on how velocity is taken."
)
COLUMN = (
    "section_area", "dynamic_range", "max_tension", "stiffness", "work", "tension_intensity", "stiffness_intensity",
    "work_density",
)  # fmt: skip


def table_rows() -> tuple[str, ...]:
    """Identifiers of the numbers in Table 1."""
    muscles = ("nylon", "fiberglass", "bridgestone")
    biology = ("stiffness_intensity", "work_density", "dynamic_range", "peak_power_density")
    return (
        *(f"table1.{muscle}.{name}" for muscle in muscles for name in COLUMN),
        *(f"friction.{muscle}" for muscle in muscles),
        "loop.max_velocity", "isotonic.mean_power_density", "isotonic.peak_power_density",
        "energy.valve.efficiency_accumulator", "energy.maximal.efficiency_accumulator",
        *(f"biology.{name}" for name in biology),
    )  # fmt: skip
