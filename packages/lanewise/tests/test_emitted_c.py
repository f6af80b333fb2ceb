"""Emitted C compiles without a warning, and has the bits of the LLVM kernel."""

import subprocess
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

from c_programs import COMPILER, InC, built, same_bits
from lanewise import ArgumentError, CFunction, lower, to_c, to_c_library
from lanewise._c import dotted_path
from lanewise._c_text import C_OPS
from lowered_examples import (
    CASES,
    arguments_of,
    commands,
    orbit_program,
    orbit_values,
    program,
    run_of_orbit,
    sample_of_orbit,
)
from lowered_systems import bodies

compiled = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
MODES = [(mode, real) for mode in ("default", "strict") for real in ("float64", "float32")]
GROUPS = {"arguments": ("parameters", "state", "inputs"), "results": ("state", "outputs")}


def test_the_examples_use_every_operation() -> None:
    used = set()
    for mode in ("default", "fast"):
        used |= {node.op for name in CASES for node in program(name).prepared(mode)[1].live.nodes}
    assert used >= {*C_OPS, "invert", "item", "table"}


@compiled
@pytest.mark.parametrize(("mode", "real"), MODES)
@pytest.mark.parametrize("name", CASES)
def test_c_has_the_bits_of_the_kernel(name: str, mode: str, real: str, tmp_path: Path) -> None:
    # No tolerance: both write the same operations in the same order, each rounded as IEEE 754 says.
    made = program(name)
    c = InC(tmp_path, made, mode=mode, real=real)
    for values in arguments_of(name, real):
        assert same_bits(c(values), made.call(values, mode=mode, real=real)), values


@compiled
@pytest.mark.parametrize(("mode", "real"), MODES)
def test_a_run_of_an_orbit_has_the_bits_of_the_kernel(mode: str, real: str, tmp_path: Path) -> None:
    made, values = orbit_program(), orbit_values()
    c = InC(tmp_path, made, "orbit", mode=mode, real=real)
    found = c(values)
    assert same_bits(found, made.call(values, mode=mode, real=real))
    assert np.ptp(found[0]) > 1e-4  # it moved


@compiled
@pytest.mark.parametrize("name", CASES)
def test_fast_differs_by_rounding_only(name: str, tmp_path: Path) -> None:
    made = program(name)
    c = InC(tmp_path, made, mode="fast")
    for values in arguments_of(name, "float64"):
        for ours, exact in zip(c(values), made.call(values), strict=True):
            # three products more for each reciprocal, 1e-16 each, in sums that cancel by a factor of 100 at most; not
            # finite is the same in both, for where a product of denominators is no normal number each is taken by itself
            np.testing.assert_allclose(ours, exact, rtol=1e-13, atol=1e-13)


@compiled
def test_optimisation_changes_no_bit(tmp_path: Path) -> None:
    made, values = orbit_program(), orbit_values()
    found = []
    for level in ("-O0", "-O3", "-march=native"):  # the last with the processor's own fused multiply-add
        (tmp_path / level).mkdir()
        found.append(InC(tmp_path / level, made, flags=[level])(values))
    assert same_bits(found[0], found[1])
    assert same_bits(found[0], found[2])


@compiled
def test_two_roundings_differ_by_rounding_only(tmp_path: Path) -> None:
    made, values = orbit_program(), orbit_values()
    (tmp_path / "two").mkdir()
    fused = InC(tmp_path, made)(values)
    apart = InC(tmp_path / "two", made, flags=["-DEMITTED_TWO_ROUNDINGS"])(values)
    for a, b in zip(fused, apart, strict=True):
        # 1e-16 per operation, some 1e5 operations in this run, of which few act on what is kept: 1e-12 leaves room
        np.testing.assert_allclose(a, b, rtol=1e-12)
    assert not same_bits(fused, apart)  # or the macro does nothing


@compiled
def test_c_follows_xla(tmp_path: Path) -> None:
    theirs = jax.jit(run_of_orbit)(*bodies(), commands())
    ours = InC(tmp_path, orbit_program(), mode="strict")(orbit_values())
    for leaf, value in zip(orbit_program().results, ours, strict=True):
        np.testing.assert_allclose(
            value, theirs[dotted_path(leaf.name)], rtol=1e-12
        )  # 120 steps, each exact to some 1e-16


