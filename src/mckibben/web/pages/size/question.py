"""The question of a visitor on the Size page: the words of its fields, as a link states them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

from ....documents import JsonValue


class QuestionField(NamedTuple):
    """A field of the form: argument of `mckibben.size`, label, class of its quantity, and what to write."""

    name: str
    label: str
    quantity: str
    about: str


FIELDS: tuple[tuple[str, tuple[QuestionField, ...]], ...] = (
    (
        "What it must do",
        (
            QuestionField("force", "Force", "F", "at the end of the stroke, such as 50 N"),
            QuestionField("load", "or load", "F", "a mass that hangs on it, such as 5 kg"),
            QuestionField("stroke", "Stroke", "L", "such as 3 cm"),
            QuestionField("pressure", "Pressure", "P", "gauge, such as 5 bar"),
            QuestionField("space", "Space", "L", "length x diameter, such as 25 cm x 3 cm"),
            QuestionField("speed", "Speed", "L", "of shortening with that force, such as 10 cm/s"),
        ),
    ),
    (
        "How often",
        (
            QuestionField("rate", "Cycles", "", "such as 1 Hz"),
            QuestionField("working_time", "Each day", "", "time at work, such as 8 h"),
        ),
    ),
    (
        "With what",
        (
            QuestionField("tube_length", "Tube", "L", "from the valve to the muscle, such as 50 cm"),
            QuestionField("valve", "Valve", "v", "a name, or numbers of a catalogue: Cv=0.3, switching_time=8 ms"),
            QuestionField("battery", "Battery", "", "for a small compressor and the valve, such as 100 Wh"),
            QuestionField("tank", "Tank", "", "of air, such as 2 l at 200 bar"),
        ),
    ),
)
# Field of the form in which a value is put right, by the name that an error has.
FIELD_OF = {"length": "space", "diameter": "space", "frequency": "rate"}


@dataclass(frozen=True)
class SizeQuestion:
    """Words of the form, by argument of `mckibben.size`; nothing where none is required."""

    force: str = "50 N"
    load: str = ""
    stroke: str = "3 cm"
    pressure: str = "5 bar"
    space: str = ""
    speed: str = ""
    rate: str = "1 Hz"
    working_time: str = "8 h"
    tube_length: str = "50 cm"
    valve: str = ""
    battery: str = ""
    tank: str = ""
    muscle: str = ""
    law: str = "linear_threshold"
    lines: str = "yes"

    def arguments(self) -> dict[str, JsonValue]:
        """Arguments of `mckibben.size`."""
        stated = {f.name: getattr(self, f.name).strip() or None for f in fields(self)}
        return stated | {"lines": self.lines == "yes"}

    def link(self) -> dict[str, str | None]:
        """Parameters of the page's address; None for those that are usual, ``none`` for those left empty."""
        usual = SizeQuestion()
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {n: None if v == getattr(usual, n) else v or "none" for n, v in values.items()}


LINKED = tuple(f.name for f in fields(SizeQuestion))


def from_link(words: Mapping[str, str]) -> SizeQuestion:
    """The question of a link; what it does not state is as usual."""
    stated = {name: "" if text == "none" else text for name, text in words.items() if name in LINKED}
    if stated.get("load"):
        stated.setdefault("force", "")  # the usual force is none that anybody gave
    return replace(SizeQuestion(), **stated)
