"""Width, style and file format of figures: for the screen, in print, in gray, and for a projector.

`figure_style` sets them for a block of code. Every figure drawn in it has the width and is laid out for it, so that text
keeps its size in print.

A figure is drawn with the colours of the screen, where a family of lines of one quantity differs by its shade. On paper
each line of a pair of axes gets a dash of its own, and beyond six lines a marker as well; the legend shows the same.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...documents import JsonValue
from ...errors import InputError
from ...quantities import from_si, in_si, with_unit
from .colours import LIGHT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


SMALL, NORMAL = 8.0, 9.0  # type [pt]
LEAST_TYPE = 6.0  # in print [pt]
LINE, HEAVY, HAIR = 1.3, 1.9, 0.7
SUFFIXES = (".svg", ".pdf", ".png")
STYLES = ("screen", "print", "gray", "projector")
# Usual widths [m]: of a column and of the text of a two-column journal, and of a slide of 4:3.
WIDTHS = {"column": 0.086, "page": 0.178, "slide": 0.128}
NARROWEST, WIDEST = 0.07, 1.2  # [m]
_USUAL_WIDTHS = {"screen": None, "print": "column", "gray": "column", "projector": "slide"}
_DPI = {"screen": 130.0, "print": 600.0, "gray": 600.0, "projector": 500.0}
# The first of these fonts that the machine has is embedded; the last ones come with matplotlib and have every sign.
_FONTS = {
    "sans": ("Arial", "Helvetica", "Liberation Sans", "DejaVu Sans"),
    "serif": ("Times New Roman", "Times", "Liberation Serif", "STIXGeneral", "DejaVu Sans"),
}


class FigureStyle(NamedTuple):
    """Style of figures: its name, their width [inch], and the kind of font; no width leaves each figure its own."""

    name: str = "screen"
    width: float | None = None
    font: str = ""

    @property
    def printed(self) -> bool:
        """Whether figures go to paper: white ground, and lines that differ without colour."""
        return self.name in ("print", "gray")

    @property
    def dpi(self) -> float:
        """Pixels per inch of a PNG file."""
        return _DPI[self.name]


_SCREEN = FigureStyle()
_STYLE: ContextVar[FigureStyle] = ContextVar("style", default=_SCREEN)


def current_style() -> FigureStyle:
    """The style in which figures are drawn here."""
    return _STYLE.get()


def named_style(
    name: str = "print", *, width: str | float | None = None, gray: bool = False, font: str = "sans"
) -> FigureStyle:
    """The style of a name, see `figure_style`."""
    if name not in STYLES:
        raise InputError("style", name, known=STYLES)
    if font not in _FONTS:
        raise InputError("font", font, known=tuple(_FONTS))
    if gray and name not in ("print", "gray"):
        raise InputError("gray", None, f"must be False for the style {name!r}: gray figures are for print")
    wanted = _USUAL_WIDTHS[name] if width is None else width
    inches = None if wanted is None else from_si(_width(wanted), "m", "inch")
    return FigureStyle("gray" if gray else name, inches, "" if name == "screen" else font)


def _width(width: str | float) -> float:
    if isinstance(width, str) and width.strip().isalpha():
        if width not in WIDTHS:
            names = ", ".join(WIDTHS)
            raise InputError("width", width, f"must be a length such as '86 mm', or one of {names}")
        return WIDTHS[width]
    value = float(in_si(width, "m", field="width"))
    if not NARROWEST <= value <= WIDEST:
        ends = " and ".join(with_unit(end, "m", 4) for end in (NARROWEST, WIDEST))
        raise InputError("width", str(width), f"must be between {ends}")
    return value


@contextlib.contextmanager
def figure_style(
    name: str = "print", *, width: str | float | None = None, gray: bool = False, font: str = "sans"
) -> Iterator[FigureStyle]:
    """Draw the figures of a block at a width and in a style.

    Figures that you create yourself in the block take size, type and embedded fonts from it, too.

    Args:
        name: ``print``: 8 pt type on white, and lines that differ without colour; ``gray``: the same without colours;
            ``projector``: large type and thick lines; ``screen``: as without this context.
        width: ``"column"`` (86 mm, usual in print), ``"page"`` (178 mm), ``"slide"`` (128 mm),
            or a length of 70 mm or more [m].
        gray: the style ``gray``.
        font: ``sans`` or ``serif``.

    Raises:
        InputError: the style, the font or the width is not among these.

    Example:
        >>> import mckibben as mk
        >>> with mk.figure_style("print", width="column", gray=True):
        ...     ax = mk.muscle("nylon").plot.force_map()
        >>> mk.save_figure(ax, "map.pdf")
    """
    import matplotlib

    style = named_style(name, width=width, gray=gray, font=font)
    applicable: Any = settings(style)
    with applied(style), matplotlib.rc_context(applicable):
        yield style


@contextlib.contextmanager
def applied(style: FigureStyle) -> Iterator[None]:
    """Draw the figures of this package in a style."""
    token = _STYLE.set(style)
    try:
        yield
    finally:
        _STYLE.reset(token)


def drawn_width(usual: float) -> float:
    """Width that a figure has here [inch]: that of the style, else its usual one."""
    return current_style().width or usual


def settings(style: FigureStyle) -> dict[str, JsonValue]:
    """Settings of matplotlib for a style."""
    settings_of_style = dict(_RC)
    if style.font:
        settings_of_style["font.family"] = list(_families(style.font))
    if style.width is not None:
        settings_of_style |= {
            "figure.figsize": (style.width, 0.72 * style.width),
            "font.size": SMALL,
            "savefig.dpi": style.dpi,
        }
    if style.printed:
        settings_of_style |= {key: "#ffffff" for key in ("figure.facecolor", "savefig.facecolor")}
    if style.name == "gray":
        settings_of_style |= {
            key: gray_of(value)
            for key, value in settings_of_style.items()
            if isinstance(value, str) and value[:1] == "#"
        }
    return settings_of_style


@functools.cache
def _families(font: str) -> tuple[str, ...]:
    """Fonts of a kind that the machine has; matplotlib complains about others at every text."""
    from matplotlib import font_manager

    known = set(font_manager.get_font_names())
    return tuple(name for name in _FONTS[font] if name in known)


def gray_of(colour: str) -> str:
    """The gray of a colour ``#rrggbb`` that looks equally light."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    light = round(0.299 * red + 0.587 * green + 0.114 * blue)
    return f"#{light:02x}{light:02x}{light:02x}"