@compiled
def test_steps_called_one_by_one_are_the_run(tmp_path: Path) -> None:
    # A sample's step, its state kept by the caller in C's own struct, against the run that has the loop inside.
    parameters, state = bodies()
    step, _ = lower(sample_of_orbit, parameters, state, {"thrust": 0.0})
    c = InC(tmp_path, step, "orbit", **GROUPS)
    values = [*jax.tree.leaves((parameters, state)), 0.0]
    first, last = values.index(values[-1], len(values) - 1), len(jax.tree.leaves(state))
    seen: list[Any] = []
    for command in commands()[:-1]:
        found = c([*values[:first], command])
        values[first - last : first] = found[:last]
        seen.append(found[last])
    whole = orbit_program().call(orbit_values())
    # rounding: the run takes reciprocals of parameters out of its loop and groups others than the single step does
    np.testing.assert_allclose(seen, whole[0][1:], rtol=1e-12)


@compiled
def test_state_is_replaced_where_it_stands(tmp_path: Path) -> None:
    # The new a needs the old b and the new b the old a: what is read must not be what was just written.
    made, _ = lower(lambda s, u: ({"a": s["b"] + u, "b": s["a"] * u}, s["a"]), {"a": 1.0, "b": 2.0}, 3.0)
    c = InC(tmp_path, made, arguments=("state", "input"), results=("state", "output"))
    assert [g.name for g in c.groups] == ["state", "input", "output"]
    assert [float(v) for v in c([1.0, 2.0, 3.0])] == [5.0, 3.0, 1.0]


@compiled
def test_defaults_are_exact(tmp_path: Path) -> None:
    numbers = {
        "third": 1.0 / 3.0,
        "tiny": 5e-324,
        "large": 1.7976931348623157e308,
        "minus": -0.0,
        "rows": np.array([0.1, -2e-7]),
    }
    made, _ = lower(lambda p, x: p["third"] * x + p["tiny"] + p["large"] + p["minus"] + p["rows"].sum(), numbers, 1.0)
    names = {"arguments": ("parameters", "x")}
    leaves = jax.tree.leaves(numbers)
    c = InC(tmp_path, made, values={"parameters": leaves}, **names)
    held = c.structs["parameters"].in_dll(c.library, "emitted_default_parameters")
    for member, leaf in zip(c.groups[0].members, leaves, strict=True):
        assert np.ctypeslib.as_array(getattr(held, member.name)).tobytes() == np.asarray(leaf, float).tobytes()


@compiled
@pytest.mark.parametrize("real", ["float64", "float32"])
def test_strictest_warnings_find_nothing(real: str, tmp_path: Path) -> None:
    flags = ["-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Wstrict-prototypes", "-Wmissing-prototypes"]
    for name in CASES:
        built(tmp_path, to_c(program(name), name, real=real), name, flags)
    built(tmp_path, to_c(orbit_program(), "orbit", real=real), "orbit", flags)


def test_it_allocates_nothing_and_keeps_nothing() -> None:
    for name in CASES:
        text = to_c(program(name), name)[f"{name}.c"]
        assert "malloc" not in text
        assert all(
            line.startswith(("static inline", "static const"))
            for line in text.splitlines()
            if line.startswith("static")
        )


