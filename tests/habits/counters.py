"""Counters of the house: how large it is, how it is cut, and who imports whom; to compare before and after a change.

    python tests/habits/counters.py [--json]       the counters
    python tests/habits/counters.py --list NAME    the members of one list, such as one-call-helpers

Lines are lines of Python files. `test_house.py` keeps them from growing.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import re
import tokenize
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
SOURCES = {"mckibben": ROOT / "src" / "mckibben"}
SOURCES |= {folder.name: folder for folder in sorted(ROOT.glob("packages/*/src/*")) if folder.is_dir()}
Function = ast.FunctionDef | ast.AsyncFunctionDef
SMALL = 6  # lines below which the body of a helper that is called once says what its line says
REGISTRY = "mckibben.accessors"  # what rooms above carry out: the one table that may name them
NAMED = re.compile(r"[a-z_][\w.]*:\w+")  # "module:name" in a text
TOLD_TO_TOOLS = re.compile(r"#\s*(noqa|type:|fmt:|pragma|ruff|mypy|!)")


class Import(NamedTuple):
    """One import of a module of this repository by another."""

    importer: str
    imported: str
    deferred: bool  # inside a function
    line: int
    typing: bool = False  # for type checkers alone


@cache
def parsed(path: Path) -> ast.Module:
    """The syntax tree of a file, parsed once; nobody changes it."""
    return ast.parse(path.read_text(encoding="utf-8"))


@dataclass(frozen=True)
class House:
    """The parsed modules of one distribution.

    Args:
        name: of the top-level package.
        folder: that holds it.
    """

    name: str
    folder: Path
    trees: dict[str, ast.Module] = field(default_factory=dict)
    paths: dict[str, Path] = field(default_factory=dict)

    @classmethod
    def read(cls, name: str, folder: Path) -> House:
        """Parse every module below a folder."""
        house = cls(name, folder)
        for path in sorted(folder.rglob("*.py")):
            parts = [name, *path.relative_to(folder).with_suffix("").parts]
            module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            house.trees[module] = parsed(path)
            house.paths[module] = path
        return house

    @cached_property
    def imports(self) -> list[Import]:
        """Every import between modules of the package."""
        return [i for module, tree in self.trees.items() for i in self._targets(module, tree) if i.imported != module]

    def _targets(self, module: str, tree: ast.Module) -> Iterator[Import]:
        is_package = self.paths[module].name == "__init__.py"

        def visit(node: ast.AST, deferred: bool, typing: bool) -> Iterator[Import]:
            for child in ast.iter_child_nodes(node):
                if isinstance(child, ast.Import):
                    for alias in child.names:
                        if alias.name in self.trees:
                            yield Import(module, alias.name, deferred, child.lineno, typing)
                elif isinstance(child, ast.ImportFrom):
                    base = self._base(module, child, is_package)
                    for alias in child.names:
                        target = f"{base}.{alias.name}" if f"{base}.{alias.name}" in self.trees else base
                        if target in self.trees:
                            yield Import(module, target, deferred, child.lineno, typing)
                else:
                    checked = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test)
                    yield from visit(child, deferred or isinstance(child, Function), typing or checked)

        return visit(tree, False, False)

    @cached_property
    def named_modules(self) -> list[Import]:
        """Every module that another names in a text, as ``"module:name"``; the table of public names of the root is none."""
        found = []
        for module, nodes in self.nodes.items():
            for node in nodes if module != self.name else ():
                if isinstance(node, ast.Constant) and isinstance(node.value, str) and NAMED.fullmatch(node.value):
                    place = node.value.partition(":")[0]
                    targets = (f"{self.name}.{place}", f"{module.rpartition('.')[0]}.{place}")
                    found += [Import(module, t, True, node.lineno) for t in targets if t in self.trees and t != module][
                        :1
                    ]
        return found

    @cached_property
    def functions(self) -> list[tuple[str, Function]]:
        """Every function and method, with its module."""
        return [(m, n) for m, nodes in self.nodes.items() for n in nodes if isinstance(n, Function)]

    @cached_property
    def nodes(self) -> dict[str, list[ast.AST]]:
        """All nodes of each module."""
        return {module: list(ast.walk(tree)) for module, tree in self.trees.items()}

    @cached_property
    def texts(self) -> dict[str, str]:
        """The source of each module."""
        return {module: path.read_text(encoding="utf-8") for module, path in self.paths.items()}

    @cached_property
    def comments(self) -> list[tuple[str, bool]]:
        """Every comment, and whether it has its line alone."""
        read = (tokenize.generate_tokens(io.StringIO(text).readline) for text in self.texts.values())
        return [
            (t.string, t.line.lstrip().startswith("#")) for tokens in read for t in tokens if t.type == tokenize.COMMENT
        ]

    @staticmethod
    def _base(module: str, node: ast.ImportFrom, is_package: bool) -> str:
        if not node.level:
            return node.module or ""
        parts = module.split(".")
        parts = parts[: len(parts) - node.level + is_package]
        return ".".join([*parts, node.module] if node.module else parts)

    def lines_by_room(self) -> dict[str, int]:
        """Lines of each subpackage, the modules beside them together."""
        lines: Counter[str] = Counter()
        for module in self.paths:
            parts = module.split(".")
            room = parts[1] if len(parts) > 1 and (self.folder / parts[1]).is_dir() else "(top)"
            lines[room] += len(self.texts[module].splitlines())
        return dict(lines.most_common())

    def modules_of_one_sibling(self) -> list[str]:
        """Modules that a single module imports, which lies in the same folder."""
        importers = defaultdict(set)
        for i in self.imports:
            if not i.typing:
                importers[i.imported].add(i.importer)
        return sorted(
            f"{module} <- {who}"
            for module, (who, *others) in importers.items()
            if not others and module.rpartition(".")[0] == who.rpartition(".")[0]
        )

    def functions_called_once(self) -> list[str]:
        """Private functions of a module that are named once beside their definition."""
        once = []
        for module, nodes in self.nodes.items():
            names = Counter(n.id for n in nodes if isinstance(n, ast.Name))
            names += Counter(n.attr for n in nodes if isinstance(n, ast.Attribute))
            once += [
                f"{module}.{n.name}"
                for n in nodes
                if isinstance(n, Function)
                and n.name.startswith("_")
                and not n.name.endswith("__")
                and names[n.name] == 1
            ]
        return once

    def one_call_helpers(self) -> list[str]:
        """Those of them whose body is shorter than `SMALL` lines, with the lines that each takes."""
        once = set(self.functions_called_once())
        return sorted(
            f"{module}.{node.name} {lines_of_body(node)}"
            for module, node in self.functions
            if f"{module}.{node.name}" in once and lines_of_body(node) < SMALL and not node.decorator_list
        )

    def shared_class_names(self) -> list[str]:
        """Public classes whose name another public class has."""
        owners = defaultdict(list)
        for module, tree in self.trees.items():
            for node in tree.body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    owners[node.name].append(f"{module}.{node.name}")
        return sorted(name for names in owners.values() if len(names) > 1 for name in names)

    def deferred_imports(self) -> list[str]:
        """Imports of own modules inside functions."""
        return [f"{i.importer}:{i.line} -> {i.imported}" for i in self.imports if i.deferred]

    def circles(self) -> list[str]:
        """Groups of modules that lead to each other by imports, deferred, for type checkers or in a text; one a line."""
        graph: dict[str, set[str]] = {module: set() for module in self.trees}
        for i in [*self.imports, *self.named_modules]:
            if i.importer != REGISTRY:
                graph[i.importer].add(i.imported)
        groups = [sorted(group) for group in strong_components(graph) if len(group) > 1]
        return [" ".join(group) for group in sorted(groups, key=len, reverse=True)]

    def any_in_public_signatures(self) -> list[str]:
        """Parameters and results annotated with `Any` of functions and methods without an underscore."""
        places = []
        for module, tree in self.trees.items():
            owners: list[tuple[str, list[ast.stmt]]] = [("", tree.body)]
            owners += [
                (f"{c.name}.", c.body) for c in tree.body if isinstance(c, ast.ClassDef) and not c.name.startswith("_")
            ]
            for owner, body in owners:
                for node in body:
                    if not isinstance(node, Function) or node.name.startswith("_"):
                        continue
                    arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                    annotations = [a.annotation for a in arguments] + [node.returns]
                    annotations += [a.annotation for a in (node.args.vararg, node.args.kwarg) if a is not None]
                    if any(isinstance(n, ast.Name) and n.id == "Any" for a in annotations if a for n in ast.walk(a)):
                        places.append(f"{module}.{owner}{node.name}")
        return places


def strong_components(graph: dict[str, set[str]]) -> list[list[str]]:
    """Tarjan's strongly connected components of a directed graph."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    components: list[list[str]] = []

    def connect(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for neighbour in graph[node]:
            if neighbour not in index:
                connect(neighbour)
                low[node] = min(low[node], low[neighbour])
            elif neighbour in stack:
                low[node] = min(low[node], index[neighbour])
        if low[node] == index[node]:
            cut = stack.index(node)
            components.append(stack[cut:])
            del stack[cut:]

    for node in graph:
        if node not in index:
            connect(node)
    return components


def lines_of_body(node: Function) -> int:
    """Lines of a function below its signature and docstring."""
    body = node.body[1:] if ast.get_docstring(node) is not None else node.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


def arguments(node: Function) -> list[ast.expr]:
    """Annotations of the arguments of a function."""
    every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs, node.args.vararg, node.args.kwarg]
    return [a.annotation for a in every if a is not None and a.annotation is not None]


