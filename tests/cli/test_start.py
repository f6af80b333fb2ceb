"""What a command loads before it computes: a person waits for that at every call."""

import subprocess
import sys
from pathlib import Path

import pytest

from mckibben.cli.app import COMMANDS
from mckibben.registry import PACKAGES

# Each of them takes a tenth to a whole second to load.
HEAVY = ("jax", "scipy", "pint", "matplotlib", "xarray", "pandas", "llvmlite", "h5py")
COMPUTING = ("mckibben.bench.hardware", "mckibben.identification.fit", "mckibben.muscles.law", "mckibben.report.blocks")


def loaded(code: str, modules: tuple[str, ...]) -> list[str]:
    """Those of some modules that a fresh process has loaded after some code."""
    report = f"import sys\n{code}\nprint([m for m in {modules!r} if m in sys.modules], file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", report], capture_output=True, text=True, check=True)
    return eval(done.stderr.splitlines()[-1])


def command(words: str) -> str:
    """Code that calls the command line."""
    return (
        "from mckibben.cli import main\n"
        f"try: main({words.split()!r})\n"
        "except SystemExit as end: assert not end.code, end.code"
    )


def test_the_help_of_no_command_loads_what_computes():
    # All modules in one process: what one of them loads, the others do not unload.
    places = sorted({place.partition(":")[0] for place, _ in COMMANDS.values() if place and place not in PACKAGES})
    code = "\n".join(["from mckibben import registry", *(f"import mckibben.cli.{place}" for place in places)])
    code += "\nregistry.plugins('mckibben.commands')"
    assert loaded(code, HEAVY + COMPUTING) == []


@pytest.mark.parametrize("words", ["show nylon", "muscles", "protocols isometric-step"])
def test_what_computes_nothing_loads_no_library_that_does(words):
    if words.startswith("show"):
        loaded(command(words), ())  # the kernels of its curves are kept from then on
    assert loaded(command(words), tuple(m for m in HEAVY if m != "llvmlite")) == []


def test_a_tension_needs_no_jax_once_its_kernel_is_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("MCKIBBEN_KERNELS", str(tmp_path / "kernels"))
    law = "import mckibben, mckibben.muscles as m\nm.law_from_specimen(mckibben.specimen('nylon')).tension(0.14, 5e5)"
    asked = ("tension nylon --length 14cm --pressure 5bar", "tension nylon --length 12cm --for 30N")
    both = "\n".join([law, *map(command, asked)])
    assert "jax" in loaded(both, HEAVY)  # nothing is kept yet
    assert loaded(both, tuple(m for m in HEAVY if m != "llvmlite")) == []


def test_runs_fits_and_cycles_need_no_jax_once_their_kernels_are_kept(tmp_path):
    tank = Path(__file__).parents[2] / "examples" / "circuits" / "filling-a-tank.toml"
    commands = (
        "run work-loop --muscle nylon",
        f"circuit run {tank} --out {tmp_path / 'tank.nc'}",
        "energy nylon --pressure 5bar",
        "fit DMSP-20-300 --law hyperelastic_braid",
    )
    # One process for all: what one of them loads, the others do not unload. The kernels are those of all tests.
    code = "\n".join(map(command, commands))
    assert "jax" not in loaded(code, ("jax",)) or "jax" not in loaded(
        code, ("jax",)
    )  # the first call may have to keep them
