"""Test rigs, simulated and real, and the runs on them and on circuits."""

from .._lazy import lazy_submodules

lazy_submodules(__name__)
