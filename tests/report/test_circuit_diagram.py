import itertools
import re
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.components.flow import FlowElement, Gases, TwoPort
from mckibben.errors import InputError
from mckibben.muscles.build import law_from_specimen
from mckibben.pneumatics.build import ELEMENTS
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.tubes import LumpedTube
from mckibben.pneumatics.volume import FixedVolume, MovingVolume, Reservoir
from mckibben.report.figures import circuit_cells, circuit_diagram, circuit_symbols, style
from mckibben.specimens import specimen

# Two rectangles may touch: half a point is less than the width of a line.
TOUCH = 0.5
LAW = law_from_specimen(specimen("nylon"), "ideal")
SUPPLY, AIR, VACUUM = Reservoir(pressure_abs=7e5), Reservoir(), Reservoir(pressure_abs=3e4)
VALVE, TUBE = Orifice(conductance=1e-8), LumpedTube(length=1.0, diameter=3.2e-3)


class Silencer(TwoPort):
    def mass_flow(self, a: Any, b: Any, state: Any = (), command: Any = 0.0) -> Any:
        return 0.0 * a.pressure_abs


class ThreeWayValve(FlowElement):
    """Stands for any type of this name: symbols go by name and ports."""

    ports: ClassVar[tuple[str, ...]] = ("supply", "work", "exhaust")
    paths: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (1, 2))
    commanded: ClassVar[bool] = True

    def flows(self, gas: Gases, state: Any, memory: Any, command: Any) -> Any:
        return 0.0, 0.0


class Manifold(ThreeWayValve):
    ports: ClassVar[tuple[str, ...]] = ("a", "b", "c", "d")
    paths: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (1, 2), (2, 3))
    commanded: ClassVar[bool] = False


def tank(size: float = 164e-6) -> FixedVolume:
    return FixedVolume(volume=size)


def muscle(signal: str = "length") -> MovingVolume:
    return MovingVolume(of=LAW.braid_volume, signal=signal)


def four_muscles() -> Circuit:
    nodes: dict[str, Any] = {"supply": SUPPLY, "reserve": tank(2e-3), "atmosphere": AIR}
    branches = {"main valve": Branch(VALVE, ("supply", "reserve"))}
    for i in "1234":
        nodes |= {f"line {i}": tank(1e-6), f"muscle {i}": muscle(f"length {i}")}
        branches[f"valve {i}"] = Branch(ThreeWayValve(), ("reserve", f"line {i}", "atmosphere"), f"u{i}")
        branches[f"tube {i}"] = Branch(TUBE, (f"line {i}", f"muscle {i}"))
    branches["leak"] = Branch(VALVE, ("muscle 2", "atmosphere"))
    return Circuit.of(nodes, branches)


CIRCUITS = {
    "chain": Circuit.of(
        {"supply": SUPPLY, "valve end": tank(1e-6), "tank": tank()},
        {"valve": Branch(VALVE, ("supply", "valve end"), "u"), "tube": Branch(TUBE, ("valve end", "tank"))},
    ),
    "fill and vent": Circuit.of(
        {"supply": SUPPLY, "muscle": muscle(), "atmosphere": AIR},
        {"fill": Branch(VALVE, ("supply", "muscle"), "u1"), "vent": Branch(VALVE, ("muscle", "atmosphere"), "u2")},
    ),
    "four muscles": four_muscles(),
    "three ports": Circuit.of(
        {"supply": SUPPLY, "muscle": muscle(), "atmosphere": AIR},
        {"valve": Branch(ThreeWayValve(), ("supply", "muscle", "atmosphere"), "u")},
    ),
    "ring": Circuit.of(
        {"one": tank(), "two": tank(), "three": tank()},
        {"a": Branch(TUBE, ("one", "two")), "b": Branch(TUBE, ("two", "three")), "c": Branch(VALVE, ("three", "one"))},
    ),
    "ports on the wrong side": Circuit.of(
        {"vacuum": VACUUM, "measured": Reservoir(signal="bench"), "one": tank(), "two": muscle(), "atmosphere": AIR},
        {
            "valve": Branch(ThreeWayValve(), ("one", "two", "vacuum"), "u"),
            "block": Branch(Manifold(), ("two", "atmosphere", "one", "vacuum")),
            "bench valve": Branch(VALVE, ("measured", "two")),
        },
    ),
}


