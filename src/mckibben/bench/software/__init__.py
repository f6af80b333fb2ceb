"""Software of the test machine: set-points, controllers, interlocks, and processing of samples."""

from typing import TYPE_CHECKING

from ..._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from .controllers import bounded as bounded
    from .controllers import first_trim as first_trim

lazy_submodules(__name__)
lazy_names(__name__)
