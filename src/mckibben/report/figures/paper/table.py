"""Table 1 of both papers: three muscles and biological muscle, our values with the printed ones in brackets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from ....analysis import characteristics
from ....quantities import from_si
from ....reproduction import part1
from ....specimens import specimen
from .. import style
from ..style import CAUTION, HAIR, INK, INK_2, INK_3, NORMAL, RULE, SMALL, WIDE, number
from .common import as_printed, label, mark, outcome, shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


MUSCLES = {"nylon": "Nylon shell", "fiberglass": "Fiberglass shell", "bridgestone": "Bridgestone"}
COLUMNS = (0.3, 2.5, 4.5, 6.3, 8.2)  # where the columns begin [inch]
ROW, HEAD, FOOT = 0.27, 0.95, 0.75  # [inch]
CM = from_si(1.0, "m", "cm")


class TableEntry(NamedTuple):
    """Our value and the printed one as text, either empty.

    A mark as of `Entry`, or ``‡`` for values taken from the paper.
    """

    ours: str = ""
    paper: str = ""
    mark: str = ""


def cells() -> list[tuple[str, str, tuple[TableEntry, ...]]]:
    """The rows in the paper's order: property, unit, and a cell for each muscle and for biological muscle."""
    bio = part1.muscle()
    ends = characteristics.dynamic_range(bio.active_curve)
    top, speed = number(part1.INTENSITY * from_si(1.0, "N/m^2", "N/cm^2")), number(part1.FASTEST)
    each = tuple(MUSCLES)
    blank = (TableEntry(), TableEntry())
    return [
        ("Resting length (L₀)", "cm", (*(_taken(number(_rest(m) * CM)) for m in each), TableEntry())),
        (
            "Dynamic range",
            "L₀",
            (*(_range(m) for m in each), TableEntry(f"{ends.shortest:.3f}–{ends.longest:.3f}", "0.64–1.12")),
        ),
        ("Maximum tension", "N", (*(_cell(f"table1.{m}.max_tension") for m in each), TableEntry())),
        ("Stiffness", "N/L₀", (*(_cell(f"table1.{m}.stiffness") for m in each), TableEntry())),
        ("Work per cycle", "N L₀", (*(_cell(f"table1.{m}.work") for m in each), TableEntry())),
        ("Cross section area", "cm²", (*(_cell(f"table1.{m}.section_area") for m in each), TableEntry())),
        ("Tension intensity", "N/cm²", (*(_cell(f"table1.{m}.tension_intensity") for m in each), _taken(top))),
        (
            "Stiffness intensity",
            "N/(L₀ cm²)",
            (*(_cell(f"table1.{m}.stiffness_intensity") for m in each), _cell("biology.stiffness_intensity")),
        ),
        (
            "Work density per cycle",
            "J/cm³",
            (*(_cell(f"table1.{m}.work_density") for m in each), _cell("biology.work_density")),
        ),
        ("Coulomb friction", "N", (*(_cell(f"friction.{m}") for m in each), TableEntry("0", "0"))),
        ("Maximum velocity", "L₀/s", (_fastest(), *blank, _taken(f"2–8 or {speed}"))),
        ("Average power density", "W/cm³", (_cell("isotonic.mean_power_density"), *blank, TableEntry())),
        (
            "Peak power density",
            "W/cm³",
            (_cell("isotonic.peak_power_density"), *blank, _cell("biology.peak_power_density")),
        ),
        ("Energy efficiency", "-", (_efficiency(), *blank, TableEntry("", "0.2–0.25"))),
    ]


def _rest(muscle: str) -> float:
    return specimen(muscle).property_si("rest_length", "m")


def _taken(words: str) -> TableEntry:
    return TableEntry(words, words, "‡")


def _cell(identifier: str, digits: int = 3) -> TableEntry:
    one = outcome(identifier)
    assert one.ours is not None
    return TableEntry(shown(one.ours, digits), as_printed(one.row.paper), mark(one.row))


