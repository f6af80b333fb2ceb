"""Chance that is the same on every machine: whole-number arithmetic only, and no generator's state."""

from __future__ import annotations

import numpy as np

# Feedback taps of shift registers of maximal length, by order.
TAPS = {
    3: (3, 2), 4: (4, 3), 5: (5, 3), 6: (6, 5), 7: (7, 6), 8: (8, 6, 5, 4), 9: (9, 5), 10: (10, 7), 11: (11, 9),
    12: (12, 6, 4, 1), 13: (13, 4, 3, 1), 14: (14, 5, 3, 1), 15: (15, 14), 16: (16, 15, 13, 4),
}  # fmt: skip


def uniform(seed: int, index: np.ndarray) -> np.ndarray:
    """Numbers from 0 to 1 by SplitMix64: one for each index, independent of all others; shape of the indices."""
    # Two rounds: one turns seed and index into a word, the other mixes neighbouring seeds apart.
    mixed = _mix(np.asarray(index).astype(np.uint64) + np.uint64(1) + _mix(np.asarray(seed, np.uint64)))
    return (mixed >> np.uint64(11)).astype(float) * 2.0**-53


def register_bits(order: int) -> np.ndarray:
    """One period of a shift register that starts with ones, bool (2^order - 1,)."""
    state, bits = (1 << order) - 1, []
    for _ in range((1 << order) - 1):
        bits.append(state & 1)
        new = 0
        for tap in TAPS[order]:
            new ^= state >> (order - tap) & 1
        state = state >> 1 | new << (order - 1)
    return np.array(bits, bool)


def _mix(word: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):  # wrapping round is what it is made of
        word = word * np.uint64(0x9E3779B97F4A7C15)
        word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mix: np.ndarray = word ^ (word >> np.uint64(31))
    return mix
