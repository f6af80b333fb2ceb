"""Figures for paper and for a projector: white ground, grays, dashes, markers, thick lines, and a smallest type size.

A figure is drawn with the colours of the screen, where a family of lines of one quantity differs by its shade. On paper
each line of a pair of axes gets a dash of its own, and beyond six lines a marker as well; the legend shows the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from .colours import LIGHT
from .formats import HAIR, LEAST_TYPE, FigureStyle, gray_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

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
