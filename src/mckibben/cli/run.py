"""``run``: a protocol on a simulated test machine, from the dry run to the recording."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from .protocols import chosen_protocol
from .words import Json, pairs, print_json, progress, table, writable

if TYPE_CHECKING:
    from ..bench.prepare import Bench
    from ..experiments.dry_run import Finding
    from ..recordings.recording import Recording

PARTS = 1000  # of a progress bar
_EXAMPLE = "pressure='5 bar', rig.plumbing.direct.tube.length='1 m' or muscle.law.passive_stiffness='3 N/cm'"

Protocol = Annotated[str, typer.Argument(metavar="PROTOCOL", help="A shipped protocol or a .toml file.")]
Muscle = Annotated[str, typer.Option("--muscle", metavar="ID", help="A specimen, or a .toml file of one.")]
RigName = Annotated[str, typer.Option("--rig", metavar="NAME|FILE", help="paper, modern, or a .toml file.")]
Change = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="PATH=VALUE",
        help=f"A value of the protocol (several by commas), of rig.* or muscle.*: {_EXAMPLE}.",
    ),
]  # fmt: skip


def add_to(app: typer.Typer) -> None:
    """Add this command to the table."""
    app.command("run")(run)


def run(
    protocol: Protocol,
    muscle: Muscle,
    rig: RigName = "paper",
    change: Change = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE.nc|.csv", help="Save the recording.")] = None,
    figure: Annotated[Path | None, typer.Option(help="Draw the measured channels into this SVG, PNG or PDF.")] = None,
    plumbing: Annotated[str | None, typer.Option(help="A way to join the rig's pneumatic parts.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the sensors' noise: same seed, same bits.")] = 0,
    step: Annotated[str, typer.Option(metavar="TIME", help="Largest step of the physics.")] = "50 us",
    accept_saturation: Annotated[
        bool, typer.Option("--accept-saturation", help="Go on where only the load cell's range would be exceeded.")
    ] = False,
    dry: Annotated[
        bool, typer.Option("--dry-run", help="Only say what would be done, and what speaks against it.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Run a protocol on a simulated test machine; nothing moves before the dry run has found nothing."""
    from ..quantities import parse

    writable("--out", out, ".nc", ".csv")
    writable("--figure", figure, ".svg", ".png", ".pdf")
    bench = _prepared(
        protocol, muscle, rig, change, plumbing=plumbing, seed=seed, step=_step(parse(step, "s", field="--step")),
        accept_saturation=accept_saturation,
    )  # fmt: skip
    if bench.findings or dry:
        _tell(bench, dry, as_json)
        return
    with progress("running", PARTS) as advance, _stoppable() as stopped:
        recording = _run(bench, advance, stopped)
    if out is not None:
        recording.save(out)
    if figure is not None:
        from ..report.figures import recording_figures

        recording_figures.write(recording_figures.time_figure(recording), figure)
    if as_json:
        print_json(_result(recording, out))
    else:
        _print(recording)
        for path in (out, figure):
            if path is not None:
                typer.echo(f"Written: {path}")
    if recording.meta["result"] != "done":
        raise typer.Exit(130 if recording.meta["result"] == "interrupted" else 1)


def _prepared(protocol: str, muscle: str, rig: str, change: list[str] | None, **options: Any) -> Bench:
    from ..assembly.build import unit_from_specimen
    from ..bench.prepare import prepare
    from ..bench.rig_file import rig as rig_of
    from ..components import paths
    from ..quantities import parse
    from ..specimens import specimen

    given = pairs(change, "--set", _EXAMPLE)
    own = [f"{k}={v}" for k, v in given.items() if not k.startswith(("rig.", "muscle."))]
    on = rig_of(rig, {k.removeprefix("rig."): v for k, v in given.items() if k.startswith("rig.")})
    spec = specimen(muscle)
    unit = unit_from_specimen(spec)
    for key, words in given.items():
        if key.startswith("muscle."):
            path = key.removeprefix("muscle.")
            declared = paths.declaration(unit, path)
            value = parse(words, declared.unit, field=f"--set {key}")
            declared.check(f"--set {key}", value)
            unit = paths.put(unit, {path: value})
    return prepare(chosen_protocol(protocol, own), muscle=spec, unit=unit, rig=on, **options)


