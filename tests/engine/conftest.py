"""Kernels of the tests are kept beside JAX's compilations, not in the user's folder."""

import os
from pathlib import Path

os.environ.setdefault("MCKIBBEN_KERNELS", str(Path(__file__).parents[2] / ".pytest_cache" / "kernels"))
