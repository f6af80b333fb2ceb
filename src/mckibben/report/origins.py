"""Origins of the parameters of a recorded run: printed in a source, a rig's file, inferred, or a default.

A recording keeps the resolved parameters by the paths of the assembled machine, and the names of what was inferred by the
paths of the files of specimen and rig. This module brings both together.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from ..assembly.build import INFERRED
from ..documents import JsonValue
from ..errors import InputError
from ..specimens import Specimen, SpecimenNumber, specimen
from .blocks import amount, flat, is_number, mapping, minus, significant, tied, unit_text

# Values that no file states and the assembly infers, by what follows the unit's name in a path.
_USUAL = {
    name: INFERRED[key].value
    for name, key in {
        "end_mass": "end_mass",
        "viscosity": "viscosity",
        "stop_damping": "stop_damping",
        "stop_travel": "stop_travel",
        "tendon.stiffness": "tendon_stiffness",
        "tendon.toe_length": "tendon_toe",
        "tendon.loss": "tendon_loss",
    }.items()
}
SAME = 1e-6  # relative; a value that differs by more from its file's was set for the run


class ResolvedParameters(NamedTuple):
    """A parameter of the run: its dotted path, value and unit, origin as text, and whether it was inferred."""

    path: str
    value: str
    origin: str
    inferred: bool


class InferredInput(NamedTuple):
    """A value that its file marks as inferred: its name, the file, the value as text, and the reason."""

    name: str
    file: str
    value: str
    note: str


def known_specimen(meta: Mapping[str, JsonValue]) -> Specimen | None:
    """Specimen that a recording names, if this installation knows it."""
    try:
        return specimen(str(meta["specimen"]))
    except (KeyError, InputError):
        return None


def parameters(meta: Mapping[str, JsonValue]) -> list[ResolvedParameters]:
    """All resolved parameters of a recording, in order."""
    spec, resolved = known_specimen(meta), []
    for path, entry in mapping(meta.get("parameters")).items():
        value, unit = (mapping(entry).get(k) for k in ("value", "unit"))
        names = [*_names(str(path), meta)]
        assumed = mapping(mapping(meta.get("assumptions")).get(str(path)))
        known = f"assumed: {assumed['note']}" if assumed.get("value") == value and "note" in assumed else None
        why, inferred = (known, True) if known else _origin(names, value, str(unit), meta, spec)
        resolved.append(ResolvedParameters(str(path), _value(value, str(unit)), why, inferred))
    return resolved


def inferred_inputs(meta: Mapping[str, JsonValue]) -> list[InferredInput]:
    """Inferred values of the files of rig and specimen, as far as this run used them."""
    spec, rig = known_specimen(meta), mapping(meta.get("rig_document"))
    listed, inputs = meta.get("inferred"), []
    layout, used = str(meta.get("plumbing", "")), {"laws": _laws(meta, spec), "friction": _frictions(spec)}
    for name in (str(n) for n in (listed if isinstance(listed, list) else [])):
        room, _, rest = name.partition(".")
        if room == "plumbing" and layout and not rest.startswith(f"{layout}."):
            continue
        if room in used and used[room] and rest.partition(".")[0] not in used[room]:
            continue
        stated, printed = _walk(rig, name), _stated(spec, name)
        if stated is None and printed is not None:
            note = printed.note
            if printed.range is not None:
                ends = " to ".join(significant(v) for v in printed.range)
                note = "; ".join(filter(None, (note, f"plausible {tied(ends, printed.unit)}")))
            values = printed.value if isinstance(printed.value, list) else [printed.value]
            said = tied(", ".join(significant(float(v)) for v in values), printed.unit)
            inputs.append(InferredInput(name, f"specimen {meta.get('specimen')}", said, note))
        elif stated is not None:
            said = "; ".join(minus(f"{n} {text}".strip()) for n, text in flat(stated))
            inputs.append(InferredInput(name, f"rig {meta.get('rig')}", said, ""))
        else:
            inputs.append(InferredInput(name, "", "", ""))
    return inputs


def _names(path: str, meta: Mapping[str, JsonValue]) -> Iterator[str]:
    head, _, rest = path.partition(".")
    layout = f"plumbing.{meta.get('plumbing', '')}"
    if head == "circuit":
        kind, _, rest = rest.partition(".")
        if kind == "elements":
            yield f"{layout}.{rest}"
        elif kind == "nodes":
            last = {"volume": "port_volume", "dead_volume": "muscle_accumulator"}.get(rest.rpartition(".")[2])
            yield f"{layout}.{last}" if last else f"{layout}.supply_pressure" if rest == "supply.pressure_abs" else rest
    elif head == "load":
        yield rest
    elif head == "units":
        kind, _, last = rest.partition(".")[2].partition(".")
        if kind == "law":
            yield from (f"laws.{law}.{last}" for law in _laws(meta, known_specimen(meta)))
        elif kind == "friction":
            for model in _frictions(known_specimen(meta)):
                yield f"friction.{model}.{last.rpartition('.')[2]}"
                yield f"friction.{model}"
        else:
            yield f"{kind}.{last}".removesuffix(".")
    else:
        yield path


def _origin(
    names: list[str], value: Any, unit: str, meta: Mapping[str, JsonValue], spec: Specimen | None
) -> tuple[str, bool]:
    listed = meta.get("inferred")
    guessed = {str(n) for n in listed} if isinstance(listed, list) else set()
    if any(_USUAL.get(name) == value for name in names):
        return "inferred: as such parts usually are", True
    for name in names:
        printed = _stated(spec, name)
        if printed is not None and _differs(printed, value, unit):
            return "set for this run", False
        above = [g for g in guessed if g == name or name.startswith(f"{g}.")]
        if above or any(g.startswith(f"{name}.") for g in guessed):
            return f"inferred: {max(above, key=len) if above else name}", True
        if printed is not None:
            return f"specimen {meta.get('specimen')}, {printed.source or spec.source()}" if spec else "", False
        if _walk(mapping(meta.get("rig_document")), name) is not None:
            return f"rig {meta.get('rig')}", False
    return "default or derived", False


def _differs(printed: SpecimenNumber, value: Any, unit: str) -> bool:
    if not is_number(value) or isinstance(printed.value, list):
        return False
    try:
        stated = printed.si(unit, field="value")
    except InputError:
        return False
    assert isinstance(stated, float)
    differs: bool = abs(value - stated) > SAME * max(abs(value), abs(stated))
    return differs


def _laws(meta: Mapping[str, JsonValue], spec: Specimen | None) -> list[str]:
    stated = mapping(mapping(meta.get("energy")).get("laws")).values()
    return [str(law) for law in stated] or ([spec.law] if spec else [])


def _frictions(spec: Specimen | None) -> list[str]:
    """Names of the friction that a run uses, see `assembly.build.unit_from_specimen`."""
    stated = [*spec.friction] if spec else []
    return ["maxwell_slip"] if "maxwell_slip" in stated else stated[:1]


def _stated(spec: Specimen | None, name: str) -> SpecimenNumber | None:
    group: Any = spec
    for word in name.split("."):
        group = group.get(word) if isinstance(group, dict) else getattr(group, word, None)
    return group if isinstance(group, SpecimenNumber) else None


def _walk(table: Any, name: str) -> Any:
    for word in name.split("."):
        table = mapping(table).get(word)
    return table


def _value(value: Any, unit: str) -> str:
    if is_number(value):
        try:
            return amount(float(value), unit)
        except InputError:
            return tied(significant(float(value)), unit)
    numbers = [float(v) for v in value] if isinstance(value, list) and all(map(is_number, value)) else []
    if not numbers:
        return f"{value} {unit_text(unit)}".strip()
    low, high = min(numbers), max(numbers)
    ends = amount(low, unit) if low == high else f"{amount(low, unit)} to {amount(high, unit)}"
    return f"{ends}, {len(numbers)} values"
