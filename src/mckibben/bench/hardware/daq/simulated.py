"""A card without hardware: a device server on this computer, whose card has a machine in counts around it.

    with SimulatedDevice(machine, wiring) as device:
        hardware = DaqHardware(device.wiring)

It answers the calls of the service `nidaqmx_grpc.NiDAQmx` that `client` makes of the unmodified `nidaqmx`, one client at a
time, and refuses what a card would: unknown devices and terminals, a counter that is not on the clock of the inputs, samples
that were not read in time. It shows no noise, no settling and no time that a bus takes; what a real driver does beyond these
calls is not in it.
"""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor

from ..interface import CountedMachine
from .card import Card
from .complaints import library
from .service import Calls
from .terminals import GRPC
from .wiring import CardWiring


class SimulatedDevice:
    """A device server in this process, from entering to leaving its context.

    Args:
        machine: what is behind the card.
        wiring: the terminals that the card has; the machine's names are those of its inputs.
        lock_step: the machine goes on when its outputs are written, which needs reads of one sample; else by the clock.
        zeroed: the counter is set to nothing at every start; else it shows the machine's own count.

    Raises:
        InputError: the library is missing, or the wiring has a channel that the machine has not.
    """

    def __init__(
        self, machine: CountedMachine, wiring: CardWiring, *, lock_step: bool = True, zeroed: bool = True
    ) -> None:
        self.card = Card(machine, lock_step=lock_step, zeroed=zeroed)
        stubs = library("nidaqmx._stubs.nidaqmx_pb2_grpc")
        service = type("Service", (Calls, stubs.NiDAQmxServicer), {})(self.card, wiring)
        self._server = library("grpc").server(ThreadPoolExecutor(8, "simulated device"))
        stubs.add_NiDAQmxServicer_to_server(service, self._server)
        port = self._server.add_insecure_port("127.0.0.1:0")
        self.wiring = dataclasses.replace(wiring, connection=f"{GRPC}127.0.0.1:{port}")

    def __enter__(self) -> SimulatedDevice:
        self._server.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """As if it were unplugged: calls that are under way end, later ones find nobody."""
        self.card.stop()
        self._server.stop(None).wait()