def _range(muscle: str) -> TableEntry:
    """Working range: the lower end where the law's tension ends at 5 bar, the upper end as given."""
    column = part1.table1(muscle)
    shortest, upper = (v / column.rest_length for v in (column.zero_tension_length, column.upper_length))
    width = outcome(f"table1.{muscle}.dynamic_range").row.paper
    assert isinstance(width, float)
    return TableEntry(f"{shortest:.3f}–{upper:.2f}", f"{number(round(upper - width, 3))}–{number(round(upper, 3))}")


def _fastest() -> TableEntry:
    """A velocity up to which no viscous friction was seen, so a lower limit."""
    cell = _cell("loop.max_velocity", 2)
    return TableEntry(f"> {cell.ours}", f"> {cell.paper}", cell.mark)


def _efficiency() -> TableEntry:
    """Range of efficiencies with the accumulator; 0.49 is the misprint of Part IV."""
    low, high = (outcome(f"energy.{name}.efficiency_accumulator") for name in ("valve", "maximal"))
    assert low.ours is not None and high.ours is not None
    words = "–".join(as_printed(o.row.paper) for o in (low, high))
    return TableEntry(f"{low.ours:.2f}–{high.ours:.2f}", words, "†")


@style.styled()
def table(figure: str) -> Figure:
    """Draw the table, our values in bold and the printed ones in brackets."""
    rows = cells()
    high = HEAD + ROW * len(rows) + FOOT
    fig = style.drawing(WIDE, high)
    ax = fig.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    ax.set_xlim(0.0, WIDE)
    ax.set_ylim(high, 0.0)
    ax.text(COLUMNS[0], 0.25, label(figure), fontsize=NORMAL, fontweight="bold", va="center")
    words = "McKibben and biological muscles at 5 bar: ours, and printed in brackets"
    ax.text(COLUMNS[0] + 1.1, 0.25, words, fontsize=SMALL, color=INK_3, va="center")
    for x, words in zip(COLUMNS, ("", *MUSCLES.values(), "Biological muscles"), strict=True):
        ax.text(x, HEAD - 0.2, words, fontsize=SMALL, fontweight="bold", va="center", color=INK_2)
    lines = [HEAD - 0.05, HEAD + ROW * len(rows) + 0.02]
    for y in lines:
        ax.plot([COLUMNS[0], WIDE - 0.3], [y, y], color=INK_3, lw=0.8)
    for i, (words, unit, row) in enumerate(rows):
        y = HEAD + ROW * (i + 0.5)
        head = words if unit == "-" else f"{words}, {unit}"
        ax.text(COLUMNS[0], y, head, fontsize=SMALL, va="center_baseline", color=INK)
        for x, cell in zip(COLUMNS[1:], row, strict=True):
            _write(ax, x, y, cell)
        if i:
            ax.plot([COLUMNS[0], WIDE - 0.3], [HEAD + ROW * i] * 2, color=RULE, lw=HAIR, zorder=1)
    foot = (
        "* an input of ours was inferred from the print   ‡ ours is taken from the paper   "
        "† misprint: 2.59 J over 5.50 J is 0.471   § open",
        "Friction of fiberglass and Bridgestone and all powers come from recordings; their notes are with the rows.",
    )
    for i, words in enumerate(foot):
        ax.text(COLUMNS[0], high - FOOT + 0.28 + 0.2 * i, words, fontsize=SMALL, color=INK_3, va="center")
    return fig


def _write(ax: Axes, x: float, y: float, cell: TableEntry) -> None:
    look: dict[str, Any] = {"fontsize": SMALL, "va": "center_baseline"}
    paper = f"({cell.paper})" if cell.paper else ""
    if not cell.ours:
        ax.text(x, y, paper or "–", color=INK_3 if not paper else INK_2, **look)
        return
    first = ax.text(x, y, cell.ours + cell.mark.replace("†", ""), color=INK, fontweight="bold", **look)
    colour = CAUTION if cell.mark == "†" else INK_2
    ax.annotate(
        paper + ("†" if cell.mark == "†" else ""),
        (1.0, 0.0),
        xycoords=first,
        xytext=(6, 0),
        textcoords="offset points",
        va="bottom",
        fontsize=SMALL,
        color=colour,
    )
