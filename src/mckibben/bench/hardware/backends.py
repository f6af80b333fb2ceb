"""Backends by name: what opens the hardware that a spec such as ``serial:/dev/ttyACM0`` names.

A backend is a function of a `HardwareRequest` that returns an open `Hardware`. A package adds one by an entry point of the
group `GROUP`, whose name is what stands before the colon; ours are listed here, so that a checkout needs no installation.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from ...errors import InputError
from ...extras import library
from . import daq, serial_line
from .interface import Hardware

if TYPE_CHECKING:
    from ..rig import Rig

GROUP = "mckibben.hardware"
SILENCE = 0.02  # after which a device vents by itself [s]; a program on a shared computer may pause so long
USAGE = {
    "serial": "serial:PORT or serial:PORT@BITS_PER_SECOND, such as serial:/dev/ttyACM0",
    "daq": "daq, with the table [daq] in the rig's file",
}


class HardwareRequest(NamedTuple):
    """The request to a backend to open a machine."""

    place: str  # what stands behind the colon, such as a port; empty without one
    rig: Rig  # whose channels and outputs the machine must have
    period: float  # period of the samples [s]
    lock_step: bool = False  # the machine waits for every command, as only a simulated device can
    silence: float = SILENCE  # time without a command after which the machine vents by itself [s]


Backend = Callable[[HardwareRequest], Hardware]


@contextlib.contextmanager
def connected(
    words: str | None, rig: Rig, period: float, *, lock_step: bool = False, silence: float = SILENCE
) -> Iterator[Hardware | None]:
    """Open the hardware named by a spec; vent and close it on exit. None and ``simulated`` stand for no hardware.

    Args:
        words: name of a backend, and behind a colon what it opens.
        rig: whose channels and outputs it must have.
        period: period of the samples [s].
        lock_step: it waits for every command, as only a simulated device can.
        silence: time without a command after which the machine vents by itself [s].

    Raises:
        InputError: if there is no such machine, or it is not the rig's.
        LineLostError: if it does not answer.
    """
    if words is None or words == "simulated":
        yield None
        return
    name, place = _split(words)
    backend: Backend | None = OURS.get(name)
    if backend is None:  # that of an installed package, which `_split` has found
        backend = next(e for e in importlib.metadata.entry_points(group=GROUP) if e.name == name).load()
    hardware = backend(HardwareRequest(place, rig, period, lock_step, silence))
    try:
        yield hardware
    finally:
        hardware.close()


def check_connection(words: str | None) -> None:
    """Refuse a spec that names no backend, or one whose library is not installed, before any work begins.

    Args:
        words: as of `connected`.

    Raises:
        InputError: if they name no backend.
        MissingLibraryError: if the library that talks to the machine is not installed.
    """
    if words is None or words == "simulated":
        return
    name, place = _split(words)
    if name == "serial":
        library("serial", "Machines on a serial port need", where=place)
    elif name == "daq":
        library("nidaqmx", "Data acquisition cards need")


def _split(words: str) -> tuple[str, str]:
    name, colon, place = words.partition(":")
    others = sorted({e.name for e in importlib.metadata.entry_points(group=GROUP)} - USAGE.keys())
    well_formed = bool(place) == (name == "serial") if name in USAGE else name in others
    if not well_formed:
        known = ", or ".join([*USAGE.values(), *others])
        raise InputError("--on", words, f"must be {known}")
    return name, place


def _open_serial(request: HardwareRequest) -> Hardware:
    # such as ``/dev/ttyUSB0@3000000``, with bits per second; the name of a port may have an @ of its own
    port, _, stated = request.place.rpartition("@")
    speed = {"baud": int(stated)} if port and stated.isascii() and stated.isdigit() and len(stated) < 10 else {}
    if speed == {"baud": 0}:
        raise InputError("--on", f"serial:{request.place}", "must state 1 bit per second or more after @")
    converters = request.rig.converters(0.0)
    return serial_line.SerialHardware(
        port if speed else request.place,
        converters.names,
        bits={n: c.bits for n, c in converters.analog.items()},
        encoder=converters.encoder is not None,
        motor=converters.motor is not None,
        lock_step=request.lock_step,
        watchdog=max(3, math.ceil(request.silence / request.period)),
        **speed,
    )


def _open_daq(request: HardwareRequest) -> Hardware:
    rig = request.rig
    if "daq" not in rig.document:
        raise InputError("daq", None, "is missing: the rig's file must state how the card is wired", where=rig.where)
    wired = daq.wiring(rig.document["daq"], where=rig.where)
    for name, converter in rig.converters(0.0).analog.items():
        if name in wired.inputs and wired.inputs[name].bits != converter.bits:
            allowed = f"must be {converter.bits}, as sensors.{name}.converter has"
            raise InputError(f"daq.inputs.{name}.bits", wired.inputs[name].bits, allowed, where=rig.where)
    return daq.DaqHardware(wired)


OURS: dict[str, Backend] = {"serial": _open_serial, "daq": _open_daq}
