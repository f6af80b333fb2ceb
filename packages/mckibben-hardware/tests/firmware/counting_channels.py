"""Channels of a machine for emulated boards, of which every count is known beforehand."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "firmware" / "emulator"))
from emulated_board import CHANNELS  # noqa: E402


class CountingChannels:
    """Channels that go through the counts of a converter, and an encoder that the count of the valve moves both ways.

    Args:
        bits: of the converters.
        steps: from sample to sample of each channel [counts].
        offsets: of each channel at the first sample [counts].
    """

    names = CHANNELS

    def __init__(self, bits: int, steps: tuple[int, int, int], offsets: tuple[int, int, int]) -> None:
        self.bits = (bits, bits, bits)
        self.steps, self.offsets = steps, offsets
        self.period = 0.0
        self.number = self.edges = 0

    def sample(self) -> tuple[list[int], int]:
        """The counts of the present sample and of the encoder."""
        pairs = zip(self.steps, self.offsets, self.bits, strict=True)
        return [(step * self.number + offset) % 2**bits for step, offset, bits in pairs], self.edges

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        """Take the outputs of a sample."""
        self.number += 1
        self.edges += valve % 41 - 20
