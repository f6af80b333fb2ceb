"""Width, style and file format of figures: for the screen, in print, in gray, and for a projector.

`figure_style` sets them for a block of code. Every figure drawn in it has the width and is laid out for it, so that text
keeps its size in print.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Any, NamedTuple

from ...documents import JsonValue
from ...errors import InputError
from ...quantities import from_si, in_si, with_unit
from .colours import LIGHT

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
