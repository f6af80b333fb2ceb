"""Report of the reproduction: printed and computed values, number by number and figure by figure, with verdicts.

The figures come from the registry `figures.FIGURES`; each is drawn from our own runs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from mckibben.answers import Answer, Column, Table
from mckibben.documents import JsonValue
from mckibben.errors import InputError, not_found
from mckibben.report.blocks import (
    Block,
    Figure,
    Gauge,
    Hyperlink,
    KeyValues,
    NoteBox,
    Paragraph,
    References,
    ReportTable,
    Section,
    Span,
    TableCell,
    TableColumn,
    TableRow,
    Text,
    headed,
    minus,
    numeric,
    significant,
    unit_text,
    versions_text,
)
from mckibben.report.document import Document
from mckibben.report.figures import style
from mckibben.verbs import ParameterType, verb

from .figures import CONFERENCE, FIGURES, JOURNAL, PaperFigure
from .rows import (
    PrintedRow,
    RowOutcome,
    Tally,
    VerdictKind,
    accepted_band,
    headline,
    is_prediction,
    judge,
    kind_of,
    percent,
    relative_difference,
    relative_tolerance,
    select,
    tallies,
)

PARTS = {
    "I": "Part I. Static and dynamic tension-length relationships",
    "II": "Part II. Pneumatic circuits",
    "III": "Part III. Isometric and isotonic experiments",
    "IV": "Part IV. Energy conversion and efficiency",
    "discussion": "Discussion",
}
LEFT_OUT = "Rows that need recordings of the simulated test machine were left out."
PREDICTIONS = "Predictions. Each number from all others: what is not printed of its inputs was inferred without it"
_SIGNS = {
    "predicted": "✓",
    "arithmetic": "=",
    "misprint": "▲",
    "open": "○",
    "synthetic": "◇",
    "short": "■",
    "repeats": "↻",
    "unprinted": "–",
    "to come": "…",
}
_LOOKS: dict[str, Any] = {"misprint": "caution", "short": "stop"}
_ENDS = 0.5  # place on a gauge where the tolerance ends


class Drawn(NamedTuple):
    """A figure of the papers, with its matplotlib figure."""

    of: PaperFigure
    picture: Any


def chosen_figures(
    ids: Sequence[str] | None = None,
    *,
    part: str | None = None,
    rows: Sequence[str] | None = None,
    recordings: bool = True,
    known: Mapping[str, PaperFigure] = FIGURES,
) -> list[PaperFigure]:
    """Find figures by their identifiers, or those that show one of the rows; of one part, if it is given.

    Args:
        ids: such as ``3a``; a number alone stands for all its panels.
        part: ``I`` to ``IV`` or ``discussion``.
        rows: beginnings of identifiers of rows; asked only where no figure is named.
        recordings: off leaves out the figures that need them.
        known: the registry.

    Raises:
        InputError: there is no such figure, or it is named and left out.
    """
    figures = [*known.values()]
    if ids:
        named: dict[str, PaperFigure] = {}
        for word in ids:
            panels = {k: f for k, f in known.items() if k == word or re.fullmatch(re.escape(word) + "[a-z]", k)}
            if not panels:
                raise InputError("figures", word, known=known)
            named |= panels
        figures = [*named.values()]
        elsewhere = [f.id for f in figures if part not in (None, f.part)]
        if elsewhere:
            raise InputError("figures", ", ".join(elsewhere), f"not in part {part}")
        left = [f.id for f in figures if f.recordings and not recordings]
        if left:
            problem = "drawn of recordings, which {recordings=False} leaves out"
            raise InputError("figures", ", ".join(left), problem)
    elif rows:
        figures = [f for f in figures if any(a.startswith(b) for a in f.rows for b in rows)]
    return [f for f in figures if (part is None or f.part == part) and (recordings or not f.recordings)]


def draw(figures: Iterable[PaperFigure], tell: Callable[[PaperFigure], None] | None = None) -> list[Drawn]:
    """Draw figures; `tell` is called before each."""
    drawings = []
    for figure in figures:
        if tell:
            tell(figure)
        drawings.append(Drawn(figure, figure.draw()))
    return drawings


def reproduction_report(outcomes: Sequence[RowOutcome], drawn: Sequence[Drawn] = (), *, left_out: str = "") -> Document:
    """Build the report of judged rows and of figures, with a sentence on what was not asked for."""
    first, second = ([d for d in drawn if (d.of.paper == CONFERENCE) is later] for later in (False, True))
    predicted = [o for o in predictions_first(outcomes) if is_prediction(o.row)]
    others = [o for o in outcomes if not is_prediction(o.row)]
    parts = dict.fromkeys([*(o.row.part for o in others), *(d.of.part for d in first)])
    order = sorted(parts, key=lambda p: [*PARTS].index(p) if p in PARTS else len(PARTS))
    in_parts = []
    for part in order:
        rows, pictures = [o for o in others if o.row.part == part], [d for d in first if d.of.part == part]
        blocks: list[Block] = [_table(rows, first)] if rows else []
        blocks += map(_figure, pictures)
        in_parts.append(Section(PARTS.get(part, part), tuple(blocks), _anchor("part", part)))
    sections = [
        Section("Verdict", tuple(_verdict(outcomes, drawn, left_out)), "verdict"),
        *([Section(PREDICTIONS, (_table(predicted, drawn),), "predictions")] if predicted else []),
        *in_parts,
        *([Section("Figures of the paper of 1994", tuple(_figure(d) for d in second), "conference")] if second else []),
        Section("Papers", (References((JOURNAL, CONFERENCE)),), "papers"),
        Section("Versions", (KeyValues((("Computed by", versions_text()),)),), "versions"),
    ]
    lead = (
        "Every printed number and figure of the papers on the McKibben muscle by Chou and Hannaford, recomputed: theirs, "
        "ours, and what the difference says."
    )
    return Document("The papers, reproduced", tuple(sections), lead)


def title_of(row: PrintedRow) -> str:
    """Title of the group in which a row is listed: the predictions, or its part of the paper."""
    return PREDICTIONS if is_prediction(row) else PARTS.get(row.part, row.part)


def predictions_first(outcomes: Iterable[RowOutcome]) -> list[RowOutcome]:
    """Outcomes with the predictions in front, those that agree before those that are open; otherwise in their order."""
    return sorted(outcomes, key=lambda o: (not is_prediction(o.row), is_prediction(o.row) and o.verdict == "open"))


# ---- numbers


def printed(value: float | tuple[float, float]) -> str:
    """Format a printed value or interval."""
    if isinstance(value, tuple):
        return " to ".join(significant(v, 6) for v in value)
    return significant(value, 6)


def difference(row: PrintedRow, ours: float | None) -> str:
    """Difference from the printed value or the nearer end of its interval, in per cent, or in its unit for a printed 0."""
    if ours is None:
        return ""
    if isinstance(row.paper, tuple) and judge(row, ours):
        return "inside"
    relative = relative_difference(row, ours)
    if relative is None:
        return ("+" if ours > 0.0 else "") + significant(ours, 3)
    share = 100.0 * relative
    digits = 0 if abs(share) >= 99.95 else 1 if abs(share) >= 0.95 else 2
    return f"{minus(f'{share:+.{digits}f}')}\N{THIN SPACE}%"


def _gauge(row: PrintedRow, ours: float | None) -> Gauge | str:
    allowed = accepted_band(row)
    if allowed is None or ours is None or not allowed[1] > 0.0:
        return ""
    middle, half = allowed
    place = _ENDS * (ours - middle) / half
    label = f"{significant(ours - middle, 2)} from the middle of a tolerance of plus or minus {significant(half, 2)}"
    tick = None if isinstance(row.paper, tuple) else 0.0
    return Gauge(label, place, tick=tick, band=(-_ENDS, _ENDS))


# ---- sections


def _verdict(outcomes: Sequence[RowOutcome], drawn: Sequence[Drawn], left_out: str) -> Iterator[Block]:
    failed = [o for o in outcomes if o.ok is False]
    if failed:
        names = tuple((Span(o.row.id, "code"), f" {o.row.what}") for o in failed)
        yield NoteBox(f"{len(failed)} of {sum(o.ours is not None for o in outcomes)} numbers fall short", names, "stop")
    if outcomes:
        pictures = f" {len(drawn)} figure{'s are' if len(drawn) != 1 else ' is'} drawn below." if drawn else ""
        yield Paragraph(f"{headline(outcomes)}{pictures}", "lead")
    if left_out:
        yield Paragraph(left_out)
    rows = tuple(TableRow((_mark(t.kind), str(t.rows), _range(t), t.kind.meaning)) for t in tallies(outcomes))
    if rows:
        columns = headed(
            "Verdict", *numeric("Rows", "Difference from the print"), TableColumn("What it says", wide=True)
        )
        yield ReportTable(columns, rows)
        yield Paragraph(
            "A gauge beside a number shows the tolerance in grey, the print as a tick and ours as a dot; an arrow is a "
            "number beyond twice the tolerance. Every row says what went into ours; a prediction says from how many other "
            "rows it comes, what these leave of it and of each inferred input, one standard deviation, and in brackets its "
            "sensitivity to that input. An open one begins with the input that would have to change. A tolerance is half a "
            "unit of the last printed digit, unless its reason is given.",
            "quiet",
        )


def _range(tally: Tally) -> str:
    if tally.lowest is None or tally.highest is None:
        return ""
    ends = dict.fromkeys(percent(end, 1) for end in (tally.lowest, tally.highest))
    return f"{' to '.join(ends)}\N{THIN SPACE}%"


def _mark(kind: VerdictKind) -> TableCell:
    look = _LOOKS.get(kind.key, "")
    words = kind.verdict.replace(" ", "\N{NO-BREAK SPACE}")
    return TableCell(words if look else f"{_SIGNS[kind.key]}\N{NO-BREAK SPACE}{words}", look)


def _table(outcomes: Sequence[RowOutcome], drawn: Sequence[Drawn]) -> ReportTable:
    columns = headed(
        "Verdict",
        TableColumn("What", wide=True),
        *numeric("Paper", "Ours"),
        "Unit",
        TableColumn("Difference", number=True),
        "Tolerance",
    )
    return ReportTable(columns, tuple(_row(o, drawn) for o in outcomes), head=1)


def _row(outcome: RowOutcome, drawn: Sequence[Drawn]) -> TableRow:
    row, ours = outcome.row, outcome.ours
    theirs: Text = printed(row.paper)
    if outcome.verdict == "misprint":
        theirs = Span(printed(row.paper), "struck")
    shows = [d.of for d in drawn if row.id in d.of.rows]
    links = tuple(p for f in shows for p in ("  ", Hyperlink(figure_name(f), _anchor("figure", f.id))))
    description = (row.heading, " ", Span(row.id, "code"), *links)
    computed = TableCell(significant(ours) if ours is not None else "\N{EN DASH}", "best" if ours is not None else "")
    cells = (
        _mark(kind_of(outcome)),
        description,
        theirs,
        computed,
        unit_text(row.unit),
        difference(row, ours),
        _gauge(row, ours),
    )
    return TableRow(cells, note=_said(outcome.note))


def _said(note: str) -> Text:
    """Format a note; text between backticks is code."""
    return tuple(Span(p, "code") if i % 2 else minus(p.replace("+-", "±")) for i, p in enumerate(note.split("`")))


def _figure(drawn: Drawn) -> Figure:
    of = drawn.of
    caption = (Span(f"{figure_name(of)}. {of.title}.", "strong"), f" {of.caption}" if of.caption else "")
    return Figure(drawn.picture, caption, f"{figure_name(of)}: {of.title}", anchor=_anchor("figure", of.id))


def figure_name(figure: PaperFigure, space: str = "\N{NO-BREAK SPACE}") -> str:
    """Number of a figure as printed in the papers, with a space in front of it that breaks no line."""
    year, _, number = figure.id.rpartition("-")
    name = f"Table{space}{number.removeprefix('table')}" if number.startswith("table") else f"Fig.{space}{number}"
    return f"{name} of {year}" if year else name


def _anchor(kind: str, name: str) -> str:
    return f"{kind}-" + re.sub(r"[^A-Za-z0-9]+", "-", name)


# ---- the question


Chapter = Annotated[str, ParameterType("CHAPTER")]
RowName = Annotated[str, ParameterType("ROW")]
FigureName = Annotated[str, ParameterType("FIGURE")]
FigureFormat = Annotated[str, ParameterType("FORMAT")]
RecordingFolder = Annotated[Any, ParameterType("FOLDER")]
REPORTS = ("reproduction.html", "reproduction.pdf")  # what is written into a folder


@dataclass(frozen=True)
class Reproduction(Answer):
    """Printed and computed values with their verdicts, and figures: what `reproduce_papers` computes.

    Attributes:
        outcomes: judged rows.
        drawn: figures.
        figures_only: whether a folder gets the figures, not the reports.
        figure_format: of these figures.
        pdf: whether a folder gets the report as PDF too.
        left_out: sentence about rows that were left out.
        saved: folder of the recordings behind the rows.
    """

    outcomes: tuple[RowOutcome, ...]
    drawn: tuple[Drawn, ...] = ()
    figures_only: bool = False
    figure_format: str = "svg"
    pdf: bool = True
    left_out: str = ""
    saved: str | None = None

    def rows(self) -> list[dict[str, JsonValue]]:
        """A row for each printed number, predictions first."""
        return [_as_json(one) for one in predictions_first(self.outcomes)]

    def to_dict(self) -> dict[str, JsonValue]:
        """Headline, how many numbers are of each kind, and the rows."""
        kinds = {t.kind.key: {"rows": t.rows, "lowest": t.lowest, "highest": t.highest} for t in tallies(self.outcomes)}
        failed = sum(one.ok is False for one in self.outcomes)
        return {"headline": headline(self.outcomes), "kinds": kinds, "failed": failed, "rows": self.rows()}

    def tables(self) -> list[Table]:
        """A table for each part of the papers, with the reasons below each row."""
        columns = tuple(Column(key, right=key in ("paper", "ours", "difference")) for key in COLUMNS)
        parts: dict[str, list[dict[str, Any]]] = {}
        for one in predictions_first(self.outcomes):
            ours = "–" if one.ours is None else significant(one.ours)
            unit = "" if one.row.unit == "-" else one.row.unit
            cells = one.row.id, printed(one.row.paper), ours, unit, difference(one.row, one.ours), one.verdict
            parts.setdefault(title_of(one.row), []).append(
                dict(zip((*COLUMNS, "note"), (*cells, one.note), strict=True))
            )
        return [Table(title, columns, rows, below="note") for title, rows in parts.items()]

    def remarks(self) -> list[str]:
        """The verdict in a sentence, and where the recordings are."""
        saved = [] if self.saved is None else [f"Written: {self.saved}"]
        return [*saved, headline(self.outcomes) if self.outcomes else "No row is asked for."]

    def failure(self) -> str | None:
        """Empty where a number is not reproduced, which the tables say."""
        return "" if any(one.ok is False for one in self.outcomes) else None

    def report(self, path: str | Path) -> Path:
        """Write the report to an ``.html`` or ``.pdf`` file; returns its path."""
        return reproduction_report(self.outcomes, self.drawn, left_out=self.left_out).write(path)

    def save(self, folder: str | Path) -> list[Path]:
        """Write both reports, or the figures that were named, into a folder; returns their paths."""
        place = Path(folder)
        place.mkdir(exist_ok=True)
        if not self.figures_only:
            return [self.report(place / name) for name in REPORTS if self.pdf or not name.endswith(".pdf")]
        paths = [place / f"figure-{one.of.id}.{self.figure_format}" for one in self.drawn]
        for one, path in zip(self.drawn, paths, strict=True):
            style.save(one.picture, path)
        return paths


COLUMNS = ("row", "paper", "ours", "unit", "difference", "verdict")


def _as_json(o: RowOutcome) -> dict[str, JsonValue]:
    return {
        "id": o.row.id,
        "paper": o.row.paper,
        "ours": o.ours,
        "unit": o.row.unit,
        "expect": o.row.expect,
        "ok": o.ok,
        "basis": o.row.basis,
        "inputs": o.row.inputs,
        "calibrated": o.row.calibrated,
        "verdict": o.verdict,
        "kind": kind_of(o).key,
        "difference": relative_difference(o.row, o.ours),
        "tolerance": relative_tolerance(o.row),
        "reason": o.row.reason,
        "told": None if o.prediction is None else o.prediction.told,
        "spread": None if o.prediction is None else o.prediction.spread,
        "rows": 0 if o.prediction is None else len(o.prediction.by),
        "sensitivities": "" if o.prediction is None else o.prediction.inputs_text(o.row),
        "needed": "" if o.prediction is None or o.prediction.needed is None else str(o.prediction.needed),
        "note": o.note,
    }


@verb
def reproduce_papers(
    *,
    part: Chapter | None = None,
    rows: Sequence[RowName] | None = None,
    figures: Sequence[FigureName] | None = None,
    figure_format: FigureFormat = "svg",
    pdf: bool = True,
    recordings: bool = True,
    save_recordings: RecordingFolder | None = None,
    draws: bool | None = None,
    begun: Callable[[int], AbstractContextManager[Callable[[str, float], None]]] | None = None,
) -> Reproduction:
    """Compute the papers' numbers and report whether each value is reproduced.

    Predictions come first: inputs that are not printed are inferred from all other rows, and the one left out is predicted,
    with its sensitivity to each. Where it differs it is open, with the input that would have to change and by how much.
    Other numbers follow from printed coefficients by the paper's own equations.

    A value of these that is not reproduced, or one that lies outside what we take the papers' words to mean, is a failure,
    exit code 1. Rows of loops, friction, steps and power come from recordings of the simulated machine, which take minutes.

    Args:
        part: compute only this part: I, II, III, IV or discussion.
        rows: compute only rows whose name begins like this, such as table1.nylon.
        figures: compute only this figure and its rows, such as 3a, and draw it.
        figure_format: format of figures in a folder: svg, pdf or png.
        pdf: write the PDF report beside the HTML one into a folder.
        recordings: compute rows that need recordings of the test machine, which take minutes.
        save_recordings: folder into which the recordings behind the rows are written (.nc).
        draws: whether figures are drawn for a report; by default where they are named.
        begun: told how many rows and figures there are; its context is told what is done now, and how many of them are done.

    Raises:
        InputError: there is no such part, row or figure, or the folder is a file.
    """
    from . import reproduction  # it computes

    # Whatever can be refused is refused before anything is loaded or computed, which takes minutes.
    select(part, None if rows is None else [*rows])
    if figure_format not in FORMATS:
        raise InputError("figure_format", figure_format, known=FORMATS)
    if save_recordings is not None:
        if not recordings:
            raise InputError("save_recordings", None, "is allowed only without {recordings=False}")
        place = Path(save_recordings)
        if not str(save_recordings).strip() or (place.exists() and not place.is_dir()):
            raise InputError("save_recordings", str(place), "must be a folder")
        if not place.absolute().parent.is_dir():
            raise not_found(place.absolute().parent, "folder")
    pictures = []
    if figures or draws:
        pictures = chosen_figures(figures, part=part, rows=rows, recordings=recordings)
    # None stands for all rows, an empty list for none
    wanted = None if rows is None else [*rows]
    if figures:
        wanted = [*(rows or ()), *dict.fromkeys(row for one in pictures for row in one.rows)]
    asked = [] if wanted == [] else select(part, wanted)
    outcomes: list[RowOutcome] = []
    with (
        reproduction.helped([row.id for row in asked] if recordings else []),
        (begun or _untold)(len(asked) + len(pictures)) as tell,
    ):
        if asked:
            outcomes = reproduction.reproduce(
                part, wanted, progress=lambda row: tell(row.id, 1.0), tell=lambda words: tell(words, 0.0),
                recordings=recordings, save=save_recordings,
            )  # fmt: skip
        with reproduction.told(lambda words: tell(words, 0.0)):
            drawn = draw(pictures, lambda one: tell(f"figure {one.id}: {one.title}", 1.0))
    saved = None if save_recordings is None else str(save_recordings)
    left_out = "" if recordings else LEFT_OUT
    return Reproduction(tuple(outcomes), tuple(drawn), bool(figures), figure_format, pdf, left_out, saved)


FORMATS = ("svg", "pdf", "png")


@contextmanager
def _untold(count: int) -> Iterator[Callable[[str, float], None]]:
    yield lambda words, done: None
