"""The list of tests beside each source, from which single mutations are drawn by hand, follows what moves."""

from pathlib import Path

import pytest

from mutations_beside import ROOMS

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("room", ROOMS)
def test_every_source_and_test_that_is_named_is_there(room: str) -> None:
    home, tested, beside = ROOMS[room]
    sources = [place for place in beside if not (ROOT / home / place).exists()]
    tests = [name for names in beside.values() for name in names.split() if not (ROOT / tested / name).exists()]
    assert sources == tests == []


@pytest.mark.parametrize("room", ["hosts", "hardware", "studies"])
def test_every_source_of_a_whole_room_is_in_its_list(room: str) -> None:
    home, _, beside = ROOMS[room]
    files = [path.relative_to(ROOT / home).as_posix() for path in (ROOT / home).rglob("*.py")]
    assert [one for one in files if not one.endswith("__init__.py") and not one.startswith(tuple(beside))] == []
