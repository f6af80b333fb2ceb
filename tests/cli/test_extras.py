"""A library that comes with an extra is asked for before anything is computed, and one sentence says which extra."""

import html
import sys
from importlib import metadata
from pathlib import Path

import pytest

import mckibben
from loops import completed
from mckibben import registry
from mckibben.cli import main, record, serve, verb_commands  # noqa: F401  bound before anything is replaced
from mckibben.cli.app import COMMANDS
from mckibben.errors import InputError, MissingLibraryError
from mckibben.extras import library
from mckibben.studies import rig_run  # noqa: F401

SWEEP = str(Path(__file__).parents[2] / "examples" / "sweeps" / "tube-and-threshold.toml")
BENCH = ("run", "work-loop", "--muscle", "nylon", "--on")


def too_early(*args, **options):
    pytest.fail("it computed before it looked for the library")


@pytest.mark.parametrize(
    ("missing", "extra", "words", "work"),
    [
        ("serial", "serial", (*BENCH, "serial:/dev/ttyACM0"), "mckibben.studies.rig_run.prepare"),
        ("nidaqmx", "daq", (*BENCH, "daq"), "mckibben.studies.rig_run.prepare"),
        ("typst", "report", ("compare", "nylon", "--out", "a.pdf"), "mckibben.studies.comparison.side_by_side.subject"),
        ("typst", "report", ("fit", "DMSP-20-300", "--out", "a.pdf"), "mckibben.studies.fitting.fit_laws"),
        # a.nc is not there, which is what reading it would say first
        ("polars", "formats", ("record", "convert", "a.nc", "a.parquet"), "mckibben.recordings.read_recording"),
        ("zarr", "sweep", ("sweep", SWEEP, "--out", "a", "--scheduler", "serial"), "mckibben.batch.sweep.Sweep.check"),
        ("distributed", "sweep", ("sweep", SWEEP, "--out", "a"), "mckibben.batch.sweep.Sweep.check"),
        ("starlette", "web", ("serve", "--no-open"), "mckibben.bench.rig_file.rig"),
    ],
)  # fmt: skip
def test_a_missing_library_is_said_before_any_work(missing, extra, words, work, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(work, too_early)
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(SystemExit) as stop:
        main(list(words))
    out, err = capsys.readouterr()
    assert (stop.value.code, out, err.count("\n")) == (2, "", 1)
    assert f"which is not installed: pip install 'mckibben[{extra}]'" in err
    assert not list(tmp_path.iterdir())


@pytest.fixture
def bare(monkeypatch):
    """As if no distribution beside mckibben were installed."""

    def distribution(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", distribution)
    return monkeypatch


@pytest.mark.parametrize("package", registry.PACKAGES)
def test_a_package_that_announces_less_than_is_asked_for_is_of_another_version(package):
    with pytest.raises(InputError, match=rf"^this needs another version of {registry.PACKAGES[package]} than \d"):
        registry.announced("mckibben.commands", "nothing", package, "this needs")


@pytest.mark.parametrize(
    ("name", "package"), [(n, place) for n, (place, _) in COMMANDS.items() if place in registry.PACKAGES]
)
def test_a_command_of_a_package_that_is_not_installed_says_which_and_the_help_lists_it(name, package, bare, capsys):
    *group, last = name.split()
    with pytest.raises(SystemExit) as stop:
        main([*group, last, "nylon"])
    out, err = capsys.readouterr()
    assert (stop.value.code, out, err.count("\n")) == (2, "", 1)
    needs = f"mckibben {name} needs {registry.PACKAGES[package]}, which is not installed"
    assert f"{needs}: pip install 'mckibben[{package}]'" in err
    with pytest.raises(SystemExit) as stop:
        main([*group, "--help"])
    assert stop.value.code == 0 and f"\n  {last} " in capsys.readouterr().out


@pytest.mark.parametrize("name", registry.PACKAGES)
def test_a_name_of_a_package_that_is_not_installed_says_which(name, bare):
    bare.delitem(vars(mckibben), name, raising=False)
    needs = f"mckibben.{name} needs {registry.PACKAGES[name]}, which is not installed: pip install 'mckibben[{name}]'"
    says = f"{needs}, or in a copy of the repository pip install './packages/{registry.PACKAGES[name]}'"
    with pytest.raises(MissingLibraryError) as error:
        getattr(mckibben, name)
    assert str(error.value) == says


def test_a_page_of_a_package_that_is_not_installed_says_which_and_pages_that_show_what_is_printed_go_without(bare):
    pytest.importorskip("starlette")
    from mckibben.web import elements, server, widgets
    from mckibben.web.pages.compare.drawings import paper_values

    (page,) = (one for one in widgets.PAGES if one.extra)
    assert paper_values("nylon")["efficiency"] == 0.29
    bare.setattr(registry, "_entry_points", tuple)
    registry.plugins.cache_clear()
    try:
        assert paper_values("nylon") == {}
    finally:
        registry.plugins.cache_clear()

    async def shown() -> str:
        documents = elements.Documents()
        opened = documents.open()
        with opened.root:
            server._builder(page)(None, None)
        documents.close_all()
        return html.unescape(widgets.written(opened))

    says = "The page The paper needs mckibben-papers, which is not installed: pip install 'mckibben[papers]',"
    assert says in completed(shown())


def test_where_it_was_asked_for_stays_in_front_of_the_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(MissingLibraryError) as error:
        library("polars", "Parquet files need", where="a.parquet")
    says = "a.parquet: Parquet files need polars, which is not installed: pip install 'mckibben[formats]'"
    assert str(error.value) == says and str(error.value.at("batch")) == f"batch: {says}"
    assert isinstance(error.value, InputError)
