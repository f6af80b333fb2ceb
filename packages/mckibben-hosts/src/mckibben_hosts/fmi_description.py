"""What an FMU states: its variables, and the XML of FMI 2.0 and 3.0: model description, terminals, building of the sources.

Variables are the numbers at the border of a part with names, value references and places in the C struct.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from mckibben.errors import InputError
from mckibben.quantities import base_exponents

from .c_source import PartSource, PartVariable

NOMINALS = {"kg": 1e-3, "Pa": 1e5, "m": 0.1, "m/s": 0.1}  # usual size of a state by its unit; 1 otherwise
NOT_OFFERED = ("sound",)  # outputs that are errors of a step in FMI
MEANINGS = {
    "tension": "mean tension over the communication step: step the muscle first, then the mechanism with this tension in "
    "the same step; in model exchange the present tension",
    "rate": "rate of the span; without it the muscle takes the span as constant over a step",
}


class FmuVariable(NamedTuple):
    """A variable of an FMU, perhaps an array.

    Attributes:
        reference: value reference; each element has one of its own in FMI 2.0, the following ones.
        name: by which users find it.
        kind: ``INPUT``, ``OUTPUT``, ``FIXED`` or ``TUNABLE`` parameter, ``STATE`` or ``RATE``.
        member: of the C struct of the instance, such as ``inputs.span_muscle``.
        unit: SI unit; empty where none is declared.
        bounds: least and largest value, infinite where there is none.
        meaning: one phrase.
        start: value at the start; None where it is calculated.
        shape: () for a number.
        nominal: usual size of a state.
        silent: values of an input from and to which no warning is logged.
        state: reference of the state that a rate belongs to.
    """

    reference: int
    name: str
    kind: str
    member: str
    unit: str
    bounds: tuple[float, float]
    meaning: str
    start: float | list[float] | None = None
    shape: tuple[int, ...] = ()
    nominal: float | None = None
    silent: tuple[float, float] = (-math.inf, math.inf)
    state: int | None = None

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)

    def starts(self) -> list[float]:
        """Values at the start, element by element; empty where they are calculated."""
        return [] if self.start is None else np.ravel(self.start).tolist()


def variable_name(muscles: Sequence[str], muscle: str, what: str) -> str:
    """Name of a variable of a muscle; a single one needs no name."""
    return what if len(muscles) == 1 else f"{muscle}.{what}"


def fmu_variables(source: PartSource, *, states: bool) -> list[FmuVariable]:
    """The variables of a part, with value references from 1 on; 0 is the time.

    Args:
        source: the C of the part.
        states: whether continuous states and their rates are variables, as model exchange needs.

    Raises:
        InputError: two variables have the same name.
    """
    made: list[FmuVariable] = []
    next_free = 1
    for variable in _unnumbered(source, states):
        made.append(variable._replace(reference=next_free))
        next_free += variable.size
    references = {v.name: v.reference for v in made}
    numbered = [v._replace(state=references[v.name[4:-1]]) if v.kind == "RATE" else v for v in made]
    names = [v.name for v in numbered]
    for name in names:
        if names.count(name) > 1:
            raise InputError("muscles", None, f"must have other names: two variables would be called {name}")
    return numbered


def _unnumbered(source: PartSource, states: bool) -> Iterator[FmuVariable]:
    muscles = source.part.muscles
    for variable in source.of("inputs"):
        what, _, whose = variable.path.partition(".")
        name = variable.path if what == "command" else variable_name(muscles, whose, what)
        made = _of(variable, name, "INPUT", MEANINGS.get(what, variable.meaning))
        yield made._replace(silent=source.part.command_limits(whose)) if what == "command" else made
    for variable in source.of("outputs"):
        words = variable.path.split(".")
        what, whose = (words[2], words[1]) if words[0] == "muscle" else (words[0], words[1] if len(words) > 1 else "")
        if what in NOT_OFFERED:
            continue
        name = variable_name(muscles, whose, what) if whose else what
        yield _of(variable, name, "OUTPUT", MEANINGS.get(what, variable.meaning))._replace(start=None)
    meaning = (
        "0: rates belong to the time of the spans; 1: they are half a step older, as in a semi-implicit Euler method"
    )
    yield FmuVariable(0, "staggered", "FIXED", "staggered", "1", (0.0, 1.0), meaning, 0.0)
    for variable in source.of("parameters"):
        fixed = variable.path.startswith("start.")
        yield _of(variable, variable.path, "FIXED" if fixed else "TUNABLE", variable.meaning)
    if not states:
        return
    rates = source.of("rates")
    paths = {f"physics.{rate.path}" for rate in rates}
    for variable in source.of("state"):
        if variable.path in paths:
            name = variable.path.replace("physics.", "state.", 1)
            yield _of(variable, name, "STATE", variable.meaning)._replace(nominal=NOMINALS.get(variable.unit, 1.0))
    for rate in rates:
        yield _of(rate, f"der(state.{rate.path})", "RATE", rate.meaning)


def _of(variable: PartVariable, name: str, kind: str, meaning: str) -> FmuVariable:
    member, (unit, bounds) = f"{variable.group}.{variable.member}", (variable.unit, variable.bounds)
    return FmuVariable(0, name, kind, member, unit, bounds, meaning, variable.default, variable.shape)


DISPLAY_UNITS = {"Pa": ("bar", 1e-5), "m": ("mm", 1e3), "m^3": ("ml", 1e6)}
CAUSALITY = {
    "INPUT": ("input", "continuous", None),
    "OUTPUT": ("output", "continuous", "calculated"),
    "FIXED": ("parameter", "fixed", "exact"),
    "TUNABLE": ("parameter", "tunable", "exact"),
    "STATE": ("local", "continuous", "calculated"),
    "RATE": ("local", "continuous", "calculated"),
}
"""Causality, variability and initial value of each kind of variable."""
HEAD = '<?xml version="1.0" encoding="UTF-8"?>'
STEP = 1e-3  # of the importer, as the description proposes it [s]


class FmuDescription(NamedTuple):
    """What the XML of an FMU states.

    Attributes:
        name: identifier of the model.
        title: one phrase.
        statement: how the muscles are held, and what was assumed.
        token: by which importer and binary know each other.
        tool: that made the FMU.
        variables: all variables.
        sources: names of the C files.
        exchange: whether there is model exchange.
        memory: whether the part has memory, which is less accurate in model exchange.
    """

    name: str
    title: str
    statement: str
    token: str
    tool: str
    variables: Sequence[FmuVariable]
    sources: Sequence[str]
    exchange: bool
    memory: bool

    def of(self, *kinds: str) -> list[FmuVariable]:
        """The variables of some kinds."""
        return [v for v in self.variables if v.kind in kinds]

    @property
    def sentence(self) -> str:
        """What the FMU is."""
        more = "; friction follows the importer's integrator steps in model exchange" if self.memory else ""
        return f"{self.title}: spans in, tensions out{more if self.exchange else ''}; {self.statement}"


def _attributes(**values: object) -> str:
    """Attributes of an element; those that are None are left out."""

    def text(value: object) -> str:
        return (
            str(value).lower() if isinstance(value, bool) else repr(value) if isinstance(value, float) else str(value)
        )

    return "".join(f" {name}={quoteattr(text(value))}" for name, value in values.items() if value is not None)


def unit_definitions(of_variables: Iterable[str]) -> list[str]:
    """The lines of the XML that define the units of variables, and seconds."""
    units = dict.fromkeys(["s", *of_variables])
    lines = ["  <UnitDefinitions>"]
    for unit in units:
        base, display = "", ""
        with contextlib.suppress(ValueError):  # FMI has no word for half a power, as of m/N^0.5: its name stands alone
            base = f"<BaseUnit{_attributes(**base_exponents(unit))}/>"
        if unit in DISPLAY_UNITS:
            name, factor = DISPLAY_UNITS[unit]
            display = f"<DisplayUnit{_attributes(name=name, factor=factor)}/>"
        lines.append(f"    <Unit{_attributes(name=unit)}>{base}{display}</Unit>")
    return [*lines, "  </UnitDefinitions>"]


def _frame() -> list[str]:
    categories = ("logStatusWarning", "logStatusDiscard", "logStatusError")
    return [
        "  <LogCategories>",
        *(f"    <Category{_attributes(name=name)}/>" for name in categories),
        "  </LogCategories>",
        f"  <DefaultExperiment{_attributes(startTime=0.0, stopTime=1.0, stepSize=STEP)}/>",
    ]


def _known(variable: FmuVariable) -> dict[str, object]:
    causality, variability, initial = CAUSALITY[variable.kind]
    known: dict[str, object] = {"description": variable.meaning or None, "causality": causality}
    return known | {"variability": variability, "initial": initial}


def _numbers(variable: FmuVariable) -> dict[str, object]:
    limits = {name: float(b) for name, b in zip(("min", "max"), variable.bounds, strict=True) if math.isfinite(b)}
    return {"unit": variable.unit or None, "nominal": variable.nominal, **limits}


# ---- FMI 3.0


def description_3(fmu: FmuDescription) -> str:
    """The model description of FMI 3.0."""
    can = {"canGetAndSetFMUState": True, "canSerializeFMUState": True}
    head = _attributes(
        fmiVersion="3.0",
        modelName=fmu.name,
        instantiationToken=fmu.token,
        description=fmu.sentence,
        generationTool=fmu.tool,
        variableNamingConvention="structured",
    )
    lines = [HEAD, f"<fmiModelDescription{head}>"]
    if fmu.exchange:
        more = _attributes(modelIdentifier=fmu.name, needsCompletedIntegratorStep=True, **can)
        lines.append(f"  <ModelExchange{more}/>")
    more = _attributes(modelIdentifier=fmu.name, canHandleVariableCommunicationStepSize=True, **can)
    lines += [
        f"  <CoSimulation{more}/>",
        *unit_definitions(v.unit for v in fmu.variables if v.unit),
        *_frame(),
        "  <ModelVariables>",
    ]
    time = _attributes(name="time", valueReference=0, causality="independent", variability="continuous", unit="s")
    lines.append(f"    <Float64{time}/>")
    for v in fmu.variables:
        start = " ".join(map(repr, v.starts())) or None
        places = {"name": v.name, "valueReference": v.reference}
        attributes = _attributes(**places, **_known(v), **_numbers(v), derivative=v.state, start=start)
        dimensions = "".join(f"<Dimension{_attributes(start=n)}/>" for n in v.shape)
        lines.append(f"    <Float64{attributes}>{dimensions}</Float64>" if v.shape else f"    <Float64{attributes}/>")
    lines += ["  </ModelVariables>", "  <ModelStructure>"]
    lines += [f"    <Output{_attributes(valueReference=v.reference)}/>" for v in fmu.of("OUTPUT")]
    lines += [f"    <ContinuousStateDerivative{_attributes(valueReference=v.reference)}/>" for v in fmu.of("RATE")]
    unknown = fmu.of("OUTPUT", "STATE", "RATE")
    lines += [f"    <InitialUnknown{_attributes(valueReference=v.reference)}/>" for v in unknown]
    return "\n".join([*lines, "  </ModelStructure>", "</fmiModelDescription>", ""])


def terminals(muscles: Sequence[str]) -> str:
    """Terminals of FMI 3.0: of each muscle the tendon, with span, rate and tension."""
    lines = [HEAD, '<fmiTerminalsAndIcons fmiVersion="3.0">', "  <Terminals>"]
    for muscle in muscles:
        about = f"end of {muscle}, or of its tendon, at which the mechanism pulls"
        head = _attributes(name=muscle, matchingRule="plug", terminalKind="mckibben.tendon", description=about)
        lines.append(f"    <Terminal{head}>")
        for member in ("span", "rate", "tension"):
            name = variable_name(muscles, muscle, member)
            more = _attributes(variableName=name, memberName=member, variableKind="signal")
            lines.append(f"      <TerminalMemberVariable{more}/>")
        lines.append("    </Terminal>")
    return "\n".join([*lines, "  </Terminals>", "</fmiTerminalsAndIcons>", ""])


def build_description(fmu: FmuDescription) -> str:
    """How to build the sources, of FMI 3.0."""
    files = "".join(f"<SourceFile{_attributes(name=name)}/>" for name in fmu.sources)
    return f"""{HEAD}
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration{_attributes(modelIdentifier=fmu.name)}>
    <SourceFileSet language="C99" compilerOptions="-ffp-contract=off">{files}</SourceFileSet>
    <Library name="m" external="true"/>
  </BuildConfiguration>
