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

from mckibben.errors import InputError

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


__all__ = ["CONFERENCE", "FIGURES", "JOURNAL", "PaperFigure", "figure"]


def figure(identifier: str) -> PaperFigure:
    """A figure by its key.

    Raises:
        InputError: there is none; names those that there are.
    """
    if identifier not in FIGURES:
        raise InputError("figure", identifier, known=FIGURES)
    return FIGURES[identifier]


def _one(key: str, part: str, title: str, caption: str, rows: str, draw: str, *arguments: str) -> PaperFigure:
    """A figure of the first paper; `rows` are words, and `draw` is ``module.function`` of what draws it."""
    recordings = draw.startswith("recordings.") or draw in ("statics.figure_6b", "statics.table")
    drawn = _later(draw, *arguments)
    return PaperFigure(key, JOURNAL, part, title, caption, tuple(rows.split()), drawn, recordings)


def _later(place: str, *arguments: str) -> Callable[[], Figure]:
    module, _, function = place.partition(".")

    def draw() -> Figure:  # loaded at the call, since matplotlib takes a second to load
        drawn: Figure = getattr(importlib.import_module(f"{__package__}.figures_{module}"), function)(*arguments)
        return drawn

    return draw


LOOPS = (
    "Recordings of the simulated machine, all cycles faint and their mean drawn; open circles are Table 1 at "
    "5 bar. The paper's stroke is not printed, and it took another one at each pressure."
)
INFERRED = " The law of this muscle is inferred from two printed constraints."
FIFTH = "Ideal law and law with wall thickness over length; which quantity the panel shows is not in the text."
SYNTHETIC = (
    "The paper's pressures are not published: noise and steps take their place, the distributed tube that of "
    "the sensor."
)
MODEL_ROWS = (
    "static.stiffness_5bar static.stiffness_5bar_per_length static.max_tension static.zero_tension_length "
    "static.work_per_cycle static.threshold_pressure static.passive_stiffness"
)
BOTH = "tube.capacitance_10in3 tube.capacitance_3in3"


def _words(prefix: str, names: str) -> str:
    return " ".join(f"{prefix}.{name}" for name in names.split())


def _table_rows() -> str:
    column = "section_area dynamic_range max_tension stiffness work tension_intensity stiffness_intensity work_density"
    muscles = ("nylon", "fiberglass", "bridgestone")
    return " ".join(
        (
            *(_words(f"table1.{muscle}", column) for muscle in muscles),
            *(f"friction.{muscle}" for muscle in muscles),
            "loop.max_velocity isotonic.mean_power_density isotonic.peak_power_density",
            "energy.valve.efficiency_accumulator energy.maximal.efficiency_accumulator",
            _words("biology", "stiffness_intensity work_density dynamic_range peak_power_density"),
        )
    )


