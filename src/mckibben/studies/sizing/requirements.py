"""Requirements of a muscle, and shortfalls of candidates."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...components import Environment
from ...errors import InputError
from ...quantities import SMALLEST, parse, with_unit

# Of every part of a wish: SI unit, above what, up to what.
ALLOWED: dict[str, tuple[str, float, float]] = {
    "force": ("N", 0.0, 1e6),
    "stroke": ("m", 0.0, 10.0),
    "pressure": ("Pa", 0.0, 20e5),
    "length": ("m", 0.0, 100.0),
    "diameter": ("m", 0.0, 10.0),
    "speed": ("m/s", 0.0, 100.0),
    "frequency": ("Hz", 0.0, 1e3),
    "tube_length": ("m", 0.0, 100.0),
    "working_time": ("s", 0.0, 86400.0),
}


@dataclass(frozen=True)
class Requirements:
    """Requirements of a muscle; None stands for no requirement.

    Attributes:
        force: with which it still pulls at the end of the stroke, while it shortens [N].
        stroke: by which it shortens [m].
        pressure: gauge pressure at which it does so [Pa].
        length: largest overall length, fittings included [m].
        diameter: largest outer diameter, when contracted [m].
        speed: at which it shortens with that force [m/s].
        frequency: frequency of working cycles [1/s].
        tube_length: between valve and muscle [m].
        working_time: time for which it works each day [s]; needs a frequency.
        environment: the room.
    """

    force: float
    stroke: float
    pressure: float
    length: float | None = None
    diameter: float | None = None
    speed: float | None = None
    frequency: float | None = None
    tube_length: float = 0.5
    working_time: float | None = None
    environment: Environment = Environment()

    def __post_init__(self) -> None:
        """Refuse values that are not finite, or unreasonable."""
        for name, (unit, low, high) in ALLOWED.items():
            value = getattr(self, name)
            if value is None:
                continue
            if not (math.isfinite(value) and max(low, SMALLEST) < value <= high):
                allowed = f"must be above {with_unit(low, unit)}, up to {with_unit(high, unit)}"
                raise InputError(name, with_unit(value, unit), allowed)
        if self.length is not None and self.length <= self.stroke:
            raise InputError(
                "length", with_unit(self.length, "m"), f"must be more than the stroke, {with_unit(self.stroke, 'm')}"
            )

        if self.working_time is not None and self.frequency is None:
            raise InputError("working_time", None, "needs a frequency of cycles, such as '1 Hz'")

    def parts(self) -> dict[str, float]:
        """Required values by name [SI]."""
        return {n: v for n in ALLOWED if (v := getattr(self, n)) is not None}


def parse_space(text: str) -> tuple[float, float | None]:
    """Length and diameter of ``20 cm x 3 cm`` [m]; the length alone if there is no x.

    Raises:
        InputError: it is neither.
    """
    pieces = [piece.strip() for piece in text.replace("\N{MULTIPLICATION SIGN}", "x").split("x")]
    if len(pieces) > 2 or not all(pieces):
        raise InputError("space", text, "must be a length and a diameter, such as '20 cm x 3 cm', or a length")
    sizes = [parse(piece, "m", field="space") for piece in pieces]
    return sizes[0], sizes[1] if len(sizes) > 1 else None


@dataclass(frozen=True)
class Shortfall:
    """A requirement that is not met, with all others as required: the required value, and the nearest possible one.

    `reachable` is None if no value of this part alone would help.
    """

    part: str
    asked: float
    reachable: float | None

    @property
    def change(self) -> float:
        """Factor by which the part would have to change, 1 for not at all; infinite if no change helps."""
        if self.reachable is None or self.reachable <= 0.0:
            return math.inf
        return max(self.reachable / self.asked, self.asked / self.reachable)

    def sentence(self) -> str:
        """Description with numbers."""
        unit = ALLOWED[self.part][0]
        asked = with_unit(self.asked, unit, 3)
        if self.reachable is None:
            return f"the {self.part} of {asked} is not what stands in the way: no other would do"
        share = abs(self.reachable / self.asked - 1.0)
        reachable = with_unit(self.reachable, unit, 3)
        size = "at most" if self.reachable < self.asked else "at least"
        return f"{self.part} of {size} {reachable} instead of {asked} ({share:.0%} off), all else as wished"
