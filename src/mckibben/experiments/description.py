"""Protocols in words: those that ship, and one of them with all its numbers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..answers import Answer, Column, Table
from ..citations import known_keys, reference
from ..documents import JsonValue
from ..errors import InputError
from ..verbs import Changes, ProtocolName, verb
from . import amounts, read
from .protocol import Protocol, ProtocolChoice, ProtocolParameter, is_inferred

REST_LENGTH = 0.14  # of the muscle for which a duration is stated [m]


@dataclass(frozen=True)
class ShippedProtocols(Answer):
    """The protocols that ship: what `describe_protocol` finds without a name.

    Attributes:
        protocols: of test machines.
        stimulated: of biological muscles.
    """

    protocols: tuple[Protocol, ...]
    stimulated: tuple[Protocol, ...]

    def to_dict(self) -> dict[str, JsonValue]:
        """Name, title and source of each."""
        return {"protocols": self.rows()}

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per protocol."""
        return [*_named(self.protocols), *_named(self.stimulated)]

    def tables(self) -> list[Table]:
        """Those of test machines, and those with stimulation."""
        columns = (Column("name"), Column("title", "what is done"), Column("source"))
        title = "Protocols with stimulation, of biological muscles"
        return [Table("Protocols", columns, _named(self.protocols)), Table(title, columns, _named(self.stimulated))]


def _named(protocols: tuple[Protocol, ...]) -> list[dict[str, JsonValue]]:
    return [{"name": p.name, "title": p.title, "source": p.source} for p in protocols]


@dataclass(frozen=True)
class ProtocolDescription(Answer):
    """A protocol with all its numbers: what `describe_protocol` finds.

    Attributes:
        protocol: with changes.
        toml: text of its file; of a changed one, that of the changed protocol.
    """

    protocol: Protocol
    toml: str

    def to_dict(self) -> dict[str, JsonValue]:
        """Sentence, choices, parameters with their values [SI], duration [s] and hash, and the whole document."""
        protocol = self.protocol
        key = protocol.source.split(",")[0]
        return {
            "name": protocol.name,
            "title": protocol.title,
            "source": protocol.source,
            "reference": reference(key) if key in known_keys() else None,
            "note": protocol.note,
            "sentence": protocol.sentence(),
            "choices": {c.name: _choice(c) for c in protocol.choices},
            "parameters": {p.name: _parameter(protocol, p) for p in protocol.parameters},
            "varied": list(protocol.varied()),
            "needs": list(protocol.required()),
            "sample_rate": protocol.sample_rate,
            "order": protocol.order,
            "seed": protocol.seed,
            "repeat": protocol.repeat,
            "duration": _duration(protocol),
            "hash": protocol.digest,
            "document": protocol.document(),
            "toml": self.toml,
        }

    def tables(self) -> list[Table]:
        """Choices and parameters below the protocol's sentence."""
        rows = []
        for c in self.protocol.choices:
            values = [f"{v} (inferred)" if v in c.inferred else str(v) for v in c.values]
            allowed = f"one of {', '.join(option for option, _ in c.options)}"
            rows.append({"parameter": c.name, "value": ", ".join(values), "allowed": allowed, "about": _about(c)})
        for p in self.protocol.parameters:
            known = _parameter(self.protocol, p)
            values = [f"{v['words']} (inferred)" if v["inferred"] else str(v["words"]) for v in known["values"]]
            # a bound is stated, a unit shows what else is allowed
            allowed = " to ".join(b["words"] for b in known["bounds"]) if known["bounds"] else _kind(p.unit)
            about = _about(p, known["set_by"])
            rows.append({"parameter": p.name, "value": ", ".join(values), "allowed": allowed, "about": about})
        columns = (Column("parameter"), Column("value"), Column("allowed"), Column("about", "")) if rows else ()
        return [Table(self.protocol.sentence(), columns, rows)]

    def remarks(self) -> list[str]:
        """What it needs, how long it takes, where it is from, and its hash."""
        content = self.to_dict()
        said, length = [f"Needs: {', '.join(content['needs'])}."], content["duration"]
        if length["longest"] is None:
            said.append(f"Duration not known in advance: {length['note']}.")
        else:
            at_most, count = "at most " if length["note"] else "", length["steps"]
            steps = f"{count} step{'' if count == 1 else 's'}"
            minutes, rest = divmod(length["longest"], 60.0)
            time = f"{minutes:.0f} min {rest:.3g} s" if minutes else f"{rest:.4g} s"
            duration = f"{at_most}{time} in {steps}"
            said.append(f"Duration: {duration}, for a rest length of {100 * REST_LENGTH:g} cm.")
        said += [f"Note: {self.protocol.note.rstrip('.')}."] if self.protocol.note else []
        source = f"Source: {self.protocol.source}. {content['reference'] or ''}".rstrip()
        return [*said, *([source] if self.protocol.source else []), f"Hash: {content['hash']}"]


