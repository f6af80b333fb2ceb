"""The controllers that ship, by the names under which they are scored."""

from __future__ import annotations

import functools
from collections.abc import Callable

from .controllers import PID, InverseControl, IterativeLearning
from .lqi import LQI
from .predictive import PredictiveControl
from .published import PublishedControl
from .task import Controller, ControlTask

CONTROLLERS: dict[str, Callable[[ControlTask], Controller]] = {
    "pid": PID,
    "inverse": functools.partial(InverseControl, memory=False),
    "memory-inverse": InverseControl,
    "memory-inverse-open": functools.partial(InverseControl, feedback=False),
    "lqi": LQI,
    "lqi-memory": functools.partial(LQI, memory=True),
    "learning": IterativeLearning,
    "mpc": PredictiveControl,
    "published-feedforward": functools.partial(PublishedControl, kind="feedforward"),
    "published-pid": functools.partial(PublishedControl, kind="pid"),
    "published-lqi": PublishedControl,
}
