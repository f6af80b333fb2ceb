"""Tables of words: what is declared is read, refused by its path, and written so that it reads back."""

import math
from dataclasses import dataclass, field

import pytest

from mckibben import schema
from mckibben.errors import InputError
from mckibben.quantities import quantity
from mckibben.schema import FileTable, read_table, write_table


@dataclass(frozen=True)
class Leg:
    """A part of a thing."""

    length: float = schema.number("m", (0.0, 2.0), "from end to end")
    joints: int = schema.whole(0, 3, "of it", default=1)


@dataclass(frozen=True, kw_only=True)
class Thing:
    """All kinds of fields."""

    name: str
    begin: float = schema.number("s", key="from", default=0.0)
    level: float = schema.number("level", default=math.inf, endless=True)
    points: tuple[float, ...] = schema.numbers("Pa", default=())
    colour: str = schema.word(among=("red", "blue"), default="red")
    loud: bool = schema.flag(default=False)
    tags: tuple[str, ...] = schema.words(default=())
    first: Leg | None = schema.nested(Leg, default=None)
    legs: dict[str, Leg] = schema.named(Leg, default_factory=dict)
    others: tuple[Leg, ...] = schema.listed(Leg, default=())
    place: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if self.name == "nothing":
            raise InputError("name", self.name, "must be something")


STATED = {
    "name": "spider", "from": "20 ms", "level": "3 bar", "points": ["1 bar", "200000.0 Pa"], "colour": "blue", "loud": True,
    "tags": ["a", "b"], "first": {"length": "10 cm"}, "legs": {"left": {"length": "1 m", "joints": 2}},
    "others": [{"length": "50 cm"}],
}  # fmt: skip
UNITS = {"level": "Pa"}


def read(**changes):
    stated = {k: v for k, v in (STATED | changes).items() if v is not None}
    return read_table(Thing, FileTable(stated, "thing", "a.toml"), units=UNITS, owner="a thing has")


def test_what_is_stated_is_read_in_si():
    thing = read()
    assert (thing.begin, thing.level, thing.points) == (0.02, 3e5, (1e5, 2e5))
    assert thing.legs["left"] == Leg(1.0, 2) and thing.others == (Leg(0.5),) and thing.first == Leg(0.1)


def test_what_is_written_reads_back_exactly():
    thing = read()
    table = write_table(thing, units=UNITS)
    assert read_table(Thing, FileTable(table), units=UNITS) == thing
    assert "joints" not in table["first"]  # as it is by default


def test_numbers_in_si_have_no_units():
    table = write_table(read(), units=UNITS, bare=True)
    assert table["level"] == 3e5
    leg = FileTable({"length": "1 m"}, "leg", "a.nc")
    with pytest.raises(InputError, match="a.nc: leg.length must be a number, got 1 m"):
        read_table(Leg, leg, bare=True)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"nam": "x"}, "Unknown field 'thing.nam'. Did you mean 'name'? A thing has name, from, level"),
        ({"name": None}, "thing.name is missing"),
        ({"from": "1 m"}, "thing.from must be a time such as '20 ms', got 1 m"),
        ({"level": "3 N"}, "thing.level must be a pressure such as '5 bar', got 3 N"),
        ({"points": []}, "thing.points must be a list of one or more"),
        ({"colour": "blu"}, "Unknown thing.colour 'blu'. Did you mean 'blue'? Known are red, blue"),
        ({"loud": "yes"}, "thing.loud must be true or false, got 'yes'"),
        ({"first": {"length": "3 m"}}, "thing.first.length must be between 0 cm and 200 cm, got 300 cm"),
        ({"first": {}}, "thing.first.length is missing: it is the from end to end"),
        ({"points": "2 bar"}, 'thing.points must be a list of one or more, such as ["2 bar"], got 2 bar'),
        ({"tags": "a"}, "thing.tags must be a list of words, such as [\"a\"], got 'a'"),
        ({"legs": {"left": 3}}, "thing.legs.left must be a table such as { length = .. }, got 3"),
        ({"legs": {"left": ["1 m"]}}, 'thing.legs.left must be a table such as { length = "1 m" }, got '),
        ({"legs": 3}, "thing.legs must be a table by name, of tables such as { length = .. }, got 3"),
        ({"others": 3}, "thing.others must be a list of tables such as { length = .. }, got 3"),
        ({"legs": {"3": {}}}, "thing.legs.3 must be a name of letters"),
        (
            {"others": [{"length": "1 m", "joints": 4}]},
            "thing.others.1.joints must be a whole number between 0 and 3, got 4",
        ),
        ({"name": "nothing"}, "thing.name must be something, got 'nothing'"),
    ],
)
def test_what_is_wrong_is_refused_by_file_and_dotted_path(changes, says):
    with pytest.raises(InputError) as refused:
        read(**changes)
    assert f"a.toml: {says}" in str(refused.value)


