"""Programs and machine code on disk: found again by all that they depend on, and by nothing less."""

import functools
import hashlib
import json
import os
import shutil
import stat
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

import lanewise
import mckibben
from lanewise import CacheWarning, cache
from lanewise.cache import is_private
from mckibben.assembly.build import unit_from_specimen
from mckibben.cli.app import _keep_compilations as keep_compilations
from mckibben.components import Module, Scalar, field, programs
from mckibben.components.system import System
from mckibben.engine import held, step
from mckibben.engine.integration import _outputs, compile_march
from mckibben.engine.native import compile_function
from mckibben.engine.signals import Value
from mckibben.muscles.elements import Tendon
from mckibben.muscles.hysteresis import FrictionLimit, MaxwellSlip
from mckibben.pneumatics.volume import MovingVolume

TENDON = Tendon(stiffness=1e5, toe_length=5e-4, loss=0.2)
STRETCH = np.float64(1e-3)
ROOT, COMPILER = (Path(package.__file__).parents[1] for package in (mckibben, lanewise))


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder of its own, for no test may find what another one left."""
    monkeypatch.setenv("MCKIBBEN_KERNELS", str(tmp_path / "kept"))
    return tmp_path / "kept"


@pytest.fixture
def lowered(monkeypatch):
    """How often something was lowered."""
    times = []
    real = lanewise.lower
    monkeypatch.setattr(lanewise, "lower", lambda *a, **k: times.append(1) or real(*a, **k))
    return times


def tension(**changes):
    """The force of a tendon, anew, as a fresh process has it."""
    tendon = TENDON.replace(**changes)
    return compile_function(Tendon.force, tendon, STRETCH, engine="native")(tendon, STRETCH)


def march_key(system=None, **changes):
    known = {"period": 1e-3, "inner": 10, "samples": 4, "stiff": False, "outputs": None} | changes
    return programs.program_key(functools.partial(_outputs, **known), (TENDON if system is None else system, 1.0))


def test_what_is_kept_is_found_and_gives_the_same_bits(lowered, monkeypatch):
    first, second = tension(), tension()
    assert len(lowered) == 1
    monkeypatch.setenv("MCKIBBEN_KERNELS", "off")
    third = tension()
    assert len(lowered) == 2
    assert first == second == third != 0.0


def test_parameters_are_arguments_and_not_part_of_a_program(lowered):
    assert tension() != tension(stiffness=2e5)
    assert len(lowered) == 1


def test_a_program_that_came_with_the_package_is_found_whatever_versions_lowered_it(
    folder, lowered, tmp_path, monkeypatch
):
    monkeypatch.setattr(programs, "LOWERED", tmp_path / "lowered")
    programs.LOWERED.mkdir()
    first = tension()
    (program,) = folder.glob("*.program")
    other = folder / f"{program.stem[: programs.DIGITS]}{'0' * 8}.program"  # as of another Python, JAX or NumPy
    program.rename(other)
    assert tension() == first
    assert len(lowered) == 2  # what is cached is of these versions
    (folder / program.name).unlink()
    shipped = programs.LOWERED / f"{program.stem[: programs.DIGITS]}.program"
    shutil.move(other, shipped)
    assert tension() == first
    assert len(lowered) == 2
    shipped.write_bytes(shipped.read_bytes()[:-1])
    assert tension() == first
    assert len(lowered) == 3  # a damaged file is none


class Remainder(Module):
    """A module with a formula that no kernel can do."""

    factor: Scalar

    @programs.evaluated
    def left(self, x):
        return self.factor * jnp.fmod(x, 0.3)


def test_a_formula_that_no_kernel_can_do_is_tried_once_and_evaluated_as_it_is_written(lowered):
    for x in (1.0, np.array([0.5, 1.0])):
        for _ in range(2):
            np.testing.assert_allclose(Remainder(factor=2.0).left(x), 2.0 * np.fmod(x, 0.3), rtol=1e-12)
    assert len(lowered) == 1


def test_off_keeps_nothing(folder, monkeypatch):
    monkeypatch.setenv("MCKIBBEN_KERNELS", "off")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    tension()
    assert not folder.exists()


class Named(Module):
    """A module with structure that is no array."""

    factor: Scalar
    name: str = field(static=True, default="")


def test_a_key_changes_with_every_thing_that_tracing_depends_on():
    limit = FrictionLimit(constant=1.0)
    slip = {n: MaxwellSlip.geometric(limit, elements=n) for n in (3, 4)}
    keys = [
        march_key(), march_key(period=2e-3), march_key(inner=11), march_key(samples=5), march_key(stiff=True),
        march_key(outputs=("a",)), march_key(outputs=("b",)), march_key(slip[3]), march_key(slip[4]),
        march_key(held(np.zeros(4))), march_key(held(np.zeros(5))), march_key(held(np.zeros(4)).delayed(0.1)),
        march_key(held(np.zeros(4)).replace(straight=True)),  # a static field
        march_key((TENDON, TENDON)), march_key([TENDON, TENDON]), march_key({"a": TENDON}), march_key({"b": TENDON}),
        march_key(np.int64(1)), march_key(np.float64(1.0)), march_key(np.float32(1.0)), march_key(np.zeros(1)),
        programs.program_key(Tendon.force, (TENDON, 1.0)), programs.program_key(Tendon.stored_energy, (TENDON, 1.0)),
    ]  # fmt: skip
    assert None not in keys
    assert len(set(keys)) == len(keys)
    assert march_key(slip[3]) == march_key(MaxwellSlip.geometric(FrictionLimit(constant=2.0), elements=3))


def test_a_constant_that_was_set_gives_another_key(monkeypatch):
    before = march_key()
    monkeypatch.setattr(step, "UNROLLED", step.UNROLLED + 1)
    assert march_key() != before


def test_a_library_may_move_what_a_module_imports_of_it_and_the_key_stays(monkeypatch):
    imported = type("Path", (), {})
    monkeypatch.setattr(step, "Path", imported, raising=False)
    keys = []
    for home in ("pathlib", "pathlib._local", "zipfile"):  # as with Python 3.12, with 3.13, and of another library
        imported.__module__ = home
        keys.append(march_key())
    assert keys[0] == keys[1] != keys[2]


def test_a_function_that_was_replaced_is_found_out(monkeypatch):
    before = march_key()
    monkeypatch.setattr(step, "axpy", step.zero_integrals)
    assert march_key() != before
    monkeypatch.setattr(step, "axpy", lambda a, x, y: y)
    assert march_key() is None


def test_a_method_in_a_tree_is_known_by_its_function_and_its_owner():
    def chamber(law):
        return MovingVolume(of=law.braid_volume, ambient=1e5, dead_volume=1e-6, signal="m.length")

    laws = [unit_from_specimen(name).law for name in ("nylon", "nylon", "fiberglass", "dmsp-20-300")]
    keys = [march_key(chamber(law)) for law in laws]
    assert None not in keys
    assert keys[0] == keys[1] == keys[2] != keys[3]  # two muscles of one law, and one of another


def test_what_has_no_sure_name_has_no_key(lowered):
    class Inner(Module):
        x: Scalar

    bound = 3.0
    for function in (
        lambda t, x: t.force(x),
        lambda t, x: bound * x,
        Named(1.0).replace,
        functools.partial(len, object()),
    ):
        assert programs.program_key(function, (TENDON, STRETCH)) is None
    for tree in (Inner(1.0), Named(1.0, name="a"), object(), {"a": "text"}, jnp.sum):  # types of a test, and no trees
        assert programs.program_key(Tendon.force, (tree, STRETCH)) is None
    # it is lowered each time, and right
    doubled = [compile_function(lambda t, x, k=k: k * t.force(x), TENDON, STRETCH, engine="native") for k in (2.0, 3.0)]
    assert doubled[1](TENDON, STRETCH) == pytest.approx(1.5 * doubled[0](TENDON, STRETCH), rel=1e-15)
    assert len(lowered) == 2


def test_layers_that_a_key_leaves_out_are_the_upper_ones_of_the_contract():
    contract = tomllib.loads((ROOT.parent / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers = next(c for c in contract["contracts"] if c.get("containers") == ["mckibben"])["layers"]
    assert [set(layer) for layer in programs.UPPER] == [set(x.split(" | ")) for x in layers[: len(programs.UPPER)]]


def test_a_changed_source_gives_another_key(tmp_path):
    shutil.copytree(ROOT / "mckibben", tmp_path / "src" / "mckibben", ignore=shutil.ignore_patterns("__pycache__"))
    program = (
        "from mckibben.bench.channels import measured\nfrom mckibben.components.programs import program_key\n"
        "from mckibben.muscles.elements import Tendon\n"
        "print(program_key(Tendon.force, (Tendon(stiffness=1e5), 1.0)), program_key(measured, (1.0,)))"
    )

    def keys(place=tmp_path / "src"):
        settings = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (place, COMPILER)))}
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, env=settings)
        return done.stdout.split()

    def changed(*path):
        source = (tmp_path / "src" / "mckibben").joinpath(*path)
        source.write_text(source.read_text(encoding="utf-8") + "\n# another\n", encoding="utf-8")
        return keys()

    first = keys()
    assert [len(key) for key in first] == [40, 40]
    assert first == keys(ROOT)  # wherever it is installed
    orifice = changed("pneumatics", "orifice.py")
    assert all(old != new for old, new in zip(first, orifice, strict=True))
    assert changed("cli", "app.py") == orifice  # neither function can import the command line
    force, channels = changed("bench", "rig.py")  # the bench imports the physics, never the other way round
    assert force == orifice[0]
    assert channels != orifice[1]


def test_what_a_package_computes_is_kept_once_it_has_joined_and_until_its_source_changes(tmp_path):
    """Of a package that nobody watches nothing is kept: an old program would go on after its source has changed."""
    package = tmp_path / "muscle_package"
    package.mkdir()
    program = (
        "import sys, muscle_package as m\nfrom mckibben.components.programs import program_key\n"
        "from mckibben.registry import join\nbefore = program_key(m.doubled, (1.0,))\njoin(m.__name__)\n"
        "print(before, program_key(m.doubled, (1.0,)))"
    )

    def keys(source):
        (package / "__init__.py").write_text(source, encoding="utf-8")
        settings = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (tmp_path, ROOT, COMPILER)))}
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, env=settings)
        return done.stdout.split()

    source = "def doubled(x):\n    return 2.0 * x\n"
    first, again, other = keys(source), keys(source), keys(source.replace("2.0", "3.0"))
    assert first[0] == again[0] == other[0] == "None"
    assert first[1] == again[1] != other[1] and len(other[1]) == 40


@pytest.mark.parametrize("kind", ["program", "o"])
@pytest.mark.parametrize("place", [0, 20, 40, -40])
def test_a_damaged_file_is_made_anew(folder, kind, place):
    first = tension()
    (file,) = folder.glob(f"*.{kind}")
    good = file.read_bytes()
    bad = bytearray(good)
    bad[place] ^= 0xFF
    for wrong in (bytes(bad), good[: len(good) // 2], b""):
        file.write_bytes(wrong)
        assert tension() == first
        assert file.read_bytes() == good  # as it was made before


def test_results_that_are_trees_come_back_as_they_were():
    def shown(run):
        return run(*given)

    given = MaxwellSlip.geometric(FrictionLimit(constant=1.0), elements=3), np.zeros(3), np.float64(1e-3)
    runs = [compile_function(_advanced, *given, engine="native") for _ in range(2)]
    native, again = map(shown, runs)
    assert type(native) is type(again) is type(_advanced(*given))
    for a, b in zip(native, again, strict=True):
        np.testing.assert_array_equal(a, b)


def _advanced(friction, state, displacement):
    return friction.advance(state, displacement, start_pressure=1e5, end_pressure=1e5)


def test_the_words_of_a_structure_are_understood_or_nothing_is_kept():
    import jax

    trees = [
        {"a": 1.0, "b": (2.0, [3.0, None])}, TENDON, held(np.zeros(3)),
        Value(1.0, 2.0),
    ]  # fmt: skip
    for tree in trees:
        said = programs._said(jax.tree.map(lambda _: 0.0, tree))  # noqa: SLF001
        assert jax.tree.structure(programs._built(json.loads(json.dumps(said)))) == jax.tree.structure(tree)  # noqa: SLF001
    with pytest.raises(TypeError):
        programs._said({"a": object()})  # noqa: SLF001


def test_two_processes_at_once_make_one_program(folder):
    program = (
        "import numpy as np\nfrom mckibben.engine.native import compile_function\n"
        "from mckibben.muscles.elements import Tendon\n"
        "t = Tendon(stiffness=1e5, toe_length=5e-4, loss=0.2)\n"
        "print(float(compile_function(Tendon.force, t, np.float64(1e-3), engine='native')(t, np.float64(1e-3))))"
    )
    both = [subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = {p.communicate()[0].strip() for p in both}
    assert [p.returncode for p in both] == [0, 0]
    assert sorted(p.suffix for p in folder.iterdir()) == [".o", ".program"]  # and no parts of files
    assert said == {str(float(tension()))}


def test_the_folder_is_bounded_and_what_was_used_last_stays(folder, monkeypatch):
    monkeypatch.setattr(cache, "LIMIT", 10_000)
    names = [f"{k:040x}.o" for k in range(12)]
    for k, name in enumerate(names):
        cache.store(name, bytes(1_000), {})
        os.utime(folder / name, (k, k))
        if k:
            assert cache.load(names[0]) is not None  # which is used all the time
            os.utime(folder / names[0], (1_000, 1_000))
    left = {p.name for p in folder.iterdir()}
    assert names[0] in left and names[-1] in left and names[1] not in left
    assert sum(p.stat().st_size for p in folder.iterdir()) <= cache.LIMIT


def test_what_others_put_there_and_what_is_being_written_stays(folder, monkeypatch):
    monkeypatch.setattr(cache, "LIMIT", 0)
    folder.mkdir()
    for name in ("notes.txt", "part-young", "part-old"):
        (folder / name).write_bytes(bytes(100))
    os.utime(folder / "part-old", (time.time() - 2 * cache.LEFT_BEHIND,) * 2)
    cache.store(f"{1:040x}.o", b"code", {})
    assert {p.name for p in folder.iterdir()} == {"notes.txt", "part-young"}


class Falling(System):
    """Stands for a system of the user's own, whose sources nobody watches."""

    gravity: Scalar

    def rate(self, state, memory, inputs):
        return {"v": self.gravity + inputs["push"].value}

    def integrands(self, state, memory, inputs):
        return {}

    def advance_memory(self, memory, start, end, duration):
        return memory

    def outputs(self, state, memory, inputs):
        return {"v": state["v"]}


