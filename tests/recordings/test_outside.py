"""Damaged archives: one clear line or what is left of them, and never a process that crashes or hangs."""

import os
import random
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray

import mckibben
from mckibben import isolation
from mckibben.errors import InputError
from mckibben.formats import store
from mckibben.formats.exchange import read_matlab
from mckibben.formats.store import BROKEN_SEAL
from mckibben.recordings import Channel, Recording, read_recording

TIME = np.arange(500) * 1e-3
RECORDING = Recording(
    TIME,
    {"pressure": Channel(1e5 * np.sin(TIME), "Pa", "measured", "p"), "tension": Channel(np.cos(TIME), "N", "true")},
    {"title": "t", "warnings": ["one"]},
)


def sleeps(path):
    time.sleep(600.0)


def dies(path):
    os._exit(3)


def complains(path, words, count, ends):
    os.write(2, words.encode() * count)
    if ends:
        os._exit(3)


@pytest.fixture
def archive(tmp_path):
    return RECORDING.save(tmp_path / "r.nc")


def test_a_sealed_archive_is_read_by_other_programs_too(archive):
    assert store.sealed(archive) is True
    assert read_recording(archive) == RECORDING
    assert xarray.open_dataset(archive, engine="h5netcdf").sizes["time"] == len(RECORDING)


def test_without_its_seal_it_is_read_the_same(archive):
    data = archive.read_bytes()
    archive.write_bytes(data[: -len(store.SEAL) - store.SEAL_DIGEST])
    assert store.sealed(archive) is None
    assert read_recording(archive) == RECORDING


def test_a_changed_archive_says_that_it_was_changed(archive):
    data = bytearray(archive.read_bytes())
    place = bytes(data).index(np.float64(RECORDING["tension"][77]).tobytes())
    data[place] ^= 1
    archive.write_bytes(data)
    found = read_recording(archive)
    assert found.meta["warnings"] == ["one", BROKEN_SEAL] and found["tension"][77] != RECORDING["tension"][77]


def test_a_seal_is_whole_for_the_bytes_that_it_was_put_on_and_for_no_others(archive):
    data = archive.read_bytes()
    body, end = len(data) - len(store.SEAL) - store.SEAL_DIGEST, len(store.SEAL)
    for place in (0, body // 2, body - 1, len(data) - 1, body + end):  # of the content, and of the digest
        changed = bytearray(data)
        changed[place] ^= 0x80
        archive.write_bytes(changed)
        assert store.sealed(archive) is False, place
    for other, known in (
        (data[:body], None), (data + b"\0", None), (data[1:], False), (b"\0" + data, False), (b"", None),
        (data[body:], False),
        (data[: body - 1] + data[body:], False), (data, True),
    ):  # fmt: skip
        archive.write_bytes(other)
        assert store.sealed(archive) is known


@pytest.mark.parametrize("seed", range(6))
def test_bytes_changed_at_random_never_crash_or_hang(archive, seed):
    """More seeds by hand: of 25, all ended within 4 s."""
    rng, data = random.Random(seed), bytearray(archive.read_bytes())
    for _ in range(rng.choice([1, 5, 50])):
        data[rng.randrange(len(data) if seed % 2 else 2000)] = rng.randrange(256)
    archive.write_bytes(data)
    try:
        assert BROKEN_SEAL in read_recording(archive).meta["warnings"] or store.sealed(archive) is None
    except InputError as error:
        assert "r.nc" in str(error) and "\n" not in str(error)


@pytest.fixture
def fresh(monkeypatch):
    """A process that finds the functions of this file."""
    isolation.close()
    monkeypatch.setenv(
        "PYTHONPATH", os.pathsep.join((str(Path(mckibben.__file__).parents[1]), str(Path(__file__).parent)))
    )
    yield
    isolation.close()


def test_a_reader_that_hangs_is_ended(archive, monkeypatch, fresh):
    monkeypatch.setenv(isolation.TIME, "1 s")
    with pytest.raises(InputError, match="did not come to an end within 1 s; .* MCKIBBEN_READ_TIME='4 s' allows more"):
        isolation.call_outside(sleeps, archive)


def test_a_reader_that_dies_takes_nothing_with_it(archive, fresh):
    with pytest.raises(InputError, match="the process that read it crashed"):
        isolation.call_outside(dies, archive)
    assert read_recording(archive) == RECORDING


def test_the_reason_of_an_end_is_what_was_said_last_and_of_this_file(archive, fresh):
    """A process reads one file after the other: what it said of an earlier one is no reason, nor does it hide one."""
    isolation.call_outside(complains, archive, "strange byte\n", 10_000, False)  # 130 kB
    with pytest.raises(InputError, match="takes more than"):
        isolation.call_outside(complains, archive, "memory allocation of 9 bytes failed\n", 1, True)
    isolation.call_outside(complains, archive, "memory allocation of 9 bytes failed\n", 1, False)
    with pytest.raises(InputError, match="the process that read it crashed"):
        isolation.call_outside(dies, archive)


def test_a_file_beside_the_data_is_not_taken_for_a_module(archive, monkeypatch):
    (archive.parent / "pickle.py").write_text("open('ran', 'w').close()\nraise SystemExit(1)\n")
    monkeypatch.chdir(archive.parent)
    archive.write_bytes(archive.read_bytes() + b"\n")
    isolation.close()  # another process begins here
    assert read_recording(archive) is not None
    assert not (archive.parent / "ran").exists()


def link_outside(file, other):
    file["linked"] = h5py.ExternalLink(other.name, "/numbers")


def raw_numbers_outside(file, other):
    file.create_dataset("raw", (2,), "f8", external=[(str(other), 0, 16)])


def virtual_outside(file, other):
    layout = h5py.VirtualLayout((2,), "f8")
    layout[:] = h5py.VirtualSource(other, "numbers", (2,))
    file.create_virtual_dataset("virtual", layout)


@pytest.mark.parametrize("put", [link_outside, raw_numbers_outside, virtual_outside])
@pytest.mark.parametrize("deep", [False, True])
def test_numbers_that_lie_in_another_file_are_refused(archive, tmp_path, put, deep):
    """HDF5 would read them from wherever the file says, as of somebody who has uploaded it."""
    other = tmp_path / "private.h5"
    with h5py.File(other, "w") as file:
        file["numbers"] = [1.0, 2.0]
    table = archive.with_suffix(".mat")  # version 7.3 is HDF5 behind 512 bytes
    for place, how in ((archive, {"mode": "r+"}), (table, {"mode": "w", "userblock_size": 512})):
        with h5py.File(place, **how) as file:
            put(file.require_group("a/b") if deep else file, other)
    with pytest.raises(InputError, match="r.nc.*in another file") as caught:
        read_recording(archive)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="r.mat.*in another file"):
        read_matlab(table)
