"""Joining: muscle, circuit, load and joint become one state equation; nothing here integrates."""

from typing import TYPE_CHECKING

from .._lazy import lazy_submodules

if TYPE_CHECKING:
    from . import check as check

lazy_submodules(__name__)
