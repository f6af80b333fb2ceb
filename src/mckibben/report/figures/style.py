"""Style of all figures: colours, type, markers, dashes, axes, labels at line ends, and output files.

Colour is data: five colours mean five quantities, the same as in the web interface, and each has its own marker
and dash, so that a figure reads in greyscale too. Whatever is derived (laws, specimens, angles, ratios) is ink.

Figures are plain ``matplotlib.figure.Figure`` objects; pyplot is never imported, for it takes a second to load and
keeps state. Text stays text in SVG files. It is laid out with DejaVu Sans, the widest of the usual sans fonts, so that
nothing collides where another one is drawn.
"""

from __future__ import annotations

import functools
import html
import io
import math
import re
from collections.abc import Callable, Iterable, Sequence
from contextvars import ContextVar
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ...documents import ErrorKeepingFile, write_text, write_whole
from ...errors import InputError
from . import formats, layout, places
from .colours import LIGHT
from .places import ArtistPlace, Sheet, set_place, set_sheet, sheet_of
from .places import shift as shift

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.text import Annotation, Text


INK, INK_2, INK_3 = LIGHT["ink"], LIGHT["ink-2"], LIGHT["ink-3"]
PANEL, GRID, RULE, SUNKEN = LIGHT["panel"], LIGHT["grid"], LIGHT["rule"], LIGHT["sunken"]
CAUTION = LIGHT["caution"]
COLOURS = {quantity: LIGHT[f"q-{quantity}"] for quantity in ("pressure", "tension", "length", "flow", "valve")}
MARKERS = {"pressure": "o", "tension": "^", "length": "s", "flow": "D", "valve": "v"}
# Dashes in multiples of the line width, for quantities that share axes.
DASHES: dict[str, Any] = {
    "pressure": "-",
    "tension": (0, (8, 2)),
    "length": (0, (4, 2.3)),
    "flow": (0, (1.2, 1.8)),
    "valve": (0, (5, 1.7, 1.2, 1.7)),
}
# Dashes for several recordings of one quantity: A, B, C.
RECORDING_DASHES: tuple[Any, ...] = ("-", (0, (3.5, 1.8)), (0, (1.2, 1.8)))
# Custom properties by which a page re-colours a figure in the dark.
PROPERTIES = {
    **{colour: f"--q-{quantity}" for quantity, colour in COLOURS.items()},
    **{INK: "--ink", INK_2: "--ink-2", INK_3: "--ink-3", PANEL: "--panel", GRID: "--grid", RULE: "--rule"},
    **{SUNKEN: "--sunken", CAUTION: "--caution"},
}

SMALL, NORMAL = formats.SMALL, formats.NORMAL  # type [pt]
LINE, HEAVY, HAIR = formats.LINE, formats.HEAVY, formats.HAIR
WIDE, MIDDLE, NARROW = 10.8, 7.2, 3.6  # widths [inch]: a page, two thirds and one third of it
FONTS = "'DejaVu Sans', Inter, 'Segoe UI', 'Helvetica Neue', Arial, sans-serif"
Drawing = TypeVar("Drawing", bound=Callable[..., Any])


_DEPTH: ContextVar[int] = ContextVar("depth", default=0)  # of functions that draw, inside each other