def test_a_run_of_a_type_that_is_not_the_packages_own_is_right_and_kept_by_nobody(folder, lowered):
    signals = {"push": held(np.zeros(11))}
    for gravity in (1.0, 2.0):
        system, state = Falling(gravity=np.float64(gravity)), {"v": np.float64(0.0)}
        run = compile_march(system, state, (), signals, period=1e-3, inner=2, engine="native")
        # 10 samples of 1 ms at a constant rate: exact to rounding
        assert run(system, state, (), signals)["v"][-1] == pytest.approx(0.01 * gravity, rel=1e-13)
    assert len(lowered) == 2
    assert not list(folder.glob("*.program"))


def forged(file, **changes):
    """Change what a kept file says, and make its checksum anew, as anyone can who may write it."""
    whole = file.read_bytes()
    size = int.from_bytes(whole[32:40], "little")
    head = json.dumps(json.loads(whole[40 : 40 + size]) | changes).encode()
    whole = len(head).to_bytes(8, "little") + head + whole[40 + size :]
    file.write_bytes(hashlib.sha256(whole).digest() + whole)


FORGED = {
    "a function of the system": {"named": "os:system", "parts": ["echo"]},
    "a function that is built in": {"named": "builtins:exec", "parts": ["called.append(1)"]},
    "a type of another package": {"named": "subprocess:Popen", "parts": ["echo"]},
    "a module that is not loaded": {"named": "antigravity:fly", "parts": []},
    "a function of the package": {"named": "mckibben.documents:write_text", "parts": ["forged.txt", "text"]},
    "another package through this one": {"named": "mckibben.documents:os.system", "parts": ["echo"]},
    "a method of the package's type": {"module": "mckibben.muscles.elements:Tendon.force", "fields": []},
    "a module of the package that is not loaded": {"named": "mckibben.cli.not_there:Found", "parts": []},
    "a type that is no tree": {"module": "mckibben.errors:InputError", "fields": []},
    "a tree with other fields": {"module": "mckibben.muscles.elements:Tendon", "fields": [["__class__", 1.0]]},
    "a tuple of another length": {"named": "mckibben.engine.signals:Value", "parts": [0.0]},
    "more results than there are": {"tuple": [0.0, 0.0]},
    "a tree without an end": json.loads("[" * 900 + "]" * 900),
    "no words at all": {"named": 1.0},
}


