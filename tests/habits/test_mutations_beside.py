"""The list of tests beside each source, from which single mutations are drawn by hand, follows what moves."""

from pathlib import Path

import pytest

from mutations_beside import NOT_DRAWN, ROOMS

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("room", ROOMS)
def test_every_source_and_test_that_is_named_is_there(room: str) -> None:
    home, tested, beside = ROOMS[room]
    sources = [place for place in beside if not (ROOT / home / place).exists()]
    tests = [name for names in beside.values() for name in names.split() if not (ROOT / tested / name).exists()]
    assert sources == tests == []


def test_every_module_is_in_a_list_or_it_is_said_why_not() -> None:
    listed = tuple(str(ROOT / home / place) for home, _, beside in ROOMS.values() for place in beside)
    homes = {ROOT / home for home, _, _ in ROOMS.values()}
    modules = sorted(path for home in homes for path in home.rglob("*.py") if path.name != "__init__.py")
    source = ROOT / "src" / "mckibben"
    reasons = tuple(str(source / folder) + "/" for folder in NOT_DRAWN)
    missing = [str(one) for one in modules if not str(one).startswith((*listed, *reasons))]
    assert [one for one in missing if "def " in Path(one).read_text()] == []  # there is nothing to change in constants
    assert [folder for folder in NOT_DRAWN if not (source / folder).is_dir()] == []
