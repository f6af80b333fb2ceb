"""The steps of a recording of the test machine as recordings of their own, by label and by case.

Such a recording lists its steps in ``meta["steps"]``: ``index``, ``label``, ``case`` (the words of every parameter of the
protocol), ``start`` (inclusive) and ``end`` (exclusive) [s] of its time, and whether each was ``recorded``. Words are
compared as amounts: ``5 bar`` is ``500 kPa``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..documents import JsonValue
from ..errors import InputError, choice
from ..formats.table import si_of
from ..quantities import to_si
from ..recordings import Recording

# Amounts that differ by less are the same: the way through a unit leaves some rounding.
_ROUNDING = 1e-9
_AMOUNT = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


def segments(record: Recording, /, label: str | None = None, **case: str | float) -> list[Recording]:
    """The recorded steps that match, in their order; each a recording with its step in ``meta["step"]``.

    The time is kept. A step of which no sample is there, such as one that a selection left out, is passed over.

    Args:
        record: record of the test machine.
        label: label of the step; any where it is left out.
        **case: what was varied, such as ``pressure="5 bar"``; a number is in SI.

    Raises:
        InputError: the recording has no steps, or none that match; names those that it has.
    """
    matching = chosen_steps(record, label, case)
    parts = [part for step in matching if step["recorded"] and (part := _part(record, step)) is not None]
    if not parts:
        skipped = ", ".join(dict.fromkeys(_place(s) for s in matching if not s["recorded"]))
        why = (
            f"not recorded are {skipped}"
            if skipped
            else f"the recording has samples from {record.time[0]:.6g} s to {record.time[-1]:.6g} s"
        )
        raise InputError("steps", None, f"have no sample in the recording ({len(matching)} match): {why}")
    return parts


def chosen_steps(record: Recording, label: str | None, case: Mapping[str, JsonValue]) -> list[dict[str, JsonValue]]:
    """The steps that match, those that were not recorded too; arguments and errors as for `segments`."""
    steps = steps_of(record)
    labels = dict.fromkeys(str(s["label"]) for s in steps)
    if label is not None and label not in labels:
        raise InputError("label", label, "the recording has", known=labels)
    values = case_values(record)
    for name, wanted in case.items():
        if name not in values:
            raise InputError("case", name, "the recording has", known=values)
        if not any(same_amount(wanted, words) for words in values[name]):
            raise InputError(name, wanted, f"must be {choice(values[name])} as in the recording")
    chosen = [
        s
        for s in steps
        if (label is None or s["label"] == label)
        and all(name in s["case"] and same_amount(wanted, s["case"][name]) for name, wanted in case.items())
    ]
    if not chosen:
        wanted_words = ", ".join([*([str(label)] if label else []), *(f"{k} {v}" for k, v in case.items())])
        near = [s for s in steps if s["label"] == label] if label is not None else steps
        has = "; ".join(dict.fromkeys(_place(s, case) for s in near))
        raise InputError("steps", wanted_words, f"not together; the recording has {has}")
    return chosen


def cases(record: Recording) -> list[dict[str, str]]:
    """Cases of the recorded steps without repetition, in order of execution: values by name, as text.

    Raises:
        InputError: the recording has no steps.
    """
    distinct: list[dict[str, str]] = []
    for step in steps_of(record):
        if step["recorded"] and step["case"] and step["case"] not in distinct:
            distinct.append(step["case"])
    return distinct


def varied(record: Recording) -> dict[str, list[str]]:
    """Names with more than one value in the cases of the recorded steps, with these values: what distinguishes steps."""
    names: dict[str, list[str]] = {}
    for case in cases(record):
        for name, words in case.items():
            known = names.setdefault(name, [])
            if words not in known:
                known.append(words)
    return {name: words for name, words in names.items() if len(words) > 1}


def case_values(record: Recording) -> dict[str, list[str]]:
    """Names of all cases with their values as text, including steps that were not recorded."""
    values: dict[str, dict[str, None]] = {}
    for step in steps_of(record):
        for name, words in step["case"].items():
            values.setdefault(name, {})[words] = None
    return {name: list(words) for name, words in values.items()}


def steps_of(record: Recording) -> list[dict[str, JsonValue]]:
    """Steps as listed in the recording, checked; the values of their cases are text.

    Raises:
        InputError: it lists none, or one that is no step.
    """
    listed = record.meta.get("steps")
    if listed is None or listed == []:
        raise InputError("steps", None, "are not in the recording: it must be one of the test machine")
    if not isinstance(listed, list):
        raise InputError("steps", type(listed).__name__, "must be a list")
    return [_checked(step, f"steps.{i}") for i, step in enumerate(listed, 1)]


def same_amount(a: object, b: object) -> bool:
    """Whether two texts state the same amount, ``5 bar`` and ``500 kPa``; a number is in the other's SI unit."""
    if isinstance(a, str) and isinstance(b, str) and a.split() == b.split():
        return True
    one, other = _amount(a), _amount(b)
    if one is None or other is None:
        return str(a).strip() == str(b).strip()
    (x, unit), (y, target) = one, other
    try:
        if unit is None and target is not None:
            unit = si_of(target, field="unit")[0]
        elif target is None and unit is not None:
            target = si_of(unit, field="unit")[0]
        if unit != target:
            assert unit is not None and target is not None
            x = to_si(x, unit or "1", target or "1", field="unit")
    except InputError:  # another dimension, or a unit of its own such as L0
        return False
    return math.isclose(x, y, rel_tol=_ROUNDING)


