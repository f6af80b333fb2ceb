"""What the tests of mckibben share beside what all tests do: this folder on their path (`machine_records`), disturbances."""

import sys
from collections.abc import Iterator
from typing import Any

import pytest

from disturbed_linalg import Disturbance
from mckibben.registry import Registry


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that disturbs linear algebra."""
    parser.addoption(
        "--disturb-linalg",
        type=int,
        metavar="SEED",
        help="Disturb what linear algebra returns by rounding, signs and rotations; leaves out tests that compare bits",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Disturb linear algebra before any test is imported, where the option asks for it."""
    if (seed := config.getoption("--disturb-linalg")) is not None:
        Disturbance(seed).install()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out tests that compare bits, where linear algebra is disturbed."""
    if config.getoption("--disturb-linalg") is not None:
        bits = [item for item in items if item.get_closest_marker("bits")]
        config.hook.pytest_deselected(items=bits)
        items[:] = [item for item in items if item not in bits]


@pytest.fixture
def shipped_kinds() -> Iterator[None]:
    """Registries without what earlier tests of this worker have named, for a test of what they list."""
    hidden = [(one, {n: e for n, e in one._known.items() if not _is_shipped(e)}) for one in _registries()]
    for one, names in hidden:
        for name in names:
            del one._known[name]
    yield
    for one, names in hidden:  # they are others' again: fits that are kept name them
        one._known.update(names)


def _registries() -> list[Registry[Any]]:
    rooms = [vars(module) for name, module in [*sys.modules.items()] if name.startswith("mckibben")]
    return [*{id(one): one for room in rooms for one in [*room.values()] if isinstance(one, Registry)}.values()]


def _is_shipped(entry: object) -> bool:
    """Whether this package has it: an entry of a registry that a test has imported first."""
    return isinstance(entry, str) or getattr(entry, "__module__", "").startswith("mckibben.")
