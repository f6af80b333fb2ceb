"""Report of a recording, as blocks; missing information gives no block."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.channels import find_cycles
from ..analysis.lever import StimulatedContraction, StimulatedLoop, stimulated_contractions, stimulated_loops
from ..analysis.loops import loops_by_held, mean_loop
from ..analysis.segments import segments, steps_of, varied
from ..answers import Caution, collect
from ..citations import bibtex, known_keys
from ..documents import JsonValue
from ..errors import InputError
from ..experiments.waveforms import time_words
from ..quantities import from_si
from ..recordings import read_recording
from ..recordings.calibration import Calibration, CorrectionTerm, read_plain
from ..recordings.recording import Recording
from ..studies.comparison.table import LENGTHS, PRESSURES, TENSIONS
from .blocks import (
    Block,
    Figure,
    Fold,
    Heading,
    KeyValues,
    Listing,
    NoteBox,
    Paragraph,
    References,
    ReportTable,
    Section,
    Span,
    TableCell,
    TableColumn,
    TableRow,
    Text,
    amount,
    flat,
    headed,
    is_number,
    listed,
    mapping,
    minus,
    numeric,
    person_unit,
    significant,
    tied,
    unit_text,
    versions_text,
)
from .document import Document, checked_place
from .figures.recording_figures import against_figure, force_frequency_figure, time_figure, usual_channels
from .origins import inferred_inputs, known_specimen, parameters

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing


MOST_STEPS, MOST_EVENTS = 60, 60  # rows that are shown
NOTHING = 1e-12  # share of a ledger's throughput below which a part is nothing but rounding
LEDGERS = {
    "exergy": "Exergy: work that could be had against the room",
    "energy": "Energy, by the first law",
    "load": "What the muscle did to the load",
}
_SIDES = (("into", "came in"), ("out", "went out"), ("stored", "is stored more"))


def clock(record: Recording) -> list[str]:
    """Describe the samples: their number, start, end, rate and gaps."""
    start, end = significant(float(record.time[0]), 6), significant(float(record.time[-1]), 6)
    said = [f"{significant(len(record), 9)} samples from {start} to {tied(end, 's')}"]
    if len(record) > 1:
        period = record.period
        gaps = int((np.diff(record.time) > 1.5 * period).sum())
        said.append(f"every {time_words(period)} ({tied(significant(1.0 / period), 'Hz')})")
        said += [f"{gaps} gap{'s' if gaps > 1 else ''} where nothing was recorded"] if gaps else []
    return said


def channels(record: Recording) -> ReportTable:
    """Smallest, mean and largest value of every channel, and the share of samples that are known."""
    columns = headed("Channel", "Kind", *numeric("Smallest", "Mean", "Largest"), "Unit", TableColumn("", wide=True))
    rows = []
    for name, s in record.summary().items():
        unit, share = person_unit(s["unit"]), float(np.isfinite(record[name]).mean())
        numbers = [significant(from_si(s[k], s["unit"], unit)) for k in ("min", "mean", "max")]
        known = f"known in {tied(significant(100.0 * share, 3), '%')}" if share else "nothing known"
        known = "" if share == 1.0 else known
        words = "; ".join(w for w in (record.channels[name].meaning, known) if w)
        rows.append(TableRow((Span(name, "code"), s["kind"], *numbers, unit_text(unit), words)))
    return ReportTable(columns, tuple(rows))


def steps(record: Recording) -> list[Block]:
    """Show the executed steps."""
    try:
        listed, names = steps_of(record), [*varied(record)]
    except InputError:
        return []
    columns = headed(
        TableColumn("", number=True),
        "Step",
        TableColumn("Case", wide=True),
        *numeric(("From", "s"), ("To", "s")),
        "Ended by",
        "Recorded",
    )
    rows = []
    for s in listed[:MOST_STEPS]:
        case = ", ".join(f"{n.replace('_', ' ')} {s['case'][n]}" for n in names if n in s["case"])
        times = [significant(float(s[k]), 6) for k in ("start", "end")]
        ended, kept = str(s.get("ended_by", "")), "yes" if s["recorded"] else "no"
        rows.append(TableRow((str(s["index"]), str(s["label"]), minus(case), *times, ended, kept)))
    return [ReportTable(columns, tuple(rows), head=1), *_more(len(listed) - len(rows))]


def _more(rest: int) -> list[Block]:
    return [Paragraph(f"And {rest} more, in the recording.", "quiet")] if rest > 0 else []


def events(meta: Mapping[str, JsonValue]) -> list[Block]:
    """List the events by time."""
    entries = meta.get("events")
    told = [mapping(e) for e in entries] if isinstance(entries, list) else []
    rows = [
        TableRow((significant(float(e["time"]), 6), str(e.get("text") or e.get("kind") or "")))
        for e in told
        if is_number(e.get("time"))
    ]
    if not rows:
        return []
    columns = headed(TableColumn("Time", "s", True), TableColumn("Event", wide=True))
    shown = ReportTable(columns, tuple(rows[:MOST_EVENTS]), head=1)
    return [Heading("Events"), shown, *_more(len(rows) - MOST_EVENTS)]


def balances(meta: Mapping[str, JsonValue]) -> list[Block]:
    """Show the errors of the balances."""
    closed = [(k, float(v)) for k, v in mapping(meta.get("balance")).items() if is_number(v)]
    if not closed:
        return []
    rows = tuple(TableRow((name.replace("_", " ").capitalize(), significant(v, 2))) for name, v in closed)
    words = (
        "What came in less what went out less what is stored more, each from integrals of its own, over what went through. "
        "A step of the integration that was too long would show here."
    )
    blocks: list[Block] = [
        Paragraph(words, "quiet"),
        ReportTable(headed("Balance of", TableColumn("Share left", number=True)), rows),
    ]
    friction = {k: v for k, v in mapping(meta.get("friction")).items() if is_number(v)}
    if friction:
        energies = ", ".join(f"{name} {tied(significant(v), 'J')}" for name, v in friction.items())
        blocks.append(KeyValues((("Friction of the braid", energies),)))
    return blocks


# ---- energy


def energy(meta: Mapping[str, JsonValue]) -> list[Block]:
    """Show every ledger of the account, part by part, and its other numbers."""
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


def _ledger(ledger: Mapping[str, Any]) -> ReportTable:
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
        rows.append(TableRow(row.cells, look="quiet"))
    columns = headed("Part", "", *numeric(("Amount", "J"), ("Of what came in", "%")))
    return ReportTable(columns, tuple(rows))


def _part(name: str, words: str, joule: float, whole: float) -> TableRow:
    share = significant(100.0 * joule / whole, 3) if whole > 0.0 else ""
    return TableRow((name, words, significant(joule), share))


# ---- a real machine


def calibration(meta: Mapping[str, JsonValue]) -> list[Block]:
    """Show the corrections of every channel with uncertainty, method and dates."""
    if not meta.get("calibration"):
        return []
    try:
        corrections = read_plain(meta["calibration"])
    except InputError:  # of a newer version: what it says is shown as it stands
        return [KeyValues(tuple(flat(meta["calibration"])))]
    columns = headed(
        "Channel",
        "Term",
        *numeric("Value", "± 95 %"),
        "Unit",
        TableColumn("Method and reference", wide=True),
        "Date",
        "Valid until",
    )
    rows = tuple(_terms(corrections, str(meta.get("created") or corrections.created)))
    pairs = (("Rig", corrections.rig), ("Made", corrections.created))
    words = "True value = gain × (indicated value − zero), taken later by the skew. Applied to what was measured."
    return [KeyValues(pairs), Paragraph(words, "quiet"), ReportTable(columns, rows)]


def _terms(calibration: Calibration, when: str) -> Iterator[TableRow]:
    for channel, one in calibration.corrections.items():
        for name, term in one.terms.items():
            unit = {"gain": "1", "skew": "s"}.get(name, one.unit)
            shown = person_unit(unit)
            low, high = term.interval()
            value, half = (significant(from_si(v, unit, shown), 5) for v in (term.value, 0.5 * (high - low)))
            sensor = f" ({one.sensor})" if one.sensor else ""
            expired = name in one.expired(when)
            yield TableRow((channel + sensor, name, value, half, unit_text(shown), *_whence(term, expired)))


def _whence(term: CorrectionTerm, expired: bool) -> tuple[str, str, str | TableCell]:
    origin = term.origin
    if origin is None:
        return "nobody determined it", "", ""
    words = ", ".join(
        w for w in (origin.method, origin.reference, f"{origin.points} points" if origin.points else "") if w
    )
    end = origin.expires
    until = "without end" if end is None else end.date().isoformat()
    return words, origin.date[:10], TableCell(until, "caution") if expired else until


def deadlines(meta: Mapping[str, JsonValue]) -> list[Block]:
    """Show how a run in real time kept its deadlines."""
    timing = mapping(meta.get("deadlines"))
    count = timing.get("samples")
    if not (is_number(count) and count):
        return [KeyValues(tuple(flat(timing)))] if timing else []
    pairs = [("Samples", significant(float(count), 9))]
    names = {"late": "Began more than a tenth of a period late", "behind": "Began more than a period late"}
    for key, words in names.items():
        if is_number(timing.get(key)):
            share = significant(100.0 * timing[key] / count, 3)
            pairs.append((words, f"{significant(float(timing[key]), 9)} ({share} %)"))
    percentiles = timing.get("percentiles")
    if isinstance(percentiles, list) and len(percentiles) == 4 and all(map(is_number, percentiles)):
        shares = ("half of them", "99 %", "99.9 %", "all")
        words = "; ".join(f"{s} within {time_words(v)}" for s, v in zip(shares, percentiles, strict=True))
        pairs.append(("Lateness", words))
    return [KeyValues(tuple(pairs))]


LEAST_TURN = 0.02  # share of the largest value by which a channel must move to be driven


def as_written(drawn: Drawing) -> Drawing:
    """Escape dollar signs in a figure's texts, so that names from outside start no formula."""
    from matplotlib.text import Text

    for text in drawn.findobj(Text):
        text.set_parse_math(False)
    return drawn


