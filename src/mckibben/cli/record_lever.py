"""``record contraction`` and ``record work-loops``: biological muscle on a lever."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import recordings
from ..analysis import lever
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import parse, split_values
from ._outputs import OBJECT, TABLE, OutputKinds, Paths
from ._terminal import Json, caution, options_named, print_json, table
from .read import Column, GearRatio, Period, Unit, format_options
from .record import AnyFile, stated_columns

OUT = OutputKinds(table=TABLE, result=OBJECT)
Force = Annotated[str, typer.Option("--force-channel", metavar="CHANNEL", help="Channel with the force.")]
NONE = "none"  # of set points


@contextmanager
def _of_file(where: str) -> Iterator[None]:
    """Name the file in errors about what is in it."""
    try:
        yield
    except InputError as error:
        raise error.at(where) from None


def contraction(
    file: AnyFile,
    rising: Annotated[
        str, typer.Option(metavar="SHARES", help="Shares of the development of force at which the rise is timed.")
    ] = "10 %, 90 %",
    relaxing: Annotated[
        str | None,
        typer.Option(
            metavar="SHARES",
            help="Shares at which the relaxation is timed; by default '90 %, 50 %', and none of a tetanus.",
        ),
    ] = None,
    above: Annotated[
        str, typer.Option(metavar="LEVEL", help="Level from which force counts: rest, at the stimulus, or zero.")
    ] = "rest",
    force: Force = "force",
    stimulus: Annotated[
        str, typer.Option("--stimulus-channel", metavar="CHANNEL", help="Channel with the stimulus.")
    ] = "stimulus",
    column: Column = None,
    unit: Unit = None,
    period: Period = None,
    gear_ratio: GearRatio = None,
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Time a twitch or tetanus: stimulus, peak, and set points of rise and relaxation.

    $ mckibben record contraction twitch.ddf --rising "10 %, 50 %, 90 %"
    """
    shares = {"--rising": rising, "--relaxing": relaxing}
    points = {name: None if words is None else _shares(words, name) for name, words in shares.items()}
    with OUT.files(out) as files:
        record = _read(file, column, unit, period, gear_ratio)
        with _of_file(str(file)):
            timing = lever.contraction_timing(
                record,
                rising=points["--rising"] or (),
                relaxing=points["--relaxing"],
                above=above,
                force=force,
                stimulus=stimulus,
            )
        protocol = _protocol(record)
        loop = protocol is not None and protocol["kind"] == "work loop"
        warnings = caution(
            "the protocol is one of work loops, in which the length changes; a twitch or a tetanus is timed at one length"
            if loop
            else None
        )
        rows: list[dict[str, Any]] = [
            {"point": "stimulus", "share": None, "time": timing.stimulus_time, "force": timing.stimulus_force},
            *({"point": "rising", **p._asdict()} for p in timing.rising),
            {"point": "peak", "share": None, "time": timing.peak_time, "force": timing.peak_force},
            *({"point": "relaxing", **p._asdict()} for p in timing.relaxing),
        ]
        files.write_rows(rows, {"share": "1", "time": "s", "force": "N"})
        points_json = {name: [p._asdict() for p in getattr(timing, name)] for name in ("rising", "relaxing")}
        content: dict[str, JsonValue] = timing._asdict() | points_json
        content |= {"time_to_peak": timing.time_to_peak, "developed_force": timing.developed_force}
        content |= {"file": str(file), "protocol": protocol, "warnings": warnings}
        files.write_result(content)
        if as_json:
            print_json(content)
            return
        first = timing.stimulus_time
        cells = [
            [
                row["point"] if row["share"] is None else f"{row['point']} {100.0 * row['share']:g} %",
                *(
                    [f"{1e3 * row['time']:.2f}", f"{1e3 * (row['time'] - first):+.2f}", f"{1e3 * row['force']:.7g}"]
                    if row["time"] == row["time"]
                    else ["", "", "below rest"]
                ),
            ]
            for row in rows
        ]
        table(
            f"Contraction of {file.name}, shares above {timing.above}",
            ["point", "time, ms", "after stimulus, ms", "force, mN"],
            cells,
            right=[1, 2, 3],
        )
        typer.echo(
            f"\nPeak {1e3 * timing.peak_force:.7g} mN above zero, "
            f"{1e3 * (timing.peak_force - timing.stimulus_force):.7g} mN above rest, "
            f"{1e3 * timing.time_to_peak:.4g} ms after the stimulus."
        )
        files.say()


