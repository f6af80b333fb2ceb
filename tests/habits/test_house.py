"""Conventions of the repository that no other test would check: declarations, sources, sizes, imports."""

import ast
import builtins
import contextlib
import functools
import importlib
import importlib.util
import math
import pkgutil
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import counters
import pytest
from counters import parsed

import lanewise
import mckibben
from mckibben import accessors
from mckibben.errors import MissingLibraryError
from mckibben.muscles.laws import LAWS, law_type
from mckibben.quantities import Quantity, declared, to_si

PACKAGE = Path(mckibben.__file__).parent
COMPILER = Path(lanewise.__file__).parent
ABOVE = {name: folder for name, folder in counters.SOURCES.items() if folder not in (PACKAGE, COMPILER)}
ROOT = Path(__file__).parents[2]
DEFINITIONS = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
HEAVY = ("jax", "matplotlib", "pint", "scipy", "equinox", "pydantic")


def modules() -> list[str]:
    folders = {"mckibben": PACKAGE, **ABOVE}
    every = [m.name for name, folder in folders.items() for m in pkgutil.walk_packages([str(folder)], f"{name}.")]
    return [name for name in every if not name.endswith("__main__")]


def declaring_types() -> dict[str, type]:
    """Every class of the package that declares a quantity."""
    import dataclasses

    found: dict[str, type] = {}
    for name in modules():
        try:
            module = importlib.import_module(name)
        except MissingLibraryError:
            continue  # a host program whose extra is not installed
        for owner in vars(module).values():
            if (
                isinstance(owner, type)
                and owner.__module__ == name
                and dataclasses.is_dataclass(owner)
                and declared(owner)
            ):
                found[f"{name}.{owner.__name__}"] = owner
    return found


TYPES = declaring_types()


def test_the_declarations_are_found() -> None:
    # All laws among them, and the friction and creep elements and the environment: else the tests below look at nothing.
    named = {f"{kind.__module__}.{kind.__qualname__}" for kind in LAWS.values()}
    assert {name for name in named if name.startswith("mckibben.")} <= set(TYPES)  # other tests may have added theirs
    assert "mckibben.components.flow.Environment" in TYPES
    assert len(TYPES) > len(LAWS) + 5


@pytest.mark.parametrize("name", TYPES)
def test_every_declared_quantity_is_complete(name: str) -> None:
    for field, q in declared(TYPES[name]).items():
        assert isinstance(q, Quantity)
        assert to_si(1.0, q.unit, q.unit, field=field) == pytest.approx(1.0), f"{field}: pint cannot read {q.unit!r}"
        low, high = q.bounds
        assert not math.isnan(low) and not math.isnan(high) and low < high, field  # noqa: PT018
        assert low <= q.typical[0] < q.typical[1] <= high, f"{field}: the usual range is outside the bounds"
        assert len(q.doc) >= 4, field
        assert re.fullmatch(r"\w.*[^.:;\s]", q.doc), f"{field}: a phrase on one line, without a full stop"
        assert re.fullmatch(r"[a-z][a-z0-9_]*", field), field


@pytest.mark.parametrize("name", TYPES)
def test_defaults_lie_within_their_bounds(name: str) -> None:
    import dataclasses

    for f in dataclasses.fields(TYPES[name]):
        if "quantity" in f.metadata and f.default is not dataclasses.MISSING and f.default is not None:
            f.metadata["quantity"].check(f.name, f.default)


@pytest.mark.parametrize("law", LAWS)
def test_every_law_names_its_source_and_its_range(law: str) -> None:
    doc = importlib.import_module(f"mckibben.muscles.laws.{law}").__doc__ or ""
    assert "Range" in doc
    assert "doi:10." in doc or "Source" in doc
    assert " = " in doc or "(eq" in doc  # an equation, or the number of one


@pytest.mark.parametrize("law", LAWS)
def test_what_a_law_frees_and_cites_exists(law: str) -> None:
    kind = law_type(law)
    bib = (PACKAGE / "references.bib").read_text(encoding="utf-8")
    known = set(re.findall(r"^@\w+\{([^,\s]+),", bib, flags=re.MULTILINE))
    assert known
    assert kind.cites
    assert set(kind.cites) <= known
    assert kind.fitted
    assert set(kind.fitted) <= set(declared(kind))
    assert len(set(kind.fitted)) == len(kind.fitted)
    assert kind.title


def test_every_doi_of_a_docstring_is_in_the_bibliography() -> None:
    bib = (PACKAGE / "references.bib").read_text(encoding="utf-8").lower()
    found, missing = 0, []
    for path in sorted((PACKAGE / "muscles").rglob("*.py")):
        for doi in re.findall(r"doi:(10\.\d+/[^\s,;)\"]+)", path.read_text(encoding="utf-8")):
            found += 1
            if doi.rstrip(".").lower() not in bib:
                missing.append(f"{path.name}: {doi}")
    assert found > 10
    assert not missing, missing


def sources() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


@functools.cache
def read_house() -> counters.House:
    """The modules of the package, read once for all tests."""
    return counters.House.read("mckibben", PACKAGE)