def loop_blocks(record: Recording) -> list[Block]:
    """Figures and tables of loops, for each label of steps in which the length or the pressure is cyclic."""
    blocks: list[Block] = []
    for label, parts in _groups(record):
        one, kinds = parts[0], (LENGTHS, TENSIONS, PRESSURES)
        usable = ([n for n in names if n in one and np.isfinite(one[n]).all()] for names in kinds)
        length, tension, pressure = (next(iter(names), "") for names in usable)
        if length and tension and (some := _cycling(parts, length)):
            blocks += [_figure(some, length, tension, label), *_table(some, length, tension, _told_apart(record))]
        elif pressure and (some := _cycling(parts, pressure)):
            answers = [n for n in (length, tension) if n and any(_moves(p[n]) for p in some)]
            blocks += [_figure(some, pressure, n, label) for n in answers[:1]]
    return blocks


def _groups(record: Recording) -> list[tuple[str, list[Recording]]]:
    if not record.meta.get("steps"):
        return [("", [record])]
    try:
        labels = dict.fromkeys(str(s["label"]) for s in steps_of(record) if s["recorded"])
        return [(label, segments(record, label)) for label in labels]
    except InputError:
        return [("", [record])]


def _moves(values: np.ndarray) -> bool:
    return bool(np.ptp(values) > LEAST_TURN * np.abs(values).max())