TABLE = FileTable(
    {
        "word": "a", "blank": " ", "list": ["a", "b"], "number": "2 bar", "whole": 3, "digits": "3", "yes": True, "one": 1,
        "table": {"x": {"y": 1}, "z": {}}, "tables": [{"a": 1}, {}], "kind": "leg",
    },
    "part",
    "a.toml",
)  # fmt: skip


@pytest.mark.parametrize(
    ("read", "value"),
    [
        (lambda t: t.word("word"), "a"),
        (lambda t: t.word("missing", "b"), "b"),
        (lambda t: t.word("word", among=("a", "b")), "a"),
        (lambda t: t.text("word") + t.text("missing"), "a"),
        (lambda t: t.texts("list") + t.texts("missing"), ("a", "b")),
        (lambda t: t.number("number", "Pa"), 2e5),
        (lambda t: t.number("missing", "Pa", 1.0), 1.0),
        (lambda t: t.number("number", "Pa", 1.0), 2e5),
        (lambda t: (t.whole("whole", 3, 3), t.whole("digits", 0, 3), t.whole("missing", 0, 3, 2)), (3, 3, 2)),
        (lambda t: (t.flag("yes", False), t.flag("missing", False), t.flag("missing", True)), (True, False, True)),
        (lambda t: dict(t.table("table").table("x").values), {"y": 1}),
        (lambda t: dict(t.table("missing").values), {}),
        (lambda t: [(name, one.path) for name, one in t.tables("table")], [("x", "part.table.x"), ("z", "part.table.z")]),
        (lambda t: [one.path for one in t.listed("tables")], ["part.tables.1", "part.tables.2"]),
        (lambda t: (len(t.listed("tables")), t.listed("missing")), (2, ())),
        (lambda t: ("word" in t, "w" in t, "list" in t.without("word"), "word" in t.without("word")), (1, 0, 1, 0)),
        (lambda t: (t.field("a"), FileTable({}).field("a")), ("part.a", "a")),
    ],
)  # fmt: skip
def test_a_table_gives_what_it_states_and_the_default_of_what_it_leaves_out(read, value):
    assert read(TABLE) == value


@pytest.mark.parametrize(
    ("read", "says"),
    [
        (lambda t: t.word("missing"), "part.missing is missing"),
        (lambda t: t.word("missing", among=("a", "b")), "part.missing is missing: it must be a or b"),
        (lambda t: t.word("blank"), "part.blank must be a word"),
        (lambda t: t.word("whole"), "part.whole must be a word"),
        (lambda t: t.word("word", among=("b",)), "Known are b"),
        (lambda t: t.texts("word"), "part.word must be a list of words"),
        (lambda t: t.texts("tables"), "part.tables must be a list of words"),
        (lambda t: t.number("missing", "Pa"), "part.missing is missing"),
        (lambda t: t.number("one", "Pa"), "part.one must be a pressure"),
        (lambda t: t.number("yes", "1"), "part.yes must be a number"),
        (lambda t: t.whole("whole", 0, 2), "part.whole must be a whole number between 0 and 2, got 3"),
        (lambda t: t.whole("whole", 4, 9), "part.whole must be a whole number between 4 and 9, got 3"),
        (lambda t: t.whole("word", 0, 2**63 - 1), "part.word must be a whole number, got"),
        (lambda t: t.whole("whole", 4, 2**63 - 1), "part.whole must be a whole number, 4 or more, got 3"),
        (lambda t: t.whole("yes", 0, 3), "part.yes must be a whole number"),
        (lambda t: t.whole("missing", 0, 3), "part.missing is missing"),
        (lambda t: t.flag("one", True), "part.one must be true or false"),
        (lambda t: t.table("word"), "part.word must be a table, [part.word]"),
        (lambda t: list(t.derived({"table": {"1": {}}}).tables("table")), "must be a name of letters"),
        (lambda t: t.listed("word"), "part.word must be a list of tables, [[word]]"),
        (lambda t: t.listed("list"), "part.list.1 must be a table, got"),
        (lambda t: t.only(("word", "list")), "Unknown field 'part.blank'"),
        (lambda t: t.schema(2), "part.schema is missing: this version of mckibben reads schema 2"),
        (lambda t: t.derived({"schema": 1}).schema(2), "part.schema must be 2"),
        (lambda t: t.derived({"schema": True}).schema(1), "part.schema must be 1"),
    ],
)
def test_a_table_that_states_it_otherwise_is_refused_by_file_and_dotted_path(read, says):
    with pytest.raises(InputError) as refused:
        read(TABLE)
    assert str(refused.value).startswith("a.toml: ") and says in str(refused.value)
    TABLE.derived({"schema": 2}).schema(2)


