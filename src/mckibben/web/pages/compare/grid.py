"""Table of the comparison: a column per muscle with its drawing, its surface and Table 1."""

from __future__ import annotations

import html
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....documents import JsonValue
from ....quantities import from_si
from ....studies.comparison import ComparedMuscle, MuscleColumn
from ...save import save_menu
from ...widgets import box, button, raw, refused, text
from ..bench import drawing
from . import drawings, jobs

if TYPE_CHECKING:
    from .page import ComparePage


class ComparisonGrid:
    """Table of one page.

    Args:
        face: the page, which moves and drops columns.
        columns: word of the link, column, muscle where it is one by its law, and why there is no column.
    """

    def __init__(
        self, face: ComparePage, columns: list[tuple[str, MuscleColumn | None, ComparedMuscle | None, str]]
    ) -> None:
        self.face, self.columns = face, columns

    def show(self, surfaces: dict[str, JsonValue]) -> None:
        """Build all of it, within the open element."""
        columns, count = self.columns, len(self.columns)
        with box("div", "cmp").style(**{"--columns": str(count)}):
            box("div", "k head")
            for i, (name, column, one, _) in enumerate(columns):
                self._head(drawings.LETTERS[i], name, column, one)
            bad = {i: said for i, (_, column, _, said) in enumerate(columns) if column is None}
            if bad:
                box("div", "k")
                for i in range(count):
                    with box("div", "cell"):
                        if i in bad:
                            refused(bad[i])
            if any(one is not None for _, _, one, _ in columns):
                self._drawings(columns)
                self._surfaces(columns, surfaces)
            self._rows(columns)

    def _head(self, letter: str, name: str, column: MuscleColumn | None, one: ComparedMuscle | None) -> None:
        with box("div", "ch"):
            text("span", letter, "ab")
            title = one.spec.title if one is not None else Path(name).stem
            text("span", _short(title), "title").set(title=title)
            with box("details", "more"):
                raw("\u22ef", "summary", "btn s q").set(aria_label=f"More about {_short(title)}")
                with box("div", "menu-list"):
                    button("Move left", lambda: self.face.move(name, -1), small=True, quiet=True)
                    button("Move right", lambda: self.face.move(name, 1), small=True, quiet=True)
                    if one is not None and one.unit is not None and not name.endswith(".toml"):
                        text("a", "Use on the bench", "btn s q").set(href=f"/?muscle={one.id}")
                    for note in column.notes if column is not None else ():
                        text("p", f"{note}.", "small dim")
                    button("Remove", lambda: self.face.drop(name), small=True, quiet=True)

    def _drawings(self, columns: Any) -> None:
        raw("At rest and fully shortened,<br>one scale<br><span class='faint scale'></span>", "div", "k tall")
        for _, _, one, _ in columns:
            if one is None:
                box("div", "cell")
                continue
            shortest = float(jobs.column(one).values["shortest"])
            spec = (
                drawing.plain(one.spec) if one.unit is not None else {"rest_length": one.rest_length, "fibre": True}
            ) | {
                "shortest": shortest * one.rest_length,
                "full": from_si(one.full, "Pa", "bar"),
                "area": one.section_area,
            }
            with box("div", "cell"):
                words, packed = html.escape(drawings.sizes(one)), html.escape(json.dumps(spec))
                raw(f'<canvas class="drawn" role="img" aria-label="{words}" data-muscle="{packed}"></canvas>')

    def _surfaces(self, columns: Any, surfaces: dict[str, JsonValue]) -> None:
        shown = [s for s in surfaces.values() if s is not None]
        scale = {
            "low": min((float(s.lengths[0]) for s in shown), default=0.6) - 0.04,
            "high": max((float(s.lengths[-1]) for s in shown), default=1.2) + 0.05,
            "top": max((float(s.tension.max()) * from_si(1.0, "N/m^2", "N/cm^2") for s in shown), default=1.0),
        }
        raw(
            '<b class="F">Tension</b> per section, N/cm\u00b2, over <b class="L">length</b> and '
            '<b class="P">pressure</b> or <b>activation</b><br><span class="faint">the same axes in all; point at one, or '
            "use the arrows</span>",
            "div",
            "k tall",
        )
        for i, (name, _, one, _) in enumerate(columns):
            with box("div", "cell chartbox"):
                if one is not None:
                    raw(drawings.surface_markup(one, drawings.LETTERS[i], surfaces[name], scale))
                    if (chart := drawings.surface_chart(one, surfaces[name])) is not None:
                        save_menu(chart.name, chart.figure)

    def _rows(self, columns: Any) -> None:
        place = {id(c): i for i, c in enumerate(c for _, c, _, _ in columns if c is not None)}
        papers = [jobs.paper_values(c.name) if c is not None else {} for _, c, _, _ in columns]
        ends = [
            v for _, c, _, _ in columns if c is not None for n in ("shortest", "longest") if (v := jobs.value_of(c, n))
        ]
        low, high = min(ends, default=0.6) - 0.03, max(ends, default=1.2) + 0.03
        for row in jobs.shown_rows(self.face.table):
            known = [p.get(row.property.name) for p in papers]
            unit = row.property.unit.replace("L0", "L\u2080").replace("^2", "\u00b2").replace("^3", "\u00b3")
            unit = html.escape("" if unit == "1" else unit)
            shown = html.escape("" if unit == "1" else unit)
            raw(f"<span>{html.escape(row.property.title)}</span><span class='u'>{shown}</span>", "div", "k r")
            largest = drawings.largest_of(row, known)
            for i, (_, column, _, _) in enumerate(columns):
                if column is None:
                    box("div", "r")
                elif row.property.name == "dynamic_range":
                    raw(drawings.range_bar(column, low, high, known[i]), "div", "r")
                else:
                    one = columns[i][2]
                    living = one is not None and one.fibre is not None
                    raw(drawings.bar(row, place[id(column)], largest, known[i], living), "div", "r")


def _short(title: str) -> str:
    """Start of a title, up to its first comma or of-phrase; of a biological muscle the kind of its fibres."""
    living, comma, kind = title.partition(", ")
    if living == "Biological muscle" and comma:
        return f"{kind[:1].upper()}{kind[1:]}"
    for stop in (",", " of ", " with "):
        title = title.split(stop)[0]
    return title.removesuffix(" muscle") if len(title) > 18 else title
