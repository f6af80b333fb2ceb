"""What all tests share, those of the packages too: the same examples in every run, and compilations, which are kept.

Most of the suite's time is compilation, and every worker and every command line that a test starts would compile alike.
"""

import ctypes
import gc
import importlib.util
import os
import platform
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

# The same examples in every run of the same code; who looks for new ones sets HYPOTHESIS_PROFILE=default.
settings.register_profile("suite", deadline=None, database=None, derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))

# One folder per machine, for it holds machine code; it is not in version control. Read by JAX when it is first imported.
CACHE = Path(__file__).with_name(".pytest_cache") / f"jax-{platform.node()}"
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(CACHE))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
# The kernels of the packages, for the tests and all that they start, where a test takes no folder of its own.
for name in ("MCKIBBEN_KERNELS", "LANEWISE_CACHE"):
    os.environ.setdefault(name, str(CACHE.with_name("kernels")))
# What a script runs in the background ignores interrupts, and so would every program that a test starts and interrupts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
KEPT = 7 * 86400.0  # [s]; changed sources leave behind what nothing asks for again


def pytest_sessionstart(session: pytest.Session) -> None:
    """Drop old compilations, once per run."""
    if not hasattr(session.config, "workerinput"):
        for entry in CACHE.glob("*-cache"):
            if time.time() - entry.stat().st_mtime > KEPT:
                entry.unlink(missing_ok=True)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """A file goes to one worker, as with `--dist loadfile`: its tests share what is traced and compiled."""
    from xdist.scheduler import LoadFileScheduling

    return LoadFileScheduling(config, log) if config.getoption("dist") == "load" else None


LARGEST = 1.2e9  # resident memory above which a worker drops its compiled programs between two files [bytes]


@pytest.fixture(scope="module", autouse=True)
def _drop_compiled_programs() -> Iterator[None]:
    """Drop what JAX compiled for a file, once a worker has grown: no later file asks for it, and it adds up to 5 GB."""
    yield
    if (jax := sys.modules.get("jax")) is not None and _resident_memory() > LARGEST:
        jax.clear_caches()
        gc.collect()
        if sys.platform == "linux":
            ctypes.CDLL(None).malloc_trim(0)


def _resident_memory() -> float:
    """Resident memory of this process [bytes]; infinite where the system does not say."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return float("inf")


@pytest.fixture(scope="session", autouse=True)
def _stages_in_a_loop() -> Iterator[None]:
    """The stages of Runge-Kutta in a loop: a third of the compilation; one test shows that they are the same."""
    if importlib.util.find_spec("mckibben") is None:  # tests of the compiler alone
        yield
        return
    from mckibben.engine import step

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(step, "UNROLLED", 0)
        yield
