"""Compare the emulated boards with the simulated rig sample by sample, count their cycles, and let everything fail.

    python emulator/compare.py [uno] [stm32f405] [--out measured.json]

Builds images and emulators first (`make firmware`); both boards by default. Three tables for each board:

samples   protocols on the simulated rig, on Python's device and on the board: samples that differ
cycles    what a period takes, task by task, at the highest rate
faults    time from a fault to outputs at rest, and to a pump on `alive` that has run empty; what the host said
"""

import argparse
import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cortex_m4
import emulated_board as uno
import emulated_stm32f405 as stm32f405
import numpy as np

import mckibben as mk
from mckibben.bench.hardware.interface import Hardware, connected
from mckibben.bench.segment import SegmentMachine, timing_of
from mckibben.errors import LineLostError
from mckibben_hardware.serial_line import SerialHardware
from mckibben_hardware.serial_line.device import About
from mckibben_hardware.serial_line.microcontroller import in_thread

FIRMWARE = Path(__file__).parents[1]
CHANNELS = ("pressure", "tension", "span")
BOARDS: dict[str, Any] = {"uno": uno, "stm32f405": stm32f405}
MAKE = {"uno": ("uno", "emulator"), "stm32f405": ("stm32f405", "emulator-stm32f405")}
PROTOCOLS = {
    "uno": (
        ("isometric-step", 250.0, {"cycles": 1, "range": "full"}),
        ("isometric-step", 500.0, {"cycles": 1, "range": "half"}),
        ("sinusoids", 500.0, {"frequency": "2 Hz", "cycles": 2, "precondition": 1}),
    ),
    "stm32f405": (
        ("isometric-step", 250.0, {"cycles": 1, "range": "full"}),
        ("isometric-step", 500.0, {"cycles": 1, "range": "half"}),
        ("sinusoids", 1000.0, {"frequency": "10 Hz", "cycles": 2, "precondition": 1}),
    ),
}
FAULTS = {
    "power": "lost power",
    "brown-out": "supply too low",
    "converter-stopped": "converter without an end",
    "converter-stuck": "converter stuck at one input",
    "encoder-skips": "both lines of the encoder change at once",
    "encoder-jammed": "encoder stands still while the motor moves",
    "line": "torn line",
    "host": "host killed by SIGKILL",
    "hang": "timer of the samples stops",
}
MISSING = {"stm32f405": ("power", "encoder-skips")}  # nothing that its emulator could measure
MOVING = {"uno": 2.7, "stm32f405": 2.52}  # time of the run at which the motor moves [s]
PERIOD, FAULT_AT, WATCHDOG = 4e-3, 20, 5  # [s], samples
PATIENCE = 60.0  # with an emulator on a busy computer [s]
SIMAVR_HZ = 16e6


# ---- samples


def machine_of(bench: Any) -> Any:
    return SegmentMachine(bench, 0, next(bench.segments()), timing_of(bench)).at_interface()


@contextlib.contextmanager
def on_board(board: str, bench: Any, fault: str = "") -> Iterator[tuple[Hardware, Any]]:
    """Yield the hardware of an emulated board with the simulated machine of a run at its pins."""
    with BOARDS[board].emulated(machine_of(bench), fault=fault) as emulated:
        hardware = SerialHardware(
            emulated.port,
            sorted(bench.rig.sensors),
            encoder=True,
            motor=True,
            watchdog=WATCHDOG,
            timeout=PATIENCE,
            greeting=PATIENCE,
        )
        try:
            yield hardware, emulated
        finally:
            hardware.close()


def prepared(board: str, name: str, rate: float, values: dict[str, Any]) -> Any:
    return mk.prepare(name, muscle="nylon", rig=board, sample_rate=f"{rate:g} Hz", **values)


def compare_samples(board: str) -> Iterator[dict[str, Any]]:
    """Yield a row for each protocol: samples, and how many differ."""
    for name, rate, values in PROTOCOLS[board]:
        bench = prepared(board, name, rate, values)
        simulated = mk.run(bench)
        with (
            in_thread(machine_of(bench), about=About(motor_rest=BOARDS[board].MOTOR_REST)) as device,
            connected(f"serial:{device.port}", bench.rig, 1.0 / rate, lock_step=True) as hardware,
        ):
            in_python = mk.run(bench, hardware=hardware)
        with on_board(board, bench) as (hardware, emulated):
            measured = mk.run(bench, hardware=hardware)
        other = {"in_python": 0, "on_board": 0}
        for channel in CHANNELS:
            here = np.asarray(simulated[channel])
            for key, recording in (("in_python", in_python), ("on_board", measured)):
                there = np.asarray(recording[channel])
                n = min(len(here), len(there))
                other[key] += int((here[:n] != there[:n]).sum()) + abs(len(here) - len(there))
        statistics: Any = hardware.statistics
        yield {
            "protocol": f"{name}, {', '.join(f'{k} {v}' for k, v in values.items())}",
            "rate_hz": rate,
            "samples": len(CHANNELS) * len(np.asarray(simulated["pressure"])),
            "differ_in_python": other["in_python"],
            "differ_on_board": other["on_board"],
            "late_answers": statistics.answers_late,
            "motor": name == "sinusoids",
        }


