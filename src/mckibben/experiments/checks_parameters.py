"""Checks of a protocol's parameters: lengths that no machine of a rig can hold, refused before anything is computed."""

from __future__ import annotations

from ..errors import InputError
from .amounts import read_amount
from .limits import Limits
from .protocol import Protocol
from .waveforms.waveform import words


def check_lengths(protocol: Protocol, limits: Limits, rest_length: float) -> None:
    """Refuse a length that exceeds the longest span of the rig, whether it is a place, a way or an amplitude.

    Args:
        protocol: whose parameters are checked, in every one of their values.
        limits: of the rig.
        rest_length: of the muscle [m], which ``L0`` stands for.

    Raises:
        InputError: names the parameter, its value and the longest span.
    """
    longest = limits.span[1]
    for p in protocol.parameters:
        for value in p.values if p.unit == "m" else ():
            length = read_amount(value, "m", field=p.name).si(rest_length)
            if abs(length) > longest:
                told = f"a length is at most {words(longest, 'm')}, the longest span of the rig"
                raise InputError(p.name, f"{value}", told)
