"""The printed numbers, and what it means to reproduce one of them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from decimal import ROUND_HALF_UP, Decimal
from importlib import resources
from typing import Any, NamedTuple, TypeVar

from ..documents import parse_toml
from ..errors import InputError
from ..quantities import from_si

Value = float | tuple[float, float]


class Row(NamedTuple):
    """One printed number: what it is, its value and unit in print, and what agreement with it means.

    Attributes:
        id: its name.
        part: of the paper.
        what: it is.
        paper: its value in print, or the two ends of an interval.
        unit: of the value.
        expect: what agreement means, as the head of ``rows.toml`` says.
        tolerance: relative, for ``near``.
        calibrated: an input was inferred from this row or its companion.
        note: shown beside it.
        reason: why the tolerance is as wide as it is; rows must have it above a tenth.
        decimals: in print, where TOML drops a zero at the end.
    """

    id: str
    part: str
    what: str
    paper: Value
    unit: str
    expect: str
    tolerance: float = 0.0
    calibrated: bool = False
    note: str = ""
    reason: str = ""
    decimals: int | None = None


class Outcome(NamedTuple):
    """A row with ours beside it, in the row's unit; ``ok`` is None while no verdict is possible."""

    row: Row
    ours: float | None
    ok: bool | None
    note: str

    @property
    def verdict(self) -> str:
        """The verdict in one word or two."""
        if self.ours is None:
            return "to come"
        if self.row.expect in ("open", "synthetic"):
            return self.row.expect
        if not self.ok:
            return "falls short"
        if self.row.expect == "erratum":
            return "misprint"
        return "holds, calibrated" if self.row.calibrated else "holds"


class Found(NamedTuple):
    """What a function that computes a row may return in place of the number: the number with what it found beside."""

    value: float
    note: str = ""


class Way(NamedTuple):
    """How a row is computed.

    Attributes:
        compute: gives the value.
        si_unit: of the value.
        note: what is said to it.
        recordings: whether it is computed of recordings of the simulated test machine, which take their time to make.
    """

    compute: Callable[[], float | Found]
    si_unit: str
    note: str
    recordings: bool


AnyCompute = TypeVar("AnyCompute", bound=Callable[[], float | Found])
_WAYS: dict[str, Way] = {}


def reproduces(
    identifier: str, si_unit: str, note: str = "", *, recordings: bool = False
) -> Callable[[AnyCompute], AnyCompute]:
    """Register the function that computes a row; it returns an SI value whose unit is given here."""

    def register(compute: AnyCompute) -> AnyCompute:
        if identifier in _WAYS:
            raise ValueError(f"two functions reproduce {identifier}")
        _WAYS[identifier] = Way(compute, si_unit, note, recordings)
        return compute

    return register


@functools.cache
def all_rows() -> tuple[Row, ...]:
    """Every printed number, in the order of the papers."""
    text = (resources.files(__package__) / "rows.toml").read_text(encoding="utf-8")
    return tuple(_row(entry) for entry in parse_toml(text, where="rows.toml")["row"])


def select(part: str | None = None, identifiers: list[str] | None = None) -> list[Row]:
    """Rows of one part (``I`` to ``IV``, ``discussion``) or whose identifier begins with one of the given words."""
    rows = list(all_rows())
    parts = list(dict.fromkeys(r.part for r in rows))
    if part is not None:
        if part not in parts:
            raise InputError("part", part, f"known are {', '.join(parts)}")
        rows = [r for r in rows if r.part == part]
    for word in identifiers or []:
        if not word or not any(r.id.startswith(word) for r in rows):
            raise InputError("row", word, "no row begins with that; `mckibben reproduce --json` lists them")
    if identifiers:
        rows = [r for r in rows if any(r.id.startswith(word) for word in identifiers)]
    return rows


def reproduce_row(row: Row) -> Outcome:
    """Compute one row and judge it."""
    if row.id not in _WAYS:
        return Outcome(row, None, None, said_of(row))
    way = _WAYS[row.id]
    computed = way.compute()
    value, found = computed if isinstance(computed, Found) else (computed, "")
    ours = from_si(value, way.si_unit, _plain_unit(row.unit))
    note = "; ".join(filter(None, (row.note, way.note, found, _reasoned(row))))
    return Outcome(row, ours, judge(row, ours), note)


def said_of(row: Row) -> str:
    """What is said beside a row before it is computed: its note, and why its tolerance is wide."""
    return "; ".join(filter(None, (row.note, _reasoned(row))))


def _reasoned(row: Row) -> str:
    if not row.reason:
        return ""
    return (
        f"interval: {row.reason}" if row.expect == "range" else f"tolerance {100.0 * row.tolerance:g} %: {row.reason}"
    )


def needs_recording(row: Row) -> bool:
    """Whether a row is computed of recordings of the simulated test machine, which take their time to make."""
    return row.id in _WAYS and _WAYS[row.id].recordings


def judge(row: Row, ours: float) -> bool | None:
    """Whether our value, in the row's unit, is what the row expects; None where nothing is expected."""
    if row.expect in ("open", "synthetic"):
        return None
    if row.expect == "range":
        low, high = row.paper if isinstance(row.paper, tuple) else (row.paper, row.paper)
        return low <= ours <= high
    assert isinstance(row.paper, float)
    if row.expect == "printed":
        return rounds_to(ours, row.paper, decimals_of(row))
    if row.expect == "near":
        return abs(ours - row.paper) <= row.tolerance * abs(row.paper)
    return abs(ours - row.paper) > 0.0  # erratum: the printed value is wrong, and ours must differ


def rounds_to(ours: float, printed: float, decimals: int) -> bool:
    """Whether a value rounds to a printed one at so many decimals."""
    return Decimal(repr(ours)).quantize(Decimal(1).scaleb(-decimals), ROUND_HALF_UP) == Decimal(repr(printed))


def decimals_of(row: Row) -> int:
    """Decimals of a row's value in print."""
    if row.decimals is not None:
        return row.decimals
    exponent = Decimal(repr(row.paper).removesuffix(".0")).as_tuple().exponent  # a TOML integer has become a float
    assert isinstance(exponent, int)
    return -exponent


def accepted_band(row: Row) -> tuple[float, float] | None:
    """Middle and half-width of what counts as agreement [the row's unit]; None where nothing does."""
    if isinstance(row.paper, tuple):
        low, high = row.paper
        return 0.5 * (low + high), 0.5 * (high - low)
    if row.expect == "near":
        return row.paper, row.tolerance * abs(row.paper)
    if row.expect == "printed":
        return row.paper, 0.5 * 10.0 ** -decimals_of(row)
    return None


def _row(entry: dict[str, Any]) -> Row:
    paper = entry["paper"]
    value = tuple(float(v) for v in paper) if isinstance(paper, list) else float(paper)
    return Row(**(entry | {"paper": value}))


def _plain_unit(unit: str) -> str:
    """The unit of a row without the muscle's own length unit L0, which the computing function has divided out."""
    plain = unit.replace("(L0 cm2)", "cm2").replace("/L0", "").replace(" L0", "").replace("L0", "1")
    return plain.replace("cm2", "cm^2").replace("cm3", "cm^3").replace("s2", "s^2").replace(" ", "*")
