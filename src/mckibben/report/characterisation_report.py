"""Report of a characterisation: what was found, how well it predicts, and how it was measured.

It carries no date: the same recordings give the same file.
"""

from __future__ import annotations

import math
from pathlib import Path

from ..muscles.laws import law_type
from ..quantities import with_unit
from ..studies.characterisation.stages import STAGES
from ..studies.characterisation.verb import Characterisation
from .blocks import (
    Block,
    Figure,
    KeyValues,
    NoteBox,
    Paragraph,
    References,
    ReportTable,
    Section,
    TableColumn,
    TableRow,
)
from .document import Document
from .figures import characterisation_figures
from .words import versions_text

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
    """Write the report to an ``.html`` or ``.pdf`` file.

    Args:
        found: outcome of the characterisation.
        path: path of the file.

    Returns:
        The path.
    """
    return characterisation_document(found).write(path)


def characterisation_document(found: Characterisation) -> Document:
    """Build the report; arguments as for `write_characterisation_report`."""
    sections = (
        Section("Result", tuple(_result(found)), "result"),
        Section("Prediction", tuple(_prediction(found)), "prediction"),
        Section("Measurement", tuple(_measurement(found)), "measurement"),
        Section("How to read this", (KeyValues(READING),), "reading"),
        Section("Papers this rests on", (References(tuple(_papers(found))),), "papers"),
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
    facts = [
        ("Rest length", _words(found.bounds.rest_length, "m")),
        ("Taut, vented", _seat(found)),
        ("Span less length of the muscle", " to ".join(_words(by, "m", 2) for by in evaluation.clamp)),
        ("Leak", _leak(found)),
        ("Measured pressures", " to ".join(_words(p, "Pa", 3) for p in found.measured_pressures)),
        (
            "Measured lengths",
            " to ".join(_words(end, "m", 3) for end in evaluation.lengths),
        ),
        ("A loop again at the end", _again(found)),
        ("Machine time", f"{found.seconds / 60.0:.1f} min"),
    ]
    rows = tuple(
        TableRow((name, _words(e.value, e.unit), _words(e.low, e.unit), _words(e.high, e.unit)))
        for name, e in found.estimates.items()
    )
    columns = (
        TableColumn("Parameter"),
        TableColumn("Value", number=True),
        TableColumn("95 %: from", number=True),
        TableColumn("to", number=True),
    )
    said = [*evaluation.fits[0].warnings, *(f"friction: {warning}" for warning in evaluation.friction.warnings)]
    if not found.knows_volume:
        said.append(
            "these tensions are those of no ideal braid, so that the volume is not known, which commands that fill the "
            f"muscle need; measure it and state rest_volume under laws.{found.law} in the specimen's file"
        )
    return [
        Paragraph(words, "lead"),
        *([NoteBox("Not to be used", (found.failure,), "stop")] if found.failure else []),
        KeyValues(tuple(facts)),
        ReportTable(columns, rows, "Parameters with 95 % intervals"),
        *([NoteBox("Caution", tuple(dict.fromkeys(said)))] if said else []),
    ]


def _seat(found: Characterisation) -> str:
    seat = found.evaluation.seat
    if not math.isfinite(seat.value):
        return "not up to 2 % longer"
    return f"{_words(seat.value, 'm')} ({_words(seat.low, 'm')} to {_words(seat.high, 'm')})"


def _again(found: Characterisation) -> str:
    change = found.evaluation.gain_change
    if not math.isfinite(change.value):
        return "has no lengths in common with the one of the map"
    ends = (f"{100.0 * v:+.2f}" for v in (change.value, change.low, change.high))
    value, low, high = (end.replace("-", "−") for end in ends)
    hidden = "" if found.tells_gain else ": too uncertain to tell a gain that drifts, since the muscle relaxes too much"
    return f"tensions changed by {value} % ({low} to {high} %){hidden}"


def _leak(found: Characterisation) -> str:
    leak = found.evaluation.leak
    if leak is None:
        return "not tested: the plumbing has no shut-off valve"
    low, high = (f"{100.0 * v:.2g}" for v in (leak.low, leak.high))
    return f"{100.0 * leak.value:.2g} % of the pressure per second, shut off ({low} to {high} %)".replace("-", "−")


def _prediction(found: Characterisation) -> list[Block]:
    columns = (
        TableColumn("Length", number=True),
        TableColumn("Pressure", number=True),
        TableColumn("Measured", "N", True),
        TableColumn("Predicted", "N", True),
    )
    rows = tuple(
        TableRow((_words(p.length, "m"), _words(p.pressure, "Pa", 3), f"{p.measured:.2f}", f"{p.predicted:.2f}"))
        for p in found.evaluation.held_out
    )
    return [
        Figure(
            characterisation_figures.loops_figure(found),
            "Tension over the span where the muscle pulls. The lower branch of a loop is that of shortening.",
            "Loops of tension over span, one per pressure, measured and fitted.",
        ),
        Figure(
            characterisation_figures.held_out_figure(found),
            "Errors of the points that no fit has seen.",
            "Errors of the held-out points over the measured tension, with the 95 % band.",
            wide=False,
        ),
        Figure(
            characterisation_figures.relaxation_figure(found),
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
    columns = (
        TableColumn("Stage"),
        TableColumn("", wide=True),
        TableColumn("Time", "s", True),
        TableColumn("Recording"),
    )
    errors = ", ".join(f"{law_type(f.law).title} {f.rmse:.2f}\N{NO-BREAK SPACE}N" for f in found.evaluation.fits)
    return [
        ReportTable(columns, rows, "Stages"),
        Paragraph(
            f"Root mean square error of each law on the map, best by Akaike's criterion first: {errors}.", "quiet"
        ),
    ]


def _papers(found: Characterisation) -> list[str]:
    return list(dict.fromkeys([*law_type(found.law).cites, "findley1976", "albender2005"]))