def _step(value: float) -> float:
    if not 1e-7 <= value <= 1e-3:
        raise InputError("--step", f"{value:g} s", "allowed is 0.1 us to 1 ms")
    return value


@contextmanager
def _stoppable() -> Iterator[threading.Event]:
    """The first Ctrl-C ends the run after its chunk and keeps what there is; the second one ends the program."""
    asked = threading.Event()

    def ask(*_: Any) -> None:
        if asked.is_set():
            raise KeyboardInterrupt
        asked.set()

    if threading.current_thread() is not threading.main_thread():
        yield asked
        return
    before = signal.signal(signal.SIGINT, ask)
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)


def _run(bench: Bench, advance: Any, stopped: threading.Event) -> Recording:
    from ..bench.run import run as do

    shown = 0

    def tell(time: float, total: float) -> None:
        nonlocal shown
        for _ in range(shown, int(PARTS * time / total)):
            advance(f"{time:.1f} s of {total:.1f} s")
            shown += 1

    return do(bench, progress=tell, stop=stopped.is_set)


def _tell(bench: Bench, dry: bool, as_json: bool) -> None:
    """What the dry run found; the exit code is 2 if that is anything."""
    found: list[Finding] = list(bench.findings)
    if as_json and dry:
        keys = ("step", "path", "case", "field", "value", "allowed", "sentence")
        print_json(
            {
                "result": "refused" if found else "ready", "sentence": bench.protocol.sentence(),
                "duration": bench.plan.duration, "plumbing": bench.layout, "rig": bench.rig.name,
                "findings": [{k: getattr(f, k) for k in keys} for f in found],
                "warnings": [f.sentence for f in bench.accepted],
            }
        )  # fmt: skip
    elif dry:
        typer.echo(bench.protocol.sentence())
        typer.echo(f"\nAt most {bench.plan.duration:.4g} s on the rig {bench.rig.name}, plumbing {bench.layout}.")
    for warning in bench.accepted:
        typer.echo(f"mckibben: accepted: {warning.sentence}", err=True)
    for finding in found:
        typer.echo(f"mckibben: {finding.sentence}", err=True)
    if found:
        raise typer.Exit(2)


def _result(recording: Recording, out: Path | None) -> dict[str, Any]:
    meta = recording.meta
    keys = ("message", "events", "steps", "saturation", "warnings", "friction", "timing", "seed", "rig", "plumbing")
    return {
        "result": meta["result"], "file": None if out is None else str(out), "summary": recording.summary(),
        "balance": {"mass": meta["balance"]["mass"], "energy": meta["balance"]["energy"]},
        "accounts": meta["balance"], "samples": len(recording), **{k: meta[k] for k in keys},
    }  # fmt: skip


def _print(recording: Recording) -> None:
    from ..quantities import with_unit

    meta = recording.meta
    rows = [
        [name, *(with_unit(s[k], s["unit"]) for k in ("min", "mean", "max"))]
        for name, s in recording.summary().items()
        if s["kind"] == "measured"
    ]
    title = f"{meta['title']}: {meta['specimen']} on the rig {meta['rig']}"
    table(title, ["measured", "lowest", "mean", "highest"], rows)
    closed = meta["balance"]
    typer.echo(f"\n{len(recording)} samples. {meta['message']}")
    typer.echo(f"Balances: mass {closed['mass']:.1e}, energy {closed['energy']:.1e} of what went through.")
    for name, one in meta["saturation"].items():
        typer.echo(f"{name}: {one['sentence']}")
    for event in meta["events"]:
        typer.echo(f"{event['time']:.4g} s: {event['text']}")
