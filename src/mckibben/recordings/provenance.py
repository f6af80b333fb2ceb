"""What metadata say: how a recording came about, by what recordings differ, and what speaks against the samples."""

from __future__ import annotations

import datetime
import platform
from collections.abc import Iterable, Mapping, Sequence
from importlib import metadata
from typing import Any, TypeGuard

from .._version import __version__
from ..answers import Caution, collect
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import with_unit


def versions() -> dict[str, str]:
    """Return the versions of this package, of JAX and of Python."""
    return {"mckibben": __version__, "jax": metadata.version("jax"), "python": platform.python_version()}


def created() -> str:
    """Return the present time in UTC, ISO 8601."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


FIRST = ("muscle", "protocol", "rig", "plumbing", "circuit", "result")  # of a recording, in this order
MOST = 6  # numbers of the machine that tell recordings apart, beyond which they are too many to be told


def conditions(meta: Mapping[str, JsonValue]) -> dict[str, str]:
    """The conditions of a recording as text, by name: muscle, protocol, rig, and the numbers of the protocol.

    Args:
        meta: its metadata.
    """
    protocol = _table(meta.get("protocol"))
    specimen = meta.get("specimen")
    words = {
        "muscle": str(_table(specimen).get("id") or ("" if isinstance(specimen, Mapping) else specimen or "")),
        "protocol": str(protocol.get("name") or (meta["protocol"] if isinstance(meta.get("protocol"), str) else "")),
        **{name: str(meta[name]) for name in FIRST[2:] if isinstance(meta.get(name), str)},
    }
    for name, parameter in _table(protocol.get("parameters")).items():
        value = _table(parameter).get("value")
        if value is not None:
            words[name] = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    for section in ("choices", "chosen"):
        words |= {name: str(value) for name, value in _table(protocol.get(section)).items() if isinstance(value, str)}
    if isinstance(meta.get("seed"), int):
        words["seed"] = str(meta["seed"])
    return {name: value for name, value in words.items() if value}


def machine_numbers(meta: Mapping[str, JsonValue]) -> dict[str, str]:
    """The numbers of the machine of a recording as text with units, by their path, such as ``circuit.tube.length``."""
    numbers = {}
    for path, number in _table(meta.get("parameters")).items():
        value, unit = _table(number).get("value"), str(_table(number).get("unit") or "")
        if isinstance(value, int | float) and not isinstance(value, bool):
            try:
                numbers[path] = with_unit(float(value), unit) if unit and unit != "1" else f"{value:.4g}"
            except InputError:
                numbers[path] = f"{value:.4g} {unit}"
    return numbers


def differing_conditions(recordings: Sequence[Mapping[str, str]]) -> list[str]:
    """Names of the conditions that are not the same in all recordings, in their order."""
    names = dict.fromkeys(name for one in recordings for name in one)
    return [name for name in names if len({one.get(name) for one in recordings}) > 1]


def told_apart(metas: Sequence[Mapping[str, JsonValue]]) -> list[dict[str, str]]:
    """What distinguishes each recording: the conditions that differ, else a few numbers of the machine."""
    for read in (conditions, machine_numbers):
        told = [read(meta) for meta in metas]
        names = differing_conditions(told)
        if names and (read is conditions or len(names) <= MOST):
            return [{name: one[name] for name in names if name in one} for one in told]
    return [{} for _ in metas]


def _table(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


# What describes the run itself and not how it was set up.
_RESULTS = (
    "created", "digest", "energy", "balance", "friction", "steps", "events", "saturation", "warnings", "citations", "timing",
    "versions", "message", "sentence", "inferred", "encoder", "converters", "units",
)  # fmt: skip
_PREFIXES = {"protocol.parameters.": "", "rig_document.": "rig.", "parameters.units.": "", "parameters.": ""}
_WORDS = {"protocol.name": "protocol", "specimen": "muscle", "rig_document.name": "rig"}


def facts(meta: Mapping[str, JsonValue], *, everything: bool = False) -> dict[str, str]:
    """How a recording was set up, as text by name.

    Args:
        meta: metadata of the recording.
        everything: results and descriptions, too.
    """
    facts_by_name: dict[str, str] = {}
    for path, value in _flat(meta, ""):
        top = path.partition(".")[0]
        if path.endswith((".unit", ".low", ".high", ".about", ".schema")) and not everything:
            continue
        if not everything and (top in _RESULTS or isinstance(value, list | tuple)):
            continue
        facts_by_name.setdefault(path if everything else _short_path(path), _fact_text(value))
    return facts_by_name


def differing(metas: Sequence[Mapping[str, JsonValue]], *, everything: bool = False) -> dict[str, list[str]]:
    """Values by name of what is not the same in all recordings, one per recording; empty where one lacks it.

    Of values that follow from each other, such as a parameter of the protocol and of the simulated circuit, those that were
    set come first, and others are left out unless everything is asked for.
    """
    known = [facts(meta, everything=everything) for meta in metas]
    names = list(dict.fromkeys(name for one in known for name in one))
    found = {name: [one.get(name, "") for one in known] for name in names}
    found = {name: values for name, values in found.items() if len(set(values)) > 1}
    if everything:
        return found
    distinct: dict[str, list[str]] = {}
    patterns: set[tuple[int, ...]] = set()
    for name in sorted(found, key=_rank):
        # Two facts that part the recordings alike say the same, unless both were set.
        pattern = tuple(found[name].index(value) for value in found[name])
        if pattern in patterns and _rank(name) > 0:
            continue
        patterns.add(pattern)
        distinct[name] = found[name]
    return distinct


def labels(metas: Sequence[Mapping[str, JsonValue]], names: Iterable[str] | None = None) -> list[str]:
    """Distinguish each recording from the others in a few words, or by its number."""
    values = differing(metas)
    chosen = [name for name in (values if names is None else names) if name != "title"] or list(values)
    rows = [
        ", ".join(filter(None, (values[name][i] for name in chosen[:2] if name in values))) for i in range(len(metas))
    ]
    return [row or str(i + 1) for i, row in enumerate(rows)]


def _rank(name: str) -> int:
    """Whether a fact was chosen for the run, 0, or follows from that choice."""
    return 0 if "." not in name else 1 if name.startswith(("rig.", "muscle.")) else 2


def _flat(value: Mapping[str, Any], path: str) -> Iterable[tuple[str, Any]]:
    for key, one in value.items():
        at = f"{path}{key}"
        if isinstance(one, Mapping):
            yield from _flat(one, f"{at}.")
        else:
            yield at, one


def _short_path(path: str) -> str:
    if path in _WORDS:
        return _WORDS[path]
    for prefix, words in _PREFIXES.items():
        if path.startswith(prefix):
            return words + path.removeprefix(prefix).removesuffix(".value")
    return path


def _fact_text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return ", ".join(map(_fact_text, value)) if isinstance(value, list | tuple) else str(value)


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
    """What metadata say against the samples of a recording: lost and late ones, saturation, warnings, rows left out.

    Of the file of another program also what was mended in its clock, and that its runs stand one after another.
    """
    sentences = [(text, "hardware") for text in _lines(_table(meta.get("hardware")))]
    timing = _table(meta.get("deadlines"))
    if behind := _count(timing, "behind"):
        sentences.append(
            (f"{behind:,} of {_count(timing, 'samples'):,} samples began more than a period late", "deadlines")
        )
    sentences += [
        (f"{name} {_saturated(_table(one))}", name) for name, one in _table(meta.get("saturation")).items() if one
    ]
    source = _table(meta.get("source"))
    for said in (source.get("left_out"), source.get("changed")):
        sentences += [(str(text).rstrip("."), "source") for text in said] if isinstance(said, list | tuple) else []
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


def _count(table: Mapping[str, Any], name: str) -> int:
    value = table.get(name)
    return int(value) if _number(value) and value == value else 0


def _number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