class FigureSettings:
    """The settings of all figures, as a context or a decorator, see `styled`."""

    def __init__(self) -> None:
        self._settings: list[Any] = []

    def __enter__(self) -> None:
        """Apply the settings."""
        import matplotlib

        context = matplotlib.rc_context(_settings(formats.current_style()))
        context.__enter__()
        self._settings.append(context)
        _DEPTH.set(_DEPTH.get() + 1)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Restore the settings."""
        _DEPTH.set(_DEPTH.get() - 1)
        self._settings.pop().__exit__(kind, error, trace)

    def __call__(self, draw: Drawing) -> Drawing:
        """A function that draws with the settings, and finishes its figure."""

        @functools.wraps(draw)
        def drawn(*args: Any, **options: Any) -> Any:
            with styled():
                result = draw(*args, **options)
                if _DEPTH.get() == 1 and formats.current_style() != formats.FigureStyle():
                    finish(result)
            return result

        return drawn  # type: ignore[return-value]


def styled() -> FigureSettings:
    """Apply the settings of all figures, as a context or a decorator; a user's own matplotlib settings are ignored.

    A decorated function may return a figure of `figure`, or its axes. The outermost one lays it out for the width of
    `formats.figure_style`, and gives it that style.
    """
    return FigureSettings()


def finish(result: Any) -> None:
    """Lay out a figure, or that of axes, for the current style; figures that were created elsewhere stay as they are.

    Raises:
        InputError: if a drawing would be reduced until its text is too small to read.
    """
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    fig = result.get_figure(root=True) if isinstance(result, Axes) else result
    if not isinstance(fig, Figure):
        return
    sheet, style = sheet_of(fig), formats.current_style()
    if sheet is None:
        if isinstance(result, Axes) and style.printed:
            formats.distinguish(result)
        return
    set_sheet(fig, None)
    formats.restyle(fig, style)
    if style.width is None:
        return
    if sheet.drawing:
        layout.reduce(fig, sheet.scale)
    else:
        layout.fit_width(fig, style.width, sheet.width)


@functools.cache
def _settings(style: formats.FigureStyle) -> Any:
    import matplotlib

    left_out = ("backend", "backend_fallback", "toolbar", "interactive", "webagg", "tk.", "savefig.directory", "date.")
    plain = {k: v for k, v in matplotlib.rcParamsDefault.items() if not k.startswith(left_out)}
    return plain | formats.settings(style)


def figure(width: float, height: float, *, rows: bool = False, least: float = 0.0) -> Figure:
    """Create an empty figure of a width and height [inch], or of the width of the current style.

    Args:
        width: that it has on a screen.
        height: on a screen; a narrower figure is lower.
        rows: keep the height, since it holds rows of text.
        least: width, below which the figure cannot be read [inch].

    Raises:
        InputError: if the current style is narrower.
    """
    wanted = formats.current_style().width
    if wanted is not None and wanted < least:
        raise layout.too_narrow(least)
    if wanted is not None and not rows:
        height *= min(max((wanted / width) ** 0.5, 0.62), 1.0)
    fig = _empty(wanted or width, height)
    set_sheet(fig, Sheet(width))
    return fig


def drawing(width: float, height: float) -> Figure:
    """Create an empty figure for a drawing of a width and height [inch], which another width reduces as a whole."""
    usual = formats.current_style().width
    scale = 1.0 if usual is None else min(usual / width, 1.0)
    fig = _empty(scale * width, scale * height)
    set_sheet(fig, Sheet(width, scale=scale, drawing=True))
    return fig


def _empty(width: float, height: float) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    fig = Figure(figsize=(width, height))
    FigureCanvasAgg(fig)
    return fig


def quantity_axes(ax: Axes, *, x: tuple[str, str | None], y: tuple[str, str | None]) -> None:
    """Title both axes in the colour of their quantity.

    Args:
        ax: the axes.
        x: title with its unit, such as ``"Length, cm"``, and the quantity, or None for something derived.
        y: the same; it stands above the axis, so that it is read without turning the head.
    """
    ax.set_xlabel(x[0], color=colour(x[1]), fontweight="bold", fontsize=SMALL + 0.5, labelpad=3)
    ax.set_ylabel(y[0], color=colour(y[1]), fontweight="bold", fontsize=SMALL + 0.5, rotation=0, ha="left", va="bottom")
    ax.yaxis.set_label_coords(0.0, 1.0, transform=ax.transAxes + shift(ax, 0, 5))
    for axis in (ax.xaxis, ax.yaxis):
        if axis.get_scale() == "linear":
            tick_numbers(axis)


def tick_numbers(axis: Axis) -> None:
    """Write few round numbers along an axis, at 1, 2 and 5 of each decade of a logarithmic one."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    if axis.get_scale() == "log":
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_minor_formatter(NullFormatter())
    else:
        axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    axis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))


