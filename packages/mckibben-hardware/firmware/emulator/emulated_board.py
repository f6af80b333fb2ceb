"""An Arduino Uno in simavr behind a pseudo-terminal, its pins connected to a machine of counts.

The image is the one that a board gets (`make uno`); the emulator (`make emulator`) executes it instruction by instruction.
"""

import contextlib
import json
import os
import subprocess
import threading
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FIRMWARE = Path(__file__).parents[1]
IMAGE, EMULATOR = FIRMWARE / "build" / "uno.hex", FIRMWARE / "build" / "emulator-uno"
CHANNELS = ("pressure", "tension", "valve_pressure")  # at the pins A0, A1 and A2
MOTOR_REST = 512
FREQUENCY = 16e6  # of the processor [1/s]
Outputs = tuple[int, int, bool]


class EmulatedBoard:
    """What stands behind the port of an emulated board.

    Attributes:
        port: name of the pseudo-terminal for the host.
        outputs: counts of valve and motor, and whether the shut-off was open, for each period of all runs.
        report: what the emulator measured, in cycles, once it has ended.
    """

    def __init__(self, machine: Any, port: str) -> None:
        self.machine, self.port = machine, port
        self.outputs: list[Outputs] = []
        self.report: dict[str, int] = {}
        self.failed: Exception | None = None
        self._places = [list(machine.names).index(n) if n in machine.names else None for n in CHANNELS]

    def answer(self, words: list[str]) -> str:
        """Advance the machine as the emulator says, and return the counts of pins and encoder."""
        if words[0] == "start":
            self.machine.period = int(words[1]) * 1e-9
        else:
            valve, motor, opened = map(int, words[1:])
            self.outputs.append((valve, motor, bool(opened)))
            self.machine.advance(valve, motor, bool(opened))
        counts, encoder = self.machine.sample()
        pins = [0 if place is None else int(counts[place]) for place in self._places]
        return f"{pins[0]} {pins[1]} {pins[2]} {int(encoder)}\n"


def addresses_of_tasks(image: Path) -> list[str]:
    """Words for the emulator that name the two functions of the main program; none where the linked program is missing."""
    linked = image.with_suffix(".elf")
    if not linked.is_file():
        return []
    names = subprocess.run(["avr-nm", str(linked)], capture_output=True, text=True, check=True).stdout
    address = {name: int(number, 16) for number, _, name in (line.split() for line in names.splitlines())}
    return [f"tick={address['bench_tick']}", f"receive={address['bench_receive']}"]


@contextlib.contextmanager
def emulated(
    machine: Any, *, fault: str = "", patience: float = 2.0, image: Path = IMAGE, emulator: Path = EMULATOR
) -> Iterator[EmulatedBoard]:
    """Run a board with a machine behind its pins.

    Args:
        machine: a `device.DeviceMachine` with converters of 10 bits.
        fault: what fails and at which sample, such as ``power@100``; the kinds are those of ``uno.c``.
        patience: time for which the board's time stands still while the host computes [s].
        image: program of the board.
        emulator: program that executes it.
    """
    line, other = os.openpty()
    tty.setraw(other)
    words = [str(emulator), str(image), str(line), f"patience={round(patience * 1e3)}"]
    words += addresses_of_tasks(image)
    words += [f"fault={fault}"] if fault else []
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, pass_fds=[line])
    assert process.stdin is not None and process.stdout is not None
    board = EmulatedBoard(machine, os.ttyname(other))
    ask, answer = process.stdout, process.stdin

    def serve() -> None:
        for request in ask:
            if request.startswith("report "):
                board.report = json.loads(request.removeprefix("report "))
                return
            try:
                reply = board.answer(request.split())
            except Exception as error:  # told to whoever waits for the board
                board.failed = error
                process.kill()
                return
            with contextlib.suppress(OSError, ValueError):  # closed: then it only reports
                answer.write(reply)
                answer.flush()

    thread = threading.Thread(target=serve, name="emulated board", daemon=True)
    thread.start()
    try:
        yield board
    finally:
        with contextlib.suppress(OSError):
            answer.close()
        thread.join(10.0)
        if process.poll() is None and not board.report:
            process.kill()
        process.wait()
        ask.close()
        os.close(line)
        os.close(other)
    if board.failed is not None:
        raise board.failed