@pytest.fixture(scope="module", autouse=True)
def _forget_sources() -> Iterator[None]:
    """Trees of all sources are a few hundred megabytes that no other file asks for."""
    yield
    read_house.cache_clear()
    parsed.cache_clear()


def definitions(body: list[Any]) -> Iterator[Any]:
    """Classes and functions among statements and what these contain; much faster than all nodes by `ast.walk`."""
    for node in body:
        if isinstance(node, DEFINITIONS):
            yield node
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            yield from definitions(getattr(node, part, []))


def test_every_module_class_and_public_function_says_what_it_is() -> None:
    silent: list[str] = []
    for path in [
        *sources(),
        *(path for folder in (COMPILER, *ABOVE.values()) for path in sorted(folder.rglob("*.py"))),
    ]:
        tree = parsed(path)
        where = "/".join(path.parts[path.parts.index("src") + 1 :])
        if tree.body and ast.get_docstring(tree) is None and path.name not in ("__init__.py", "__main__.py"):
            silent.append(where)
        silent += [f"{where}:{node.name}" for node in public(tree) if ast.get_docstring(node) is None]
    assert not silent, silent


@pytest.mark.parametrize("folder", counters.SOURCES.values(), ids=counters.SOURCES)
def test_docstrings_raise_only_errors_that_exist(folder: Path) -> None:
    """Every error named under "Raises:" is a builtin one, or a class of the distribution or of one that it depends on."""
    nodes = [(path, node) for path in sorted(folder.rglob("*.py")) for node in definitions(parsed(path).body)]
    classes = {node.name for _, node in nodes if isinstance(node, ast.ClassDef)}
    classes |= set(vars(lanewise.errors)) if folder != COMPILER else set()  # all others depend on the compiler
    classes |= set(vars(mckibben.errors)) if folder in ABOVE.values() else set()
    documented = [
        (f"{path.relative_to(folder)}:{node.name}", error)
        for path, node in nodes
        for error in _documented_errors(ast.get_docstring(node) or "")
    ]
    assert documented
    assert not [f"{where}: {error}" for where, error in documented if error not in classes | set(dir(builtins))]


def _documented_errors(docstring: str) -> list[str]:
    """Names of the section "Raises:", whose entries are indented by four spaces and their continuations by more."""
    section = re.search(r"^Raises:\n((?: {4}.*\n?|\n(?= ))+)", docstring, flags=re.MULTILINE)
    return re.findall(r"^ {4}([\w.]+):", section[1], flags=re.MULTILINE) if section else []


def public(tree: ast.Module) -> list[Any]:
    """Names without an underscore at the top of a module, and methods of such classes; no signatures of overloads."""
    bodies = [tree.body, *(c.body for c in tree.body if isinstance(c, ast.ClassDef) and not c.name.startswith("_"))]
    return [
        node
        for body in bodies
        for node in body
        if isinstance(node, ast.ClassDef | ast.FunctionDef)
        and not node.name.startswith("_")
        and not any(getattr(d, "id", "") == "overload" for d in node.decorator_list)
    ]


@pytest.mark.parametrize(
    ("pattern", "allowed"),
    [
        # A unit's factor in one place only; figures draw and nothing else does.
        (r"\bimport pint\b|\bpint\.", "quantities.py"),
        (r"matplotlib", "report/"),
        (r"jax_enable_x64", "_jax.py"),
    ],
)
def test_some_things_live_in_one_place(pattern: str, allowed: str) -> None:
    named = [p for p in sources() if re.search(pattern, p.read_text(encoding="utf-8"))]
    users = [str(p.relative_to(PACKAGE)) for p in named if re.search(pattern, _code(p))]
    assert users, "nobody does it any more: drop this line"
    assert all(user.startswith(allowed) or user.endswith(allowed) for user in users), users


