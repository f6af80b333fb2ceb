"""Description of a protocol as one paragraph: cases, steps with all numbers, and values that no source states."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ..documents import JsonValue
from ..errors import InputError
from ..schema import FileTable, FrozenTable
from .amounts import read_amount
from .steps import read_step, repeats, substituted

if TYPE_CHECKING:
    from .protocol import Protocol, ProtocolParameter

_UNITS = r"bar/s|bar|L0/s|L0|cm/s|cm|m/s\^2|m/s|mm|m|N/s|N|Hz|us|ms|s|deg|cycles|cycle"
_NUMBER = r"[-+]?(?<![\w.])\d[\d.]*(?:e[-+]?\d+)?"
_TOKENS = re.compile(rf"{_NUMBER}(?: (?:{_UNITS})(?![\w/]))?|\w+|\s+|.")


def protocol_sentence(protocol: Protocol) -> str:
    """Title; what is varied; first, the steps, last; sampling and needs; what is inferred."""
    cases = protocol.cases()
    varied = _varied(cases)
    said = [f"{protocol.title}."]
    if protocol.first:
        said.append(f"First {_parts(protocol.first, cases[0], 'first')}.")
    each = [f"each {_named(name)} of {_listed(protocol, name)}" for name in protocol.varied()]
    times = f"{protocol.repeat} times" if protocol.repeat > 1 else ""
    order = f"in random order (seed {protocol.seed})" if protocol.order == "random" else ""
    how = " ".join(w for w in (f"For {' and '.join(each)}" if each else "", times, order) if w)
    body = _marked(protocol.steps, _told(protocol, cases[0]), varied)
    said.append(f"{how[:1].upper()}{how[1:]}: {body}." if how else f"{body[:1].upper()}{body[1:]}.")
    if protocol.last:
        said.append(f"Last {_parts(protocol.last, cases[-1], 'last')}.")
    said += [_controlled(name, table) for name, table in protocol.control.items()]
    said.append(_sampled(protocol))
    inferred = _inferred(protocol, cases)
    if inferred:
        said.append(f"Inferred, not printed: {'; '.join(inferred)}.")
    return " ".join(said)


def clauses(protocol: Protocol) -> list[tuple[str, str]]:
    """Describe every step or group, with its dotted path such as ``steps.2``, in the order in which they are run."""
    cases = protocol.cases()
    varied, sentences = _varied(cases), []
    for section, case in (("first", cases[0]), ("steps", _told(protocol, cases[0])), ("last", cases[-1])):
        for i, part in enumerate(getattr(protocol, section), 1):
            text = _marked((part,), case, varied)
            if text:
                sentences.append((f"{section}.{i}", text))
    return sentences


def case_words(case: Mapping[str, JsonValue]) -> str:
    """Describe a case, such as ``pressure 5 bar, frequency 1 Hz``."""
    return ", ".join(f"{_named(k)} {v}" for k, v in case.items())


def is_inferred(p: ProtocolParameter, value: object) -> bool:
    """Whether a value of a parameter is one that no source prints."""
    if p.unit == "word":
        return value in p.inferred
    amount = read_amount(value, p.unit, field=p.name)
    return any(amount == read_amount(v, p.unit, field=p.name) for v in p.inferred)


def _named(name: str) -> str:
    return name.replace("_", " ")


def _varied(cases: list[dict[str, JsonValue]]) -> dict[str, list[Any]]:
    """Names with more than one value in all the cases, with these values."""
    names: dict[str, list[Any]] = {}
    for case in cases:
        for name, value in case.items():
            known = names.setdefault(name, [])
            if value not in known:
                known.append(value)
    return {name: values for name, values in names.items() if len(values) > 1}


def _listed(protocol: Protocol, name: str) -> str:
    """The values of a name: ``0, 1, 5 bar``, with a flag at inferred ones; options of a choice with what they set."""
    for choice in protocol.choices:
        if choice.name == name:
            return ", ".join(_option(choice.sets(o), o) for o in choice.values)
    (p,) = (p for p in protocol.parameters if p.name == name)
    words = [str(v).split(None, 1) for v in p.values]
    flags = [" (inferred)" if is_inferred(p, v) else "" for v in p.values]
    if p.unit == "word":
        return ", ".join(f"{v}{f}" for v, f in zip(p.values, flags, strict=True))
    same = len({w[1] if len(w) > 1 else "" for w in words}) == 1 and len(words[0]) > 1
    shown = [f"{w[0] if same else ' '.join(w)}{f}" for w, f in zip(words, flags, strict=True)]
    return ", ".join(shown) + (f" {words[0][1]}" if same else "")


def _option(sets: Mapping[str, JsonValue], option: str) -> str:
    return f"{option} ({case_words(sets)})" if sets else option


def _told(protocol: Protocol, case: Mapping[str, JsonValue]) -> dict[str, JsonValue]:
    """Case with phrases such as ``this lubricant`` for parameters that are text, for use in sentences."""
    words = {p.name: f"this {_named(p.name)}" for p in protocol.parameters if p.unit == "word" and len(p.values) > 1}
    phrases = {**case, **words}
    try:
        _parts(protocol.steps, phrases, "steps")
    except InputError:  # it is a word that means something, such as a kind of waveform
        return dict(case)
    return phrases


def _parts(parts: tuple[FrozenTable, ...], case: Mapping[str, JsonValue], path: str) -> str:
    said = []
    for i, part in enumerate(parts, 1):
        place = f"{path}.{i}"
        entry = FileTable(substituted(part, case, place, None), place, "")
        times = repeats(entry)
        if times == 0:
            continue
        if "steps" in part:
            label = f"{part['label']}: " if "label" in part else ""
            text = f"{label}[{_parts(part['steps'], case, f'{place}.steps')}]"
        else:
            text = read_step(entry).sentence()
        said.append(f"{text} (done {times} times)" if times > 1 else text)
    return "; ".join(said)


def _marked(parts: tuple[FrozenTable, ...], case: Mapping[str, JsonValue], varied: Mapping[str, list[Any]]) -> str:
    """The steps of one case; a number that changes with a name is called after it: ``at this frequency``."""
    base = _TOKENS.findall(_parts(parts, case, "steps"))
    marked = list(base)
    for name, values in varied.items():
        for value in () if str(case[name]).startswith("this ") else values:
            other = _TOKENS.findall(_parts(parts, {**case, name: value}, "steps"))
            if len(other) != len(base):
                continue
            for i, (a, b) in enumerate(zip(base, other, strict=True)):
                if a != b:
                    marked[i] = f"this {_named(name)}"
    return "".join(marked)


def _controlled(name: str, table: Mapping[str, JsonValue]) -> str:
    """Which controller of a quantity takes the place of the rig's, with its parameters."""
    gains = ", ".join(f"{_named(key)} {value}" for key, value in table.items() if key != "controller")
    by = f" by {table['controller']}" if "controller" in table else ""
    return f"The {name} is controlled{by}{f' with {gains}' if gains else ''}."


def _sampled(protocol: Protocol) -> str:
    rate = protocol.sample_rate
    shown = f"{rate / 1e3:.6g} kHz" if rate >= 1e3 else f"{rate:.6g} Hz"
    return f"Sampled at {shown}; needs {', '.join(protocol.required())}."


def _inferred(protocol: Protocol, cases: list[dict[str, JsonValue]]) -> list[str]:
    said = []
    for c in protocol.choices:
        options = [o for o in c.values if o in c.inferred]
        if options:
            said.append(f"{_named(c.name)} {', '.join(_option(c.sets(o), o) for o in options)}")
    for p in protocol.parameters:
        if len(p.values) > 1:
            continue  # flagged where they are listed
        values = dict.fromkeys(case[p.name] for case in cases if is_inferred(p, case[p.name]))
        if values:
            said.append(f"{_named(p.name)} {', '.join(str(v) for v in values)}")
    return said