@st.composite
def random_circuits(draw: Any) -> Circuit:
    """Any network of up to five chambers, three reservoirs and nine elements with two to four ports."""
    chambers = [f"node {i}" for i in range(draw(st.integers(1, 5)))]
    reservoirs = {"supply": SUPPLY, "atmosphere": AIR, "vacuum": VACUUM}
    names = [*chambers, *reservoirs]
    branches: dict[str, Branch] = {}
    for i in range(draw(st.integers(1, 9))):
        part: Any = draw(st.sampled_from([VALVE, TUBE, Silencer(), ThreeWayValve(), Manifold()]))
        ends = draw(st.permutations(names))[: len(part.ports)]
        shorted = any(ends[a] in reservoirs and ends[b] in reservoirs for a, b in part.paths if max(a, b) < len(ends))
        if len(ends) < len(part.ports) or shorted:
            continue
        driven = part.commanded or draw(st.booleans())
        branches[f"part {i}"] = Branch(part, tuple(ends), f"signal {i}" if driven else None)
    touched = {end for b in branches.values() for end in b.ports}
    for name in chambers:
        if name not in touched:
            branches[f"to {name}"] = Branch(TUBE, ("supply", name))
            touched |= {"supply", name}
    nodes = {n: reservoirs.get(n) or (muscle() if draw(st.booleans()) else tank()) for n in names if n in touched}
    return Circuit.of(nodes, branches)


def check_apart(circuit: Circuit, **options: Any) -> None:
    """No two symbols, triangles or texts overlap, no line runs through a text, none through a symbol but its own."""
    plan = circuit_diagram.plan(circuit, **options)
    solid = {**plan.symbols, **{f"triangle {i}": b for i, b in enumerate(plan.triangles)}}
    # The name of a part that has no symbol stands inside its box.
    inside = {type(e).__name__ for e in circuit.elements.values()}
    texts = {f"text {i} {t.words.text}": t.box for i, t in enumerate(plan.texts) if t.words.text not in inside}
    for (a, one), (b, two) in itertools.combinations({**solid, **texts}.items(), 2):
        assert not one.overlaps(two, TOUCH), (a, b)
    for node, net in plan.nets.items():
        for run in net.lines:
            for (x0, y0), (x1, y1) in itertools.pairwise(run):
                assert abs(x0 - x1) < 1e-6 or abs(y0 - y1) < 1e-6, "lines are orthogonal"
                stroke = circuit_symbols.Box(min(x0, x1) - 1, min(y0, y1) - 1, max(x0, x1) + 1, max(y0, y1) + 1)
                for name, box in texts.items():
                    assert not stroke.overlaps(box, TOUCH), (node, name)
                own = {f"node {node}", *(f"element {e}" for e, (ends, _) in circuit.ends.items() if node in ends)}
                for name, box in solid.items():
                    assert name in own or not stroke.overlaps(box, TOUCH), (node, name)


def check_nets_apart(circuit: Circuit) -> None:
    """Lines of different nodes may cross, but never lie on each other."""
    strokes = []
    for node, net in circuit_diagram.plan(circuit).nets.items():
        for run in net.lines:
            strokes += [(node, *sorted(pair)) for pair in itertools.pairwise(run) if pair[0] != pair[1]]
    for (n, a, b), (m, c, d) in itertools.combinations(strokes, 2):
        if n == m:
            continue
        for along in (0, 1):
            off = 1 - along
            level = {round(p[off], 3) for p in (a, b, c, d)}
            shared = min(max(a[along], b[along]), max(c[along], d[along])) - max(
                min(a[along], b[along]), min(c[along], d[along])
            )
            assert len(level) > 1 or shared < 1e-6, (n, m)


@pytest.mark.parametrize("name", CIRCUITS)
def test_every_node_element_and_command_is_named(name: str) -> None:
    circuit = CIRCUITS[name]
    svg = style.to_svg(circuit_diagram.draw(circuit, title="A title"))
    texts = set(re.findall(r"<text[^>]*>([^<]*)</text>", svg))
    commands = {command for _, command in circuit.ends.values() if command}
    assert {"A title", *circuit.nodes, *circuit.elements, *commands} <= texts


@pytest.mark.parametrize("name", CIRCUITS)
def test_nothing_overlaps(name: str) -> None:
    circuit = CIRCUITS[name]
    check_apart(circuit, pressures={n: 3e5 for n in circuit.chambers})
    check_nets_apart(circuit)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(random_circuits())
def test_nothing_overlaps_in_any_topology(circuit: Circuit) -> None:
    check_apart(circuit)
    check_nets_apart(circuit)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(random_circuits())