def _cycling(parts: Sequence[Recording], name: str) -> list[Recording]:
    chosen = []
    for part in parts:
        try:
            if name in part and np.isfinite(part[name]).all() and _moves(part[name]) and find_cycles(part[name]):
                chosen.append(part)
        except InputError:
            continue
    return chosen


def _figure(parts: list[Recording], across: str, up: str, label: str) -> Block:
    where = f", step “{label}”" if label else ""
    title = f"{_word(up).capitalize()} over {_word(across)}"
    drawn = against_figure(parts, across, channels=[up], title=f"{title}{where}")
    caption = (
        f"{title}{where}: {len(parts)} recorded part{'s' if len(parts) > 1 else ''}, each in the shade of its case."
    )
    return Figure(as_written(drawn), caption, f"{title}{where}.")


def _word(name: str) -> str:
    return name.rpartition(".")[2].replace("_", " ")


def _table(parts: list[Recording], length: str, tension: str, apart: list[str]) -> list[Block]:
    rows: list[TableRow] = []
    cautions: list[Caution] = []
    for part in parts:
        try:
            groups, said = loops_by_held(part, length=length, tension=tension)
        except InputError:
            continue
        cautions += said
        for held, loops in groups:
            mean = mean_loop(loops)
            width, stiffness = from_si(mean.width, "m", "mm"), from_si(mean.stiffness, "N/m", "N/cm")
            values = (width, mean.height, mean.work, stiffness, mean.friction)
            step = part.meta.get("step")
            whose = _case_words(step["case"], str(step["label"]), apart) if step else "whole recording"
            case = ", ".join(filter(None, (whose, held.words())))
            rows.append(TableRow((case, str(len(loops)), *(significant(v) for v in values))))
    if not rows:
        return []
    columns = headed(
        "Case",
        *numeric("Cycles", ("Width", "mm"), ("Height", "N"), ("Work", "J"), ("Stiffness", "N/cm"), ("Friction", "N")),
    )
    words = (
        f"Mean loop of each part and of what was held in it, {_word(tension)} over {_word(length)}. Width at mid-range of "
        "the tension, height at that of the length, both positive where the muscle takes work in; friction is half the "
        "height. Work per cycle is positive where the muscle does it"
    )
    notes = tuple(f"{c.text[:1].upper()}{c.text[1:]}." for c in collect(*cautions))
    return [ReportTable(columns, tuple(rows), words), *([NoteBox("Caution", notes)] if cautions else [])]


