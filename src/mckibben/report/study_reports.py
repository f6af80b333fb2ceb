"""Reports of studies: of a characterisation, of a comparison of muscles, and of working cycles.

They carry no date: the same recordings and muscles give the same file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.energy import CYCLES, READINGS, CycleLoops, CycleMuscle, EnergyCurve, EnergyCycle
from ..answers import named
from ..components.gas import AIR, REFERENCE_DENSITY, REFERENCE_TEMPERATURE
from ..errors import InputError
from ..formats.columns import AMBIENT
from ..muscles import evidence
from ..muscles.build import rest_length_of, upper_length_of
from ..muscles.laws import law_type
from ..muscles.muscle import from_specimen
from ..quantities import from_si, with_unit
from ..studies.characterisation.stages import STAGES
from ..studies.characterisation.verb import Characterisation
from ..studies.comparison.match import Match
from ..studies.comparison.side_by_side import MuscleTable
from ..studies.comparison.table import PropertyRow
from ..studies.description import MuscleDescription
from .blocks import (
    Block,
    Cite,
    Figure,
    Heading,
    KeyValues,
    NoteBox,
    Paragraph,
    References,
    ReportTable,
    Section,
    TableCell,
    TableColumn,
    TableRow,
    Text,
    amount,
    headed,
    minus,
    numeric,
    significant,
    unit_text,
    versions_text,
)
from .document import Document
from .figures import energy_figures, study_figures
from .figures.comparison_figures import table_figure
from .figures.muscle_figures import law_curves

__all__ = ["characterisation_document", "write_characterisation_report"]


READING = (
    ("Law", "fitted to the mean of both branches of the loops, less what friction and relaxation leave in it."),
    ("Friction", "fitted to the difference of the branches, for which no law is needed."),
    (
        "Relaxation",
        "fitted to the tension after a stretch, at one span; stated is what relaxes from 1 s to 30 s after a step.",
    ),
    (
        "Interval of a tension",
        "from the errors of the held-out points, which no fit has seen: half its width is Student's t times their root mean "
        "square, with what the gains of load cell and pressure sensor may be off added to it.",
    ),
    (
        "Lengths",
        "are spans of the rig. A muscle in a slack clamp has the tension of a longer one at every span and pressure, so no "
        "sensor shows the slack: what tells is the span at which the vented muscle gets taut, beside the rest length as "
        "measured. The tension at a length of the muscle itself is known only as far as both agree.",
    ),
    (
        "A loop again at the end",
        "one loop of the map, measured again as the last: a gain of the load cell or of the pressure sensor that drifts "
        "changes its tensions. An interval that lies beyond 0.3 %, and the specimen is not to be used; one wider than "
        "that either way tells nothing.",
    ),
    ("Intervals", "95 %; those of the law's parameters take errors as independent and the law as right."),
)


def write_characterisation_report(found: Characterisation, path: str | Path) -> Path:
    """Write the report to an ``.html`` or ``.pdf`` file; returns its path."""
    return characterisation_document(found).write(path)


def characterisation_document(found: Characterisation) -> Document:
    """Build the report; arguments as for `write_characterisation_report`."""
    papers = tuple(dict.fromkeys([*law_type(found.law).cites, "findley1976", "albender2005"]))
    sections = (
        Section("Result", tuple(_result(found)), "result"),
        Section("Prediction", tuple(_prediction(found)), "prediction"),
        Section("Measurement", tuple(_measurement(found)), "measurement"),
        Section("How to read this", (KeyValues(READING),), "reading"),
        Section("Papers this rests on", (References(papers),), "papers"),
        Section("Versions", (Paragraph(versions_text()),), "versions"),
    )
    lead = "An unknown muscle, measured on its own in one run: its law, friction, relaxation and leak."
    return Document(f"Characterisation on the rig {found.rig}", sections, lead)


def _words(value: float, unit: str, digits: int = 4) -> str:
    text = with_unit(value, unit, digits) if math.isfinite(value) else "–"
    return text.replace("-", "\N{MINUS SIGN}").replace(" ", "\N{NO-BREAK SPACE}")


def _result(found: Characterisation) -> list[Block]:
    evaluation = found.evaluation
    title, half = law_type(found.law).title, _words(evaluation.half_width, "N", 2)
    share = f"{100.0 * found.held_out_error:.2g}\N{NO-BREAK SPACE}%"
    words = f"The law {title} with friction predicts {len(evaluation.held_out)} held-out points to {share} rms of the "
    words += f"largest tension, {_words(evaluation.largest, 'N', 3)}. A predicted tension is known to ±{half} (95 %)."
    seat, leak = evaluation.seat, evaluation.leak
    taut, lost = "not up to 2 % longer", "not tested: the plumbing has no shut-off valve"
    if math.isfinite(seat.value):
        taut = f"{_words(seat.value, 'm')} ({_words(seat.low, 'm')} to {_words(seat.high, 'm')})"
    if leak is not None:
        low, high = (f"{100.0 * v:.2g}" for v in (leak.low, leak.high))
        lost = f"{100.0 * leak.value:.2g} % of the pressure per second, shut off ({low} to {high} %)"
        lost = lost.replace("-", "\N{MINUS SIGN}")
    facts = [
        ("Rest length", _words(found.bounds.rest_length, "m")),
        ("Taut, vented", taut),
        ("Span less length of the muscle", " to ".join(_words(by, "m", 2) for by in evaluation.clamp)),
        ("Leak", lost),
        ("Measured pressures", " to ".join(_words(p, "Pa", 3) for p in found.measured_pressures)),
        ("Measured lengths", " to ".join(_words(end, "m", 3) for end in evaluation.lengths)),
        ("A loop again at the end", _again(found)),
        ("Machine time", f"{from_si(found.seconds, 's', 'min'):.1f} min"),
    ]
    rows = tuple(
        TableRow((name, _words(e.value, e.unit), _words(e.low, e.unit), _words(e.high, e.unit)))
        for name, e in found.estimates.items()
    )
    columns = headed("Parameter", *numeric("Value", "95 %: from", "to"))
    said = tuple(named(one.text) for one in found.cautions)
    return [
        Paragraph(words, "lead"),
        *([NoteBox("Not to be used", (found.failure() or "",), "stop")] if not found.passed else []),
        KeyValues(tuple(facts)),
        ReportTable(columns, rows, "Parameters with 95 % intervals"),
        *([NoteBox("Caution", said)] if said else []),
    ]


def _again(found: Characterisation) -> str:
    change = found.evaluation.gain_change
    if not math.isfinite(change.value):
        return "has no lengths in common with the one of the map"
    ends = (f"{100.0 * v:+.2f}" for v in (change.value, change.low, change.high))
    value, low, high = (end.replace("-", "−") for end in ends)
    hidden = "" if found.tells_gain else ": too uncertain to tell a gain that drifts, since the muscle relaxes too much"
    return f"tensions changed by {value} % ({low} to {high} %){hidden}"


def _prediction(found: Characterisation) -> list[Block]:
    columns = (*numeric("Length", "Pressure", ("Measured", "N"), ("Predicted", "N")),)
    rows = tuple(
        TableRow((_words(p.length, "m"), _words(p.pressure, "Pa", 3), f"{p.measured:.2f}", f"{p.predicted:.2f}"))
        for p in found.evaluation.held_out
    )
    return [
        Figure(
            study_figures.loops_figure(found),
            "Tension over the span where the muscle pulls. The lower branch of a loop is that of shortening.",
            "Loops of tension over span, one per pressure, measured and fitted.",
        ),
        Figure(
            study_figures.held_out_figure(found),
            "Errors of the points that no fit has seen.",
            "Errors of the held-out points over the measured tension, with the 95 % band.",
            wide=False,
        ),
        Figure(
            study_figures.relaxation_figure(found),
            "Tension after the stretch at a span that stands still.",
            "Tension over time after the stretch, measured and fitted.",
            wide=False,
        ),
        ReportTable(columns, rows, "Held-out points"),
    ]


def _measurement(found: Characterisation) -> list[Block]:
    rows = tuple(
        TableRow((s.stage, STAGES[s.stage], f"{s.seconds:.0f}", "from the folder" if s.resumed else "new"))
        for s in found.stages
    )
    columns = headed("Stage", TableColumn("", wide=True), TableColumn("Time", "s", True), "Recording")
    errors = ", ".join(f"{law_type(f.law).title} {f.rmse:.2f}\N{NO-BREAK SPACE}N" for f in found.evaluation.fits)
    return [
        ReportTable(columns, rows, "Stages"),
        Paragraph(
            f"Root mean square error of each law on the map, best by Akaike's criterion first: {errors}.", "quiet"
        ),
    ]


CURVES = {"force_length": "Force over length", "passive": "Passive force", "force_velocity": "Force over velocity"}
PAPER = "chou1996"


def muscle_comparison(found: MuscleTable) -> Document:
    """Build the report of a comparison of muscles, with its figure where any of them has a law to draw."""
    names = [c.name for c in found.columns]
    rows = found.properties()
    keys = dict.fromkeys([PAPER, *(k for r in rows if r.published for k in r.published.sources)])
    columns = headed(
        TableColumn("", wide=True),
        "Unit",
        *(TableColumn(n, number=True) for n in names),
        TableColumn("Biological, published", number=True),
    )
    table = ReportTable(columns, tuple(_row(r) for r in rows), "Table 1 of the paper, for these muscles")
    remarks = tuple((c.name, f"{c.title}, from {c.kind}" + "".join(f"; {n}" for n in c.notes)) for c in found.columns)
    sections = [Section("Side by side", (table, Heading("Remarks"), KeyValues(remarks)), "table")]
    if found.muscles:
        drawn = table_figure(found)
        caption = (
            "Normalised. McKibben muscles have the colour of tension, biological ones ink; a letter ends each line."
        )
        picture = Figure(drawn, caption, f"Curves of {', '.join(names)}; the table has the numbers.")
        sections.append(Section("Figures", (picture,), "figures"))
    if found.matches:
        sections.append(Section("Details", tuple(block for m in found.matches for block in _match(m)), "details"))
    sections += [
        Section("Papers", (References(tuple(keys)),), "papers"),
        Section("Versions", (KeyValues((("Computed by", versions_text()),)),), "versions"),
    ]
    lead = "L₀ is each muscle's own resting length, F₀ its tension there; a dash says that the property is not known."
    return Document(f"Muscles side by side: {', '.join(names)}", tuple(sections), lead)


def _row(row: PropertyRow) -> TableRow:
    ends = row.shown_range()
    published: Text = ""
    note = ""
    if ends is not None and row.published is not None:
        words = significant(ends[0], 3) if ends[0] == ends[1] else " to ".join(significant(e, 3) for e in ends)
        published = (words, "\N{THIN SPACE}", Cite(tuple(row.published.sources)))
        note = row.published.note
    values = (TableCell("\N{EN DASH}") if v is None else significant(v, 3) for v in row.shown())
    return TableRow((row.property.title, unit_text(row.property.unit), *values, published), note=note)


def _match(match: Match) -> list[Block]:
    title = f"{match.muscle.id} with elements, towards {match.target.id}"
    rows = tuple(
        TableRow(
            (
                CURVES.get(n, "Together" if n == "all" else n.replace("_", " ")),
                significant(match.rms_before[n], 3),
                significant(match.rms_after[n], 3),
            )
        )
        for n in match.rms_before
    )
    curves = ReportTable(
        headed("Curve", *numeric("As built", "With elements")),
        rows,
        "Root mean square difference over the tension at rest length",
    )
    elements = tuple(
        TableRow((p.title, *(minus(with_unit(v, p.unit)) for v in (p.start, p.value)), _hit(p)))
        for p in match.parameters
    )
    columns = headed("Element", *numeric("As built", "Found"), TableColumn("", wide=True))
    blocks: list[Block] = [Heading(title), curves, ReportTable(columns, elements)]
    if match.simulated is not None:
        words = f"The twitch with elements on the test machine, circuit and all: {significant(match.rms_simulated, 3)}."
        blocks.append(Paragraph(words))
    return blocks


def _hit(p: Any) -> str:
    ends = {"low": ("lower", p.low), "high": ("upper", p.high)}
    return f"at its {ends[p.hit][0]} bound, {minus(with_unit(ends[p.hit][1], p.unit))}" if p.hit in ends else ""


VOLUMES = {"paper": "eq. 38b of the paper", "potential": "the law's own"}
LOSSES = {
    "friction": "friction",
    "throttling": "throttled in the valve",
    "exhaust": "exergy of the air that leaves",
    "emptying": "work on that air",
    "slackening": "slack braid",
    "unaccounted": "unaccounted",
}


def energy_report(
    title: str,
    law: str,
    muscles: Mapping[str, CycleMuscle],
    loops: Sequence[CycleLoops],
    curves: Sequence[tuple[str, EnergyCurve]],
    numbers: Mapping[tuple[str, str], EnergyCycle],
) -> Document:
    """Build the report.

    Args:
        title: title of the muscle.
        law: name of the law.
        muscles: under each volume; the first is the one of the loops.
        loops: loops of one cycle, the first the one that is requested, others with another exchange.
        curves: efficiency over the supply's pressure, each with its words.
        numbers: numbers of the cycle by exchange and volume.
    """
    first = loops[0]
    c, volume = first.conditions, next(iter(muscles))
    between = [
        ("Cycle", CYCLES[first.name]),
        ("Supply", amount(c.pressure, "Pa")),
        ("Exchange", f"accumulator at {amount(c.exchange_pressure, 'Pa')}" if c.exchange_pressure else "atmosphere"),
        ("Surroundings", amount(float(c.ambient.pressure_abs), "Pa", 5)),
        ("Begins at", amount(c.stretched_length, "m")),
        ("Friction", amount(c.friction, "N")),
        ("Law", law.replace("_", " ")),
        ("Volume", VOLUMES[volume]),
    ]
    if first.name != "maximal" and c.friction:
        between.append(("Reading", READINGS[c.reading]))
    heads = ("Exchange", "Volume", "Input, J", "Output, J", "Efficiency", *(f"{w}, J" for w in LOSSES.values()))
    rows = tuple(
        TableRow(
            (
                exchange,
                VOLUMES[which],
                *(significant(getattr(one, k)) for k in ("input", "output", "efficiency")),
                *(significant(0.0 if abs(getattr(one, k)) < 1e-12 else getattr(one, k)) for k in LOSSES),
            )
        )
        for (exchange, which), one in numbers.items()
    )
    columns = tuple(TableColumn(h, number=i > 1) for i, h in enumerate(heads))
    alt = f"Pressure over volume and tension over length; input {first.cycle.input:.3g} J, output {first.cycle.output:.3g} J"
    drawn = energy_figures.loops_figure(loops, title=title)
    pictures = [Figure(drawn, "The areas are the input of the piston and the output of the tendon.", alt)]
    lines = [energy_figures.EfficiencyLine(words, curve) for words, curve in curves]
    if lines:
        over = energy_figures.efficiency_figure(lines, title=title)
        pictures.append(
            Figure(over, "Efficiency over the gauge pressure of the supply.", "Efficiency over supply pressure")
        )
    sections = (
        Section("Between what it runs", (KeyValues(tuple(between)),), "conditions"),
        Section(
            "Numbers",
            (ReportTable(columns, rows), Paragraph("Input is output and losses together.", "quiet")),
            "numbers",
        ),
        Section("Figures", tuple(pictures), "figures"),
        Section("Papers", (References(("chou1996",)),), "papers"),
        Section("Versions", (KeyValues((("Computed by", versions_text()),)),), "versions"),
    )
    named = CYCLES[first.name]
    lead = f"{named[:1].upper()}{named[1:]}: what goes in, what comes out, and where the rest goes."
    return Document(f"Energy of a working cycle: {title}", sections, lead)


# ---- data sheet

SHEET_CONTRACTIONS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25)  # at which a data sheet states forces
SHEET_STEP = 1e5  # of the pressures at which it does [Pa]
USUAL_PRESSURE = 5e5  # up to which it does, where no pressure is stated [Pa]
NOT_STATED = "not stated"


def write_data_sheet(found: MuscleDescription, path: str | Path) -> Path:
    """Write the data sheet of a muscle on one page, in the terms of makers' sheets, to an ``.html`` or ``.pdf`` file.

    Forces are those of the law at rest, without friction: half the hysteresis lies to either side of them.

    Args:
        found: what `studies.description.describe_muscle` found of a McKibben muscle.
        path: of the file.

    Raises:
        InputError: it is no McKibben muscle, the ending is another, or what sets a PDF file is not installed.
    """
    return data_sheet(found).write(path)


def data_sheet(found: MuscleDescription) -> Document:
    """Build the data sheet; arguments as for `write_data_sheet`."""
    spec, law = found.specimen, found.law
    if spec.kind != "mckibben":
        raise InputError("muscle", spec.id, "must be a McKibben muscle: the sheet states forces over contraction")

    def stated(name: str, unit: str) -> float | None:
        return spec.property_si(name, unit) if name in spec.properties else None

    rest = rest_length_of(spec, law)
    full = stated("rated_pressure", "Pa") or stated("highest_measured_pressure", "Pa") or USUAL_PRESSURE
    free, upper = float(np.asarray(law.free_length(full))), upper_length_of(spec, law)
    muscle = from_specimen(spec, found.law_name)
    bore = stated("rest_inner_diameter", "m") or getattr(law, "rest_diameter", None)
    size = f"{_words(float(bore), 'm', 3)} inner" if bore is not None else NOT_STATED
    outer = stated("outer_diameter", "m")
    size += f", {_words(outer, 'm', 3)} outer" if outer is not None else ""
    air = NOT_STATED
    if law.has_volume():
        densities = [float(AIR.density(p + AMBIENT, REFERENCE_TEMPERATURE)) for p in (0.0, full)]
        volumes = [float(np.asarray(law.volume(at, p))) for at, p in ((rest, 0.0), (free, full))]
        used = (densities[1] * volumes[1] - densities[0] * volumes[0]) / REFERENCE_DENSITY
        air = f"{from_si(used, 'm^3', 'l'):.2g} l at 20 °C, 1 bar and 65 % humidity"
    friction = None if muscle.friction is None else float(np.asarray(muscle.friction.largest_force(full)))
    leak, error = stated("leak_decay", "1/s"), evidence.error_of(spec, found.law_name)
    within = stated("tension_uncertainty", "N")
    accuracy = f"±{_words(within, 'N', 2)}" if within is not None else NOT_STATED if error is None else str(error)
    weight = stated("mass", "kg")
    burst = stated("burst_pressure", "Pa")
    pairs = (
        ("Design", f"contracting, braided; law {law.title}"),
        ("Nominal length", _words(rest, "m")),
        ("Diameter", size),
        ("Operating pressure", f"0 to {_words(full, 'Pa', 3)}" + (f", bursts at {_words(burst, 'Pa', 3)}" if burst else "")),
        ("Maximum contraction", f"{100.0 * (1.0 - free / rest):.3g} % of the nominal length, unloaded"),
        ("Maximum stroke", _words(rest - free, "m", 3)),
        ("Maximum force", f"{_words(float(np.asarray(law.tension(rest, full))), 'N')} at the nominal length"),
        ("Maximum pretension", f"{100.0 * (upper / rest - 1.0):.2g} % beyond it" if upper > rest else NOT_STATED),
        ("Hysteresis", NOT_STATED if friction is None else f"{_words(2.0 * friction, 'N', 2)} between both directions"),
        ("Accuracy of the forces", accuracy),
        ("Air per full stroke", air),
        ("Leakage, shut off", NOT_STATED if leak is None else f"{6e3 * leak:.2g} % of the pressure per minute"),
        ("Product weight", NOT_STATED if weight is None else _words(weight, "kg", 3)),
    )  # fmt: skip
    step = SHEET_STEP if full >= 3.0 * SHEET_STEP else 0.25 * full
    pressures = step * np.arange(1, math.floor(full / step + 1e-9) + 1)
    columns = [*map(float, pressures), *([full] if full > 1.01 * pressures[-1] else [])]
    rows = []
    for share in SHEET_CONTRACTIONS:
        tensions = [float(np.asarray(law.tension((1.0 - share) * rest, p))) for p in columns]
        rows.append(
            TableRow((f"{100.0 * share:g} %", *(f"{t:.0f}" if t >= 100.0 else significant(t, 2) for t in tensions)))
        )
    heads = headed(TableColumn("Contraction", number=True), *numeric(*(_words(float(p), "Pa", 3) for p in columns)))
    drawn = law_curves(law, title=spec.title, pressures=[float(p) for p in pressures])
    alt = "Tension over length at each pressure, length without load over pressure, and volume where it is known."
    cautions = tuple(one.text for one in found.cautions)
    blocks: tuple[Block, ...] = (
        KeyValues(pairs),
        ReportTable(heads, tuple(rows), "Force at rest in N, over contraction and pressure; 0 where the muscle is slack"),
        Figure(drawn, "", alt),
        *([NoteBox("Caution", cautions)] if cautions else []),
    )  # fmt: skip
    papers = tuple(dict.fromkeys([*found.sources, *spec.sources]))
    sources = (Section("Sources", (References(papers),), "papers"),) if papers else ()
    return Document(f"{spec.title}: data sheet", (Section("Technical data", blocks, "data"), *sources), "")
