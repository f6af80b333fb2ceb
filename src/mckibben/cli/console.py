"""``console``: the test machine at a prompt, from a script, or from a pipe."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import muscles
from ..bench import console as prompt_module
from ..bench import hardware as hardware_package
from ..bench import rig_file
from ..bench import session as session_package
from ..errors import ConvergenceError, InputError, MckibbenError
from ..quantities import parse
from ._progress import progress
from ._reading import CalibrationFile, Contraction, Muscle, NoiseSeed, On, Plumbing, RigName
from ._terminal import ask_person as ask_person

if TYPE_CHECKING:
    from ..bench.rig import Rig
    from ..bench.session.interface import MachineSession

LOOK = 0.2  # time between two looks at the machine for the line at the bottom and its messages [s]
ENDED = 143  # exit code after a signal that ends the program


def console(
    muscle: Muscle,
    rig: RigName = "paper",
    script: Annotated[
        Path | None,
        typer.Option("--script", metavar="SCRIPT", help="Script with one command per line; # begins a comment."),
    ] = None,
    machine: On = None,
    calibration: CalibrationFile = None,
    span: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH", help="Span at which the muscle is mounted, such as '14 cm'; by default its rest length."
        ),
    ] = None,
    contraction: Contraction = None,
    plumbing: Plumbing = None,
    rate: Annotated[str | None, typer.Option(metavar="FREQUENCY", help="Sample rate, such as '1 kHz'.")] = None,
    as_fast_as_it_goes: Annotated[
        bool,
        typer.Option(
            "--as-fast-as-it-goes", help="Advance simulated time only while commands are pending, as fast as possible."
        ),
    ] = False,
    seed: NoiseSeed = 0,
) -> None:
    """Operate a test machine, simulated or real, at a prompt, by a script or a pipe.

    $ mckibben console --muscle nylon --rig modern
    """
    hardware_package.backends.check_connection(machine)
    lines = None if script is None else _lines(script)
    if machine is not None and as_fast_as_it_goes:
        raise InputError("--as-fast-as-it-goes", None, "is allowed only without --on: a real machine has its own time")
    on, wanted = (
        rig_file.rig(rig, calibration=calibration),
        None if rate is None else parse(rate, "1/s", field="--rate"),
    )
    by_hand = lines is None and sys.stdin.isatty()
    if by_hand:
        typer.echo("Getting the machine ready ..", err=True)
    options = {"span": _span(span, contraction, muscle), "plumbing": plumbing, "rate": wanted, "seed": seed}
    with _ending(), _session(machine, on, muscle, speed=None if as_fast_as_it_goes else 1.0, **options) as session:
        spoken = prompt_module.Console(session, ask=ask_person)
        if by_hand:
            _at_a_prompt(spoken, muscle)
            code = 0
        else:
            code = _by_script(spoken, sys.stdin if lines is None else lines, str(script or "standard input"))
    if by_hand:
        typer.echo("Vented.")
    if code:
        raise typer.Exit(code)


def _span(span: str | None, contraction: str | None, muscle: str) -> str | None:
    """The span of the options, as text with its unit."""
    if contraction is None:
        return span
    if span is not None:
        raise InputError("--span", span, "is allowed only without --contraction")
    try:
        return f"{float(muscles.muscle.built_muscle(muscle).length_at(contraction))!r} m"
    except InputError as error:
        raise error.changed(field="--contraction" if error.field == "contraction" else error.field) from None


def _session(words: str | None, rig: Rig, muscle: str, **options: Any) -> MachineSession:
    """Open a session; that of a real machine is in a separate process, which nothing here can delay."""
    if words is None or words == "simulated":
        return session_package.Session(rig, muscle, **options)
    from ..bench.session.proxy import SessionProxy

    return SessionProxy(words, rig, muscle, **options)


def _lines(script: Path) -> list[str]:
    try:
        return script.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "it is no text"
        raise InputError("--script", str(script), f"it cannot be read: {why}") from None


@contextmanager
def _ending() -> Iterator[None]:
    """Vent first when the system asks the program to end."""
    names = [n for n in ("SIGTERM", "SIGHUP") if hasattr(signal, n)]
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(*_: Any) -> None:
        raise SystemExit(ENDED)

    before = {name: signal.signal(getattr(signal, name), end) for name in names}
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)


def _by_script(console: prompt_module.Console, lines: Iterable[str], where: str) -> int:
    """Execute and echo commands; exit code 2 after the first error, 1 if the machine stopped by itself."""
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        typer.echo(f"> {text}")
        try:
            with console.session.button.on_signals():
                answer = console.execute(text)
        except ConvergenceError as error:
            return _ended(console, f"{where}: line {number}: {error}", 1)
        except (MckibbenError, OSError) as error:
            return _ended(console, f"{where}: line {number}: {_said(error)}", 2)
        _tell(console, answer)
        if console.session.button.reason.startswith("signal"):
            return _ended(console, f"{where}: line {number}: interrupted", 130)
        if console.session.why and not text.lower().startswith("stop"):
            return _ended(console, f"{where}: line {number}: {console.session.why}", 1)
        if console.over:
            break
    return 0


def _ended(console: prompt_module.Console, sentence: str, code: int) -> int:
    _tell(console, "")
    typer.echo(f"mckibben: {sentence}", err=True)
    return code


def _said(error: Exception) -> str:
    """An error message as one line."""
    return f"{error.filename}: {error.strerror}" if isinstance(error, OSError) and error.filename else str(error)


def _tell(console: prompt_module.Console, answer: str) -> None:
    """Print the messages of the machine, then the answer."""
    for line in [*console.news(), *([answer] if answer else [])]:
        typer.echo(line)


def _at_a_prompt(console: prompt_module.Console, muscle: str) -> None:
    """Run the prompt until the user leaves. Ctrl-C stops the running command, or else clears the line; Ctrl-D leaves."""
    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import Completer, Completion
    from prompt_toolkit.history import FileHistory, InMemoryHistory
    from prompt_toolkit.patch_stdout import patch_stdout

    class Words(Completer):
        def get_completions(self, document: Any, _: Any) -> Iterator[Completion]:
            text = document.text_before_cursor
            last = text.rpartition(" ")[2]
            for word in console.complete(text):
                yield Completion(word, start_position=-len(last))

    place = _history()
    prompt: PromptSession[str] = PromptSession(
        "mckibben> ",
        history=InMemoryHistory() if place is None else FileHistory(place),
        completer=Words(),
        complete_while_typing=False,
        bottom_toolbar=lambda: console.session.status().line(),
        refresh_interval=LOOK,
        enable_history_search=True,
    )
    typer.echo(f"{console.session.rig.title}, {muscle}. help says what it knows.")
    while not console.over:
        try:
            with patch_stdout(), _echoed(console):
                line = prompt.prompt()
        except KeyboardInterrupt:
            continue
        except EOFError:
            return
        try:
            with console.session.button.on_signals(), _bar(console, line):
                answer = console.execute(line)
        except (MckibbenError, OSError) as error:
            typer.echo(f"mckibben: {_said(error)}", err=True)
            answer = ""
        _tell(console, answer)


@contextmanager
def _bar(console: prompt_module.Console, line: str) -> Iterator[None]:
    """Show a progress bar during a run."""
    if not line.split() or line.split()[0].lower() != "run":
        yield
        return
    with progress("running", 1.0, guarded=False) as bar:
        console.progress = bar.at
        yield


@contextmanager
def _echoed(console: prompt_module.Console) -> Iterator[None]:
    """Show the machine's messages above the prompt while it waits for input."""
    done = threading.Event()

    def echo() -> None:
        while not done.wait(LOOK):
            for line in console.news():
                print(line)

    thread = threading.Thread(target=echo, name="console messages", daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def _history() -> str | None:
    """Path of the command history, if there is a place for it."""
    home = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_STATE_HOME") or os.path.expanduser("~/.local/state")
    if not os.path.isabs(home):
        return None
    folder = os.path.join(home, "mckibben")
    try:
        os.makedirs(folder, exist_ok=True)
        path = os.path.join(folder, "console-history")
        with open(path, "a", encoding="utf-8"):
            pass
    except OSError:
        return None
    return path
