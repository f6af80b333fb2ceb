"""libcosim as `mckibben conform` sees it: FMUs of parts as slaves of executions, whose inputs are overridden."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...errors import ConvergenceError, InputError
from ...extras import library
from ..adapters import LoopHost, PartInstance, PartReadings
from ..part import Part
from .archive import export_fmu
from .host import MASSES

NEEDS = "The host libcosim needs"


def _libcosim(module: str) -> Any:
    return library(f"libcosimpy.{module}", NEEDS)


class _CosimInstance(PartInstance):
    """A part's FMU as the only slave of an execution, which is made with the first step."""

    def __init__(self, path: Path, part: Part, parameters: Mapping[str, float], name: str) -> None:
        self.path, self.part, self.parameters, self.name = path, part, dict(parameters), name
        self.period: float | None = None

    def _start(self, period: float, inputs: Mapping[str, float]) -> None:
        """Make the execution; the slave starts with parameters and inputs."""
        self.period = period
        self.execution = _libcosim("CosimExecution").CosimExecution.from_step_size(step_size=round(1e9 * period))
        self.slave = _libcosim("CosimSlave").CosimLocalSlave(fmu_path=str(self.path), instance_name=self.name)
        self.index = self.execution.add_local_slave(self.slave)
        self.inputs = _libcosim("CosimManipulator").CosimManipulator.create_override()
        self.execution.add_manipulator(self.inputs)
        self.outputs = _libcosim("CosimObserver").CosimObserver.create_last_value()
        self.execution.add_observer(self.outputs)
        of = {v.name.decode(): int(v.reference) for v in self.execution.slave_variables(self.index)}
        for name, value in {**self.parameters, **inputs}.items():
            self.execution.real_initial_value(self.index, of[name], float(value))
        self.written = [of[name] for name in inputs]
        muscles = self.part.muscles
        self.read = [of[self._name(m, what)] for what in ("tension", "pressure", "work") for m in muscles]
        self.read += [reference for name, reference in of.items() if name.startswith(MASSES)]

    def _name(self, muscle: str, variable: str) -> str:
        return variable if len(self.part.muscles) == 1 else f"{muscle}.{variable}"

    def step(
        self, period: float, span: Mapping[str, float], rate: Mapping[str, float], commands: Mapping[str, float]
    ) -> PartReadings:
        """Go on by one step of the execution."""
        muscles = self.part.muscles
        inputs = {self._name(m, "span"): float(span[m]) for m in muscles}
        inputs |= {self._name(m, "rate"): float(rate[m]) for m in muscles}
        inputs |= {f"command.{name}": float(value) for name, value in commands.items()}
        if self.period is None:
            self._start(period, inputs)
        if period != self.period:
            raise InputError("period", f"{period:g} s", f"must stay {self.period:g} s in an execution")
        self.inputs.slave_real_values(self.index, self.written, list(inputs.values()))
        if not self.execution.step():
            raise ConvergenceError(f"libcosim could not make a step of {period:g} s.")
        return PartReadings.of_variables(muscles, self.outputs.last_real_values(self.index, self.read))

    def save(self) -> Any:
        """None before the first step; later moments cannot be saved."""
        if self.period is not None:
            raise InputError("moment", None, "cannot be saved in libcosim once the execution has begun")

    def restore(self, saved: Any) -> None:
        """Return to the start, which is all that can be saved."""
        self.period = None

    def look(self, span: Mapping[str, float], rate: Mapping[str, float], commands: Mapping[str, float]) -> None:
        """Nothing: a slave is evaluated by steps only."""


class LibcosimHost(LoopHost):
    """An importer of FMI 2.0 that is built on FMI Library."""

    name, title, staggered = "libcosim", "FMU of FMI 2.0 in libcosim, mean acceleration", False
    caveats = ("States of slaves cannot be saved from Python, so that only the return to the start was tested.",)
    untested = ("saved and restored", "restored elsewhere", "copied", "evaluated twice", "on four threads")

    def __init__(self) -> None:
        logging = _libcosim("CosimLogging")
        logging.log_output_level(logging.CosimLogLevel.FATAL)  # light masses, which are looked for, fail with an error
        self._folder = tempfile.TemporaryDirectory(prefix="mckibben-")
        self._fmus: dict[str, Path] = {}
        self._numbers = itertools.count()

    def version(self) -> str:
        """Version of the Python package."""
        import importlib.metadata as metadata

        return f"libcosimpy {metadata.version('libcosimpy')}"

    def instance(self, part: Part, parameters: Mapping[str, float]) -> PartInstance:
        """A new instance of a part, whose FMU is made once."""
        key = part.fingerprint
        if key not in self._fmus:
            (self._fmus[key],) = export_fmu(part, Path(self._folder.name, f"{key}.fmu"), "part", 2)
        return _CosimInstance(self._fmus[key], part, parameters, f"muscles_{next(self._numbers)}")

    def close(self) -> None:
        """Remove the FMUs."""
        self._fmus.clear()
        self._folder.cleanup()
