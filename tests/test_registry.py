"""Kinds by name: those of an installed package are found like those of this package."""

import importlib.metadata

import pytest

from mckibben import registry
from mckibben.errors import InputError
from mckibben.registry import Registry


@pytest.fixture
def installed(monkeypatch):
    """Make entry points look installed: name, value, group."""

    def install(*points: tuple[str, str, str]) -> None:
        registry.plugins.cache_clear()
        monkeypatch.setattr(registry, "_entry_points", lambda: [importlib.metadata.EntryPoint(*p) for p in points])

    yield install
    registry.plugins.cache_clear()


def test_a_kind_of_an_installed_package_comes_after_the_own_ones(installed):
    installed(("tau", "math:tau", "mckibben.numbers"), ("e", "math:e", "mckibben.others"))
    numbers = Registry("mckibben.numbers", "number", {"pi": "math:pi"})
    assert list(numbers) == ["pi", "tau"]
    assert numbers["tau"] == 2.0 * numbers["pi"]  # exact: a power of two
    assert numbers.own() == (numbers["pi"],)


def test_an_unknown_kind_is_refused_with_the_nearest_one(installed):
    installed()
    numbers = Registry("mckibben.numbers", "number", {"three": 3, "seven": 7})
    with pytest.raises(InputError, match="Unknown number 'tree'. Did you mean 'three'. Known are three, seven"):
        numbers.find("tree")


def test_an_entry_point_that_cannot_be_loaded_is_named(installed):
    installed(("broken", "no_such_package:Kind", "mckibben.numbers"))
    with pytest.raises(InputError, match="broken: the entry point no_such_package:Kind of mckibben.numbers"):
        list(Registry("mckibben.numbers", "number", {}))


def test_a_name_is_given_once():
    numbers = Registry("mckibben.numbers", "number", {"pi": "math:pi"})
    with pytest.raises(InputError, match="another number has that name"):
        numbers.add("pi", 3.0)
