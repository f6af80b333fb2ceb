"""The public names: what hangs on `import mckibben`."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import mckibben
from mckibben._lazy import public_names

# Libraries that take longer to load than `import mckibben` may: all of them wait until they are used.
HEAVY = ("jax", "matplotlib", "numpy", "pint", "scipy", "tomlkit", "typer", "xarray", "mckibben.registry")


OWN = [name for name, source in mckibben._SOURCES.items() if not source.startswith("[")]


@pytest.mark.parametrize("name", OWN)
def test_a_public_name_is_the_object_of_its_module(name):
    module, _, attribute = mckibben._SOURCES[name].partition(":")
    assert getattr(mckibben, name) is getattr(importlib.import_module(module, "mckibben"), attribute)


ROOMS = [
    mckibben,
    *(importlib.import_module(f"mckibben.{room}") for room in ("recordings", "identification", "muscles")),
]


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.__name__)
def test_type_checkers_read_the_same_names_as_those_that_are_loaded(room):
    tree = ast.parse(Path(room.__file__).read_text(encoding="utf-8"))
    (guarded,) = (node for node in tree.body if isinstance(node, ast.If))
    imported = {
        name.asname for node in guarded.body if isinstance(node, ast.ImportFrom) and node.module for name in node.names
    }
    assert imported <= public_names(room.__name__).keys() & {*room.__all__}


def test_every_public_name_has_its_subject_and_its_place():
    assert sorted(name for group in mckibben.PUBLIC.values() for name in group) == sorted(mckibben._SOURCES)


def test_completion_lists_the_public_names_and_others_are_refused():
    assert set(dir(mckibben)) == {"__version__", *mckibben._SOURCES}
    with pytest.raises(AttributeError, match="no attribute 'tension'"):
        _ = mckibben.tension


def test_the_import_loads_no_heavy_library():
    code = f"import mckibben, sys; print(*[name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_package_that_is_installed_by_itself_hangs_on_the_same_name():
    import mckibben_benchmark
    import mckibben_hardware
    import mckibben_hosts
    import mckibben_papers
    from mckibben import benchmark, hardware, hosts, papers, reproduce

    session = importlib.import_module("mckibben_hardware.calibrate.session")
    assert mckibben.hardware is hardware is mckibben_hardware
    assert hardware.CalibrationSession is session.CalibrationSession
    assert mckibben.benchmark is benchmark is mckibben_benchmark.benchmark
    assert mckibben.papers is papers is mckibben_papers and reproduce is mckibben_papers.reproduce

    assert (
        mckibben.hosts is hosts is mckibben_hosts and hosts.Part is importlib.import_module("mckibben_hosts.part").Part
    )
