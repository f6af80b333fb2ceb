"""A disk that is full: one sentence that names the file, and nothing half written beside it, for every kind of file.

Instead of a full disk, which only an administrator can make, the system limits how long a file may be: a write then
fails after the first bytes, as it does there (EFBIG for ENOSPC).
"""

import contextlib
import gc
import json
import os
import re
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from test_broken_input import POSTERIOR

from lanewise import ArgumentError, Program, cache
from mckibben.bench.run import prepare, run
from mckibben.cli import _outputs, main
from mckibben.documents import ErrorKeepingFile, write_whole
from mckibben.engine import native  # noqa: F401 - its programs are kept where the environment variable says
from mckibben.errors import InputError
from mckibben.formats.live_log import LiveLog
from mckibben.recordings import Channel, Recording, read_recording
from mckibben.recordings.tables import write_table

ROOT = Path(__file__).parents[2]
resource = pytest.importorskip("resource", reason="Windows has no such limit")

TIME = 1e-3 * np.arange(2_000)
CHANNELS = {
    "pressure": Channel(1e5 * (1.0 + np.sin(TIME)), "Pa", "measured"),
    "tension": Channel(10.0 + np.cos(TIME), "N", "measured"),
    "length": Channel(0.15 + 0.01 * np.sin(TIME), "m", "measured"),
}


