"""Environments of Gymnasium in which pneumatic muscles are controlled by their valves.

import gymnasium
import mckibben_hosts.gymnasium

env = gymnasium.make("mckibben/Joint-v0", render_mode="rgb_array")
lanes = gymnasium.make_vec("mckibben/Joint-v0", num_envs=1024)

The physics is that of `mckibben.simulation`: one control period is one call of a native kernel, for one environment and for
all lanes of a vector environment, whose lanes have the same bits as single environments.
"""

from __future__ import annotations

from mckibben.extras import library

gymnasium = library("gymnasium", "These environments need")

from .environments import MuscleEnv, MuscleVectorEnv  # noqa: E402
from .tasks import PERIOD, TASKS, Task  # noqa: E402

__all__ = ["PERIOD", "TASKS", "MuscleEnv", "MuscleVectorEnv", "Task"]

for _id, _task in TASKS.items():
    if _id not in gymnasium.registry:
        gymnasium.register(
            _id,
            entry_point="mckibben_hosts.gymnasium.environments:MuscleEnv",
            vector_entry_point="mckibben_hosts.gymnasium.environments:MuscleVectorEnv",
            max_episode_steps=_task.samples,
            kwargs={"task": _id},
        )
