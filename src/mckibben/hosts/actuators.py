"""How the muscles and commands of a part are spread over the actuators of a host that gives each actuator one control.

The first actuators are the muscles, in the part's order. The control of each is the command of the same name, or else the
next command that no muscle has. Commands that are left get actuators of their own behind the muscles, which do not pull.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .part import Part

LEAST_SIZE = 1e-6  # of a number of the state by which it is divided


class ActuatorRole(NamedTuple):
    """What an actuator is for a part: the muscle that pulls there, and the command that its control is; None for neither."""

    muscle: str | None
    command: str | None

    @property
    def name(self) -> str:
        """Name of the muscle, else of the command."""
        return self.muscle or self.command or ""


def actuator_roles(part: Part) -> tuple[ActuatorRole, ...]:
    """The actuators that a part needs, in their order."""
    left = [name for name in part.commands if name not in part.muscles]
    roles = []
    for muscle in part.muscles:
        named = muscle if muscle in part.commands else None
        roles.append(ActuatorRole(muscle, named or (left.pop(0) if left else None)))
    return (*roles, *(ActuatorRole(None, command) for command in left))


def state_sizes(part: Part) -> np.ndarray:
    """Usual size of each number of a part's state, its value at rest; 1 where that is next to nothing."""
    rested = np.abs(part.rest())
    return np.where(rested > LEAST_SIZE, rested, 1.0)
