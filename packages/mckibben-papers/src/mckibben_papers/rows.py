"""Printed numbers, and the criteria of their reproduction."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Iterable, Sequence
from decimal import ROUND_HALF_UP, Decimal
from importlib import resources
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from mckibben.documents import parse_toml
from mckibben.errors import InputError
from mckibben.quantities import from_si

if TYPE_CHECKING:
    from .inference import RowPrediction

Value = float | tuple[float, float]
BASES = {  # what went into a computed value -> verdict of a row that agrees
    "prediction": "predicted",
    "other rows": "predicted",
    "words": "not printed",
    "arithmetic": "arithmetic",
}


class PrintedRow(NamedTuple):
    """A printed number: what it is, its value and unit in print, and the tolerance of agreement.

    Attributes:
        id: identifier.
        part: part of the paper.
        what: description.
        paper: printed value, or the two ends of an interval.
        unit: unit of the value.
        expect: what agreement means, as the head of ``rows.toml`` says.
        tolerance: relative, for ``near``.
        basis: what went into our value, a key of `BASES`.
        inputs: what that is, in words.
        note: shown beside it.
        reason: why the tolerance is wider than the print, or where an interval comes from.
        decimals: in print, where TOML drops a zero at the end.
        repeats: identifier of the row whose number this one tells again, in another place or unit; it is not counted.
        printed: whether the papers print a value; where they have words or a formula only, the row is not counted either.
    """

    id: str
    part: str
    what: str
    paper: Value
    unit: str
    expect: str
    tolerance: float = 0.0
    basis: str = "arithmetic"
    inputs: str = ""
    note: str = ""
    reason: str = ""
    decimals: int | None = None
    repeats: str = ""
    printed: bool = True

    @property
    def heading(self) -> str:
        """The description with a capital; a symbol such as dF/dL keeps its letters."""
        first = self.what.split(" ", 1)[0]
        return self.what[:1].upper() + self.what[1:] if first.isalpha() and first.islower() else self.what

    @property
    def calibrated(self) -> bool:
        """Whether inputs of this row were inferred from others that are printed."""
        return self.basis == "other rows"


class RowOutcome(NamedTuple):
    """A row with our value, in the row's unit; ``ok`` is None without a verdict.

    `prediction` is what all other rows say of it, where inputs were inferred from them: ours is then its value.
    """

    row: PrintedRow
    ours: float | None
    ok: bool | None
    note: str
    prediction: RowPrediction | None = None

    @property
    def verdict(self) -> str:
        """Verdict in one or two words."""
        if self.ours is None:
            return "to come"
        if not self.row.printed:
            return "not printed"
        if self.ok is False:
            return "falls short"
        if self.row.repeats:
            return "told again"
        if self.row.expect in ("open", "synthetic"):
            return self.row.expect
        if self.prediction is not None and self.ok is None:
            return "open"
        if self.row.expect == "erratum":
            return "misprint"
        return BASES[self.row.basis]


class ComputedValue(NamedTuple):
    """A number with remarks, which a function of a row may return instead of a plain number."""

    value: float
    note: str = ""


class Computation(NamedTuple):
    """How a row is computed.

    Attributes:
        compute: gives the value.
        si_unit: si unit of the value.
        note: remark.
        recordings: whether it is computed of recordings of the simulated test machine, which take their time to make.
    """

    compute: Callable[[], float | ComputedValue]
    si_unit: str
    note: str
    recordings: bool


AnyCompute = TypeVar("AnyCompute", bound=Callable[[], float | ComputedValue])
_WAYS: dict[str, Computation] = {}


def reproduces(
    identifier: str, si_unit: str, note: str = "", *, recordings: bool = False
) -> Callable[[AnyCompute], AnyCompute]:
    """Register the function that computes a row; it returns an SI value whose unit is given here."""

    def register(compute: AnyCompute) -> AnyCompute:
        if identifier in _WAYS:
            raise ValueError(f"two functions reproduce {identifier}")
        _WAYS[identifier] = Computation(compute, si_unit, note, recordings)
        return compute

    return register


def _way(row: PrintedRow) -> Computation | None:
    """How a row is computed: what computes is imported with the first question, and registers itself."""
    for module in ("computed", "measured", "part4"):
        importlib.import_module(f".{module}", __package__)
    return _WAYS.get(row.id)


def is_inferred(row: PrintedRow) -> bool:
    """Whether a row is predicted from all others: what has no printed value, repeats one or is a misprint is not."""
    return row.basis == "other rows" and row.printed and not row.repeats and row.expect in ("printed", "near", "range")


@functools.cache
def all_rows() -> tuple[PrintedRow, ...]:
    """All printed numbers, in the order of the papers."""
    text = (resources.files(__package__) / "rows.toml").read_text(encoding="utf-8")
    return tuple(_row(entry) for entry in parse_toml(text, where="rows.toml")["row"])


@functools.cache
def rows_by_name() -> dict[str, PrintedRow]:
    """All printed numbers by identifier, which pages of mckibben show beside theirs."""
    return {row.id: row for row in all_rows()}


def printed(identifier: str) -> float:
    """Value that the paper prints for a row, in the row's unit."""
    value = next(row.paper for row in all_rows() if row.id == identifier)
    assert isinstance(value, float)
    return value


