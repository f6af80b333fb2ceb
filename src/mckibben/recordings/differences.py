"""By what recordings differ: muscle, rig, protocol and parameters, read from their metadata."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..documents import JsonValue

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
        facts_by_name.setdefault(path if everything else _short(path), _text(value))
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


def _short(path: str) -> str:
    if path in _WORDS:
        return _WORDS[path]
    for prefix, words in _PREFIXES.items():
        if path.startswith(prefix):
            return words + path.removeprefix(prefix).removesuffix(".value")
    return path


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return ", ".join(map(_text, value)) if isinstance(value, list | tuple) else str(value)
