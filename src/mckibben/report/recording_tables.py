"""What a recording says beside its channels, as blocks of a report; what it does not say gives no block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ..analysis.segments import steps_of, varied
from ..errors import InputError
from ..experiments.waveforms import time_words
from ..quantities import from_si
from ..recordings.calibration import Calibration, CorrectionTerm, read_plain
from ..recordings.recording import Recording
from .document import Block, Cell, Column, Heading, KeyValues, Paragraph, Row, Span, Table
from .words import amount, flat, is_number, mapping, minus, person_unit, significant, tied, unit_text

MOST_STEPS, MOST_EVENTS = 60, 60  # rows that are shown
NOTHING = 1e-12  # share of a ledger's throughput below which a part is nothing but rounding
LEDGERS = {
    "exergy": "Exergy: work that could be had against the room",
    "energy": "Energy, by the first law",
    "load": "What the muscle did to the load",
}
_SIDES = (("into", "came in"), ("out", "went out"), ("stored", "is stored more"))


def clock(record: Recording) -> list[str]:
    """How many samples, from when to when, how often, and how many gaps."""
    start, end = significant(float(record.time[0]), 6), significant(float(record.time[-1]), 6)
    said = [f"{significant(len(record), 9)} samples from {start} to {tied(end, 's')}"]
    if len(record) > 1:
        period = record.period
        gaps = int((np.diff(record.time) > 1.5 * period).sum())
        said.append(f"every {time_words(period)} ({tied(significant(1.0 / period), 'Hz')})")
        said += [f"{gaps} gap{'s' if gaps > 1 else ''} where nothing was recorded"] if gaps else []
    return said


def channels(record: Recording) -> Table:
    """Smallest, mean and largest value of every channel, and how much of it is known."""
    columns = (
        Column("Channel"), Column("Kind"), Column("Smallest", number=True), Column("Mean", number=True),
        Column("Largest", number=True), Column("Unit"), Column("", wide=True),
    )  # fmt: skip
    rows = []
    for name, s in record.summary().items():
        unit, share = person_unit(s["unit"]), float(np.isfinite(record[name]).mean())
        numbers = [significant(from_si(s[k], s["unit"], unit)) for k in ("min", "mean", "max")]
        known = (
            "" if share == 1.0 else f"known in {tied(significant(100.0 * share, 3), '%')}" if share else "nothing known"
        )
        words = "; ".join(w for w in (record.channels[name].meaning, known) if w)
        rows.append(Row((Span(name, "code"), s["kind"], *numbers, unit_text(unit), words)))
    return Table(columns, tuple(rows))


def saturation(meta: Mapping[str, Any]) -> list[str]:
    """A sentence for each channel that was at an end of its range."""
    found = []
    for name, said in mapping(meta.get("saturation")).items():
        told = mapping(said)
        if told.get("sentence"):
            found.append(f"{name} {told['sentence']}.")
        elif told:
            words = (
                [f"{significant(100.0 * told['share'], 3)} % of its samples"] if is_number(told.get("share")) else []
            )
            words += [f"first at {significant(told['first'], 6)} s"] if is_number(told.get("first")) else []
            words += [f"at most {time_words(told['longest'])} on end"] if is_number(told.get("longest")) else []
            found.append(", ".join([f"{name} was at an end of its range", *words]) + ".")
    return found


def steps(record: Recording) -> list[Block]:
    """The steps as they were done."""
    try:
        listed, names = steps_of(record), [*varied(record)]
    except InputError:
        return []
    columns = (
        Column("", number=True), Column("Step"), Column("Case", wide=True), Column("From", "s", True),
        Column("To", "s", True), Column("Ended by"), Column("Recorded"),
    )  # fmt: skip
    rows = []
    for s in listed[:MOST_STEPS]:
        case = ", ".join(f"{n.replace('_', ' ')} {s['case'][n]}" for n in names if n in s["case"])
        times = [significant(float(s[k]), 6) for k in ("start", "end")]
        ended, kept = str(s.get("ended_by", "")), "yes" if s["recorded"] else "no"
        rows.append(Row((str(s["index"]), str(s["label"]), minus(case), *times, ended, kept)))
    rest = len(listed) - len(rows)
    more: list[Block] = [Paragraph(f"And {rest} more, in the recording.", "quiet")] if rest else []
    return [Table(columns, tuple(rows), head=1), *more]


def events(meta: Mapping[str, Any]) -> list[Block]:
    """What happened, by time."""
    found = meta.get("events")
    told = [mapping(e) for e in found] if isinstance(found, list) else []
    rows = [
        Row((significant(float(e["time"]), 6), str(e.get("text") or e.get("kind") or "")))
        for e in told
        if is_number(e.get("time"))
    ]
    if not rows:
        return []
    rest = len(rows) - MOST_EVENTS
    more: list[Block] = [Paragraph(f"And {rest} more, in the recording.", "quiet")] if rest > 0 else []
    columns = (Column("Time", "s", True), Column("Event", wide=True))
    return [Heading("Events"), Table(columns, tuple(rows[:MOST_EVENTS]), head=1), *more]


def balances(meta: Mapping[str, Any]) -> list[Block]:
    """How far the books close."""
    closed = [(k, float(v)) for k, v in mapping(meta.get("balance")).items() if is_number(v)]
    if not closed:
        return []
    rows = tuple(Row((name.replace("_", " ").capitalize(), significant(v, 2))) for name, v in closed)
    words = (
        "What came in less what went out less what is stored more, each from integrals of its own, over what went through. "
        "A step of the integration that was too long would show here."
    )
    blocks: list[Block] = [
        Paragraph(words, "quiet"),
        Table((Column("Balance of"), Column("Share left", number=True)), rows),
    ]
    friction = {k: v for k, v in mapping(meta.get("friction")).items() if is_number(v)}
    if friction:
        told = ", ".join(f"{name} {tied(significant(v), 'J')}" for name, v in friction.items())
        blocks.append(KeyValues((("Friction of the braid", told),)))
    return blocks


# ---- energy


def energy(meta: Mapping[str, Any]) -> list[Block]:
    """Every ledger of the account, part by part, and what else the account says in numbers."""
    account = mapping(meta.get("energy"))
    ledgers = {str(k): mapping(v) for k, v in account.items() if "into" in mapping(v) and "out" in mapping(v)}
    blocks: list[Block] = []
    for name, ledger in ledgers.items():
        blocks += [Heading(LEDGERS.get(name, name.replace("_", " ").capitalize())), _ledger(ledger)]
    pairs = []
    if is_number(account.get("air")) and account["air"] == account["air"]:
        pairs.append(("Air drawn from supplies", amount(account["air"], "kg")))
    for how, work in mapping(account.get("compressor")).items():
        if is_number(work) and work == work:
            pairs.append((f"Least work of a compressor, {how}", tied(significant(work), "J")))
    return [*blocks, KeyValues(tuple(pairs))] if pairs else blocks


def _ledger(ledger: Mapping[str, Any]) -> Table:
    through = float(ledger["throughput"]) if is_number(ledger.get("throughput")) else 0.0
    came = [float(v) for v in mapping(ledger["into"]).values() if is_number(v)]
    whole = sum(v for v in came if v > 0.0)
    rows = []
    for key, words in _SIDES:
        for name, value in mapping(ledger.get(key)).items():
            if is_number(value) and abs(value) > NOTHING * through:
                rows.append(_part(name.replace("_", " "), words, float(value), whole))
    if is_number(ledger.get("remainder")):
        share = f", {significant(abs(ledger['remainder']) / through, 2)} of what went through" if through else ""
        row = _part("remainder", f"is accounted for nowhere{share}", float(ledger["remainder"]), 0.0)
        rows.append(Row(row.cells, look="quiet"))
    columns = (
        Column("Part"), Column(""), Column("Amount", "J", True), Column("Of what came in", "%", True),
    )  # fmt: skip
    return Table(columns, tuple(rows))


def _part(name: str, words: str, joule: float, whole: float) -> Row:
    share = significant(100.0 * joule / whole, 3) if whole > 0.0 else ""
    return Row((name, words, significant(joule), share))


# ---- a real machine


def calibration(meta: Mapping[str, Any]) -> list[Block]:
    """The corrections of every channel with uncertainty, method and dates."""
    if not meta.get("calibration"):
        return []
    try:
        found = read_plain(meta["calibration"])
    except InputError:  # of a newer version: what it says is shown as it stands
        return [KeyValues(tuple(flat(meta["calibration"])))]
    columns = (
        Column("Channel"), Column("Term"), Column("Value", number=True), Column("± 95 %", number=True), Column("Unit"),
        Column("Method and reference", wide=True), Column("Date"), Column("Valid until"),
    )  # fmt: skip
    rows = tuple(_terms(found, str(meta.get("created") or found.created)))
    pairs = (("Rig", found.rig), ("Made", found.created))
    words = "True value = gain × (indicated value − zero), taken later by the skew. Applied to what was measured."
    return [KeyValues(pairs), Paragraph(words, "quiet"), Table(columns, rows)]


def _terms(found: Calibration, when: str) -> Iterator[Row]:
    for channel, one in found.corrections.items():
        for name, term in one.terms.items():
            unit = {"gain": "1", "skew": "s"}.get(name, one.unit)
            shown = person_unit(unit)
            low, high = term.interval()
            value, half = (significant(from_si(v, unit, shown), 5) for v in (term.value, 0.5 * (high - low)))
            sensor = f" ({one.sensor})" if one.sensor else ""
            expired = name in one.expired(when)
            yield Row((channel + sensor, name, value, half, unit_text(shown), *_whence(term, expired)))


def _whence(term: CorrectionTerm, expired: bool) -> tuple[str, str, str | Cell]:
    origin = term.origin
    if origin is None:
        return "nobody determined it", "", ""
    words = ", ".join(
        w for w in (origin.method, origin.reference, f"{origin.points} points" if origin.points else "") if w
    )
    end = origin.expires
    until = "without end" if end is None else end.date().isoformat()
    return words, origin.date[:10], Cell(until, "caution") if expired else until


def deadlines(meta: Mapping[str, Any]) -> list[Block]:
    """How a run by the wall clock kept its deadlines."""
    told = mapping(meta.get("deadlines"))
    count = told.get("samples")
    if not (is_number(count) and count):
        return [KeyValues(tuple(flat(told)))] if told else []
    pairs = [("Samples", significant(float(count), 9))]
    names = {"late": "Began more than a tenth of a period late", "behind": "Began more than a period late"}
    for key, words in names.items():
        if is_number(told.get(key)):
            pairs.append((words, f"{significant(float(told[key]), 9)} ({significant(100.0 * told[key] / count, 3)} %)"))
    found = told.get("percentiles")
    if isinstance(found, list) and len(found) == 4 and all(map(is_number, found)):
        shares = ("half of them", "99 %", "99.9 %", "all")
        words = "; ".join(f"{s} within {time_words(v)}" for s, v in zip(shares, found, strict=True))
        pairs.append(("Lateness", words))
    return [KeyValues(tuple(pairs))]
