"""Where the parts of a circuit stand and how the lines between them run, for any topology.

Nodes and elements stand in columns: supplies first, each element right of the nodes that feed it, loops cut where they
close. Every branch has its row. An element keeps free the cells of its row as far as its lines reach, so that lines along
rows meet no symbol; lines along columns run between the columns, each node's on a track of its own. The air outside is no
place of its own: each port that leads to it ends in its own triangle. All lengths are points.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from .circuit_cells import Cell
from .circuit_symbols import Box, Point

GAP, CHANNEL, TRACK = 16.0, 18.0, 11.0


class Wiring(NamedTuple):
    """A circuit as the layout sees it, without the air outside: the nodes left and right of each element."""

    order: tuple[str, ...]  # of the nodes, supplies first
    left: dict[str, tuple[str, ...]]
    right: dict[str, tuple[str, ...]]

    def leaving(self, node: str) -> list[str]:
        """Elements right of a node, those that lead on before those that only vent."""
        found = [e for e, ends in self.left.items() if node in ends]
        return sorted(found, key=lambda e: not self.right[e])

    def arriving(self, node: str) -> list[str]:
        """Elements left of a node."""
        return [e for e, ends in self.right.items() if node in ends]


def wiring(
    supplies: Sequence[str], nodes: Sequence[str], ends: Mapping[str, tuple[str, ...]], starts: set[str]
) -> Wiring:
    """Order the nodes by their distance from a supply, and turn every element from the earlier to the later.

    Args:
        supplies: nodes of given pressure.
        nodes: all nodes but the air outside.
        ends: the nodes at each element's ports.
        starts: elements that feed a node from the air outside.
    """
    fed = [end for e in ends if e in starts for end in ends[e]]
    order: dict[str, None] = {}
    queue = deque(supplies)
    waiting = deque(dict.fromkeys([*fed, *nodes]))
    while queue or waiting:
        node = queue.popleft() if queue else waiting.popleft()
        if node in order:
            continue
        order[node] = None
        queue.extend(end for found in ends.values() if node in found for end in found if end not in order)
    rank = {name: i for i, name in enumerate(order)}
    left, right = {}, {}
    for name, found in ends.items():
        sources = [n for n in found if n in supplies]
        if not sources and found and not (name in starts and len(set(found)) == 1):
            sources = [min(found, key=rank.__getitem__)]
        left[name] = tuple(dict.fromkeys(sources))
        right[name] = tuple(n for n in dict.fromkeys(found) if n not in sources)
    # Supplies are in order from the start, so that whatever they feed comes after all of them.
    return Wiring(tuple([*supplies, *(n for n in order if n not in supplies)]), left, right)


def columns(wires: Wiring) -> dict[tuple[str, str], int]:
    """The column of each node ("node", name) and element ("element", name): one after the last that feeds it."""
    found: dict[tuple[str, str], int] = {}
    for node in wires.order:
        before = [max((found["node", n] for n in wires.left[e]), default=-2) + 1 for e in wires.arriving(node)]
        found["node", node] = max(before, default=-1) + 1
    for e, ends in wires.left.items():
        feeds = [found["node", n] for n in wires.right[e]]
        found["element", e] = max(found["node", n] for n in ends) + 1 if ends else min(feeds, default=1) - 1
    first = min(found.values(), default=0)
    return {key: at - first for key, at in found.items()}


class _Board:
    """Which cells of the grid are taken, and by which node's line the ends of rows may be met."""

    def __init__(self, wires: Wiring, column: Mapping[tuple[str, str], int], cells: Mapping[tuple[str, str], Cell]):
        self.wires, self.column, self.cells = wires, column, cells
        self.rows: dict[tuple[str, str], int] = {}
        self.taken: set[tuple[int, int]] = set()
        self.nodes: dict[tuple[int, int], str] = {}
        self.claims: dict[tuple[int, int, int], str] = {}  # column, row and the side the line comes from

    def put(self, kind: str, name: str, hint: int) -> int:
        row = hint
        while not (self._node_fits(name, row) if kind == "node" else self._element_fits(name, row)):
            row += 1
        self.rows[kind, name] = row
        if kind == "node":
            self.nodes[self.column[kind, name], row] = name
            return row
        body, claims = self._reach(name, row)
        self.taken |= body
        self.claims |= claims
        return row

    def _node_fits(self, name: str, row: int) -> bool:
        at = self.column["node", name], row
        free = at not in self.taken and at not in self.nodes
        return free and all(self.claims.get((*at, side), name) == name for side in (-1, 1))

    def _element_fits(self, name: str, row: int) -> bool:
        body, claims = self._reach(name, row)
        for at in body:
            if at in self.taken or at in self.nodes or any((*at, side) in self.claims for side in (-1, 1)):
                return False
        return all((c, r) not in self.taken and self.nodes.get((c, r), net) == net for (c, r, _), net in claims.items())

    def _reach(self, name: str, row: int) -> tuple[set[tuple[int, int]], dict[tuple[int, int, int], str]]:
        """The cells that an element keeps free, and the nodes that may stand at the two ends of its row."""
        at = self.column["element", name]
        start, end = at, at
        claims = {}
        for side, nets in ((-1, self.wires.left[name]), (1, self.wires.right[name])):
            if not nets:
                continue
            far = (min if side < 0 else max)(self.column["node", n] for n in nets)
            start, end = (far + 1, end) if side < 0 else (start, far - 1)
            straight = [p.node for p in self.cells["element", name].ports if p.side == side and p.route[-1][1] == 0.0]
            main = straight[0] if straight and self.column["node", straight[0]] == far else ""
            claims[far, row, -side] = main
        return {(c, row) for c in range(start, end + 1)}, claims


