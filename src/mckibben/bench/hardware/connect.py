"""A machine by the words of a person: ``serial:/dev/ttyACM0`` or ``daq``, checked against what the rig says it has."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from ...errors import InputError
from ...extras import library
from .interface import Hardware

if TYPE_CHECKING:
    from ..rig import Rig

SILENCE = 0.02  # after which a device vents by itself [s]; a program on a shared computer may pause so long
ALLOWED = "allowed is serial:PORT, such as serial:/dev/ttyACM0, or daq with the table [daq] in the rig's file"


@contextlib.contextmanager
def connected(
    words: str | None, rig: Rig, period: float, *, lock_step: bool = False, silence: float = SILENCE
) -> Iterator[Hardware | None]:
    """The machine that the words name, for as long as this lasts; None for none. It is vented and let go at the end.

    Args:
        words: ``serial:PORT`` or ``daq``.
        rig: whose channels and outputs it must have.
        period: of the samples [s].
        lock_step: it waits for every command, as only a simulated device can.
        silence: time without a command after which a device on a serial line vents by itself [s].

    Raises:
        InputError: if there is no such machine, or it is not the rig's.
        LineLostError: if it does not answer.
    """
    if words is None:
        yield None
        return
    hardware = _made(words, rig, period, lock_step, silence)
    try:
        yield hardware
    finally:
        hardware.close()


def check_connection(words: str | None) -> None:
    """Refuse words that name no kind of machine, or one whose library is not installed; asked before any work begins.

    Args:
        words: ``serial:PORT`` or ``daq``; None for no machine.

    Raises:
        InputError: if they name no kind of machine.
        MissingLibraryError: if the library that talks to it is not installed.
    """
    if words is None:
        return
    kind, _, place = words.partition(":")
    if kind == "serial" and place:
        library("serial", "Machines on a serial port need", where=place)
    elif kind == "daq" and not place:
        library("nidaqmx", "Data acquisition cards need")
    else:
        raise InputError("--on", words, ALLOWED)


def _made(words: str, rig: Rig, period: float, lock_step: bool, silence: float) -> Hardware:
    kind, _, place = words.partition(":")
    converters = rig.converters(0.0)
    if kind == "serial" and place:
        from .serial_line import SerialHardware

        return SerialHardware(
            place, converters.names, bits={n: c.bits for n, c in converters.analog.items()},
            encoder=converters.encoder is not None, motor=converters.motor is not None, lock_step=lock_step,
            watchdog=max(3, math.ceil(silence / period)),
        )  # fmt: skip
    if kind == "daq" and not place:
        from .daq import DaqHardware, wiring

        if "daq" not in rig.document:
            raise InputError("daq", "missing", "the rig's file has to say how the card is wired", where=rig.where)
        wired = wiring(rig.document["daq"], where=rig.where)
        for name, converter in converters.analog.items():
            if name in wired.inputs and wired.inputs[name].bits != converter.bits:
                allowed = f"allowed is {converter.bits}, as sensors.{name}.converter has"
                raise InputError(f"daq.inputs.{name}.bits", wired.inputs[name].bits, allowed, where=rig.where)
        return DaqHardware(wired)
    raise InputError("--on", words, ALLOWED)
