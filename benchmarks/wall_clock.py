"""How the loop by the wall clock keeps its deadlines: in one process, and through a serial line to a process of its own.

The paper's rig with the nylon muscle under isotonic triangles: gas, friction, motor, both feedback loops and interlocks at
every sample, every channel into a log that survives, and a display's look at each chunk. No sample is ever left out;
lateness is that of the moment at which a sample's counts are there, over a clock that never waits. Let nothing else run.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import tempfile
import time
from pathlib import Path

from mckibben.bench.hardware.backends import connected
from mckibben.bench.hardware.simulated import SimulatedMachine
from mckibben.bench.prepare import PreparedRun, prepare
from mckibben.bench.run import run
from mckibben.bench.segment import SegmentMachine, timing_of
from mckibben.experiments.read import protocol
from mckibben.recordings import Recording
from mckibben_hardware.serial_line.device import About
from mckibben_hardware.serial_line.microcontroller import in_process


def bench_of(rate: float, seconds: float) -> PreparedRun:
    """Some seconds of triangles at a sample rate [1/s]; the filling before and the venting after come on top."""
    wanted = protocol("isotonic-triangle", load="50 N", frequency="1 Hz", cycles=max(1, round(seconds)))
    return prepare(dataclasses.replace(wanted, sample_rate=rate), muscle="nylon", rig="paper")


def machine_of(rate: float, seconds: float) -> SimulatedMachine:
    """The machine that a device hosts; called in its process."""
    bench = bench_of(rate, seconds)
    return SegmentMachine(bench, 0, next(bench.segments()), timing_of(bench)).at_interface(ahead=seconds)


def measured(rate: float, seconds: float, *, serial: bool, log: Path) -> tuple[Recording, float, float]:
    """The recording, the time that it took, and the processor time of this process [s]."""
    bench = bench_of(rate, seconds)
    if not serial:
        run(bench_of(rate, 1.0), real_time=True)  # compiled before
        begin, spent = time.perf_counter(), time.process_time()
        record = run(bench, real_time=True, log=log)
        return record, time.perf_counter() - begin, time.process_time() - spent
    out = bench.rig.motor_out
    about = About(motor_rest=0 if out is None else int(out.count(0.0)))
    with in_process(machine_of, rate, seconds + 10.0, about=about) as hosted:
        with connected(f"serial:{hosted.port}", bench.rig, 1.0 / rate) as hardware:
            begin, spent = time.perf_counter(), time.process_time()
            record = run(bench, hardware=hardware, log=log)
            return record, time.perf_counter() - begin, time.process_time() - spent


def main() -> None:
    """Print a line per way and sample rate."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rates", type=float, nargs="+", default=[1000.0, 5000.0])
    parser.add_argument("--only", choices=("process", "serial"))
    parser.add_argument("--json", action="store_true", help="one JSON object instead of lines")
    given = parser.parse_args()
    rows = []
    for serial in (False, True):
        if given.only is not None and serial != (given.only == "serial"):
            continue
        for rate in given.rates:
            with tempfile.TemporaryDirectory() as folder:
                log = Path(folder) / "run.mcap"
                record, took, spent = measured(rate, given.seconds, serial=serial, log=log)
                size = log.stat().st_size
            late = record.meta["deadlines"]
            rows.append({
                "way": "serial line" if serial else "one process", "sample_rate": rate, "channels": len(record.channels),
                "result": record.meta["result"], "samples": late["samples"], "late": late["late"], "behind": late["behind"],
                "lateness": late["percentiles"], "core": spent / took,
            })  # fmt: skip
            if given.json:
                continue
            half, most, nearly, largest = (1e3 * x for x in late["percentiles"])
            print(
                f"{'serial line' if serial else 'one process'}, {rate:.0f} samples/s, {len(record.channels)} channels: "
                f"{record.meta['result']}, {late['samples']} samples in {took:.1f} s, {late['late']} late by a tenth of a "
                f"period, {late['behind']} by a period; lateness {half:.3f} ms (50 %), {most:.3f} (99 %), {nearly:.3f} "
                f"(99.9 %), {largest:.3f} (largest); {100.0 * spent / took:.0f} % of a core, log of {size / 1e6:.1f} MB"
                + (f"; {json.dumps(record.meta['hardware'])}" if serial else "")
            )
            if record.meta["result"] != "done":
                print(f"  {record.meta['message']}")
    if given.json:
        print(json.dumps(rows))


if __name__ == "__main__":
    main()