def work_loops(
    file: AnyFile,
    cut: Annotated[
        str, typer.Option(metavar="POINT", help="Where a cycle begins and ends: L0, peak or trough of the length.")
    ] = "L0",
    keep: Annotated[
        str | None, typer.Option(metavar="CYCLES", help="Cycles to keep, such as '4-6' or '1, 3'; all by default.")
    ] = None,
    cycle_frequency: Annotated[
        str | None,
        typer.Option(
            metavar="FREQUENCY",
            help="Frequency of the cycles, such as '28 Hz'; by default that of the file's protocol.",
        ),
    ] = None,
    length: Annotated[
        str, typer.Option("--length-channel", metavar="CHANNEL", help="Channel with the length.")
    ] = "length",
    force: Force = "force",
    column: Column = None,
    unit: Unit = None,
    period: Period = None,
    gear_ratio: GearRatio = None,
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Compute work and power of each cycle of a muscle on a lever.

    $ mckibben record work-loops workloop.ddf --cut peak --keep 4-6 --gear-ratio 2
    """
    numbers = None if keep is None else _numbers(keep)
    frequency = None if cycle_frequency is None else parse(cycle_frequency, "1/s", field="--cycle-frequency")
    with OUT.files(out) as files:
        record = _read(file, column, unit, period, gear_ratio)
        with _of_file(str(file)), options_named(frequency="--cycle-frequency '28 Hz'"):
            loops = lever.lever_loops(record, cut=cut, keep=numbers, frequency=frequency, length=length, force=force)
        warnings = caution(lever.missing_cycles(record, length=length) or None, _not_whole(loops))
        units = {"work": "J", "duration": "s", "power": "W", "mean_power": "W", "start": "1", "end": "1", "cycle": "1"}
        files.write_rows([one._asdict() for one in loops], units)
        mean = {name: sum(getattr(one, name) for one in loops) / len(loops) for name in ("work", "power", "mean_power")}
        content: dict[str, JsonValue] = {"file": str(file), "cut": cut, "cycles": [one._asdict() for one in loops]}
        content |= {"mean": mean, "protocol": _protocol(record), "warnings": warnings}
        files.write_result(content)
        if as_json:
            print_json(content)
            return
        cells = [
            [
                str(one.cycle),
                f"{record.time[one.start]:.4f}",
                f"{1e3 * one.duration:.2f}",
                f"{1e3 * one.work:.5f}",
                f"{1e3 * one.power:.4f}",
                f"{1e3 * one.mean_power:.4f}",
            ]
            for one in loops
        ]
        heads = ["cycle", "from, s", "duration, ms", "work, mJ", "power, mW", "mean of F v, mW"]
        table(f"Work loops of {file.name}, cut at {cut}", heads, cells, right=range(len(heads)))
        typer.echo(
            f"\nIn the mean {1e3 * mean['work']:.5g} mJ a cycle, {1e3 * mean['power']:.5g} mW; the mean of force times "
            f"smoothed velocity is {1e3 * mean['mean_power']:.5g} mW."
        )
        files.say()


def _not_whole(loops: Sequence[lever.LeverLoop]) -> str | None:
    """Caution about cycles that are not whole and are in the mean."""
    some = lever.partial_cycles(loops)
    if not some:
        return None
    words = " and ".join(f"{n}" for n in some)
    which, verb = ("cycle", "is") if len(some) == 1 else ("cycles", "are")
    return f"{which} {words} {verb} longer or shorter than the others, and in the mean; --keep takes others"


def _read(
    file: Path, column: list[str] | None, unit: list[str] | None, period: str | None, gear_ratio: str | None
) -> recordings.Recording:
    ratio = None if gear_ratio is None else str(parse(gear_ratio, "1", field="--gear-ratio"))
    asked = stated_columns(column, unit, period) | format_options(None, None, ratio)
    return recordings.read_any(file, **asked).recording


def _protocol(record: recordings.Recording) -> dict[str, JsonValue] | None:
    """The protocol that the file states; None if it states none."""
    try:
        return lever.lever_protocol(record)._asdict()
    except InputError:
        return None


def _shares(words: str, field: str) -> tuple[float, ...]:
    if words.strip() == NONE:
        return ()
    if not words.strip():
        raise InputError(field, words, "must be shares such as '10 %, 90 %', or none")
    return tuple(parse(word, "1", field=field) for word in split_values(words, field=field))


def _numbers(words: str) -> tuple[int, ...]:
    """Numbers and ranges of cycles, such as ``4-6``."""
    numbers: list[int] = []
    for word in words.split(","):
        if not (match := re.fullmatch(r"\s*(\d+)\s*(?:-\s*(\d+)\s*)?", word)):
            raise InputError("--keep", words, "must be numbers or ranges of cycles, such as '4-6' or '1, 3'")
        first, last = int(match[1]), int(match[2] or match[1])
        if not 1 <= first <= last <= first + 10_000:
            raise InputError("--keep", words, "must be ranges that rise, from 1 on")
        numbers += range(first, last + 1)
    return tuple(numbers)
