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


LAW = """
from mckibben.muscles.laws.ideal import Ideal

class Law(Ideal):
    title = "{0}"
"""


def test_a_relative_path_means_the_file_of_the_folder_where_it_is_read(tmp_path, monkeypatch):
    """Of two folders with a file of one name; a class that came from the one stays itself in the other."""
    monkeypatch.setenv(registry.CODE, "")
    first, second, empty = (tmp_path / name for name in ("first", "second", "empty"))
    for folder in (first, second, empty):
        folder.mkdir()
    for folder in (first, second):
        (folder / "canary.py").write_text(LAW.format(folder.name), encoding="utf-8")
        registry.allow_code(folder / "canary.py")
    laws = Registry("mckibben.no_group", "law", {}, accept=lambda _: None)
    kinds = {}
    for folder in (first, second):
        monkeypatch.chdir(folder)
        kinds[folder.name] = laws.find("canary.py:Law")
        assert kinds[folder.name].title == folder.name
    name = laws.register(kinds["first"])  # in the second folder
    assert laws[name] is laws.find(name) is kinds["first"]
    monkeypatch.chdir(empty)
    assert laws[laws.register(kinds["first"])] is kinds["first"]
    with pytest.raises(InputError, match="File not found: canary.py"):
        laws.find("canary.py:Law")


def test_a_class_in_place_of_a_stated_one_counts_for_that_file_alone(tmp_path, monkeypatch):
    monkeypatch.setenv(registry.CODE, "")
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "canary.py").write_text(LAW.format(name), encoding="utf-8")
        registry.allow_code(tmp_path / name / "canary.py")
    laws = Registry("mckibben.no_group", "law", {}, accept=lambda _: None)

    class Law:
        title = "of a notebook"

    monkeypatch.chdir(tmp_path / "first")
    assert laws[laws.stated_as(Law, ["canary.py:Law"])] is Law
    monkeypatch.chdir(tmp_path / "second")
    assert laws["canary.py:Law"].title == "second"


def test_sources_of_a_package_that_joins_are_watched_as_the_own_ones(monkeypatch):
    monkeypatch.setattr(registry, "WATCHED", set(registry.WATCHED))
    assert "mckibben" in registry.WATCHED and "mckibben_new" not in registry.WATCHED
    registry.join("mckibben_new")
    assert "mckibben_new" in registry.WATCHED
