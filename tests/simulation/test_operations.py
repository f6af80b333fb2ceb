"""How many operations a step takes: counted, because a clock tells of the load of a machine as well."""

import functools

import numpy as np
import pytest

import lanewise
import mckibben as mk
from lanewise._analysis import find_homes, find_live
from mckibben.simulation.stepping import step_vectors

FREE = {"const", "load", "phi", "end", "index", "table", "done"}  # values that take no instruction of their own
SYSTEMS = {
    "plate": lambda: mk.Plate("nylon", span=0.135),
    "joint": lambda: mk.Joint("nylon"),
    "weight": lambda: mk.Weight("DMSP-10-250", mass=5.0),
}


# As they were counted when the three were last made faster, and a hundredth for how another JAX writes the same.
@pytest.mark.parametrize(
    ("name", "most", "divisions"), [("plate", 2055, 52), ("joint", 4365, 103), ("weight", 1820, 70)]
)
def test_a_step_takes_no_more_operations_than_it_did(name, most, divisions):
    sim = mk.Simulation(SYSTEMS[name](), mk.Air(supply="6 bar", valve="regulator"))
    one = functools.partial(step_vectors, sim.programs.layouts, False)
    program, _ = lanewise.lower(one, *sim.programs.examples, np.float64(1e-3), np.int64(1))
    graph, _ = program.prepared()
    live = find_live(graph)
    home = find_homes(graph, live)
    inside = [node.op for node in live.nodes if home[node] is not None and node.op not in FREE]
    assert len(inside) <= most
    assert inside.count("div") + inside.count("rcp") <= divisions  # each takes as long as ten of the others
