"""Figures, in the colours of the quantities; no other package draws."""

from ..._lazy import lazy_submodules

lazy_submodules(__name__)
