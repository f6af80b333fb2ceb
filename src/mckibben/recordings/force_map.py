"""Measured static tables of length, pressure and tension: what an identification starts from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError


@dataclass(frozen=True)
class ForceMap:
    """Static points of one or more muscles of a kind; arrays of equal shape (n,), SI.

    `tension` at or below zero means that the muscle hung slack: such a point says where the law must not pull, but not
    how large the tension is, and fits leave it out.
    """

    name: str
    length: np.ndarray
    pressure: np.ndarray
    tension: np.ndarray
    rest_length: np.ndarray | None = None
    branch: np.ndarray | None = None
    diameter: np.ndarray | None = None
    remarks: tuple[str, ...] = ()  # what was left out on reading, in words

    def __len__(self) -> int:
        return len(self.length)

    @property
    def taut(self) -> np.ndarray:
        """Which points carry tension, bool (n,)."""
        return self.tension > 0.0

    @property
    def told_slack(self) -> np.ndarray:
        """Slack points at pressures that do inflate the muscle, bool (n,).

        They say that the law may not pull there. At a pressure below the lowest one with tension (of the same rest length)
        the bladder may just not be filled, and nothing is said about the braid.
        """
        rest = np.zeros(len(self)) if self.rest_length is None else self.rest_length
        told = np.zeros(len(self), bool)
        for one in np.unique(rest):
            same = rest == one
            filled = self.pressure[same & self.taut]
            told |= same & ~self.taut & (self.pressure >= (filled.min() if filled.size else np.inf))
        return told

    @property
    def largest(self) -> float:
        """Largest tension [N], to which relative errors refer."""
        return float(self.tension.max())

    def select(self, keep: np.ndarray, name: str | None = None) -> ForceMap:
        """The points where `keep` is true."""
        some = {k: None if getattr(self, k) is None else getattr(self, k)[keep] for k in _ARRAYS}
        return ForceMap(name=name or self.name, remarks=self.remarks, **some)  # type: ignore[arg-type]

    def with_rest_length(self, rest_length: float) -> ForceMap:
        """The same with one rest length for all points [m]."""
        return replace(self, rest_length=np.full(len(self), float(rest_length)))

    @property
    def contraction(self) -> np.ndarray:
        """(L0 - L)/L0; raises `InputError` where the rest length is not known."""
        if self.rest_length is None:
            raise InputError(
                "rest_length", "not given", "give the rest length, or a column rest_length", where=self.name,
                remedy="rest_length",
            )  # fmt: skip
        return 1.0 - self.length / self.rest_length


_ARRAYS = ("length", "pressure", "tension", "rest_length", "branch", "diameter")
