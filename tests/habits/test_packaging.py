"""What a published package says of itself, and says the same everywhere."""

import importlib
import re
import tomllib
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet

import lanewise
import mckibben
from mckibben.extras import LIBRARIES
from mckibben.registry import PACKAGES

ROOT = Path(__file__).parents[2]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = SETTINGS["project"]
COMPILER = tomllib.loads((ROOT / "packages/lanewise/pyproject.toml").read_text(encoding="utf-8"))["project"]
ABOVE = {
    name: (importlib.import_module(name.replace("-", "_")), tomllib.loads(path.read_text(encoding="utf-8"))["project"])
    for name in sorted(PACKAGES.values())
    for path in [ROOT / "packages" / name / "pyproject.toml"]
}
BOUNDED = [r for r in {*PROJECT["dependencies"], *COMPILER["dependencies"]} if not r.startswith("lanewise")]
WORKFLOW = (ROOT / ".github/workflows/test.yml").read_text(encoding="utf-8")


def names(requirements: list[str]) -> set[str]:
    return {re.split(r"[<>=;\[ ]", r)[0].lower().replace("_", "-") for r in requirements}


def lines(name: str) -> list[str]:
    return (ROOT / name).read_text(encoding="utf-8").splitlines()


def test_the_version_is_the_same_in_all_packages_citation_and_changelog() -> None:
    assert {package.__version__ for package in (lanewise, *(one for one, _ in ABOVE.values()))} == {
        mckibben.__version__
    }
    assert f"version: {mckibben.__version__}" in lines("CITATION.cff")
    assert re.search(rf"^## {re.escape(mckibben.__version__)}\b", "\n".join(lines("CHANGELOG.md")), flags=re.M)


def test_distributions_of_one_release_ask_for_each_other_and_for_no_other_release() -> None:
    """They share private modules: a minor version that is newer or older may have renamed them; a repair may not."""
    projects = [PROJECT, COMPILER, *(project for _, project in ABOVE.values())]
    asked = [
        r for p in projects for part in (p["dependencies"], *p.get("optional-dependencies", {}).values()) for r in part
    ]
    within = [re.split(r"(?=[<>=])", r, maxsplit=1)[1] for r in asked if re.match(r"(mckibben|lanewise)\b", r)]
    major, minor, _ = map(int, mckibben.__version__.split("."))
    newer = (f"{major}.{minor + 1}.0", f"{major + 1}.0.0", f"{major}.{minor}.0rc1")
    assert [mckibben.__version__ in SpecifierSet(one) for one in within] == [True] * len(within)
    assert not [one for one in within for other in newer if other in SpecifierSet(one)]
    assert (
        len(within) == 5 + len(PACKAGES) + sum(len(p.get("optional-dependencies", ())) for _, p in ABOVE.values()) + 1
    )


def test_the_package_says_that_it_is_typed() -> None:
    assert Path(mckibben.__file__).with_name("py.typed").is_file()
    assert "Typing :: Typed" in PROJECT["classifiers"]


def test_the_compiler_of_this_repository_is_the_one_that_the_laboratory_asks_for() -> None:
    (asked,) = [r for r in PROJECT["dependencies"] if r.startswith("lanewise")]
    assert lanewise.__version__ in SpecifierSet(asked.removeprefix("lanewise"))
    assert COMPILER["requires-python"] == PROJECT["requires-python"]
    assert Path(lanewise.__file__).with_name("py.typed").is_file()


def test_every_python_that_is_promised_is_tried() -> None:
    promised = [c.rsplit(" ", 1)[1] for c in PROJECT["classifiers"] if re.search(r"Python :: 3\.\d+$", c)]
    assert re.search(r"python: \[(.*)\]", WORKFLOW).group(1).replace('"', "").split(", ") == promised
    assert PROJECT["requires-python"] == f">={promised[0]}"


def test_the_workflow_calls_what_continuous_integration_calls() -> None:
    assert re.findall(r"^ +- run: (make \w+)$", WORKFLOW, flags=re.M) == re.findall(
        r"^(make \w+)$", "\n".join(lines(".ci/run")), flags=re.M
    )


