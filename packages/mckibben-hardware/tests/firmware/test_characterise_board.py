"""``mckibben characterise --on`` at the ports of the emulated boards."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).parents[2] / "firmware"
sys.path.insert(0, str(FIRMWARE / "emulator"))


def need(*tools: tuple[str, str]) -> None:
    for tool, package in tools:
        if shutil.which(tool) is None:
            pytest.skip(f"no {tool}: the emulated board needs it (Debian: {package})")


@pytest.fixture(scope="module")
def uno(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Image and emulator of the Uno."""
    need(("avr-gcc", "gcc-avr avr-libc"), ("make", "make"), ("cc", "gcc"))
    if not Path("/usr/include/simavr/sim_avr.h").exists():
        pytest.skip("no simavr: the emulated board needs it (Debian: libsimavr-dev)")
    out = tmp_path_factory.mktemp("uno")
    made = subprocess.run(
        ["make", "-C", str(FIRMWARE), f"OUT={out}", "uno", "emulator"], capture_output=True, text=True
    )
    assert made.returncode == 0, made.stderr
    return {"image": out / "uno.hex", "emulator": out / "emulator-uno"}


@pytest.mark.slow
def test_the_command_moves_the_board_and_ctrl_c_vents_it(uno: dict[str, Path], tmp_path: Path) -> None:
    import characterise_board

    begun = characterise_board.on_board("uno", tmp_path / "uno", samples=300, **uno)
    assert begun["samples"] >= 300
    assert begun["vented"]
    assert not list(tmp_path.glob("uno/*.nc"))  # the first stage was not at its end


@pytest.mark.slow
@pytest.mark.parametrize("board", ["uno", "stm32f405"])
def test_a_board_finds_the_muscle_of_the_simulated_rig(board: str, tmp_path: Path) -> None:
    """Everything to the end: 7 min of the board, about as long of the computer."""
    import characterise_board

    if board == "uno":
        need(("avr-gcc", "gcc-avr avr-libc"))
    else:
        need(("arm-none-eabi-gcc", "gcc-arm-none-eabi"), ("qemu-system-arm", "qemu-system-arm"))
    subprocess.run(["make", "-s", "-C", str(FIRMWARE), *characterise_board.MAKE[board]], check=True)
    found = characterise_board.compare(board, tmp_path)
    # Half the width of the interval that either states of a tension of its own.
    assert found["tension_apart_rms"] < found["half_width"]
    assert found["vented"]
