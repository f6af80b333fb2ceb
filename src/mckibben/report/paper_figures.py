"""Every figure of both papers by its number, drawn from our models in the paper's own form.

    FIGURES["3a"].draw()          a matplotlib figure
    figure("12c").caption         what it shows, and what differs from the paper

Keys are the numbers in print; those of the second paper begin with its year, such as ``1994-3a``. Drawing and what it needs
are loaded when a figure is drawn. Figures whose `recordings` is true need recordings of the simulated test machine, the
same as the rows', made once and shared.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from ..errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


JOURNAL, CONFERENCE = "chou1996", "chou1994"


class PaperFigure(NamedTuple):
    """A figure or table of a paper.

    Attributes:
        id: its key in `FIGURES`.
        paper: citation key.
        part: ``I`` to ``IV`` or ``discussion``.
        title: in a few words.
        caption: content of the figure, its origin, and differences from the paper.
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
    """Drawing function of `report.figures.paper`, loaded at the call, since matplotlib takes a second to load."""

    def draw() -> Figure:
        figure: Figure = getattr(importlib.import_module(f"{__package__}.figures.paper.{module}"), function)(*arguments)
        return figure

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
    "static.stiffness_5bar",
    "static.stiffness_5bar_per_length",
    "static.max_tension",
    "static.zero_tension_length",
    "static.work_per_cycle",
    "static.threshold_pressure",
    "static.passive_stiffness",
)
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
    "section_area",
    "dynamic_range",
    "max_tension",
    "stiffness",
    "work",
    "tension_intensity",
    "stiffness_intensity",
    "work_density",
)


def table_rows() -> tuple[str, ...]:
    """Identifiers of the numbers in Table 1."""
    muscles = ("nylon", "fiberglass", "bridgestone")
    biology = ("stiffness_intensity", "work_density", "dynamic_range", "peak_power_density")
    return (
        *(f"table1.{muscle}.{name}" for muscle in muscles for name in COLUMN),
        *(f"friction.{muscle}" for muscle in muscles),
        "loop.max_velocity",
        "isotonic.mean_power_density",
        "isotonic.peak_power_density",
        "energy.valve.efficiency_accumulator",
        "energy.maximal.efficiency_accumulator",
        *(f"biology.{name}" for name in biology),
    )


def second_paper() -> tuple[PaperFigure, ...]:
    """Figures of the second paper."""

    def one(
        key: str,
        title: str,
        caption: str,
        rows: tuple[str, ...],
        at: tuple[str, str],
        *,
        recordings: bool = False,
        part: str = "I",
    ) -> PaperFigure:
        name = f"1994-{key}"
        return PaperFigure(name, CONFERENCE, part, title, caption, rows, later(*at, name), recordings)

    loops = ("loop.width", "loop.height", "loop.small_range_ratio", "loop.rising_path_distance", "loop.rate_ratio")
    return (
        one("1", "Geometry of the muscle", GEOMETRY, (), ("machine", "geometry")),
        one("2", "Dynamic testing machine", MACHINE, (), ("machine", "machine")),
        one(
            "3a",
            "Quasi-static loops, nylon, both ranges",
            LOOPS + " Dashed is the large range, full the small one.",
            loops,
            ("recordings", "both_ranges"),
            recordings=True,
        ),
        one(
            "3b",
            "Quasi-static loops, fiberglass",
            LOOPS + INFERRED_LAW,
            FIBERGLASS_ROWS,
            ("recordings", "figure_3c"),
            recordings=True,
        ),
        one("4", "Dynamic loops of sines", SINES, SINE_ROWS, ("recordings", "figure_4"), recordings=True),
        one("5a", "Linear static model", MODEL, MODEL_ROWS, ("statics", "figure_6a")),
        one("5b", "Eq. 13 through ten points", FIT, FIT_ROWS, ("statics", "figure_6b"), recordings=True),
        one(
            "table1",
            "McKibben and biological muscles",
            TABLE,
            table_rows(),
            ("statics", "table"),
            recordings=True,
            part="discussion",
        ),
    )


__all__ = ["CONFERENCE", "FIGURES", "JOURNAL", "PaperFigure", "figure"]

SYNTHETIC = (
    "The paper's pressures are not published: noise and steps take their place, the distributed tube that of "
    "the sensor."
)


def figure(identifier: str) -> PaperFigure:
    """A figure by its key.

    Raises:
        InputError: there is none; names those that there are.
    """
    if identifier not in FIGURES:
        raise InputError("figure", identifier, known=FIGURES)
    return FIGURES[identifier]