def heading(ax: Axes, text: str, note: str = "", *, above: float = 20.0) -> None:
    """Write a heading over a pair of axes, `above` their top [pt], with a smaller note after it."""
    anchor = ax.transAxes + shift(ax, 0, above)
    head = ax.text(0.0, 1.0, text, transform=anchor, fontsize=NORMAL, fontweight="bold", va="bottom", color=INK)
    quiet = None
    if note:
        quiet = beside(ax, note, (1.0, 0.0), (7, 0), xycoords=head, annotation_clip=False, color=INK_3, va="bottom")
    set_place(head, ArtistPlace(ax, "heading", dy=above, note=quiet))


def colour(quantity: str | None) -> str:
    """Colour of a quantity; ink for derived ones."""
    return COLOURS[quantity] if quantity else INK


def number(value: float, digits: int | None = None, *, sign: bool = False) -> str:
    """Format a number: grouped by thin spaces, with a typographic minus, a dash for none.

    Args:
        value: the number.
        digits: places after the point; as many as needed, six significant digits at most, by default.
        sign: write a plus too.
    """
    if value is None or not math.isfinite(value):
        return "\N{EN DASH}"
    text = f"{value:{'+' if sign else ''},.{6 if digits is None else digits}f}"
    text = text.rstrip("0").rstrip(".") if digits is None else text
    if float(text.replace(",", "")) == 0.0:
        text = text.lstrip("+-")
    return text.replace(",", "\N{THIN SPACE}").replace("-", "\N{MINUS SIGN}")


def pressure_text(pressure_bar: float, *, unit: bool = False) -> str:
    """Format a pressure as a label of a line [bar]."""
    return f"{pressure_bar:.2f}" + ("\N{NO-BREAK SPACE}bar" if unit else "")


_GREEK = {"theta": "θ", "alpha": "α", "beta": "β", "mu": "μ", "eps": "ε", "kappa": "κ", "sigma": "σ", "tau": "τ"}
_LOW = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


def symbol_text(symbol: str, name: str = "") -> str:
    """Format a declared symbol: ``theta0`` becomes θ₀; the name for a parameter without symbol."""
    match = re.fullmatch(r"([A-Za-z]+?)_?(\d*)", symbol)
    if not match:
        return symbol or name
    return _GREEK.get(match[1], match[1]) + match[2].translate(_LOW)


def spread(places: Sequence[float], gap: float, low: float = -math.inf, high: float = math.inf) -> list[float]:
    """Move places along a line as little as possible until neighbours are `gap` apart, between `low` and `high`."""
    order = np.argsort(places, kind="stable")
    blocks: list[list[float]] = []  # [centre, count]
    for at in (float(places[i]) for i in order):
        blocks.append([at, 1])
        while len(blocks) > 1 and blocks[-1][0] - blocks[-2][0] < gap * (blocks[-1][1] + blocks[-2][1]) / 2.0:
            (a, n), (b, m) = blocks[-2:]
            blocks[-2:] = [[(a * n + b * m) / (n + m), n + m]]
        last = blocks[-1]
        half = gap * (last[1] - 1) / 2.0
        last[0] = max(min(last[0], high - half), low + half)
    out = [0.0] * len(places)
    spots = [c + gap * (i - (n - 1) / 2.0) for c, n in blocks for i in range(int(n))]
    for i, at in zip(order, spots, strict=True):
        out[int(i)] = at
    return out