def select(part: str | None = None, identifiers: list[str] | None = None) -> list[PrintedRow]:
    """Rows of one part (``I`` to ``IV``, ``discussion``) or whose identifier begins with one of the given texts."""
    rows = list(all_rows())
    parts = list(dict.fromkeys(r.part for r in rows))
    if part is not None:
        if part not in parts:
            raise InputError("part", part, known=parts)
        rows = [r for r in rows if r.part == part]
    for word in identifiers or []:
        if not word or not any(r.id.startswith(word) for r in rows):
            raise InputError("row", word, "no row begins with that; `mckibben reproduce --json` lists them")
    if identifiers:
        rows = [r for r in rows if any(r.id.startswith(word) for word in identifiers)]
    return rows


def computed_row(row: PrintedRow) -> RowOutcome:
    """Compute one row with the numbers of specimen and rig, which the figures draw."""
    way = _way(row)
    if way is None:
        return RowOutcome(row, None, None, said_of(row))
    computed = way.compute()
    value, remark = computed if isinstance(computed, ComputedValue) else (computed, "")
    ours = in_row_unit(row.id, value)
    return RowOutcome(row, ours, judge(row, ours), said_of(row, way.note, remark))


def reproduce_row(row: PrintedRow) -> RowOutcome:
    """Compute one row and its verdict; what has inputs that are not printed is predicted from all other rows."""
    computed = computed_row(row)
    if computed.ours is None or not is_inferred(row):
        return computed
    from .inference import predict
    from .networks import network

    prediction = predict(network(row.id), row.id)
    at = f"{computed.ours:.4g}{'' if row.unit == '-' else f' {row.unit}'} with the numbers of specimen and rig"
    note = "; ".join(filter(None, (prediction.words(row), at, computed.note)))
    agreed = prediction.told and judge(row, prediction.value)
    return RowOutcome(row, prediction.value, agreed or None, note, prediction)


def in_row_unit(name: str, value: float) -> float:
    """Value [SI] of a row in its unit; of any other name the value itself."""
    row = rows_by_name().get(name)
    way = None if row is None else _way(row)
    if row is None or way is None:
        return value
    plain = row.unit.replace("(L0 cm2)", "cm2").replace("/L0", "").replace(" L0", "").replace("L0", "1")
    plain = plain.replace("cm2", "cm^2").replace("cm3", "cm^3").replace("s2", "s^2").replace(" ", "*")
    return from_si(value, way.si_unit, plain)


def said_of(row: PrintedRow, *computed: str) -> str:
    """Remarks on a row: its note, what computing it adds, why its tolerance is wide, and what goes into it."""
    again = f"the number of {row.repeats}, told again" if row.repeats else ""
    allowed = "interval" if row.expect == "range" else f"tolerance {100.0 * row.tolerance:g} %"
    inputs = row.inputs
    if inputs and row.expect != "synthetic":
        inputs = f"{'inferred' if row.basis in ('other rows', 'words') else BASES[row.basis]}: {inputs}"
    return "; ".join(filter(None, (again, row.note, *computed, row.reason and f"{allowed}: {row.reason}", inputs)))


