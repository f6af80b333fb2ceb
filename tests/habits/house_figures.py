"""Figures of the source tree, to compare before and after a redesign.

Run `python tests/habits/house_figures.py [--list NAME]`: lines of source by room, modules that only one sibling imports,
private functions called once, public classes that share a name, imports inside functions, import cycles, and `Any` in
public signatures. `--list` prints the members of one figure.
"""

from __future__ import annotations

import argparse
import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
SOURCES = {"mckibben": ROOT / "src" / "mckibben"}
SOURCES |= {folder.name: folder for folder in sorted(ROOT.glob("packages/*/src/*")) if folder.is_dir()}
Function = ast.FunctionDef | ast.AsyncFunctionDef


class Import(NamedTuple):
    """One import of a module of this repository by another."""

    importer: str
    imported: str
    deferred: bool  # inside a function
    line: int


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
            house.trees[module] = ast.parse(path.read_text(encoding="utf-8"))
            house.paths[module] = path
        return house

    @cached_property
    def imports(self) -> list[Import]:
        """Every import between modules of the package, those for type checking left out."""
        return [
            Import(module, target, deferred, line)
            for module, tree in self.trees.items()
            for target, deferred, line in self._targets(module, tree)
            if target != module
        ]

    def _targets(self, module: str, tree: ast.Module) -> Iterator[tuple[str, bool, int]]:
        is_package = self.paths[module].name == "__init__.py"

        def visit(node: ast.AST, deferred: bool) -> Iterator[tuple[str, bool, int]]:
            for child in ast.iter_child_nodes(node):
                if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test):
                    continue
                if isinstance(child, ast.Import):
                    yield from ((a.name, deferred, child.lineno) for a in child.names if a.name in self.trees)
                elif isinstance(child, ast.ImportFrom):
                    base = self._base(module, child, is_package)
                    for alias in child.names:
                        target = f"{base}.{alias.name}" if f"{base}.{alias.name}" in self.trees else base
                        if target in self.trees:
                            yield target, deferred, child.lineno
                else:
                    yield from visit(child, deferred or isinstance(child, Function))

        return visit(tree, False)

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
        for module, path in self.paths.items():
            parts = module.split(".")
            room = parts[1] if len(parts) > 1 and (self.folder / parts[1]).is_dir() else "(top)"
            lines[room] += len(path.read_text(encoding="utf-8").splitlines())
        return dict(lines.most_common())

    def modules_of_one_sibling(self) -> list[str]:
        """Modules that a single module imports, which lies in the same folder."""
        importers = defaultdict(set)
        for i in self.imports:
            importers[i.imported].add(i.importer)
        return sorted(
            f"{module} <- {who}"
            for module, (who, *others) in importers.items()
            if not others and module.rpartition(".")[0] == who.rpartition(".")[0]
        )

    def functions_called_once(self) -> list[str]:
        """Private functions of a module that are named once beside their definition."""
        once = []
        for module, tree in self.trees.items():
            names = Counter(n.id for n in ast.walk(tree) if isinstance(n, ast.Name))
            names += Counter(n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute))
            once += [
                f"{module}.{n.name}"
                for n in ast.walk(tree)
                if isinstance(n, Function)
                and n.name.startswith("_")
                and not n.name.endswith("__")
                and names[n.name] == 1
            ]
        return once

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

    def cycles(self) -> list[str]:
        """Groups of modules that import each other, deferred imports counted, as one line each."""
        graph: dict[str, set[str]] = {module: set() for module in self.trees}
        for i in self.imports:
            graph[i.importer].add(i.imported)
        return [" ".join(sorted(group)) for group in strong_components(graph) if len(group) > 1]

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


FIGURES = {
    "modules-of-one-sibling": House.modules_of_one_sibling,
    "functions-called-once": House.functions_called_once,
    "shared-class-names": House.shared_class_names,
    "deferred-imports": House.deferred_imports,
    "cycles": House.cycles,
    "any-in-public-signatures": House.any_in_public_signatures,
}


def main() -> None:
    """Print the figures of every distribution of the repository."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", choices=FIGURES, help="print the members of one figure")
    chosen = parser.parse_args().list
    for name, folder in SOURCES.items():
        house = House.read(name, folder)
        if chosen:
            print(*FIGURES[chosen](house), sep="\n")
            continue
        rooms = house.lines_by_room()
        print(f"{name}: {sum(rooms.values())} lines in {len(house.trees)} modules")
        print("  " + ", ".join(f"{room} {lines}" for room, lines in rooms.items()))
        for figure, members in FIGURES.items():
            print(f"  {figure:26s} {len(members(house))}")
        groups = house.cycles()
        print(f"  modules in cycles          {sum(len(g.split()) for g in groups)}")


if __name__ == "__main__":
    main()
