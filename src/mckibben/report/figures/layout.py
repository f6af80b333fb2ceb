"""Layout of a finished figure for a width: panels beside or below each other, keys below them, headings in lines.

The functions that draw know nothing about the width of a page. They place axes for a screen and write texts at distances
from them in points. `fit_width` measures what stands around each pair of axes, gives the axes the room that is left, stacks
panels that would become too narrow, moves keys and lists from the right of the axes below them, and breaks long lines.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ...errors import InputError
from ...quantities import from_si
from .formats import LEAST_TYPE, SMALL
from .places import ArtistPlace, BannerRow, margins_of, place_of, set_place, shift

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import XAxis, YAxis
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.text import Text

WORDS = "_mckibben_words"  # attribute of a text whose lines were broken
EDGE = 0.05  # round the figure [inch]
APART = 0.12  # between panels [inch]
LEAST, LEAST_PART = 0.8, 0.4  # width of axes [inch], and share of their usual width, below which panels are stacked
UNEVEN = 0.35  # by which margins of panels below each other may be wider than needed [inch]
COVER = 0.6  # share of the axes that a key in them may cover
SHARE = 0.6  # of its panel that the axes must have; else what stands right of them moves below
LEAST_REDUCED = 4.8  # size that the smallest type of a reduced drawing would have; it is then drawn larger [pt]
LEADING = 1.25  # of lines of text, in their size


@dataclass
class Panel:
    """Axes that belong together: the lowest has the title of the shared axis.

    Args:
        axes: from the top.
        around: what stands left, right, above and below of the axes [inch].
        gaps: between the axes [inch].
    """

    axes: list[Axes]
    around: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    gaps: list[float] = field(default_factory=list)


def fit_width(fig: Figure, width: float, usual: float) -> None:
    """Lay out a finished figure for a width [inch]; its height follows.

    Args:
        fig: the figure; the heights of its axes are kept.
        width: of the figure, which it has already [inch].
        usual: width that it has on a screen [inch].
    """
    layout = _Layout(fig, width, usual)
    layout.place()


def too_narrow(least: float) -> InputError:
    """The refusal of a figure that needs at least a width [inch]."""
    return InputError("width", None, f"must be at least {math.ceil(from_si(least, 'inch', 'mm'))} mm for this figure")


def reduce(fig: Figure, scale: float) -> None:
    """Reduce type and strokes of a drawing that was drawn at a scale.

    Raises:
        InputError: if the type becomes too small to read.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.text import Text

    if SMALL * scale < LEAST_REDUCED:
        raise too_narrow(fig.get_size_inches()[0] * LEAST_REDUCED / (SMALL * scale))
    for text in fig.findobj(Text):
        text.set_fontsize(max(scale * _size(text), LEAST_TYPE))
    for line in fig.findobj(Line2D):
        line.set_linewidth(scale * line.get_linewidth())
        line.set_markersize(scale * line.get_markersize())
    for patch in fig.findobj(Patch):
        patch.set_linewidth(scale * patch.get_linewidth())