def end_labels(
    ax: Axes, ends: Iterable[tuple[float, float, str]], *, quantity: str | None, gap: float = 10.5, bold: bool = True
) -> None:
    """Label line ends, right of the axes, moved apart where they would overlap.

    Args:
        ax: axes whose limits and place are final.
        ends: x and y of each line's end in data, and its label.
        quantity: whose colour the labels take.
        gap: least distance between labels [pt].
        bold: weight.
    """
    labels = list(ends)
    if not labels:
        return
    scale = 72.0 / ax.figure.dpi
    right = ax.get_window_extent().x1 * scale
    points = [ax.transData.transform((x, y)) * scale for x, y, _ in labels]
    places = spread([p[1] for p in points], gap)
    for (x, y, text), at, place in zip(labels, points, places, strict=True):
        moved = abs(place - at[1]) > 2.0
        offset = (right - at[0] + (13 if moved else 5), place - at[1])
        pointer = {"arrowstyle": "-", "color": INK_3, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 1} if moved else None
        look: dict[str, Any] = {"va": "center_baseline", "ha": "left", "fontweight": "bold" if bold else "normal"}
        look |= {"color": colour(quantity), "annotation_clip": False, "arrowprops": pointer}
        label = beside(ax, text, (x, y), offset, **look)
        set_place(label, ArtistPlace(ax, "end", x, y, 13.0 if moved else 5.0))


def graded(count: int, least: float = 0.4) -> list[float]:
    """Opacities for a family of lines, from the lowest to the highest."""
    return [1.0] if count == 1 else [least + (1.0 - least) * i / (count - 1) for i in range(count)]


def note(
    ax: Axes, text: str, *, x: float = 0.0, y: float = 1.0, dx: float = 0.0, dy: float = 0.0, **options: object
) -> Text:
    """Write a remark at a place of the axes [share of their size], shifted by points."""
    style: dict[str, Any] = {"fontsize": SMALL, "color": INK_3, "va": "center", "ha": "left"} | options
    written = ax.text(x, y, text, transform=ax.transAxes + shift(ax, dx, dy), **style)
    set_place(written, ArtistPlace(ax, "note", x, y, dx, dy))
    return written


def beside(ax: Axes, text: str, at: Any, by: tuple[float, float], **look: Any) -> Annotation:
    """Write small text `by` points from a place, which is one of the data unless `xycoords` says of what."""
    style: dict[str, Any] = {"fontsize": SMALL, "textcoords": "offset points"} | look
    return ax.annotate(text, at, by, **style)


def key(owner: Any, *entries: Any, **look: Any) -> Legend:
    """Add a key of small, close lines without a frame; `entries` and `look` are those of a legend of matplotlib."""
    usual = {"frameon": False, "fontsize": SMALL, "handlelength": 2.6, "labelspacing": 0.35, "borderpad": 0.2}
    legend: Legend = owner.legend(*entries, **usual | look)
    return legend


def rule(ax: Axes, start: float, end: float, above: float) -> None:
    """Draw a thin line over columns of text right of the axes, from and to points right of them, `above` their top [pt]."""
    from matplotlib.lines import Line2D

    box = ax.get_window_extent()
    scale = ax.figure.dpi / 72.0
    x = [1.0 + start * scale / box.width, 1.0 + end * scale / box.width]
    y = 1.0 + above * scale / box.height
    line = ax.add_artist(Line2D(x, [y, y], transform=ax.transAxes, color=RULE, lw=HAIR, clip_on=False))
    set_place(line, ArtistPlace(ax, "rule", dx=start, dy=end))


# ---- to a file


def to_svg(fig: Figure) -> str:
    """Convert the figure to an SVG document: reproducible, without a date."""
    stream = io.StringIO()
    with styled():
        words = {"Date": None, "Creator": None, "Format": None, "Type": None}
        fig.savefig(stream, format="svg", facecolor=fig.get_facecolor(), metadata=words)
    text = stream.getvalue().replace("'DejaVu Sans'", FONTS)
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.S)
    text = re.sub(r"(?:<use [^>]*/>\s*)+", _gathered, text)
    # A hundredth of a point is below what is seen, and keeps files small and equal on all machines.
    return re.sub(r"<[^>]+>", lambda tag: re.sub(r"-?\d+\.\d{3,}", _hundredth, tag[0]), text)


