"""Another try for what was made ready beside other things.

Several threads of one server trace and compile at the same time. Now and then the interpreter itself trips over that (a
``SystemError`` of a tuple that is still being built); the same work, done again, is done.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from ...errors import MckibbenError

TRIES = 3
Made = TypeVar("Made")


def again(make: Callable[[], Made]) -> Made:
    """What `make` returns; what it raises on purpose is raised at once, anything else after `TRIES`."""
    for left in reversed(range(TRIES)):
        try:
            return make()
        except MckibbenError:
            raise
        except Exception:
            if not left:
                raise
    raise AssertionError("TRIES is above zero")
