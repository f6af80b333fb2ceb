"""Fields with what must be said of them: label, unit, bounds and meaning are those of `quantities`.

A value that is refused stays in its field with the sentence of the command line below; the old one stays in use. Below it
stands, too, what an answer says of the parameter that the field is for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from ..answers import Caution
from ..errors import InputError
from ..quantities import Quantity, from_si, parse, shown_unit
from ..verbs import ParsedNumber
from .elements import Element
from .widgets import box, note, refused, sentence, text

DECADES = 1e9  # ratio of bounds from which on they are not shown: they tell a person nothing
# The class of lab.css that colours a label, by the SI unit of what it names.
COLOURS = {"Pa": "P", "N": "F", "m": "L", "m^3/s": "q"}


def accept(name: str, words: str, quantity: Quantity) -> float:
    """Convert the text of a field to a value [SI]; a number without a unit is in the unit that the field shows.

    Raises:
        InputError: they are no value that the declaration allows; names the field.
    """
    unit, typed = shown_unit(quantity.unit), plain_text(words)
    bare = typed.removeprefix("-").replace(".", "", 1).replace("e-", "", 1).replace("e", "", 1).isdigit()
    typed = f"{typed} {unit}" if bare and unit != "1" else typed
    value = ParsedNumber(parse(typed, quantity.unit, field=name), typed)
    quantity.check(name, value)
    return value


def plain_text(words: str) -> str:
    """Words of a person or of a page with the minus and the blanks of a keyboard."""
    return words.strip().replace("\u2212", "-").replace("\u2009", " ").replace("\u2060", "")


def shown(value: float, quantity: Quantity) -> str:
    """Value as its field displays it, in the unit beside it."""
    return f"{from_si(value, quantity.unit, shown_unit(quantity.unit)) if quantity.unit != '1' else value:.6g}"


def refusal(error: Exception, old: str) -> str:
    """Sentence of a refused value, with the one that stays in use."""
    return f"{error}. The old value, {old}, stays in use."


class InputField:
    """A text field with label, unit and meaning, and below it why its words were refused and what must be known of them.

    Args:
        label: before it.
        value: text to begin with.
        change: called with the words of every change.
        name: id in the page; a number by default.
        unit: beside the text.
        about: its meaning, below it.
        colour: CSS class of the label.
        hint: shown at the pointer.
        called: name for who cannot see, in place of a label.
        classes: CSS classes of the whole; without any it has no box of its own.
        edge: CSS classes of the field with its unit.
        said: CSS class of the place of the sentences; without any they stand below the field.
    """

    def __init__(
        self,
        label: str,
        value: str,
        change: Callable[[str], object],
        *,
        name: str = "",
        unit: str = "",
        about: str = "",
        colour: str = "",
        hint: str = "",
        called: str = "",
        classes: str = "f",
        edge: str = "field s",
        said: str = "",
    ) -> None:
        self._refusal, self._cautions = "", tuple[Caution, ...]()
        with box("div", classes) as self.element:
            key = name or f"c-{self.element.number}"
            if label:
                text("label", label, colour).set(for_=key, title=hint or None)
            with box("div", edge) as self._edge:
                self.input = box("input").set(id=key, value=value, autocomplete="off", title=hint or None)
                self.input.set(aria_label=called or None)
                self.input.set(aria_describedby=f"{key}-about {key}-said" if about else f"{key}-said")
                if unit not in ("", "1"):
                    text("span", unit, "u")
            self._said = box("div", said).set(id=f"{key}-said")
            if about:
                text("span", about, "about").set(id=f"{key}-about")
        for place, has_box in ((self.element, classes), (self._said, said)):
            if not has_box:
                place.style(display="contents")
        self.input.on_value("change", lambda words: change(str(words)[:2000]))

    def show(self, words: str) -> None:
        """Show other words."""
        self.input.set(value=words)

    def refuse(self, why: str, words: str | None = None) -> None:
        """Show why words were refused, which stay in the field to be put right; an empty sentence takes it away."""
        if why != self._refusal:
            self._refusal = why
            self._edge.classed("bad", bool(why))
            self._say()
        self.input.set(aria_invalid="true" if why else "false")
        if words is not None:
            self.show(words)

    def warn(self, cautions: Iterable[Caution]) -> None:
        """Show what must be known of the value."""
        if (now := tuple(cautions)) != self._cautions:
            self._cautions = now
            self._say()

    def _say(self) -> None:
        self._said.clear()
        with self._said:
            if self._refusal:
                refused(self._refusal)
            for caution in self._cautions:
                note(sentence(caution))


def show_cautions(cautions: Iterable[Caution], fields: Mapping[str, InputField], place: Element) -> None:
    """Show each caution beside the field of its parameter, and those of no field in a place."""
    every = list(cautions)
    for one in dict.fromkeys(fields.values()):
        one.warn(caution for caution in every if fields.get(caution.parameter) is one)
    place.clear()
    with place:
        for caution in every:
            if caution.parameter not in fields:
                note(sentence(caution))


def field(
    name: str, quantity: Quantity, value: float, change: Callable[[float], object], label: str = ""
) -> InputField:
    """Build the field of a declared parameter.

    Args:
        name: name of the parameter.
        quantity: declaration of the parameter.
        value: to begin with [SI].
        change: told every value that was accepted [SI]; may raise `InputError`, which is shown beside the field.
        label: its words; the name by default.
    """
    kept, (low, high) = value, quantity.bounds

    def came(words: str) -> None:
        nonlocal kept
        why = ""
        try:
            value = accept(name, words, quantity)
            change(value)
            kept = value
        except InputError as error:
            why = refusal(error, shown(kept, quantity))
        one.refuse(why, words if why else shown(kept, quantity))

    one = InputField(
        label or name.replace("_", " "),
        shown(value, quantity),
        came,
        unit=shown_unit(quantity.unit),
        about=quantity.doc if 0.0 < low * DECADES < high else f"{quantity.doc}; {quantity.allowed()}",
        colour=COLOURS.get(quantity.unit, ""),
        hint=quantity.doc,
    )
    one.input.set(inputmode="decimal")
    return one
