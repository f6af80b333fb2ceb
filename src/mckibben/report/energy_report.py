"""Report of working cycles: numbers, both loops, division of the input, and efficiency over supply pressure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..analysis.energy import CYCLES, READINGS, CycleLoops, CycleMuscle, EnergyCurve, EnergyCycle
from .blocks import Figure, KeyValues, Paragraph, References, ReportTable, Section, TableColumn, TableRow
from .document import Document
from .figures import energy_figures
from .words import amount, significant, versions_text

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