_RC: dict[str, Any] = {
    "font.family": ["DejaVu Sans"],
    "font.size": NORMAL,
    "text.color": LIGHT["ink"],
    "figure.facecolor": LIGHT["panel"],
    "savefig.facecolor": LIGHT["panel"],
    "axes.facecolor": "none",
    "axes.edgecolor": LIGHT["rule"],
    "axes.linewidth": HAIR,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": NORMAL,
    "axes.titlelocation": "left",
    "axes.labelsize": NORMAL,
    "axes.unicode_minus": True,
    "grid.color": LIGHT["grid"],
    "grid.linewidth": HAIR,
    "xtick.color": LIGHT["rule"],
    "ytick.color": LIGHT["rule"],
    "xtick.labelcolor": LIGHT["ink-2"],
    "ytick.labelcolor": LIGHT["ink-2"],
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "xtick.major.size": 3.0,
    "ytick.major.size": 0.0,
    "lines.linewidth": LINE,
    "lines.markersize": 4.5,
    "svg.fonttype": "none",
    "svg.hashsalt": "mckibben",
    "svg.image_inline": True,
    "pdf.fonttype": 42,
    "path.simplify_threshold": 0.05,
}


PANEL = LIGHT["panel"]
# In multiples of the width of a line; markers distinguish lines beyond these.
PRINT_DASHES: tuple[Any, ...] = (
    "-",
    (0, (5, 2)),
    (0, (1.2, 1.6)),
    (0, (6, 1.8, 1.2, 1.8)),
    (0, (9, 2.5)),
    (0, (3, 1.4, 1.2, 1.4, 1.2, 1.4)),
)
PRINT_MARKERS = ("None", "o", "^", "s", "D", "v", "x")
STROKES = 1.45  # of a projector, relative to those of the screen
LEAST_STROKE = 0.5  # in print [pt]
MARKS = 9  # markers along a line


def restyle(fig: Figure, style: FigureStyle) -> None:
    """Give a finished figure the lines and colours of a style, in place."""
    from matplotlib.text import Text

    if style.printed:
        for ax in fig.axes:
            distinguish(ax)
        _recolour(fig, style)
        for text in [artist for artist in fig.findobj(Text) if artist.get_text()]:
            text.set_fontsize(max(text.get_fontsize(), LEAST_TYPE))
        for line in _lines(fig):
            line.set_linewidth(max(line.get_linewidth(), min(LEAST_STROKE, HAIR)))
    if style.name == "projector":
        for line in _lines(fig):
            line.set_linewidth(STROKES * line.get_linewidth())
            line.set_markersize(1.2 * line.get_markersize())


def distinguish(ax: Axes) -> None:
    """Give the lines of a pair of axes that differ by colour or shade alone dashes, or markers, of their own."""
    used: dict[tuple[Any, str], Any] = {}
    lines = [one for one in series(ax) if appearance(one)[0] != "None"]
    for line in sorted(lines, key=lambda one: -one.get_linewidth()):  # what stands out keeps its dash
        look, bundle = appearance(line), _bundle(line)
        if used.setdefault(look, bundle) == bundle:
            continue
        same = next((old for old, owner in used.items() if owner == bundle), None)
        if same is None:
            same = next((pair for pair in _looks(look) if pair not in used), look)
            used[same] = bundle
        _put(line, same)
    _follow(ax)


def series(ax: Axes) -> list[Line2D]:
    """Lines and rows of marks that show data: neither rules nor single marks."""
    return [line for line in ax.get_lines() if line.get_visible() and np.size(line.get_xdata()) > 2 and _drawn(line)]