def _gathered(match: re.Match[str]) -> str:
    uses = re.findall(r"<use ([^>]*?)\s*/>", match[0])
    styles = {style[1] if (style := re.search(r' style="([^"]*)"', use)) else "" for use in uses}
    if len(styles) > 1 or len(uses) < 3:
        return match[0]
    bare = "\n".join("<use " + re.sub(r' style="[^"]*"', "", use) + "/>" for use in uses)
    return f'<g style="{styles.pop()}">\n{bare}\n</g>\n'


def _hundredth(match: re.Match[str]) -> str:
    short = f"{float(match[0]):.2f}".rstrip("0").rstrip(".")
    return "0" if short == "-0" else short


def inline_svg(fig: Figure, name: str, label: str) -> str:
    """Convert the figure to an element of a page, in the page's colours, with unique ids.

    Args:
        fig: the figure.
        name: a word that no other figure of the page has.
        label: description for readers who cannot see it.
    """
    text = to_svg(fig)
    text = text[text.index("<svg") :]
    text = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", text, flags=re.S)  # it would reach the whole page
    used = set(re.findall(r'(?:href="|url\()#([^")]+)', text))
    text = re.sub(r'\s+id="([^"]+)"', lambda m: f' id="{name}-{m[1]}"' if m[1] in used else "", text)
    text = re.sub(r'((?:href="|url\()#)', rf"\g<1>{name}-", text)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.S).replace("xlink:href", "href")
    text = re.sub(r"#[0-9a-f]{6}\b", lambda m: f"var({PROPERTIES[m[0]]})" if m[0] in PROPERTIES else m[0], text)
    width, height = (f"{float(v):.0f}" for v in re.findall(r'(?:width|height)="([\d.]+)pt"', text)[:2])
    box = re.search(r'viewBox="([^"]+)"', text)
    assert box is not None
    opening = (
        f'<svg viewBox="{box[1]}" role="img" aria-label="{html.escape(label, quote=True)}" '
        f'style="width:{width}pt;aspect-ratio:{width}/{height};stroke-linejoin:round;stroke-linecap:butt">'
    )
    return re.sub(r"\n\s*", "\n", re.sub(r"^<svg[^>]*>", lambda _: opening, text)).strip()


def save(fig: Figure, path: str | Path, *, dpi: float | None = None) -> None:
    """Write the figure to an ``.svg``, ``.pdf`` or ``.png`` file, with what it shows and without a date.

    Args:
        fig: the figure.
        path: the file; its ending says which.
        dpi: pixels per inch of a PNG file; those of the current style where left out.

    Raises:
        InputError: if the ending is another.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in formats.SUFFIXES:
        raise InputError("path", str(path), f"must be a name that ends in {' or '.join(formats.SUFFIXES)}")
    origin = places.provenance_of(fig)
    if suffix == ".svg":
        write_text(path, places.in_svg(to_svg(fig), origin))
        return
    resolution = dpi or formats.current_style().dpi

    def write(part: Path) -> None:
        stream: Any
        with ErrorKeepingFile(part) as stream:
            words = places.file_entries(origin, suffix)
            fig.savefig(stream, format=suffix[1:], dpi=resolution, facecolor=fig.get_facecolor(), metadata=words)

    with styled():
        write_whole(path, write)


def save_figure(drawn: Figure | Axes, path: str | Path, *, dpi: float | None = None) -> None:
    """Write a figure, or the figure of axes, to an ``.svg``, ``.pdf`` or ``.png`` file.

    Fonts are embedded in a PDF file and text stays text in an SVG file. The file says what it shows and the version that
    drew it.

    Args:
        drawn: figure or axes, such as ``.plot`` returns.
        path: the file; its ending says which.
        dpi: pixels per inch of a PNG file; those of the current style where left out.

    Raises:
        InputError: if the ending is another.

    Example:
        >>> import mckibben as mk
        >>> mk.save_figure(mk.muscle("nylon").plot.force_map(), "map.pdf")
    """
    from matplotlib.axes import Axes

    fig = drawn.get_figure(root=True) if isinstance(drawn, Axes) else drawn
    assert fig is not None
    save(fig, path, dpi=dpi)
