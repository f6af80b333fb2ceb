"""Waveforms as data: signals over time, read from tables, sampled, and described in sentences.

A waveform is an immutable value in the unit of its signal. `Waveform.at` gives its values at any times; the same times give
the same values on every machine, noise included. ``straight`` says how it goes on between two samples: along a line, or
held until the next one. A jump belongs to the time that it is stated for.
"""

from .shapes import (
    Binary,
    Chirp,
    Constant,
    MultiSine,
    Noise,
    PointTable,
    Pulse,
    PulseWidth,
    Ramp,
    Sequence,
    Sine,
    Square,
    Staircase,
    Sum,
    Triangle,
)
from .waveform import KINDS, Waveform, read_waveform, time_words

__all__ = [
    "KINDS", "Binary", "Chirp", "Constant", "MultiSine", "Noise", "Pulse", "PulseWidth", "Ramp", "Sequence", "Sine",
    "Square", "Staircase", "Sum", "PointTable", "Triangle", "Waveform", "read_waveform", "time_words",
]  # fmt: skip
