"""Three views of a protocol: a sentence with editable numbers, a form, and the text of its file."""

from __future__ import annotations

import re
from typing import Any

from ....documents import JsonValue
from ....errors import InputError, MckibbenError
from ....experiments.protocol import Protocol, ProtocolParameter, clauses, is_inferred
from ....experiments.read import with_values
from ....quantities import split_values

COLOURS = {"Pa": "pressure", "N": "tension", "m": "length"}  # of a number, by its unit
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")
_TOKENS = re.compile(r"[-+]?(?<![\w.])\d[\d.]*(?:e[-+]?\d+)?(?: (?:bar/s|bar|L0/s|L0|cm/s|cm|m/s|mm|m|N/s|N|Hz|us|ms|s|deg|"
                     r"cycles|cycle|times)(?![\w/]))?|this \w+|\w+|\s+|.")  # fmt: skip
FACTORS = (1.01, 0.99, 1.5)


def faces(protocol: Protocol) -> dict[str, JsonValue]:
    """Return all three views."""
    return {
        "name": protocol.name,
        "title": protocol.title,
        "source": protocol.source,
        "sentence": sentence(protocol),
        "full": protocol.sentence(),
        "form": form(protocol),
        "text": protocol.toml(),
    }


def sentence(protocol: Protocol) -> list[dict[str, JsonValue]]:
    """Split the sentence into clauses: path of the step, and pieces of text, some of them fields of a parameter."""
    said = clauses(protocol)
    cut = [_TOKENS.findall(text) for _, text in said]
    owner: dict[tuple[int, int], ProtocolParameter] = {}
    for p in protocol.parameters:
        for other in _changed(protocol, p):
            for i, (mine, theirs) in enumerate(zip(cut, other, strict=True)):
                if len(mine) == len(theirs):
                    for j in [j for j, (a, b) in enumerate(zip(mine, theirs, strict=True)) if a != b]:
                        owner.setdefault((i, j), p)
    known = {f"this {p.name.replace('_', ' ')}": p for p in protocol.parameters if len(p.values) > 1}
    parts = []
    for i, (path, _) in enumerate(said):
        pieces: list[dict[str, Any]] = []
        for j, token in enumerate(cut[i]):
            owned = owner.get((i, j)) or known.get(token)
            if owned is not None:
                pieces.append({"text": token, "name": owned.name, "colour": COLOURS.get(owned.unit, "")})
            elif pieces and "name" not in pieces[-1]:
                pieces[-1]["text"] += token
            else:
                pieces.append({"text": token})
        if pieces and "name" not in pieces[0]:
            pieces[0]["text"] = pieces[0]["text"][:1].upper() + pieces[0]["text"][1:]
        parts.append({"path": path, "pieces": pieces})
    return parts


def _changed(protocol: Protocol, p: ProtocolParameter) -> list[list[list[str]]]:
    """Return the clauses with another value of a parameter, to locate its number."""
    match = _NUMBER.fullmatch(str(p.values[0])) if len(p.values) == 1 else None
    if match is None or p.unit == "word":
        return []
    number, unit = float(match[1]), match[2]
    for factor in FACTORS:
        whole = p.unit == "1" and number == int(number)
        other = number + (1.0 if factor > 1.0 else -1.0) if whole or number == 0.0 else number * factor
        words = f"{int(other) if whole else f'{other:.6g}'} {unit}".strip()
        try:
            return [[_TOKENS.findall(text) for _, text in clauses(with_values(protocol, {p.name: words}))]]
        except MckibbenError:
            continue
    return []


def form(protocol: Protocol) -> list[dict[str, JsonValue]]:
    """List a field of every choice and parameter: name, label, value, unit, meaning and what is allowed."""
    fields: list[dict[str, Any]] = []
    for c in protocol.choices:
        options = [o for o, _ in c.options]
        value = ", ".join(c.values)
        fields.append(
            {
                "name": c.name,
                "label": _label(c.name),
                "value": value,
                "unit": "",
                "about": c.about,
                "options": options,
                "allowed": f"one or more of {', '.join(options)}",
                "colour": "",
                "inferred": set(c.values) <= set(c.inferred),
            }
        )
    set_by = {k for c in protocol.choices for _, sets in c.options for k, _ in sets}
    for p in protocol.parameters:
        if not p.values and p.name in set_by:
            continue
        value, unit = _value(p)
        allowed = f"{p.bounds[0]} to {p.bounds[1]}" if p.bounds else ""
        fields.append(
            {
                "name": p.name,
                "label": _label(p.name),
                "value": value,
                "unit": unit,
                "about": p.about,
                "options": None,
                "allowed": allowed,
                "colour": COLOURS.get(p.unit, ""),
                "inferred": any(is_inferred(p, v) for v in p.values),
            }
        )
    return fields


def _label(name: str) -> str:
    words = name.replace("_", " ")
    return words[:1].upper() + words[1:]


def _value(p: ProtocolParameter) -> tuple[str, str]:
    """Return the values of a parameter as text, and their common unit."""
    if p.unit == "word":
        return ", ".join(map(str, p.values)), ""
    matches = [_NUMBER.fullmatch(str(v)) for v in p.values]
    units = {m[2] for m in matches if m}
    if len(units) == 1 and all(matches):
        return ", ".join(m[1] for m in matches if m), units.pop()
    return ", ".join(map(str, p.values)), ""


def changed(protocol: Protocol, name: str, words: str) -> Protocol:
    """Return the protocol with another value of a parameter or choice; plain numbers are in the unit of the field.

    Raises:
        InputError: names the field, and what is allowed.
    """
    text = words.replace("\u2212", "-").replace("\u2009", " ").replace("\u2060", "").strip()
    if not text:
        raise InputError(name, None, "is empty")
    unit = next((_value(p)[1] for p in protocol.parameters if p.name == name), "")
    listed = split_values(text, field=name)
    full = [f"{w} {unit}" if unit and (m := _NUMBER.fullmatch(w)) and not m[2] else w for w in listed]
    return with_values(protocol, {name: full if len(full) > 1 else full[0] if full else text})
