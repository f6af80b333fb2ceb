"""Characterise a muscle on an emulated board and on the simulated rig, and compare both specimens.

    python firmware/emulator/characterise_board.py [uno] [stm32f405] [--folder FOLDER] [--out firmware/characterised.json]

Builds image and emulator first; both boards by default. `mckibben characterise --on` runs in a process of its own
at the port of the board, at whose pins a simulated machine with the muscle hangs, and then with `--muscle` on the simulated
rig of the same name. Neither knows more of the muscle than its rest length and what the sensors read; the noise of their
sensors is not the same. A folder with stages that were run already is continued.
"""

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import emulated_board as uno
import emulated_stm32f405 as stm32f405
import numpy as np

import mckibben as mk
from mckibben.assembly.build import unit_from_specimen
from mckibben.bench.segment import SegmentMachine
from mckibben.bench.session.interface import ManualSetup
from mckibben.specimens import muscle_specimen

BOARDS: dict[str, Any] = {"uno": uno, "stm32f405": stm32f405}
MAKE = {"uno": ("uno", "emulator"), "stm32f405": ("stm32f405", "emulator-stm32f405")}
FIRMWARE = Path(__file__).parents[1]
MUSCLE, REST_LENGTH, PRESSURE = "nylon", 0.14, "5 bar"  # rest length [m]
SPANS = (0.84, 0.98)  # of the comparison, of the rest length
PRESSURES = (1.5e5, 4.75e5)  # and its gauge pressures [Pa]
POINTS = 12  # of each
BEFORE = "board.json"  # in the folder: samples and times of the board in all the runs that made its recordings


class Counted:
    """A machine of counts that counts its samples."""

    def __init__(self, machine: Any) -> None:
        self.machine, self.samples, self.names = machine, 0, machine.names

    @property
    def period(self) -> float:
        """Period of the samples [s]."""
        return float(self.machine.period)

    @period.setter
    def period(self, period: float) -> None:
        self.machine.period = period

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        """Advance the machine by a period."""
        self.machine.advance(valve, motor, opened)
        self.samples += 1

    def sample(self) -> tuple[Any, int]:
        """Return the counts of the channels and of the encoder."""
        counts: tuple[Any, int] = self.machine.sample()
        return counts


def layout_of(rig: Any) -> str:
    """The plumbing of a rig that shuts the muscle off, so that its leak can be measured."""
    return next(name for name, parts in rig.plumbing.items() if parts.has_muscle and parts.shut_off is not None)


def command(board: str, folder: Path, words: list[str]) -> list[str]:
    """The command that characterises, with all laws."""
    common = ["--rig", board, "--plumbing", layout_of(mk.rig(board)), "--max-pressure", PRESSURE, "--out", str(folder)]
    return [sys.executable, "-m", "mckibben", "characterise", *words, *common, "--json"]


