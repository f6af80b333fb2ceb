"""Tables of words: what is declared is read, refused by its path, and written so that it reads back."""

import math
from dataclasses import dataclass, field

import pytest

from mckibben import schema
from mckibben.errors import InputError
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
