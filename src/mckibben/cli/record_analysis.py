"""``record energy``, ``frequency``, ``repeatability`` and ``report``: analysis of recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from .. import recordings
from ..analysis import energy_accounts
from ..analysis import frequency as response_module
from ..analysis import repeatability as repeating
from ..errors import InputError
from ..quantities import from_si, parse, shown_unit, split_values, with_unit
from ..report import document
from ..report import recording_report as reports
from ..report.figures import energy_figures, frequency_figures, style
from ._terminal import PICTURES, FigureLook, FigureWidth, Json, print_json, table, writable
from .record import File, between

if TYPE_CHECKING:
    from ..analysis.energy_parts import EnergyAccount

CYCLES = 20  # rows of cycles that a person is shown
RESPONSES = 16  # rows of a frequency response that a person is shown
Start = Annotated[str | None, typer.Option("--from", metavar="TIME", help="Time from which on samples are used.")]
End = Annotated[str | None, typer.Option("--to", metavar="TIME", help="Time up to which samples are used.")]


def energy(
    file: File,
    figure: Annotated[
        Path | None, typer.Option(metavar="PICTURE", help="Picture file to write (.svg, .pdf or .png).")
    ] = None,
    start: Start = None,
    end: End = None,
    measured: Annotated[bool, typer.Option("--measured", help="Estimate from measured channels alone.")] = False,
    muscle: Annotated[
        str | None, typer.Option(metavar="SPECIMEN", help="Specimen whose law gives the volume for measured channels.")
    ] = None,
    accumulator: Annotated[
        str | None,
        typer.Option(metavar="PRESSURE", help="Gauge pressure of an exhaust accumulator whose saving is computed."),
    ] = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    as_json: Json = False,
) -> None:
    """Account for the exergy of a recording: supply, losses and shaft work."""
    writable("--figure", figure, *PICTURES)
    first, last = (
        None if t is None else parse(t, "s", field=name, bare=True) for t, name in ((start, "--from"), (end, "--to"))
    )
    at = None if accumulator is None else parse(accumulator, "Pa", field="--accumulator", bare=True)
    record = recordings.read_recording(file)
    options: dict[str, Any] = {} if muscle is None else {"muscle": muscle}
    if muscle is not None and not measured and record.meta.get("energy"):
        raise InputError("--muscle", None, "is allowed only with --measured, for the recording carries its own law")
    account = energy_accounts.energy_account(record, start=first, end=last, measured=measured, **options)
    saving = None if at is None else account.saved_by_accumulator(at)
    if figure is not None:
        title = record.meta.get("title")
        style.save(energy_figures.energy_flow_figure(account, **({"title": str(title)} if title else {})), figure)
    if as_json:
        content = account.to_dict() | {"file": str(file), "figure": None if figure is None else str(figure)}
        print_json(content | {"saving": None if saving is None else saving._asdict()})
        return
    _print(account)
    if saving is not None:
        typer.echo(
            f"\nAn exhaust accumulator at {saving.pressure / 1e3:.4g} kPa would keep at most {saving.exergy:.4g} J, "
            f"{100.0 * saving.share:.3g} % of the supply's, in {1e3 * saving.air:.4g} g of air."
        )
    if figure is not None:
        typer.echo(f"\nWritten: {figure}")


def _print(account: EnergyAccount) -> None:
    supply = next((p.value for p in account.parts if p.name == "supply"), float("nan"))
    words = {"into": "in", "out": "out", "stored": "gained", "remainder": "left"}
    shares = {p: f"{100.0 * p.value / supply:.2f}" if supply > 0.0 else "" for p in account.parts}
    rows = [
        [words[p.side], p.name, f"{p.value:.5g}", shares[p], p.origin, p.meaning]
        for p in account.parts
        if p.value or p.name in ("supply", "shaft_work", "remainder")
    ]
    table(f"Exergy, {account.kind}", ["", "part", "J", "%", "from", ""], rows, right=[2, 3])
    told = ", ".join(f"{100.0 * v:.3g} % of the {name}" for name, v in account.efficiencies().items() if v == v)
    typer.echo(f"\nAir drawn: {1e3 * account.air:.4g} g. Shaft work: {told or 'no supply to compare it with'}.")
    if account.cycles:
        typer.echo("")
        cycles = [
            [
                f"{c.start:.4g}",
                f"{c.end:.4g}",
                f"{1e3 * c.air:.4g}",
                f"{c.supply:.4g}",
                f"{c.shaft_work:.4g}",
                f"{c.work_out:.4g}",
                f"{100.0 * c.efficiency:.2f}",
                f"{c.parts[-1].value:.2g}",
            ]
            for c in account.cycles[:CYCLES]
        ]
        heads = [
            "from, s",
            "to, s",
            "air, g",
            "supply, J",
            "shaft work, J",
            "work out, J",
            "efficiency, %",
            "remainder, J",
        ]
        table("Cycles, from samples", heads, cycles, right=range(len(heads)))
        if len(account.cycles) > CYCLES:
            typer.echo(f"... and {len(account.cycles) - CYCLES} more; --json lists all.")
    if account.unknown:
        typer.echo(f"\nUnknown, and not zero: {', '.join(account.unknown)}.")
    for note in account.notes:
        typer.echo(f"Note: {note}.")


def report(
    file: File,
    out: Annotated[Path, typer.Option(metavar="REPORT", help="Report file to write (.html or .pdf).")],
    width: FigureWidth = None,
    look: FigureLook = "screen",
    as_json: Json = False,
) -> None:
    """Write a report of a recording: figures, balances, parameters, references."""
    document.checked_place(out, field="--out")
    reports.write_recording_report(file, out)
    if as_json:
        print_json({"file": str(out)})
    else:
        typer.echo(f"Written: {out}")


def frequency(
    file: File,
    source: Annotated[
        str, typer.Option("--input", metavar="CHANNEL", help="Channel that drives, such as valve.command.")
    ],
    target: Annotated[str, typer.Option("--output", metavar="CHANNEL", help="Channel that answers, such as tension.")],
    resolution: Annotated[
        str | None,
        typer.Option(metavar="FREQUENCY", help="Spacing of the frequencies; by default eight over the duration."),
    ] = None,
    sines: Annotated[
        str | None,
        typer.Option(metavar="F1,F2", help="Frequencies of sines in the input, such as '1 Hz, 2 Hz'."),
    ] = None,
    start: Start = None,
    end: End = None,
    figure: Annotated[
        Path | None, typer.Option(metavar="PICTURE", help="Draw the response, .svg, .pdf or .png.")
    ] = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    as_json: Json = False,
) -> None:
    """Estimate the frequency response between two channels.

    Chirps, noise and many sines are averaged over a band by Welch's method. At known frequencies the response is fitted
    by least squares of sines, without their transient.
    """
    writable("--figure", figure, *PICTURES)
    if sines is not None and resolution is not None:
        raise InputError("--resolution", None, "is allowed only without --sines, which states the frequencies")
    recording = between(recordings.read_recording(file), start, end)
    if sines is None:
        distance = None if resolution is None else parse(resolution, "1/s", field="--resolution")
        response = response_module.frequency_response(recording, source=source, response=target, resolution=distance)
    else:
        at = [parse(word, "1/s", field="--sines") for word in split_values(sines, field="--sines")]
        if not at:
            raise InputError("--sines", sines, "must be one frequency or several, such as '1 Hz, 2 Hz'")
        response = response_module.sine_response(recording, sorted(at), source=source, response=target)
    above, below = (recording.channels[name].unit for name in (target, source))
    unit = "" if above == below else above if below == "1" else f"{above} per {below}"
    cutoff = response.cutoff()
    if figure is not None:
        title = frequency_figures.BodeTitles(
            f"{target} over {source}", str(recording.meta.get("title") or file.name), unit
        )
        style.save(frequency_figures.bode_figure(response, title, cutoff=cutoff), figure)
    if as_json:
        values = {
            name: getattr(response, name) for name in ("frequency", "magnitude", "phase", "coherence", "segments")
        }
        print_json({"file": str(file), "input": source, "output": target, "unit": unit, "cutoff": cutoff, **values})
        return
    count = len(response.frequency)
    chosen = sorted({round(i) for i in np.geomspace(1, count, min(count, RESPONSES))})
    rows = [
        [
            f"{response.frequency[i]:.4g}",
            f"{response.magnitude[i]:.4g}",
            f"{np.degrees(response.phase[i]):.1f}",
            f"{response.coherence[i]:.3f}",
        ]
        for i in (k - 1 for k in chosen)
    ]
    columns = ["frequency, Hz", f"magnitude{f', {unit}' if unit else ''}", "phase, degrees", "coherence"]
    table(f"{target} over {source}", columns, rows, right=range(4))
    averaged = f", {response.segments} segments averaged" if sines is None else ""
    fallen = f"It falls by 3 dB at {cutoff:.4g} Hz." if np.isfinite(cutoff) else "It does not fall by 3 dB."
    typer.echo(f"\n{count} frequencies{averaged}. {fallen}")
    if figure is not None:
        typer.echo(f"Written: {figure}")


def repeatability(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE..", help="One recording with cycles, or several runs alike.")
    ],
    channel: Annotated[str, typer.Option(metavar="CHANNEL", help="Channel that is compared.")] = "tension",
    drive: Annotated[
        str, typer.Option(metavar="CHANNEL", help="Channel that has the cycles, of one recording.")
    ] = "span",
    skip: Annotated[int, typer.Option(min=0, help="Number of first cycles that are left out.")] = 0,
    start: Start = None,
    end: End = None,
    figure: Annotated[
        Path | None, typer.Option(metavar="PICTURE", help="Draw all courses, .svg, .pdf or .png.")
    ] = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    as_json: Json = False,
) -> None:
    """Report how well cycles or runs repeat each other.

    Cycles are compared at equal phase, runs at equal time. The drift is the slope of a straight line through the peaks.
    """
    writable("--figure", figure, *PICTURES)
    records = [between(recordings.read_recording(file), start, end) for file in files]
    if len(records) == 1:
        result, each = repeating.between_cycles(records[0], channel=channel, drive=drive, skip=skip), "cycle"
    else:
        result, each = repeating.between_runs(records, channel=channel), "run"
    unit = records[0].channels[channel].unit
    shown_as = shown_unit(unit)
    if figure is not None:
        scale = from_si(1.0, unit, shown_as)
        scaled = result._replace(courses=scale * result.courses)
        title = str(records[0].meta.get("title") or files[0].name)
        over = "Phase of the cycle" if each == "cycle" else "Time, s"
        name = channel.replace(".", " ").replace("_", " ").capitalize()
        drawn = frequency_figures.repeatability_figure(scaled, title=title, channel=f"{name}, {shown_as}", over=over)
        style.save(drawn, figure)
    peaks = repeating.spread(result.peaks)
    drift = repeating.trend(range(result.repetitions), result.peaks.tolist()).slope if result.repetitions > 2 else None
    if as_json:
        print_json(
            {
                "files": [str(file) for file in files],
                "channel": channel,
                "unit": unit,
                "between": f"{each}s",
                "repetitions": result.repetitions,
                "rms": result.rms,
                "largest": result.largest,
                "relative_rms": result.relative_rms,
                "peaks": {"values": result.peaks, **peaks._asdict()},
                "drift": None if drift is None else drift._asdict(),
            }
        )
        return
    rows = [
        [
            "rms distance from the mean course",
            with_unit(result.rms, unit),
            f"{100.0 * result.relative_rms:.3g} % of its range",
        ],
        ["largest distance", with_unit(result.largest, unit), ""],
        ["peak", with_unit(peaks.mean, unit), f"standard deviation {with_unit(peaks.deviation, unit)}"],
    ]
    if drift is not None:
        interval = f"95 %: {with_unit(drift.low, unit)} to {with_unit(drift.high, unit)}"
        rows.append([f"drift of the peak per {each}", with_unit(drift.value, unit), interval])
    table(f"{channel} over {result.repetitions} {each}s", ["", "", ""], rows, right=[1])
    if figure is not None:
        typer.echo(f"\nWritten: {figure}")