def test_the_header_names_every_argument_by_its_path() -> None:
    sources = to_c(orbit_program(), "orbit", arguments=("parameters", "state", "thrust"))
    for leaf in (*orbit_program().arguments, *orbit_program().results):
        if leaf.name != "[2]":
            assert f" {dotted_path(leaf.name)}" in sources["orbit.h"], leaf.name
    assert "bodies.ship.mass */" in sources["orbit.h"]
    assert "float " not in sources["orbit.h"]
    assert "double " not in to_c(orbit_program(), "orbit", real="float32")["orbit.c"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "2fast"}, "name must be a name in C .*, got '2fast'"),
        ({"name": "double"}, "name must be a name in C .*, got 'double'"),
        ({"arguments": ("a",)}, "arguments must be 2 names, got 1"),
        ({"arguments": ("same", "same")}, "must be names that differ"),
        ({"arguments": ("state", "v1")}, "arguments must be a name in C .*, got 'v1'"),
        ({"arguments": ("state", "input"), "results": ("input", "output")}, "results must replace .*'input' differs"),
        ({"values": {"nothing": []}}, "Unknown argument 'nothing' in values. Known are argument0, argument1"),
        ({"values": {"argument0": [1.0]}}, "argument0 must be 2 values, .*got 1"),
        ({"values": {"argument1": [[1.0, 2.0]]}}, "argument1.* must have the shape \\(\\), got \\(2,\\)"),
        ({"mode": "loose"}, "Unknown mode 'loose'"),
    ],
)
def test_refusals_name_what_is_wrong(changes: dict[str, Any], message: str) -> None:
    made, _ = lower(lambda s, u: ({"a": s["b"] + u, "b": s["a"] * u}, s["a"]), {"a": 1.0, "b": 2.0}, 3.0)
    with pytest.raises(ArgumentError, match=message):
        to_c(made, **{"name": "step", **changes})


def _tank_steps(parameters: Any, state: Any, inputs: Any) -> tuple[Any, Any]:
    flow = parameters["slope"] * (inputs["supply"] - state["level"])
    return {"level": state["level"] + 0.1 * flow}, {"flow": flow}


def _tank_starts(parameters: Any, inputs: Any) -> tuple[Any]:
    return ({"level": parameters["share"] * inputs["supply"]},)


TANK = ({"slope": 2.0, "share": 0.25, "unread": 7.0}, {"level": 0.0}, {"supply": 3.0})


def _tank(**more: Any) -> dict[str, CFunction]:
    steps = lower(_tank_steps, *TANK)[0]
    starts = lower(_tank_starts, TANK[0], TANK[2])[0]
    step = CFunction(steps, ("parameters", "state", "inputs"), ("state", "outputs"))
    return {"step": step, "start": CFunction(starts, ("parameters", "inputs"), ("state",)), **more}


@compiled
def test_functions_of_a_library_share_structs_and_leave_out_what_none_reads(tmp_path: Path) -> None:
    values = {"parameters": [TANK[0][name] for name in sorted(TANK[0])]}
    made = to_c_library(_tank(), "tank", values=values, about=lambda group, path: f"{group}: {path}")
    assert [m.path for m in made.structs["parameters"]] == ["share", "slope"]
    assert "parameters: slope" in made.header and "unread" not in made.header
    main = """
    #include <stdio.h>
    #include "tank.h"
    int main(void)
    {
        tank_state state; tank_inputs inputs = {3.0}; tank_outputs outputs;
        tank_start(&tank_default_parameters, &inputs, &state);
        tank_step(&tank_default_parameters, &state, &inputs, &outputs);
        printf("%.17g %.17g", state.level, outputs.flow);
        return 0;
    }
    """
    sources = {"tank.c": made.source, "tank.h": made.header, "main.c": main}
    for file, text in sources.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    assert COMPILER
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off"]
    command = [
        COMPILER,
        *flags,
        str(tmp_path / "main.c"),
        str(tmp_path / "tank.c"),
        "-o",
        str(tmp_path / "tank"),
        "-lm",
    ]
    subprocess.run(command, check=True)
    printed = subprocess.run([str(tmp_path / "tank")], check=True, capture_output=True, text=True).stdout
    level = 0.25 * 3.0
    flow = 2.0 * (3.0 - level)
    assert [float(word) for word in printed.split()] == [level + 0.1 * flow, flow]  # the same operations, each rounded


def test_a_library_refuses_structs_that_differ_and_names_that_clash() -> None:
    other = CFunction(lower(lambda state: (state["height"],), {"height": 1.0})[0], ("state",), ("outputs",))
    with pytest.raises(
        ArgumentError, match="state must have the same members in all functions; those of 'other' differ"
    ):
        to_c_library(_tank(other=other), "tank")
    with pytest.raises(ArgumentError, match="both are called 'state'"):
        to_c_library(_tank(state=_tank()["start"]), "tank")
    with pytest.raises(ArgumentError, match="Unknown argument 'numbers' in values"):
        to_c_library(_tank(), "tank", values={"numbers": []})
