"""The sampled loop of a joint: set-points come with the samples, the controller does the rest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp

from ...components import Scalar
from ...components.sampled import Software
from .controllers.joint import JointControl


class JointSoftware(Software):
    """One controller; a row of a sample has ``angle``, ``stiffness``, ``moment`` from outside, and ``active``, 1 or 0."""

    control: JointControl
    start_angle: Any = 0.0
    start_stiffness: Any = 0.0

    def initial(self, measured: Mapping[str, Any]) -> Any:
        """At rest at the first set-points."""
        return self.control.initial(self.start_angle, self.start_stiffness)

    def step(
        self, state: Any, measured: Mapping[str, Any], row: Any, dt: Any
    ) -> tuple[Any, dict[str, Scalar], dict[str, Scalar]]:
        """One sample: commands ``flexor`` and ``extensor`` [Pa] and the row's ``moment``; shown are all set-points."""
        after, asked = self.control.step(
            state, row["angle"], row["stiffness"], measured["angle"], measured["flexor_pressure"],
            measured["extensor_pressure"], dt, row["active"],
        )  # fmt: skip
        shown = {
            "command.angle": row["angle"],
            "command.stiffness": row["stiffness"],
            "approach.angle": asked.angle,
            "approach.stiffness": asked.stiffness,
            "command.flexor_pressure": asked.flexor_set,
            "command.extensor_pressure": asked.extensor_set,
            "loop.active": jnp.asarray(row["active"], float),
        }
        commands = {"flexor": asked.flexor, "extensor": asked.extensor, "moment": row["moment"]}
        return after, commands, shown