def test_an_error_of_a_part_is_located_once():
    inside = InputError("length", 1.0, "must be 2")
    assert TABLE.located(inside).field == TABLE.located(TABLE.located(inside)).field == "part.length"
    assert TABLE.located(inside).where == "a.toml"
    assert FileTable({}).located(inside).field == "length"


def test_a_frozen_table_is_its_values_and_thaws_to_them():
    values = {"a": [1, {"b": [2, 3]}], "c": "d"}
    one = schema.FrozenTable(values)
    assert one.plain() == values and hash(one) == hash(schema.FrozenTable(values)) and len(one) == 2
    assert one["a"] == (1, schema.FrozenTable({"b": [2, 3]})) and list(one) == ["a", "c"]
    assert schema.thawed(schema.frozen(values)) == values and schema.frozen(5) == 5


@dataclass(frozen=True, kw_only=True)
class Sized:
    """What needs a range, a pattern, or another type's declaration."""

    name: str = schema.word(pattern="[a-z]+", demand="small letters", default="a")
    tags: tuple[str, ...] = schema.words(among=("x", "y"), default=())
    length: float = schema.number("m")
    part: object = schema.nested({"leg": Leg, "thing": Thing}, default=None)
    numbers: dict = schema.by_name((int, float), "a number")
    count: int = 0


def sized(**stated):
    return read_table(Sized, FileTable({"length": "1 m"} | stated, "s", "a.toml"))


def test_a_part_is_of_the_kind_that_it_names_and_other_values_are_as_they_are_declared():
    thing = sized(
        part={"kind": "leg", "length": "2 m"}, tags=["x", "y"], numbers={"a": 1, "b": 2.5}, name="ab", count=4
    )
    assert (thing.part, thing.tags, thing.numbers) == (Leg(2.0), ("x", "y"), {"a": 1, "b": 2.5})
    assert (thing.name, thing.count, thing.length) == ("ab", 4, 1.0)
    for stated, says in (
        ({"part": {"length": "2 m"}}, "s.part.kind is missing: it must be leg or thing"),
        ({"part": {"kind": "leg", "lenght": "2 m"}}, "Leg has length, joints"),
        ({"part": 3}, 's.part must be a table such as { kind = "leg", .. }'),
        ({"tags": ["z"]}, "Known are x, y"),
        ({"numbers": {"a": True}}, "s.numbers.a must be a number"),
        ({"numbers": {"a": "1"}}, "s.numbers.a must be a number"),
        ({"name": "A"}, "s.name must be small letters"),
        ({"count": True}, "s.count must be a whole number"),
        ({"count": 1.0}, "s.count must be a whole number"),
    ):
        with pytest.raises(InputError) as refused:
            sized(**stated)
        assert says in str(refused.value)


def test_bounds_are_inclusive_and_a_level_may_have_no_end():
    ends = [read(first={"length": text}).first.length for text in ("0 m", "2 m")]
    assert ends == [0.0, 2.0]
    for text in ("-1e-9 m", "2.000001 m"):
        with pytest.raises(InputError, match="between"):
            read(first={"length": text})
    assert read(level=math.inf).level == math.inf
    with pytest.raises(InputError):
        read(**{"from": math.inf})


def test_what_is_at_its_default_is_written_only_if_it_is_asked_for_and_what_is_skipped_never():
    leg = Leg(math.nan, 1)
    assert write_table(Leg(1.0)) == {"length": "1.0 m"}
    assert write_table(Leg(1.0), always=("joints",)) == {"length": "1.0 m", "joints": 1}
    assert write_table(Leg(1.0, 2), skip=("joints",)) == write_table(Leg(1.0, 2), skip=("joints",), always=("joints",))
    assert write_table(Leg(1.0, 2), skip=("joints",)) == {"length": "1.0 m"}
    assert write_table(leg, bare=True)["length"] != 0.0
    assert "level" not in write_table(read(level=math.inf), units=UNITS)
    assert schema.read_stated(Thing, FileTable({"from": "2 s", "loud": True}), ["from", "level"]) == {"begin": 2.0}


