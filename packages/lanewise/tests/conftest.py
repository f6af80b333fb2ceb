"""What the package's tests share: numbers of 64 bits, the same examples in every run, kernels where the package keeps them.

The examples are said again, for whoever runs these tests from the package's source archive.
"""

import os
from collections.abc import Iterator

import jax
import pytest
from hypothesis import settings

from lanewise import cache

jax.config.update("jax_enable_x64", True)
settings.register_profile("suite", deadline=None, database=None, derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))


@pytest.fixture(scope="module", autouse=True)
def _own_cache() -> Iterator[None]:
    """Keep kernels where the package itself does; tests of an application in the same process may keep theirs elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cache, "_settings", cache.CacheSettings())
        yield
