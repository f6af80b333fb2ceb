"""XML of an FMU: model description of FMI 2.0 and 3.0, terminals, and how to build the sources."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from ...quantities import base_exponents
from .variables import FmuVariable

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
    return "".join(f" {name}={quoteattr(_text(value))}" for name, value in values.items() if value is not None)


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value) if isinstance(value, float) else str(value)


def _units(variables: Iterable[FmuVariable]) -> list[str]:
    """Definitions of all units."""
    units = dict.fromkeys(["s", *(v.unit for v in variables if v.unit)])
    lines = ["  <UnitDefinitions>"]
    for unit in units:
        base = _attributes(**base_exponents(unit))
        display = ""
        if unit in DISPLAY_UNITS:
            name, factor = DISPLAY_UNITS[unit]
            display = f"<DisplayUnit{_attributes(name=name, factor=factor)}/>"
        lines.append(f"    <Unit{_attributes(name=unit)}><BaseUnit{base}/>{display}</Unit>")
    return [*lines, "  </UnitDefinitions>"]


def _frame() -> list[str]:
    return [
        "  <LogCategories>",
        *(
            f"    <Category{_attributes(name=name)}/>"
            for name in ("logStatusWarning", "logStatusDiscard", "logStatusError")
        ),
        "  </LogCategories>",
        f"  <DefaultExperiment{_attributes(startTime=0.0, stopTime=1.0, stepSize=STEP)}/>",
    ]


def _limits(variable: FmuVariable) -> dict[str, float]:
    low, high = variable.bounds
    return {name: float(b) for name, b in (("min", low), ("max", high)) if math.isfinite(b)}


def _known(variable: FmuVariable) -> dict[str, object]:
    causality, variability, initial = CAUSALITY[variable.kind]
    known: dict[str, object] = {"description": variable.meaning or None, "causality": causality}
    return known | {"variability": variability, "initial": initial}


def _numbers(variable: FmuVariable) -> dict[str, object]:
    """Unit, usual size and limits."""
    return {"unit": variable.unit or None, "nominal": variable.nominal, **_limits(variable)}


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
    lines += [f"  <CoSimulation{more}/>", *_units(fmu.variables), *_frame(), "  <ModelVariables>"]
    time = _attributes(name="time", valueReference=0, causality="independent", variability="continuous", unit="s")
    lines += [f"    <Float64{time}/>", *_variables_3(fmu), "  </ModelVariables>", "  <ModelStructure>"]
    lines += [f"    <Output{_attributes(valueReference=v.reference)}/>" for v in fmu.of("OUTPUT")]
    lines += [f"    <ContinuousStateDerivative{_attributes(valueReference=v.reference)}/>" for v in fmu.of("RATE")]
    unknown = fmu.of("OUTPUT", "STATE", "RATE")
    lines += [f"    <InitialUnknown{_attributes(valueReference=v.reference)}/>" for v in unknown]
    return "\n".join([*lines, "  </ModelStructure>", "</fmiModelDescription>", ""])


def _variables_3(fmu: FmuDescription) -> Iterator[str]:
    for v in fmu.variables:
        start = " ".join(map(repr, v.starts())) or None
        attributes = _attributes(
            name=v.name, valueReference=v.reference, **_known(v), **_numbers(v), derivative=v.state, start=start
        )
        if v.shape:
            dimensions = "".join(f"<Dimension{_attributes(start=n)}/>" for n in v.shape)
            yield f"    <Float64{attributes}>{dimensions}</Float64>"
        else:
            yield f"    <Float64{attributes}/>"


def terminals(muscles: Sequence[str]) -> str:
    """Terminals of FMI 3.0: of each muscle the tendon, with span, rate and tension."""
    lines = [HEAD, '<fmiTerminalsAndIcons fmiVersion="3.0">', "  <Terminals>"]
    for muscle in muscles:
        about = f"end of {muscle}, or of its tendon, at which the mechanism pulls"
        head = _attributes(name=muscle, matchingRule="plug", terminalKind="mckibben.tendon", description=about)
        lines.append(f"    <Terminal{head}>")
        for member in ("span", "rate", "tension"):
            name = member if len(muscles) == 1 else f"{muscle}.{member}"
            more = _attributes(variableName=name, memberName=member, variableKind="signal")
            lines.append(f"      <TerminalMemberVariable{more}/>")
        lines.append("    </Terminal>")
    return "\n".join([*lines, "  </Terminals>", "</fmiTerminalsAndIcons>", ""])


def build_description(fmu: FmuDescription) -> str:
    """How to build the sources, of FMI 3.0."""
    files = "".join(f"<SourceFile{_attributes(name=name)}/>" for name in fmu.sources)
    return "\n".join(
        [
            HEAD,
            '<fmiBuildDescription fmiVersion="3.0">',
            f"  <BuildConfiguration{_attributes(modelIdentifier=fmu.name)}>",
            f'    <SourceFileSet language="C99" compilerOptions="-ffp-contract=off">{files}</SourceFileSet>',
            '    <Library name="m" external="true"/>',
            "  </BuildConfiguration>",
            "</fmiBuildDescription>",
            "",
        ]
    )


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
    lines += [*_units(fmu.variables), *_frame(), "  <ModelVariables>"]
    places, texts = _variables_2(fmu)
    lines += [*texts, "  </ModelVariables>", "  <ModelStructure>"]
    groups = (("Outputs", ("OUTPUT",)), ("Derivatives", ("RATE",)), ("InitialUnknowns", ("OUTPUT", "STATE", "RATE")))
    for group, kinds in groups:
        unknown = [places[v.reference + k] for v in fmu.of(*kinds) for k in range(v.size)]
        if unknown:
            entries = [f"      <Unknown{_attributes(index=index)}/>" for index in sorted(unknown)]
            lines += [f"    <{group}>", *entries, f"    </{group}>"]
    return "\n".join([*lines, "  </ModelStructure>", "</fmiModelDescription>", ""])


def _variables_2(fmu: FmuDescription) -> tuple[dict[int, int], list[str]]:
    """Index of each element by value reference, from 1 on, and the variables."""
    elements = [(v, k) for v in fmu.variables for k in range(v.size)]
    places = {v.reference + k: index for index, (v, k) in enumerate(elements, 1)}
    lines = []
    for v, k in elements:
        name = f"{v.name}[{k + 1}]" if v.shape else v.name
        start = v.starts()[k] if v.start is not None else None
        state = None if v.state is None else places[v.state + k]
        known = _attributes(name=name, valueReference=v.reference + k, **_known(v))
        real = _attributes(**_numbers(v), start=start, derivative=state)
        lines.append(f"    <ScalarVariable{known}><Real{real}/></ScalarVariable>")
    return places, lines