def _static() -> tuple[PaperFigure, ...]:
    def one(
        key: str, title: str, caption: str, rows: tuple[str, ...], at: tuple[str, ...], *, recordings: bool = False
    ) -> PaperFigure:
        return PaperFigure(key, JOURNAL, "I", title, caption, rows, later(*at), recordings)

    fifth = "Ideal law and law with wall thickness over length; which quantity the panel shows is not in the text."
    return (
        one("1", "Geometry of the muscle", GEOMETRY, (), ("machine", "geometry", "1")),
        one("2", "Dynamic testing machine", MACHINE, (), ("machine", "machine", "2")),
        one(
            "3a",
            "Quasi-static loops, nylon, large range",
            LOOPS + " Dashed is eq. 12 with its printed numbers.",
            (
                "loop.width",
                "loop.height",
                "friction.nylon",
                "loop.pressure_variation",
                "loop.rate_ratio",
                "table1.nylon.max_tension",
            ),
            ("recordings", "figure_3a"),
            recordings=True,
        ),
        one(
            "3b",
            "Quasi-static loops, nylon, small range",
            "As Fig. 3a over half the stroke, the lower end held, as recorded on the simulated machine; thin "
            "and dashed is the loop of Fig. 3a at 5 bar, whose rising path stays.",
            ("loop.small_range_ratio", "loop.rising_path_distance"),
            ("recordings", "figure_3b"),
            recordings=True,
        ),
        one(
            "3c",
            "Quasi-static loops, fiberglass",
            LOOPS + INFERRED_LAW,
            FIBERGLASS_ROWS,
            ("recordings", "figure_3c"),
            recordings=True,
        ),
        one(
            "3d",
            "Quasi-static loops, Bridgestone",
            LOOPS + " It pulls beyond the paper's cell of 100 N, so that the rig with a cell of 1 kN was taken.",
            ("loop.width_bridgestone", "friction.bridgestone", "table1.bridgestone.max_tension"),
            ("recordings", "figure_3d"),
            recordings=True,
        ),
        one("4", "Dynamic loops of sines", SINES, SINE_ROWS, ("recordings", "figure_4"), recordings=True),
        one("5a", "Braid angle over length", fifth, ("static.zero_force_angle",), ("statics", "figure_5a")),
        one(
            "5b",
            "Diameter over length",
            fifth + " The measured 1.1 cm lies on the inner diameter.",
            (),
            ("statics", "figure_5b"),
        ),
        one("5c", "Volume over length", fifth, (), ("statics", "figure_5c")),
        one("5d", "Tension per pressure over length", fifth, (), ("statics", "figure_5d")),
        one(
            "5e",
            "Stiffness per pressure over length",
            "Slope of tension over length and pressure, without and with wall thickness; the paper calls it "
            "constant from 10 to 14 cm.",
            ("static.stiffness_per_pressure",),
            ("statics", "figure_5e"),
        ),
        one("6a", "Linear static model", MODEL, MODEL_ROWS, ("statics", "figure_6a")),
        one("6b", "Eq. 13 through ten points", FIT, FIT_ROWS, ("statics", "figure_6b"), recordings=True),
    )


def _circuits() -> tuple[PaperFigure, ...]:
    def one(key: str, title: str, caption: str, rows: tuple[str, ...]) -> PaperFigure:
        return PaperFigure(key, JOURNAL, "II", title, caption, rows, later("machine", f"figure_{key}"))

    both = ("tube.capacitance_10in3", "tube.capacitance_3in3")
    kept = "The parameters are those of the 10 in3 accumulator."
    return (
        one(
            "7a",
            "Pneumatic circuit",
            "Valve, tube and accumulator of the simulated machine in symbols of ISO 1219-1, a sensor at each end "
            "of the tube.",
            (),
        ),
        one(
            "7b",
            "Model with resistance and capacity",
            "The lumped model as an electrical circuit, its capacity V/RT at 300 K.",
            both,
        ),
        one(
            "7c",
            "Model with inertia",
            "The same with the inertia of the gas. Of the two printed values of L, 126 1/cm lacks a factor of ten.",
            (*both, "tube.inertance", "tube.inertance_per_cm"),
        ),
        one(
            "8a",
            "Quadratic model, 10 in³",
            f"Pressures of the quadratic model, fitted. {SYNTHETIC}",
            ("tube.capacitance_10in3", "tube.R1", "tube.R2", "tube.quadratic_rms_10in3", "tube.quadratic_lead"),
        ),
        one(
            "8b",
            "Quadratic model, 3 in³",
            f"Pressures of the quadratic model, fitted again. {SYNTHETIC}",
            ("tube.capacitance_3in3", "tube.quadratic_rms_3in3"),
        ),
        one(
            "9a",
            "Inertial model, 10 in³",
            f"Pressures of the inertial model, its inertance fitted too. {SYNTHETIC}",
            ("tube.capacitance_10in3", "tube.inertial_rms_10in3"),
        ),
        one(
            "9b",
            "Inertial model, 3 in³",
            f"Pressures of the inertial model. {kept} {SYNTHETIC}",
            ("tube.capacitance_3in3", "tube.inertial_rms_3in3"),
        ),
    )


