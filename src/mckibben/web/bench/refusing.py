"""What may not be done to the test machine as it is now, each with a sentence that says what may."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ...errors import InputError

if TYPE_CHECKING:
    from .by_hand import ByHand, Real
    from .going import Going


class Refusing:
    """Asked before anything is done.

    Attributes:
        going: the run that goes on.
        hand: the machine by hand.
        real: the real machine; None: a simulated one.
        why: of a stop that stays until it is reset.
    """

    going: Going | None
    hand: ByHand | None
    real: Real | None
    why: str

    def _simulated(self, what: str, otherwise: str = "a real machine has its own time; allowed is stop") -> None:
        if self.real is not None:
            raise InputError(what, "refused", otherwise)

    def _still(self, what: str) -> None:
        if self.going is not None:
            raise InputError(what, "refused", f"{self.going.bench.protocol.name} is running; stop it first")

    def _may(self, what: str) -> None:
        self._still(what)
        if self.why:
            raise InputError(what, "refused", f"the machine is stopped ({self.why}); reset it first")

    def _goes(self, what: str) -> Going:
        if self.going is None:
            raise InputError(what, "refused", "nothing is running")
        if self.going.button():
            raise InputError(what, "refused", "the run is being stopped")
        return self.going

    def _by_hand(self, what: str, wanted: Mapping[str, Any]) -> ByHand:
        if self.going is not None:
            names = " and ".join(wanted) or "set-points"
            raise InputError(what, "refused", f"the protocol sets the {names}; stop the run first")
        self._may(what)
        assert self.hand is not None
        return self.hand