def stimulation_tables(record: Recording) -> dict[str, ReportTable]:
    """Tables of the contractions and work loops of a stimulated muscle by title; none where nothing was stimulated."""
    if "excitation" not in record:
        return {}
    apart = _told_apart(record)
    tables: dict[str, ReportTable] = {}
    for columns, rows_of in ((CONTRACTION_COLUMNS, stimulated_contractions), (LOOP_COLUMNS, stimulated_loops)):
        try:
            each: Sequence[StimulatedContraction | StimulatedLoop] = rows_of(record)
        except InputError:
            continue
        rows = [
            TableRow(
                (
                    _case_words(one.case, one.label, apart),
                    *(_number(getattr(one, name), scale) for name, scale, _, _ in columns),
                )
            )
            for one in each
        ]
        heads = headed("Case", *(TableColumn(title, unit, True) for _, _, title, unit in columns))
        title = "Contractions" if columns is CONTRACTION_COLUMNS else "Work loops with stimulation"
        tables[title] = ReportTable(heads, tuple(rows))
    return tables


# Field, factor from SI, title and unit of what is shown of a contraction and of a work loop.
CONTRACTION_COLUMNS = (
    ("peak", 1.0, "Peak", "N"),
    ("time_to_peak", 1e3, "Time to peak", "ms"),
    ("half_relaxation_time", 1e3, "Half relaxation", "ms"),
    ("mean", 1.0, "Mean", "N"),
    ("ripple", 1e2, "Ripple", "%"),
)
LOOP_COLUMNS = (
    ("cycles", 1.0, "Cycles", ""),
    ("work", 1e3, "Work per cycle", "mJ"),
    ("power", 1e3, "Power", "mW"),
)


def _case_words(case: Mapping[str, Any], label: str, apart: Sequence[str]) -> str:
    return listed(f"{name.replace('_', ' ')} {case[name]}" for name in apart if name in case) or label


def _number(value: float, scale: float) -> str:
    return significant(round(scale * value, 4)) if np.isfinite(value) else "\N{EN DASH}"


def _told_apart(record: Recording) -> list[str]:
    return [*varied(record)] if record.meta.get("steps") else []