def rows(
    wires: Wiring, column: Mapping[tuple[str, str], int], cells: Mapping[tuple[str, str], Cell]
) -> dict[tuple[str, str], int]:
    """The row of each node and element: a branch goes straight on, further branches go below."""
    board = _Board(wires, column, cells)
    roots = [("element", e) for e, ends in wires.left.items() if not ends] + [("node", n) for n in wires.order]
    for root in roots:
        stack = [(*root, 0)]
        while stack:
            kind, name, hint = stack.pop()
            if (kind, name) in board.rows:
                continue
            row = board.put(kind, name, hint)
            following = wires.leaving(name) if kind == "node" else wires.right[name]
            other = "element" if kind == "node" else "node"
            stack += [(other, found, row) for found in reversed(following)]
    used = {row: i for i, row in enumerate(sorted(set(board.rows.values())))}
    return {key: used[row] for key, row in board.rows.items()}


# ---- from the grid to points


class Net(NamedTuple):
    """The lines that a node's pressure fills, and the dots where three or more of them meet."""

    lines: tuple[tuple[Point, ...], ...]
    dots: tuple[Point, ...]


class Grid(NamedTuple):
    """Where every cell's origin lies, the lines of every node, and the rectangle around all."""

    at: dict[tuple[str, str], Point]
    nets: dict[str, Net]
    box: Box


class _Bus(NamedTuple):
    """The ends that a node's line along one column joins, and its own height."""

    node: str
    side: int
    ends: tuple[tuple[str, int], ...]  # element and port
    low: float
    high: float


def arrange(wires: Wiring, cells: Mapping[tuple[str, str], Cell]) -> Grid:
    """Place all cells and run all lines."""
    column = columns(wires)
    row = rows(wires, column, cells)
    y = _heights(row, cells)
    buses = _buses(wires, cells, {key: y[r] for key, r in row.items()})
    tracks = _tracks(buses, column)
    x, channels = _widths(column, cells, tracks)
    at = {key: (x[column[key]], y[row[key]]) for key in row}
    nets: dict[str, Net] = {}
    for node in wires.order:
        lines: list[tuple[Point, ...]] = []
        dots: list[Point] = []
        for bus in (b for b in buses if b.node == node):
            channel = column["node", node] + (0 if bus.side > 0 else -1)
            track = tracks.get((node, bus.side))
            place = None if track is None else channels[channel] + TRACK * track[0]
            _run(bus, at, cells, place, lines, dots)
        nets[node] = Net(tuple(lines), tuple(dots))
    low, high = min(y.values()) - _most(cells, row, max(row.values()), -1), _most(cells, row, 0, 1)
    right = max(x[column[key]] + cells[key].box.x1 for key in column)
    return Grid(at, nets, Box(0.0, low, right, y[0] + high))


