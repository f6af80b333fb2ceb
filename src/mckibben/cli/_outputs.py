"""``--out``: the files that a command writes, each by its suffix; ``-`` is standard output.

A command declares once what it can write, in the order in which a suffix is looked up::

    OUT = OutputKinds(recording=RECORDING, figure=FIGURE)


    def run(out: Annotated[Paths, OUT.option()] = None) -> None:
        with OUT.files(out) as files:  # checks all paths before anything is computed
            recording = ...
            for path in files["recording"]:
                recording.save(path)
"""

from __future__ import annotations

import contextlib
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..documents import JsonValue
from ..errors import InputError, not_found
from . import _progress, _terminal

if TYPE_CHECKING:
    from ..recordings import Recording

Paths = list[Path] | None

FIGURE = (".svg", ".pdf", ".png")
RECORDING = (".nc", ".csv", ".mcap", ".mat", ".tdms", ".parquet")
KEPT_RECORDING = (".nc", ".csv")  # formats that hold all that a recording has
REPORT = (".html", ".pdf")
TABLE = (".csv", ".xlsx", ".parquet")
OBJECT = (".json",)  # what --json prints
SPECIMEN = (".toml",)
TEXT = (".csv", ".toml", ".md", ".json", ".svg", ".html")  # formats that a pipe takes, the one that is preferred first


class OutputKinds:
    """What a command can write.

    Args:
        folder: what is written into a folder, if a path without a suffix is taken, which is of the kind ``folder`` then.
        kinds: suffixes by what is written, such as ``figure=(".svg", ".png")``; the first that has a suffix takes it.
    """

    def __init__(self, folder: str = "", /, **kinds: Sequence[str]) -> None:
        self.folder, self.kinds = folder, kinds

    def option(self, *, note: str = "") -> Any:
        """The option ``--out`` in the signature of a command; `note` is a further sentence of the help."""
        listed = [f"{name.replace('_', ' ')} ({', '.join(suffixes)})" for name, suffixes in self.kinds.items()]
        listed += [f"{self.folder} (folder)"] if self.folder else []
        said = f"Write the {', '.join(listed[:-1]) + ' or ' + listed[-1] if len(listed) > 1 else listed[0]}"
        stream = self.stream()
        said += f"; - prints {stream}." if stream else "."
        shared = [s for s in self.all() if sum(s in suffixes for suffixes in self.kinds.values()) > 1]
        if shared and "figure" in self.kinds and "report" in self.kinds:
            said += f" {shared[0]} is the report, figure:NAME{shared[0]} the figure."
        return typer.Option("--out", metavar="OUT", help=f"{said} {note}".strip())

    def stream(self) -> str:
        """The suffix of what ``-`` prints; empty if nothing that can be written is a text."""
        return next((suffix for suffix in TEXT if suffix in self.all()), "")

    def all(self) -> list[str]:
        """All suffixes, each once."""
        return list(dict.fromkeys(s for suffixes in self.kinds.values() for s in suffixes))

    @contextlib.contextmanager
    def files(self, paths: Sequence[Path] | None, *, field: str = "--out") -> Iterator[OutputFiles]:
        """Check the paths before anything is computed, and say what was written at the end.

        Args:
            paths: as they were given.
            field: name of the option in error messages.

        Raises:
            InputError: a suffix is none of those that are written, or there is no such folder.
        """
        with contextlib.ExitStack() as stack:
            files: dict[str, list[Path]] = {kind: [] for kind in (*self.kinds, "folder")}
            streamed = None
            for path in paths or []:
                if str(path) == "-":
                    if not self.stream():
                        raise InputError(field, "-", f"must be a name that ends in {' or '.join(self.all())}")
                    place = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mckibben-")))
                    path = streamed = place / f"stdout{self.stream()}"
                    stack.enter_context(_terminal.silence())
                elif self.folder and not path.suffix:
                    files["folder"].append(path)
                    continue
                kind, path = self.placed(path, field)
                files[kind].append(path)
            yield OutputFiles(files, streamed)
            if streamed is None:
                return
            out = _terminal.stdout()
            if hasattr(out, "buffer"):
                out.flush()
                with streamed.open("rb") as stream:
                    shutil.copyfileobj(stream, out.buffer)
            else:
                out.write(streamed.read_text(encoding="utf-8"))
            out.flush()
            sys.stdout.flush()

    def placed(self, given: Path, field: str = "--out") -> tuple[str, Path]:
        """What is written to a path, and the path itself; ``figure:a.pdf`` names the kind where a suffix has two."""
        head, _, rest = str(given).partition(":")
        kinds = {head: self.kinds[head]} if rest and head in self.kinds else self.kinds
        path = Path(rest) if rest and head in self.kinds else given
        for kind, suffixes in kinds.items():
            if path.suffix.lower() in suffixes:
                if not path.absolute().parent.is_dir():
                    raise not_found(path.absolute().parent, "folder")
                if kind == "report":
                    from ..report.document import checked_place

                    checked_place(path, field=field)  # it may need a program that is not at hand
                return kind, path
        suffixes = list(dict.fromkeys(suffix for several in kinds.values() for suffix in several))
        raise InputError(field, str(given), f"must be a name that ends in {' or '.join(suffixes)}")