# ---- cycles


class Counting:
    """Counts that go through the converters' range, and an encoder that turns with the valve's count."""

    names = uno.CHANNELS

    def __init__(self, bits: int) -> None:
        self.bits, self.period, self.number, self.edges = (bits,) * 3, 0.0, 0, 0

    def sample(self) -> tuple[list[int], int]:
        """Return the counts of the channels and of the encoder."""
        return [(self.number * step) % 2 ** self.bits[0] for step in (5, 3, 7)], self.edges

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        """Take the outputs of a sample."""
        self.number += 1
        self.edges += valve % 41 - 20


def drive(port: str, period: float, samples: int, watchdog: int = WATCHDOG) -> None:
    """Answer samples with commands that change all outputs."""
    hardware = SerialHardware(port, watchdog=watchdog, timeout=PATIENCE, greeting=PATIENCE)
    try:
        hardware.start(period)
        for k in range(samples):
            hardware.wait(k)
            hardware.write(1 + 37 * k % 1023, 11 * k % 1024, opened=k % 7 != 0)
    finally:
        hardware.close()


TASKS = {
    "timer": "timer of the samples",
    "converters": "converters",
    "encoder": "encoder",
    "receive": "serial line, receive",
    "send": "serial line, send",
    "sample": "a sample: watchdog, frame, checksum",
    "command": "a command: frame, checksum, outputs",
    "main": "main program: queue, watchdog, sleep",
}


def cycles_of_uno() -> dict[str, Any]:
    """Count the cycles of each task at 500 Hz, with up to 20 edges of the encoder in a period."""
    with uno.emulated(Counting(10)) as board:
        drive(board.port, 2e-3, 300)
    report = board.report
    return {
        "rate_hz": SIMAVR_HZ / report["period"],
        "period": report["period"],
        "tasks": {key: [report[f"{key}_mean"], report[f"{key}_most"]] for key in TASKS},
        "busy_most": report["busy_most"],
        "sample_sent": report["tick_to_sent"],
        "command_received": 20 * 160,
        "command_put": report["command_to_output"],
        "jitter": report["jitter"],
        "free_memory": report["free_memory"],
    }