MOST_FURTHER = 60  # lines of what a recording says beside all that is known here
# Keys of the meta that have a place of their own, or are too long for one.
_TOLD = frozenset(
    "title sentence circuit run protocol digest rig rig_document plumbing specimen rest_length inferred environment seed "
    "warnings citations versions created parameters balance friction energy saturation timing steps events result message "
    "calibration deadlines description step gaps".split()
)


def recording_report(record: Recording, *, name: str = "") -> Document:
    """Build the report of a recording.

    Args:
        record: any recording.
        name: name of its file, which stands for a missing title.
    """
    meta = record.meta
    sections = [
        Section("What was done", tuple(_done(record, name)), "done"),
        Section("What was recorded", tuple(_figures(record)), "recorded"),
        *_sections(record),
        *_rests(meta),
    ]
    said = str(meta.get("sentence") or "").removeprefix(f"{meta.get('title')}.").strip()  # the title stands above it
    lead = said or ", ".join(str(meta[k]) for k in ("circuit", "run") if meta.get(k))
    return Document(str(meta.get("title") or name or "Recording"), tuple(sections), lead)


def write_recording_report(file: str | os.PathLike[str], out: str | Path) -> Path:
    """Read a recording and write its report to an ``.html`` or ``.pdf`` file.

    Raises:
        InputError: the recording cannot be read, or the report not be written; says why.
    """
    place = checked_place(out)
    return recording_report(read_recording(Path(file)), name=Path(file).name).write(place)


# ---- what was done


def _done(record: Recording, name: str) -> list[Block]:
    meta = record.meta
    blocks: list[Block] = []
    if meta.get("result", "done") != "done":
        words = ": ".join(str(w) for w in (meta["result"], meta.get("message")) if w)
        blocks.append(NoteBox("The run did not reach its end", (words,), "stop"))
    cautions = [f"{c.text.rstrip('.')}." for c in record.cautions if c.parameter != "source"]
    if cautions:
        blocks.append(NoteBox("Caution", tuple(cautions)))
    return [*blocks, KeyValues(tuple(_facts(record, name)))]


def _facts(record: Recording, name: str) -> list[tuple[str, Text]]:
    meta = record.meta
    facts: list[tuple[str, Text]] = []

    def add(title: str, *words: Any) -> None:
        text = ", ".join(str(w) for w in words if w)
        if text:
            facts.append((title, text))

    spec = known_specimen(meta)
    named = meta.get("specimen")
    add("Muscle", spec.title if spec else "", "" if isinstance(named, Mapping) else named)
    if is_number(meta.get("rest_length")):
        add("Rest length", amount(meta["rest_length"], "m"))
    rig = mapping(meta.get("rig_document"))
    add("Test machine", rig.get("title"), f"rig {meta['rig']}" if meta.get("rig") else "")
    room = mapping(meta.get("environment"))
    lines = []
    if is_number(room.get("pressure_abs")):
        lines.append(f"room at {amount(room['pressure_abs'], 'Pa', 5)} absolute")
    if is_number(room.get("temperature")):
        lines.append(tied(significant(room["temperature"]), "K"))
    add("Air", f"plumbing “{meta['plumbing']}”" if meta.get("plumbing") else "", *lines)
    add("Protocol", mapping(meta.get("protocol")).get("name"), mapping(meta.get("protocol")).get("source"))
    add("Recorded", meta.get("created"))
    add("Time", *clock(record))
    timing = {k: v for k, v in mapping(meta.get("timing")).items() if is_number(v) and v > 0.0}
    control = [f"software at {tied(significant(timing['control_rate']), 'Hz')}"] if "control_rate" in timing else []
    control += [f"{k} {amount(timing[k] * 1e3, '1')} ms" for k in ("latency", "step") if k in timing]
    add("Clocks", *control)
    add("Result", meta.get("message") or meta.get("result"))
    add("Seed of the noise", str(meta["seed"]) if is_number(meta.get("seed")) else "")
    add("File", name)
    if meta.get("digest"):
        facts.append(("Protocol's hash", Span(str(meta["digest"]), "code")))
    return facts


# ---- what was recorded


