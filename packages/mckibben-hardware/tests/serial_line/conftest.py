"""The firmware, compiled once; and devices of both kinds."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from serial_devices import Codec, Desk

FIRMWARE = Path(__file__).parents[2] / "firmware"
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")


@pytest.fixture(scope="session")
def compiler() -> str:
    found = shutil.which("cc")
    if found is None:
        pytest.skip("no C compiler (cc) to compile the firmware with")
    return found


@pytest.fixture(scope="session")
def library(compiler: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("firmware") / "libbench.so"
    sources = [str(FIRMWARE / name) for name in ("frame.c", "bench.c", "host.c")]
    done = subprocess.run(
        [compiler, *STRICT, "-O2", "-fPIC", "-shared", "-o", str(made), *sources], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return made


@pytest.fixture(scope="session")
def codec(library: Path) -> Codec:
    return Codec(library)


@pytest.fixture(params=["python", "c"])
def chosen(request: pytest.FixtureRequest) -> Path | None:
    """The state machine in Python, and that in C."""
    return None if request.param == "python" else request.getfixturevalue("library")


@pytest.fixture
def desk(chosen: Path | None) -> Callable[..., Desk]:
    return lambda **options: Desk(library=chosen, **options)
