"""Large files are read in a process of their own, which can be stopped; and what is drawn or stored of files is bounded."""

import multiprocessing
import os
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from screen_readers import cells, die, read_for_ever, refuse, who

from mckibben import isolation
from mckibben.bench.rig_file import rig
from mckibben.errors import InputError, MckibbenError
from mckibben.experiments.dry_run import check_lengths
from mckibben.experiments.read import protocol_names, shipped, with_values
from mckibben.web.pages.compare import drawings
from mckibben.web.reader import ReaderProcess, ReadingStopped, check_rows
from mckibben.web.shelf import Shelf, plain_name
from mckibben.web.stream import of_cycle

PAPER = rig("paper").limits("direct")


@pytest.fixture
def stuck(tmp_path):
    """A file whose reader never comes to an end: a pipe into which nobody writes."""
    path = tmp_path / "stuck.csv"
    os.mkfifo(path)
    return path


def test_another_process_reads_and_its_answer_and_its_refusal_come_whole(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("a,b\n")
    process, text, words = ReaderProcess(who, path, "more").result()
    assert process != os.getpid() and (text, words) == ("a,b\n", "more")
    with pytest.raises(InputError, match="table.csv: row 3 must be a number, got 'x'") as refused:
        ReaderProcess(refuse, path).result()
    assert refused.value.field == "row 3"
    with pytest.raises(InputError, match="ended before it was done"):
        ReaderProcess(die, path).result()
    assert not multiprocessing.active_children()


def test_a_reader_is_stopped_by_a_person_and_by_its_patience(stuck, monkeypatch):
    one, told = ReaderProcess(read_for_ever, stuck), []

    def wait():
        try:
            one.result()
        except MckibbenError as error:
            told.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    other = ReaderProcess(read_for_ever, stuck)  # waits for the first one, and is stopped meanwhile
    other.stop()
    with pytest.raises(ReadingStopped):
        other.result()
    one.stop()
    thread.join(20.0)
    assert isinstance(told[0], ReadingStopped)
    monkeypatch.setenv(isolation.TIME, "0.5 s")
    with pytest.raises(InputError, match="did not come to an end within 0 s"):
        ReaderProcess(read_for_ever, stuck).result()
    assert not multiprocessing.active_children()


def test_a_file_with_more_rows_than_are_taken_is_refused_by_their_number(tmp_path):
    path = tmp_path / "long.csv"
    path.write_text("length_mm\n" + "1\n" * 99)
    check_rows(path, 100, "a fit")
    with pytest.raises(MckibbenError, match="The file has 100 lines; a fit takes up to 30. Keep one in 4 of them"):
        check_rows(path, 30, "a fit")


@pytest.mark.parametrize(
    ("given", "name"),
    [("Kra\u0308fte.csv", "Kr\u00e4fte.csv"), ("\u529b.csv", "\u529b.csv"), ("map [2] & more.csv", "map -2- - more.csv"),
     ("..hidden..csv", "hidden.csv"), ("\u00e4" * 300 + ".csv", None)],
)  # fmt: skip
def test_the_name_of_any_file_becomes_one_that_a_shelf_takes(tmp_path, given, name):
    shelf = Shelf(tmp_path, (".csv",))
    found = plain_name(given)
    assert shelf.store(found, b"1").name == found and shelf.names() == [found]
    assert name is None or found == name


def test_a_length_beyond_the_longest_span_of_the_rig_is_refused_and_shipped_protocols_pass():
    for name in protocol_names():
        check_lengths(shipped(name), PAPER, 0.14)
    for words in ("1e9 L0", "-3 L0"):
        with pytest.raises(InputError, match="a length is at most 40 cm, the longest span of the rig"):
            check_lengths(with_values(shipped("work-loop"), {"amplitude": words}), PAPER, 0.14)


def test_the_work_of_a_cycle_is_positive_where_the_muscle_does_it():
    t = np.arange(0.0, 2.0, 1e-3)
    length, tension = 0.13 + 0.01 * np.cos(2 * np.pi * t), 50.0 + 30.0 * np.sin(2 * np.pi * t)
    flow = np.zeros_like(t)
    # it pulls harder while it shortens: pi a b of the ellipse, short by (2 pi/n)^2/6 of it, and of the printed places
    does, _, _, _, _ = of_cycle({"length": length, "tension": tension, "flow": flow}, 1e-3, 1.0)
    takes = of_cycle({"length": length[::-1], "tension": tension[::-1], "flow": flow}, 1e-3, 1.0)[0]
    assert does["value"] == pytest.approx(np.pi * 0.01 * 30.0, rel=1e-4) and takes["value"] == pytest.approx(
        -does["value"]
    )


def test_no_bar_of_the_comparison_has_a_negative_width():
    row = SimpleNamespace(shown=lambda: [-1.2, 3.0], shown_range=lambda: (-0.5, 1.0), published=None)
    column = SimpleNamespace(values={"shortest": 0.9, "longest": 0.7})
    drawn = [drawings.bar(row, 0, 3.0, -0.4, living=False), drawings.range_bar(column, 0.7, 0.9, None)]
    drawn.append(drawings.bar(row, 1, 0.0, None, living=False))
    for markup in drawn:
        assert '="-' not in markup and "<rect" in markup, markup


def test_reading_a_file_leaves_the_server_free(tmp_path):
    """While another process reads, the interpreter of this one answers within its switch interval and some."""
    path = tmp_path / "table.csv"
    path.write_text("1,2,3\n" * 400_000)
    one, late = ReaderProcess(cells, path), []
    thread = threading.Thread(target=one.result)
    thread.start()
    while thread.is_alive():
        begun = time.perf_counter()
        time.sleep(0.001)
        late.append(time.perf_counter() - begun)
    assert (
        len(late) > 20 and float(np.median(late)) < 0.05
    )  # of a busy machine; read here, the median is as long as it takes