</fmiBuildDescription>
"""


# ---- FMI 2.0


def description_2(fmu: FmuDescription) -> str:
    """The model description of FMI 2.0, in which the elements of an array are variables of their own."""
    files = "".join(f"<File{_attributes(name=name)}/>" for name in fmu.sources)
    can = {"canNotUseMemoryManagementFunctions": True, "canGetAndSetFMUstate": True, "canSerializeFMUstate": True}
    head = _attributes(
        fmiVersion="2.0",
        modelName=fmu.name,
        guid=fmu.token,
        description=fmu.sentence,
        generationTool=fmu.tool,
        variableNamingConvention="structured",
        numberOfEventIndicators=0,
    )
    lines = [HEAD, f"<fmiModelDescription{head}>"]
    if fmu.exchange:
        more = _attributes(modelIdentifier=fmu.name, **can)
        lines.append(f"  <ModelExchange{more}><SourceFiles>{files}</SourceFiles></ModelExchange>")
    step = {"canHandleVariableCommunicationStepSize": True, "canInterpolateInputs": True}
    more = _attributes(modelIdentifier=fmu.name, **step, **can)
    lines.append(f"  <CoSimulation{more}><SourceFiles>{files}</SourceFiles></CoSimulation>")
    lines += [*unit_definitions(v.unit for v in fmu.variables if v.unit), *_frame(), "  <ModelVariables>"]
    elements = [(v, k) for v in fmu.variables for k in range(v.size)]
    places = {v.reference + k: index for index, (v, k) in enumerate(elements, 1)}  # of elements by value reference
    for v, k in elements:
        name = f"{v.name}[{k + 1}]" if v.shape else v.name
        start = v.starts()[k] if v.start is not None else None
        state = None if v.state is None else places[v.state + k]
        known = _attributes(name=name, valueReference=v.reference + k, **_known(v))
        real = _attributes(**_numbers(v), start=start, derivative=state)
        lines.append(f"    <ScalarVariable{known}><Real{real}/></ScalarVariable>")
    lines += ["  </ModelVariables>", "  <ModelStructure>"]
    groups = (("Outputs", ("OUTPUT",)), ("Derivatives", ("RATE",)), ("InitialUnknowns", ("OUTPUT", "STATE", "RATE")))
    for group, kinds in groups:
        unknown = [places[v.reference + k] for v in fmu.of(*kinds) for k in range(v.size)]
        if unknown:
            entries = [f"      <Unknown{_attributes(index=index)}/>" for index in sorted(unknown)]
            lines += [f"    <{group}>", *entries, f"    </{group}>"]
    return "\n".join([*lines, "  </ModelStructure>", "</fmiModelDescription>", ""])