def on_board(board: str, folder: Path, samples: int | None = None, **images: Path) -> dict[str, Any]:
    """Characterise on an emulated board; returns the command's result and what it took.

    Args:
        board: its name.
        folder: of the recordings.
        samples: after which the command is interrupted as by Ctrl-C; None: it runs to its end.
        **images: of `emulated`, other ones than those of `make`.
    """
    rig = mk.rig(board)
    unit = unit_from_specimen(muscle_specimen(MUSCLE))
    setup = ManualSetup(rig, span=REST_LENGTH, muscle=unit, plumbing=layout_of(rig))
    machine = Counted(SegmentMachine(setup.prepared, 0, setup.segment, setup.timing).at_interface())
    begun = time.monotonic()
    with BOARDS[board].emulated(machine, patience=60.0, **images) as emulated:
        words = ["--on", f"serial:{emulated.port}", "--rest-length", f"{REST_LENGTH} m"]
        process = subprocess.Popen(
            command(board, folder, words), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        if samples is not None:
            while machine.samples < samples and process.poll() is None:
                time.sleep(0.05)
            process.send_signal(signal.SIGINT)
        out, err = process.communicate()
    seconds = time.monotonic() - begun
    if process.returncode != (130 if samples is not None else 0):
        sys.exit(f"{board}: characterise ended with {process.returncode}: {err.strip()[-1000:]}")
    figures = {
        "samples": machine.samples,
        "device_seconds": round(machine.samples * machine.period, 1),
        "seconds": round(seconds, 1),
    }
    place = folder / BEFORE
    before = json.loads(place.read_text(encoding="utf-8")) if place.exists() else dict.fromkeys(figures, 0)
    figures = {key: round(value + before[key], 1) for key, value in figures.items()}
    place.write_text(json.dumps(figures) + "\n", encoding="utf-8")
    return {
        "result": None if samples is not None else json.loads(out),
        **figures,
        "vented": emulated.outputs[-1][0] == 0 and emulated.outputs[-1][2],
    }


def on_rig(board: str, folder: Path) -> dict[str, Any]:
    """Characterise on the simulated rig; returns the command's result."""
    words = command(board, folder, ["--muscle", MUSCLE])
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{board}: characterise ended with {done.returncode}: {done.stderr.strip()[-1000:]}")
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def compare(board: str, folder: Path) -> dict[str, Any]:
    """Characterise on board and simulated rig, print both specimens side by side, and return the figures."""
    there = on_board(board, folder / f"{board}-emulated")
    simulated, emulated = on_rig(board, folder / f"{board}-simulated"), there["result"]
    muscles = [mk.muscle(folder / f"{board}-{way}" / "characterised.toml") for way in ("emulated", "simulated")]
    true = mk.muscle(MUSCLE)
    spans, pressures = (
        grid.ravel() for grid in np.meshgrid(REST_LENGTH * np.linspace(*SPANS, POINTS), np.linspace(*PRESSURES, POINTS))
    )
    tensions = [
        np.array([float(muscle.tension(x, p)) for x, p in zip(spans, pressures, strict=True)]) for muscle in muscles
    ]
    difference = tensions[0] - tensions[1]
    largest = float(simulated["largest_tension"])
    rows = {
        "held-out points, rms error [N]": [d["held_out_error"] * d["largest_tension"] for d in (emulated, simulated)],
        "half width of a tension's interval [N]": [d["tension_interval"] for d in (emulated, simulated)],
        "largest tension [N]": [d["largest_tension"] for d in (emulated, simulated)],
        "friction at 3.5 bar [N]": [float(np.sum(m.friction.largest_force(3.5e5))) for m in (*muscles, true)],
        "machine time [s]": [d["machine_time"] for d in (emulated, simulated)],
    }
    for name, title in (("relaxation.1_to_30_s", "relaxation [N/m]"), ("leak.decay", "leak [1/s]")):
        for end, words in (("value", ""), ("low", ", 95 %: from"), ("high", ", to")):
            rows[f"{title}{words}"] = [d["estimates"][name][end] for d in (emulated, simulated)]
            rows[f"{title}{words}"] += [0.0] if end == "value" else []  # this muscle has neither
    rows["taut at [m]"] = [d["seat"]["value"] for d in (emulated, simulated)]
    print(f"\n{board}: characterised in its emulator and on the simulated rig", flush=True)
    print(f"{'':42}{'emulated':>14}{'simulated':>14}{'true':>14}")
    for name, values in rows.items():
        print(f"{name:42}" + "".join(f"{value:14.5g}" for value in values))
    print(f"{'law':42}{emulated['law']:>14} {simulated['law']}")
    rms, most = float(np.sqrt(np.mean(difference**2))), float(np.abs(difference).max())
    print(
        f"tension at {len(spans)} spans and pressures: {rms:.3g} N rms apart, {most:.3g} N at most, of {largest:.3g} N"
    )
    print(
        f"{there['samples']} samples, {there['device_seconds']:.0f} s of the board, in {there['seconds']:.0f} s",
        flush=True,
    )
    figures = {key: value for key, value in there.items() if key != "result"}
    return {
        "muscle": MUSCLE,
        "law": [emulated["law"], simulated["law"]],
        "compared": rows,
        "tension_apart_rms": rms,
        "tension_apart_most": most,
        "half_width": emulated["tension_interval"],
        **figures,
    }


def main() -> None:
    """Characterise on the boards that are named."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("boards", nargs="*", default=[], help="uno, stm32f405; both if left out")
    parser.add_argument("--folder", type=Path, help="folder of recordings, reports and specimens")
    parser.add_argument("--out", type=Path, help="JSON file for the figures; those of another board stay in it")
    given = parser.parse_args()
    boards = given.boards or list(BOARDS)
    if unknown := [board for board in boards if board not in BOARDS]:
        parser.error(f"unknown board {unknown[0]!r}: give uno or stm32f405")
    targets = [target for board in boards for target in MAKE[board]]
    subprocess.run(["make", "-s", "-C", str(FIRMWARE), *targets], check=True)
    content = json.loads(given.out.read_text(encoding="utf-8")) if given.out and given.out.is_file() else {}
    with tempfile.TemporaryDirectory() as temporary:
        for board in boards:
            content[board] = compare(board, given.folder or Path(temporary))
            if given.out:
                given.out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
