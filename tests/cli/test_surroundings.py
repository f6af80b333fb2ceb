"""What surrounds a command: the processes that it starts, and what is said beside its result."""

import os
import subprocess
import sys
import warnings

import pytest

from lanewise.errors import CacheWarning
from mckibben.cli import app, main


def test_processes_that_a_command_starts_take_no_module_from_the_working_folder(tmp_path, monkeypatch):
    """As of a folder of somebody's data, in which a file is named like a module that every process imports."""
    (tmp_path / "multiprocessing.py").write_text("print('taken')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    monkeypatch.setenv("PYTHONWARNINGS", "default")
    before, started = dict(os.environ), [sys.executable, "-c", "import multiprocessing"]
    said = []
    monkeypatch.setattr(
        app, "_execute", lambda *_: said.append(subprocess.run(started, capture_output=True, check=True).stdout)
    )
    with pytest.raises(SystemExit):
        main(["muscles"])
    assert said == [b""]
    assert dict(os.environ) == before
    assert subprocess.run(started, capture_output=True, check=True).stdout == b"taken\n"


def test_a_cache_that_is_not_used_is_said_in_one_line_and_others_as_python_says_them(capsys, monkeypatch):
    def warn(*_):
        warnings.warn(CacheWarning("/shared/kernels", "MCKIBBEN_KERNELS"), stacklevel=1)
        warnings.warn("Error reading persistent compilation cache entry for 'f'", UserWarning, stacklevel=1)
        warnings.warn("something else", UserWarning, stacklevel=1)
        return 0

    monkeypatch.setattr(app, "_execute", warn)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        with pytest.raises(SystemExit) as stop:
            main(["muscles"])
    out, err = capsys.readouterr()
    assert (stop.value.code, out) == (0, "")
    first, rest = err.split("\n", 1)
    assert first.startswith("mckibben: The cache folder /shared/kernels is not used") and "MCKIBBEN_KERNELS" in first
    assert "UserWarning: something else" in rest and "persistent" not in rest


def test_signs_that_move_a_terminals_cursor_are_shown_and_not_obeyed(capsys):
    with pytest.raises(SystemExit):
        main(["show", "a\x1b[2J\r\u202eb"])
    assert "'a\\x1b[2J\\r\\u202eb'" in capsys.readouterr().err
