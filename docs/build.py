"""Build the documentation into site/: run every example, generate the reference, and let zensical make the site.

    python docs/build.py                 everything, as `make docs` does
    python docs/build.py --fresh         the same, though nothing changed since a page was made (see kept.py)
    python docs/build.py PAGE ..         only the examples of these pages, printed: for a writer
    python docs/build.py --no-site       stage the pages in build/docs and stop
    python docs/build.py --readme        bring the numbers in README.md up to date

The build fails when an example raises or warns, when a command ends with another code than its block says, when an image
is missing, when zensical warns, and when a built page would load something from the network.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import time
import warnings
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
STAGE, SITE = ROOT / "build" / "docs", ROOT / "site"
sys.path.insert(0, str(DOCS))

import examples  # noqa: E402
import generated  # noqa: E402
import kept  # noqa: E402
import notebooks  # noqa: E402


def sources() -> list[Path]:
    """The written pages and the notebooks, in order."""
    return sorted([*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb")])


def stage(*, fresh: bool = False) -> None:
    """Write all pages with the output of their examples into the stage."""
    shutil.rmtree(STAGE, ignore_errors=True)
    for path in DOCS.rglob("*"):
        if path.is_file() and path.suffix in (".css", ".png", ".svg", ".ipynb"):
            _write(path.relative_to(DOCS), path.read_bytes())
    made = {p.relative_to(DOCS).with_suffix(".md").as_posix(): p.read_bytes() for p in sources()}
    made |= dict.fromkeys(generated.PAGES, b"")
    for page in kept.make_all(made, make, fresh=fresh):
        _write(Path(page.name), (page.folder / "page.md").read_bytes())
        for figure in (page.folder / "figures").iterdir():
            _write(Path("assets", "generated", Path(page.name).stem, figure.name), figure.read_bytes())
        print(f"  {page.name}" + (f"  {page.seconds:.1f} s" if page.seconds > 0.5 else ""), flush=True)
    _images_exist()


def make(name: str, figures: Path) -> str:
    """One page, generated or with the output of its examples; their figures go to a folder."""
    if name in generated.PAGES:
        return generated.PAGES[name](figures)
    if (book := (DOCS / name).with_suffix(".ipynb")).is_file():
        return notebooks.run_notebook(book, name, figures)
    return examples.run_page((DOCS / name).read_text(encoding="utf-8"), name, figures)


def site() -> None:
    """Let zensical build the site; any warning is a failure."""
    shutil.rmtree(SITE, ignore_errors=True)
    command = [sys.executable, "-m", "zensical", "build", "--strict", "--clean", "-f", str(ROOT / "mkdocs.yml")]
    done = subprocess.run(command, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    print(done.stdout, end="")
    if done.returncode or re.search(r"\b(warning|error)\b|^(griffe|mkdocstrings):", done.stdout, re.I | re.M):
        raise SystemExit("docs: zensical was not content")
    # Where the site is opened from the disk, a browser reads no JSON: the theme asks for the index as a script then.
    index = (SITE / "search.json").read_text(encoding="utf-8")
    (SITE / "search.js").write_text(f"var __index = {index}", encoding="utf-8")
    _loads_nothing()


def _loads_nothing() -> None:
    """No page may load a script, style, font or picture from elsewhere; links that a reader follows are no loads."""
    loads = re.compile(
        r"""<(?:script|img|iframe|source|video|audio)\b[^>]*\bsrc=["']?(?:https?:)?//[^"'>\s]+|<link\b[^>]*\bhref=["']?(?:https?:)?//[^>]*>"""
    )
    imports = re.compile(r"""(?:@import|url\()\s*["']?(?:https?:)?//[^)"']+""")
    for path in SITE.rglob("*"):
        if path.suffix in (".html", ".css"):
            text = path.read_text(encoding="utf-8")
            found = [
                m for m in (loads if path.suffix == ".html" else imports).findall(text) if 'rel="canonical"' not in m
            ]
            # The theme would fetch the programs for these from elsewhere, if a page had one.
            found += re.findall(r'class="[^"]*(?:mermaid|glightbox|pyodide)[^"]*"', text)
            if found:
                raise SystemExit(f"docs: {path.relative_to(ROOT)} loads from the network: {found[0]}")


def _images_exist() -> None:
    for path in STAGE.rglob("*.md"):
        for target in re.findall(r"!\[[^\]]*\]\(([^)\s]+)", path.read_text(encoding="utf-8")):
            if not (path.parent / target).is_file():
                raise SystemExit(f"docs: {path.relative_to(STAGE)} shows {target}, which is not there")


def _write(name: Path, data: bytes) -> None:
    path = STAGE / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def main(words: list[str]) -> None:
    """See the module's docstring."""
    warnings.simplefilter("error")
    pages = [w for w in words if not w.startswith("-")]
    if pages:
        for page in pages:
            path = Path(page).resolve()
            figures = ROOT / "build" / "examples" / path.stem
            figures.mkdir(parents=True, exist_ok=True)
            print(make(path.relative_to(DOCS).with_suffix(".md").as_posix(), figures))
        return
    if "--readme" in words:
        import readme

        readme.refresh(ROOT / "README.md")
        return
    begun = time.perf_counter()
    try:
        stage(fresh="--fresh" in words)
    except examples.ExampleError as error:
        raise SystemExit(f"docs: {error}") from None
    if "--no-site" not in words:
        site()
        print(f"site/index.html, in {time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
