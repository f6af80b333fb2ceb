"""Compare a protocol on the simulated rig, Python's device and an emulated board, sample by sample; then let things fail.

make uno emulator && python emulator/compare.py
make emulator-stm32f405 && python emulator/compare.py stm32f405
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import emulated_board as uno
import emulated_stm32f405 as stm32f405
import numpy as np

import mckibben as mk
from mckibben.bench import prepare as preparation
from mckibben.bench.hardware.connect import connected
from mckibben.bench.hardware.interface import Hardware
from mckibben.bench.hardware.serial_line.device import About
from mckibben.bench.hardware.serial_line.microcontroller import in_thread
from mckibben.bench.rig_file import rig
from mckibben.bench.segment import SegmentMachine, timing_of

RATE = 250.0  # [1/s]
BOARD = sys.argv[1] if len(sys.argv) > 1 else "uno"
# Of protocols that move the motor [1/s]. The Uno is too slow for the controllers of the rig, which need 1 kHz: there the
# loop runs at 400 Hz, with gains that are stable then, to compare counts; no run of the package is prepared like that.
MOTOR_RATE = 400.0 if BOARD == "uno" else 1000.0
GENTLE = {
    "control.position.kp": "500 N/m", "control.position.kd": "6 N*s/m", "control.position.ki": "5e3 N/(m*s)",
}  # fmt: skip
FAULTS = {
    "uno": ("power", "brown-out", "hang", "converter-stopped", "converter-stuck", "encoder-skips", "line"),
    "stm32f405": ("converter-stopped", "converter-stuck"),
}[BOARD]
emulated, motor_rest = {
    "uno": (uno.emulated, uno.MOTOR_REST),
    "stm32f405": (stm32f405.emulated, stm32f405.MOTOR_REST),
}[BOARD]
BITS = {
    f"{channel}.bits": "10" if BOARD == "uno" else "12"
    for channel in (
        "sensors.pressure.converter",
        "sensors.tension.converter",
        "sensors.valve_pressure.converter",
        "outputs.valve",
        "outputs.motor",
    )
}


MOTOR = (
    "sinusoids", MOTOR_RATE, {"frequency": "2 Hz" if BOARD == "uno" else "10 Hz", "cycles": 2, "precondition": 1},
)  # fmt: skip


def prepared(name: str, rate: float = RATE, **values: object):
    gentle = BOARD == "uno" and name == MOTOR[0]
    if gentle:
        preparation.CONTROL_RATE = MOTOR_RATE
    on = rig("paper", BITS | (GENTLE if gentle else {}))
    return mk.prepare(name, muscle="nylon", rig=on, sample_rate=f"{rate:g} Hz", **values)


def machine_of(bench):
    return SegmentMachine(bench, 0, next(bench.segments()), timing_of(bench)).at_interface()


@contextmanager
def on_board(bench, fault: str = "", rate: float = RATE) -> Iterator[tuple[Hardware, object]]:
    with (
        emulated(machine_of(bench), fault=fault) as board,
        connected(f"serial:{board.port}", bench.rig, 1.0 / rate, silence=5.0 / rate) as hardware,
    ):
        yield hardware, board


def measured(board) -> dict[str, int]:
    """What the emulator counted: cycles of the Uno, instructions of the STM32F405."""
    return dict(board.report) if BOARD == "uno" else {"instructions of a sample": max(board.instructions)}


def main() -> None:
    protocols = [
        ("isometric-step", RATE, {"cycles": 1, "range": "full"}),
        ("isometric-step", RATE, {"cycles": 1, "range": "half"}),
        MOTOR,
    ]
    for name, rate, values in protocols:
        bench = prepared(name, rate, **values)
        here = mk.run(bench)
        with in_thread(machine_of(bench), about=About(motor_rest=motor_rest)) as device:
            with connected(f"serial:{device.port}", bench.rig, 1.0 / rate, lock_step=True) as hardware:
                there = mk.run(bench, hardware=hardware)
        with on_board(bench, rate=rate) as (hardware, board):
            emulation = mk.run(bench, hardware=hardware)
        for channel in ("pressure", "tension", "span"):
            a, b, c = (np.asarray(r[channel]) for r in (here, there, emulation))
            other = [
                int((x[: len(y)] != y[: len(x)]).sum()) + abs(len(x) - len(y)) for x, y in ((a, b), (a, c), (b, c))
            ]
            print(
                f"{name} {channel}: {len(a)} samples; other than simulated in Python's device {other[0]}, "
                f"on the board {other[1]}; other on the board than in Python's device {other[2]}"
            )
        print(f"answers that came too late for the board: {hardware.statistics.answers_late}; {measured(board)}")
    bench = prepared("isometric-step", cycles=1, range="full")
    for fault in FAULTS:
        with on_board(bench, f"{fault}@200") as (hardware, board):
            try:
                recording = mk.run(bench, hardware=hardware)
                said = str(recording.meta["result"])
            except Exception as error:
                said = f"{type(error).__name__}: {error}"
        if BOARD == "uno":
            after = board.report.get("vented_after", 0) / uno.FREQUENCY * 1e3
            print(f"{fault}: at rest after {after:.1f} ms; last outputs {board.outputs[-1]}; {said}")
        else:
            print(f"{fault}: last outputs {board.puts[-1]}; {said}")


if __name__ == "__main__":
    main()