class _Layout:
    """Panels of a figure in rows, with the texts that belong to each."""

    def __init__(self, fig: Figure, width: float, usual: float) -> None:
        self.fig, self.width = fig, width
        primary: list[Axes] = []
        for ax in fig.axes:
            if not any(_same_box(ax, other) for other in primary):
                primary.append(ax)
        self.primary = primary
        self.twins = {ax: [t for t in fig.axes if t is not ax and _same_box(t, ax)] for ax in self.primary}
        self.heights = {ax: self.inches(ax)[3] for ax in self.primary}
        self.rows = _rows(self.primary)
        self.widths = {ax: self.inches(ax)[2] for ax in self.primary}
        self.moved: set[Axes] = set()
        self.usual = usual
        self.measured: dict[Axes, tuple[float, float, float, float]] = {}  # by `around`, until something moves
        self.lengths: dict[tuple[str, int], float] = {}  # of texts [pt]
        self.under: list[Any] = []  # keys, and texts of lists, that have been moved below their axes

    def inches(self, ax: Axes) -> tuple[float, float, float, float]:
        """Left, lower edge, width and height of axes [inch]."""
        wide, high = self.fig.get_size_inches()
        x, y, w, h = ax.get_position().bounds
        return x * wide, y * high, w * wide, h * high

    # ---- horizontally

    def place(self) -> None:
        # Titles above the axes are broken where they would not fit; they do not push the axes.
        titles = [label for ax in self.fig.axes if (label := ax.yaxis.label).get_visible()]
        for ax in self.primary:
            for text in self.headings(ax):
                text.set_in_layout(False)
        for label in titles:
            label.set_visible(False)
        bands = self.bands()
        for _ in range(2):
            for band in bands:
                self.across(band, bands)
            self.settle()
        for ax in self.primary:
            for text in self.headings(ax):
                text.set_in_layout(True)
        for label in titles:
            label.set_visible(True)
        self.measured.clear()
        self.down(bands)

    def bands(self) -> list[list[Panel]]:
        # Keys can stand below their axes; they do not decide.
        keys = [
            one for ax in self.primary for key in self.keys(ax) for one in (key if isinstance(key, list) else [key])
        ]
        for key in keys:
            key.set_in_layout(False)
        bands: list[list[Panel]] = []
        most = max(len(row) for row in self.rows)
        for count in (n for n in range(most, 0, -1) if most % n == 0):
            bands = [row[i : i + count] for row in self.rows for i in range(0, len(row), count)]
            self.estimate(count)
            for band in bands:
                self.measure(band)
            if all(self.fits(band, bands) for band in bands):
                break
        for key in keys:
            key.set_in_layout(True)
        self.measured.clear()
        return bands

    def estimate(self, count: int) -> None:
        """Make the axes about as wide as they become with `count` panels side by side: texts stand out of narrow ones."""
        wide = (self.width - 2.0 * EDGE - APART * (count - 1)) / count
        for ax in self.primary:
            _, y, _, tall = ax.get_position().bounds
            for one in (ax, *self.twins[ax]):
                one.set_position((0.12, y, max(wide - 0.65, 0.4) / self.width, tall))
        self.measured.clear()
        self.settle()

    def shares(self, band: list[Panel], bands: list[list[Panel]]) -> list[float]:
        count = max(len(one) for one in bands)
        if count < max(len(row) for row in self.rows):
            return [1.0] * max(len(band), count)
        return [max(self.widths[ax] for ax in panel.axes) for panel in band]

    def room(self, band: list[Panel], bands: list[list[Panel]]) -> float:
        """Width that the axes of a band share [inch]."""
        wide = max(len(one) for one in bands)
        ends = self.margins(wide, bands) if self.aligned(bands) else [(p.around[0], p.around[1]) for p in band]
        return self.width - 2.0 * EDGE - APART * (len(ends) - 1) - sum(a + b for a, b in ends)

    def aligned(self, bands: list[list[Panel]]) -> bool:
        return len({len(row) for row in self.rows}) == 1 or len(bands) > len(self.rows)

    def margins(self, count: int, bands: list[list[Panel]]) -> list[tuple[float, float]]:
        """What the panels of each column have left and right of their axes [inch]."""
        return [
            (
                max((band[i].around[0] for band in bands if len(band) > i), default=0.0),
                max((band[i].around[1] for band in bands if len(band) > i), default=0.0),
            )
            for i in range(count)
        ]

    def fits(self, band: list[Panel], bands: list[list[Panel]]) -> bool:
        """Whether all axes of a band would be wide enough."""
        shares, room = self.shares(band, bands), self.room(band, bands)
        return all(
            room * share / sum(shares) >= max(LEAST, LEAST_PART * self.usual * self.widths[ax] / self.width)
            for panel, share in zip(band, shares, strict=False)
            for ax in panel.axes
        )

    def across(self, band: list[Panel], bands: list[list[Panel]]) -> None:
        """Place the axes of a band from left to right."""
        wide, high = self.fig.get_size_inches()
        self.measure(band)
        self.clear_right(band, bands)
        shares, room = self.shares(band, bands), self.room(band, bands)
        columns = self.margins(max(len(b) for b in bands), bands) if self.aligned(bands) else None
        x = EDGE
        for i, panel in enumerate(band):
            before, after = columns[i] if columns else (panel.around[0], panel.around[1])
            across = max(room * shares[i] / sum(shares), 0.3)
            if max(len(b) for b in bands) == 1:
                # Panels below each other have common edges, unless one of them would lose much of its width.
                ends = before + across + after
                before = before if before - panel.around[0] < UNEVEN else panel.around[0]
                after = after if after - panel.around[1] < UNEVEN else panel.around[1]
                across = ends - before - after
            for ax in panel.axes:
                _, y, _, tall = self.inches(ax)
                for one in (ax, *self.twins[ax]):
                    one.set_position(((x + before) / wide, y / high, across / wide, tall / high))
            x += before + across + after + APART
        self.measured.clear()
        for i, panel in enumerate(band):
            end = self.inches(band[i + 1].axes[0])[0] - band[i + 1].around[0] - APART if i + 1 < len(band) else None
            for ax in panel.axes:
                self.headings_in(ax, (self.width - EDGE if end is None else end) - self.inches(ax)[0])

    def clear_right(self, band: list[Panel], bands: list[list[Panel]]) -> None:
        """Move keys and lists below the axes where they leave these too little room."""
        count = max(len(one) for one in bands)
        whole = (self.width - 2.0 * EDGE - APART * (count - 1)) / count
        for panel in band:
            keyed = {ax: keys for ax in panel.axes if (keys := [k for k in self.keys(ax) if self.moves(k, ax, whole)])}
            if self.moved.isdisjoint(panel.axes) and not any(self.crowded(ax, whole) for ax in keyed):
                continue
            for ax, keys in keyed.items():
                # The only key of axes below each other belongs to all of them.
                self.below(panel.axes[-1] if len(keyed) == 1 else ax, keys, whole - panel.around[0])
                self.moved.add(ax)
        self.measure(band)

    def moves(self, key: Any, ax: Axes, whole: float) -> bool:
        """Whether a key may stand below its axes: it stands beside them, or would cover most of them."""
        wide = self.extent(key).width / self.fig.dpi
        return key in self.under or self.beyond(key, ax) or wide > COVER * (whole - self.around(ax)[0])

    def crowded(self, ax: Axes, whole: float) -> bool:
        left, right, _, _ = self.around(ax)
        inside = any(not self.beyond(key, ax) and self.moves(key, ax, whole) for key in self.keys(ax))
        above = any(self.extent(key).y0 > ax.get_window_extent().y1 - 2.0 for key in self.keys(ax))
        return inside or above or whole - left - right < SHARE * (whole - left)

    def keys(self, ax: Axes) -> list[Any]:
        """Legends and lists of notes that belong to axes; a list is a list of texts."""
        from matplotlib.legend import Legend

        every = [k for k in (*ax.get_children(), *self.fig.legends) if isinstance(k, Legend) and k.get_visible()]
        legends = [k for k in every if _owner(k, ax) is ax]
        block = [t for t in ax.texts if _beside(t)]
        return ([block] if block else []) + legends

    def extent(self, key: Any) -> Any:
        """Box of a key [pixel]."""
        from matplotlib.transforms import Bbox

        members = key if isinstance(key, list) else [key]
        return Bbox.union([k.get_window_extent(self.renderer) for k in members])

    def beyond(self, key: Any, ax: Axes) -> bool:
        box, own = self.extent(key), ax.get_window_extent()
        return bool(box.x0 > own.x1 - 2.0 or box.y0 > own.y1 - 2.0)

    def below(self, ax: Axes, keys: Sequence[Any], width: float) -> None:
        """Write keys below axes, one after the other, in as many columns as fit a width [inch]."""
        for key in keys:
            for member in key if isinstance(key, list) else [key]:
                member.set_in_layout(False)
        self.measured.clear()
        foot = 72.0 * self.around(ax)[3] + 5.0
        for key in keys:
            if isinstance(key, list):
                # Write a list of notes below axes, its top a distance below them [pt]; return its height [pt]
                places = [place for text in key if (place := place_of(text)) is not None]
                left, top = min(p.dx for p in places), max(p.dy for p in places)
                for text, place in zip(key, places, strict=True):
                    text.set_transform(ax.transAxes + shift(ax, place.dx - left, place.dy - top - foot - 4.0))
                    text.set_position((0.0, 0.0))
                foot += top - min(p.dy for p in places) + 12.0
                self.under += [one for one in key if one not in self.under]
                continue
            legend = _in_columns(key, ax, foot, 72.0 * width, self.renderer)
            self.under = [one for one in self.under if one is not key] + [legend]
            foot += legend.get_window_extent(self.renderer).height * 72.0 / self.fig.dpi + 3.0
            set_place(legend, ArtistPlace(ax, "key"))
        for key in keys:
            for member in key if isinstance(key, list) else [key]:
                member.set_in_layout(True)
        self.measured.clear()

    # ---- what stands around axes

    @property
    def renderer(self) -> Any:
        return self.fig.canvas.get_renderer()  # type: ignore[attr-defined]

    def headings(self, ax: Axes) -> list[Text]:
        headings: list[Text] = []
        for text in ax.texts:
            place = place_of(text)
            if place is not None and place.kind in ("heading", "note") and place.y == 1.0 and place.dy > 0.0:
                if place.kind == "heading" or place.x == 0.0:
                    headings.append(text)
                if place.note is not None:
                    headings.append(place.note)
        return headings

    def around(self, ax: Axes) -> tuple[float, float, float, float]:
        """What stands left, right, above and below of axes, headings left out [inch]."""
        if ax not in self.measured:
            box, per = ax.get_window_extent(), self.fig.dpi
            boxes = beside = self.boxes(ax)
            if counted := [one for one in self.under if one.get_in_layout()]:
                for one in counted:
                    one.set_in_layout(False)
                beside = self.boxes(ax)  # a key below the axes takes the width that there is
                for one in counted:
                    one.set_in_layout(True)
            self.measured[ax] = (
                max((box.x0 - min(b.x0 for b in beside)) / per, 0.0),
                max((max(b.x1 for b in beside) - box.x1) / per, 0.0),
                max((max(b.y1 for b in boxes) - box.y1) / per, 0.0),
                max((box.y0 - min(b.y0 for b in boxes)) / per, 0.0),
            )
        return self.measured[ax]

    def boxes(self, ax: Axes) -> list[Any]:
        """Boxes of axes and of what belongs to them [pixel]."""
        keys = [k for k in self.fig.legends if _owner(k, ax) is ax and k.get_in_layout() and k.get_visible()]
        boxes = [one.get_tightbbox(self.renderer) for one in (ax, *self.twins[ax])]
        return [b for b in boxes if b is not None] + [k.get_window_extent(self.renderer) for k in keys]

    def measure(self, band: Iterable[Panel]) -> None:
        for panel in band:
            all_around = [self.around(ax) for ax in panel.axes]
            panel.around = (
                max(a[0] for a in all_around),
                max(a[1] for a in all_around),
                all_around[0][2],
                all_around[-1][3],
            )
            panel.gaps = [a[3] + b[2] + 0.05 for a, b in zip(all_around[:-1], all_around[1:], strict=True)]

    # ---- texts

    def headings_in(self, ax: Axes, room: float) -> None:
        """Write headings and notes above axes in lines of a width [inch], one above the other."""
        room = 72.0 * room
        current = 5.0
        titles = [one.yaxis.label for one in (ax, *self.twins[ax]) if one.yaxis.label.get_text() and one.axison]
        if titles:
            lines = 1
            for title in titles:
                lines = max(lines, self.wrap(title, room / len(titles)))
            current += lines * LEADING * 8.5 + 2.0
        if ax.child_axes:
            tops = [box.y1 for child in ax.child_axes if (box := child.get_tightbbox(self.renderer)) is not None]
            top = max(tops, default=0.0)
            current = max(current, (top - ax.get_window_extent().y1) * 72.0 / self.fig.dpi + 4.0)
        groups: dict[float, list[tuple[Text, ArtistPlace]]] = {}
        for text in ax.texts:
            place = place_of(text)
            if place is not None and place.kind in ("heading", "note") and place.y == 1.0 and place.dy > 0.0:
                groups.setdefault(place.dy, []).append((text, place))
        for dy in sorted(groups):
            if len(groups[dy]) == 1 and groups[dy][0][1].x == 0.0:
                current = self.line(*groups[dy][0], current, room)
            elif titles and all(self.points(t) + self.points(s) + 10.0 < room for t in titles for s, _ in groups[dy]):
                current = max(dy + 12.0, current)
            else:
                at = max(current, dy)
                for text, place in groups[dy]:
                    text.set_transform(_anchor(place._replace(dy=at)))
                current = max(at + 11.0, current)

    def line(self, text: Text, place: ArtistPlace, current: float, room: float) -> float:
        """Write a heading or note at a height above its axes [pt]; return the height above it [pt]."""
        at = max(current, place.dy) if place.dy - current <= 4.0 else current + 3.0
        width = room - place.dx
        note = place.note
        text.set_verticalalignment("bottom")
        count = self.wrap(text, width)
        if note is not None:
            if count == 1 and self.points(text) + 7.0 + self.points(note, _words(note)) <= width:
                note.set_text(_words(note))
            else:
                lines = self.wrap(note, width)
                note.xy, note.xyann = (0.0, 0.0), (0.0, -2.0)
                note.set_verticalalignment("top")
                at += lines * LEADING * _size(note) + 2.0
        text.set_transform(_anchor(place._replace(dy=at)))
        return at + count * LEADING * _size(text) + 1.0

    def points(self, text: Text, words: str | None = None) -> float:
        """Width of a text [pt]."""
        shown, font = text.get_text() if words is None else words, text.get_fontproperties()
        key = shown, hash(font)
        if key not in self.lengths:
            lines = shown.split("\n")
            wide = max(self.renderer.get_text_width_height_descent(line, font, ismath="$" in line)[0] for line in lines)
            self.lengths[key] = float(wide) * 72.0 / self.fig.dpi
        return self.lengths[key]

    def wrap(self, text: Text, room: float) -> int:
        """Break a text in lines of a width [pt]; return their number."""
        words = _words(text)
        lines = [words]
        while (wide := self.points(text, "\n".join(lines))) > room:
            longest = max(map(len, lines))
            letters = max(min(longest - 1, int(1.03 * longest * room / wide)), 1)
            broken = textwrap.wrap(words, letters, break_long_words=False, break_on_hyphens=False) or [""]
            if broken == lines:
                break
            lines = broken
        text.set_text("\n".join(lines))
        return len(lines)

    def settle(self) -> None:
        """Adapt what depends on the width of the axes: ticks, titles below, labels at line ends, rules."""
        for ax in self.primary:
            wide = self.inches(ax)[2]
            label = ax.xaxis.label
            if label.get_text() and ax.axison:
                self.wrap(label, 72.0 * (wide + 0.2))
            _fewer_ticks(ax.xaxis, self.renderer)
            _fewer_ticks(ax.yaxis, self.renderer)
            box = ax.get_window_extent()
            for text in ax.texts:
                place = place_of(text)
                if place is not None and place.kind == "end":
                    at = ax.transData.transform((place.x, place.y))[0]
                    text.xyann = ((box.x1 - at) * 72.0 / self.fig.dpi + place.dx, text.xyann[1])  # type: ignore[attr-defined]
            for line in ax.get_children():
                place = place_of(line)
                if place is not None and place.kind == "rule":
                    line.set_xdata([1.0 + d * self.fig.dpi / 72.0 / box.width for d in (place.dx, place.dy)])  # type: ignore[attr-defined]
        self.measured.clear()

    # ---- vertically

    def down(self, bands: list[list[Panel]]) -> None:
        """Place all axes from the top to the bottom, and give the figure its height."""
        for band in bands:
            self.measure(band)
        depths = []
        for band in bands:
            if len({len(p.gaps) for p in band}) == 1:  # side by side at equal heights
                gaps = [max(p.gaps[i] for p in band) for i in range(len(band[0].gaps))]
                for panel in band:
                    panel.gaps = gaps
            top = max(p.around[2] for p in band)
            body = max(sum(self.heights[ax] for ax in p.axes) + sum(p.gaps) for p in band)
            depths.append((top, body, max(p.around[3] for p in band)))
        gap = 0.16
        over, under = self.banner_height(), self.foot_height()
        height = sum(map(sum, depths)) + gap * (len(bands) - 1) + 2.0 * EDGE + over + under
        boxes = {ax: self.inches(ax) for ax in self.primary}
        self.fig.set_size_inches(self.width, height)
        self.place_margins(height)
        y = height - EDGE - over
        for band, (top, body, foot) in zip(bands, depths, strict=True):
            y -= top
            for panel in band:
                at = y
                for ax, pause in zip(panel.axes, [*panel.gaps, 0.0], strict=True):
                    x, _, wide, _ = boxes[ax]
                    tall = self.heights[ax] if len(panel.axes) > 1 else max(self.heights[ax], 0.0)
                    for one in (ax, *self.twins[ax]):
                        one.set_position((x / self.width, (at - tall) / height, wide / self.width, tall / height))
                    at -= tall + pause
            y -= body + foot + gap

    # ---- texts over and under all axes

    def banner_height(self) -> float:
        """Height of the lines over all axes, broken for the width [inch]."""
        high = 0.0
        for row in margins_of(self.fig).banner:
            room = 72.0 * (self.width - 2.0 * EDGE - (0.52 if row.sample else 0.0))
            high += LEADING * _size(row.words) * self.wrap(row.words, room)
            if row.note is not None and not self.beside(row, room):
                high += LEADING * _size(row.note) * self.wrap(row.note, room)
        return high / 72.0 + (0.12 if high else 0.0)

    def beside(self, row: BannerRow, room: float) -> bool:
        return row.note is not None and self.points(row.words) + 10.0 + self.points(row.note, _words(row.note)) < room

    def foot_height(self) -> float:
        """Height of the list under all axes [inch]."""
        rows = margins_of(self.fig).foot
        return (math.ceil(len(rows) / self.foot_columns()) * 12.0 + 8.0) / 72.0 if rows else 0.0

    def foot_columns(self) -> int:
        widest = max((self.points(row.words) for row in margins_of(self.fig).foot), default=0.0)
        return max(int(72.0 * (self.width - 2.0 * EDGE) / (widest + 30.0)), 1)

    def place_margins(self, height: float) -> None:
        wide, y = self.width, height - EDGE
        for row in margins_of(self.fig).banner:
            left = EDGE + (0.52 if row.sample else 0.0)
            room = 72.0 * (wide - EDGE - left)
            for text in (row.words, row.note):
                if text is None:
                    continue
                step = LEADING * _size(text) * (text.get_text().count("\n") + 1) / 72.0
                if text is row.note and self.beside(row, room):
                    text.set_text(_words(text))
                    text.set_position(((left + (self.points(row.words) + 10.0) / 72.0) / wide, y / height))
                else:
                    y -= step
                    text.set_position((left / wide, y / height))
                text.set_verticalalignment("bottom")
            if row.sample is not None:
                middle = row.words.get_window_extent(self.renderer)
                row.sample.set_ydata([0.5 * (middle.y0 + middle.y1) / self.fig.bbox.height] * 2)
                row.sample.set_xdata([EDGE / wide, (EDGE + 0.42) / wide])
        foot = margins_of(self.fig).foot
        columns = self.foot_columns()
        for i, one in enumerate(foot):
            x = EDGE + (i // math.ceil(len(foot) / columns)) * (wide - 2.0 * EDGE) / columns
            y = self.foot_height() - (12.0 * (i % math.ceil(len(foot) / columns)) + 14.0) / 72.0
            one.number.set_position((x / wide, y / height))
            one.words.set_position(((x + 0.2) / wide, y / height))


# ---- panels


def _same_box(a: Axes, b: Axes) -> bool:
    same_box: bool = (
        max(abs(p - q) for p, q in zip(a.get_position().bounds, b.get_position().bounds, strict=True)) < 1e-9
    )
    return same_box


def _rows(axes: Sequence[Axes]) -> list[list[Panel]]:
    """Panels row by row: axes above each other are one panel where only the lowest has a title below it."""
    columns: list[list[Axes]] = []
    for ax in sorted(axes, key=lambda a: a.get_position().x0):
        column = next((c for c in columns if _overlap(c[0], ax) > 0.5), None)
        if column is None:
            columns.append([ax])
        else:
            column.append(ax)
    panels: list[list[Panel]] = []
    for column in columns:
        column.sort(key=lambda a: -a.get_position().y1)
        parts = [[column[0]]]
        for ax in column[1:]:
            upper = parts[-1][-1]
            if upper.axison and not upper.get_xlabel():
                parts[-1].append(ax)
            else:
                parts.append([ax])
        panels.append([Panel(part) for part in parts])
    most = max(len(column) for column in panels)
    return [[column[i] for column in panels if len(column) > i] for i in range(most)]


def _overlap(a: Axes, b: Axes) -> float:
    p, q = a.get_position(), b.get_position()
    return float((min(p.x1, q.x1) - max(p.x0, q.x0)) / min(p.width, q.width))


# ---- keys


def _owner(legend: Artist, ax: Axes) -> Axes | None:
    place = place_of(legend)
    if place is not None:
        return place.axes
    return ax if getattr(legend, "axes", None) is ax else None


def _beside(text: Text) -> bool:
    place = place_of(text)
    return (
        place is not None and place.kind == "note" and place.x == 1.0 and place.y == 1.0 and place.dx > 0.0 >= place.dy
    )


def _in_columns(legend: Legend, ax: Axes, foot: float, room: float, renderer: Any) -> Legend:
    """A legend below axes instead of another one, in as many columns as fit a width [pt]."""
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

    handles, texts = legend.legend_handles, legend.get_texts()
    parent = legend.parent if isinstance(legend.parent, Figure) else ax
    for count in range(len(handles), 0, -1):
        new = Legend(
            parent,
            [h for h in handles if h is not None],
            [t.get_text() for t in texts],
            loc="upper left",
            bbox_to_anchor=(0.0, 0.0),
            bbox_transform=ax.transAxes + shift(ax, -2.0, -foot),
            ncols=count,
            frameon=False,
            fontsize=max(texts[0].get_fontsize(), LEAST_TYPE),
            handlelength=2.6,
            columnspacing=1.2,
            labelspacing=0.3,
            borderpad=0.1,
            borderaxespad=0.0,
        )
        for text, old in zip(new.get_texts(), texts, strict=True):
            text.set_color(old.get_color())
        if count == 1 or new.get_window_extent(renderer).width * 72.0 / ax.figure.dpi <= room:
            break
    legend.set_visible(False)  # a legend of a figure cannot be removed
    if isinstance(parent, Figure):
        parent.legends.append(new)
    else:
        ax.add_artist(new)
        new.set_clip_on(False)
    return new


# ---- texts


def _size(text: Text) -> float:
    """Size of the type of a text [pt]."""
    return float(text.get_fontproperties().get_size_in_points())


def _words(text: Text) -> str:
    words = str(getattr(text, WORDS, text.get_text()))
    setattr(text, WORDS, words)
    return words


def _anchor(place: ArtistPlace) -> Any:
    return place.axes.transAxes + shift(place.axes, place.dx, place.dy)


def _fewer_ticks(axis: XAxis | YAxis, renderer: Any) -> None:
    """Thin the ticks of an axis until their numbers stand apart."""
    from matplotlib.ticker import MaxNLocator

    locator = axis.get_major_locator()
    ends, least = (("x0", "x1"), 4.0) if axis.axis_name == "x" else (("y0", "y1"), -1.0)
    for count in (6, 5, 4, 3, 2):
        boxes = [t.get_window_extent(renderer) for t in axis.get_ticklabels() if t.get_visible() and t.get_text()]
        places = sorted((getattr(b, ends[0]), getattr(b, ends[1])) for b in boxes)
        if all(b[0] - a[1] > least for a, b in zip(places[:-1], places[1:], strict=True)):
            return
        if not isinstance(locator, MaxNLocator):
            return
        locator.set_params(nbins=count)