def needs_recording(row: PrintedRow) -> bool:
    """Whether a row needs recordings of the simulated test machine, which take time to make."""
    way = _way(row)
    return way is not None and way.recordings


def judge(row: PrintedRow, ours: float) -> bool | None:
    """Whether our value, in the row's unit, is what the row expects; None if nothing is expected."""
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
    """Whether a value rounds to a printed one with a number of decimals."""
    return Decimal(repr(ours)).quantize(Decimal(1).scaleb(-decimals), ROUND_HALF_UP) == Decimal(repr(printed))


def decimals_of(row: PrintedRow) -> int:
    """Number of decimals in print."""
    if row.decimals is not None:
        return row.decimals
    exponent = Decimal(repr(row.paper).removesuffix(".0")).as_tuple().exponent  # a TOML integer has become a float
    assert isinstance(exponent, int)
    return -exponent


def agrees(row: PrintedRow, ours: float) -> bool:
    """Whether our value is what the row expects; an open row expects nothing."""
    return judge(row, ours) is not False


def accepted_band(row: PrintedRow) -> tuple[float, float] | None:
    """Middle and half-width of what counts as agreement [the row's unit]; None if nothing does."""
    if row.expect == "open":
        return None
    if isinstance(row.paper, tuple):
        low, high = row.paper
        return 0.5 * (low + high), 0.5 * (high - low)
    if row.expect == "near":
        return row.paper, row.tolerance * abs(row.paper)
    if row.expect == "printed":
        return row.paper, 0.5 * 10.0 ** -decimals_of(row)
    return None


def _row(entry: dict[str, Any]) -> PrintedRow:
    paper = entry["paper"]
    value = tuple(float(v) for v in paper) if isinstance(paper, list) else float(paper)
    return PrintedRow(**(entry | {"paper": value}))


class VerdictKind(NamedTuple):
    """A kind of verdict.

    Attributes:
        key: its name in files and in the web interface.
        verdict: verdict of one row.
        counted: what follows its number in the headline where that is one, and where it is more.
        meaning: what it says, a phrase.
    """

    key: str
    verdict: str
    counted: tuple[str, str]
    meaning: str


KINDS = {
    kind.verdict: kind
    for kind in (
        VerdictKind(
            "predicted",
            "predicted",
            ("is predicted", "are predicted"),
            "agrees; what is not printed of its inputs was inferred from other rows, without it",
        ),
        VerdictKind(
            "arithmetic",
            "arithmetic",
            ("is arithmetic", "are arithmetic"),
            "agrees; only printed coefficients and the paper's own equations went in",
        ),
        VerdictKind(
            "synthetic",
            "synthetic",
            ("is synthetic", "are synthetic"),
            "no measured curve is printed; ours is computed against the distributed reference",
        ),
        VerdictKind(
            "open",
            "open",
            ("is open", "are open"),
            "differs, or no other row tells it: the input that would have to change is named, and nothing is tuned",
        ),
        VerdictKind(
            "misprint",
            "misprint",
            ("is a misprint", "are misprints"),
            "the printed value is wrong; ours is the corrected one",
        ),
        VerdictKind("short", "falls short", ("falls short", "fall short"), "ours does not agree"),
        VerdictKind(
            "repeats",
            "told again",
            ("row tells one of them again", "rows tell one of them again"),
            "the number of another row, in another place or unit; not counted",
        ),
        VerdictKind(
            "unprinted",
            "not printed",
            ("row has no printed value", "rows have no printed value"),
            "the papers have words or a formula and no value; not counted, and held against what we take them to mean",
        ),
        VerdictKind("to come", "to come", ("is to come", "are to come"), "not computed yet"),
    )
}
DIFFERING = (  # keys whose differences the headline shows
    "predicted",
    "arithmetic",
    "synthetic",
    "open",
    "short",
)


