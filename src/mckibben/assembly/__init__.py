"""Joining: muscle, circuit, load and joint become one state equation; nothing here integrates."""

from .._lazy import lazy_submodules

lazy_submodules(__name__)
