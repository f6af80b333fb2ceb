"""Verbs: public functions whose signature and docstring are all that a command, a form and a reference page need.

    @verb
    def tension(muscle: MuscleOrLaw, *, length: Length | None = None) -> Tensions:

The annotation of a parameter says what it takes: unit, usual range, names to choose from. The words of help are those of the
docstring's ``Args``. Both are read from the source, so that a command shows its help without importing what computes.
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import importlib
import importlib.util
import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, ParamSpec, TypeVar, cast, get_args

from .accessors import PLACES
from .answers import Answer, Caution, collect, warn
from .errors import InputError, each_once
from .quantities import in_si, parse, split_values, values_in_si

PACKAGE = Path(__file__).parent
P = ParamSpec("P")
A = TypeVar("A", bound=Answer)


class ParameterType(NamedTuple):
    """What a parameter takes.

    Attributes:
        word: stands for a value in a usage line, such as LENGTH.
        unit: SI unit of a quantity, else empty.
        range: within which such a quantity lies at muscles, rigs and their air [unit]; outside a value is a slip.
        names: lists the known names, for the shell.
        suffixes: of files that are taken, ``("",)`` for any; folders end in a slash.
        listed: whether several values are separated by commas.
        bare: whether a number in a text may lack its unit, which is then the SI one.
        none: whether the word ``none`` stands for no value at all.
        parts: parameters of another verb, by its place, that such a one has under their names, as options of a file format.
        least: smallest whole number that is taken; None for any.
    """

    word: str = ""
    unit: str = ""
    range: tuple[float, float] | None = None
    names: Callable[[], Iterable[tuple[str, str]]] | None = None
    suffixes: tuple[str, ...] = ()
    listed: bool = False
    bare: bool = False
    none: bool = False
    parts: tuple[str, tuple[str, ...]] = ("", ())
    least: int | None = None


QUANTITIES = {
    kind.word: kind
    for kind in (
        ParameterType("LENGTH", "m", (1e-3, 20.0)),
        ParameterType("SIZE", "m", (1e-5, 0.5)),  # small: a diameter, a thickness, a moment arm, an error of a length
        ParameterType("PRESSURE", "Pa", (1e3, 3e6)),
        ParameterType("FORCE", "N", (1e-2, 5e4)),
        ParameterType("TIME", "s", (1e-7, 1e10)),
        ParameterType("FREQUENCY", "1/s", (1e-4, 1e5)),
        ParameterType("SPEED", "m/s", (1e-5, 20.0)),
        ParameterType("ANGLE", "rad", (1e-4, 7.0)),
        ParameterType("INERTIA", "kg*m^2", (1e-8, 10.0)),
        ParameterType("STIFFNESS", "N/m", (1e2, 1e8)),
        ParameterType("ACCELERATION", "m/s^2", (1.0, 30.0)),
        ParameterType("SHARE", "1", (1e-9, 2.0)),
        ParameterType("SHARES", "1", (0.0, 1.0), listed=True),
        ParameterType("CONTRACTION", "1", (1e-4, 0.5)),
        ParameterType("ACTIVATION", "1", (1e-4, 1.0)),
        ParameterType("LENGTHS", "m", (1e-4, 20.0), listed=True),
        ParameterType("PRESSURES", "Pa", (1e3, 3e6), listed=True),
        ParameterType("MASS", "kg", (1e-4, 1e3)),
        ParameterType("ENERGY", "J", (1e-2, 1e9)),
        ParameterType("FLOW", "m^3/s", (1e-8, 0.2)),
        ParameterType("AIRVOLUME", "m^3", (1e-8, 0.1)),
        ParameterType("MASSES", "kg", (1e-3, 2e3), listed=True),
        ParameterType("FREQUENCIES", "1/s", (1e-4, 1e5), listed=True),
    )
}
Length = Annotated[float | str, QUANTITIES["LENGTH"]]
Pressure = Annotated[float | str, QUANTITIES["PRESSURE"]]
Force = Annotated[float | str, QUANTITIES["FORCE"]]
Contraction = Annotated[float | str, QUANTITIES["CONTRACTION"]]
Activation = Annotated[float | str, QUANTITIES["ACTIVATION"]]
Mass = Annotated[float | str, QUANTITIES["MASS"]]
Energy = Annotated[float | str, QUANTITIES["ENERGY"]]
AirVolume = Annotated[float | str, QUANTITIES["AIRVOLUME"]]
Diameter = Annotated[float | str, QUANTITIES["SIZE"]]
SmallLength = Annotated[float | str, QUANTITIES["SIZE"]]
# What one asks of a muscle is within narrower bounds than what a rig or a recording may have.
WorkingForce = Annotated[float | str, ParameterType("FORCE", "N", (1e-2, 2e4))]
Stroke = Annotated[float | str, ParameterType("LENGTH", "m", (1e-4, 2.0))]
OverallLength = Annotated[float | str, ParameterType("LENGTH", "m", (1e-2, 5.0))]
TubeLength = Annotated[float | str, ParameterType("LENGTH", "m", (5e-3, 50.0))]
WorkingSpeed = Annotated[float | str, ParameterType("SPEED", "m/s", (1e-4, 5.0))]
CycleRate = Annotated[float | str, ParameterType("FREQUENCY", "1/s", (1e-4, 100.0))]
TimePerDay = Annotated[float | str, ParameterType("TIME", "s", (1.0, 1e5))]
MuscleName = Annotated[Any, ParameterType("SPECIMEN")]
MuscleOrLaw = Annotated[Any, ParameterType("SPECIMEN|LAW")]
LawName = Annotated[str, ParameterType("LAW")]
LawPair = Annotated[Sequence[str] | str, ParameterType("LAWS")]  # in one text with a comma between
CycleName = Annotated[str, ParameterType("CYCLE")]
SpaceText = Annotated[str, ParameterType("LENGTHxDIAMETER")]
TankText = Annotated[str, ParameterType("TANK")]
ValveName = Annotated[str, ParameterType("VALVE")]
VolumeName = Annotated[str, ParameterType("VOLUME")]
ReadingName = Annotated[str, ParameterType("READING")]
RigName = Annotated[Any, ParameterType("RIG")]
PlumbingName = Annotated[str, ParameterType("PLUMBING")]
NamedValues = Annotated[Mapping[str, str], ParameterType("NAME=VALUE")]
PosteriorFile = Annotated[Any, ParameterType("FIT")]
Changes = Annotated[Mapping[str, float | str], ParameterType("PATH=VALUE")]
Time = Annotated[float | str, QUANTITIES["TIME"]._replace(bare=True)]
Duration = Annotated[float | str, QUANTITIES["TIME"]]
Frequency = Annotated[float | str, QUANTITIES["FREQUENCY"]]
Frequencies = Annotated[Sequence[float | str] | str, QUANTITIES["FREQUENCIES"]]
Lengths = Annotated[Sequence[float | str] | str, QUANTITIES["LENGTHS"]]
Pressures = Annotated[Sequence[float | str] | str, QUANTITIES["PRESSURES"]]
FilePressures = Annotated[Sequence[float | str] | str, QUANTITIES["PRESSURES"]._replace(word="PRESSURE")]
Masses = Annotated[Sequence[float | str] | str, QUANTITIES["MASSES"]]
Stiffness = Annotated[float | str, QUANTITIES["STIFFNESS"]]
CalibrationFile = Annotated[Any, ParameterType("CALIBRATION")]
MachineName = Annotated[str, ParameterType("MACHINE")]
Acceleration = Annotated[float | str, QUANTITIES["ACCELERATION"]]
Share = Annotated[float | str, QUANTITIES["SHARE"]]
Shares = Annotated[Sequence[float | str] | str, QUANTITIES["SHARES"]._replace(none=True)]
BarePressure = Annotated[float | str, QUANTITIES["PRESSURE"]._replace(bare=True)]
TensionReading = Annotated[str, ParameterType("LENGTH,PRESSURE,FORCE")]
Count = Annotated[int, ParameterType("N")]
RecordingFile = Annotated[Any, ParameterType("RECORDING")]  # or the recording itself
RecordFiles = Annotated[Any, ParameterType("RECORD", listed=True)]  # files, folders and patterns of any format
MeasuredTable = Annotated[Any, ParameterType("TABLE")]  # a file, a specimen that ships with one, or what was read
LoopFile = Annotated[Any, ParameterType("TABLE")]
ConstraintsFile = Annotated[Any, ParameterType("TABLE")]
LoopFriction = Annotated[str, ParameterType("FRICTION")]
DataFolder = Annotated[Any, ParameterType("FOLDER")]
DataFolders = Annotated[Any, ParameterType("FOLDER", listed=True)]
DataSet = Annotated[str, ParameterType("DATASET")]
ParameterPath = Annotated[str, ParameterType("PATH")]
FrictionModel = Annotated[str, ParameterType("MODEL")]
DataFile = Annotated[Any, ParameterType("FILE")]  # of any format, or what was read from one
ChannelName = Annotated[str, ParameterType("CHANNEL")]
CutPoint = Annotated[str, ParameterType("POINT")]
ForceLevel = Annotated[str, ParameterType("LEVEL")]
CycleNumbers = Annotated[Sequence[int] | str, ParameterType("CYCLES")]
FileColumns = Annotated[Mapping[str, str | int], ParameterType("NAME=COLUMN")]
FileUnits = Annotated[Mapping[str, str], ParameterType("NAME=UNIT")]
FileScales = Annotated[Mapping[str, str], ParameterType("NAME=SCALE")]
FileKind = Annotated[Literal["map", "recording"], ParameterType("KIND")]
DecimalMark = Annotated[Literal[".", ","], ParameterType("MARK")]
Header = Annotated[str, ParameterType("NAMES")]
Label = Annotated[str, ParameterType("LABEL")]
Inertia = Annotated[float | str, QUANTITIES["INERTIA"]]
Course = Annotated[str, ParameterType("COURSE")]
Courses = Annotated[Mapping[str, str], ParameterType("NAME=COURSE")]
RecordFile = Annotated[Any, ParameterType("RECORD")]
Seed = Annotated[int, ParameterType("N", least=0)]
WorkerCount = Annotated[int, ParameterType("N", least=0)]
SchedulerName = Annotated[str, ParameterType("SCHEDULER")]
SweepFile = Annotated[Any, ParameterType("SWEEP")]
ResultFolder = Annotated[Any, ParameterType("FOLDER")]
SignalName = Annotated[str, ParameterType("SIGNAL")]
CircuitFile = Annotated[Any, ParameterType("CIRCUIT")]
PartName = Annotated[str, ParameterType("PART")]
ProtocolName = Annotated[Any, ParameterType("PROTOCOL")]
Flow = Annotated[float | str, QUANTITIES["FLOW"]]
Angle = Annotated[float | str, QUANTITIES["ANGLE"]]
Hardness = Annotated[float | str, ParameterType("HARDNESS")]
Sheet = Annotated[str | int, ParameterType("SHEET")]
Topic = Annotated[str, ParameterType("TOPIC")]
PlainNumber = Annotated[float | str, ParameterType("NUMBER")]
# How the file of another program is understood.
READING = ("columns", "units", "scales", "period", "decimal", "header", "sheet", "topic", "gear_ratio")
FILE = PLACES["describe_file"]
Reading = Annotated[Mapping[str, Any], ParameterType("READING", parts=(FILE, READING))]
PATH_READING = ("columns", "units", "pressure_zero")
MAP_READING = (*PATH_READING, "pressure", "length_zero", "branch", "decimal", "header", "sheet", "topic", "gear_ratio")
PathReading = Annotated[Mapping[str, Any], ParameterType("READING", parts=(FILE, PATH_READING))]
MapReading = Annotated[Mapping[str, Any], ParameterType("READING", parts=(FILE, MAP_READING))]


class ParsedNumber(float):
    """A number [SI] that knows the `text` that it was read from, for sentences; arithmetic gives plain numbers."""

    text: str

    def __new__(cls, value: float, text: str) -> ParsedNumber:
        """A number with its text."""
        number = super().__new__(cls, value)
        number.text = text
        return number

    def __str__(self) -> str:
        return self.text

    def __reduce__(self) -> tuple[Any, ...]:
        return ParsedNumber, (float(self), self.text)


class ParsedList(list[float]):
    """Numbers [SI] that know the `text` that they were read from; empty where they were given as numbers."""

    text = ""


def typed(value: object) -> str | None:
    """A value as a person gave it, for sentences about it; None of what is neither number nor text."""
    if isinstance(value, ParsedNumber | ParsedList):
        return value.text or None
    return value if isinstance(value, str) else f"{value:g}" if isinstance(value, int | float) else None


@dataclass(frozen=True)
class Parameter:
    """A parameter of a verb: all that a command, a form and a page show of it.

    Attributes:
        name: in the signature.
        type: what it takes; without a word for a flag and for what only Python gives.
        default: in the signature.
        required: whether it has none.
        keyword: whether it is given by its name only.
        several: whether any number of values are given in its place.
        many: whether it takes several values: of a quantity a list or a range in one text.
        flag: whether it is true or false.
        about: words of help.
        parts: parameters that it has under their names; whoever types them gives each by itself.

    What has neither a type nor is a flag only Python gives, such as a function that is told of progress.
    """

    name: str
    type: ParameterType
    default: Any
    required: bool
    keyword: bool
    several: bool
    many: bool
    flag: bool
    about: str
    parts: tuple[Parameter, ...] = ()

    def read(self, value: Any) -> Any:
        """A value as the function takes it: text with a unit becomes SI."""
        unit = self.type.unit
        if value is None:
            return value
        if self.type.least is not None and not (isinstance(value, int) and value >= self.type.least):
            raise InputError(self.name, value, f"must be a whole number of {self.type.least} or more")
        if self.flag and not isinstance(value, bool):
            raise InputError(self.name, None, f"must be True or False, got {value!r}")
        if self.parts:
            known = {part.name: part for part in self.parts}
            if not isinstance(value, Mapping):
                raise InputError(self.name, str(value), f"must be a table with some of {', '.join(known)}")
            return {name: known[name].read(one) if name in known else one for name, one in value.items()}
        if not unit:
            if self.many and isinstance(value, Mapping | int | float):
                raise InputError(self.name, None, f"must be a name or several, got {value!r}")
            if self.many and isinstance(value, list | tuple) and "," not in self.type.word:  # two readings may be alike
                value = each_once(self.name, value)
            return value
        if not self.many:
            typed_bare = self.type.bare and isinstance(value, str)
            number = (
                parse(value, unit, field=self.name, bare=True) if typed_bare else in_si(value, unit, field=self.name)
            )
            return ParsedNumber(float(number), value) if isinstance(value, str) else number
        if self.type.none and isinstance(value, str) and value.strip() == "none":
            return ParsedList()
        words = value
        if isinstance(value, str) and not (":" in value or ";" in value or ", " in value):
            # a comma alone parts values of lists; elsewhere it may be meant as that of a decimal
            words = split_values(value, field=self.name) if self.type.listed and value.strip() else [value]
        numbers = ParsedList(values_in_si(words, unit, field=self.name))
        numbers.text = value if isinstance(value, str) else ""
        return numbers


@dataclass(frozen=True)
class Description:
    """A verb as its source describes it: words of help and parameters."""

    name: str
    paragraphs: tuple[str, ...]
    parameters: Mapping[str, Parameter]


@functools.cache
def described(place: str) -> Description:
    """Read a verb's signature and docstring from its source, which is not imported.

    Args:
        place: module and name within the package, such as ``studies.tension:tension``; the module of another package by its
            whole name. It may declare types of its own, as this module declares `Length`.
    """
    module, _, name = place.partition(":")
    first, *inside = _module(module).split(".")
    spec = cast(ModuleSpec, importlib.util.find_spec(first))
    tree = ast.parse(Path(str(spec.origin)).parent.joinpath(*inside).with_suffix(".py").read_text(encoding="utf-8"))
    node = next(n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == name)
    known = globals() | {
        ast.unparse(n.targets[0]): Annotated[Any, own]
        for n in tree.body
        if isinstance(n, ast.Assign) and (own := _own_type(n.value)) is not None
    }
    head, *sections = re.split(r"^(?=\w+:$)", ast.get_docstring(node) or "", flags=re.MULTILINE)
    section = next((one.removeprefix("Args:\n") for one in sections if one.startswith("Args:")), "")
    words = {m[1]: _words(m[2]) for m in re.finditer(r"^ {4}(\w+): (.*?)(?=^ {4}[*\w]|\Z)", section, re.M | re.S)}
    several = [] if node.args.vararg is None else [node.args.vararg]
    arguments = [*node.args.args, *several, *node.args.kwonlyargs]
    without = len(node.args.args) - len(node.args.defaults)
    defaults = [*[None] * without, *node.args.defaults, *[None] * len(several), *node.args.kw_defaults]
    parameters = {}
    for argument, default in zip(arguments, defaults, strict=True):
        annotation = ast.unparse(cast(ast.expr, argument.annotation))
        named = [known[word] for word in re.findall(r"\w+", annotation) if word in known]
        types = [one for alias in named for one in get_args(alias) if isinstance(one, ParameterType)]
        kind = types[0] if types else ParameterType()
        whole, names = kind.parts
        parameters[argument.arg] = Parameter(
            argument.arg,
            kind,
            None if default is None else ast.literal_eval(default),
            required=default is None,
            keyword=argument in node.args.kwonlyargs,
            several=argument in several,
            many="Sequence" in annotation or kind.listed or argument in several,
            flag=annotation == "bool",
            about=words.get(argument.arg, ""),
            parts=tuple(described(whole).parameters[part] for part in names),
        )
    return Description(name, tuple(_words(p) for p in head.split("\n\n") if p.strip()), parameters)


def _own_type(value: ast.expr) -> ParameterType | None:
    """The type that `Annotated[.., ParameterType(..)]` states in literals; None of any other expression."""
    calls = [n for n in ast.walk(value) if isinstance(n, ast.Call) and ast.unparse(n.func) == "ParameterType"]
    if not isinstance(value, ast.Subscript) or len(calls) != 1:
        return None
    given = {word.arg: ast.literal_eval(word.value) for word in calls[0].keywords if word.arg}
    return ParameterType(*map(ast.literal_eval, calls[0].args), **given)


def _words(text: str) -> str:
    """Words of a docstring for people: without marks and, but for quoted ones, SI units, beginning with a capital."""
    plain = re.sub(r"\s\[[^\]]{1,8}\](?!')", "", " ".join(text.split())).replace("``", "")
    return plain[:1].upper() + plain[1:]


def verb(function: Callable[P, A]) -> Callable[P, A]:
    """Make of a function one that takes text with units, and whose answer says which values can only be slips.

    Cautions of the answer go out as warnings too. A sentence that is to be read at a command line as well names other
    parameters in braces: ``"is allowed only without {pressure}"``, or ``"{lines=False}"`` with the value of a flag.
    """

    @functools.wraps(function)
    def ask(*positional: P.args, **named: P.kwargs) -> A:
        values = dict(inspect.signature(function).bind(*positional, **named).arguments)
        found = answer(function, values | values.pop("options", {}))  # what a signature leaves open goes on as it is
        warn(found.cautions)
        return found

    return ask


def answer(function: Callable[..., A], values: Mapping[str, Any], shown: Callable[[str], str] = str) -> A:
    """Ask a verb.

    Args:
        function: the verb.
        values: of its parameters by name, as a person gives them.
        shown: how whoever asks calls a parameter, such as ``--length``.

    Raises:
        InputError: a value is refused; the sentence calls parameters as `shown` does.
    """
    function = inspect.unwrap(function)
    place = f"{function.__module__.removeprefix(f'{__package__}.')}:{function.__name__}"
    parameters = described(place).parameters
    # A default in words is read as what is typed is.
    words = {name: p.default for name, p in parameters.items() if p.type.unit and isinstance(p.default, str)}
    values = words | dict(values)
    try:
        read = {name: parameters[name].read(value) for name, value in values.items() if name in parameters}
        every = {**values, **read}
        several = next((name for name, p in parameters.items() if p.several), "")
        found = function(*every.pop(several, ()), **every)
    except InputError as error:
        for slip in _slips(parameters, values):
            if slip.parameter == error.field.replace("_", " ") and "; was " in slip.text:
                error = error.changed(problem=f"{error.problem}; was {slip.text.partition('; was ')[2]}")
        parts = {part.name: part for one in parameters.values() for part in one.parts}
        if error.field in parts:  # how a file is read is said by whoever has it read
            where = "" if error.where is None else f"{error.where}: "
            error = error.changed(field=f"{where}{shown(error.field)}", where="")
        raise _renamed(error, parts | dict(parameters), shown) from None
    own = [dataclasses.replace(one, text=_called(one.text, parameters, shown)) for one in found.cautions]
    slips = (one for one in _slips(parameters, values) if one.parameter not in {said.parameter for said in own})
    cautions = collect(*own, *slips)
    return found if cautions == found.cautions else cast(A, dataclasses.replace(cast(Any, found), cautions=cautions))


def load(place: str) -> Callable[..., Answer]:
    """Import a verb by its place."""
    module, _, name = place.partition(":")
    return cast(Callable[..., Answer], getattr(importlib.import_module(_module(module)), name))


def _module(name: str) -> str:
    """The whole name of a module: of this package where it has one of that name, else of another."""
    first = PACKAGE / name.partition(".")[0]
    return f"{__package__}.{name}" if first.is_dir() or first.with_suffix(".py").is_file() else name


def _renamed(error: InputError, parameters: Mapping[str, Parameter], shown: Callable[[str], str]) -> InputError:
    """An error with parameters called as somebody calls them."""
    called = functools.partial(_called, parameters=parameters, shown=shown)
    name, dot, key = error.field.partition(".")
    name = name if name in parameters else f"{name}s"  # one of several
    known = name in parameters and error.where is None  # else the field of a file
    field = shown(name) + (f" {key}" if dot and shown is not str else dot + key) if known else called(error.field)
    sentence = None if error.sentence is None else called(error.sentence)
    value = str(error.value) if isinstance(error.value, ParsedNumber) else None  # as it was typed
    return error.changed(field=field, value=value, problem=called(error.problem), sentence=sentence)


def _called(text: str, parameters: Mapping[str, Parameter], shown: Callable[[str], str]) -> str:
    """A sentence whose parameters in braces are called as somebody calls them."""

    def one(found: re.Match[str]) -> str:
        value = (found[2] or "") if shown is str else ""  # an option of its own stands for a flag with its value
        return shown(found[1]) + value if found[1] in parameters else found[0]

    return re.sub(r"\{(\w+)(=\w+)?\}", one, text)


def _slips(parameters: Mapping[str, Parameter], values: Mapping[str, Any]) -> Iterator[Caution]:
    """Cautions about values whose size can only be a slip."""
    for name, value in values.items():
        kind = parameters[name].type if name in parameters else ParameterType()
        if isinstance(value, Mapping) and kind.parts[1]:
            yield from _slips({part.name: part for part in parameters[name].parts}, value)
            continue
        changes = kind.word == "PATH=VALUE" and isinstance(value, Mapping)
        texts: Sequence[tuple[str, Any]] = [*value.items()] if changes else [(name, value)]
        for key, text in texts:
            if isinstance(text, str | int | float | list | tuple) and (kind.range or changes):
                from .slips import size_caution

                several = re.split(" *[,;] *", text) if (kind.listed or changes) and isinstance(text, str) else text
                for one in several if isinstance(several, list | tuple) else [several]:
                    slip = size_caution(one, kind.unit, name=key.replace("_", " "), usual=kind.range)
                    if slip is not None:
                        yield slip
