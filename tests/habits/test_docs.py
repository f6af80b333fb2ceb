"""The documentation names everything a reader can use, and its links lead somewhere; `make docs` builds the site."""

import importlib.util
import json
import pkgutil
import re
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
import typer

import mckibben
from mckibben.citations import known_keys
from mckibben.cli.app import app
from mckibben.extras import LIBRARIES
from mckibben.muscles import LAWS
from mckibben.muscles.hysteresis import HYSTERESES

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
WRITTEN = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
TEXT = {page: page.read_text(encoding="utf-8") for page in WRITTEN}
NAVIGATION = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
PLAIN = {page: re.sub(r"^```.*?^```", "", text, flags=re.M | re.S) for page, text in TEXT.items()}


NOTEBOOKS = sorted(DOCS.rglob("*.ipynb"))
READMES = [*(ROOT / name for name in ("SECURITY.md", "CHANGELOG.md", "benchmarks/README.md"))]
READMES += sorted((ROOT / "packages").rglob("README.md"))
LINKED = [*WRITTEN, *NOTEBOOKS, *sorted((ROOT / "examples").rglob("*.ipynb")), *READMES]
# Rooms without a page in the reference of Python: command line and screen have pages of their own.
NO_ROOM = ("mckibben.cli", "mckibben.__main__", "mckibben.batch", "mckibben.web")


def script(name: str) -> ModuleType:
    """A script of the documentation's build as a module; nothing of it is run."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def generated() -> ModuleType:
    """The build's own list of the pages that it generates."""
    return script("generated")


def made_pages() -> set[Path]:
    """The pages that the build makes: those it generates, and the notebooks."""
    return {DOCS / name for name in generated().PAGES} | {book.with_suffix(".md") for book in NOTEBOOKS}


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("law", LAWS)
def test_every_law_is_explained(law: str) -> None:
    assert f"### `{law}`" in TEXT[DOCS / "explanation/laws.md"]
    assert f"| `{law}` |" in TEXT[ROOT / "README.md"]


@pytest.mark.parametrize("friction", HYSTERESES)
def test_every_friction_is_explained(friction: str) -> None:
    assert f"`{friction}`" in TEXT[DOCS / "explanation/friction.md"]


def test_every_command_is_used_in_an_example() -> None:
    text = "\n".join(TEXT.values())
    for command in typer.main.get_command(app).commands:  # type: ignore[attr-defined]
        assert f"$ mckibben {command}" in text, command


def test_the_commands_without_json_are_those_that_the_reference_names() -> None:
    lasting = generated().without_json()
    assert lasting == ["console", "device serve", "serve"]  # they go on until somebody ends them
    for page in (DOCS / "reference").rglob("*.md"):
        assert "Every command takes `--json`" not in page.read_text(encoding="utf-8")


def targets(text: str) -> list[str]:
    """The places to which the links and pictures of a text lead, without those on other hosts."""
    return [t for t in re.findall(r"\]\(([^)\s]+)\)", text) if not re.match(r"https?:", t)]


