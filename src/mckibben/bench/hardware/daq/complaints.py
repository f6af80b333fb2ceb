"""What the `nidaqmx` client complains about, as one line of the house that names the card, the terminal and the code."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from .... import extras
from ....errors import InputError, LineLostError
from .terminals import GRPC

OVERRUNS = (
    "SAMPLES_NO_LONGER_AVAILABLE", "ACQ_STOPPED_TO_PREVENT_INPUT_BUFFER_OVERWRITE", "INPUT_FIFO_OVERFLOW",
    "INPUT_FIFO_OVERFLOW_2", "INPUT_FIFO_OVERFLOW_3", "ACQ_STOPPED_DRIVER_CANT_XFER_DATA_FAST_ENOUGH", "ADC_OVERRUN",
    "ACQ_STOPPED_TO_PREVENT_INPUT_BUFFER_OVERWRITE_ONE_DATA_XFER_MECH", "AI_OVERRUN", "CI_OVERRUN",
    "ACQ_STOPPED_TO_PREVENT_INTERMEDIATE_BUFFER_OVERFLOW",
)  # fmt: skip
MISNAMED = (
    "PHYSICAL_CHAN_DOES_NOT_EXIST", "INVALID_DEVICE_ID", "INVALID_PHYS_CHAN_NAME", "INVALID_PHYS_CHAN_TYPE",
    "PHYS_CHAN_MEAS_TYPE", "INVALID_ATTRIBUTE_VALUE", "INVALID_TERM", "INVALID_TERM_ROUTING",
    "ROUTE_NOT_SUPPORTED_BY_HW_ROUTING",
)  # fmt: skip


class OverrunError(LineLostError):
    """Samples were overwritten on the card, or on their way from it, before they were read."""


def library(module: str = "nidaqmx") -> Any:
    """The client, or a part of it.

    Raises:
        MissingLibraryError: it is not installed.
    """
    return extras.library(module, "Data acquisition cards need")


class Complaints:
    """Of one card: `place` is its name, and `where` names its wiring."""

    def __init__(self, place: str, where: str) -> None:
        self.errors = library("nidaqmx.errors")
        self.place, self.where = place, where
        self.closed = False

    @contextmanager
    def told(self, path: str = "", said: str = "") -> Iterator[None]:
        """Errors of the client as one line of the house; with a path, what is misnamed there is the user's."""
        errors = self.errors
        try:
            yield
        except errors.DaqNotFoundError:
            raise LineLostError(
                f"{self.place}: no NI-DAQmx driver is installed on this computer; install it, "
                f"or name a device server: connection = '{GRPC}host:port'"
            ) from None
        except errors.RpcError as error:
            raise LineLostError(f"{self.place}: {_rpc(error)}") from None
        except errors.DaqError as error:
            text, name = _line(str(error)), error.error_type.name
            code = f"(NI-DAQmx {error.error_code})"
            if path and name in MISNAMED:
                raise InputError(path, said, f"{text} {code}", where=self.where) from None
            at = f"{self.place}, {said}" if said else self.place
            if name in OVERRUNS:
                raise OverrunError(f"{at}: samples were overwritten before they were read: {text} {code}") from None
            raise LineLostError(f"{at}: {text} {code}") from None
        except errors.Error as error:
            raise LineLostError(f"{self.place}: {_line(str(error))}") from None
        except ValueError:
            if not self.closed:
                raise
            raise LineLostError(f"{self.place}: the tasks are closed") from None


def _line(message: str) -> str:
    """A message of the driver in one line, without what is told elsewhere."""
    parts = [" ".join(p.split()) for p in message.splitlines()]
    kept = [p for p in parts if p and not p.startswith(("DaqTask Name:", "Status Code:"))]
    closed = [p if p.endswith((".", ":", ",")) else f"{p}," for p in kept]
    return " ".join(closed).rstrip(".,")


def _rpc(error: Any) -> str:
    """What became of the line to a device server."""
    name = getattr(error.rpc_code, "name", str(error.rpc_code))
    known = {
        "UNAVAILABLE": "the device server does not answer any more",
        "DEADLINE_EXCEEDED": "the device server did not answer in time",
        "CANCELLED": "the device server does not answer any more",
    }
    return known.get(name, f"the device server says {name}: {_line(str(error.description))}")
