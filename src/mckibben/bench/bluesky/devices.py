"""All devices of a session, and a guard for the RunEngine that runs them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...experiments.protocol import Protocol
from ..session import Session
from ..session.continued import SETTLE
from .flyer import ProtocolFlyer
from .machine import DeviceContext
from .set_point import AXES, SetPoint
from .signals import ChannelSignal


class Devices:
    """What `bench_devices` gives.

    Attributes:
        pressure, span, velocity, tension: set-points; without a motor there is only the pressure.
        measured: signals by channel.
        true: signals by channel, of a simulated machine.
        machine: shared context.
    """

    pressure: SetPoint
    span: SetPoint
    velocity: SetPoint
    tension: SetPoint

    def __init__(self, machine: DeviceContext, *, settle: float, over: float) -> None:
        self.machine = machine
        for axis in AXES if machine.session.setup.rig.motor is not None else AXES[:1]:
            setattr(self, axis, SetPoint(machine, axis, settle=settle))
        self.measured, self.true = (
            {n: ChannelSignal(machine, n, over=over) for n, (_, kind, _) in machine.kinds.items() if kind == wanted}
            for wanted in ("measured", "true")
        )

    def flyer(self, protocol: Protocol | str, **options: Any) -> ProtocolFlyer:
        """A protocol to let go; with the options of `ProtocolFlyer`."""
        return ProtocolFlyer(self.machine, protocol, **options)

    def guard(self, name: str, document: Mapping[str, Any]) -> None:
        """For ``RE.subscribe``: where a run of a plan was aborted or failed, stop what runs, or vent."""
        if name == "stop" and document.get("exit_status") != "success":
            why = document.get("reason") or document.get("exit_status")
            self.machine.let_down(f"the plan did not end as planned: {why}")


def bench_devices(session: Session, name: str = "", *, settle: float = SETTLE, over: float = 0.0) -> Devices:
    """A machine as devices for Bluesky.

    Args:
        session: the machine; it is closed by whoever opened it.
        name: put before every key, where there is more than one machine.
        settle: time at the end of every move [s].
        over: time over which a reading of a signal is the mean [s]; 0: the newest sample.
    """
    return Devices(DeviceContext(session, name), settle=settle, over=over)
