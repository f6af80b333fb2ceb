"""What all devices of one session share: names and descriptions of its channels, its clock, and how it is let down.

A key is a channel's name with ``-`` for every dot, since documents do not hold dots: ``command-pressure``. Values are SI, as
in recordings. Time stamps are seconds since 1970: the time of the session's sample after that of its first one, so that of a
simulation as fast as it goes they tell the simulated time.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from typing import Any

from ...errors import InputError, MckibbenError
from .. import channels
from ..metadata import initial_metadata
from ..session import Session
from ..session.status import IDLE, MANUAL
from .status import DeviceStatus

Reading = dict[str, dict[str, Any]]  # by key: value and timestamp
Keys = dict[str, dict[str, Any]]  # by key: how a value is described


class DeviceContext:
    """A session as its devices see it.

    Args:
        session: the machine.
        name: put before every key, where there is more than one machine.

    Attributes:
        names: names of the channels.
        moves: what goes on of the ``pressure`` and of the ``motor``.
        lock: lock of the moves.
    """

    def __init__(self, session: Session, name: str = "") -> None:
        if any(c in name for c in "./"):
            raise InputError("name", name, "documents hold no keys with dots or slashes")
        self.session, self.prefix = session, f"{name}-" if name else ""
        newest = self.after(-1.0)
        self.zero = time.time() - newest["time"]
        self.names = [n for n in newest if n != "time"]
        self.kinds = channels.kinds(self.names)
        self.moves: dict[str, DeviceStatus] = {}
        self.lock = threading.Lock()
        about = initial_metadata(session.setup.prepared)
        self.about = {"rig": about["rig"], "specimen": about["specimen"] or "", "simulated": self.simulated}

    def after(self, time: float) -> dict[str, float]:
        """The newest sample, which is later than a time [s]; waits for it.

        Raises:
            MckibbenError: if there will be none.
        """
        session = self.session
        while not (newest := session.latest()) or newest["time"] < time + 0.5 * session.period:
            if session.gone:
                raise MckibbenError(f"the machine is {session.gone}: {session.why}")
            session.wait(session.period)
        return newest

    @property
    def simulated(self) -> bool:
        """Whether it is simulated in this process."""
        return self.session.machine.hardware.state() is not None

    def key(self, channel: str) -> str:
        """Of a channel, or of something else with a name."""
        return self.prefix + channel.replace(".", "-")

    def described(self, channel: str, **more: Any) -> dict[str, Any]:
        """How the values of a channel are described in documents."""
        unit, kind, meaning = self.kinds[channel]
        fine = self.session.setup.limits.resolution.get(channel.removeprefix("command."))
        digits = {} if not fine else {"precision": max(0, math.ceil(-math.log10(fine)))}
        return {
            "source": f"{self.place}/{channel}",
            "dtype": "number",
            "dtype_numpy": "<f8",
            "shape": [],
            "units": unit,
            "kind": kind,
            "meaning": meaning,
            **digits,
            **more,
        }

    @property
    def place(self) -> str:
        """Where values come from."""
        return f"mckibben-{'simulated' if self.simulated else 'machine'}:{self.about['rig']}"

    def stamp(self, when: float) -> float:
        """Seconds since 1970 of a time of the session [s]."""
        return self.zero + when

    def configuration(self, own: str, values: dict[str, Any]) -> Reading:
        """What does not change during a plan, of a device by its name."""
        return {f"{own}-{n}": {"value": v, "timestamp": self.zero} for n, v in (self.about | values).items()}

    def described_configuration(self, own: str, values: dict[str, Any], units: dict[str, str]) -> Keys:
        """How that is described."""
        found = {}
        for n, v in (self.about | values).items():
            dtype = "boolean" if isinstance(v, bool) else "string" if isinstance(v, str) else "number"
            unit = {"units": units[n]} if n in units else {}
            found[f"{own}-{n}"] = {"source": f"{self.place}/{n}", "dtype": dtype, "shape": [], **unit}
        return found

    def free(self, what: str) -> None:
        """Refuse at once what a session would let wait: something while a protocol runs, and after a stop.

        Raises:
            InputError: says what the machine does instead.
        """
        status = self.session.status()
        if status.state not in (IDLE, MANUAL):
            why = f": {status.why}" if status.why else ""
            raise InputError(what, "refused", f"the machine is {status.doing()}{why}; allowed is in manual mode")

    def let_down(self, reason: str) -> None:
        """Nothing may be left under pressure: stop what runs, or vent at the manual rate. Never raises `InputError`."""
        if self.session.status().protocol is not None:
            self.session.emergency_stop(reason)
        elif not self.session.why:
            with contextlib.suppress(InputError):
                self.session.vent()
