"""An STM32F405 in QEMU behind a pseudo-terminal, its converters and outputs connected to a machine of counts.

The program is that of the board (`make stm32f405`) except for the peripherals that QEMU has no model of
(`make emulator-stm32f405`): processor, interrupts, timer of the samples and serial port are QEMU's.
"""

import contextlib
import os
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from emulated_board import FIRMWARE, EmulatedBoard, Outputs

IMAGE = FIRMWARE / "build" / "emulator-stm32f405.elf"
QEMU = "qemu-system-arm"
MACHINE = "netduinoplus2"  # the board of QEMU 7.2 that has an STM32F405; newer ones also have olimex-stm32-h405
MOTOR_REST = 2048
REFERENCE = 1502  # 1.21 V in counts of 3.3 V
LOW_SUPPLY = 1709  # and of 2.9 V
REST = (0, MOTOR_REST, True)
SLEEPS = "icount sleep disabled and no active timers"  # what QEMU says where the board waits for its host
PUMP = 10e-3  # after the last edge of `alive` the dump valve opens [s]
HOST_FAULTS = ("line", "host", "encoder-jammed")  # which the board does not find by itself, or only by its watchdog


class EmulatedSTM32F405(EmulatedBoard):
    """What stands behind the port of an emulated STM32F405.

    Attributes:
        puts: counts of valve and motor, and whether the shut-off was open, whenever they changed.
        pins_after: from the fault to outputs at rest [s]; None if they are not.
        pump_after: from the fault to the time at which the pump on `alive` has run empty [s]; None while it does not.
        intervals: between the ticks of samples, of the board's time [ns].
        idle: time that the processor slept in each [ns].
        instructions: of `bench_tick` and `bench_receive` in each.
    """

    def __init__(self, machine: Any, port: str, fault: str) -> None:
        super().__init__(machine, port)
        kind, _, number = fault.partition("@")
        self._fault, self._fault_at = kind, int(number or 0)
        self._samples = 0
        self._jammed: str | None = None
        self.puts: list[Outputs] = []
        self.pins_after: float | None = None
        self.pump_after: float | None = None
        self._time = 0  # of the board at the newest sample [ns]
        self.waiting_since: float | None = None  # when the newest sample was asked for, by the wall clock [s]
        self.intervals: list[int] = []
        self.idle: list[int] = []
        self.instructions: list[int] = []

    def _since_fault(self, nanoseconds: int) -> float:
        """Time from the sample of the fault to one of the board's [ns], whose clock wraps and stands between samples [s]."""
        since_sample = (nanoseconds - self._time + 2**31) % 2**32 - 2**31
        return (self._samples - 1 - self._fault_at) * self.machine.period + 1e-9 * since_sample

    def answer(self, words: list[str]) -> str:
        """Advance the machine as the emulator says, and return the counts of channels, reference and encoder."""
        failed = self._fault if self._fault and self._samples > self._fault_at else ""
        if words[0] == "outputs":
            valve, motor, opened, at, edge = map(int, words[1:])
            self.puts.append((valve, motor, bool(opened)))
            if failed and self.puts[-1] == REST and self.pins_after is None:
                if failed != "hang":  # then only the host has told it to
                    self.pins_after = self._since_fault(at)
                if failed not in (*HOST_FAULTS, "hang"):  # the run is over, and so are the edges
                    self.pump_after = max(0.0, self._since_fault(edge)) + PUMP
            return ""
        if words[0] == "hung":
            self.pump_after = max(0.0, self._since_fault(int(words[2]))) + PUMP
            return ""
        if words[0] == "step":
            for measured, word in zip((self.intervals, self.idle, self.instructions), words[4:7], strict=True):
                measured.append(int(word))
            self._time = int(words[7])
        *pins, encoder = super().answer(words[:4]).split()
        failed = self._fault if self._fault and self._samples >= self._fault_at else ""
        self._samples += 1
        self.waiting_since = time.monotonic()
        if failed == "encoder-jammed":
            self._jammed = encoder if self._jammed is None else self._jammed
            encoder = self._jammed
        if failed == "converter-stopped":
            return "\n"
        reference = {"converter-stuck": 0, "brown-out": LOW_SUPPLY}.get(failed, REFERENCE)
        return f"{' '.join(pins)} {reference} {encoder} {int(failed == 'hang')}\n"


def command_line(image: Path, line: int, *words: str) -> list[str]:
    """QEMU with a program, the serial port at an open file, and the words that the program reads."""
    semihosting = ",".join(f"arg={word}" for word in words)
    arguments = [QEMU, "-M", MACHINE, "-kernel", str(image), "-display", "none", "-monitor", "none"]
    arguments += [
        "-icount",
        "shift=0,sleep=off",
        "-add-fd",
        f"fd={line},set=1",
        "-chardev",
        "serial,id=line,path=/dev/fdset/1",
    ]
    arguments += ["-serial", "null", "-serial", "null", "-serial", "chardev:line"]
    if words:
        arguments += ["-semihosting-config", f"enable=on,target=native,{semihosting}"]
    return arguments


@contextlib.contextmanager
def emulated(
    machine: Any, *, fault: str = "", patience: float = 10.0, image: Path = IMAGE, trace: Path | None = None
) -> Iterator[EmulatedSTM32F405]:
    """Run a board with a machine behind its pins.

    Args:
        machine: a `device.DeviceMachine` with converters of 12 bits.
        fault: what fails and from which sample on, such as ``converter-stuck@100`` or ``converter-stopped@100``.
        patience: time for which the board's time stands still while the host computes [s]; 0: it never does, and
            is that of the instructions alone.
        image: program of the board.
        trace: file to write the address of each instruction to.
    """
    line, other = os.openpty()
    tty.setraw(other)
    answers, answer = os.pipe()
    request, requests = os.pipe()
    words = ("board", f"/dev/fd/{answers}", f"/dev/fd/{requests}", str(int(patience > 0.0)))
    logged = [] if trace is None else ["-singlestep", "-d", "exec,nochain", "-D", str(trace)]
    process = subprocess.Popen(
        [*command_line(image, line, *words), *logged],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        pass_fds=[line, answers, requests],
    )
    for end in (answers, requests, line):
        os.close(end)
    board = EmulatedSTM32F405(machine, os.ttyname(other), fault)

    def serve() -> None:
        with open(request, encoding="ascii") as ask:
            for words in ask:
                try:
                    reply = board.answer(words.split())
                    os.write(answer, reply.encode())
                except BrokenPipeError:
                    return
                except Exception as error:  # told to whoever waits for the board
                    board.failed = error
                    process.kill()
                    return

    def go_on() -> None:
        """Send an empty frame in the place of a host that has not answered for the patience."""
        while not ended.wait(patience / 2.0):
            since = board.waiting_since
            if since is not None and time.monotonic() - since > patience:
                os.write(other, b"\0")

    ended = threading.Event()
    threads = [threading.Thread(target=serve, name="emulated board", daemon=True)]
    if patience > 0.0:
        threads.append(threading.Thread(target=go_on, name="patience of the board", daemon=True))
    for thread in threads:
        thread.start()
    try:
        yield board
    finally:
        ended.set()
        process.kill()
        said = process.communicate()[1]
        for thread in threads:
            thread.join(10.0)
        os.close(answer)
        os.close(other)
        sys.stderr.writelines(words for words in said.splitlines(True) if SLEEPS not in words)
    if board.failed is not None:
        raise board.failed
