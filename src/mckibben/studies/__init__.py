"""Complete studies of one question each, with fixed inputs and seeds."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from .design import design_study as design_study

lazy_submodules(__name__)
lazy_names(__name__)