def _most(cells: Mapping[tuple[str, str], Cell], row: Mapping[tuple[str, str], int], which: int, sign: int) -> float:
    """How far the cells of a row reach up (1) or down (-1) from its line."""
    found = [cells[key].box for key, r in row.items() if r == which]
    return max(b.y1 if sign > 0 else -b.y0 for b in found)


def _heights(row: Mapping[tuple[str, str], int], cells: Mapping[tuple[str, str], Cell]) -> dict[int, float]:
    """The height of each row's line, the first at 0."""
    found = {0: 0.0}
    for r in range(1, max(row.values()) + 1):
        found[r] = found[r - 1] - _most(cells, row, r - 1, -1) - GAP - _most(cells, row, r, 1)
    return found


def _buses(wires: Wiring, cells: Mapping[tuple[str, str], Cell], height: Mapping[tuple[str, str], float]) -> list[_Bus]:
    found = []
    for node in wires.order:
        for side, elements in ((-1, wires.arriving(node)), (1, wires.leaving(node))):
            ends, ys = [], [height["node", node]]
            for e in elements:
                for i, port in enumerate(cells["element", e].ports):
                    if port.node == node and port.side == -side:
                        ends.append((e, i))
                        ys.append(height["element", e] + port.route[-1][1])
            if ends:
                found.append(_Bus(node, side, tuple(ends), min(ys), max(ys)))
    return found


def _tracks(buses: Sequence[_Bus], column: Mapping[tuple[str, str], int]) -> dict[tuple[str, int], tuple[int, int]]:
    """The track of each line along a column and the channel it lies in, none for a line that runs straight on."""
    found: dict[tuple[str, int], tuple[int, int]] = {}
    used: dict[int, list[list[_Bus]]] = {}
    for bus in sorted(buses, key=lambda b: (b.low - b.high, b.node, b.side)):
        if bus.high - bus.low < 1e-6:
            continue
        channel = column["node", bus.node] + (0 if bus.side > 0 else -1)
        lanes = used.setdefault(channel, [])
        fits = [all(bus.low > b.high + 4.0 or b.low > bus.high + 4.0 for b in lane) for lane in lanes]
        if True not in fits:
            lanes.append([])
            fits.append(True)
        lanes[fits.index(True)].append(bus)
        found[bus.node, bus.side] = fits.index(True), channel
    return found


def _widths(
    column: Mapping[tuple[str, str], int],
    cells: Mapping[tuple[str, str], Cell],
    tracks: Mapping[tuple[str, int], tuple[int, int]],
) -> tuple[dict[int, float], dict[int, float]]:
    """The place of each column's origin, and of the first track right of it."""
    x: dict[int, float] = {}
    channels: dict[int, float] = {}
    at = 0.0
    for c in range(max(column.values()) + 1):
        boxes = [cells[key].box for key, found in column.items() if found == c]
        x[c] = at - min((b.x0 for b in boxes), default=0.0)
        at = x[c] + max((b.x1 for b in boxes), default=0.0)
        lanes = 1 + max((t for t, channel in tracks.values() if channel == c), default=-1)
        channels[c] = at + CHANNEL / 2.0
        at += CHANNEL + TRACK * max(lanes - 1, 0)
    return x, channels


def _run(
    bus: _Bus,
    at: Mapping[tuple[str, str], Point],
    cells: Mapping[tuple[str, str], Cell],
    place: float | None,
    lines: list[tuple[Point, ...]],
    dots: list[Point],
) -> None:
    """Add the lines of one side of a node: from each port to the line along the column, and from there to the node."""
    x, y = at["node", bus.node]
    meets: dict[float, int] = {}
    for e, i in bus.ends:
        ex, ey = at["element", e]
        route = [(ex + a, ey + b) for a, b in cells["element", e].ports[i].route]
        end = x if place is None else place
        lines.append((*route, (end, route[-1][1])))
        meets[route[-1][1]] = meets.get(route[-1][1], 0) + 1
    if place is None:
        return
    lines += [((x, y), (place, y)), ((place, bus.low), (place, bus.high))]
    meets[y] = meets.get(y, 0) + 1
    for height, count in meets.items():
        if count + (height > bus.low) + (height < bus.high) > 2:
            dots.append((place, height))