@pytest.mark.parametrize("tree", FORGED.values(), ids=FORGED)
def test_a_kept_program_calls_nothing_that_it_names(folder, lowered, monkeypatch, tmp_path, tree):
    calls = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os, "system", calls.append)
    monkeypatch.setattr(subprocess, "Popen", calls.append)
    first = tension()
    (file,) = folder.glob("*.program")
    good = file.read_bytes()
    forged(file, tree=tree)
    assert tension() == first and len(lowered) == 2  # found out, and made anew
    assert calls == [] and "antigravity" not in sys.modules and os.listdir(tmp_path) == [folder.name]
    assert file.read_bytes() == good


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="folders have no such permissions there")
@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777])
def test_a_folder_that_others_can_write_is_not_used_and_that_is_said_once(folder, lowered, mode):
    first = tension()
    names = sorted(p.name for p in folder.iterdir())
    for file in folder.iterdir():
        file.unlink()
    folder.chmod(mode)
    with pytest.warns(CacheWarning, match=rf"cache folder {folder} is not used.*MCKIBBEN_KERNELS") as said:
        assert tension() == first
        assert tension() == first
    assert len(said) == 1 and not list(folder.iterdir()) and len(lowered) == 3
    folder.chmod(0o700)
    assert tension() == first and sorted(p.name for p in folder.iterdir()) == names


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="files have no such permissions there")
def test_a_file_that_others_can_write_is_made_anew(folder, lowered):
    first = tension()
    for file in folder.iterdir():
        file.chmod(0o622)
    assert tension() == first and len(lowered) == 2
    assert {stat.S_IMODE(p.stat().st_mode) for p in folder.iterdir()} == {0o600}


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="folders have no such owners there")
def test_what_another_user_owns_is_not_ours(tmp_path, monkeypatch):
    place = tmp_path / "k"
    assert is_private(place)  # where there is nothing yet
    place.mkdir(mode=0o700)
    about = place.stat()
    for owner, ours in ((os.geteuid(), True), (0, True), (os.geteuid() + 1, False)):
        changed = os.stat_result((about.st_mode, *about[1:4], owner, *about[5:10]))
        monkeypatch.setattr(os, "stat", lambda _, changed=changed: changed)
        assert is_private(place) == ours
        monkeypatch.undo()


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="folders have no such permissions there")
def test_folders_are_made_for_their_user_alone(tmp_path, monkeypatch):
    before = os.umask(0)
    try:
        monkeypatch.setenv("MCKIBBEN_KERNELS", str(tmp_path / "a" / "b"))
        cache.store(f"{1:040x}.o", b"code", {})
        monkeypatch.delenv("MCKIBBEN_KERNELS")
        monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
        monkeypatch.delitem(sys.modules, "jax")  # as in a process that begins
        for home in ("c", "d"):
            monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / home))
            keep_compilations()
            assert os.environ.pop("JAX_COMPILATION_CACHE_DIR") == str(tmp_path / home / "mckibben" / "compiled")
        made = [p for p in tmp_path.rglob("*") if p.is_dir()]
        assert len(made) == 8 and {stat.S_IMODE(p.stat().st_mode) for p in made} == {0o700}
        (tmp_path / "d" / "mckibben" / "compiled").chmod(0o777)
        with pytest.warns(CacheWarning, match=r"compiled is not used.*JAX_COMPILATION_CACHE_DIR"):
            keep_compilations()
        assert "JAX_COMPILATION_CACHE_DIR" not in os.environ
    finally:
        os.umask(before)