@dataclass(frozen=True, kw_only=True)
class Line:
    """What has parameters as parts of a circuit do, and a field that its reader gives."""

    length: float = quantity("m", (0.0, 2.0), "of it")
    gain: float = quantity("N", (0.0, 5.0), "of it", default=1.0)
    name: str = ""
    open: bool = True


def test_declared_bounds_hold_in_the_declared_unit_and_not_in_one_that_stands_in_its_place():
    line = read_table(Line, FileTable({"length": "2 m", "gain": "5 N"}))
    assert (line.length, line.gain, line.name, line.open) == (2.0, 5.0, "", True)
    assert read_table(Line, FileTable({"length": "2 m", "gain": "500 Pa"}), units={"gain": "Pa"}).gain == 500.0
    assert read_table(Line, FileTable({"length": "2 m", "gain": "500 Pa"}), units={"N": "Pa"}).gain == 500.0
    for table, says in (
        ({"length": "2.1 m"}, "between 0 cm and 200 cm"), ({"length": "1 m", "gain": "5.1 N"}, "between 0 N and 5 N"),
        ({}, "length is missing: it is the of it"), ({"length": "1 m", "open": 1}, "must be true or false"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=says):
            read_table(Line, FileTable(table))
    with pytest.raises(InputError, match="between 0 cm and 200 cm"):  # a unit that is stated for another key
        read_table(Line, FileTable({"length": "3 m"}), units={"gain": "Pa"})


def test_a_field_that_the_reader_gives_is_none_of_the_table_and_keys_of_another_reader_stay():
    stated = {"length": "1 m", "of": 3}
    assert read_table(Line, FileTable(stated), beside=("of",), name="a").name == "a"
    for beside, given in (((), {}), (("of",), {"length": 1.0})):
        with pytest.raises(InputError, match="Unknown field"):
            read_table(Line, FileTable(stated), beside=beside, **given)
    # what another reader reads is not read here, whether or not a field has that name
    assert read_table(Line, FileTable({"length": "1 m", "gain": "wrong"}), beside=("gain",)).gain == 1.0


@dataclass(frozen=True)
class Rest:
    """What keeps all other keys."""

    name: str
    part: Leg = schema.nested(Leg)
    others: dict = schema.rest()


def test_all_other_keys_go_to_the_rest_and_a_part_that_is_left_out_is_read_as_an_empty_table():
    table = FileTable({"name": "a", "part": {"length": "1 m"}, "x": 1, "y": [2]}, "t")
    assert read_table(Rest, table) == Rest("a", Leg(1.0), {"x": 1, "y": [2]})
    assert read_table(Rest, table, beside=("y",)).others == {"x": 1}
    with pytest.raises(InputError, match=r"t\.part\.length is missing"):
        read_table(Rest, FileTable({"name": "a"}, "t"))


def test_what_is_read_bare_is_written_bare_and_reads_back():
    line = Line(length=0.1, gain=2.5, name="a", open=False)
    for bare in (False, True):
        table = write_table(line, bare=bare)
        assert read_table(Line, FileTable(table), bare=bare) == line
        assert isinstance(table["length"], float) is bare
    assert write_table(line, units={"gain": "kN"})["gain"] == "2.5 kN"  # as it is said there


@dataclass(frozen=True)
class Count:
    """Whole numbers with and without bounds of their own."""

    free: int = schema.whole(default=0)
    most: int = schema.whole(1, 5, default=1)
    least: int = schema.whole(2, default=2)


def test_a_whole_number_without_bounds_is_one_of_64_bits_from_zero_and_its_bounds_are_its_own():
    for stated in (
        {"free": 0},
        {"free": 2**63 - 1},
        {"free": "7"},
        {"most": 1},
        {"most": 5},
        {"least": 2},
        {"least": 2**63 - 1},
    ):
        table = read_table(Count, FileTable(stated))
        assert [getattr(table, key) for key in stated] == [int(value) for value in stated.values()]
    for key, value, demand in (
        ("free", -1, "must be a whole number, got -1"),
        ("free", 2**63, "must be a whole number, got 9223372036854775808"),
        ("most", 0, "between 1 and 5, got 0"),
        ("most", 6, "between 1 and 5, got 6"),
        ("least", 1, "whole number, 2 or more, got 1"),
        ("least", 2**63, "whole number, 2 or more, got"),
        ("free", 1.0, "must be a whole number"),
        ("free", "x", "must be a whole number"),
    ):
        with pytest.raises(InputError) as refused:
            read_table(Count, FileTable({key: value}))
        assert demand in str(refused.value)
