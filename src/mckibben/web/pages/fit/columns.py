"""Panel 1: the file, the meaning and units of its columns with a preview, and other known values."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....errors import InputError
from ....quantities import declared, parse, shown_unit, with_unit
from ....specimens import specimen_ids, specimens
from ...widgets import box, button, check, raw, refused, select, text
from .state import FitRequest, dimensions, specimen_of

if TYPE_CHECKING:
    from ....recordings.force_map import TablePreview

NAMES = {
    "length": "Length", "contraction": "Contraction", "pressure": "Pressure", "tension": "Tension",
    "rest_length": "Rest length", "branch": "Branch", "diameter": "Diameter", "run": "Run",
}  # fmt: skip
COLOURS = {"length": "L", "contraction": "L", "pressure": "P", "tension": "F", "rest_length": "L", "diameter": "L"}
LENGTHS = ("m", "cm", "mm", "inch")
PRESSURES = ("Pa", "kPa", "MPa", "bar", "mbar", "psi")
UNITS = {
    "length": LENGTHS, "rest_length": LENGTHS, "diameter": LENGTHS, "contraction": ("percent", "1"),
    "pressure": tuple(f"{u}{r}" for u in PRESSURES for r in ("", " abs")), "tension": ("N", "kN", "mN", "lbf", "kgf"),
}  # fmt: skip
SHOWN = 4  # rows of the preview
MOST = 4  # columns that are shown side by side; of more, those that are used
Change = Callable[[FitRequest], Any]


def mapping(asked: Callable[[], FitRequest], look: TablePreview, change: Change, wrong: InputError | None) -> None:
    """Build the table of columns with a preview; a column with an error is marked.

    Args:
        asked: returns how the file is read now, with choices that came after this table was drawn.
        look: into the file.
        change: told how it shall be read.
        wrong: why it could not be read.
    """
    meant = {k: v for k, v in {**look.meant, **dict(asked().columns)}.items() if v in look.header}
    blamed = "" if wrong is None else wrong.field
    few = len(look.header) <= MOST
    if few:
        shown = [(column, next((w for w, c in meant.items() if c == column), "")) for column in look.header]
    else:
        needed = [w for w in ("length", "pressure", "tension") if w not in meant and "contraction" not in meant]
        shown = [(column, quantity) for quantity, column in meant.items()] + [("", quantity) for quantity in needed]
    with box("div", "scroll-x"), box("table", "map"):
        raw("Preview and mapping of columns", "caption", "vh")
        with box("thead"):
            with box("tr"):
                for column, quantity in shown:
                    label = column if few else NAMES[quantity]
                    text("th", label, "mono" if few else COLOURS.get(quantity, "")).set(scope="col")
            with box("tr"):
                for column, quantity in shown:
                    with box("th"):
                        one = (
                            _what(asked, column, quantity, meant, change)
                            if few
                            else _which(asked, quantity, column, look, change)
                        )
                        if blamed and blamed in (column, quantity):
                            one.set(aria_invalid="true")
                            if one.parent is not None:
                                one.parent.classed("bad")
            with box("tr"):
                for column, quantity in shown:
                    with box("th"):
                        if quantity in UNITS:
                            _unit(asked, column, quantity, change)
        with box("tbody", "mono"):
            at = [look.header.index(column) if column else -1 for column, _ in shown]
            pull = look.header.index(meant["tension"]) if "tension" in meant else -1
            for row in _telling(look.rows, pull):
                with box("tr", "z" if pull >= 0 and _slack(row[pull]) else ""):
                    for i in at:
                        text("td", row[i][:12] if i >= 0 else "")


def part(asked: Callable[[], FitRequest], names: Sequence[str], change: Change) -> None:
    """Build the choice of a sheet or topic of a file that has several."""
    word = "Sheet" if Path(asked().name).suffix.lower() in (".xlsx", ".xls", ".ods") else "Topic"

    def chosen(name: str) -> None:
        change(dataclasses.replace(asked(), part=name, columns=(), units=()))

    with box("div", "given"):
        text("label", word)
        usual = {} if asked().part or word == "Sheet" else {"": "all topics"}
        select(usual | {name: name for name in names}, asked().part, chosen, word)


def _telling(rows: list[list[str]], pull: int) -> list[list[str]]:
    """Select some of the first rows, with a slack one among them if there is any."""
    slack = [row for row in rows if pull >= 0 and _slack(row[pull])]
    kept = [row for row in rows if not any(row is s for s in slack[1:])]
    return kept[:SHOWN] or rows[:SHOWN]


def _slack(cell: str) -> bool:
    try:
        return float(cell) <= 0.0
    except ValueError:
        return False


def _what(asked: Callable[[], FitRequest], column: str, what: str, meant: dict[str, str], change: Change) -> Any:
    """Build the choice of what one column holds."""

    def chosen(now: str) -> None:
        changed = asked()
        if what:  # it held something else, which no column holds now
            changed = changed.with_pair("columns", what, "-").with_pair("units", what, None)
        if now:
            changed = changed.with_pair("columns", now, column).with_pair("units", now, None)
        change(changed)

    words = {"": "not used", **NAMES}
    return select(words, what, chosen, f"What {column} holds", COLOURS.get(what, ""))


def _which(asked: Callable[[], FitRequest], what: str, column: str, look: TablePreview, change: Change) -> Any:
    """Build the choice of the column that holds a quantity."""

    def chosen(now: str) -> None:
        change(asked().with_pair("columns", what, now or "-").with_pair("units", what, None))

    return select({"": "no column", **{c: c for c in look.header}}, column, chosen, f"Column of {NAMES[what]}")


def _unit(asked: Callable[[], FitRequest], column: str, what: str, change: Change) -> None:
    from ....recordings.force_map import stated_unit

    stated = stated_unit(column, what) if column else ""
    now = dict(asked().units).get(what, stated).removesuffix(" gauge")
    words = {u: _unit_words(u, what) for u in UNITS[what]}
    if now not in words:
        words = {now: _unit_words(now, what) if now else "unit?", **words}

    def chosen(unit: str) -> None:
        reference = " gauge" if what == "pressure" and not unit.endswith(" abs") else ""
        change(asked().with_pair("units", what, None if unit == stated else unit + reference))

    select(words, now, chosen, f"Unit of {NAMES[what]}")


def _unit_words(unit: str, what: str) -> str:
    if what == "pressure":
        bare = unit.removesuffix(" abs")
        return f"{bare}, {'absolute' if unit != bare else 'gauge'}"
    return {"percent": "%", "1": "share"}.get(unit, unit)


def words_field(
    name: str, label: str, unit: str, words: str, change: Callable[[str], object], about: str = "", mark: str = ""
) -> None:
    """Build an optional text field; input is checked by `change`, whose `InputError` is shown below it.

    Args:
        name: name of the field, for everybody.
        label: before it.
        unit: SI unit; a number without one is in the unit that the field shows.
        words: to begin with.
        change: given the words, or nothing if the field was emptied.
        about: explanation.
        mark: class of the label.
    """
    shown = shown_unit(unit)
    text("label", label, mark).set(for_=f"c-{name}")
    with box("div", "field s") as edge:
        typed = box("input").set(id=f"c-{name}", inputmode="decimal", value=words.removesuffix(shown).strip())
        text("span", shown, "u")
    if about:
        text("span", about, "about")
    said = box("div").style(display="contents")

    kept = words

    def came(value: object) -> None:
        nonlocal kept
        text = str(value).strip().replace("\u2212", "-")
        try:
            float(text)
            text = f"{text} {shown}"
        except ValueError:
            pass  # it has a unit, or is no number: `change` says which
        said.clear()
        wrong = False
        try:
            change(text)
            kept = text
        except InputError as error:
            wrong = True
            with said:
                refused(f"{error}. {f'The old value, {kept}, stays in use.' if kept else 'It is not used.'}")
        edge.classed("bad", wrong)
        typed.set(aria_invalid="true" if wrong else "false")  # what was typed stays, to be put right

    typed.on_value("change", came)


def given(asked: Callable[[], FitRequest], change: Change, branches: list[str]) -> None:
    """Build the fields for values that are not in a column; `asked` returns the present request."""
    from ....muscles.laws import law_type

    def si(field: str, unit: str, key: str) -> Callable[[str], None]:
        def take(words: str) -> None:
            if words:
                value = parse(words, unit, field=field)
                if key == "rest":
                    declared(law_type("sarosi"))["rest_length"].check(field, value)
            new: dict[str, Any] = {key: words}
            change(dataclasses.replace(asked(), **new))

        return take

    def told(name: str, quantity: Any) -> Callable[[str], None]:
        def take(words: str) -> None:
            if words:
                quantity.check(name, parse(words, quantity.unit, field=name))
            change(asked().with_pair("known", name, words or None))

        return take

    now = asked()
    spec = specimen_of(now) if now.kind == "map" else None
    rest = now.rest or ("" if spec is None else with_unit(spec.property_si("rest_length", "m"), "m"))
    with box("div", "given"):
        words_field("rest", "Rest length L\u2080", "m", rest, si("rest length", "m", "rest"), mark="L")
    with box("details"):
        text("summary", "Other known values")
        _more(asked, change, branches, si, told)


def _more(asked: Callable[[], FitRequest], change: Change, branches: list[str], si: Any, listener: Any) -> None:
    now = asked()
    with box("div", "given"):
        _like(asked, change)
        for name, quantity in dimensions().items():
            already = dict(now.known).get(name, "")
            words_field(
                name,
                name.replace("_", " ").capitalize(),
                quantity.unit,
                already,
                listener(name, quantity),
                quantity.doc,
            )
        if branches:
            text("span", "Branch")
            words = {"": "all rows", **{b: b for b in branches}}
            select(words, now.branch, lambda v: change(dataclasses.replace(asked(), branch=v)), "Branch")
        about = "what the pressure channel reads at zero"
        words_field("zero", "Pressure zero", "Pa", now.zero, si("pressure zero", "Pa", "zero"), about, "P")
        about = "a separate fit sees only pressures up to this one and predicts those above"
        words_field("below", "Train up to", "Pa", now.below, si("train below", "Pa", "below"), about, "P")
    check(
        "Slack points say where a law may not pull", now.slack, lambda v: change(dataclasses.replace(asked(), slack=v))
    ).classed("small")


def maps(take: Change) -> None:
    """Build the list of available tables: those of specimens that ship with one."""
    text("p", "Or use a published map:", "small dim")
    with box("div", "row wrap"):
        for spec in specimens():
            if spec.map:
                button(spec.id, lambda s=spec: take(FitRequest("map", s.id)), small=True)


def _like(asked: Callable[[], FitRequest], change: Change) -> None:
    """Build the choice of a specimen with the same dimensions."""
    if asked().kind == "map":
        return

    text("span", "Dimensions of")
    names = {"": "nobody", **{name: name for name in specimen_ids("mckibben")}}
    select(names, asked().like, lambda v: change(dataclasses.replace(asked(), like=v)), "Dimensions of")