def size(*folders: Path) -> tuple[int, int]:
    """Lines and number of the files of Python below folders, without tests and emulators of boards, wherever they lie."""
    left_out = {"tests", "firmware"}
    paths = [
        path
        for folder in folders
        for path in folder.rglob("*.py")
        if left_out.isdisjoint(path.relative_to(folder).parts)
    ]
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths), len(paths)


LISTS = {
    "modules-of-one-sibling": House.modules_of_one_sibling,
    "functions-called-once": House.functions_called_once,
    "one-call-helpers": House.one_call_helpers,
    "shared-class-names": House.shared_class_names,
    "deferred-imports": House.deferred_imports,
    "circles": House.circles,
    "any-in-public-signatures": House.any_in_public_signatures,
}


def counters() -> dict[str, float | str]:
    """The counters by name; those of one distribution are of mckibben."""
    house = House.read("mckibben", SOURCES["mckibben"])
    every, own = size(ROOT / "src", ROOT / "packages"), size(house.folder)
    annotated = [a for _, node in house.functions for a in arguments(node)]
    unsure = [a for a in annotated if any(isinstance(n, ast.Name) and n.id == "Any" for n in ast.walk(a))]
    run = [i for i in house.imports if not i.typing]
    said = [alone for text, alone in house.comments if not TOLD_TO_TOOLS.match(text)]
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    circles = [len(group.split()) for group in house.circles()]
    helpers = house.one_call_helpers()
    return {
        "lines of src and packages": every[0],
        "files of src and packages": every[1],
        "lines of src/mckibben": own[0],
        "files of src/mckibben": own[1],
        "functions per 1,000 lines": round(1e3 * len(house.functions) / own[0], 1),
        "lines of a mean body": round(sum(lines_of_body(n) for _, n in house.functions) / len(house.functions), 2),
        "lines that are comments [%]": round(1e2 * sum(said) / own[0], 2),
        "lines with a comment behind code [%]": round(1e2 * (len(said) - sum(said)) / own[0], 2),
        "arguments with Any [%]": round(1e2 * len(unsure) / len(annotated), 1),
        "deferred imports [%]": round(1e2 * sum(i.deferred for i in run) / len(run), 1),
        "deferred imports": sum(i.deferred for i in run),
        "modules named in a text": len(house.named_modules),
        "opt-outs of the formatter": sum(bool(re.match(r"#\s*fmt:\s*(skip|off)", text)) for text, _ in house.comments),
        "circles": len(circles),
        "files of the largest circle": max(circles, default=0),
        "files in circles": sum(circles),
        "circles of 2 to 5 files": sum(n <= 5 for n in circles),
        "exemptions of the import contract": len({i for c in contracts for i in c.get("ignore_imports", ())}),
        "private functions called once": len(house.functions_called_once()),
        "of these with a body below 6 lines": len(helpers),
    }


def main() -> None:
    """Print the counters, or the members of a list for every distribution of the repository."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print the counters as one JSON object")
    parser.add_argument("--list", choices=LISTS, help="print the members of one list")
    options = parser.parse_args()
    if options.list:
        for name, folder in SOURCES.items():
            print(*LISTS[options.list](House.read(name, folder)), sep="\n")
        return
    found = counters()
    if options.json:
        print(json.dumps(found, indent=1))
        return
    for name, value in found.items():
        print(f"{name:38s} {value:>10,}")
    for name, folder in SOURCES.items():
        rooms = House.read(name, folder).lines_by_room()
        print(f"{name}: " + ", ".join(f"{room} {lines}" for room, lines in rooms.items()))


if __name__ == "__main__":
    main()
