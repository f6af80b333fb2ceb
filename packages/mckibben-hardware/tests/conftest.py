"""What the package's tests share: short runs of the bench's tests, the same examples in every run, kept compilations."""

import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

REPOSITORY = Path(__file__).parents[3]
sys.path.append(str(REPOSITORY / "tests" / "bench"))  # `short_runs`: a real machine runs what the simulated one runs
settings.register_profile("suite", deadline=None, database=None, derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))
KEPT = REPOSITORY / ".pytest_cache"  # machine code: a folder per machine
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(KEPT / f"jax-{platform.node()}"))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
os.environ.setdefault("MCKIBBEN_KERNELS", str(KEPT / "kernels"))


@pytest.fixture(scope="session", autouse=True)
def _stages_in_a_loop() -> Iterator[None]:
    """The stages of Runge-Kutta in a loop, as in all tests of this repository: a third of the compilation."""
    from mckibben.engine import step

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(step, "UNROLLED", 0)
        yield
