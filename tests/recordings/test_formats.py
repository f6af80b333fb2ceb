"""Formats of other packages are found by their entry points."""

import numpy as np
import pytest

from mckibben import registry
from mckibben.errors import InputError
from mckibben.formats.table import FileFormat, ForeignColumn, ForeignTable
from mckibben.recordings import read_any, read_force_map, write


def read_pairs(path):
    values = np.loadtxt(path, delimiter="|", ndmin=2)
    columns = [ForeignColumn("time", values[:, 0], "ms"), ForeignColumn("tank.pressure", values[:, 1], "kPa")]
    return ForeignTable(columns, {"program": "pairs"}, ["the header was left out"])


FORMAT = FileFormat(title="Files of pairs", read=read_pairs)


@pytest.fixture
def installed(monkeypatch):
    """Another package with a format for ``.pairs``."""
    monkeypatch.setattr(registry, "plugins", lambda group: {"pairs": FORMAT} if group == "mckibben.formats" else {})


def test_a_format_of_another_package_is_read_by_its_suffix(installed, tmp_path):
    (tmp_path / "a.pairs").write_text("0|100\n10|150\n20|200\n")
    found = read_any(tmp_path / "a.pairs")
    assert found.remarks == ["the header was left out"] and found.recording.meta["source"]["program"] == "pairs"
    assert np.allclose(found.recording["tank.pressure"], [1e5, 1.5e5, 2e5], rtol=1e-15)
    assert np.allclose(found.recording.time, [0.0, 0.01, 0.02], rtol=1e-15)
    with pytest.raises(InputError, match="the file has time .ms., tank.pressure"):  # its columns are those of any table
        read_force_map(tmp_path / "a.pairs")


def test_a_format_that_is_only_read_is_not_written(installed, tmp_path):
    (tmp_path / "a.pairs").write_text("0|100\n10|150\n")
    record = read_any(tmp_path / "a.pairs").recording
    with pytest.raises(InputError, match="[Kk]nown are .nc, .csv, .mcap"):
        write(record, tmp_path / "b.pairs")


def test_without_other_packages_an_unknown_suffix_is_refused(tmp_path):
    (tmp_path / "a.pairs").write_text("1")
    with pytest.raises(InputError, match="[Kk]nown are .nc, .csv"):
        read_any(tmp_path / "a.pairs")
