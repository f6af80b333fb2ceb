"""A circuit and its run as one line: what a log, a figure and a recording call it."""

from __future__ import annotations

from ..components import paths
from ..experiments.waveforms import time_words
from ..quantities import with_unit
from .circuit_file import CircuitPlan


def sentence(plan: CircuitPlan) -> str:
    """The circuit as chains of nodes and elements, such as ``supply (5 bar) -> tube (..) -> tank (120 cm^3, ..)``.

    A node is described where it comes first. Chains begin at reservoirs, follow the elements' first paths in the order of
    the file, and end where they meet one that has been told; the other ports of an element stand in its brackets.
    """
    described: set[str] = set()
    left = dict(plan.circuit.ends)
    chains = []
    while left:
        name = next(
            (n for n in left if plan.nodes[left[n][0][0]].kind in ("reservoir", "atmosphere")), next(iter(left))
        )
        chain = [_node(plan, _way(plan, name)[0], described)]
        while True:
            _, end = _way(plan, name)
            chain += [_element(plan, name, described), _node(plan, end, described)]
            del left[name]
            following = [n for n in left if _way(plan, n)[0] == end]
            if not following or plan.nodes[end].kind in ("reservoir", "atmosphere"):
                break
            name = following[0]
        chains.append(" -> ".join(chain))
    return "; ".join(chains)


def run_sentence(plan: CircuitPlan) -> str:
    """Describe signals and duration, such as ``open: pulse ..; for 2 s at 1 kHz, step 50 us``."""
    driven = [f"{name}: {s.waveform.sentence(s.unit)}" for name, s in plan.signals.items()]
    rate = 1.0 / plan.period
    shown = f"{rate / 1e3:.6g} kHz" if rate >= 999.5 else f"{rate:.6g} Hz"
    method = "" if plan.method == "auto" else f", method {plan.method}"
    clock = f"for {time_words(plan.duration)} at {shown}, step {time_words(plan.inner_step)}{method}"
    return "; ".join([*driven, clock])


def _way(plan: CircuitPlan, name: str) -> tuple[str, str]:
    ends = plan.circuit.ends[name][0]
    i, j = plan.circuit.elements[name].paths[0]
    return ends[i], ends[j]


def _node(plan: CircuitPlan, name: str, stated: set[str]) -> str:
    words = plan.nodes[name].words
    if name in stated or not words:
        return name
    stated.add(name)
    return f"{name} ({words})"


def _element(plan: CircuitPlan, name: str, told: set[str]) -> str:
    stated = plan.document["elements"][name]
    element, (ends, command) = plan.circuit.elements[name], plan.circuit.ends[name]
    words = [str(stated["kind"]).replace("_", " ")]
    if "specimen" in stated:
        words.append(str(stated["specimen"]))
    known = dict(paths.parameters(plan.owner))
    for key, value in stated.items():
        if key in ("kind", "specimen", "command", "from", "to", *element.ports):
            continue
        values = value if isinstance(value, list) else [value]
        words.append(f"{key.replace('_', ' ')} {' '.join(map(str, values))}")
    for path, number in plan.overrides.items():
        if path.startswith(f"elements.{name}."):
            key = path.removeprefix(f"elements.{name}.")
            words.append(f"{key.replace('_', ' ')} {with_unit(number, known[path].unit)}")
    i, j = element.paths[0]
    for k, port in enumerate(element.ports):
        if k not in (i, j):
            words.append(f"{port.replace('_', ' ')} at {_node(plan, ends[k], told)}")
    if command is not None:
        words.append(f"driven by {command}")
    return f"{name} ({', '.join(words)})"
