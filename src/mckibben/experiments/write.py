"""A protocol as tables of words: the way back from `read.build_protocol`."""

from __future__ import annotations

from typing import Any

from .protocol import SCHEMA, Choice, Parameter, Protocol


def document(protocol: Protocol) -> dict[str, Any]:
    """All that a file needs to give the same protocol again; nothing that is as it would be anyway."""
    out: dict[str, Any] = {"schema": SCHEMA, "name": protocol.name, "title": protocol.title}
    for key in ("source", "note", "order", "seed", "repeat"):
        if getattr(protocol, key) != Protocol.__dataclass_fields__[key].default:
            out[key] = getattr(protocol, key)
    if protocol.needs:
        out["needs"] = list(protocol.needs)
    out["sample_rate"] = f"{protocol.sample_rate!r} Hz"
    if protocol.choices:
        out["choices"] = {c.name: _choice(c) for c in protocol.choices}
    if protocol.parameters:
        out["parameters"] = {p.name: _parameter(p) for p in protocol.parameters}
    for key in ("first", "steps", "last"):
        parts = getattr(protocol, key)
        if parts:
            out[key] = [part.plain() for part in parts]
    return out


def _parameter(p: Parameter) -> dict[str, Any]:
    out: dict[str, Any] = {"unit": p.unit}
    if p.values:
        out["value"] = _few(p.values)
    if p.about:
        out["about"] = p.about
    if p.bounds:
        out["low"], out["high"] = p.bounds
    if p.inferred:
        out["inferred"] = list(p.inferred)
    if p.note:
        out["note"] = p.note
    return out


def _choice(c: Choice) -> dict[str, Any]:
    out: dict[str, Any] = {"value": _few(c.values)}
    if c.about:
        out["about"] = c.about
    if c.inferred:
        out["inferred"] = list(c.inferred)
    if c.note:
        out["note"] = c.note
    out["options"] = {option: dict(sets) for option, sets in c.options}
    return out


def _few(values: tuple[Any, ...]) -> Any:
    return values[0] if len(values) == 1 else list(values)