def _choice(choice: ProtocolChoice) -> dict[str, JsonValue]:
    return {
        "values": list(choice.values),
        "inferred": [v for v in choice.values if v in choice.inferred],
        "options": {option: dict(sets) for option, sets in choice.options},
        "about": choice.about,
        "note": choice.note,
    }


def _parameter(protocol: Protocol, p: ProtocolParameter) -> dict[str, Any]:
    """A parameter with its values, or those that a choice assigns to it, and its bounds."""

    def by_inferred(value: Any) -> bool:  # depends on an option of a choice that no source prints
        inferred = [c.sets(o) for c in protocol.choices for o in c.values if o in c.inferred]
        return not p.values and any(sets.get(p.name) == value for sets in inferred)

    def entry(value: Any) -> dict[str, JsonValue]:
        if p.unit == "word":
            return {"value": value, "unit": "word", "words": value, "inferred": is_inferred(p, value)}
        amount = amounts.read_amount(value, p.unit, field=p.name)
        inferred = is_inferred(p, value) or by_inferred(value)
        return {"value": amount.value, "unit": amount.unit, "words": str(value), "inferred": inferred}

    setters = (c.name for c in protocol.choices if any(p.name in dict(sets) for _, sets in c.options))
    return {
        "unit": p.unit,
        "values": [entry(v) for v in p.values or dict.fromkeys(case[p.name] for case in protocol.cases())],
        "bounds": [entry(b) | {"inferred": False} for b in p.bounds] or None,
        "set_by": None if p.values else next(setters),
        "about": p.about,
        "note": p.note,
    }


def _duration(protocol: Protocol) -> dict[str, JsonValue]:
    """Longest time [s] for a typical muscle; None if it is unknown in advance."""
    about: dict[str, Any] = {"rest_length": REST_LENGTH}
    try:
        plan = protocol.expand(rest_length=REST_LENGTH)
    except InputError as error:
        return about | {"longest": None, "samples": None, "steps": None, "note": str(error)}
    until = any(step.until is not None for step in plan.steps)
    note = "the longest: steps may end earlier" if until else ""
    return about | {"longest": plan.duration, "samples": plan.samples, "steps": len(plan.steps), "note": note}


def _about(one: ProtocolChoice | ProtocolParameter, set_by: str | None = None) -> str:
    return "; ".join(words for words in (f"set by {set_by}" if set_by else "", one.about, one.note) if words)


def _kind(unit: str) -> str:
    words = {"m": "a length, or in L0", "m/s": "a velocity, or in L0/s", "1": "a number", "word": "a word"}
    return words.get(unit, f"a value in {unit}")


@verb
def describe_protocol(
    protocol: ProtocolName | None = None, *, changes: Changes | None = None
) -> ShippedProtocols | ProtocolDescription:
    """List the protocols, or describe one of them with all its numbers.

    Args:
        protocol: name of a shipped protocol, or a .toml file; without it all are listed.
        changes: change a parameter; several values separated by ', ' or ';', such as pressure='1 bar, 3 bar'.

    Raises:
        InputError: names what is unknown, out of bounds or in the wrong unit.

    Examples:
        >>> from mckibben.experiments.description import describe_protocol
        >>> describe_protocol("work-loop", changes={"cycles": 3}).protocol.name
        'work-loop'
    """
    if protocol is None:
        if changes:
            raise InputError("changes", None, "is allowed only after the name of one")
        names = (read.protocol_names(), read.stimulation_protocol_names())
        machine, stimulated = (tuple(map(read.shipped, some)) for some in names)
        return ShippedProtocols(machine, stimulated)
    chosen = read.changed_protocol(protocol, changes or {})
    if changes or isinstance(protocol, Protocol):
        text = chosen.toml()
    else:
        text = Path(protocol).read_text("utf-8") if str(protocol).endswith(".toml") else read.shipped_text(protocol)
    return ProtocolDescription(chosen, text)
