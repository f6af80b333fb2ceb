"""What the package's tests share: numbers of 64 bits, and kernels in a folder of the repository, not in the user's."""

import os
from collections.abc import Iterator
from pathlib import Path

import jax
import pytest
from hypothesis import settings

from lanewise import cache

jax.config.update("jax_enable_x64", True)
settings.register_profile("suite", deadline=None, database=None, derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))
os.environ.setdefault("LANEWISE_CACHE", str(Path(__file__).parents[3] / ".pytest_cache" / "kernels"))


@pytest.fixture(scope="module", autouse=True)
def _own_cache() -> Iterator[None]:
    """Keep kernels where the package itself does; tests of an application in the same process may keep theirs elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cache, "_settings", cache.CacheSettings())
        yield
