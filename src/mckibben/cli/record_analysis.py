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
from ..report.figures import analysis_figures, energy_figures, style
from ._outputs import FIGURE, OBJECT, REPORT, TABLE, OutputFiles, OutputKinds, Paths
from ._terminal import End, FigureLook, FigureWidth, Json, Start, print_json, table
from .record import File, between

if TYPE_CHECKING:
    from ..analysis.energy_parts import EnergyAccount

CYCLES = 20  # rows of cycles that a person is shown
RESPONSES = 16  # rows of a frequency response that a person is shown
OUT = OutputKinds(figure=FIGURE, table=TABLE, result=OBJECT)
REPORTED = OutputKinds(report=REPORT)


def energy(
    file: File,
    start: Start = None,
    end: End = None,
    measured: Annotated[bool, typer.Option("--measured", help="Estimate from measured channels alone.")] = False,
    muscle: Annotated[
        str | None, typer.Option(metavar="SPECIMEN", help="Specimen whose law gives the volume for measured channels.")
    ] = None,
    accumulator: Annotated[
        str | None,
        typer.Option(
            "--accumulator-pressure",
            metavar="PRESSURE",
            help="Gauge pressure of an exhaust accumulator whose saving is computed, such as '1 bar'.",
        ),
    ] = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Account for the exergy of a recording: supply, losses and shaft work.

    $ mckibben record energy loop.nc --out energy.svg
    """
    with OUT.files(out) as files:
        _account(
            file, start, end, measured=measured, muscle=muscle, accumulator=accumulator, files=files, as_json=as_json
        )


def _account(
    file: Path,
    start: str | None,
    end: str | None,
    *,
    measured: bool,
    muscle: str | None,
    accumulator: str | None,
    files: OutputFiles,
    as_json: bool,
) -> None:
    """Compute and write the account."""
    first, last = (
        None if t is None else parse(t, "s", field=name, bare=True) for t, name in ((start, "--from"), (end, "--to"))
    )
    at = None if accumulator is None else parse(accumulator, "Pa", field="--accumulator-pressure", bare=True)
    record = recordings.read_recording(file)
    options: dict[str, Any] = {} if muscle is None else {"muscle": muscle}
    if muscle is not None and not measured and record.meta.get("energy"):
        raise InputError("--muscle", None, "is allowed only with --measured, for the recording carries its own law")
    account = energy_accounts.energy_account(record, start=first, end=last, measured=measured, **options)
    saving = None if at is None else account.saved_by_accumulator(at)
    title = {"title": str(record.meta["title"])} if record.meta.get("title") else {}
    files.write("figure", lambda path: style.save(energy_figures.energy_flow_figure(account, **title), path))
    files.write_rows(
        [{"side": p.side, "part": p.name, "energy": p.value, "from": p.origin} for p in account.parts], {"energy": "J"}
    )
    figure = files.first("figure")
    content = account.to_dict() | {"file": str(file), "figure": None if figure is None else str(figure)}
    content |= {"saving": None if saving is None else saving._asdict()}
    files.write_result(content)
    if as_json:
        print_json(content)
        return
    _print(account)
    if saving is not None:
        typer.echo(
            f"\nAn exhaust accumulator at {saving.pressure / 1e3:.4g} kPa would keep at most {saving.exergy:.4g} J, "
            f"{100.0 * saving.share:.3g} % of the supply's, in {1e3 * saving.air:.4g} g of air."
        )
    files.say()


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
    out: Annotated[list[Path], REPORTED.option()],
    width: FigureWidth = None,
    look: FigureLook = "screen",
    as_json: Json = False,
) -> None:
    """Write a report of a recording: figures, balances, parameters, references.

    $ mckibben record report loop.nc --out loop.html
    """
    with REPORTED.files(out) as files:
        for place in files["report"]:
            document.checked_place(place, field="--out")
        files.write("report", lambda path: reports.write_recording_report(file, path))
        if as_json:
            print_json({"file": str(out[0])})
        else:
            files.say()


def frequency(
    file: File,
    source: Annotated[
        str, typer.Option("--input", metavar="CHANNEL", help="Channel that drives, such as valve.command.")
    ],
    target: Annotated[str, typer.Option("--output", metavar="CHANNEL", help="Channel that answers, such as tension.")],
    resolution: Annotated[
        str | None,
        typer.Option(
            metavar="FREQUENCY",
            help="Spacing of the frequencies, such as '0.5 Hz'; by default eight over the duration.",
        ),
    ] = None,
    sines: Annotated[
        str | None,
        typer.Option(metavar="FREQUENCIES", help="Frequencies of sines in the input, such as '1 Hz, 2 Hz'."),
    ] = None,
    start: Start = None,
    end: End = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Estimate the frequency response between two channels.

    Chirps, noise and many sines are averaged over a band by Welch's method. At known frequencies the response is fitted
    by least squares of sines, without their transient.

    $ mckibben record frequency chirp.nc --input command.pressure --output tension --out response.svg
    """
    with OUT.files(out) as files:
        _respond(file, source, target, resolution, sines, start, end, files, as_json)


def _respond(
    file: Path,
    source: str,
    target: str,
    resolution: str | None,
    sines: str | None,
    start: str | None,
    end: str | None,
    files: OutputFiles,
    as_json: bool,
) -> None:
    """Estimate and write the response."""
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
    title = analysis_figures.BodeTitles(f"{target} over {source}", str(recording.meta.get("title") or file.name), unit)
    files.write(
        "figure",
        lambda path: style.save(analysis_figures.bode_figure(response, title, cutoff=cutoff), path),
    )
    courses = {name: getattr(response, name) for name in ("frequency", "magnitude", "phase", "coherence")}
    files.write_columns(courses, {"frequency": "Hz", "magnitude": unit or "1", "phase": "rad"})
    about = {"file": str(file), "input": source, "output": target, "unit": unit, "cutoff": cutoff}
    content = {**about, **courses, "segments": response.segments}
    files.write_result(content)
    if as_json:
        print_json(content)
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
    files.say()


def repeatability(
    recording: Annotated[
        list[Path], typer.Argument(metavar="RECORDING", help="One recording with cycles, or several runs alike.")
    ],
    channel: Annotated[str, typer.Option(metavar="CHANNEL", help="Channel that is compared.")] = "tension",
    drive: Annotated[
        str, typer.Option(metavar="CHANNEL", help="Channel that has the cycles, of one recording.")
    ] = "span",
    skip: Annotated[int, typer.Option(metavar="N", min=0, help="Number of first cycles that are left out.")] = 0,
    start: Start = None,
    end: End = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Report how well cycles or runs repeat each other.

    Cycles are compared at equal phase, runs at equal time. The drift is the slope of a straight line through the peaks.

    $ mckibben record repeatability loop.nc --skip 1 --out cycles.svg
    """
    with OUT.files(out) as files:
        _repeat(recording, channel, drive, skip, start, end, files, as_json)


def _repeat(
    paths: list[Path],
    channel: str,
    drive: str,
    skip: int,
    start: str | None,
    end: str | None,
    files: OutputFiles,
    as_json: bool,
) -> None:
    """Compare and write the courses."""
    records = [between(recordings.read_recording(path), start, end) for path in paths]
    if len(records) == 1:
        result, each = repeating.between_cycles(records[0], channel=channel, drive=drive, skip=skip), "cycle"
    else:
        result, each = repeating.between_runs(records, channel=channel), "run"
    unit = records[0].channels[channel].unit
    shown_as = shown_unit(unit)
    if files["figure"]:
        scale = from_si(1.0, unit, shown_as)
        scaled = result._replace(courses=scale * result.courses)
        title = str(records[0].meta.get("title") or paths[0].name)
        over = "Phase of the cycle" if each == "cycle" else "Time, s"
        name = channel.replace(".", " ").replace("_", " ").capitalize()
        drawn = analysis_figures.repeatability_figure(scaled, title=title, channel=f"{name}, {shown_as}", over=over)
        files.write("figure", lambda path: style.save(drawn, path))
    files.write_rows([{each: i + 1, "peak": float(peak)} for i, peak in enumerate(result.peaks)], {"peak": unit})
    peaks = repeating.spread(result.peaks)
    drift = repeating.trend(range(result.repetitions), result.peaks.tolist()).slope if result.repetitions > 2 else None
    content = {
        "files": [str(path) for path in paths],
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
    files.write_result(content)
    if as_json:
        print_json(content)
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
    files.say()