def cycles_of_stm32f405() -> dict[str, Any]:
    """Count the cycles of each task at 5 kHz, with up to 20 edges of the encoder in a period."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "trace"
        with stm32f405.emulated(Counting(12), patience=0.0, trace=log) as board:
            drive(board.port, 2e-4, 8, watchdog=60)
        periods = cortex_m4.count_periods(cortex_m4.program(stm32f405.IMAGE), cortex_m4.addresses(log))[:7]
    tasks = {}
    for key in TASKS:
        counts = [period[key] for period in periods if key in period]
        if counts:
            most = max(counts, key=lambda count: count[2])
            tasks[key] = [sum(c[1] for c in counts) // len(counts), most[1], most[2]]
    totals = [[sum(row[i] for row in period.values()) for i in range(3)] for period in periods]
    most = max(totals, key=lambda total: total[2])
    return {"rate_hz": 5000.0, "period": 33600, "tasks": tasks, "busy_most": most[1], "busy_without_cache": most[2]}


# ---- faults


def answer_until_lost(port: str, silent_at: int | None = None, killed_at: int | None = None) -> str:
    """Answer all samples, or those before one, with the same command until the line is lost; return what the host says."""
    hardware = SerialHardware(port, watchdog=WATCHDOG, timeout=2.0, greeting=PATIENCE)
    try:
        hardware.start(PERIOD)
        for k in range(FAULT_AT + 100):
            hardware.wait(k)
            if k == killed_at:
                os.kill(os.getpid(), signal.SIGKILL)
            if silent_at is None or k < silent_at:
                hardware.write(600, 700, opened=False)
    except LineLostError as error:
        return str(error).partition(": ")[2]
    finally:
        hardware.close()
    return "nothing"


def fault_of_host(port: str, fault: str) -> str:
    """Let a host answer until the fault ends the run; in a process of its own where the host is what fails."""
    if fault != "host":
        return answer_until_lost(port, FAULT_AT if fault == "line" else None)
    ended = subprocess.run([sys.executable, __file__, "--host", port], capture_output=True, text=True, timeout=60.0)
    return "" if ended.returncode == -signal.SIGKILL else f"ended by itself: {ended.stderr.strip()[-200:]}"


def times_of(board: str, emulated: Any) -> dict[str, float | None]:
    """Times from the fault to outputs at rest and to an empty pump [ms]; None where that does not happen."""
    if board == "uno":
        seconds = {key: emulated.report.get(key, 0) / SIMAVR_HZ for key in ("pins_after", "pump_after")}
        seconds = {key: value or None for key, value in seconds.items()}
    else:
        seconds = {key: getattr(emulated, key) for key in ("pins_after", "pump_after")}
    return {f"{key}_ms": None if value is None else round(1e3 * value, 2) for key, value in seconds.items()}


def compare_faults(board: str) -> Iterator[dict[str, Any]]:
    """Yield a row for each fault, which happens with a sample at 250 Hz, the machine under pressure and shut off."""
    for fault, title in FAULTS.items():
        if fault in MISSING.get(board, ()):
            continue
        if fault == "encoder-jammed":
            yield {"fault": title, **jammed(board)}
            continue
        patience = 0.05 if fault in ("line", "host", "hang", "power") else 2.0  # with a silent host, or board [s]
        with BOARDS[board].emulated(Counting(8), fault=f"{fault}@{FAULT_AT}", patience=patience) as emulated:
            words = fault_of_host(emulated.port, fault)
            rest = (0, BOARDS[board].MOTOR_REST, True)
            deadline = time.monotonic() + 5.0
            while rest not in emulated.outputs[FAULT_AT:] and time.monotonic() < deadline:
                time.sleep(0.01)
            time.sleep(0.3)  # until the pump is empty
        yield {"fault": title, **times_of(board, emulated), "host": words}


def jammed(board: str) -> dict[str, Any]:
    """Let the encoder stand still while the motor moves: the board cannot know it, the interlocks of the host can."""
    name, rate, values = PROTOCOLS[board][-1]
    bench = prepared(board, name, rate, values)
    moves = round(MOVING[board] * rate)
    with on_board(board, bench, f"encoder-jammed@{moves}") as (hardware, emulated):
        recording = mk.run(bench, hardware=hardware)
    return {**times_of(board, emulated), "host": str(recording.meta["message"])}


# ---- tables


def compare(board: str) -> dict[str, Any]:
    """Compare one board; prints each table when it is complete."""
    tasks = cycles_of_uno if board == "uno" else cycles_of_stm32f405
    samples = list(compare_samples(board))
    print(f"\n{board}: samples of pressure, tension and span, and how many differ from the simulated rig's", flush=True)
    print(f"{'':66}{'rate':>8}{'samples':>9}{'Python':>8}{'board':>7}{'late':>6}")
    for row in samples:
        print(
            f"{row['protocol']:66}{row['rate_hz']:5g} Hz{row['samples']:9}{row['differ_in_python']:8}"
            f"{row['differ_on_board']:7}{row['late_answers']:6}"
        )
    cycles = tasks()
    print(f"\n{board}: cycles of a period of {cycles['period']} at {cycles['rate_hz']:g} Hz", flush=True)
    print(f"{'':42}{'mean':>8}{'most':>8}" + ("" if board == "uno" else f"{'no cache':>10}"))
    for key, counts in cycles["tasks"].items():
        print(f"{TASKS[key]:42}" + "".join(f"{count:8}" for count in counts))
    print(f"{'all':42}{'':8}{cycles['busy_most']:8}" + ("" if board == "uno" else f"{cycles['busy_without_cache']:8}"))
    faults = list(compare_faults(board))
    print(f"\n{board}: ms from a fault to outputs at rest, and to an empty pump")
    for row in faults:
        times = [row[f"{key}_ms"] for key in ("pins_after", "pump_after")]
        print(
            f"{row['fault']:46}" + "".join(f"{'-' if t is None else f'{t:.2f}':>9}" for t in times) + f"  {row['host']}"
        )
    return {"samples": samples, "cycles": cycles, "faults": faults}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("boards", nargs="*", default=[], help="uno, stm32f405; both if left out")
    parser.add_argument("--out", type=Path, help="JSON file for the figures; those of another board stay in it")
    parser.add_argument("--host", metavar="PORT", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.host:
        answer_until_lost(given.host, killed_at=FAULT_AT)
        return
    boards = given.boards or list(BOARDS)
    if unknown := [board for board in boards if board not in BOARDS]:
        parser.error(f"unknown board {unknown[0]!r}: give uno or stm32f405")
    started = time.monotonic()
    targets = [target for board in boards for target in MAKE[board]]
    subprocess.run(["make", "-s", "-C", str(FIRMWARE), *targets], check=True)
    content = json.loads(given.out.read_text(encoding="utf-8")) if given.out and given.out.is_file() else {}
    for board in boards:
        content[board] = compare(board)
        if given.out:
            given.out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print(f"\n{time.monotonic() - started:.0f} s")
    differing = sum(row["differ_on_board"] for board in boards for row in content[board]["samples"])
    # A row without a time did not vent.
    alive = [row["fault"] for board in boards for row in content[board]["faults"] if not _vented(row)]
    if differing or alive:
        sys.exit(f"{differing} samples differ; not vented: {', '.join(alive) or 'none'}")


def _vented(row: dict[str, Any]) -> bool:
    return row["pins_after_ms"] is not None or row["pump_after_ms"] is not None


if __name__ == "__main__":
    main()
