"""Benchmark of muscle models: measured tasks with frozen splits, into which any model enters by `fit` and `predict`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .._lazy import lazy_submodules
from .datasets import BenchmarkRecord, DataSplit
from .run import MODELS, BenchmarkModel, BenchmarkResult, TaskScore, benchmark, model_names, new_model, run_task
from .tasks import TASKS, BenchmarkTask, task

if TYPE_CHECKING:
    from . import page as page

__all__ = [
    "MODELS",
    "TASKS",
    "BenchmarkModel",
    "BenchmarkRecord",
    "BenchmarkResult",
    "DataSplit",
    "BenchmarkTask",
    "TaskScore",
    "benchmark",
    "model_names",
    "new_model",
    "run_task",
    "task",
]

lazy_submodules(__name__)
