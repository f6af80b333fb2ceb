"""Blocks on several processes: every one is done and given back once, whatever becomes of the workers."""

import contextlib
import multiprocessing
import os
import signal
import time
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from mckibben.batch import Variants, drive
from mckibben.batch.drive import ATTEMPTS, VariantBlock, Workers
from mckibben.batch.run import Results
from mckibben.errors import ConvergenceError, InputError


class Counting(NamedTuple):
    """Work that leaves a mark for every block begun; one of its blocks kills its worker the first times."""

    folder: str
    deadly: int = -1
    times: int = 0

    @property
    def name(self):
        return "counting"

    def run(self, block, tell=lambda _: None):
        first = block.part.start
        begun = len(list(Path(self.folder).glob(f"{first}-*")))
        (Path(self.folder) / f"{first}-{begun}-{os.getpid()}").touch()
        if first == self.deadly and begun < self.times:
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(0.02)
        values = block.variants.columns["x"]
        return Results(np.zeros(len(values), np.int8), ["done"] * len(values), values * 0.0, {"twice": 2.0 * values})


def blocks(count, size):
    values = np.arange(float(count))
    return [
        VariantBlock(slice(i, min(i + size, count)), Variants({"x": values[i : i + size]}))
        for i in range(0, count, size)
    ]


def gathered(way, work, parts, workers=2):
    found = []
    with Workers(way, workers).open() as team:
        for block, results in team.run(work, parts, lambda _: None):
            np.testing.assert_array_equal(results.outputs["twice"], 2.0 * block.variants.columns["x"])
            found.append(block.part.start)
    return found


@pytest.mark.parametrize("way", ["serial", "processes", "dask"])
def test_every_block_is_given_back_once(way, tmp_path):
    parts = blocks(23, 5)
    found = gathered(way, Counting(str(tmp_path)), parts)
    assert sorted(found) == [b.part.start for b in parts]
    assert len(list(tmp_path.iterdir())) == len(parts)  # and begun once


@pytest.mark.parametrize("way", ["processes", "dask"])
def test_a_killed_worker_loses_no_block_and_gives_none_twice(way, tmp_path):
    parts = blocks(23, 5)
    found = gathered(way, Counting(str(tmp_path), deadly=10, times=1), parts)
    assert sorted(found) == [b.part.start for b in parts]
    assert len(list(tmp_path.glob("10-*"))) >= 2  # it was killed, and done again


@pytest.mark.parametrize("way", ["processes", pytest.param("dask", marks=pytest.mark.slow)])
def test_a_block_that_kills_every_worker_is_named_at_last(way, tmp_path, monkeypatch):
    monkeypatch.setattr("mckibben.batch.drive.GATHERED", 20.0)
    with pytest.raises(ConvergenceError, match=f"variants .* died, {ATTEMPTS} times"):
        gathered(way, Counting(str(tmp_path), deadly=10, times=99), blocks(15, 5), workers=1)
    # a worker that dies takes the blocks in its queue with it, so another block may be blamed one time earlier
    assert ATTEMPTS - 1 <= len(list(tmp_path.glob("10-*"))) <= ATTEMPTS


def test_workers_end_with_their_team(tmp_path):
    gathered("processes", Counting(str(tmp_path)), blocks(4, 2))
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize(
    ("way", "count", "said"), [("cluster", 1, "dask, processes or serial"), ("dask", -1, "above 0")]
)
def test_an_unknown_way_is_refused(way, count, said):
    with pytest.raises(InputError, match=said):
        Workers(way, count)


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    monkeypatch.setattr("mckibben.batch.drive.PATIENCE", 1.0)
    with pytest.raises(InputError, match="tcp://127.0.0.1:9': no Dask scheduler answered"):
        with Workers("tcp://127.0.0.1:9").open():
            pass


def test_a_team_is_of_the_way_that_was_chosen_and_of_so_many_workers(monkeypatch):
    asked = []

    @contextlib.contextmanager
    def client(way, count):
        asked.append((way, count))
        yield SimpleNamespace(scheduler_info=lambda n_workers: {"workers": {"a": 1, "b": 2, "c": 3}})

    monkeypatch.setattr(drive, "_client", client)
    for way, count, kind, size in (
        ("serial", 5, drive.SerialTeam, 1), ("processes", 3, drive.ProcessTeam, 3), ("processes", 0, drive.ProcessTeam, 7),
        ("dask", 3, drive.DaskTeam, 3), ("tcp://a:1", 2, drive.DaskTeam, 3),
    ):  # fmt: skip
        monkeypatch.setattr(drive, "cores", lambda: 7)
        with Workers(way, count).open() as team:
            assert (type(team), team.size) == (kind, size)
    assert asked == [("dask", 3), ("tcp://a:1", 2)]
    for way, needs in (("serial", False), ("processes", False), ("dask", True), ("tcp://a:1", True)):
        looked = []
        monkeypatch.setattr(drive, "_dask_libraries", lambda looked=looked: looked.append(1))
        Workers(way).check_libraries()
        assert bool(looked) == needs
    with pytest.raises(InputError, match="must be a whole number above 0"):
        Workers("serial", -1)
