"""Complete studies of one question each, with fixed inputs and seeds."""

from .._lazy import lazy_submodules

lazy_submodules(__name__)
