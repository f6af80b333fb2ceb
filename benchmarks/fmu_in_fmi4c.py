"""FMUs of FMI 3.0 in fmi4c, the C library by which OMSimulator and Hopsan import FMUs: the scenarios of `mckibben conform`.

    python benchmarks/fmu_in_fmi4c.py --library libfmi4c.so [--version COMMIT] [--scenario hang] [--out fmi4c.json]

fmi4c reads the XML, loads the binary and calls it; the mechanism is stepped here, as for every importer. It is no Python
package: `--library` names its shared library.
"""

from __future__ import annotations

import argparse
import ctypes
import itertools
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mckibben.errors import ConvergenceError, InputError
from mckibben_hosts import Part, conform, export
from mckibben_hosts.adapters import LoopHost, PartInstance, PartReadings
from mckibben_hosts.fmi_host import MASSES

POINTERS = (
    "fmi4c_loadFmu",
    "fmi3_getVariableByIndex",
    "fmi3_instantiateCoSimulation",
)
FLAGS, DOUBLE = (ctypes.c_bool(False),) * 2, ctypes.c_double  # visible and logging, event mode and early return


class Fmi4cInstance(PartInstance):
    """An instance of a part's FMU."""

    def __init__(self, library: Any, path: Path, part: Part, parameters: Mapping[str, float], name: str) -> None:
        self.library, self.part, self.path, self.name = library, part, path, name
        fmu = ctypes.c_void_p(library.fmi4c_loadFmu(str(path).encode(), name.encode()))
        if not fmu:
            raise InputError("fmu", str(path), "could not be loaded by fmi4c")
        self.references = {}
        for k in range(1, library.fmi3_getNumberOfVariables(fmu) + 1):
            variable = ctypes.c_void_p(library.fmi3_getVariableByIndex(fmu, k))
            found = library.fmi3_getVariableName(variable).decode()
            self.references[found] = int(library.fmi3_getVariableValueReference(variable))
        none = ctypes.c_void_p()
        empty, count = ctypes.c_void_p(), ctypes.c_size_t(0)
        self.fmu = fmu
        self.instance = ctypes.c_void_p(
            library.fmi3_instantiateCoSimulation(fmu, *FLAGS, *FLAGS, empty, count, none, LOGGER, none)
        )
        self.parameters, self.time, self.started = dict(parameters), 0.0, False
        muscles = part.muscles
        self.read = [self._called(m, what) for what in ("tension", "pressure", "work") for m in muscles]
        self.read += [other for other in self.references if other.startswith(MASSES)]

    def _called(self, muscle: str, variable: str) -> str:
        return variable if len(self.part.muscles) == 1 else f"{muscle}.{variable}"

    def _call(self, function: str, *arguments: Any) -> None:
        if self.library[function](self.instance, *arguments) != 0:
            raise ConvergenceError(f"{function} failed at {self.time:g} s.")

    def _put(self, values: Mapping[str, float]) -> None:
        count = len(values)
        if count:
            references = (ctypes.c_uint32 * count)(*(self.references[name] for name in values))
            size = ctypes.c_size_t(count)
            self._call("fmi3_setFloat64", references, size, (DOUBLE * count)(*values.values()), size)

    def _get(self, names: list[str]) -> list[float]:
        count = len(names)
        values, size = (DOUBLE * count)(), ctypes.c_size_t(count)
        references = (ctypes.c_uint32 * count)(*(self.references[name] for name in names))
        self._call("fmi3_getFloat64", references, size, values, size)
        return list(values)

    def _give(self, span: Mapping[str, float], rate: Mapping[str, float], commands: Mapping[str, float]) -> None:
        values = {self._called(m, "span"): float(span[m]) for m in self.part.muscles}
        values |= {self._called(m, "rate"): float(rate[m]) for m in self.part.muscles}
        self._put(values | {f"command.{name}": float(value) for name, value in commands.items()})

    def _start(self) -> None:
        self._put(self.parameters)
        no, zero = ctypes.c_bool(False), DOUBLE(0.0)
        self._call("fmi3_enterInitializationMode", no, zero, zero, no, zero)
        self._call("fmi3_exitInitializationMode")
        self.started = True

    def step(
        self, period: float, span: Mapping[str, float], rate: Mapping[str, float], commands: Mapping[str, float]
    ) -> PartReadings:
        """Go on by one step."""
        self._give(span, rate, commands)
        if not self.started:
            self._start()
        flags, last = [ctypes.c_bool() for _ in range(3)], DOUBLE()
        places = [ctypes.byref(flag) for flag in (*flags, last)]
        self._call("fmi3_doStep", DOUBLE(self.time), DOUBLE(period), ctypes.c_bool(False), *places)
        self.time += period
        return PartReadings.of_variables(self.part.muscles, self._get(self.read))

    def save(self) -> Any:
        """The time and the state as bytes; None before the first step."""
        if not self.started:
            return None
        state, size = ctypes.c_void_p(), ctypes.c_size_t()
        self._call("fmi3_getFMUState", ctypes.byref(state))
        self._call("fmi3_serializedFMUStateSize", state, ctypes.byref(size))
        content = ctypes.create_string_buffer(size.value)
        self._call("fmi3_serializeFMUState", state, content, size)
        self._call("fmi3_freeFMUState", ctypes.byref(state))
        return self.time, content.raw

    def restore(self, saved: Any) -> None:
        """Return to a state, perhaps of another instance."""
        if saved is None:
            self._call("fmi3_reset")
            self.time, self.started = 0.0, False
            return
        if not self.started:
            self._start()
        self.time, content = saved
        state = ctypes.c_void_p()
        self._call("fmi3_deserializeFMUState", content, ctypes.c_size_t(len(content)), ctypes.byref(state))
        self._call("fmi3_setFMUState", state)
        self._call("fmi3_freeFMUState", ctypes.byref(state))

    def look(self, span: Mapping[str, float], rate: Mapping[str, float], commands: Mapping[str, float]) -> None:
        """Set the inputs and read the outputs."""
        if self.started:
            self._give(span, rate, commands)
            self._get(self.read)


@ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
def LOGGER(_environment: Any, _status: int, _category: bytes, _message: bytes) -> None:  # noqa: N802 - a constant
    """Messages of light masses that fail, which are looked for."""


class Fmi4cHost(LoopHost):
    """fmi4c as importer of FMI 3.0."""

    name, title, staggered = "fmi4c", "FMU of FMI 3.0 in fmi4c, mean acceleration", False

    def __init__(self, library: str, version: str) -> None:
        self._version = version
        self.library: Any = ctypes.CDLL(library)
        for name in POINTERS:
            getattr(self.library, name).restype = ctypes.c_void_p  # `library[name]` would be another function each time
        self.library.fmi3_getVariableName.restype = ctypes.c_char_p
        self.library.fmi3_getVariableValueReference.restype = ctypes.c_uint32
        self._folder = tempfile.TemporaryDirectory(prefix="mckibben-")
        self._fmus: dict[str, Path] = {}
        self._numbers = itertools.count()

    def version(self) -> str:
        """Name of the library, and what the caller knows of it: it states no version."""
        return f"fmi4c {self._version}".strip()

    def instance(self, part: Part, parameters: Mapping[str, float]) -> PartInstance:
        """A new instance of a part, whose FMU is made once."""
        key = part.fingerprint
        if key not in self._fmus:
            (self._fmus[key],) = export(part, "fmi3", Path(self._folder.name, f"{key}.fmu"), name="part")
        return Fmi4cInstance(self.library, self._fmus[key], part, parameters, f"part_{next(self._numbers)}")

    def close(self) -> None:
        """Remove the FMUs."""
        self._folder.cleanup()


def main() -> None:
    """Run the scenarios, print the limits, and write the certificate."""
    parser = argparse.ArgumentParser(description="Run FMUs of FMI 3.0 in fmi4c through the scenarios of conformance.")
    parser.add_argument("--library", default="libfmi4c.so", help="Shared library of fmi4c")
    parser.add_argument("--version", default="", help="Version or commit of fmi4c, for the certificate")
    parser.add_argument("--scenario", action="append", help="Scenario to run instead of all")
    parser.add_argument("--out", type=Path, help="Certificate to write, a JSON file")
    options = parser.parse_args()
    host = Fmi4cHost(options.library, options.version)
    try:
        certificate = conform(host, scenarios=options.scenario, states=options.scenario is None, progress=print)
    finally:
        host.close()
    for verdict in certificate.verdicts:
        print(f"{verdict.what}: {verdict.value:.3g} {verdict.unit}, {'holds' if verdict.holds else 'is missed'}")
    print(f"steps of 1 ms in a second: {certificate.content.get('steps_per_s', 'not measured')}")
    if options.out:
        certificate.save(options.out)


if __name__ == "__main__":
    main()
