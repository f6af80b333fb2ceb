"""Controllers by name, and a bench on which they are scored: `score`, and the command ``mckibben control``.

    answer = mk.control.score("memory-inverse", bench="B1", reference="R2")

A controller is whatever has `reset` and `step`, see `Controller`; it runs behind a `Simulation`, a rig or a host alike.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .._lazy import lazy_names

if TYPE_CHECKING:
    from .benches import BENCHES as BENCHES
    from .benches import Plant as Plant
    from .benches import control_task as control_task
    from .benches import unseen_plants as unseen_plants
    from .catalogue import CONTROLLERS as CONTROLLERS
    from .controllers import PID as PID
    from .controllers import InverseControl as InverseControl
    from .controllers import IterativeLearning as IterativeLearning
    from .lqi import LQI as LQI
    from .predictive import PredictiveControl as PredictiveControl
    from .references import REFERENCES as REFERENCES
    from .scores import score as score
    from .task import Controller as Controller
    from .task import ControlTask as ControlTask

lazy_names(__name__)