def text_of(page: Path) -> str:
    """The text of a page or notebook, without blocks of code and without comments."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".ipynb":
        cells = [c for c in json.loads(text)["cells"] if c["cell_type"] == "markdown"]
        return "\n\n".join("".join(c["source"]) for c in cells)
    return re.sub(r"<!--.*?-->", "", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S), flags=re.S)


@pytest.mark.parametrize("page", LINKED, ids=name_of)
def test_links_lead_somewhere_in_the_repository(page: Path) -> None:
    """As GitHub shows it: what only the build makes is not there. `docs/links.py` says how to link to that."""
    for target in targets(text_of(page)):
        path, _, anchor = target.partition("#")
        place = (page.parent / path).resolve() if path else page
        assert place.exists() and (DOCS / "assets/generated") not in place.parents, target
        if anchor:
            assert anchor in anchors(place, script("links").github_anchor), target


@pytest.mark.parametrize("page", [*PAGES, *NOTEBOOKS], ids=name_of)
def test_links_lead_somewhere_on_the_site(page: Path) -> None:
    links, made = script("links"), made_pages()
    stored = text_of(page) + "".join(f"\n{c}\n" for c in links.PICTURE.findall(page.read_text(encoding="utf-8")))
    for target in targets(links.site_page(stored, page.relative_to(DOCS).as_posix())):
        path, _, anchor = target.partition("#")
        place = (page.parent / path).resolve() if path else page
        if place.parent == DOCS / "assets/generated" / page.stem:
            continue  # a picture that an example of this page draws; the build fails where it is missing
        assert DOCS in place.parents, f"{target} is not on the site"
        assert place in made or place.exists(), target
        if anchor and place not in made:
            assert anchor in anchors(place, links.site_anchor), target


def anchors(page: Path, anchor_of: Callable[[str], str]) -> set[str]:
    """The anchors of the headings of a page."""
    return {anchor_of(head) for head in re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)}


def test_every_generated_page_of_the_reference_has_a_heading() -> None:
    links, build = script("links"), generated()
    assert set(links.GENERATED) < anchors(DOCS / "reference/index.md", links.github_anchor)
    assert set(links.GENERATED.values()) == {n for n in build.PAGES if "/api/" not in n} | {"reference/api/mckibben.md"}


# What a block asks for without an import: of which extra, by a pattern.
ASKED = {
    "formats": r"\w\.(xlsx|parquet|tdms|mat|db3)\b", "posterior": r"--posterior\b|posterior=True",
    "report": r"^\$ mckibben (record report|reproduce|fit|compare)\b.*\.pdf\b", "sweep": r"^\$ mckibben sweep\b",
    "serial": r"--on serial:", "daq": r"--on daq\b", "mujoco": r"(--for|conform) mujoco\b",
    "gym": r"mckibben_hosts\.gymnasium",
}  # fmt: skip
INSTALLED = ("data", "web")  # by the line that every page takes for granted
BROUGHT = {"bluesky": "bluesky", "mujoco": "warp"}  # libraries that those of another extra need, too


@pytest.mark.parametrize("page", [p for p in WRITTEN if "```" in TEXT[p] and "decisions" not in p.parts], ids=name_of)
def test_a_page_names_what_its_visible_blocks_need_beyond_the_installation(page: Path) -> None:
    """Extras by their names, other libraries by a command of pip: else a reader finds out by a traceback."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    basic = {re.split(r"[<>=]", r)[0].lower().replace("-", "_") for r in project["dependencies"]} | {"IPython"}
    blocks = re.findall(r"^```(python|console|sh)\b((?!.*\bquiet\b)[^\n]*)\n(.*?)^```", TEXT[page], flags=re.M | re.S)
    wanted, libraries = set(), set()
    for kind, _, body in blocks:
        wanted |= {extra for extra, pattern in ASKED.items() if re.search(pattern, body, flags=re.M)}
        if kind == "python":
            libraries |= {m for m in re.findall(r"^(?:import|from) (\w+)", body, flags=re.M)}
    libraries -= {*sys.stdlib_module_names, *basic, *(p.name for p in ROOT.glob("packages/*/src/*")), "mckibben"}
    libraries -= {library for library, extra in BROUGHT.items() if f"`{extra}`" in TEXT[page]}
    wanted |= {LIBRARIES[library][0] for library in libraries if library in LIBRARIES}
    assert {extra for extra in wanted - {*INSTALLED} if f"`{extra}`" not in TEXT[page]} == set()
    own = set(re.findall(r'file=(\w+)\.py|Path\("(\w+)\.py"\)|--out (\w+)', TEXT[page]))  # written by the page itself
    others = libraries - set(LIBRARIES) - {name for pair in own for name in pair}
    assert {name for name in others if not re.search(rf"pip install [^`\n]*\b{name}\b", TEXT[page])} == set()


@pytest.mark.parametrize("page", [*(p for p in WRITTEN if p.name != "CONTRIBUTING.md"), *READMES[3:]], ids=name_of)
def test_a_command_stands_where_it_is_run_as_printed(page: Path) -> None:
    """In a block that `docs/as_printed.py` runs, or that says what it needs: nobody runs an indented one, or text."""
    text = page.read_text(encoding="utf-8")
    others = re.findall(r"^```(?!(?:python|console|sh)\b)[^\n]*\n(.*?)^```", text, flags=re.M | re.S)
    others += re.findall(r"^    (.*)$", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S), flags=re.M)
    command = r"^(?:\$ )?(?:mckibben .*|python (?:examples|benchmarks)/.*|(?:import|from) mckibben\b.*)$"
    assert re.findall(command, "\n".join(others), flags=re.M) == []


