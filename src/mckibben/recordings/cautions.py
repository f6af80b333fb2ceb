"""What must be said with a recording: facts of its metadata that change what its samples are worth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeGuard

from ..answers import Caution, collect
from ..documents import JsonValue
from ..quantities import with_unit

# Counts of a machine that mean something for the samples, in words after the number; others of a hardware of one's own are
# said by their name. What is dropped without loss, as a frame that came twice, is none of them.
COUNTS = {
    "lost": "did not arrive, or damaged: what was recorded in their place is no measurement",
    "overruns": "overruns: samples were lost there",
    "late": "came more than a period late",
    "answers_late": "were taken by the device before its new command had come",
    "answers_damaged": "had a command that arrived damaged",
    "skipped": "were skipped",
    "missed": "were missed",
    "retries": "needed another try",
}
TAKEN = ("samples", "reads")  # names of the count of all samples
MACHINE = ("hardware", "deadlines")  # parameters of the cautions that a machine has counted
HARMLESS = ("repeated", "bad_checksum", "undecodable", *TAKEN)  # what is lost by them is among the lost


def cautions_of(meta: Mapping[str, JsonValue]) -> tuple[Caution, ...]:
    """What metadata say against the samples of a recording: lost and late ones, saturation, warnings, rows left out."""
    sentences = [(text, "hardware") for text in _lines(_table(meta.get("hardware")))]
    timing = _table(meta.get("deadlines"))
    if behind := _count(timing, "behind"):
        sentences.append(
            (f"{behind:,} of {_count(timing, 'samples'):,} samples began more than a period late", "deadlines")
        )
    sentences += [
        (f"{name} {_saturated(_table(one))}", name) for name, one in _table(meta.get("saturation")).items() if one
    ]
    source = _table(meta.get("source")).get("left_out")
    sentences += (
        [(str(text).rstrip("."), "source") for text in source or ()] if isinstance(source, list | tuple) else []
    )
    warnings = meta.get("warnings")
    listed = warnings if isinstance(warnings, list | tuple) else ()
    sentences += [(str(_table(one).get("text", one)), "warnings") for one in listed]
    return collect(*(Caution(text, parameter) for text, parameter in sentences))


def _lines(hardware: Mapping[str, Any]) -> list[str]:
    taken = max((_count(hardware, name) for name in TAKEN), default=0)
    of = f" of {taken:,} samples" if taken else " samples"
    return [
        f"{number:,}{of} {COUNTS.get(name, name.replace('_', ' '))}"
        for name in hardware
        if name not in HARMLESS and (number := _count(hardware, name))
    ]


def _saturated(one: Mapping[str, Any]) -> str:
    if one.get("sentence"):
        return str(one["sentence"]).rstrip(".")
    words = ["was at an end of its range"]
    words += [f"{100.0 * one['share']:.3g} % of its samples"] if _number(one.get("share")) else []
    words += [f"first at {one['first']:.6g} s"] if _number(one.get("first")) else []
    words += [f"at most {with_unit(float(one['longest']), 's')} on end"] if _number(one.get("longest")) else []
    return ", ".join(words)


def _table(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _count(table: Mapping[str, Any], name: str) -> int:
    value = table.get(name)
    return int(value) if _number(value) and value == value else 0


def _number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
