"""Forms from declarations: label, unit, bounds and meaning are those of `quantities`.

A value that is refused stays in its field with the sentence of the command line below; the old one stays in use.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from ..errors import InputError
from ..quantities import Quantity, declared, from_si, parse, shown_unit, with_unit
from .elements import Element
from .widgets import box, refused, text

DECADES = 1e9  # ratio of bounds from which on they are not shown
# The class of lab.css that colours a label, by the SI unit of what it names.
COLOURS = {"Pa": "P", "N": "F", "m": "L", "m^3/s": "q"}


class Accepted(NamedTuple):
    """Result of reading a field.

    Attributes:
        value: the one in use [SI].
        said: why the words were refused; nothing if they were not.
    """

    value: float
    said: str


def accept(name: str, words: str, quantity: Quantity, old: float) -> Accepted:
    """Convert the text of a field to a value [SI]; a number without a unit is in the unit that the field shows.

    Args:
        name: name of the field, for error messages.
        words: that were typed.
        quantity: the declaration.
        old: value that stays in use where the words are refused [SI].
    """
    unit = shown_unit(quantity.unit)
    text = words.strip().replace("\u2212", "-").replace("\u2009", " ").replace("\u2060", "")
    bare = text.removeprefix("-").replace(".", "", 1).replace("e-", "", 1).replace("e", "", 1).isdigit()
    try:
        value = parse(f"{text} {unit}" if bare and unit != "1" else text, quantity.unit, field=name)
        quantity.check(name, value)
    except InputError as error:
        return Accepted(old, f"{error}. The old value, {shown(old, quantity)}, stays in use.")
    return Accepted(value, "")


def shown(value: float, quantity: Quantity) -> str:
    """Value as its field displays it, in the unit beside it."""
    return f"{from_si(value, quantity.unit, shown_unit(quantity.unit)) if quantity.unit != '1' else value:.6g}"


def fields(owner: object, names: Mapping[str, str] | None = None) -> dict[str, Quantity]:
    """Declared parameters of a type or an instance, or those of some names."""
    known = declared(owner)
    return known if names is None else {n: known[n] for n in names}


def field(
    name: str,
    quantity: Quantity,
    value: float,
    change: Callable[[float], object],
    *,
    label: str = "",
    about: bool = True,
) -> Element:
    """Build one field with its label, unit, meaning and bounds.

    Args:
        name: name of the parameter.
        quantity: declaration of the parameter.
        value: to begin with [SI].
        change: told every value that was accepted [SI]; may raise `InputError`, which is shown beside the field.
        label: its words; the name by default.
        about: say what it means and what is allowed.
    """
    words = label or name.replace("_", " ")
    kept = value
    with box("div", "f") as one:
        element_id = f"c-{one.number}"
        text("label", words, COLOURS.get(quantity.unit, "")).set(for_=element_id)
        with box("div", "field s") as edge:
            typed = box("input").set(
                id=element_id, value=shown(value, quantity), inputmode="decimal", title=quantity.doc
            )
            typed.set(aria_describedby=f"d-{one.number}")
            if quantity.unit != "1":
                text("span", shown_unit(quantity.unit), "u")
        said = box("div", "err").set(id=f"d-{one.number}").style(display="contents")
        if about:
            text("span", quantity.doc if _is_wide(quantity) else f"{quantity.doc}; {quantity.allowed()}", "about")

    def came(words: object) -> None:
        nonlocal kept
        accepted = accept(name, str(words), quantity, kept)
        why = accepted.said
        if not why:
            try:
                change(accepted.value)
                kept = accepted.value
            except InputError as error:
                why = f"{error}. The old value, {shown(kept, quantity)}, stays in use."
        said.clear()
        edge.classed("bad", bool(why))
        # what was typed stays, to be put right
        typed.set(aria_invalid="true" if why else "false", value=str(words) if why else shown(kept, quantity))
        if why:
            with said:
                refused(why)

    typed.on_value("change", came)
    return one


def _is_wide(quantity: Quantity) -> bool:
    """Whether the bounds leave so much that they tell a person nothing."""
    low, high = quantity.bounds
    return 0.0 < low * DECADES < high


def form(
    owner: object,
    values: Mapping[str, float],
    change: Callable[[str, float], object],
    names: Mapping[str, str] | None = None,
) -> Element:
    """Build fields for all declared parameters of a type or an instance.

    Args:
        owner: that declares them.
        values: to begin with, by name [SI].
        change: told name and value [SI]; may raise `InputError`.
        names: label by name of those that are shown; all by default.
    """
    with box("div", "form") as one:
        for name, quantity in fields(owner, names).items():
            field(name, quantity, values[name], lambda v, n=name: change(n, v), label=(names or {}).get(name, ""))  # type: ignore[misc]
    return one


def allowed(low: float, high: float, unit: str) -> str:
    """Format bounds [SI] for a label."""
    return f"{with_unit(low, unit)} to {with_unit(high, unit)}"
