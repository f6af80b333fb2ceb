"""Panel 1: the file, the meaning and units of its columns with a preview, and other known values."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ....errors import InputError
from ....muscles.laws import law_type
from ....quantities import Quantity, declared, parse, shown_unit, with_unit
from ....recordings.force_map import TablePreview, stated_unit
from ....specimens import specimen_ids, specimens
from ...elements import Element
from ...forms import InputField, plain_text, refusal
from ...widgets import box, button, check, raw, select, text
from .jobs import FitRequest, dimensions, specimen_of

NAMES = {
    "length": "Length", "contraction": "Contraction or travel", "pressure": "Pressure", "tension": "Tension",
    "rest_length": "Rest length", "branch": "Branch", "diameter": "Diameter", "run": "Run",
}  # fmt: skip
COLOURS = {"length": "L", "contraction": "L", "pressure": "P", "tension": "F", "rest_length": "L", "diameter": "L"}
LENGTHS = ("m", "cm", "mm", "inch")
PRESSURES = ("Pa", "kPa", "MPa", "bar", "mbar", "psi")
UNITS = {
    "length": LENGTHS, "rest_length": LENGTHS, "diameter": LENGTHS, "contraction": ("percent", "1", *LENGTHS),
    "pressure": tuple(f"{u}{r}" for u in PRESSURES for r in ("", " abs")), "tension": ("N", "kN", "mN", "lbf", "kgf"),
}  # fmt: skip
SHOWN = 4  # rows of the preview
MOST = 4  # columns that are shown side by side; of more, those that are used
Change = Callable[[FitRequest], Any]


def mapping(asked: Callable[[], FitRequest], look: TablePreview, change: Change, wrong: InputError | None) -> None:
    """Build the table of columns with a preview; the column of an error is marked.

    What is changed is put into the request as it is then, which `asked` tells, not as it was when this was drawn.
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
                            _what(asked, column, quantity, change)
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
            # some of the first rows, with a slack one among them if there is any
            slack = [row for row in look.rows if pull >= 0 and _slack(row[pull])]
            rows = [row for row in look.rows if not any(row is other for other in slack[1:])]
            for row in (rows or look.rows)[:SHOWN]:
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


def _slack(cell: str) -> bool:
    try:
        return float(cell) <= 0.0
    except ValueError:
        return False


def _what(asked: Callable[[], FitRequest], column: str, what: str, change: Change) -> Element:

    def chosen(now: str) -> None:
        changed = asked()
        if what:  # it held something else, which no column holds now
            changed = changed.with_pair("columns", what, "-").with_pair("units", what, None)
        if now:
            changed = changed.with_pair("columns", now, column).with_pair("units", now, None)
        change(changed)

    words = {"": "not used", **NAMES}
    return select(words, what, chosen, f"What {column} holds", COLOURS.get(what, ""))


def _which(asked: Callable[[], FitRequest], what: str, column: str, look: TablePreview, change: Change) -> Element:

    def chosen(now: str) -> None:
        change(asked().with_pair("columns", what, now or "-").with_pair("units", what, None))

    return select({"": "no column", **{c: c for c in look.header}}, column, chosen, f"Column of {NAMES[what]}")


def _unit(asked: Callable[[], FitRequest], column: str, what: str, change: Change) -> None:
    stated = stated_unit(column, what) if column else ""
    now = dict(asked().units).get(what, stated).removesuffix(" gauge")

    def called(unit: str) -> str:
        if what == "pressure" and unit:
            bare = unit.removesuffix(" abs")
            return f"{bare}, {'absolute' if unit != bare else 'gauge'}"
        return {"percent": "%", "1": "share", "": "unit?"}.get(unit, unit)

    words = {unit: called(unit) for unit in (*([] if now in UNITS[what] else [now]), *UNITS[what])}

    def chosen(unit: str) -> None:
        reference = " gauge" if what == "pressure" and not unit.endswith(" abs") else ""
        change(asked().with_pair("units", what, None if unit == stated else unit + reference))

    select(words, now, chosen, f"Unit of {NAMES[what]}")


