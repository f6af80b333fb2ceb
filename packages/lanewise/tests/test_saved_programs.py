"""A program is saved, and runs in a process that never loads JAX; machine code is kept on disk."""

import json
import subprocess
import sys
import zlib

import jax
import numpy as np
import pytest

import lanewise
from lanewise import ArgumentError, Program, _kernel, _program
from lowered_systems import positions, rubbing

WITHOUT_JAX = """
import json, sys
import numpy as np
from lanewise import Program
program = Program.load(sys.argv[1])
values = np.load(sys.argv[2])
found = program.run({leaf.name: values[f"a{k}"] for k, leaf in enumerate(program.arguments)}, lanes=5)
heavy = [m for m in ("jax", "scipy", "equinox") if m in sys.modules]
print(json.dumps({"heavy": heavy, "found": [v.tolist() for v in found.values()]}))
"""


@pytest.fixture(scope="module")
def run():
    return lanewise.compile(positions(), *rubbing(), engine="native")


def arguments():
    system, *rest = rubbing()
    return system.replace(mass=np.linspace(0.3, 0.7, 5)), *rest


def test_a_saved_program_runs_without_jax_and_gives_the_same_bits(run, tmp_path):
    file, values = tmp_path / "rubbing.kernel", tmp_path / "values.npz"
    run.program.save(file)
    np.savez(values, **{f"a{k}": leaf for k, leaf in enumerate(jax.tree.leaves(arguments()))})
    done = subprocess.run([sys.executable, "-c", WITHOUT_JAX, file, values], capture_output=True, text=True, check=True)
    told = json.loads(done.stdout)
    assert told["heavy"] == []
    np.testing.assert_array_equal(told["found"][0], run(*arguments(), lanes=5))


def test_saving_and_loading_changes_nothing(run, tmp_path):
    run.program.save(tmp_path / "a.kernel")
    again = Program.load(tmp_path / "a.kernel")
    again.save(tmp_path / "b.kernel")
    assert (tmp_path / "a.kernel").read_bytes() == (tmp_path / "b.kernel").read_bytes()
    differs = frozenset([3])
    assert again.assembly(differs, lanes=True)[0] == run.program.assembly(differs, lanes=True)[0]


@pytest.mark.parametrize("piece", [1, 7, 100])
def test_in_pieces_of_any_length_a_program_is_written_as_in_one(run, monkeypatch, piece):
    def written(longest):
        monkeypatch.setattr(_program, "PIECE", longest)
        return zlib.decompress(
            _program.serialise(run.program.graph, {"title": "a \u00fc", "given": [[0.1, None], []]})
        ).decode()

    whole = written(10**9)  # list by list, each in one piece or entry by entry
    assert whole == json.dumps(json.loads(whole), separators=(",", ":")) and len(json.loads(whole)["nodes"]) > 100
    assert written(piece) == whole


def test_machine_code_is_compiled_once_and_a_damaged_file_is_made_anew(run, tmp_path, monkeypatch):
    monkeypatch.setenv("LANEWISE_CACHE", str(tmp_path))
    made = []
    real = _program.compile_assembly
    monkeypatch.setattr(_program, "compile_assembly", lambda text: made.append(1) or real(text))
    leaves = jax.tree.leaves(arguments())
    first = Program.from_bytes(run.program.serialised).call(leaves, lanes=5)[0]
    second = Program.from_bytes(run.program.serialised).call(leaves, lanes=5)[0]
    assert len(made) == 1
    (file,) = tmp_path.glob("*.o")
    file.write_bytes(file.read_bytes()[:-200])
    third = Program.from_bytes(run.program.serialised).call(leaves, lanes=5)[0]
    assert len(made) == 2
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(first, third)


def test_a_folder_that_cannot_be_written_is_no_error(run, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("LANEWISE_CACHE", str(tmp_path / "file"))
    found = Program.from_bytes(run.program.serialised).call(jax.tree.leaves(arguments()), lanes=5)[0]
    np.testing.assert_array_equal(found, run(*arguments(), lanes=5))


def test_a_long_program_in_pieces_and_without_pains_gives_the_same_bits(run, tmp_path, monkeypatch):
    """As of a large system: blocks are cut, and LLVM does not optimise; neither may move a result."""
    leaves = jax.tree.leaves(arguments())
    whole = run.program.assembly(frozenset([3]), lanes=True)[0]
    monkeypatch.setenv("LANEWISE_CACHE", str(tmp_path))
    monkeypatch.setattr(_kernel, "LONGEST", 20)
    pieces = run.program.assembly(frozenset([3]), lanes=True)[0]
    assert pieces.count("label %more") > whole.count("label %more") + 5
    found = Program.from_bytes(run.program.serialised).call(leaves, lanes=5)[0]
    np.testing.assert_array_equal(found, run(*arguments(), lanes=5))
    monkeypatch.setattr(_kernel, "LARGE", 1)
    for file in tmp_path.glob("*.o"):
        file.unlink()
    plain = Program.from_bytes(run.program.serialised).call(leaves, lanes=5)[0]
    np.testing.assert_array_equal(plain, found)


def changed(run, change):
    """A saved program with something else in its file."""
    content = json.loads(zlib.decompress(run.program.serialised))
    change(content)
    return zlib.compress(json.dumps(content).encode())


def first(content, op):
    return next(node for node in content["nodes"] if node[0] == op)


TEXT = "0)\n  call void @system()\n"
INJECTED = {
    "an operation": lambda c: c["nodes"][-1].__setitem__(0, TEXT),
    "a kind": lambda c: c["nodes"][-1].__setitem__(1, TEXT),
    "a whole number": lambda c: c["nodes"].append(["const", "int", [], TEXT]),
    "the place of an element": lambda c: first(c, "load")[3].__setitem__(2, TEXT),
    "the trips of a loop": lambda c: c["loops"][0].update(trips=TEXT),
    "the depth of a loop": lambda c: c["loops"][0].update(depth=TEXT),
    "the kind of a buffer": lambda c: c["buffers"][0].__setitem__(1, TEXT),
    "the role of a buffer": lambda c: c["buffers"][0].__setitem__(0, TEXT),
    "the shape of a buffer": lambda c: c["buffers"][0].__setitem__(2, [TEXT]),
    "a shape that is shorter than its numbers": lambda c: c["buffers"].append(["constant", "real", [1], "", [1, 2], None]),
    "a result": lambda c: c["results"].append([TEXT, TEXT, []]),
    "arguments that are none": lambda c: c.update(arguments=[1.0]),
    "no title": lambda c: c.pop("title"),
}  # fmt: skip


@pytest.mark.parametrize("change", INJECTED.values(), ids=INJECTED)
def test_what_a_graph_cannot_have_is_refused_before_it_becomes_assembly(run, change):
    with pytest.raises(ArgumentError, match="must be a file that Program.save wrote"):
        Program.from_bytes(changed(run, change), "forged.kernel")


def test_a_program_nested_without_end_is_refused():
    for data in (b"[" * 100_000, b'{"schema":1,"nodes":' + b"[" * 100_000):
        with pytest.raises(ArgumentError, match="forged.kernel: the program is unreadable"):
            Program.from_bytes(zlib.compress(data), "forged.kernel")
