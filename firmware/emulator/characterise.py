"""Characterise a muscle on an emulated STM32F405, as `mckibben characterise --on` does on a board, and on a simulated rig.

make emulator-stm32f405 && python emulator/characterise.py FOLDER

A second of the board takes about eight here, so that the whole takes an hour; the same command goes on with the first stage
that has no recording in the folder. The Uno samples every 2 ms at best, and a loop that moves the motor needs 1 ms.
"""

import sys
import time
from pathlib import Path

import emulated_stm32f405 as stm32f405
import numpy as np

import mckibben as mk
from mckibben.assembly.build import unit_from_specimen
from mckibben.bench.hardware.serial_line import SerialHardware
from mckibben.bench.rig_file import rig
from mckibben.bench.segment import SegmentMachine
from mckibben.bench.session.setup import ManualSetup
from mckibben.recordings.files import read_recording
from mckibben.specimens import muscle_specimen

REST, PLUMBING = 0.14, "tight"
BITS = {
    f"{channel}.bits": "12"
    for channel in (
        "sensors.pressure.converter",
        "sensors.tension.converter",
        "sensors.valve_pressure.converter",
        "outputs.valve",
        "outputs.motor",
    )
}
OPTIONS = {"rest_length": REST, "max_pressure": "5 bar", "plumbing": PLUMBING, "laws": ["linear_threshold", "sarosi"]}
PATIENCE = 60.0  # of the host for a board that stands still because the computer is busy [s]


def main() -> None:
    on, folder = rig("modern", BITS), Path(sys.argv[1])
    setup = ManualSetup(on, span=REST, muscle=unit_from_specimen(muscle_specimen("nylon")), plumbing=PLUMBING)
    machine = SegmentMachine(setup.prepared, 0, setup.segment, setup.timing).at_interface()
    begin, named = time.monotonic(), [""]

    def tell(done: float, total: float, stage: str) -> None:
        if stage != named[0]:
            named[0] = stage
            print(f"{time.monotonic() - begin:.0f} s: {stage}, {done:.0f} of {total:.0f} s of machine time", flush=True)

    with stm32f405.emulated(machine) as board:
        hardware = SerialHardware(board.port, watchdog=20, timeout=PATIENCE)
        try:
            there = mk.characterise(on, hardware=hardware, out=folder / "board", progress=tell, **OPTIONS)
        finally:
            print(f"{time.monotonic() - begin:.0f} s; {hardware.statistics}")
            hardware.close()
    here = mk.characterise(on, muscle="nylon", out=folder / "simulated", **OPTIONS)
    for name, found in (("board", there), ("simulated", here)):
        print(name, found, found.estimates)
    lengths = np.linspace(0.11, 0.138, 8)
    for pressure in (2e5, 4e5):
        a, b = (np.asarray(found.muscle.tension(lengths, pressure)) for found in (there, here))
        print(f"{pressure / 1e5:g} bar: tensions differ by {np.abs(a - b).max():.2f} N of {b.max():.1f} N at most")
    for place in sorted((folder / "board").glob("*.nc")):
        a, b = (read_recording(folder / which / place.name) for which in ("board", "simulated"))
        n = min(len(a.time), len(b.time))
        print(
            place.name,
            {k: f"rms {np.sqrt(np.mean((a[k][:n] - b[k][:n]) ** 2)):.3g}" for k in ("tension", "pressure", "span")},
        )


if __name__ == "__main__":
    main()