def _figures(record: Recording) -> list[Block]:
    if not any(np.isfinite(record[name]).any() for name in record.names()):
        return [Paragraph("No channel holds a value.")]

    shown = usual_channels([record])
    kinds = {record.channels[n].kind for n in shown}
    words = ["Measured channels are lines"] if "measured" in kinds else []
    thin = "true ones of the simulation thin lines on them" if words else "lines are true values of the simulation"
    words += [thin] * ("true" in kinds)
    words += ["commands dashed"] * ("command" in kinds)
    caption = f"{listed(words)}. A line ends where samples are missing."
    over = Figure(as_written(time_figure(record)), caption[0].upper() + caption[1:], f"Over time: {listed(shown)}.")
    blocks: list[Block] = []
    for title, listed_rows in stimulation_tables(record).items():
        blocks += [Heading(title), listed_rows]
    drawn = force_frequency_figure(record)
    if drawn is not None:
        caption = "Largest and mean active tension over the rate of stimulation."
        blocks.append(Figure(as_written(drawn), caption, caption))
    return [over, *blocks, *loop_blocks(record), Heading("Channels"), channels(record)]


# ---- the rest


def _sections(record: Recording) -> list[Section]:
    meta = record.meta
    sections = (
        ("Steps and events", "steps", [*steps(record), *events(meta)]),
        ("Balances", "balances", balances(meta)),
        ("Where the energy went", "energy", energy(meta)),
        ("Calibration", "calibration", calibration(meta)),
        ("Deadlines", "deadlines", deadlines(meta)),
        ("Parameters and their origin", "parameters", _parameters(meta)),
    )
    return [Section(title, tuple(blocks), anchor) for title, anchor, blocks in sections if blocks]


def _parameters(meta: Mapping[str, JsonValue]) -> list[Block]:
    blocks: list[Block] = []
    guessed = inferred_inputs(meta)
    if guessed:
        rows = tuple(TableRow((Span(g.name, "code"), g.value, g.file), note=g.note) for g in guessed)
        columns = headed("Name in its file", TableColumn("Value", wide=True), "File")
        words = (
            "No source prints these; they were chosen so that what is printed follows, or as such parts usually are."
        )
        blocks += [Paragraph(words), ReportTable(columns, rows, "Inferred, as far as this run used it")]
    resolved = parameters(meta)
    if resolved:
        marked = [("○ " if p.inferred else "") + p.origin for p in resolved]
        rows = tuple(TableRow((Span(p.path, "code"), p.value, o)) for p, o in zip(resolved, marked, strict=True))
        columns = headed("Path", "Value", TableColumn("Origin", wide=True))
        count = sum(p.inferred for p in resolved)
        title = ("All parameters of the run ", Span(f"{len(resolved)}, of them {count} inferred, marked ○", "quiet"))
        words = "Default or derived: the package's own value, or one that follows from the files of rig and specimen."
        blocks.append(Fold(title, (ReportTable(columns, rows), Paragraph(words, "quiet"))))
    further = [p for k, v in meta.items() if k not in _TOLD for p in flat(v, str(k))]
    if further:
        kept = tuple((name, minus(text)) for name, text in further[:MOST_FURTHER])
        blocks.append(Fold("Further metadata", (KeyValues(kept), *_more(len(further) - len(kept)))))
    return blocks


def _rests(meta: Mapping[str, JsonValue]) -> list[Section]:
    cited = meta.get("citations")
    keys = dict.fromkeys(str(k) for k in cited) if isinstance(cited, list) else {}
    spec = known_specimen(meta)
    keys |= dict.fromkeys(spec.sources if spec else ())
    sections = []
    if keys:
        known = [k for k in keys if k in known_keys()]
        listing = (Fold("BibTeX", (Listing(bibtex(known)),)),) if known else ()
        sections.append(Section("Papers this run rests on", (References(tuple(keys)), *listing), "papers"))
    ran = ", ".join(f"{n} {v}" for n, v in mapping(meta.get("versions")).items())
    pairs = (("The run", ran),) if ran else ()
    sections.append(Section("Versions", (KeyValues((*pairs, ("This report", versions_text()))),), "versions"))
    return sections