@contextlib.contextmanager
def room(size):
    """No file may become longer than that [B]."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def record(tmp_path):
    """A recording, outside of the folder that is full."""
    return Recording(TIME, CHANNELS, {"title": "t"}).save(tmp_path / "r.nc")


@pytest.fixture
def full(tmp_path):
    folder = tmp_path / "full"
    folder.mkdir()
    return folder


@pytest.fixture
def said(capsys, full, monkeypatch):
    """What a command says that has no room, and that nothing is left of it."""
    monkeypatch.setenv("MCKIBBEN_KERNELS", str(full / "kernels"))

    def call(*words, size=300):
        with room(size), pytest.raises(SystemExit) as stop:
            main([str(w) for w in words])
        out, err = capsys.readouterr()
        assert (stop.value.code, err.count("\n")) == (2, 1), err
        assert [p for p in full.rglob("*") if not p.is_dir()] == []
        return err

    return call


@pytest.mark.parametrize("size", [0, 300, 5_000, 20_000])
@pytest.mark.parametrize("ending", ["nc", "csv", "mcap", "mat", "tdms", "parquet"])
def test_a_recording_is_written_whole_or_not_at_all(said, record, full, ending, size):
    err = said("record", "convert", record, full / f"r.{ending}", size=size)
    assert f"'{full / f'r.{ending}'}': it cannot be written (File too large)" in err


@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("size", [0, 300, 2_000])
@pytest.mark.parametrize("ending", ["csv", "json", "xlsx", "parquet"])
def test_a_table_is_written_whole_or_not_at_all(full, capfd, ending, size):
    columns = {"length": np.random.default_rng(0).standard_normal(2_000), "name": ["word"] * 2_000}
    with room(size), pytest.raises(InputError, match=r"t\.\w+': it cannot be written \(File too large\)"):
        write_table(columns, full / f"t.{ending}", units={"length": "m"})
    gc.collect()
    assert os.listdir(full) == [] and capfd.readouterr() == ("", "")


@pytest.mark.parametrize("ending", ["svg", "png", "pdf"])
def test_a_figure_is_written_whole_or_not_at_all(said, record, full, ending):
    err = said("record", "plot", record, "--out", full / f"f.{ending}")
    assert f"f.{ending}': it cannot be written (File too large)" in err


def test_a_report_is_written_whole_or_not_at_all(said, record, full):
    assert "r.html': it cannot be written (File too large)" in said(
        "record", "report", record, "--out", full / "r.html"
    )


@pytest.mark.parametrize("ending", ["toml", "json", "csv"])
def test_the_next_experiment_is_written_whole_or_not_at_all(said, full, tmp_path, ending):
    fit = tmp_path / "fit.json"
    fit.write_text(json.dumps({"fits": [{"law": "gas_spring", "posterior": POSTERIOR}]}))
    err = said("next", "--from", fit, "--budget", "30 s", "--out", full / f"next.{ending}", size=40)
    assert f"next.{ending}': it cannot be written (File too large)" in err


def test_a_characterisation_without_room_moves_nothing(said, full):
    words = "characterise --muscle nylon --rig modern --max-pressure".split()
    err = said(*words, "5 bar", "--out", full / "muscle", "--json", size=40)
    assert "characterisation.json': it cannot be written (File too large)" in err


def test_files_are_written_through_the_two_functions_that_leave_no_half():
    """Every other place that writes itself is known here, with the reason."""
    folders = [ROOT / "src" / "mckibben", *ROOT.glob("packages/mckibben-*/src/*")]
    writing = re.compile(
        r"\.write_(bytes|text|parquet)\(|savefig\(|savemat\(|to_(netcdf|csv)\(|\b(?:open|fdopen)\([^)\n]*[\"'](?:[wax]b?\+?|ab|r\+b?)[\"']"
    )
    found = set()
    for path, root in {file: folder for folder in folders for file in folder.rglob("*.py")}.items():
        for line in path.read_text(encoding="utf-8").splitlines():
            if writing.search(line) and not re.search(
                r"write_whole\(|documents\.write_text\(|\(part\b|\bpart\.|stream", line
            ):
                found.add(str(path.relative_to(root)))
    assert found == {
        "cli/_command.py",  # standard input, into a folder that goes with the call
        "cli/_terminal.py",  # into nowhere
        "cli/console.py",  # the history of what was typed
        "fmi_export.py",  # what the compiler reads, into a temporary folder
        "analysis/description.py",  # examples of docstrings
        "recordings/files.py",  # the same
        "recordings/force_map.py",  # the same
        "documents.py",
        "formats/live_log.py",  # a log keeps what it has
        "formats/exchange.py",  # called by write_whole
        "web/bench/chosen.py",  # onto a shelf, which writes whole files
        "web/pages/circuit/__init__.py",  # the same
        "page/jobs.py",  # into memory
        "batch/store.py",  # into a draft of the whole store, which is renamed
        "calibrate/verbs.py",  # examples of docstrings
        "web/server.py",  # what opens the browser: a file of the session's own
    }


def test_a_sweep_that_cannot_begin_leaves_no_folder(said, full, tmp_path):
    (tmp_path / "short.toml").write_text(
        'schema = 1\nname = "short"\nsample_rate = "1 kHz"\n[parameters.high]\nunit = "Pa"\nvalue = "3 bar"\n'
        '[[steps]]\nlabel = "high"\nspan = "1 L0"\npressure = "$high"\nfor = "0.1 s"\n'
    )
    file = tmp_path / "sweep.toml"
    file.write_text(
        'schema = 1\nprotocol = "short.toml"\nmuscle = "nylon"\n[grid]\nhigh = ["1 bar", "2 bar"]\n'
        '[outputs.peak]\nchannel = "tension"\nreduce = "max"\n'
    )
    err = said("sweep", file, "--out", full / "out", "--scheduler", "serial")
    assert "the disk is full (File too large); nothing was run" in err
    assert not (full / "out").exists()


def test_a_log_without_a_head_is_none_and_one_that_was_cut_off_keeps_what_it_has(full):
    with room(300), pytest.raises(InputError, match=r"cannot be written \(File too large\)"):
        LiveLog(full / "r.mcap", CHANNELS)
    assert os.listdir(full) == []
    table = np.stack([c.values for c in CHANNELS.values()], axis=1)
    with room(20_000):
        log = LiveLog(full / "r.mcap", CHANNELS, sync=None)
        with pytest.raises(InputError, match=r"cannot be written \(File too large\)"):
            for at in range(0, len(TIME), 100):
                log.append(TIME[at : at + 100], table[at : at + 100])
        with pytest.raises(InputError, match=r"cannot be written \(File too large\)"):
            log.close("done", "")
    kept = read_recording(full / "r.mcap")
    assert 100 <= len(kept) < len(TIME)
    np.testing.assert_array_equal(kept["pressure"], CHANNELS["pressure"].values[: len(kept)])


SHORT = """schema = 1
name = "short"
[[steps]]
label = "up"
pressure = { to = "2 bar", in = "0.2 s" }
[[steps]]
label = "hold"
for = "1.8 s"
"""


@pytest.mark.parametrize("real_time", [False, True])
def test_a_run_whose_log_is_full_vents_and_keeps_its_samples(full, tmp_path, real_time):
    (tmp_path / "short.toml").write_text(SHORT)
    prepared = prepare(str(tmp_path / "short.toml"), muscle="nylon", rig="modern")
    whole = run(prepared)
    with room(60_000):
        record = run(prepared, log=full / "r.mcap", real_time=real_time)
    message = record.meta["message"]
    assert record.meta["result"] == "stopped" and record.meta["events"][-1]["code"] == "log"
    assert "the log r.mcap cannot be written: it cannot be written (File too large); stopped and vented" in message
    assert len(read_recording(full / "r.mcap")) >= 50  # what the log has is good: what was brought out once, or more
    if real_time:  # it is vented, and that is in the recording
        command = record["valve.command"]
        assert command[-1] == 0.0 < command.max() and len(record) < len(whole)
    for name in ("muscle.pressure", "muscle.tension"):  # of the samples before the stop none is lost
        same = record[name][:100] == whole[name][:100]
        assert same.all()


@pytest.mark.parametrize(("names", "copied"), [(["full/a.nc", "b.nc"], []), (["full/a.nc"], ["a.nc"])])
def test_a_copy_is_written_elsewhere_only_where_no_file_was(tmp_path, names, copied):
    def write(path):
        if path.parent.name == "full":
            raise InputError("file", str(path), "it cannot be written (No space left on device)")
        path.touch()

    (tmp_path / "other").mkdir()
    files = _outputs.OutputFiles({"recording": [tmp_path / name for name in names]}, None)
    kept = tmp_path / ("other/a.nc" if copied else "b.nc")
    with pytest.raises(InputError, match=f"No space left .*; kept: {re.escape(str(kept))}"):
        files.write("recording", write, elsewhere=tmp_path / "other")
    assert [path.name for path in (tmp_path / "other").iterdir()] == copied


def test_a_run_without_room_for_its_recording_writes_a_copy_where_there_is_some(full, tmp_path, monkeypatch, capsys):
    (tmp_path / "short.toml").write_text(SHORT)
    (tmp_path / "room").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "room"))
    write = _outputs.write_recording

    def cannot(recording, path):
        if path.parent == full:
            raise InputError("file", str(path), "it cannot be written (No space left on device)")
        write(recording, path)

    monkeypatch.setattr("mckibben.cli.verb_commands.write_recording", cannot)
    words = ["run", str(tmp_path / "short.toml"), "--muscle", "nylon", "--rig", "modern", "--out", str(full / "r.nc")]
    for more, kept in (["--log", str(tmp_path / "r.mcap")], "room/r.nc"), (["--out", str(tmp_path / "s.nc")], "s.nc"):
        with pytest.raises(SystemExit) as stop:
            main([*words, *more])
        err = capsys.readouterr().err
        assert stop.value.code == 2
        assert f"it cannot be written (No space left on device); kept: {tmp_path / kept}" in err
        assert read_recording(tmp_path / kept).meta["result"] == "done"


def test_a_cache_without_room_keeps_nothing_and_says_nothing(full, monkeypatch):
    monkeypatch.setenv("MCKIBBEN_KERNELS", str(full))
    with room(300):
        cache.store(f"{1:040x}.o", bytes(1_000), {})
    assert os.listdir(full) == []
    assert cache.load_or_make(f"{1:040x}.o", lambda: (b"code", {})) == (b"code", {})


def test_a_saved_program_is_written_whole_or_not_at_all(full):
    program = Program(None, [], [])
    program.serialised = bytes(1_000)
    with room(300), pytest.raises(ArgumentError, match=r"a.kernel cannot be written \(File too large\)"):
        program.save(full / "a.kernel")
    assert os.listdir(full) == []


def test_compilations_are_not_kept_on_a_full_disk(full, monkeypatch):
    from mckibben.cli import app

    monkeypatch.delitem(sys.modules, "jax", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(full))
    for least, kept in ((1 << 80, False), (0, True)):
        monkeypatch.setattr(app, "ROOM", least)
        monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
        app._keep_compilations()  # noqa: SLF001
        assert ("JAX_COMPILATION_CACHE_DIR" in os.environ) == kept


def test_a_file_that_keeps_its_error_is_like_any_other_until_then(full):
    with ErrorKeepingFile(full / "a") as file:
        for size in (5, 0, 3):
            assert file.write(bytes(range(size))) == size
        assert file.tell() == 8 and file.seek(-3, os.SEEK_END) == 5
        found = bytearray(9)
        assert file.readinto(found) == 3 and found == bytes([0, 1, 2, *bytes(6)])
        assert file.seek(20) == 20 and file.write(b"end") == 3  # a gap holds zeros
        assert file.truncate(22) == 22
    assert (full / "a").read_bytes() == bytes([0, 1, 2, 3, 4, 0, 1, 2, *bytes(12)]) + b"en"
    with room(10), pytest.raises(InputError, match="cannot be written"):
        write_whole(full / "b", lambda part: keep_on(part))
    assert os.listdir(full) == ["a"]


def keep_on(part):
    """As a library that looks at no error, reads again what it wrote, and fails because of that."""
    with ErrorKeepingFile(part) as file:
        assert file.write(bytes(100)) == 100 and file.tell() == 100
        file.seek(0)
        assert file.readinto(bytearray(100)) == 100
        raise RuntimeError("cannot understand what is there")
