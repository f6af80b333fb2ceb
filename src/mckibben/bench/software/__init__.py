"""Software of the test machine: set-points, controllers, interlocks, and processing of samples."""

from ..._lazy import lazy_submodules

lazy_submodules(__name__)