@functools.cache
def _code(path: Path) -> str:
    """A module without its docstrings and comments."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    return ast.unparse(tree)


def test_the_import_contracts_hold() -> None:
    tool = Path(sys.executable).with_name("lint-imports")
    command = str(tool) if tool.is_file() else shutil.which("lint-imports")
    assert command, "import-linter belongs to the test requirements"
    done = subprocess.run(
        [command, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False, env=_environment()
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_nothing_names_a_module_of_a_package_above_it() -> None:
    """Not in a text either: such a package announces itself by entry points, and the house stands without it."""
    assert ABOVE
    for path in sources():
        assert not [name for name in ABOVE if name in path.read_text(encoding="utf-8")], path


def test_only_the_table_of_what_is_carried_out_above_names_a_package_above_its_own() -> None:
    """Imports for type checkers and modules named in a text lead as far as others do, which `lint-imports` does not read."""
    layers = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"][
        0
    ]["layers"]
    height = {room: -row for row, layer in enumerate(layers) for room in layer.split(" | ")} | {"": 1, "__main__": 1}
    house = read_house()
    upwards = []
    for one in (*house.imports, *house.named_modules):
        below, above = ((*name.split("."), "")[1] for name in (one.importer, one.imported))
        if below not in ("", above) and one.importer != counters.REGISTRY:
            upwards += [f"{one.importer} -> {one.imported}"] if height[above] >= height[below] else []
    assert upwards == []


def test_what_the_table_names_is_there() -> None:
    house = read_house()
    for place in accessors.PLACES.values():
        module, _, name = place.partition(":")
        assert name in {getattr(node, "name", "") for node in house.trees[f"mckibben.{module}"].body}, place


def test_no_file_leads_back_to_itself() -> None:
    assert read_house().circles() == []


def test_every_name_that_a_room_lists_is_there() -> None:
    for name in modules():
        with contextlib.suppress(MissingLibraryError):
            room = importlib.import_module(name)
            assert [one for one in getattr(room, "__all__", ()) if not hasattr(room, one)] == [], name


def test_importing_the_package_is_light() -> None:
    code = f"import sys, mckibben; print([m for m in {HEAVY!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=_environment())
    assert done.stdout.strip() == "[]"


def _environment() -> dict[str, str]:
    import os

    return os.environ | {"PYTHONPATH": os.pathsep.join(str(folder.parent) for folder in counters.SOURCES.values())}


# What the house may hold at most. Whoever adds something of worth raises these by the number that its own issue grants, and
# says so in the commit; whoever makes the house smaller lowers them to what is left, rounded up to the next ten.
LARGEST = {"src and packages": (143_840, 476), "src/mckibben": (111_360, None)}


@pytest.mark.parametrize("what", LARGEST)
def test_the_house_grows_by_what_was_granted_only(what: str) -> None:
    folders = [ROOT / "src", ROOT / "packages"] if what == "src and packages" else [ROOT / what]
    lines, files = counters.size(*folders)
    most, most_files = LARGEST[what]
    assert lines <= most, f"{lines} lines in {what}, {lines - most} more than granted"
    assert most_files is None or files <= most_files, f"{files} files in {what}, more than the {most_files} granted"
    assert lines > 0.8 * most, "it shrank by much: lower what it may hold"


def test_no_two_modules_that_are_found_by_their_name_alone_share_it() -> None:
    """Tests, docs and benchmarks import what stands beside them: of two of one name the first that is loaded is both."""
    homes: dict[str, list[str]] = {}
    for folder in (ROOT / "tests", ROOT / "docs", ROOT / "benchmarks", *(ROOT / "packages").glob("*/tests")):
        for path in folder.rglob("*.py"):
            if path.name not in ("__init__.py", "conftest.py"):
                homes.setdefault(path.name, []).append(str(path.relative_to(ROOT)))
    assert [paths for paths in homes.values() if len(paths) > 1] == []


@pytest.mark.parametrize("folder", ["benchmarks", "docs", "examples"])
def test_what_is_run_by_hand_imports_only_what_there_is(folder: str) -> None:
    """A benchmark that a move has left behind would be found out only when somebody wants its number."""
    lost = []
    for path in sorted((ROOT / folder).rglob("*.py")):
        for node in ast.walk(parsed(path)):
            if not isinstance(node, ast.ImportFrom) or not re.match(r"(mckibben|lanewise)", node.module or ""):
                continue
            spec = importlib.util.find_spec(str(node.module))
            source = "" if spec is None or spec.origin is None else Path(spec.origin).read_text(encoding="utf-8")
            beside = (
                {} if spec is None else {m.name for m in pkgutil.iter_modules(spec.submodule_search_locations or [])}
            )
            lost += [
                f"{path.relative_to(ROOT)}:{node.lineno} {node.module}.{one.name}"
                for one in node.names
                if not re.search(rf"\b{one.name}\b", source) and one.name not in beside
            ]
    assert lost == []


def test_the_version_is_stated_once() -> None:
    text = (PACKAGE / "_version.py").read_text(encoding="utf-8")
    assert len(re.findall(r"^__version__ = ", text, flags=re.MULTILINE)) == 1
    assert re.fullmatch(r"\d+\.\d+\.\d+", mckibben.__version__)


def test_no_page_of_the_screen_has_the_browser_read_code_from_text() -> None:
    """The policy of the pages refuses it: handlers are names of events, and calls are names of functions."""
    for path in (PACKAGE / "web").rglob("*"):
        if path.suffix in (".py", ".js", ".html") and "uplot" not in path.parts:
            source = path.read_text(encoding="utf-8")
            assert not re.search(r"\beval\(|new Function|javascript:|\bon(click|change|input|load)=[\"']", source), path


def test_contributing_names_every_room_and_their_order() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    listed = re.findall(r"^      ([a-z_]+(?:/|\.py)) {2,}\S", text, re.M)
    there = [p.name + ("/" if p.is_dir() else "") for p in PACKAGE.iterdir() if p.is_dir() or p.suffix == ".py"]
    assert len(listed) == len(set(listed))
    assert set(listed) == {name for name in there if not name.startswith("_")}
    (order,) = re.findall(r"^    (cli > .*\n(?: {6}> .*\n)*)", text, re.M)
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    assert " ".join(order.split()) == " > ".join(contracts[0]["layers"])