class OutputFiles(Mapping[str, list[Path]]):
    """Paths by what is written there; ``folder`` has those without a suffix."""

    def __init__(self, files: dict[str, list[Path]], streamed: Path | None) -> None:
        self._files, self._streamed = files, streamed

    def __getitem__(self, kind: str) -> list[Path]:
        return self._files.get(kind, [])

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)

    def named(self) -> list[Path]:
        """All paths that were given, without standard output."""
        return [path for paths in self._files.values() for path in paths if path != self._streamed]

    def first(self, kind: str) -> Path | None:
        """The first path of a kind that was given, not standard output."""
        return next((path for path in self[kind] if path != self._streamed), None)

    def write(self, kind: str, write: Callable[[Path], object], *, elsewhere: Path | None = None) -> None:
        """Write every file of a kind; Ctrl-C waits for that.

        Args:
            kind: what is written.
            write: writes it to a path.
            elsewhere: folder for what cannot be made again, where none of the files could be written.

        Raises:
            InputError: a file cannot be written; the others are, and named.
        """
        kept: list[str] = []
        errors: list[InputError] = []
        for path in [*self[kind], *([elsewhere] if elsewhere is not None else [])]:
            if path is elsewhere:
                if kept or not errors:
                    break
                path = elsewhere / self[kind][0].name
            with _progress.protected():
                try:
                    write(path)
                except InputError as error:
                    errors.append(error)
                    continue
                if path != self._streamed:
                    kept.append(str(path))
                    _progress.keep(str(path))
        if errors:
            more = f"; kept: {', '.join(kept)}" if kept else ""
            raise errors[0].changed(problem=f"{errors[0].problem}{more}")

    def write_columns(self, columns: Mapping[str, Iterable[object]], units: Mapping[str, str]) -> None:
        """Write every table, from columns of equal length with their SI units."""
        if self["table"]:
            from ..recordings.tables import write_table

            self.write("table", lambda path: write_table(columns, path, units=units))

    def write_result(self, value: dict[str, JsonValue]) -> None:
        """Write what ``--json`` prints into every JSON file."""
        if self["result"]:
            from ..documents import write_text

            self.write("result", lambda path: write_text(path, _terminal.json_text(value) + "\n"))

    def say(self, kind: str | None = None) -> None:
        """Print which files were written, all or those of one kind."""
        for path in self.named():
            if path in self[kind] if kind else path not in self["folder"]:  # of which each file is said
                typer.echo(f"Written: {path}")


def write_recording(recording: Recording, path: Path) -> None:
    """Write a recording in the format of the suffix, with a note on what that format does not hold."""
    from ..recordings import write

    for remark in write(recording, path):
        _terminal.note(f"{path}: {remark}")
