"""The diagram of a pneumatic circuit: symbols of ISO 1219-1, lines, names, main values and pressures at the start.

Lines are ink; where pressures are given they take the colour of pressure, the stronger the higher. Commands are dashed.
Crossing lines join only where there is a dot. Symbols with their labels stand in the cells of a grid, a column further right
than what feeds them, branches below each other; the lines run in channels between the columns.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from ...errors import InputError
from ...pneumatics.circuit import Circuit
from ...pneumatics.volume import Reservoir
from . import style
from .circuit_cells import (
    SymbolCell,
    Text,
    Words,
    ambient,
    element_cell,
    element_words,
    is_atmosphere,
    node_cell,
    node_words,
    stacked,
)
from .circuit_symbols import Box, Point, Stroke
from .style import COLOURS, INK, LINE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


MARGIN = 18.0
TITLE = 12.0


class DiagramPlan(NamedTuple):
    """A diagram before drawing: all strokes, texts and lines [pt], and the occupied rectangles."""

    box: Box
    symbols: dict[str, Box]
    triangles: tuple[Box, ...]
    texts: tuple[Text, ...]
    marks: tuple[Stroke, ...]
    nets: dict[str, Net]


def plan(
    circuit: Circuit, *, pressures: Mapping[str, float] | None = None, subtitles: Mapping[str, str] | None = None
) -> DiagramPlan:
    """Lay a circuit out; arguments as for `draw`."""
    pressures, subtitles = pressures or {}, subtitles or {}
    _check(circuit, pressures, subtitles)
    wires = _wires(circuit)
    cells: dict[tuple[str, str], SymbolCell] = {}
    for name in wires.order:
        words = node_words(name, circuit, pressures, subtitles)
        cells["node", name] = node_cell(circuit.nodes[name], words, leads_on=bool(wires.leaving(name)))
    for name, (ends, command) in circuit.ends.items():
        sides = [-1 if n in wires.left[name] else 1 if n in wires.right[name] else 0 for n in ends]
        words = element_words(name, circuit, subtitles)
        cells["element", name] = element_cell(circuit.elements[name], words, ends, sides, command)
    grid = arrange(wires, cells)
    marks, texts, triangles, symbols = [], [], [], {}
    for key, cell in cells.items():
        x, y = grid.at[key]
        symbols[" ".join(key)] = cell.symbol.moved(x, y)
        marks += [m.placed(x, y) for m in cell.marks]
        texts += [t.moved(x, y) for t in cell.texts]
        triangles += [b.moved(x, y) for b in cell.triangles]
    return DiagramPlan(grid.box, symbols, tuple(triangles), tuple(texts), tuple(marks), grid.nets)


@style.styled()
def draw(
    circuit: Circuit,
    *,
    title: str = "",
    pressures: Mapping[str, float] | None = None,
    subtitles: Mapping[str, str] | None = None,
) -> Figure:
    """Draw a circuit of any topology: supplies left, flow to the right, branches below each other.

    Args:
        circuit: the network.
        title: stands over it.
        pressures: absolute pressures at the start by node [Pa], as `Circuit.initial` takes them; shown as gauge pressures.
        subtitles: by node or element, what stands below its name instead of its values.

    Raises:
        InputError: names a pressure or a subtitle of something that the circuit has not.
    """
    layout = plan(circuit, pressures=pressures, subtitles=subtitles)
    head = stacked([Words(title, TITLE, True, INK)], layout.box.x0, 0.0, "left") if title else []
    wide = max(layout.box.x1 - layout.box.x0, *(t.box.x1 - t.box.x0 for t in head), 60.0) + 2.0 * MARGIN
    above = 16.0 + TITLE if title else 0.0
    high = layout.box.y1 - layout.box.y0 + 2.0 * MARGIN + above
    fig = style.drawing(wide / 72.0, high / 72.0)
    ax = fig.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    left, bottom = layout.box.x0 - MARGIN, layout.box.y0 - MARGIN
    ax.set_xlim(left, left + wide)
    ax.set_ylim(bottom, bottom + high)
    strength = _strengths(circuit, pressures or {})
    for name, net in layout.nets.items():
        _draw_net(ax, net, strength.get(name))
    for mark in layout.marks:
        draw_mark(ax, mark)
    for text in [*layout.texts, *(t.moved(0.0, layout.box.y1 + above) for t in head)]:
        draw_text(ax, text)
    return fig


def _check(circuit: Circuit, pressures: Mapping[str, float], subtitles: Mapping[str, str]) -> None:
    for name in pressures:
        if name not in circuit.nodes:
            raise InputError("pressures", name, "nodes are", known=circuit.nodes, where="circuit")
    for name in subtitles:
        if name not in circuit.nodes and name not in circuit.elements:
            parts = [*circuit.nodes, *circuit.elements]
            raise InputError("subtitles", name, "parts are", known=parts, where="circuit")


def _wires(circuit: Circuit) -> DiagramWiring:
    nodes = [name for name, node in circuit.nodes.items() if not is_atmosphere(node)]
    supplies = [name for name in nodes if isinstance(circuit.nodes[name], Reservoir)]
    ends = {e: tuple(n for n in ports if n in nodes) for e, (ports, _) in circuit.ends.items()}
    starts = {
        e
        for e, (ports, _) in circuit.ends.items()
        if type(circuit.elements[e]).__name__ == "Compressor" and ports[0] not in nodes
    }
    return wiring(supplies, nodes, ends, starts)


def _strengths(circuit: Circuit, pressures: Mapping[str, float]) -> dict[str, float]:
    """Line strength of each node with a known pressure: its gauge pressure over the largest."""
    if not pressures:
        return {}
    known = dict(pressures)
    for name, node in circuit.nodes.items():
        if isinstance(node, Reservoir) and node.signal is None:
            known[name] = float(node.pressure_abs)
    outside = ambient(circuit)
    top = max(max(p - outside for p in known.values()), 1.0)
    return {name: 0.4 + 0.6 * min(max((p - outside) / top, 0.0), 1.0) for name, p in known.items()}


# ---- strokes


def _draw_net(ax: Axes, net: Net, strength: float | None) -> None:
    """Draw all lines of a node as one stroke, so that crossings are not darker."""
    from matplotlib.path import Path

    colour = INK if strength is None else COLOURS["pressure"]
    codes: list[Any] = []
    points: list[Point] = []
    for run in net.lines:
        points += run
        codes += [Path.MOVETO] + [Path.LINETO] * (len(run) - 1)
    if not points:
        return
    width = LINE if strength is None else 1.8 * LINE
    draw_mark(ax, Stroke(Path(points, codes), width=width, colour=colour), alpha=strength, order=1.0)
    for x, y in net.dots:
        draw_mark(ax, Stroke(Path.circle((x, y), 2.6), fill=INK, width=0.0, colour=INK), order=1.5)


def draw_mark(ax: Axes, mark: Stroke, *, alpha: float | None = None, order: float = 2.0) -> None:
    """Draw one stroke on axes whose unit is the point."""
    from matplotlib.patches import PathPatch

    ax.add_patch(
        PathPatch(
            mark.path,
            facecolor=mark.fill,
            edgecolor=mark.colour,
            linewidth=mark.width,
            linestyle=(0, mark.dash) if mark.dash else "-",
            joinstyle="round",
            capstyle="butt" if mark.dash else "projecting" if order < 2.0 else "round",
            alpha=alpha,
            zorder=order,
            clip_on=False,
        )
    )


def draw_text(ax: Axes, text: Text) -> None:
    """Draw one line of text on axes whose unit is the point."""
    words = text.words
    ax.text(
        text.x,
        text.y,
        words.text,
        ha=text.align,
        va="baseline",
        fontsize=words.size,
        fontweight="bold" if words.bold else "normal",
        color=words.colour,
        parse_math=False,
        zorder=3,
    )


# ---- the grid


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