def _shortening() -> tuple[PaperFigure, ...]:
    isometric = (
        "valve_delay",
        "pressure_to_tension",
        "total_delay",
        "rise_full",
        "rise_half",
        "fall_full",
        "fall_half",
    )
    cases = ("10N_1Hz", "50N_5Hz")
    isotonic = [f"{quantity}_{case}" for case in cases for quantity in ("work", "mean_power", "peak_power")]
    return (
        PaperFigure(
            "10",
            JOURNAL,
            "III",
            "Isometric steps",
            "One rising and one falling step of each range, recorded on the simulated machine with both ends "
            "fixed; open marks lie where the printed times would put them. Dead time and flow of the valve "
            "were inferred from these times.",
            tuple(f"isometric.{name}" for name in isometric),
            later("recordings", "figure_10"),
            True,
        ),
        PaperFigure(
            "11",
            JOURNAL,
            "III",
            "Isotonic triangles",
            "Pressure, tension, shortening and power at 10 N, 1 Hz and at 50 N, 5 Hz, recorded on the "
            "simulated machine; the printed legend has 1 Hz for both. Peaks depend on how the velocity is "
            "taken, which is not printed.",
            (
                *(f"isotonic.{name}" for name in isotonic),
                "isotonic.tension_error",
                "isotonic.mean_power_density",
                "isotonic.peak_power_density",
            ),
            later("recordings", "figure_11"),
            True,
        ),
    )


def _energy() -> tuple[PaperFigure, ...]:
    def one(key: str, title: str, caption: str, rows: tuple[str, ...]) -> PaperFigure:
        names = tuple(f"energy.{name}" for name in rows)
        return PaperFigure(key, JOURNAL, "IV", title, caption, names, later("statics", f"figure_{key}"))

    isotonic, valve = "isotonic.", "valve."
    return (
        one(
            "12a",
            "Pneumatic cycle of maximal shortening",
            "Compressor and muscle at 5 bar, with exchange from the surroundings and from the accumulator, "
            "the volume that of eq. 38b. V0 and L2 are not printed and were inferred from its joules.",
            ("maximal.input", "maximal.input_accumulator"),
        ),
        one(
            "12b",
            "Mechanical cycle of maximal shortening",
            "Tension over length of the same cycle, 2.5 N of friction taken off the output.",
            ("maximal.output", "maximal.efficiency", "maximal.efficiency_accumulator"),
        ),
        one(
            "12c",
            "Efficiency over pressure",
            "Efficiency Ea of that cycle, full with friction and dashed without; dotted with the volume of "
            "the consistent potential. The printed 0.49 is the value without friction.",
            (
                "maximal.efficiency",
                "maximal.efficiency_accumulator",
                "maximal.best_pressure",
                "maximal.zero_pressure",
                "maximal.output_below_W12",
            ),
        ),
        one(
            "13a",
            "Pneumatic cycles of isotonic shortening",
            "Both isotonic cycles up to 5 bar; hatched is what the valve throttles. Friction is taken off the "
            "output only, as the printed joules have it.",
            (isotonic + "input", isotonic + "input_accumulator", valve + "input", valve + "input_accumulator"),
        ),
        one(
            "13b",
            "Mechanical cycle of isotonic shortening",
            "Tension over length of both isotonic cycles, 2.5 N of friction taken off the output.",
            (
                isotonic + "output",
                isotonic + "efficiency",
                isotonic + "efficiency_accumulator",
                valve + "efficiency",
                valve + "efficiency_accumulator",
            ),
        ),
    )


def _table() -> PaperFigure:
    draw = later("statics", "table", "table1")
    return PaperFigure(
        "table1", JOURNAL, "discussion", "McKibben and biological muscles", TABLE, table_rows(), draw, True
    )


FIGURES: dict[str, PaperFigure] = {
    one.id: one for one in (*_static(), *_circuits(), *_shortening(), *_energy(), _table(), *second_paper())
}
