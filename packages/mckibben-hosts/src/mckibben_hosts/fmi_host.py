"""FMPy and libcosim as `mckibben conform` sees them: FMUs of parts in a loop that steps the muscle first."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from mckibben.errors import ConvergenceError, InputError
from mckibben.extras import library

from .adapters import BuildingHost, Numbers, PartInstance, PartReadings
from .fmi_description import variable_name
from .fmi_export import export_fmu
from .part import Part

MASSES = "state.circuit.mass."  # beginning of the names of the masses of gas


READ = ("tension", "pressure", "work")  # of each muscle, after a step


def instantiate_silently(fmpy: Any, slave: Any) -> None:
    """Instantiate an FMU whose messages are dropped; FMPy would print them, also within a certificate in JSON."""
    if isinstance(slave, fmpy.fmi3.FMU3Slave):
        slave.instantiate(logMessage=lambda *_: None)
        return
    fmi2 = fmpy.fmi2
    silent = fmi2.fmi2CallbackFunctions()
    silent.logger = fmi2.fmi2CallbackLoggerTYPE(lambda *_: None)
    silent.allocateMemory = fmi2.defaultCallbacks.allocateMemory
    silent.freeMemory = fmi2.defaultCallbacks.freeMemory
    slave.instantiate(callbacks=silent)


class _Fmu:
    """The FMU of a part, unpacked."""

    def __init__(self, part: Part, folder: Path, version: int) -> None:
        self.fmpy = library("fmpy", "The hosts fmi2 and fmi3 need")
        self.part, self.version = part, version
        folder.mkdir(parents=True)
        (path,) = export_fmu(part, folder / "part.fmu", "part", version)
        self.folder = self.fmpy.extract(str(path), str(folder / "unpacked"))
        self.description = self.fmpy.read_model_description(str(path))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}

    def slave(self) -> Any:
        third = self.version == 3
        made = (self.fmpy.fmi3.FMU3Slave if third else self.fmpy.fmi2.FMU2Slave)(
            guid=self.description.instantiationToken if third else self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier="part",
            instanceName="part",
        )
        instantiate_silently(self.fmpy, made)
        return made


class _FmuInstance(PartInstance):
    """An instance of a part's FMU in FMPy."""

    def __init__(self, fmu: _Fmu, parameters: Mapping[str, float]) -> None:
        self.fmu, self.parameters, self.slave = fmu, dict(parameters), fmu.slave()
        third = fmu.version == 3
        self.put = self.slave.setFloat64 if third else self.slave.setReal
        self.get = self.slave.getFloat64 if third else self.slave.getReal
        muscles, of = fmu.part.muscles, fmu.references
        places = {what: [of[variable_name(muscles, m, what)] for m in muscles] for what in ("span", "rate", *READ)}
        self.spans, self.rates = places["span"], places["rate"]
        self.read = [place for what in READ for place in places[what]]
        self.masses = [reference for name, reference in of.items() if name.startswith(MASSES)]
        self.time, self.started = 0.0, False

    def _give(self, span: Numbers, rate: Numbers, commands: Numbers) -> None:
        muscles = self.fmu.part.muscles
        self.put(self.spans, [float(span[m]) for m in muscles])
        self.put(self.rates, [float(rate[m]) for m in muscles])
        self.put([self.fmu.references[f"command.{n}"] for n in commands], [float(v) for v in commands.values()])

    def _start(self) -> None:
        if self.parameters:
            references = [self.fmu.references[path] for path in self.parameters]
            self.put(references, [float(value) for value in self.parameters.values()])
        if self.fmu.version == 2:
            self.slave.setupExperiment()
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self.started = True

    def step(self, period: float, span: Numbers, rate: Numbers, commands: Numbers) -> PartReadings:
        self._give(span, rate, commands)
        if not self.started:
            self._start()
        try:
            self.slave.doStep(self.time, period)
        except self.fmu.fmpy.fmi1.FMICallException:
            raise ConvergenceError(f"The FMU refuses a step of {period:g} s at {self.time:g} s.") from None
        self.time += period
        # Masses are variables of model exchange only.
        return PartReadings.of_variables(self.fmu.part.muscles, list(self.get(self.read + self.masses)))

    def save(self) -> Any:
        if not self.started:
            return None
        kept = self.slave.getFMUState() if self.fmu.version == 3 else self.slave.getFMUstate()
        read = self.slave.serializeFMUState if self.fmu.version == 3 else self.slave.serializeFMUstate
        content = self.time, read(kept)
        self._free(kept)
        return content

    def _free(self, kept: Any) -> None:
        (self.slave.freeFMUState if self.fmu.version == 3 else self.slave.freeFMUstate)(kept)

    def restore(self, saved: Any) -> None:
        if saved is None:
            self.slave.reset()
            self.time, self.started = 0.0, False
            return
        if not self.started:
            self._start()
        self.time, content = saved
        third = self.fmu.version == 3
        kept = (self.slave.deserializeFMUState if third else self.slave.deSerializeFMUstate)(content)
        (self.slave.setFMUState if third else self.slave.setFMUstate)(kept)
        self._free(kept)

    def look(self, span: Numbers, rate: Numbers, commands: Numbers) -> None:
        if self.started:
            self._give(span, rate, commands)
            self.get(self.read)


