"""Two processes that share the making of recordings: nothing is made twice, and what is read is what was made."""

import numpy as np
import pytest

from mckibben.recordings import Channel, Recording
from mckibben_papers import helped, reproduce
from mckibben_papers.reproduction import ElsewhereError, Folder


def small(value=1.0 / 3.0):
    time = np.arange(5) * 1e-3
    return Recording(time, {"pressure": Channel(np.full(5, value), "Pa")})


def never():
    raise AssertionError("made twice")


def test_what_one_process_made_the_other_reads_bit_for_bit(tmp_path):
    made = Folder(tmp_path).one("a", small)
    read = Folder(tmp_path, alive=lambda: True).one("a", never)
    assert read.channels == made.channels and np.array_equal(read.time, made.time)


def test_what_the_first_process_has_begun_the_helper_leaves(tmp_path):
    first, helper = Folder(tmp_path, alive=lambda: True), Folder(tmp_path)

    def meanwhile():
        with pytest.raises(ElsewhereError):
            helper.one("a", never)
        return small()

    assert first.one("a", meanwhile).channels == small().channels


def test_a_helper_that_died_leaves_its_recording_to_the_first_process(tmp_path):
    def killed():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Folder(tmp_path).one("a", killed)
    assert Folder(tmp_path, alive=lambda: False).one("a", small).channels == small().channels


@pytest.mark.slow
def test_rows_are_the_same_with_and_without_a_helper():
    with helped(["isotonic"]):
        together = reproduce(rows=["isotonic"])
    from mckibben_papers.reproduction import recording

    recording.cache_clear()
    assert together == reproduce(rows=["isotonic"])
