"""Build the documentation into site/: run every example, generate the reference, and let zensical make the site.

    python docs/build.py                 everything, as `make docs` does
    python docs/build.py --fresh         the same, without cached pages (see page_cache.py)
    python docs/build.py PAGE ..         only these pages, printed with the output of their examples
    python docs/build.py --no-site       stage the pages in build/docs and stop
    python docs/build.py --readme        bring the numbers in README.md up to date

The build fails if an example raises or warns, if the exit code of a command differs from the one stated in its block, if an
image is missing, if zensical warns, or if a page of the site would load something from the network.
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
import jobs  # noqa: E402
import lesson_notebooks  # noqa: E402
import links  # noqa: E402
import notebooks  # noqa: E402
import page_cache  # noqa: E402


def sources() -> list[Path]:
    """Return the paths of the written pages and the notebooks, in order."""
    return sorted([*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb")])


def stage(*, fresh: bool = False) -> None:
    """Write all pages, with the output of their examples, to the staging folder."""
    shutil.rmtree(STAGE, ignore_errors=True)
    for path in DOCS.rglob("*"):
        if path.is_file() and path.suffix in (".css", ".png", ".svg", ".ipynb"):
            _write(path.relative_to(DOCS), path.read_bytes())
    for path, book in lesson_notebooks.books().items():
        _write(Path("tutorials", path.name), book.encode())
    texts = {p.relative_to(DOCS).with_suffix(".md").as_posix(): p.read_bytes() for p in sources()}
    texts |= dict.fromkeys(generated.PAGES, b"")
    measured = {}
    for page in page_cache.build_all(texts, build, fresh=fresh):
        _write(Path(page.name), (page.folder / "page.md").read_bytes())
        for figure in (page.folder / "figures").iterdir():
            if figure.name != jobs.FILE:
                _write(Path("assets", "generated", Path(page.name).stem, figure.name), figure.read_bytes())
        if job := jobs.load(page.folder / "figures"):
            measured[page.name] = job
        print(f"  {page.name}" + (f"  {page.seconds:.1f} s" if page.seconds > 0.5 else ""), flush=True)
    _list_jobs(measured)
    _images_exist()


def _list_jobs(measured: dict[str, jobs.Measured]) -> None:
    """Print what each job takes, and write it to the list of the jobs."""
    page = STAGE / jobs.FOLDER / "index.md"
    page.write_text(jobs.with_times(page.read_text(encoding="utf-8"), measured), encoding="utf-8")
    print("jobs:")
    for name, job in sorted(measured.items()):
        print(f"  {name:32} {job.lines:3} lines, {job.first:5.1f} s the first time, {job.later:5.1f} s later", flush=True)


def build(name: str, figures: Path) -> str:
    """Return one page, generated or with the output of its examples; save their figures in a folder."""
    if name in generated.PAGES:
        return generated.PAGES[name](figures)
    if (book := (DOCS / name).with_suffix(".ipynb")).is_file():
        return notebooks.run_notebook(book, name, figures)
    text = links.site_page((DOCS / name).read_text(encoding="utf-8"), name)
    if name == links.INDEX:
        text = text.replace("<!-- pages of the Python reference -->", generated.list_of_rooms())
    if name in lesson_notebooks.PAGES:
        title, _, rest = text.partition("\n")
        text = f"{title}\n\n{lesson_notebooks.NOTE.format(name=Path(name).stem)}\n{rest}"
    return examples.run_page(text, name, figures)


def site() -> None:
    """Build the site by zensical; any warning is a failure."""
    shutil.rmtree(SITE, ignore_errors=True)
    command = [sys.executable, "-m", "zensical", "build", "--strict", "--clean", "-f", str(ROOT / "mkdocs.yml")]
    done = subprocess.run(command, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    print(done.stdout, end="")
    if done.returncode or re.search(r"\b(warning|error)\b|^(griffe|mkdocstrings):", done.stdout, re.I | re.M):
        raise SystemExit("docs: zensical reported a warning or an error")
    # A browser that opens the site from the disk cannot read JSON; the theme then loads the index as a script.
    index = (SITE / "search.json").read_text(encoding="utf-8")
    (SITE / "search.js").write_text(f"var __index = {index}", encoding="utf-8")
    _loads_nothing()


def _loads_nothing() -> None:
    """Fail if a page loads a script, style, font or image from the network; links for the reader are allowed."""
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
            # For these classes the theme would load programs from the network.
            found += re.findall(r'class="[^"]*(?:mermaid|glightbox|pyodide)[^"]*"', text)
            if found:
                raise SystemExit(f"docs: {path.relative_to(ROOT)} loads from the network: {found[0]}")


def _images_exist() -> None:
    for path in STAGE.rglob("*.md"):
        for target in re.findall(r"!\[[^\]]*\]\(([^)\s]+)", path.read_text(encoding="utf-8")):
            if not (path.parent / target).is_file():
                raise SystemExit(f"docs: {path.relative_to(STAGE)} shows {target}, but this file does not exist")


def _write(name: Path, data: bytes) -> None:
    path = STAGE / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def main(words: list[str]) -> None:
    """Run the command line described in the docstring of this module."""
    warnings.simplefilter("error")
    # with every answer of a muscle whose law has a large error
    warnings.filterwarnings("ignore", "the tension of .* may be off by")
    pages = [w for w in words if not w.startswith("-")]
    if pages:
        for page in pages:
            path = Path(page).resolve()
            figures = ROOT / "build" / "examples" / path.stem
            figures.mkdir(parents=True, exist_ok=True)
            print(build(path.relative_to(DOCS).with_suffix(".md").as_posix(), figures))
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