def test_every_job_has_a_page_that_runs_it_and_a_row_in_the_list() -> None:
    jobs = {p.name: TEXT[p] for p in (DOCS / "jobs").glob("*.md") if p.name != "index.md"}
    listed = re.findall(r"^\|.*\]\(([\w-]+\.md)\).*\| \| \| \|$", TEXT[DOCS / "jobs/index.md"], re.M)
    assert sorted(listed) == sorted(jobs)
    for name, text in jobs.items():
        assert re.search(r"^```(python|console) job", text, re.M) and "<!-- job -->" in text, name


def test_every_page_is_in_the_navigation() -> None:
    listed = set(re.findall(r"([\w/-]+\.md)$", NAVIGATION, re.M))
    assert listed == {str(p.relative_to(DOCS)) for p in {*PAGES, *made_pages()}}


def test_every_module_is_in_the_reference() -> None:
    build = generated()
    shown = [
        module
        for name, (_, _, entries) in build.ROOMS.items()
        for entry in entries
        for module in build._modules(entry, build.ELSEWHERE.get(name, set()))
    ]
    assert len(shown) == len(set(shown))
    there = {m.name for m in pkgutil.walk_packages(mckibben.__path__, "mckibben.") if not m.ispkg}
    private = {m for m in there if m.startswith(NO_ROOM) or "._" in m}
    assert {m for m in shown if m in there} == there - private


@pytest.mark.parametrize("book", NOTEBOOKS, ids=lambda book: book.name)
def test_a_notebook_is_kept_without_outputs_and_its_figures_have_words(book: Path) -> None:
    cells = json.loads(book.read_text(encoding="utf-8"))["cells"]
    code = [c for c in cells if c["cell_type"] == "code"]
    assert code
    assert all(c["outputs"] == [] and c["execution_count"] is None for c in code)
    assert all(c["metadata"].get("alt") for c in code if "SVG(" in "".join(c["source"]))


def test_the_notebooks_of_the_lessons_agree_with_their_pages() -> None:
    made = script("lesson_notebooks").books()
    assert sorted(made) == sorted((ROOT / "examples/notebooks").glob("*.ipynb"))
    for path, book in made.items():
        assert path.read_text(encoding="utf-8") == book, f"{path.name}: run python docs/lesson_notebooks.py"


def test_the_architecture_page_agrees_with_the_source() -> None:
    architecture = script("architecture")
    page = TEXT[DOCS / "explanation/architecture.md"]
    for diagram in (architecture.draw_layers(), architecture.draw_run()):  # these fail where a module is missing
        assert diagram.startswith("<svg")
    for package in (name for layer in architecture.layers() for name in layer):
        assert re.search(rf"^\|.*`{package}`.*\|", page, re.M), package


def test_decisions_state_context_decision_and_consequences() -> None:
    decisions = sorted((DOCS / "explanation/decisions").glob("[0-9]*.md"))
    for number, page in enumerate(decisions, 1):
        assert page.name.startswith(f"{number:04d}-")
        assert TEXT[page].startswith(f"# {number} ")
        assert re.findall(r"^## (.*)$", TEXT[page], re.M) == ["Context", "Decision", "Consequences"], page.name
        assert page.name in TEXT[DOCS / "explanation/decisions/index.md"]


def test_citation_keys_in_examples_are_known() -> None:
    for page, text in TEXT.items():
        for keys in re.findall(r"^sources = \[(.*)\]$", text, re.M):
            for key in re.findall(r'"([^"]+)"', keys):
                assert key in known_keys(), (page.name, key)


def test_nothing_is_loaded_from_elsewhere() -> None:
    assert "font: false" in NAVIGATION
    for page in PAGES:
        assert not re.search(r"!\[[^\]]*\]\(https?:|<(?:script|iframe|img|link)\b", PLAIN[page]), page.name
    # The offline plugin of the theme would add a script from a public server.
    assert not re.search(r"https?://|^ *- offline", NAVIGATION, re.M)
