"""``completion`` and ``help``: what a shell completes, and the help of a command by its name.

Completion imports the command that is typed and nothing that computes; names of muscles, laws, rigs and protocols are read
from the files of the package.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from ..errors import InputError
from . import _terminal, _values
from ._terminal import Json

SCRIPTS = {
    "bash": """\
_mckibben() {
  local IFS=$'\\n'
  COMPREPLY=($(mckibben completion bash --line "${COMP_LINE:0:$COMP_POINT}" 2>/dev/null))
  [[ ${#COMPREPLY[@]} -eq 1 && ${COMPREPLY[0]} == *[/=:] ]] && compopt -o nospace
  return 0
}
complete -o nosort -F _mckibben mckibben
""",
    "zsh": """\
#compdef mckibben
_mckibben() {
  local line
  local -a names open
  for line in "${(@f)$(mckibben completion zsh --line "${(j: :)words[1,CURRENT]}" 2>/dev/null)}"; do
    case "${line%%$'\\t'*}" in
      '') ;;
      *[/=:]) open+=("${line%%$'\\t'*}") ;;
      *) names+=("${${line%%$'\\t'*}//:/\\\\:}:${line#*$'\\t'}") ;;
    esac
  done
  (( ${#names} )) && _describe -V mckibben names
  (( ${#open} )) && compadd -S '' -- "${open[@]}"
}
compdef _mckibben mckibben
""",
    "fish": """\
complete -c mckibben -f
complete -c mckibben -a '(mckibben completion fish --line (commandline -cp | string collect))'
""",
}
INSTALLED = {
    "bash": """eval "$(mckibben completion bash)" in ~/.bashrc""",
    "zsh": """eval "$(mckibben completion zsh)" in ~/.zshrc, after compinit""",
    "fish": "mckibben completion fish | source in ~/.config/fish/config.fish",
}


class Completion(NamedTuple):
    """A word that may follow, and what it means."""

    word: str
    meaning: str = ""


def completion(
    context: typer.Context,
    shell: Annotated[str, typer.Argument(metavar="SHELL", help="bash, zsh or fish.")],
    line: Annotated[
        str | None, typer.Option(metavar="TEXT", help="Print what may follow this line instead, for the script itself.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Print the script with which a shell completes commands, options and values.

    Install it by one line: eval "$(mckibben completion bash)" in ~/.bashrc, eval "$(mckibben completion zsh)" in
    ~/.zshrc, or mckibben completion fish | source in ~/.config/fish/config.fish.

    $ mckibben completion bash
    """
    if shell not in SCRIPTS:
        raise InputError("shell", shell, known=SCRIPTS)
    if line is None:
        if as_json:
            _terminal.print_json({"shell": shell, "script": SCRIPTS[shell], "installation": INSTALLED[shell]})
        else:
            typer.echo(SCRIPTS[shell], nl=False)
        return
    last, completions = candidates(line, context.find_root().command)
    if as_json:
        _terminal.print_json({"candidates": [one._asdict() for one in completions]})
        return
    # bash replaces only what follows the last of these signs
    cut = max(last.rfind("="), last.rfind(":")) + 1 if shell == "bash" else 0
    for one in completions:
        typer.echo(one.word[cut:] if shell == "bash" else f"{one.word}\t{one.meaning}")


def show_help(
    context: typer.Context,
    command: Annotated[
        list[str] | None, typer.Argument(metavar="COMMAND", help="Command, such as fit or circuit run.")
    ] = None,
) -> None:
    """Show the help of a command.

    $ mckibben help circuit run
    """
    program: Any = context.find_root().command
    program.main(args=[*(command or []), "--help"], prog_name=context.find_root().info_name, standalone_mode=False)


# ---- candidates


def candidates(line: str, program: Any) -> tuple[str, list[Completion]]:
    """The word that is being typed at the end of a command line of a program, and the words that it may become."""
    words = _split(line)[1:] or [""]
    *before, last = words
    command, rest = _command(before, program)
    if hasattr(command, "commands"):
        if rest:
            return last, []
        known = [Completion(name, summary) for name, summary in command.commands.summaries()]
        known += [Completion("--help", "Show this help and exit.")]
        known += [Completion("--version", "Print the version and exit.")] if command.params else []
    elif command.words == "help":
        group, more = _command(rest, program)
        known = [] if more else [Completion(*one) for one in getattr(group, "commands", _NoCommands).summaries()]
    else:
        known = list(_of_command(command, rest, last))
    return last, [one for one in known if one.word.startswith(last)]


class _NoCommands:
    @staticmethod
    def summaries() -> list[tuple[str, str]]:
        return []


def _split(line: str) -> list[str]:
    """The words of a line as a shell has them; the last may be empty, or have an open quote."""
    words, current, quote, escaped, begun = [], "", "", False, False
    for sign in line:
        if escaped:
            current, escaped = current + sign, False
        elif sign == "\\" and quote != "'":
            escaped = begun = True
        elif quote:
            current, quote = (current, "") if sign == quote else (current + sign, quote)
        elif sign in "'\"":
            quote, begun = sign, True
        elif sign.isspace():
            if current or begun:
                words.append(current)
            current, begun = "", False
        else:
            current += sign
    return [*words, current]


def _command(words: list[str], program: Any) -> tuple[Any, list[str]]:
    """The command that words name, and the words behind its name."""
    command = program
    for i, word in enumerate(words):
        if not hasattr(command, "commands") or word not in set(command.commands):
            return command, words[i:]
        command = command.commands[word]
    return command, []


def _of_command(command: Any, before: list[str], last: str) -> Iterator[Completion]:
    """Options and values that may follow within a command."""
    options = {
        name: p for p in command.params if p.param_type_name == "option" for name in (*p.opts, *p.secondary_opts)
    }
    stated, arguments, waiting = set(), [], None
    for word in before:
        name = word.partition("=")[0]
        if waiting is not None:
            waiting = None
        elif name in options:
            stated.add(options[name].name)
            waiting = None if options[name].is_flag or "=" in word else options[name]
        elif not word.startswith("-") or word == "-":
            arguments.append(word)
    if waiting is not None:
        yield from values(waiting, last, arguments, before)
        return
    name, equals, _ = last.partition("=")
    if equals and name in options:
        start = f"{name}="
        completions = values(options[name], last.removeprefix(start), arguments, before)
        yield from (Completion(start + one.word, one.meaning) for one in completions)
        return
    if last.startswith("-"):
        for name, p in options.items():
            if p.name not in stated or p.multiple:
                yield Completion(name, (p.help or "").partition(";")[0].partition(". ")[0])
        yield from (Completion("--quiet", "Print only errors."), Completion("--help", "Show this help and exit."))
        return
    places = [p for p in command.params if p.param_type_name == "argument"]
    if places:
        place = places[min(len(arguments), len(places) - 1)]
        if len(arguments) < len(places) or place.nargs == -1:
            yield from values(place, last, arguments, before)


def values(param: Any, last: str, arguments: list[str], before: list[str]) -> Iterator[Completion]:
    """Values that a parameter may have, beginning with what is typed."""
    kind = _values.kind_of(param)
    if kind.names is not None:
        yield from (Completion(*one) for one in kind.names() if one[0].startswith(last))
    if param.metavar == "PATH=VALUE" and "=" not in last:
        yield from (
            Completion(f"{path}=", meaning) for path, meaning in _paths(arguments, before) if path.startswith(last)
        )
    if kind.suffixes:
        yield from _files(last, kind.suffixes)


def _files(last: str, suffixes: Iterable[str]) -> Iterator[Completion]:
    """Files with these suffixes, and folders."""
    folder, name = os.path.split(last)
    try:
        entries = sorted(os.scandir(os.path.expanduser(folder) or "."), key=lambda e: e.name)
    except OSError:
        return
    wanted = tuple(suffixes)
    for entry in entries:
        if not entry.name.startswith(name) or (entry.name.startswith(".") and not name.startswith(".")):
            continue
        path = os.path.join(folder, entry.name)
        if entry.is_dir():
            yield Completion(f"{path}/")
        elif "" in wanted or entry.name.lower().endswith(wanted):
            yield Completion(path)


def _paths(arguments: list[str], before: list[str]) -> Iterator[tuple[str, str]]:
    """Paths of values in what the command line names: a protocol, a muscle, a circuit."""
    names = [*arguments, *(after for word, after in zip(before, before[1:], strict=False) if word == "--muscle")]
    for name in names:
        for path in (
            Path(name), _values.PACKAGE / "experiments" / "protocols" / f"{name}.toml",
            _values.PACKAGE / "specimens" / "data" / f"{name.lower()}.toml",
        ):  # fmt: skip
            if path.suffix == ".toml" and path.is_file():
                yield from _paths_in(_values.read_toml(path))
                break


def _paths_in(document: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for name, one in document.get("parameters", {}).items():
        yield name, str(one.get("about", "")) if isinstance(one, dict) else ""
    for law in document.get("laws", {}).values():
        yield from ((f"law.{name}", "") for name in law if isinstance(law, dict))
    for part in ("elements", "nodes", "signals"):
        for name, table in document.get(part, {}).items():
            yield from ((f"{part}.{name}.{key}", "") for key in table if isinstance(table, dict))
