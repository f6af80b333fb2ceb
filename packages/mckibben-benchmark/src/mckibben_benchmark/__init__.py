"""Benchmark of muscle models: measured tasks with frozen splits, into which any model enters by `fit` and `predict`.

The studies that validate what ships stand beside it: every tension law on every static data set (`validation`), a loop with
creep (`muscle_loops`), and the air of a jumping robot (`jumping_robot`). With `import mckibben as mk` the function is
`mk.benchmark`. Public names are loaded when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben._lazy import lazy_names, lazy_submodules
from mckibben.registry import join

if TYPE_CHECKING:
    from .datasets import BenchmarkRecord as BenchmarkRecord
    from .datasets import DataSplit as DataSplit
    from .run import MODELS as MODELS
    from .run import BenchmarkModel as BenchmarkModel
    from .run import BenchmarkResult as BenchmarkResult
    from .run import TaskScore as TaskScore
    from .run import benchmark as benchmark
    from .run import model_names as model_names
    from .run import new_model as new_model
    from .run import run_task as run_task
    from .tasks import TASKS as TASKS
    from .tasks import BenchmarkTask as BenchmarkTask
    from .tasks import task as task

__version__ = "1.0.0"

join(__name__)
lazy_submodules(__name__)
lazy_names(__name__)
