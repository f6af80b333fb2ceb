"""Layout of circuit diagrams: symbols with labels, commands, vents to free air, and connecting lines on a grid."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from ...components.flow import FlowElement
from ...pneumatics.volume import FixedVolume, MovingVolume, Reservoir
from .circuit_labels import Text, Words, braid_angle, stacked, width
from .circuit_symbols import (
    SYMBOLS,
    THIN,
    Box,
    Point,
    Stroke,
    Symbol,
    around,
    exhaust,
    line,
    muscle,
    plain_box,
    roles,
    shape,
    source,
    tank,
)
from .style import COLOURS, INK, INK_3, SMALL

if TYPE_CHECKING:
    pass

DASH = (3.0, 2.2)
NEAR = 4.0  # between a symbol and its label


class Route(NamedTuple):
    """The line of a port: the node it leads to, the side on which it leaves, and its points."""

    node: str
    side: int
    route: tuple[Point, ...]


class SymbolCell(NamedTuple):
    """A symbol in one cell of the grid, around the origin on its line [pt]."""

    marks: tuple[Stroke, ...]
    symbol: Box
    triangles: tuple[Box, ...]
    texts: tuple[Text, ...]
    ports: tuple[Route, ...]

    @property
    def box(self) -> Box:
        """Bounding rectangle."""
        lines = [Box(x, y, x, y) for port in self.ports for x, y in port.route]
        return around([self.symbol, *self.triangles, *(t.box for t in self.texts), *lines])


def symbol_of(element: FlowElement, driven: bool) -> tuple[Symbol, str]:
    """Symbol of an element, and the name to write into it if it has no symbol of its own."""
    ports = element.ports
    if element.symbol in SYMBOLS and _suits(element.symbol, ports):
        return SYMBOLS[element.symbol](ports, driven), ""
    name = type(element).__name__
    return plain_box(name, width(name, SMALL, False))(ports, driven), name


def _suits(symbol: str, ports: Sequence[str]) -> bool:
    role = roles(ports)
    if symbol in ("on_off_valve", "proportional_valve"):
        return role.count("in") == 1 and 1 <= role.count("out") <= 2 and role.count("exhaust") <= 2
    if symbol in ("regulator", "quick_exhaust"):
        return len(set(role)) == len(role)
    return len(ports) == 2


def node_cell(node: object, words: list[Words], *, leads_on: bool) -> SymbolCell:
    """Cell of a node, its dot or the tip of its triangle at the origin."""
    if isinstance(node, Reservoir):
        symbol = source()
        texts = stacked(words, -10.5, symbol.box.y0 - NEAR, "center")
        marks = list(symbol.marks)
        if node.signal is not None:
            marks, texts = _command(marks, texts, node.signal, (-16.0, 8.4), COLOURS["pressure"])
        return SymbolCell(tuple(marks), symbol.box, (), tuple(texts), ())
    if isinstance(node, MovingVolume):
        symbol = muscle(braid_angle(node), hanging=leads_on)
        middle = (symbol.top[0] + (8.0 if leads_on else 12.0)) / 2.0
        texts = stacked(words, middle, symbol.box.y0 - NEAR, "center")
        marks = list(symbol.marks)
        if node.signal is not None:
            x, y = symbol.top
            marks.append(line((x, y), (x + 16.0, y), width=THIN, dash=DASH, colour=COLOURS["length"]))
            label = Words(node.signal, SMALL, False, COLOURS["length"])
            texts += stacked([label], x + 19.0, y + 0.62 * SMALL, "left")
        return SymbolCell(tuple(marks), symbol.box, (), tuple(texts), ())
    symbol = tank(float(node.size)) if isinstance(node, FixedVolume) else tank(1e-5)
    high = 1.3 * sum(w.size for w in words)
    top = max((symbol.box.y0 - 10.0 + high) / 2.0, symbol.box.y0 + high)
    texts = stacked(words, 14.0, min(top, -7.0), "left")
    return SymbolCell(symbol.marks, symbol.box, (), tuple(texts), ())


def element_cell(
    element: FlowElement, words: list[Words], ends: Sequence[str], sides: Sequence[int], command: str | None
) -> SymbolCell:
    """Cell of an element.

    Args:
        element: the part.
        words: label of the symbol.
        ends: the nodes at its ports.
        sides: sides of the diagram on which they stand, -1 left, 1 right, 0 for the air outside.
        command: the signal that drives it.
    """
    symbol, inside = symbol_of(element, command is not None)
    if sum(p.side * s for p, s in zip(symbol.ports, sides, strict=True)) < 0:
        symbol = symbol.mirrored()
    ports, low = _routes(symbol, ends, sides)
    marks = list(symbol.marks)
    free = [i for i, s in enumerate(sides) if s == 0]
    inward = {i for i in free if type(element).__name__ == "Compressor" and all(i == a for a, _ in element.paths)}
    triangles, texts = _outside(symbol, free, inward, ends, low, marks)
    taken = [*triangles, *(t.box for t in texts), *(_along(p.route) for p in ports if len(p.route) > 1)]
    label = stacked(words, 0.0, symbol.box.y0 - NEAR, "center")
    if any(t.box.overlaps(b, by=-3.0) for t in label for b in taken):
        label = stacked(words, 0.0, min(b.y0 for b in [*taken, symbol.box]) - NEAR, "center")
    texts += label
    if inside:
        texts += stacked([Words(inside, SMALL, False, INK)], 0.0, 0.62 * SMALL, "center")
    if command is not None:
        marks, texts = _command(marks, texts, command, symbol.top, COLOURS["valve"])
    return SymbolCell(tuple(marks), symbol.box, tuple(triangles), tuple(texts), tuple(ports))


def _along(points: Sequence[Point]) -> Box:
    return around([Box(x - 1.0, y - 1.0, x + 1.0, y + 1.0) for x, y in points])


def _routes(symbol: Symbol, ends: Sequence[str], sides: Sequence[int]) -> tuple[list[Route], float]:
    """Lines from the ports to their sides, around the symbol if necessary; and their lowest point."""
    routes, low, turned = [], symbol.box.y0, 0
    for port, end, side in zip(symbol.ports, ends, sides, strict=True):
        if side == 0:
            continue
        points: tuple[Point, ...] = ((port.x, port.y),)
        if side != port.side:
            turned += 1
            low -= 7.0
            out = port.x + port.side * (1.0 + 4.0 * turned)
            far = symbol.box.x1 + 2.0 if side > 0 else symbol.box.x0 - 2.0
            points = (*points, (out, port.y), (out, low), (far, low))
        routes.append(Route(end, side, points))
    return routes, low


def _outside(
    symbol: Symbol, free: Sequence[int], inward: set[int], ends: Sequence[str], low: float, marks: list[Stroke]
) -> tuple[list[Box], list[Text]]:
    """Triangles of ports to free air, with names, beside the symbol and below its ports."""
    boxes: list[Box] = []
    texts: list[Text] = []
    for side in (-1, 1):
        open_ports = sorted((i for i in free if symbol.ports[i].side == side), key=lambda i: symbol.ports[i].y)
        lowest = min((p.y for p in symbol.ports if p.side == side), default=0.0)
        start = min(lowest - 9.0, low - 8.0 if low < symbol.box.y0 else 0.0)
        for k, i in enumerate(open_ports):
            port = symbol.ports[i]
            x = (max(port.x, symbol.box.x1) if side > 0 else min(port.x, symbol.box.x0)) + side * (10.0 + 15.0 * k)
            top = start
            marks.append(line((port.x, port.y), (x, port.y), (x, top)))
            marks += [shape((x - 6.0, top - 9.0), (x + 6.0, top - 9.0), (x, top))] if i in inward else exhaust(x, top)
            boxes.append(Box(x - 7.0, top - 10.0, x + 7.0, top))
        names = dict.fromkeys(ends[i] for i in open_ports)
        if open_ports:
            group = around(boxes[-len(open_ports) :])
            align, edge = ("right", group.x1) if side < 0 else ("left", group.x0)
            lines = [Words(name, SMALL, False, INK_3) for name in names]
            texts += stacked(lines, edge, group.y0 - 2.0, align)
    return boxes, texts


def _command(
    marks: list[Stroke], texts: list[Text], name: str, top: Point, colour: str
) -> tuple[list[Stroke], list[Text]]:
    """Add a dashed line up from a symbol to the name of its signal."""
    x, y = top
    dashed = line((x, y), (x, y + 15.0), width=THIN, dash=DASH, colour=colour)
    label = stacked([Words(name, SMALL, True, colour)], x, y + 16.0 + 1.25 * SMALL, "center")
    return [*marks, dashed], [*texts, *label]


GAP, CHANNEL, TRACK = 16.0, 18.0, 11.0


class DiagramWiring(NamedTuple):
    """A circuit for the layout, without atmosphere: the nodes left and right of each element."""

    order: tuple[str, ...]  # of the nodes, supplies first
    left: dict[str, tuple[str, ...]]
    right: dict[str, tuple[str, ...]]

    def leaving(self, node: str) -> list[str]:
        """Elements right of a node, continuing ones before those that only vent."""
        elements = [e for e, ends in self.left.items() if node in ends]
        return sorted(elements, key=lambda e: not self.right[e])

    def arriving(self, node: str) -> list[str]:
        """Elements left of a node."""
        return [e for e, ends in self.right.items() if node in ends]


def wiring(
    supplies: Sequence[str], nodes: Sequence[str], ends: Mapping[str, tuple[str, ...]], starts: set[str]
) -> DiagramWiring:
    """Order the nodes by their distance from a supply, and orient every element from the earlier to the later.

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
        queue.extend(end for ports in ends.values() if node in ports for end in ports if end not in order)
    rank = {name: i for i, name in enumerate(order)}
    left, right = {}, {}
    for name, ports in ends.items():
        sources = [n for n in ports if n in supplies]
        if not sources and ports and not (name in starts and len(set(ports)) == 1):
            sources = [min(ports, key=rank.__getitem__)]
        left[name] = tuple(dict.fromkeys(sources))
        right[name] = tuple(n for n in dict.fromkeys(ports) if n not in sources)
    # Supplies are in order from the start, so that whatever they feed comes after all of them.
    return DiagramWiring(tuple([*supplies, *(n for n in order if n not in supplies)]), left, right)