class _FmiHost(BuildingHost):
    """FMPy as importer of FMUs."""

    staggered = False
    of_version: int

    def version(self) -> str:
        return f"FMPy {library('fmpy', 'The hosts fmi2 and fmi3 need').__version__}"

    def build(self, part: Part, folder: Path) -> _Fmu:
        return _Fmu(part, folder, self.of_version)

    def instance(self, part: Part, parameters: Mapping[str, float]) -> PartInstance:
        return _FmuInstance(self.built(part), parameters)


class Fmi3Host(_FmiHost):
    """An importer of FMI 3.0."""

    name, title, of_version = "fmi3", "FMU of FMI 3.0 in FMPy, mean acceleration", 3


class Fmi2Host(_FmiHost):
    """An importer of FMI 2.0."""

    name, title, of_version = "fmi2", "FMU of FMI 2.0 in FMPy, mean acceleration", 2


NEEDS = "The host libcosim needs"


def _libcosim(module: str) -> Any:
    return library(f"libcosimpy.{module}", NEEDS)


class _CosimInstance(PartInstance):
    """A part's FMU as the only slave of an execution, which is made with the first step."""

    def __init__(self, path: Path, part: Part, parameters: Mapping[str, float], name: str) -> None:
        self.path, self.part, self.parameters, self.name = path, part, dict(parameters), name
        self.period: float | None = None

    def _start(self, period: float, inputs: Mapping[str, float]) -> None:
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
        self.read = [of[variable_name(muscles, m, what)] for what in READ for m in muscles]
        self.read += [reference for name, reference in of.items() if name.startswith(MASSES)]

    def step(self, period: float, span: Numbers, rate: Numbers, commands: Numbers) -> PartReadings:
        muscles = self.part.muscles
        inputs = {variable_name(muscles, m, "span"): float(span[m]) for m in muscles}
        inputs |= {variable_name(muscles, m, "rate"): float(rate[m]) for m in muscles}
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
        if self.period is not None:
            raise InputError("moment", None, "cannot be saved in libcosim once the execution has begun")

    def restore(self, saved: Any) -> None:
        self.period = None

    def look(self, span: Numbers, rate: Numbers, commands: Numbers) -> None:
        """Nothing: a slave is evaluated by steps only."""


class LibcosimHost(BuildingHost):
    """An importer of FMI 2.0 that is built on FMI Library."""

    name, title, staggered = "libcosim", "FMU of FMI 2.0 in libcosim, mean acceleration", False
    caveats = ("States of slaves cannot be saved from Python, so that only the return to the start was tested.",)
    untested = ("saved and restored", "restored elsewhere", "copied", "evaluated twice", "on four threads")

    def __init__(self) -> None:
        logging = _libcosim("CosimLogging")
        logging.log_output_level(logging.CosimLogLevel.FATAL)  # light masses, which are looked for, fail with an error
        super().__init__()
        self._numbers = itertools.count()

    def version(self) -> str:
        """Version of the Python package."""
        return f"libcosimpy {metadata.version('libcosimpy')}"

    def build(self, part: Part, folder: Path) -> Path:
        """The FMU of a part."""
        (path,) = export_fmu(part, folder.with_suffix(".fmu"), "part", 2)
        return path

    def instance(self, part: Part, parameters: Mapping[str, float]) -> PartInstance:
        """A new instance of a part, whose FMU is made once."""
        return _CosimInstance(self.built(part), part, parameters, f"muscles_{next(self._numbers)}")
