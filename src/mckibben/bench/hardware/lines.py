"""What a loop reads from a machine and writes to it, held until `send`: the small parts of every `interface.Hardware`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import index

from ...errors import InputError

LARGEST = 2**32 - 1  # count that a line carries


class AnalogInputs:
    """The newest counts of the channels."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self.counts: Sequence[int] = (0,) * len(self.names)

    def read(self) -> Sequence[int]:
        """Counts of the newest sample, in the order of the names."""
        return self.counts


class EdgeCounter:
    """The newest count of the encoder."""

    def __init__(self) -> None:
        self.count = 0

    def read(self) -> int:
        """Count at the newest sample, with its sign."""
        return self.count


class MotorOutput:
    """The count to be sent to the motor; at first that at which it does nothing."""

    def __init__(self, rest: int) -> None:
        self.count = rest

    def write(self, count: int) -> None:
        """Put a count; it takes effect with `send`.

        Raises:
            InputError: if it is none.
        """
        self.count = _count("motor", count)


class ValveOutput:
    """The count to be sent to the valve, and whether the shut-off is open; `tell` is called when it is to vent at once."""

    def __init__(self, tell: Callable[[], object] = lambda: None) -> None:
        self.count, self.opened, self.vented = 0, True, False
        self._tell = tell

    def write(self, count: int, *, opened: bool = True) -> None:
        """Put a count, and whether the shut-off is open; they take effect with `send`.

        Raises:
            InputError: if it is none.
        """
        self.count, self.opened = _count("valve", count), bool(opened)

    def vent(self) -> None:
        """Count zero and an open shut-off at once, whatever is written until the next start; from any thread."""
        self.vented = True
        self._tell()


def _count(field: str, value: int) -> int:
    try:
        count = index(value)
    except TypeError:
        count = -1
    if not 0 <= count <= LARGEST:
        raise InputError(field, value, f"allowed is a count from 0 to {LARGEST}")
    return count