def columns(wires: DiagramWiring) -> dict[tuple[str, str], int]:
    """Column of each node ("node", name) and element ("element", name): one after the last that feeds it."""
    places: dict[tuple[str, str], int] = {}
    for node in wires.order:
        before = [max((places["node", n] for n in wires.left[e]), default=-2) + 1 for e in wires.arriving(node)]
        places["node", node] = max(before, default=-1) + 1
    for e, ends in wires.left.items():
        feeds = [places["node", n] for n in wires.right[e]]
        places["element", e] = max(places["node", n] for n in ends) + 1 if ends else min(feeds, default=1) - 1
    first = min(places.values(), default=0)
    return {key: at - first for key, at in places.items()}


class _Board:
    """Occupied cells of the grid, and the nodes whose lines may meet the ends of rows."""

    def __init__(
        self, wires: DiagramWiring, column: Mapping[tuple[str, str], int], cells: Mapping[tuple[str, str], SymbolCell]
    ):
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
        """Cells that an element keeps free, and the nodes that may be at the two ends of its row."""
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
    wires: DiagramWiring, column: Mapping[tuple[str, str], int], cells: Mapping[tuple[str, str], SymbolCell]
) -> dict[tuple[str, str], int]:
    """Row of each node and element: a branch continues straight, further branches go below."""
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
            stack += [(other, following_column, row) for following_column in reversed(following)]
    used = {row: i for i, row in enumerate(sorted(set(board.rows.values())))}
    return {key: used[row] for key, row in board.rows.items()}