FIRST = (
    _one(
        "1", "I", "Geometry of the muscle",
        "The nylon muscle to scale at rest and shortened, and one thread unrolled. Thread length and turns are "
        "not printed: they follow from the printed Kg and D0.",
        "", "machine.geometry", "1",
    ),
    _one(
        "2", "I", "Dynamic testing machine",
        "Hardware and software of the simulated machine, as its rig file has them; a star marks what the paper "
        "does not print. The paper shows blocks without numbers.",
        "", "machine.machine", "2",
    ),
    _one(
        "3a", "I", "Quasi-static loops, nylon, large range", f"{LOOPS} Dashed is eq. 12 with its printed numbers.",
        "loop.width loop.height friction.nylon loop.pressure_variation loop.rate_ratio table1.nylon.max_tension",
        "recordings.figure_3a",
    ),
    _one(
        "3b", "I", "Quasi-static loops, nylon, small range",
        "As Fig. 3a over half the stroke, the lower end held, as recorded on the simulated machine; thin "
        "and dashed is the loop of Fig. 3a at 5 bar, whose rising path stays.",
        "loop.small_range_ratio loop.rising_path_distance", "recordings.figure_3b",
    ),
    _one(
        "3c", "I", "Quasi-static loops, fiberglass", LOOPS + INFERRED,
        "loop.width_fiberglass friction.fiberglass table1.fiberglass.max_tension", "recordings.figure_3c",
    ),
    _one(
        "3d", "I", "Quasi-static loops, Bridgestone",
        f"{LOOPS} It pulls beyond the paper's cell of 100 N, so that the rig with a cell of 1 kN was taken.",
        "loop.width_bridgestone friction.bridgestone table1.bridgestone.max_tension", "recordings.figure_3d",
    ),
    _one(
        "4", "I", "Dynamic loops of sines",
        "Recorded loops of twelve sines at 5 bar, and their widths over the peak velocity with that at 40 Hz. The "
        "ten frequencies between 1 and 10 Hz are not printed; the lower panel is ours.",
        "loop.sine_width_spread loop.max_velocity", "recordings.figure_4",
    ),
    _one("5a", "I", "Braid angle over length", FIFTH, "static.zero_force_angle", "statics.figure_5a"),
    _one(
        "5b", "I", "Diameter over length", f"{FIFTH} The measured 1.1 cm lies on the inner diameter.",
        "", "statics.figure_5b",
    ),
    _one("5c", "I", "Volume over length", FIFTH, "", "statics.figure_5c"),
    _one("5d", "I", "Tension per pressure over length", FIFTH, "", "statics.figure_5d"),
    _one(
        "5e", "I", "Stiffness per pressure over length",
        "Slope of tension over length and pressure, without and with wall thickness; the paper calls it "
        "constant from 10 to 14 cm.",
        "static.stiffness_per_pressure", "statics.figure_5e",
    ),
    _one(
        "6a", "I", "Linear static model",
        "Terms of eq. 12a at 5 bar with the printed numbers; open circles are Table 1. The non-linear term is not "
        "printed: ours is a stop beyond 1.1 L0.",
        MODEL_ROWS, "statics.figure_6a",
    ),
    _one(
        "6b", "I", "Eq. 13 through ten points",
        "Eq. 13 through ten points of our quasi-static recordings, their friction averaged out; dashed is eq. 13 "
        "with the printed numbers. Which ten points the paper took is not printed.",
        "static.fit_Kg static.fit_Pa static.fit_Lmin static.fit_Fa", "statics.figure_6b",
    ),
    _one(
        "7a", "II", "Pneumatic circuit",
        "Valve, tube and accumulator of the simulated machine in symbols of ISO 1219-1, a sensor at each end "
        "of the tube.",
        "", "machine.figure_7a",
    ),
    _one(
        "7b", "II", "Model with resistance and capacity",
        "The lumped model as an electrical circuit, its capacity V/RT at 300 K.", BOTH, "machine.figure_7b",
    ),
    _one(
        "7c", "II", "Model with inertia",
        "The same with the inertia of the gas. Of the two printed values of L, 126 1/cm lacks a factor of ten.",
        f"{BOTH} tube.inertance tube.inertance_per_cm", "machine.figure_7c",
    ),
    _one(
        "8a", "II", "Quadratic model, 10 in³", f"Pressures of the quadratic model, fitted. {SYNTHETIC}",
        "tube.capacitance_10in3 tube.R1 tube.R2 tube.quadratic_rms_10in3 tube.quadratic_lead", "machine.figure_8a",
    ),
    _one(
        "8b", "II", "Quadratic model, 3 in³", f"Pressures of the quadratic model, fitted again. {SYNTHETIC}",
        "tube.capacitance_3in3 tube.quadratic_rms_3in3", "machine.figure_8b",
    ),
    _one(
        "9a", "II", "Inertial model, 10 in³", f"Pressures of the inertial model, its inertance fitted too. {SYNTHETIC}",
        "tube.capacitance_10in3 tube.inertial_rms_10in3", "machine.figure_9a",
    ),
    _one(
        "9b", "II", "Inertial model, 3 in³",
        f"Pressures of the inertial model. The parameters are those of the 10 in3 accumulator. {SYNTHETIC}",
        "tube.capacitance_3in3 tube.inertial_rms_3in3", "machine.figure_9b",
    ),
    _one(
        "10", "III", "Isometric steps",
        "One rising and one falling step of each range, recorded on the simulated machine with both ends "
        "fixed; open marks lie where the printed times would put them. Dead time and flow of the valve "
        "were inferred from these times.",
        _words("isometric", "valve_delay pressure_to_tension total_delay rise_full rise_half fall_full fall_half"),
        "recordings.figure_10",
    ),
    _one(
        "11", "III", "Isotonic triangles",
        "Pressure, tension, shortening and power at 10 N, 1 Hz and at 50 N, 5 Hz, recorded on the "
        "simulated machine; the printed legend has 1 Hz for both. Peaks depend on how the velocity is "
        "taken, which is not printed.",
        _words(
            "isotonic",
            "work_10N_1Hz mean_power_10N_1Hz peak_power_10N_1Hz work_50N_5Hz mean_power_50N_5Hz peak_power_50N_5Hz "
            "tension_error mean_power_density peak_power_density",
        ),
        "recordings.figure_11",
    ),
    _one(
        "12a", "IV", "Pneumatic cycle of maximal shortening",
        "Compressor and muscle at 5 bar, with exchange from the surroundings and from the accumulator, "
        "the volume that of eq. 38b. V0 and L2 are not printed and were inferred from its joules.",
        _words("energy.maximal", "input input_accumulator"), "statics.figure_12a",
    ),
    _one(
        "12b", "IV", "Mechanical cycle of maximal shortening",
        "Tension over length of the same cycle, 2.5 N of friction taken off the output.",
        _words("energy.maximal", "output efficiency efficiency_accumulator"), "statics.figure_12b",
    ),
    _one(
        "12c", "IV", "Efficiency over pressure",
        "Efficiency Ea of that cycle, full with friction and dashed without; dotted with the volume of "
        "the consistent potential. The printed 0.49 is the value without friction.",
        _words("energy.maximal", "efficiency efficiency_accumulator best_pressure output_below_W12"),
        "statics.figure_12c",
    ),
    _one(
        "13a", "IV", "Pneumatic cycles of isotonic shortening",
        "Both isotonic cycles up to 5 bar; hatched is what the valve throttles. Friction is taken off the "
        "output only, as the printed joules have it.",
        _words("energy", "isotonic.input isotonic.input_accumulator valve.input valve.input_accumulator"),
        "statics.figure_13a",
    ),
    _one(
        "13b", "IV", "Mechanical cycle of isotonic shortening",
        "Tension over length of both isotonic cycles, 2.5 N of friction taken off the output.",
        _words(
            "energy",
            "isotonic.output isotonic.efficiency isotonic.efficiency_accumulator valve.efficiency "
            "valve.efficiency_accumulator",
        ),
        "statics.figure_13b",
    ),
    _one(
        "table1", "discussion", "McKibben and biological muscles",
        "Ours in bold, the printed values in brackets; static numbers from the laws, friction, velocity and "
        "powers from recordings of the simulated machine. The highest printed efficiency is a misprint, and the "
        "peak power depends on how velocity is taken.",
        _table_rows(), "statics.table", "table1",
    ),
)  # fmt: skip


# Figures of the second paper: a key, that of the same figure in the first one, and what draws it.
SECOND = (
    ("1", "1", "machine.geometry"),
    ("2", "2", "machine.machine"),
    ("3a", "", "recordings.both_ranges"),
    ("3b", "3c", "recordings.figure_3c"),
    ("4", "4", "recordings.figure_4"),
    ("5a", "6a", "statics.figure_6a"),
    ("5b", "6b", "statics.figure_6b"),
    ("table1", "table1", "statics.table"),
)
OWN = _one(
    "3a", "I", "Quasi-static loops, nylon, both ranges", f"{LOOPS} Dashed is the large range, full the small one.",
    _words("loop", "width height small_range_ratio rising_path_distance rate_ratio"), "recordings.both_ranges",
)  # fmt: skip

FIGURES: dict[str, PaperFigure] = {one.id: one for one in FIRST}
for _key, _same, _draw in SECOND:
    _id = f"1994-{_key}"
    FIGURES[_id] = FIGURES.get(_same, OWN)._replace(id=_id, paper=CONFERENCE, draw=_later(_draw, _id))
