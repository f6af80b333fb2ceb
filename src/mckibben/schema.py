"""Reading and writing of tables: a type declares its fields once, and its tables of text follow from that.

    @dataclass(frozen=True, kw_only=True)
    class Counter:
        counter: str = word("terminal of the counter")
        frequency: float = number("1/s", (1e-3, 1e7), "of the clock", default=1e6)
        bits: int = whole(1, 64, "of the count", default=32)

    read_table(Counter, FileTable({"counter": "Dev1/ctr0", "frequency": "1 MHz"}, "daq.encoder", "rig.toml"))

Fields declared with `quantities.quantity` are numbers of their unit and bounds; a field of plain type ``int``, ``str`` or
``bool`` needs no declaration. Complaints name the file, the dotted path of the field, its value and what it must be.
"""

from __future__ import annotations

import dataclasses
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

from .documents import JsonValue
from .errors import InputError, choice, each_once
from .quantities import Quantity, declared, parse

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")
NAME = r"[A-Za-z][A-Za-z0-9_-]*"
_NOTHING: Mapping[str, str] = MappingProxyType({})
FORM_KEYS = 3  # of a table that requires none, in an example
_REST = "*"  # stands for all keys that no field has


@dataclass(frozen=True)
class FileTable:
    """A table of a file: its values, its dotted path, and the file."""

    values: Mapping[str, Any]
    path: str = ""
    where: str = ""

    @classmethod
    def of(cls, value: object, path: str, where: str) -> FileTable:
        """Make one of a value that must be a table."""
        if not isinstance(value, Mapping):
            head = f", [{path}]" if re.fullmatch(rf"{NAME}(\.{NAME})*", path) else ""  # a place in a list has none
            raise InputError(path or "file", shown(value), f"must be a table{head}", where=where)
        return cls(value, path, where)

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def field(self, key: str) -> str:
        """The dotted path of a key."""
        return f"{self.path}.{key}" if self.path else key

    def fail(self, key: str, value: object, problem: str = "", *, known: Iterable[object] | None = None) -> InputError:
        """Return an error about the value of a key; arguments as for `InputError`."""
        return InputError(self.field(key), shown(value), problem, known=known, where=self.where or None)

    def located(self, error: InputError) -> InputError:
        """Make the error message of a part that does not know its path one about this table."""
        inside = error.field if self.path and error.field.startswith(f"{self.path}.") else self.field(error.field)
        return error.changed(field=inside, where=self.where or None)

    def schema(self, version: int) -> None:
        """Refuse a file whose ``schema`` is not the one version that is read."""
        stated = self.values.get("schema")
        if stated is None:
            raise self.fail("schema", None, f"is missing: this version of mckibben reads schema {version}")
        if stated != version or isinstance(stated, bool):
            raise self.fail("schema", stated, f"must be {version}, the schema that this version of mckibben reads")

    def only(self, known: Iterable[str], owner: str = "") -> None:
        """Refuse keys that are not known; `owner` begins the list of those that are, such as ``a step has``."""
        names = list(known)
        for key in self.values:
            if key not in names:
                raise self.fail(key, None, owner, known=names)

    def word(self, key: str, default: str | None = None, *, among: Iterable[str] | None = None) -> str:
        """Read a text that is not blank, one of some where they are given."""
        value = self.values.get(key, default)
        names = None if among is None else list(among)
        if value is None:
            raise self.fail(key, None, "is missing" if names is None else f"is missing: it must be {choice(names)}")
        if not isinstance(value, str) or not value.strip():
            raise self.fail(key, value, "must be a word")
        if names is not None and value not in names:
            raise self.fail(key, value, known=names)
        return value

    def text(self, key: str) -> str:
        """Read a text, or nothing if it is left out."""
        return self.word(key) if key in self.values else ""

    def texts(self, key: str, demand: str = "must be a list of words") -> tuple[str, ...]:
        """Read a list of texts, empty if it is left out."""
        raw = self.values.get(key, [])
        if not isinstance(raw, list | tuple) or not all(isinstance(v, str) for v in raw):
            raise self.fail(key, raw, f"{demand}{_as_list(raw)}")
        return tuple(raw)

    def number(self, key: str, unit: str, default: float | None = None, *, declared: Quantity | None = None) -> float:
        """Read a number with its unit, as SI, within the bounds of a declaration."""
        if key not in self.values and default is not None:
            return default
        if key not in self.values:
            raise self.fail(key, None, "is missing")
        bounds = (-math.inf, math.inf) if declared is None else declared.bounds
        return read_number(self.values[key], unit, bounds, self.field(key), self.where or None)

    def whole(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """Read a whole number between bounds, inclusive; it may be written as a word."""
        raw = self.values.get(key, default)
        if raw is None:
            raise self.fail(key, None, "is missing")
        return read_whole(raw, low, high, self.field(key), self.where or None)

    def flag(self, key: str, default: bool) -> bool:
        """Read true or false."""
        value = self.values.get(key, default)
        if not isinstance(value, bool):
            raise self.fail(key, value, "must be true or false")
        return value

    def table(self, key: str) -> FileTable:
        """The table below a key; empty if it is left out."""
        return FileTable.of(self.values.get(key, {}), self.field(key), self.where)

    def tables(self, key: str, pattern: str = NAME) -> Iterator[tuple[str, FileTable]]:
        """Iterate over the named tables below a key."""
        below = self.table(key)
        for name in below.values:
            if not re.fullmatch(pattern, name):
                raise below.fail(name, name, "must be a name of letters, digits, - and _ that begins with a letter")
            yield name, below.table(name)

    def listed(self, key: str) -> tuple[FileTable, ...]:
        """Tables of the list below a key, their places counted from 1."""
        raw = self.values.get(key, [])
        if not isinstance(raw, list | tuple):
            raise self.fail(key, raw, f"must be a list of tables, [[{key}]]")
        return tuple(FileTable.of(one, self.field(f"{key}.{i}"), self.where) for i, one in enumerate(raw, 1))

    def derived(self, values: Mapping[str, JsonValue]) -> FileTable:
        """A table at the same place with other values."""
        return dataclasses.replace(self, values=values)

    def without(self, *keys: str) -> FileTable:
        """Return the table without some keys."""
        return self.derived({k: v for k, v in self.values.items() if k not in keys})


class FrozenTable(Mapping[str, Any]):
    """An immutable, hashable table."""

    def __init__(self, values: Mapping[str, JsonValue]) -> None:
        self._values = {str(k): frozen(v) for k, v in values.items()}

    def __getitem__(self, key: str) -> Any:
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __hash__(self) -> int:
        return hash(frozenset(self._values.items()))

    def __repr__(self) -> str:
        return f"FrozenTable({self.plain()!r})"

    def plain(self) -> dict[str, JsonValue]:
        """Convert to dicts and lists."""
        return {k: thawed(v) for k, v in self._values.items()}


def frozen(value: object) -> JsonValue:
    """Convert to immutable values: tables to `FrozenTable`, lists to tuples."""
    if isinstance(value, Mapping):
        return FrozenTable(value)
    return tuple(frozen(v) for v in value) if isinstance(value, list | tuple) else value


def thawed(value: object) -> JsonValue:
    """Convert frozen values to dicts and lists."""
    if isinstance(value, FrozenTable):
        return value.plain()
    return [thawed(v) for v in value] if isinstance(value, tuple) else value


@dataclass(frozen=True)
class Place:
    """Place of a value in a file, and the context that its reader needs.

    Attributes:
        field: dotted path.
        where: the file.
        units: SI units by key or by declared unit, for types whose unit depends on where they stand.
        own_unit: SI unit of this value alone, instead of the declared one.
        bare: whether numbers without a unit are taken as SI.
        files: what reads the files that values name, if anything does.
    """

    field: str
    where: str | None = None
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    own_unit: str = ""
    bare: bool = False
    files: object = None

    def unit(self, declared: str) -> str:
        """The SI unit here of what is declared in a unit."""
        return self.own_unit or self.units.get(declared, declared)

    def words(self, value: float, declared: str) -> float | str:
        """A number as it is written here, so that it reads back exactly; a pure number stays a number."""
        unit = "1" if self.bare else self.unit(declared)
        return float(value) if unit == "1" else f"{float(value)!r} {unit}"

    def table(self, raw: object) -> FileTable:
        """The table that stands here; refuses anything else."""
        return FileTable.of(raw, self.field, self.where or "")

    def below(self, key: object) -> Place:
        """The place of a key in the table that stands here."""
        return dataclasses.replace(self, field=f"{self.field}.{key}" if self.field else str(key), own_unit="")

    def fail(self, value: object, problem: str = "", *, known: Iterable[object] | None = None) -> InputError:
        """Return an error about the value at this place; arguments as for `InputError`."""
        return InputError(self.field, shown(value), problem, known=known, where=self.where)


@dataclass(frozen=True)
class FieldType:
    """Conversion of a field from and to text.

    Attributes:
        read: makes the value [SI] of what stands at a place.
        write: makes words of the value, for a place whose units it takes.
        doc: meaning of the field, one phrase.
        key: its name in a file, where that is another than the field's.
        empty: whether it is read as an empty table if it is left out and has no default.
    """

    read: Callable[[Any, Place], Any]
    write: Callable[[Any, Place], Any] = lambda value, place: value
    doc: str = ""
    key: str = ""
    empty: bool = False


def entry(
    read: Callable[[Any, Place], Any],
    doc: str = "",
    *,
    write: Callable[[Any, Place], Any] = lambda value, place: value,
    key: str = "",
    **options: Any,
) -> Any:
    """Declare a field that is read and written by functions of its own; `options` are those of `dataclasses.field`."""
    return dataclasses.field(metadata={"entry": FieldType(read, write, doc, key)}, **options)


def number(
    unit: str,
    bounds: tuple[float, float] = (-math.inf, math.inf),
    doc: str = "",
    *,
    key: str = "",
    endless: bool = False,
    **options: Any,
) -> Any:
    """Declare a number with unit, within inclusive bounds [unit]; with `endless`, infinity too."""

    def read(raw: object, place: Place) -> float:
        if endless and raw == math.inf:
            return math.inf
        return read_number(raw, place.unit(unit), bounds, place.field, place.where, bare=place.bare)

    return entry(read, doc, write=lambda value, place: place.words(value, unit), key=key, **options)


def numbers(
    unit: str, bounds: tuple[float, float] = (-math.inf, math.inf), doc: str = "", *, key: str = "", **options: Any
) -> Any:
    """Declare a list of one or more numbers, each as `number` reads it."""

    def read(raw: object, place: Place) -> tuple[float, ...]:
        if not isinstance(raw, list | tuple) or not raw:
            raise place.fail(raw, f"must be a list of one or more{_as_list(raw)}")
        si = place.unit(unit)
        return tuple(read_number(one, si, bounds, place.field, place.where) for one in raw)

    return entry(read, doc, write=lambda values, place: [place.words(v, unit) for v in values], key=key, **options)


def word(
    doc: str = "", *, among: tuple[str, ...] = (), pattern: str = "", demand: str = "", key: str = "", **options: Any
) -> Any:
    """Declare a text, optionally one of a set or of a pattern; `demand` describes the pattern."""

    def read(raw: object, place: Place) -> str:
        if not isinstance(raw, str):
            raise place.fail(raw, "must be a word")
        if among and raw not in among:
            raise place.fail(raw, known=among)
        if pattern and not re.fullmatch(pattern, raw):
            raise place.fail(raw, f"must be {demand}")
        return raw

    return entry(read, doc, key=key, **options)


def whole(low: int = 0, high: int = 2**63 - 1, doc: str = "", *, key: str = "", **options: Any) -> Any:
    """Declare a whole number within inclusive bounds."""
    return entry(lambda raw, place: read_whole(raw, low, high, place.field, place.where), doc, key=key, **options)


def flag(doc: str = "", *, key: str = "", **options: Any) -> Any:
    """Declare true or false."""
    return entry(_read_flag, doc, key=key, **options)


def words(doc: str = "", *, among: tuple[str, ...] = (), key: str = "", **options: Any) -> Any:
    """Declare a list of texts, each one of some where these are given."""

    def read(raw: object, place: Place) -> tuple[str, ...]:
        if not isinstance(raw, list | tuple) or not all(isinstance(v, str) for v in raw):
            raise place.fail(raw, f"must be a list of words{_as_list(raw)}")
        for one in raw:
            if among and one not in among:
                raise place.fail(one, known=among)
        return tuple(each_once(place.field, raw, where=place.where))

    return entry(read, doc, write=lambda value, place: list(value), key=key, **options)


def like(owner: type[Any], name: str, *, key: str = "", **options: Any) -> Any:
    """Declare a number as a parameter of another type is declared, with its unit, bounds and meaning."""
    q = declared(owner)[name]
    return number(q.unit, q.bounds, q.doc, key=key, **options)


def verbatim(doc: str = "", *, key: str = "", **options: Any) -> Any:
    """Declare a value that is taken as it stands in the file, for a reader that knows more."""
    return entry(lambda raw, place: raw, doc, key=key, **options)


def by_name(kinds: tuple[type, ...], demand: str, **options: Any) -> Any:
    """Declare a table of values of some plain types by name; `demand` describes them."""

    def read(raw: object, place: Place) -> dict[str, JsonValue]:
        values = place.table(raw).values
        for name, value in values.items():
            if not isinstance(value, kinds) or isinstance(value, bool):
                raise place.below(name).fail(value, f"must be {demand}")
        return dict(values)

    return entry(read, default_factory=dict, **options)


def rest(doc: str = "") -> Any:
    """Declare the table of all keys that no other field has."""
    return entry(lambda raw, place: raw, doc, key=_REST)


# A type, several by the word that the key `kind` of a table names, or none for what is taken as it stands.
Kind = type[Any] | Mapping[str, type[Any]] | None


def nested(kind: Kind, doc: str = "", *, owner: str = "", **options: Any) -> Any:
    """Declare a table of a type, read as an empty one if it is left out and has no default; `owner` as for `read_table`."""
    made = FieldType(lambda raw, place: read_part(kind, raw, place, owner), _write_part, doc, empty=True)
    return dataclasses.field(metadata={"entry": made}, **options)


def named(kind: Kind, doc: str = "", *, owner: str = "", pattern: str = NAME, **options: Any) -> Any:
    """Declare tables of a type by name; `owner` as for `read_table`."""

    def read(raw: object, place: Place) -> dict[str, JsonValue]:
        if not isinstance(raw, Mapping) and kind is not None:
            raise place.fail(raw, f"must be a table by name, of tables {_form(kind, None)}")
        table = place.table(raw)
        for name in table.values:
            if not re.fullmatch(pattern, name):
                raise table.fail(name, name, "must be a name of letters, digits, - and _ that begins with a letter")
        return {name: read_part(kind, one, place.below(name), owner) for name, one in table.values.items()}

    return entry(
        read, doc, write=lambda value, place: {n: _write_part(one, place) for n, one in value.items()}, **options
    )


def listed(kind: Kind, doc: str = "", *, owner: str = "", **options: Any) -> Any:
    """Declare a list of tables of a type, their places counted from 1; `owner` as for `read_table`."""

    def read(raw: object, place: Place) -> tuple[Any, ...]:
        if not isinstance(raw, list | tuple):
            raise place.fail(raw, f"must be a list of tables {_form(kind, None)}")
        return tuple(read_part(kind, one, place.below(i), owner) for i, one in enumerate(raw, 1))

    return entry(read, doc, write=lambda value, place: [_write_part(one, place) for one in value], **options)


_FIELDS: dict[type, dict[str, tuple[str, FieldType, bool]]] = {}  # kept by `table_fields`


def table_fields(kind: type[DataclassInstance]) -> dict[str, tuple[str, FieldType, bool]]:
    """The fields of a type that a table can state, by key: the field's name, how it is read, whether it is required."""
    if kind in _FIELDS:
        return _FIELDS[kind]
    fields = _FIELDS[kind] = {}
    for f in dataclasses.fields(kind):
        read = f.metadata.get("entry") or _implied(f)
        if read is not None and f.init:
            required = f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING
            fields[read.key or f.name] = f.name, read, required
    return fields


def read_table(
    kind: type[T],
    table: FileTable,
    *,
    units: Mapping[str, str] = _NOTHING,
    bare: bool = False,
    files: object = None,
    owner: str = "",
    beside: Iterable[str] = (),
    **given: JsonValue,
) -> T:
    """Read a value of a type from a table.

    Args:
        kind: a dataclass whose fields are declared as this module's head says.
        table: table of a file.
        units: SI units by key or by declared unit, for fields whose unit depends on where the table stands.
        bare: numbers are in SI and have no units.
        files: what reads the files that values name, for fields that can name one.
        owner: begins the list of known keys, such as ``a step has``; the name of the type where it is left out.
        beside: keys of the table that another reader reads.
        **given: fields that do not come from the table.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.
    """
    fields = {key: one for key, one in table_fields(kind).items() if one[0] not in given}
    skipped = tuple(beside)
    if _REST in fields:
        name, read, _ = fields.pop(_REST)
        given[name] = read.read(table.without(*fields, *skipped).values, Place(table.path, table.where or None))
    else:
        table.only([*fields, *skipped], owner or f"{kind.__name__} has")
    for key, (name, read, required) in fields.items():
        if key in table.values and key not in skipped:
            given[name] = read.read(table.values[key], _place(table, key, units, bare, files))
        elif required and read.empty:
            given[name] = read.read({}, _place(table, key, units, bare, files))
        elif required:
            raise table.fail(key, None, f"is missing: it is the {read.doc}" if read.doc else "is missing")
    try:
        return kind(**given)
    except InputError as error:
        raise table.located(error) from None


def read_stated(kind: type[DataclassInstance], table: FileTable, keys: Iterable[str]) -> dict[str, JsonValue]:
    """Read those of some fields of a type that a table states, by the name of the field; raises as `read_table`."""
    fields, where = table_fields(kind), table.where or None
    stated = ((fields[key], key) for key in keys if key in table)
    return {name: of.read(table.values[key], Place(table.field(key), where)) for (name, of, _), key in stated}


def write_table(
    value: DataclassInstance,
    *,
    units: Mapping[str, str] = _NOTHING,
    bare: bool = False,
    skip: Iterable[str] = (),
    always: Iterable[str] = (),
) -> dict[str, JsonValue]:
    """Write a value to the table that reads back to it; fields at their defaults are omitted.

    Args:
        value: value of a dataclass that `read_table` reads.
        units: SI units by key or by declared unit, as `read_table` takes them.
        bare: write numbers in SI without their units.
        skip: names of fields to leave out.
        always: names of fields that are written at their defaults too.
    """
    out = {}
    members, left_out = {f.name: f for f in dataclasses.fields(value)}, tuple(skip)
    for key, (name, read, _) in table_fields(type(value)).items():
        held, f = getattr(value, name), members[name]
        plain = f.default if f.default_factory is dataclasses.MISSING else f.default_factory()
        if name not in left_out and (name in always or not _same(held, plain)):
            out[key] = read.write(held, Place(key, None, units, units.get(key, ""), bare))
    return out


def _write_part(value: DataclassInstance, place: Place) -> dict[str, JsonValue]:
    return write_table(value, units=place.units, bare=place.bare)


def read_number(
    raw: object, unit: str, bounds: tuple[float, float], field: str, where: str | None, *, bare: bool = False
) -> float:
    """Read a number with its unit.

    Args:
        raw: the words, or a number where the unit is ``1`` or `bare` is true.
        unit: SI unit of the result.
        bounds: smallest and largest allowed value, inclusive [unit].
        field: dotted path for error messages.
        where: file for error messages.
        bare: take a number without a unit as SI.

    Returns:
        The value [unit].

    Raises:
        InputError: it is no number of that dimension, or out of bounds.
    """
    if isinstance(raw, bool) or not isinstance(raw, str | int | float):
        raise InputError(field, shown(raw), "must be a number with its unit in words", where=where)
    if bare:
        if isinstance(raw, str):
            raise InputError(field, raw, "must be a number", where=where)
        value = float(raw)
    else:
        value = parse(str(raw), unit, field=field, where=where)
    if bounds != (-math.inf, math.inf):
        Quantity(unit, bounds, "", "", bounds).check(field, value, where=where)
    return value


def read_whole(raw: object, low: int, high: int, field: str, where: str | None) -> int:
    """Read a whole number between inclusive bounds; it may be written as a word.

    Raises:
        InputError: it is none, or out of bounds.
    """
    try:
        value = int(raw) if isinstance(raw, str | int) and not isinstance(raw, bool) else None
    except ValueError:
        value = None
    if value is None or not low <= value <= high:
        span = f" between {low} and {high}" if high < 2**63 - 1 else f", {low} or more" if low else ""
        raise InputError(field, shown(raw), f"must be a whole number{span}", where=where)
    return value


def shown(value: object) -> str | int | float | None:
    """A value as an error message shows it: numbers, texts and None as they are, all else with its type."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        return f"{type(value).__name__} {value}"
    return value


def _place(table: FileTable, key: str, units: Mapping[str, str], bare: bool, files: object) -> Place:
    return Place(table.field(key), table.where or None, units, units.get(key, ""), bare, files)


def _implied(f: dataclasses.Field[Any]) -> FieldType | None:
    if "quantity" in f.metadata:
        q = f.metadata["quantity"]

        def read(raw: object, place: Place) -> float:
            unit = place.unit(q.unit)
            bounds = q.bounds if unit == q.unit else (-math.inf, math.inf)
            return read_number(raw, unit, bounds, place.field, place.where, bare=place.bare)

        return FieldType(read, lambda value, place: place.words(value, q.unit), q.doc)
    if f.type in ("int", int):
        return FieldType(_read_integer, doc="whole number")
    if f.type in ("str", str, "str | None"):
        return FieldType(_read_word)
    return FieldType(_read_flag) if f.type in ("bool", bool) else None


def _plain(accept: Callable[[Any], bool], demand: str) -> Callable[[Any, Place], Any]:
    def read(raw: object, place: Place) -> object:
        if not accept(raw):
            raise place.fail(raw, demand)
        return raw

    return read


_read_integer = _plain(lambda raw: isinstance(raw, int) and not isinstance(raw, bool), "must be a whole number")
_read_word = _plain(lambda raw: isinstance(raw, str) and bool(raw.strip()), "must be a word")
_read_flag = _plain(lambda raw: isinstance(raw, bool), "must be true or false")


def read_part(kind: Kind, raw: object, place: Place, owner: str = "") -> JsonValue:
    """Read a value of a type, or of that which the key `kind` names, from what stands at a place; raises as `read_table`."""
    if kind is None:
        return raw
    if not isinstance(raw, Mapping):
        raise place.fail(raw, f"must be a table {_form(kind, raw)}")
    table = place.table(raw)
    beside: tuple[str, ...] = ()
    if isinstance(kind, Mapping):
        name = table.word("kind", among=kind)
        kind, beside, owner = kind[name], ("kind",), f"{name} has"
    return read_table(kind, table, units=place.units, bare=place.bare, files=place.files, owner=owner, beside=beside)


def _as_list(raw: object) -> str:
    return f", such as [{_written(raw)}]" if isinstance(raw, str | int | float) else ""


def _written(raw: object) -> str:
    return json.dumps(raw) if isinstance(raw, str | int | float) else ".."


def _form(kind: Kind, raw: object) -> str:
    """A table of a type in words: with its required keys as a file states them, or the first ones where it requires none.

    A list of as many values as there are required keys fills them in.
    """
    if kind is None:
        return "of any keys"
    if isinstance(kind, Mapping):
        return f"such as {{ kind = {json.dumps(next(iter(kind)))}, .. }}"
    fields = {key: required for key, (_, _, required) in table_fields(kind).items() if key != _REST}
    keys = [key for key, required in fields.items() if required]
    if not keys:
        return f"with keys such as {', '.join(list(fields)[:FORM_KEYS])}"
    values = raw if isinstance(raw, list | tuple) and len(raw) == len(keys) else [None] * len(keys)
    return f"such as {{ {', '.join(f'{k} = {_written(v)}' for k, v in zip(keys, values, strict=True))} }}"


def _same(held: Any, plain: Any) -> bool:
    if held is plain:
        return True
    if isinstance(held, float) and isinstance(plain, float):
        return held == plain or (math.isnan(held) and math.isnan(plain))
    return type(held) is type(plain) and bool(held == plain)