# ---- from the grid to points


class Net(NamedTuple):
    """Lines of a node, and the dots where three or more of them meet."""

    lines: tuple[tuple[Point, ...], ...]
    dots: tuple[Point, ...]


class DiagramGrid(NamedTuple):
    """Origins of all cells, lines of all nodes, and the bounding rectangle."""

    at: dict[tuple[str, str], Point]
    nets: dict[str, Net]
    box: Box


class _Bus(NamedTuple):
    """Ends that a node's line along one column connects, and its own height."""

    node: str
    side: int
    ends: tuple[tuple[str, int], ...]  # element and port
    low: float
    high: float


def arrange(wires: DiagramWiring, cells: Mapping[tuple[str, str], SymbolCell]) -> DiagramGrid:
    """Place all cells and route all lines."""
    column = columns(wires)
    row = rows(wires, column, cells)
    y = {0: 0.0}
    for r in range(1, max(row.values()) + 1):
        y[r] = y[r - 1] - _most(cells, row, r - 1, -1) - GAP - _most(cells, row, r, 1)
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
    return DiagramGrid(at, nets, Box(0.0, low, right, y[0] + high))


def _most(
    cells: Mapping[tuple[str, str], SymbolCell], row: Mapping[tuple[str, str], int], which: int, sign: int
) -> float:
    boxes = [cells[key].box for key, r in row.items() if r == which]
    return max(b.y1 if sign > 0 else -b.y0 for b in boxes)


