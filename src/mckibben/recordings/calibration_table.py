"""The plain table of a calibration, as a recording's meta has it, read and checked: every complaint by its dotted path."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..errors import InputError
from ..quantities import with_unit
from .calibration import LONGEST, SCHEMA, TERMS, Calibration, Correction, Origin, Term, moment
from .units import is_si


def read_plain(table: Any, *, where: str = "calibration") -> Calibration:
    """A calibration from a table in SI, as `Calibration.plain` makes it and a recording's meta has it.

    Raises:
        InputError: names the dotted path, the value and what is allowed; a newer schema is refused.
    """
    top = _Table(table, "", where)
    schema = top.values.get("schema", "missing")
    if isinstance(schema, bool) or not isinstance(schema, int) or schema < 1:
        raise top.fail("schema", schema, f"this version reads schema {SCHEMA}")
    if schema > SCHEMA:
        raise top.fail("schema", schema, f"a newer version of mckibben wrote it; this one reads schema {SCHEMA}")
    top.only("schema", "rig", "created", "channels")
    channels = top.below("channels")
    corrections = {name: _read_correction(channels.below(name)) for name in channels.values}
    return Calibration(rig=top.text("rig"), created=top.date("created"), corrections=corrections)


def _read_correction(at: _Table) -> Correction:
    at.only("unit", "sensor", "correlation", "linearity", *TERMS)
    unit = at.text("unit")
    if not is_si(unit):
        raise at.fail("unit", unit, "allowed is an SI unit such as 'Pa' or 'N'")
    terms = {name: _read_term(at.below(name), name, unit) for name in TERMS if name in at.values}
    return Correction(
        unit=unit, terms=terms, sensor=at.text("sensor", ""), correlation=at.number("correlation", -1.0, 1.0, "1", 0.0),
        linearity=at.number("linearity", 0.0, 1e9, unit, math.nan),
    )  # fmt: skip


def _read_term(at: _Table, name: str, unit: str) -> Term:
    at.only("value", "uncertainty", "degrees", *Origin.__dataclass_fields__)
    _, low, high = TERMS[name]
    own = {"gain": "1", "zero": unit, "skew": "s"}[name]
    origin = None
    if "method" in at.values:
        points = at.number("points", 0.0, 1e9, "1", 0.0)
        origin = Origin(
            method=at.text("method"), date=at.date("date"), reference=at.text("reference", ""),
            reference_uncertainty=at.number("reference_uncertainty", 0.0, 1e9, unit, 0.0),
            scale_uncertainty=at.number("scale_uncertainty", 0.0, 1.0, "1", 0.0),
            valid_for=at.number("valid_for", 1.0, LONGEST, "s", math.inf, endless=True), points=int(points),
        )  # fmt: skip
    return Term(
        at.number("value", low, high, own), at.number("uncertainty", 0.0, 1e9, own, math.nan),
        at.number("degrees", 0.5, 1e12, "1", math.inf, endless=True), origin,
    )  # fmt: skip


class _Table:
    """A table with its dotted path and its place, for complaints."""

    def __init__(self, values: Any, path: str, where: str) -> None:
        if not isinstance(values, Mapping):
            raise InputError(path or "calibration", type(values).__name__, "allowed is a table", where=where)
        self.values, self.path, self.where = values, path, where

    def fail(self, key: str, value: Any, allowed: str) -> InputError:
        shown = value if isinstance(value, str | int | float) else type(value).__name__
        return InputError(f"{self.path}.{key}" if self.path else key, shown, allowed, where=self.where)

    def only(self, *known: str) -> None:
        for key in self.values:
            if key not in known:
                raise self.fail(key, "unknown", f"known are {', '.join(known)}")

    def below(self, key: str) -> _Table:
        return _Table(self.values.get(key, {}), f"{self.path}.{key}" if self.path else key, self.where)

    def text(self, key: str, default: str | None = None) -> str:
        value = self.values.get(key, default)
        if not isinstance(value, str) or not value.isprintable():
            raise self.fail(key, "missing" if value is None else value, "allowed is one line of text")
        return value

    def date(self, key: str) -> str:
        value = self.text(key)
        try:
            moment(value)
        except InputError as error:
            raise self.fail(key, value, error.allowed) from None
        return value

    def number(
        self, key: str, low: float, high: float, unit: str, default: float | None = None, *, endless: bool = False
    ) -> float:
        value = self.values.get(key, default)
        if value is default and default is not None:
            return default
        if value is None or isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fail(key, "missing" if value is None else value, "allowed is a number")
        if not (low <= value <= high or (endless and value == math.inf)):
            raise self.fail(key, value, f"allowed is {with_unit(low, unit)} to {with_unit(high, unit)}")
        return float(value)
