"""The backends ``serial`` and ``daq`` of `mckibben.bench.hardware.backends`, as entry points name them."""

from __future__ import annotations

import math

from mckibben.bench.hardware.backends import HardwareRequest
from mckibben.bench.hardware.interface import Hardware
from mckibben.errors import InputError
from mckibben.extras import library

from . import daq, serial_line


class SerialBackend:
    """Opens the machine behind a microcontroller at a port, such as ``/dev/ttyUSB0`` or ``/dev/ttyUSB0@3000000``."""

    def check(self, place: str) -> None:
        """Raise `MissingLibraryError` where the library of serial ports is not installed."""
        library("serial", "Machines on a serial port need", where=place)

    def __call__(self, request: HardwareRequest) -> Hardware:
        """Open the port; the device behind it must have the rig's channels and outputs."""
        # behind the last @ stand the bits per second; the name of a port may have an @ of its own
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


class DaqBackend:
    """Opens the data acquisition card that the table ``[daq]`` of the rig's file states."""

    def check(self, place: str) -> None:
        """Raise `MissingLibraryError` where the library of National Instruments is not installed."""
        library("nidaqmx", "Data acquisition cards need")

    def __call__(self, request: HardwareRequest) -> Hardware:
        """Open the card; its converters must be those of the rig."""
        rig = request.rig
        if "daq" not in rig.document:
            problem = "is missing: the rig's file must state how the card is wired"
            raise InputError("daq", None, problem, where=rig.where)
        wired = daq.wiring(rig.document["daq"], where=rig.where)
        for name, converter in rig.converters(0.0).analog.items():
            if name in wired.inputs and wired.inputs[name].bits != converter.bits:
                allowed = f"must be {converter.bits}, as sensors.{name}.converter has"
                raise InputError(f"daq.inputs.{name}.bits", wired.inputs[name].bits, allowed, where=rig.where)
        return daq.DaqHardware(wired)


open_serial, open_daq = SerialBackend(), DaqBackend()