def amount_of(words: str) -> tuple[float, str, str]:
    """Key that sorts words as a person expects: the number in SI, the words, the SI unit.

    Words without a number come first.
    """
    amount = _amount(words)
    if amount is None:
        return -math.inf, words, ""
    number, unit = amount
    try:
        si, scale, offset = si_of(unit or "1", field="unit")
    except InputError:  # a unit of its own such as L0
        return number, words, ""
    return number * scale + offset, words, si


def _amount(value: Any) -> tuple[float, str | None] | None:
    """A number and its unit; no unit known for a plain number, no amount for a word."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value), None
    match = _AMOUNT.fullmatch(str(value))
    return (float(match[1]), match[2]) if match else None


def _checked(step: Any, field: str) -> dict[str, JsonValue]:
    if not isinstance(step, Mapping):
        raise InputError(field, type(step).__name__, "must be a table with start, end, label and case")
    checked = {"index": 0, "path": "", "label": "", "ended_by": "time", "recorded": True, "sentence": "", **step}
    for key in ("start", "end"):
        time = step.get(key)
        if isinstance(time, bool) or not isinstance(time, int | float) or not math.isfinite(time):
            raise InputError(f"{field}.{key}", str(time), "must be a time [s]")
    case = step.get("case") or {}
    if not isinstance(case, Mapping):
        raise InputError(f"{field}.case", type(case).__name__, "must be a table of words")
    return checked | {"case": {str(name): str(words) for name, words in case.items()}}


def _part(record: Recording, step: Mapping[str, Any]) -> Recording | None:
    """The samples of a step, or None if there are none."""
    # Times are sums of periods: 0.30000000000000004 s is meant by 0.3 s.
    room = 1e-6 * record.period if len(record) > 1 else 0.0
    first, end = np.searchsorted(record.time, [step["start"] - room, step["end"] - room])
    if end <= first:
        return None
    some = {name: channel.with_values(channel.values[first:end]) for name, channel in record.channels.items()}
    return Recording(record.time[first:end], some, {**record.meta, "steps": [dict(step)], "step": dict(step)})


def _place(step: Mapping[str, Any], names: Mapping[str, Any] | None = None) -> str:
    """Describe a step, with the values of some names of its case."""
    words = ", ".join(f"{name} {step['case'][name]}" for name in names or () if name in step["case"])
    return f"{step['label'] or step['path']}{f' ({words})' if words else ''}"
