"""Channel values per second that one simulated machine records, and simulated seconds per second.

The paper's rig with the nylon muscle: gas, friction, motor, both feedback loops, converters; steps of 50 us. A sample at
5 kHz takes 4 of them, one at 1 kHz 20. Compilation is done before; each figure is the median of several runs of one process.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import statistics
import time

from mckibben.bench.prepare import prepare
from mckibben.bench.run import run
from mckibben.experiments.read import protocol


def measured(rate: float, runs: int) -> tuple[float, float, int]:
    """Values per second, simulated seconds per second, and channels, at a sample rate [1/s]."""
    wanted = dataclasses.replace(protocol("work-loop", cycles="5"), sample_rate=rate)
    bench = prepare(wanted, muscle="nylon", rig="paper")
    run(bench)
    values, speeds = [], []
    for _ in range(runs):
        begin = time.perf_counter()
        recording = run(bench)
        took = time.perf_counter() - begin
        # every sample of the loop is seen; a protocol keeps those of the steps that it records
        done = recording.meta["steps"][-1]["end"]
        values.append(done * rate * len(recording.channels) / took)
        speeds.append(done / took)
    return statistics.median(values), statistics.median(speeds), len(recording.channels)


def main() -> None:
    """Print a line per sample rate, or all as one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of lines")
    given = parser.parse_args()
    rows = []
    for rate in (1000.0, 5000.0):
        values, speed, channels = measured(rate, given.runs)
        rows.append({"sample_rate": rate, "values_per_second": values, "real_time": speed, "channels": channels})
        if not given.json:
            print(f"{rate:.0f} samples/s: {values:.3g} values/s of {channels} channels, {speed:.2f} x real time")
    if given.json:
        print(json.dumps(rows))


if __name__ == "__main__":
    main()