def test_the_demonstration_installs_what_the_package_needs_and_what_writes_pdf() -> None:
    """`make demo` is the first command of the README; it has these requirements and no others."""
    asked = names([line for line in lines("requirements/run.in") if line and not line.startswith("#")])
    assert names(BOUNDED) | {"typst"} <= asked
    pinned = names([line for line in lines("requirements/run.txt") if line and not line.startswith(" ")])
    assert asked <= pinned


def test_the_packages_above_are_known_wherever_they_must_be_named() -> None:
    """Elsewhere a pattern finds them: in the `Makefile`, in the folders of types and tests, in the check of the wheels."""
    assert {path.parent.name for path in ROOT.glob("packages/*/pyproject.toml")} == {"lanewise", *ABOVE}
    modules = {package.__name__ for package, _ in ABOVE.values()}
    imports = SETTINGS["tool"]["importlinter"]
    assert set(imports["root_packages"]) == {"mckibben", "lanewise", *modules}
    contracts = [c for c in imports["contracts"] if c["type"] == "forbidden"]
    forbidden = {c["source_modules"][0]: set(c["forbidden_modules"]) for c in contracts}
    assert forbidden["mckibben"] == modules
    assert forbidden["lanewise"] == {"mckibben", *modules}
    (documented,) = re.findall(r"^ +paths: \[(.*)\]$", "\n".join(lines("mkdocs.yml")), flags=re.M)
    assert set(documented.split(", ")) == {"src", *(f"packages/{name}/src" for name in ABOVE)}
    extras = PROJECT["optional-dependencies"]
    assert {extra: names(extras[extra]) for extra in PACKAGES} == {e: {n} for e, n in PACKAGES.items()}


@pytest.mark.parametrize("name", ABOVE)
def test_a_package_above_asks_for_this_one_and_its_extra_brings_it(name: str) -> None:
    """The bounds of both are the version of either; every extra of such a package is one of mckibben, too."""
    package, project = ABOVE[name]
    (asked,) = [r for r in project["dependencies"] if re.match(r"mckibben\W", r)]
    assert mckibben.__version__ in SpecifierSet(asked.removeprefix("mckibben"))
    extras = PROJECT["optional-dependencies"]
    brought = [r for listed in extras.values() for r in listed if r.startswith(name)]
    assert {re.sub(rf"^{name}(\[\w+\])?", "", r) for r in brought} == {asked.removeprefix("mckibben")}
    assert package.__version__ in SpecifierSet(asked.removeprefix("mckibben"))
    assert {e for e, listed in extras.items() if listed in ([r] for r in brought)} - set(PACKAGES) == set(
        project.get("optional-dependencies", ())
    )
    assert project["requires-python"] == PROJECT["requires-python"]
    assert Path(package.__file__).with_name("py.typed").is_file()


def test_every_library_that_is_asked_for_comes_with_its_extra() -> None:
    above = {e: listed for _, one in ABOVE.values() for e, listed in one.get("optional-dependencies", {}).items()}
    extras = {e: above.get(e, listed) for e, listed in PROJECT["optional-dependencies"].items() if e not in PACKAGES}
    for module, (extra, package) in LIBRARIES.items():
        assert names([package]) <= names(extras[extra]), module
    brought = {n for listed in extras.values() for n in names(listed)}
    assert brought == {n for _, package in LIBRARIES.values() for n in names([package])}


def test_bounds_of_the_package_hold_for_the_pinned_versions_on_every_python() -> None:
    """Pins that differ between Pythons once gave 3.12 a JAX whose loops the native engine does not know."""
    bounds = {r.split(">=")[0].lower().replace("_", "-"): SpecifierSet(r[len(r.split(">=")[0]) :]) for r in BOUNDED}
    for name in ("run", "test", "docs"):
        pins = [re.match(r"([\w.-]+)==([\w.]+)", line) for line in lines(f"requirements/{name}.txt")]
        found = [(pin[1].lower(), pin[2]) for pin in pins if pin and pin[1].lower() in bounds]
        assert {n for n, _ in found} == set(bounds)
        assert not [f"{n} {v}" for n, v in found if v not in bounds[n]], name