def _words_field(
    name: str, label: str, unit: str, words: str, change: Callable[[str], object], about: str = "", colour: str = ""
) -> None:
    """Build an optional text field; input is checked by `change`, whose `InputError` is shown below it."""
    kept, shown = words, shown_unit(unit)

    def came(typed: str) -> None:
        nonlocal kept
        typed, why = plain_text(typed), ""
        with contextlib.suppress(ValueError):  # else it has a unit, or is no number: `change` says which
            float(typed)
            typed = f"{typed} {shown}"
        try:
            change(typed)
            kept = typed
        except InputError as error:
            why = refusal(error, kept) if kept else f"{error}. It is not used."
        # beside the field stands its unit; what is refused stays, to be put right
        field.refuse(why, None if why else typed and plain(with_unit(parse(typed, unit, field=name), unit, 12)))

    def plain(words: str) -> str:
        return words.removesuffix(shown).strip()

    field = InputField(label, plain(words), came, name=f"c-{name}", unit=shown, about=about, colour=colour, classes="")
    field.input.set(inputmode="decimal")


def given(asked: Callable[[], FitRequest], change: Change, branches: list[str]) -> None:
    """Build the fields for values that are not in a column; `asked` returns the present request."""

    def set_to(**what: object) -> None:
        change(dataclasses.replace(asked(), **what))  # type: ignore[arg-type]

    def si(name: str, unit: str, key: str) -> Callable[[str], None]:
        def take(words: str) -> None:
            if words:
                value = parse(words, unit, field=name)
                if key == "rest":
                    declared(law_type("sarosi"))["rest_length"].check(name, value)
            set_to(**{key: words})

        return take

    def dimension(name: str, quantity: Quantity) -> Callable[[str], None]:
        def take(words: str) -> None:
            if words:
                quantity.check(name, parse(words, quantity.unit, field=name))
            change(asked().with_pair("known", name, words or None))

        return take

    now = asked()
    spec = specimen_of(now) if now.kind == "map" else None
    rest = now.rest or ("" if spec is None else with_unit(spec.property_si("rest_length", "m"), "m"))
    with box("div", "given"):
        _words_field("rest", "Rest length L\u2080", "m", rest, si("rest length", "m", "rest"), colour="L")
    with box("details"):
        text("summary", "Other known values")
        with box("div", "given"):
            if now.kind != "map":  # whose specimen says them
                text("span", "Dimensions of")
                names = {"": "nobody", **{name: name for name in specimen_ids("mckibben")}}
                select(names, now.like, lambda v: set_to(like=v), "Dimensions of")
            for name, quantity in dimensions().items():
                label, already = name.replace("_", " ").capitalize(), dict(now.known).get(name, "")
                _words_field(name, label, quantity.unit, already, dimension(name, quantity), quantity.doc)
            if branches:
                text("span", "Branch")
                words = {"": "all rows", **{b: b for b in branches}}
                select(words, now.branch, lambda v: set_to(branch=v), "Branch")
            about = "what the pressure channel reads at zero"
            _words_field("zero", "Pressure zero", "Pa", now.zero, si("pressure zero", "Pa", "zero"), about, "P")
            about = "a separate fit sees only pressures up to this one and predicts those above"
            _words_field("below", "Train up to", "Pa", now.below, si("train below", "Pa", "below"), about, "P")
        check("Slack points say where a law may not pull", now.slack, lambda v: set_to(slack=v)).classed("small")


def maps(take: Change) -> None:
    """Build the list of available tables: those of specimens that ship with one."""
    text("p", "Or use a published map:", "small dim")
    with box("div", "row wrap"):
        for spec in specimens():
            if spec.map:
                button(spec.id, lambda s=spec: take(FitRequest("map", s.id)), small=True)
