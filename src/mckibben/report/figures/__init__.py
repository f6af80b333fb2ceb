"""The only place that draws: figures from values, in the colours of the quantities."""

from ..._lazy import lazy_submodules

lazy_submodules(__name__)