def _buses(
    wires: DiagramWiring, cells: Mapping[tuple[str, str], SymbolCell], height: Mapping[tuple[str, str], float]
) -> list[_Bus]:
    buses = []
    for node in wires.order:
        for side, elements in ((-1, wires.arriving(node)), (1, wires.leaving(node))):
            ends, ys = [], [height["node", node]]
            for e in elements:
                for i, port in enumerate(cells["element", e].ports):
                    if port.node == node and port.side == -side:
                        ends.append((e, i))
                        ys.append(height["element", e] + port.route[-1][1])
            if ends:
                buses.append(_Bus(node, side, tuple(ends), min(ys), max(ys)))
    return buses


def _tracks(buses: Sequence[_Bus], column: Mapping[tuple[str, str], int]) -> dict[tuple[str, int], tuple[int, int]]:
    """Track of each line along a column and the channel of the track, none for a straight line."""
    tracks: dict[tuple[str, int], tuple[int, int]] = {}
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
        tracks[bus.node, bus.side] = fits.index(True), channel
    return tracks


def _widths(
    column: Mapping[tuple[str, str], int],
    cells: Mapping[tuple[str, str], SymbolCell],
    tracks: Mapping[tuple[str, int], tuple[int, int]],
) -> tuple[dict[int, float], dict[int, float]]:
    x: dict[int, float] = {}
    channels: dict[int, float] = {}
    at = 0.0
    for c in range(max(column.values()) + 1):
        boxes = [cells[key].box for key, place in column.items() if place == c]
        x[c] = at - min((b.x0 for b in boxes), default=0.0)
        at = x[c] + max((b.x1 for b in boxes), default=0.0)
        lanes = 1 + max((t for t, channel in tracks.values() if channel == c), default=-1)
        channels[c] = at + CHANNEL / 2.0
        at += CHANNEL + TRACK * max(lanes - 1, 0)
    return x, channels


def _run(
    bus: _Bus,
    at: Mapping[tuple[str, str], Point],
    cells: Mapping[tuple[str, str], SymbolCell],
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
