"""The image of the Arduino Uno, executed in simavr: its samples are those of its pins, and whatever fails, it vents."""

import shutil
import subprocess
import sys
import time
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
from emulated_board import MOTOR_REST, EmulatedBoard, emulated  # noqa: E402

PERIOD = 4e-3
REST = (0, MOTOR_REST, True)
FAULT_AT = 20


def counting() -> CountingChannels:
    return CountingChannels(10, (5, 3, 7), (0, 5, 1000))


def command(k: int) -> tuple[int, int, bool]:
    return 1 + 37 * k % 1023, 11 * k % 1024, k % 7 != 0


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The image and the emulator, built once."""
    for tool, package in (("avr-gcc", "gcc-avr avr-libc"), ("cc", "gcc"), ("make", "make")):
        if shutil.which(tool) is None:
            pytest.skip(f"no {tool}: the image of the Uno needs it (Debian: {package})")
    if not Path("/usr/include/simavr/sim_avr.h").is_file():
        pytest.skip("no simavr: the image of the Uno is executed in it (Debian: libsimavr-dev)")
    out = tmp_path_factory.mktemp("uno")
    made = subprocess.run(
        ["make", "-C", str(FIRMWARE), f"OUT={out}", "uno", "emulator"], capture_output=True, text=True
    )
    assert made.returncode == 0, made.stderr
    return {"image": out / "uno.hex", "emulator": out / "emulator-uno"}


@contextmanager
def board(built: dict[str, Path], **options: Any) -> Iterator[tuple[SerialHardware, EmulatedBoard]]:
    with emulated(counting(), **built, **options) as one:
        hardware = SerialHardware(one.port, watchdog=5, timeout=0.3)
        try:
            yield hardware, one
        finally:
            hardware.close()


def test_every_sample_is_that_of_the_pins_and_every_command_reaches_them(built: dict[str, Path]) -> None:
    twin, samples = counting(), 220
    with board(built) as (hardware, one):
        assert hardware.welcome.firmware == "mckibben uno 1"
        hardware.start(PERIOD)
        for k in range(samples):
            hardware.wait(k)
            assert (list(hardware.counts), hardware.edges) == twin.sample()
            hardware.write(*command(k)[:2], opened=command(k)[2])
            twin.advance(*command(k))
        assert hardware.statistics[:3] == (samples, 0, 0)
    assert one.outputs[: samples - 1] == [command(k) for k in range(samples - 1)]
    assert one.report["starts"] == 1
    assert one.report["late_outputs"] == 0
    assert one.report["jitter"] == 0  # cycles, of the first conversion; an interrupt before it would delay it
    # Whoever changes the firmware sees when a sample no longer fits into the shortest period, 32000 cycles.
    assert one.report["period"] - one.report["idle_least"] < 32_000
    assert one.report["free_memory"] > 200  # bytes between stack and data, for interrupts that come at the worst time


@pytest.mark.parametrize(
    "fault", ["power", "brown-out", "hang", "converter-stopped", "converter-stuck", "encoder-skips", "line"]
)
def test_what_fails_vents(built: dict[str, Path], fault: str) -> None:
    with board(built, fault=f"{fault}@{FAULT_AT}", patience=0.05) as (hardware, one):
        hardware.start(PERIOD)
        with pytest.raises(LineLostError):
            for k in range(FAULT_AT + 100):
                hardware.wait(k)
                hardware.write(600, 700, opened=False)
        # The host may lose its patience on a busy computer before the board has computed its next period.
        deadline = time.monotonic() + 10.0
        while REST not in one.outputs[FAULT_AT:] and time.monotonic() < deadline:
            time.sleep(0.01)
    assert one.outputs[FAULT_AT - 1] == (600, 700, False)
    assert REST in one.outputs[FAULT_AT:]
    after = one.outputs[FAULT_AT:].index(REST)
    # Five periods of the watchdog and one to notice are the longest, where the host is what fails.
    assert after <= 6
    assert set(one.outputs[FAULT_AT + after :]) == {REST}
    # The processor's watchdog restarts a board whose timer has stopped, and no other.
    assert one.report["starts"] == (2 if fault == "hang" else 1)


def test_the_shortest_period_leaves_time_and_is_kept(built: dict[str, Path]) -> None:
    with board(built) as (hardware, one):
        hardware.start(hardware.welcome.shortest * 1e-9)
        for k in range(100):
            hardware.wait(k)
            hardware.write(1, MOTOR_REST)
    assert one.report["period"] == 32_000
    assert one.report["idle_least"] > 3_200  # a tenth of the period is left when every answer comes at once
    assert one.report["jitter"] < 160  # cycles; the longest interrupt, far below the 832 of a conversion


def test_a_run_that_would_wait_for_its_host_is_refused(built: dict[str, Path]) -> None:
    with emulated(counting(), **built) as one:
        hardware = SerialHardware(one.port, lock_step=True)
        hardware.start(PERIOD)
        with pytest.raises(LineLostError, match="cannot be read"):
            hardware.wait(0)
        hardware.close()
