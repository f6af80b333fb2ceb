"""Kinds by name: those of an installed package are found like those of this package."""

import email.mime
import importlib.metadata
from pathlib import Path
from types import SimpleNamespace

import pytest

from mckibben import registry
from mckibben.errors import InputError, MissingLibraryError
from mckibben.muscles.hysteresis import HYSTERESES
from mckibben.muscles.laws import LAWS
from mckibben.pneumatics.build import ELEMENTS
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


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A folder with a file of one's own that is allowed, and a registry of numbers that takes them from files."""
    monkeypatch.setenv(registry.CODE, "")
    monkeypatch.setenv(registry.FIXED, "")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text("two = 2\nthree = 3.0\nclass Four: pass\n")
    return Registry(
        "mckibben.none", "number", {"one": 1}, accept=lambda v: None if isinstance(v, int) else "a whole number"
    )


def test_a_name_of_a_file_stands_for_what_a_registry_accepts_of_an_allowed_one(own, tmp_path):
    with pytest.raises(InputError, match="names code, which a file cannot run by itself"):
        own.find("own.py:two")
    registry.named_by_person("own.py:two", 3, "one", "none.py:two", "own.py")
    assert own.find("own.py:two") == own["own.py:two"] == own[f"{tmp_path}/own.py:two"] == 2 and "own.py:two" in own
    for name, says in (
        ("own.py:three", "own.py:three must be a whole number"),
        ("own.py:tree", "own.py has no 'tree'."),
        ("own.py", "own.py must be followed by the name of a number in it, as in own.py:Name"),
        ("none.py:two", "File not found"),
        ("on", "Unknown number 'on'. Did you mean 'one'"),
    ):
        with pytest.raises(InputError) as error:
            own.find(name)
        assert says in str(error.value)
    without = Registry("mckibben.none", "number", {"one": 1})  # takes none from files
    assert "own.py:two" not in without and not without._is_file("own.py:two")
    with pytest.raises(InputError, match="Unknown number 'own.py:two'"):
        without.find("own.py:two")


@pytest.mark.parametrize("own_kinds", [LAWS, HYSTERESES, ELEMENTS], ids=lambda one: one.noun)
def test_a_registry_accepts_whole_kinds_of_its_own_and_nothing_of_another(own_kinds):
    for kinds in (LAWS, HYSTERESES, ELEMENTS):
        for name in kinds:
            assert (own_kinds.accept(kinds[name]) is None) == (kinds is own_kinds), name
    for nothing in (object, own_kinds, next(iter(own_kinds)), None):
        assert own_kinds.accept(nothing).startswith("a class derived from mckibben.")
    unfinished = type("Unfinished", (own_kinds[next(iter(own_kinds))],), {})
    unfinished.__abstractmethods__ = frozenset({"a", "b"})
    assert own_kinds.accept(unfinished) == "complete; missing: a, b"


def test_only_python_files_of_a_bounded_length_are_allowed_and_none_after_a_server_has_begun(own, tmp_path):
    (tmp_path / "long.py").write_text("#" * (registry.LONGEST_FILE + 1))
    registry.allow_code("long.py")
    for act, says in (
        (lambda: registry.load_reference("long.py:a", field="law"), "must be a Python file below 1 MB"),
        (lambda: registry.load_reference("long", field="law"), "must be a file and a name in it, such as my.py:MyLaw"),
        (lambda: registry.allow_code("own.txt"), "code must be a Python file, such as my.py"),
        (lambda: registry.allow_code("none.py"), "File not found: none.py"),
    ):
        with pytest.raises(InputError, match=says):
            act()
    (tmp_path / "long.py").write_text("a = 1".ljust(registry.LONGEST_FILE))
    assert registry.load_reference("long.py:a", field="law") == 1
    registry.allow_code("long.py")  # twice is once
    assert registry.os.environ[registry.CODE] == str(tmp_path / "long.py")
    registry.fix_code()
    with pytest.raises(InputError, match="must be named when the server is started"):
        registry.allow_code("own.py")
    registry.named_by_person("own.py:two")  # passes, and allows nothing
    with pytest.raises(InputError, match="names code"):
        registry.load_reference("own.py:two", field="law")


def test_references_in_a_file_begin_at_its_folder_keys_and_values_and_nothing_else_moves():
    document = {"law": "own.py:Law", "laws": {"own.py:Law": {"a": 1}}, "list": ["b.py:B", "text", 3], "title": "own.py"}
    assert registry.with_own_references(document, "folder/a.toml") == {
        "law": "folder/own.py:Law",
        "laws": {"folder/own.py:Law": {"a": 1}},
        "list": ["folder/b.py:B", "text", 3],
        "title": "own.py",
    }
    for name, known in (
        ("a.py:B", True),
        ("a.py:b_1", True),
        ("a.py:1", False),
        ("a.py", False),
        (":B", False),
        (3, False),
    ):
        assert registry.is_reference(name) is known


def test_a_kind_of_a_notebook_gets_a_name_of_its_own_each_time_and_keeps_it(own):
    kinds = Registry("mckibben.none", "kind", {}, accept=lambda _: None)
    first, second = (type("Kind", (), {}) for _ in range(2))
    assert [kinds.register(one) for one in (first, second, first)] == ["Kind", "Kind_2", "Kind"]
    assert registry.registered_name(first) == "Kind" and registry.registered_name(3) is None
    assert kinds.own() == (first, second) and len(kinds) == 2
    with pytest.raises(InputError, match="float must be a whole number"):
        own.register(1.5)


def test_what_a_package_of_this_repository_announces_is_found_by_group_and_name_or_said_to_be_missing(
    tmp_path, monkeypatch
):
    (tmp_path / "names_only").mkdir()  # a folder without sources
    monkeypatch.syspath_prepend(tmp_path)
    points = [
        importlib.metadata.EntryPoint(*one)
        for one in (
            ("page", "email.mime:__name__", "mckibben.pages"),
            ("page", "math:tau", "mckibben.names"),
            ("gone", "no_such_module:a", "mckibben.pages"),
            ("names", "names_only:a", "mckibben.pages"),
        )
    ]

    def distribution(name):
        if name != "mckibben-papers":
            raise importlib.metadata.PackageNotFoundError
        return SimpleNamespace(version="0.1", entry_points=points)

    monkeypatch.setattr(importlib.metadata, "distribution", distribution)
    asked = ("mckibben.pages", "page", "papers", "a page needs")
    assert registry.announced(*asked) == "email.mime"
    assert registry.announced_folder(*asked[:3]) == Path(email.mime.__file__).parent
    for name in ("gone", "names", "none"):
        assert registry.announced_folder("mckibben.pages", name, "papers") is None
    assert registry.announced_folder("mckibben.pages", "page", "hosts") is None
    with pytest.raises(InputError, match="a page needs another version of mckibben-papers than 0.1: pip install"):
        registry.announced("mckibben.pages", "none", *asked[2:])
    for extra in (None, "fmi"):
        with pytest.raises(MissingLibraryError, match=rf"a page needs mckibben-hosts.*mckibben\[{extra or 'hosts'}\]"):
            registry.announced("mckibben.pages", "page", "hosts", "a page needs", extra=extra)