def appearance(line: Line2D) -> tuple[object, str]:
    """Dash, in multiples of the width, and marker of a line: what is left of it without colour."""
    return _dash(line), _marker(line)


def _drawn(line: Line2D) -> bool:
    return bool(np.isfinite(np.asarray(line.get_ydata(), float)).any())


def _dash(line: Line2D) -> Any:
    if line.get_linestyle() in ("None", "none", "", " "):
        return "None"
    pattern = getattr(line, "_unscaled_dash_pattern")[1]  # noqa: B009, which matplotlib has no other way to read
    return "-" if not pattern else tuple(round(float(v), 2) for v in pattern)


def _marker(line: Line2D) -> str:
    marker = line.get_marker()
    if marker in (None, "None", "none", "", " "):
        return "None"
    filled = str(line.get_markerfacecolor()) not in ("none", PANEL, "#ffffff")
    return f"{marker if isinstance(marker, str) else 'own'}{'' if filled else ' open'}"


def _bundle(line: Line2D) -> tuple[Any, ...]:
    """What lines have in common that are one series, such as all repetitions of a run."""
    label = str(line.get_label())
    own = line.get_gid() or ("" if label.startswith("_") else label)
    return (str(line.get_color()), line.get_alpha(), round(line.get_linewidth(), 2), own, appearance(line))


def _looks(first: tuple[Any, str]) -> Iterator[tuple[Any, str]]:
    dashes = ["-" if d == "-" else tuple(float(v) for v in d[1]) for d in PRINT_DASHES]
    yield from ((dash, first[1]) for dash in dashes)
    yield from ((dash, marker) for marker in PRINT_MARKERS[1:] for dash in dashes)


def _put(line: Line2D, look: tuple[Any, str]) -> None:
    dash, marker = look
    if dash != "None":
        line.set_linestyle("-" if dash == "-" else (0, dash))
    plain, _, hollow = marker.partition(" ")
    if marker != _marker(line) and plain != "own":
        line.set_marker(plain)
        line.set_markersize(min(line.get_markersize(), 4.0))
        line.set_markerfacecolor(PANEL if hollow else line.get_color())
        line.set_markeredgecolor(line.get_color())
        if dash != "None":
            line.set_markevery(max(np.size(line.get_xdata()) // MARKS, 1))


def _follow(ax: Axes) -> None:
    from matplotlib.legend import Legend
    from matplotlib.lines import Line2D

    named: dict[str, Line2D] = {}
    for line in ax.get_lines():
        for name in (line.get_gid(), str(line.get_label())):
            if name and not name.startswith("_"):
                named.setdefault(name, line)
    for legend in (child for child in ax.get_children() if isinstance(child, Legend)):
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True):
            owner = named.get(text.get_text())
            if owner is not None and isinstance(handle, Line2D):
                _put(handle, appearance(owner))
                handle.set_markevery(None)


# ---- colours and strokes


def _recolour(fig: Figure, style: FigureStyle) -> None:
    """White instead of the screen's paper, and gray instead of colours, in every part of a figure."""
    from matplotlib.collections import Collection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.text import Text

    for artist in _parts(fig):
        if isinstance(artist, Line2D):
            _change(artist, style, "color", "markerfacecolor", "markeredgecolor")
        elif isinstance(artist, Patch):
            fill, edge = artist.get_facecolor(), artist.get_edgecolor()
            artist.set_alpha(None)  # it is in both colours
            artist.set_facecolor(_printed(fill, style))
            artist.set_edgecolor(_printed(edge, style))
        elif isinstance(artist, Collection):
            artist.set_facecolor([_printed(c, style) for c in artist.get_facecolor()])
            artist.set_edgecolor([_printed(c, style) for c in artist.get_edgecolor()])
        elif isinstance(artist, Text):
            _change(artist, style, "color")


def _change(artist: Any, style: FigureStyle, *names: str) -> None:
    for name in names:
        colour = getattr(artist, f"get_{name}")()
        if isinstance(colour, str) and colour in ("none", "auto"):
            continue
        getattr(artist, f"set_{name}")(_printed(colour, style))


def _printed(colour: Any, style: FigureStyle) -> Any:
    from matplotlib.colors import to_hex, to_rgba

    red, green, blue, alpha = to_rgba(colour)
    plain = to_hex((red, green, blue))
    plain = "#ffffff" if plain == PANEL else plain
    plain = gray_of(plain) if style.name == "gray" else plain
    return (*to_rgba(plain)[:3], alpha)


def _parts(fig: Figure) -> Iterator[Any]:
    from matplotlib.text import Annotation, Text

    for artist in fig.findobj():
        yield artist
        if isinstance(artist, Text) and artist.get_bbox_patch() is not None:
            yield artist.get_bbox_patch()
        if isinstance(artist, Annotation) and artist.arrow_patch is not None:
            yield artist.arrow_patch


def _lines(fig: Figure) -> list[Any]:
    from matplotlib.lines import Line2D

    return list(fig.findobj(Line2D))
