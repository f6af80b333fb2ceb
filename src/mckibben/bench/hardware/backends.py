"""Backends by name: what opens the hardware that a spec such as ``serial:/dev/ttyACM0`` names.

A backend is a function of a `HardwareRequest` that returns an open `Hardware`. A package adds one by an entry point of the
group `GROUP`, whose name is what stands before the colon. It may have a method ``check(place)``, which says before any work
begins what it lacks. Those of `EXTRAS` are announced by a package of this repository, ``mckibben-hardware``.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from ...errors import InputError
from ...registry import announced, entry_points, loaded
from .interface import Hardware

if TYPE_CHECKING:
    from ..rig import Rig

GROUP = "mckibben.hardware"
SILENCE = 0.02  # after which a device vents by itself [s]; a program on a shared computer may pause so long
EXTRAS = {  # the extra that brings each backend of ours with its library, and what needs it
    "serial": ("serial", "Machines on a serial port need"),
    "daq": ("daq", "Data acquisition cards need"),
}
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
        MissingLibraryError: as of `check_connection`.
    """
    if words is None or words == "simulated":
        yield None
        return
    name, place = _split(words)
    hardware = _backend(name)(HardwareRequest(place, rig, period, lock_step, silence))
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
        MissingLibraryError: if the package of the backend, or the library that talks to the machine, is not installed.
    """
    if words is None or words == "simulated":
        return
    name, place = _split(words)
    check: Callable[[str], None] = getattr(_backend(name), "check", lambda place: None)
    check(place)


def _backend(name: str) -> Backend:
    """The backend of a name that `_split` has found."""
    if name in EXTRAS:
        extra, purpose = EXTRAS[name]
        backend: Backend = announced(GROUP, name, "hardware", purpose, extra=extra)
    else:
        backend = loaded(entry_points(GROUP)[name])
    return backend


def _split(words: str) -> tuple[str, str]:
    name, colon, place = words.partition(":")
    others = sorted(entry_points(GROUP).keys() - USAGE.keys())
    well_formed = bool(place) == (name == "serial") if name in USAGE else name in others
    if not well_formed:
        known = ", or ".join([*USAGE.values(), *others])
        raise InputError("--on", words, f"must be {known}")
    return name, place
