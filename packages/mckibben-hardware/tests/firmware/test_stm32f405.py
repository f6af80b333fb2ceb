"""The program of the STM32F405, executed in QEMU: samples and commands arrive unchanged, in time, and faults vent."""

import os
import re
import shutil
import subprocess
import sys
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from counting_channels import CountingChannels

from mckibben.errors import LineLostError
from mckibben_hardware.serial_line import SerialHardware

FIRMWARE = Path(__file__).parents[2] / "firmware"
sys.path.insert(0, str(FIRMWARE / "emulator"))
from emulated_stm32f405 import (  # noqa: E402
    MOTOR_REST,
    QEMU,
    EmulatedSTM32F405,
    command_line,
    emulated,
)

REST = (0, MOTOR_REST, True)
FAULT_AT = 5
CYCLES = 33_600  # of the shortest period, 0.2 ms


def counting() -> CountingChannels:
    return CountingChannels(12, (50, 30, 70), (0, 5, 4000))


def command(k: int) -> tuple[int, int, bool]:
    return 1 + 137 * k % 4095, 111 * k % 4096, k % 7 != 0


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The image, and its twin for the emulator, built once."""
    for tool, package in (
        ("arm-none-eabi-gcc", "gcc-arm-none-eabi libnewlib-arm-none-eabi"),
        (QEMU, "qemu-system-arm"),
        ("make", "make"),
    ):
        if shutil.which(tool) is None:
            pytest.skip(f"no {tool}: the image of the STM32F405 needs it (Debian: {package})")
    out = tmp_path_factory.mktemp("stm32f405")
    words = ["make", "-C", str(FIRMWARE), f"OUT={out}", "stm32f405", "emulator-stm32f405"]
    made = subprocess.run(words, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    return {"board": out / "stm32f405.elf", "emulator": out / "emulator-stm32f405.elf"}


@contextmanager
def board(
    built: dict[str, Path], watchdog: int = 5, **options: Any
) -> Iterator[tuple[SerialHardware, EmulatedSTM32F405]]:
    with emulated(counting(), image=built["emulator"], **options) as one:
        hardware = SerialHardware(one.port, watchdog=watchdog, timeout=5.0)
        try:
            yield hardware, one
        finally:
            hardware.close()


def test_every_sample_is_that_of_the_pins_and_every_command_reaches_them(built: dict[str, Path]) -> None:
    twin, samples = counting(), 60
    with board(built, patience=10.0) as (hardware, one):
        assert hardware.welcome.firmware == "mckibben stm32f405 1"
        assert hardware.welcome.bits == (12, 12, 12)
        hardware.start(hardware.welcome.shortest * 1e-9)
        for k in range(samples):
            hardware.wait(k)
            assert (list(hardware.counts), hardware.edges) == twin.sample()
            hardware.write(*command(k)[:2], opened=command(k)[2])
            twin.advance(*command(k))
        assert hardware.statistics[:3] == (samples, 0, 0)
    assert one.outputs[: samples - 1] == [command(k) for k in range(samples - 1)]
    # A third of the cycles: a processor that needs three for each instruction would still come to an end in time.
    assert max(one.instructions[: samples - 1]) < CYCLES / 3


def test_the_shortest_period_is_kept_and_leaves_time(built: dict[str, Path]) -> None:
    with board(built, watchdog=60_000, patience=0.0) as (hardware, one):
        period = hardware.welcome.shortest
        hardware.start(period * 1e-9)
        for k in range(40):
            hardware.wait(k)
    # The emulator looks for interrupts every 50 ns or so, and its clock has a frequency of whole hertz.
    assert all(abs(interval - period) < 200 for interval in one.intervals[:39])
    assert all(period - idle < CYCLES / 3 for idle in one.idle[1:39])  # a nanosecond is an instruction


@pytest.mark.parametrize("fault", ["converter-stopped", "converter-stuck", "line"])
def test_what_fails_vents(built: dict[str, Path], fault: str) -> None:
    with board(built, patience=0.05, fault="" if fault == "line" else f"{fault}@{FAULT_AT}") as (hardware, one):
        hardware.start(4e-3)
        with pytest.raises(LineLostError, match="vented by itself" if fault == "line" else "cannot be read"):
            for k in range(FAULT_AT + 10):
                hardware.wait(k)
                if fault != "line" or k < FAULT_AT:
                    hardware.write(600, 700, opened=False)
    assert one.puts == [(600, 700, False), REST]
    # The watchdog of five samples; a converter that fails ends the run at its sample.
    assert len(one.outputs) <= FAULT_AT + (5 if fault == "line" else 1)


def test_a_run_that_would_wait_for_its_host_is_refused(built: dict[str, Path]) -> None:
    with emulated(counting(), image=built["emulator"]) as one:
        hardware = SerialHardware(one.port, lock_step=True)
        hardware.start(4e-3)
        with pytest.raises(LineLostError, match="cannot be read"):
            hardware.wait(0)
        hardware.close()


def test_a_board_without_clock_and_converter_rests_and_takes_no_sample(built: dict[str, Path], tmp_path: Path) -> None:
    """The image of the board itself: the emulator has nothing at the addresses of most peripherals, and logs the writes."""
    log = tmp_path / "log"
    line, other = os.openpty()
    tty.setraw(other)
    words = [*command_line(built["board"], line), "-d", "unimp", "-D", str(log)]
    process = subprocess.Popen(words, stdin=subprocess.DEVNULL, pass_fds=[line])
    os.close(line)
    try:
        hardware = SerialHardware(os.ttyname(other), timeout=5.0)
        assert hardware.welcome.firmware == "mckibben stm32f405 1, self-test failed: crystal does not oscillate"
        hardware.start(4e-3)
        with pytest.raises(LineLostError, match="cannot be read"):
            hardware.wait(0)
        hardware.close()
    finally:
        process.terminate()
        process.wait()
        os.close(other)
    writes = [
        (match["device"], int(match["offset"], 16), int(match["value"], 16))
        for match in re.finditer(
            r"(?P<device>\S+): unimplemented device write \(size 4, offset (?P<offset>\w+), value (?P<value>\w+)\)",
            log.read_text(),
        )
    ]
    # The outputs' pins become the timer's after their counts are those of rest, which they keep in a run that fails.
    valve, motor = (writes.index(("GPIOC", 0, 2 << 2 * pin)) for pin in (8, 9))
    assert ("timer[8]", 0x3C, 0) in writes[:valve]
    assert ("timer[8]", 0x40, MOTOR_REST) in writes[:motor]
    assert {value for device, offset, value in writes if (device, offset) == ("timer[8]", 0x3C)} == {0}
    assert {value for device, offset, value in writes if (device, offset) == ("timer[8]", 0x40)} == {MOTOR_REST}
    # Then the watchdog starts, and is fed; the emulator takes its addresses for those of another device.
    keys = [value for device, offset, value in writes if (device, offset) == ("I2S2ext", 0)]
    assert keys[:2] == [0xCCCC, 0x5555]
    assert set(keys[2:]) == {0xAAAA}
    assert len(keys) > 10
    assert writes.index(("I2S2ext", 0, 0xCCCC)) > motor