def test_every_port_is_joined_to_its_node(circuit: Circuit) -> None:
    plan = circuit_diagram.plan(circuit)
    for name, (ends, _) in circuit.ends.items():
        for end in ends:
            if circuit_cells.is_atmosphere(circuit.nodes[end]):
                continue
            box, grown = plan.symbols[f"element {name}"], 1.0
            near = circuit_symbols.Box(box.x0 - grown, box.y0 - grown, box.x1 + grown, box.y1 + grown)
            starts = [run[0] for run in plan.nets[end].lines]
            assert any(near.x0 <= x <= near.x1 and near.y0 <= y <= near.y1 for x, y in starts), (name, end)
    free = [e for ends, _ in circuit.ends.values() for e in ends if circuit_cells.is_atmosphere(circuit.nodes[e])]
    assert len(plan.triangles) == len(free), "one triangle for each port to the air outside"


@pytest.mark.parametrize("ending", ["svg", "png"])
def test_the_same_circuit_gives_the_same_bytes(tmp_path: Any, ending: str) -> None:
    for i in "12":
        figure = circuit_diagram.draw(four_muscles(), pressures={"reserve": 6e5})
        style.save(figure, tmp_path / f"{i}.{ending}")
    assert (tmp_path / f"1.{ending}").read_bytes() == (tmp_path / f"2.{ending}").read_bytes()


def test_an_unknown_part_is_a_box_with_the_name_of_its_type() -> None:
    circuit = Circuit.of({"supply": SUPPLY, "tank": tank()}, {"quiet": Branch(Silencer(), ("supply", "tank"))})
    plan = circuit_diagram.plan(circuit)
    (text,) = [t for t in plan.texts if t.words.text == "Silencer"]
    box = plan.symbols["element quiet"]
    assert box.x0 < text.box.x0 and text.box.x1 < box.x1 and box.y0 < text.box.y0 and text.box.y1 < box.y1


def test_supplies_stand_left_of_what_they_feed() -> None:
    plan = circuit_diagram.plan(four_muscles())
    way = ["node supply", "element main valve", "node reserve", "element valve 3", "element tube 3", "node muscle 3"]
    starts = [plan.symbols[key].x0 for key in way]
    assert starts == sorted(starts)


def test_labels_state_values_with_the_units_people_read() -> None:
    start = {"valve end": 301325.0, "tank": 101325.0}
    texts = [
        t.words.text.replace("\N{NO-BREAK SPACE}", " ")
        for t in circuit_diagram.plan(CIRCUITS["chain"], pressures=start).texts
    ]
    # 1e-8 m^3/(s Pa) is 1e-5 L/s for each Pa, 1 L/s or 60 L/min for each bar
    for wanted in ("1 m × 3.2 mm", "164 cm³", "C 60 L/(min bar)", "2 bar", "0 bar", "5.99 bar"):
        assert wanted in texts, wanted


def test_subtitles_stand_in_for_values() -> None:
    texts = [t.words.text for t in circuit_diagram.plan(CIRCUITS["chain"], subtitles={"tube": "1/8 in\nnylon"}).texts]
    assert {"1/8 in", "nylon"} <= set(texts)
    assert not any("3.2" in t for t in texts)


def test_the_braid_is_drawn_with_the_angle_of_its_law() -> None:
    angle = circuit_cells.braid_angle(muscle())
    assert angle is not None and 0.2 < angle < 1.0
    symbol = circuit_symbols.muscle(angle, hanging=False)
    middle = [m.path.vertices for m in symbol.marks if m.width < 0.5 and len(m.path.vertices) == 9]
    slopes = {round(float(np.abs((v[5, 1] - v[3, 1]) / (v[5, 0] - v[3, 0]))), 6) for v in middle if 40 < v[4, 0] < 70}
    assert slopes == {round(float(np.tan(angle)), 6)}


@pytest.mark.parametrize("field", ["pressures", "subtitles"])
def test_words_for_what_is_not_there_are_refused(field: str) -> None:
    with pytest.raises(InputError, match="nowhere"):
        circuit_diagram.draw(CIRCUITS["chain"], **{field: {"nowhere": 1e5 if field == "pressures" else "x"}})


@pytest.mark.parametrize("kind", ELEMENTS.values(), ids=ELEMENTS)
def test_every_element_that_can_be_built_from_words_has_a_symbol_of_its_own(kind: type[FlowElement]) -> None:
    symbol, inside = circuit_cells.symbol_of(object.__new__(kind), driven=kind.commanded)
    assert inside == "" and len(symbol.ports) == len(kind.ports)
    assert len({port[:2] for port in symbol.ports}) == len(kind.ports), "two ports at one place"