class Tally(NamedTuple):
    """Number of rows of a kind, and the range of their differences, where defined.

    Attributes:
        kind: kind of verdict.
        rows: rows of that kind.
        lowest: relative difference from the print; None if no row has one, or none is of interest.
        highest: the same.
    """

    kind: VerdictKind
    rows: int
    lowest: float | None
    highest: float | None


def kind_of(outcome: RowOutcome) -> VerdictKind:
    """Kind of a row's verdict."""
    return KINDS[outcome.verdict]


def relative_difference(row: PrintedRow, ours: float | None) -> float | None:
    """Difference of our value from the print, relative to the print, or from the nearer end of an interval; 0 within it.

    None if nothing is computed or the print is zero.
    """
    if ours is None:
        return None
    paper = row.paper
    if isinstance(paper, tuple):
        if paper[0] <= ours <= paper[1]:
            return 0.0
        paper = min(paper, key=lambda end: abs(ours - end))
    return (ours - paper) / abs(paper) if paper else None


def is_prediction(row: PrintedRow) -> bool:
    """Whether a row predicts a printed number: from others of its experiment, or from none."""
    return is_inferred(row) or (
        row.basis == "prediction" and row.printed and not row.repeats and row.expect == "printed"
    )


def relative_tolerance(row: PrintedRow) -> float | None:
    """Half of what counts as agreement over its middle; None if nothing does."""
    allowed = accepted_band(row)
    return None if allowed is None or not allowed[0] else abs(allowed[1] / allowed[0])


def tallies(outcomes: Iterable[RowOutcome]) -> list[Tally]:
    """Kinds that occur, in order."""
    listed = list(outcomes)
    counts = []
    for kind in KINDS.values():
        rows = [o for o in listed if kind_of(o) is kind]
        differences = [relative_difference(o.row, o.ours) for o in rows] if kind.key in DIFFERING else []
        known = [d for d in differences if d is not None]
        if rows:
            counts.append(Tally(kind, len(rows), min(known, default=None), max(known, default=None)))
    return counts


def headline(outcomes: Sequence[RowOutcome]) -> str:
    """One sentence with the number of rows of each kind, and their differences from the print."""
    beside = [t for t in tallies(outcomes) if t.kind.key in ("repeats", "unprinted")]
    counted = [t for t in tallies(outcomes) if t not in beside]
    parts = [f"{t.rows} {t.kind.counted[t.rows != 1]}{_between(t)}" for t in counted]
    untold = sum(o.prediction is not None and not o.prediction.told for o in outcomes)
    if untold:
        at = [t.kind.key for t in counted].index("open")
        parts[at] += f" of which the others do not tell {untold}"
    if not any(t.kind.key == "short" for t in counted) and any(t.kind.key != "to come" for t in counted):
        parts.append("none falls short")
    count = sum(t.rows for t in counted)
    numbers = "1 printed number" if count == 1 else f"{count} printed numbers"
    words = f"{numbers}: {', '.join(parts)}" if parts else "No printed number was asked for"
    more = " and ".join(f"{t.rows} {t.kind.counted[t.rows != 1]}" for t in beside)
    outside = sum(o.ok is False for o in outcomes if kind_of(o).key == "unprinted")
    more += (
        f", of which {outside} {'lie' if outside > 1 else 'lies'} outside what we take its words to mean"
        if outside
        else ""
    )
    return f"{words}; beside them {more}." if more else f"{words}."


def _between(tally: Tally) -> str:
    """The differences of a kind in per cent, in brackets; nothing if there are none."""
    if tally.lowest is None or tally.highest is None:
        return ""
    ends = dict.fromkeys(percent(d) for d in (tally.lowest, tally.highest))
    return f" ({' to '.join(ends)} %)"


def percent(share: float, digits: int = 0) -> str:
    """Format a relative difference in per cent, with its sign and without the per cent sign."""
    words = f"{100.0 * share:+.{digits}f}"
    return "0" if float(words) == 0.0 else words.replace("-", "\N{MINUS SIGN}")
