"""The list of tests beside each source, from which single mutations are drawn by hand, follows what moves."""

from pathlib import Path

import pytest

from mutations_beside import GUARDS_TESTS, PHYSICS_TESTS, SOFTWARE_TESTS

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("beside", [PHYSICS_TESTS, SOFTWARE_TESTS, GUARDS_TESTS])
def test_every_source_and_test_that_is_named_is_there(beside: dict[str, str]) -> None:
    sources = [place for place in beside if not (ROOT / "src" / "mckibben" / place).exists()]
    tests = [name for names in beside.values() for name in names.split() if not (ROOT / "tests" / name).exists()]
    assert sources == tests == []
