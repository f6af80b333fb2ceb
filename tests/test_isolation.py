"""What a process that reads may cost, what travels to and from it, and which processes are kept."""

import io
import json
import math
import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import errors, isolation
from mckibben.errors import InputError, MckibbenError
from mckibben.isolation import MEMORY, TIME, ReadingLimits, pack, unpack

GIB = 1 << 30


def returned(value):
    """A value as it comes back from the other process."""
    arrays = []
    tree = pack(value, arrays)
    return unpack(tree, iter(arrays))


PLAIN = st.none() | st.booleans() | st.integers(-(2**70), 2**70) | st.floats(allow_nan=False) | st.text(max_size=5)
KEYS = st.text(max_size=4) | st.integers(0, 9)


@given(st.recursive(PLAIN, lambda x: st.lists(x, max_size=4) | st.dictionaries(KEYS, x, max_size=4), max_leaves=12))
def test_what_json_holds_and_tables_with_any_keys_come_back_as_they_were_sent(value):
    assert returned(value) == value


@pytest.mark.parametrize(
    "array",
    [
        np.arange(6.0).reshape(2, 3), np.zeros((0, 3)), np.array(4), np.array([True, False]), np.array([b"a", b"bc"]),
        np.array(["a", "µ"]), np.array([1, 2], "datetime64[s]"), np.asfortranarray(np.arange(6).reshape(2, 3)),
        np.array([["a", "bc"], ["", "µ"]], object), np.array([], object), np.array(["a\0b", "c"], object),
        np.array([None, 1, 2.5, "x", True], object), np.array(["\ud800"], object),
    ],
    ids=str,
)  # fmt: skip
def test_arrays_come_back_with_their_shape_their_kind_and_every_value(array):
    found = returned({"a": [array, 1], "b": array})
    for one in (found["a"][0], found["b"]):
        assert one.shape == array.shape and one.dtype == array.dtype and one.tolist() == array.tolist()


def test_what_is_no_json_comes_back_as_its_plain_value_or_its_words():
    class Words(str):
        pass

    assert type(returned(Words("a"))) is str and returned((1, 2)) == [1, 2]
    assert returned([np.float64(2.5), np.int8(3), np.bool_(True), np.str_("a")]) == [2.5, 3, True, "a"]
    assert returned(np.datetime64("2020-01-02")) == "2020-01-02" and returned(Path("a")) == "a"
    for many in (range(2000), list(range(1001)), range(3)):  # as one array
        arrays = []
        assert unpack(pack(many, arrays), iter(arrays)) == list(many) and len(arrays) == 1
    for few in (list(range(1000)), [*range(1001), 1.5], [2**63] * 1001):
        arrays = []
        assert unpack(pack(few, arrays), iter(arrays)) == few and not arrays


def test_an_error_keeps_its_kind_and_its_fields_and_one_of_no_kind_of_ours_is_ours():
    sent = InputError("file", 3, "must be 4", where="a.csv")
    _, (_, arguments), state = sent.__reduce__()
    found = isolation._error("InputError", list(arguments), state)
    assert type(found) is InputError and str(found) == str(sent) and vars(found) == vars(sent)
    for name in ("Nothing", "annotations", "Path", "re"):  # not there, or no error of this package
        assert not isinstance(getattr(errors, name, None), type) or not issubclass(getattr(errors, name), MckibbenError)
        assert type(isolation._error(name, [], {})) is MckibbenError


@pytest.fixture
def machine(monkeypatch):
    """Limits as the file alone makes them, on a machine of 64 GiB."""
    monkeypatch.delenv(MEMORY, raising=False)
    monkeypatch.delenv(TIME, raising=False)
    monkeypatch.setattr(isolation, "_physical", lambda: 64 * GIB)


def test_limits_grow_with_the_file_up_to_half_of_the_memory(machine, monkeypatch):
    for size in (0, 10**6, 10**9):
        assert ReadingLimits.of(size) == pytest.approx((GIB + 24 * size, 20.0 + 2.5e-6 * size), rel=1e-12)  # rounding
    assert ReadingLimits.of(10**8, passes=3).time == pytest.approx(20.0 + 3 * 250.0)
    assert ReadingLimits.of(10**11).memory == 32 * GIB
    monkeypatch.setattr(isolation, "_physical", lambda: GIB)  # of a small machine all, for a library needs as much
    assert ReadingLimits.of(0).memory == ReadingLimits.of(10**9).memory == GIB


@pytest.mark.parametrize(
    ("words", "memory"),
    [
        ("4 GB", 4e9), ("4G", 4e9), ("500 MB", 5e8), ("2 GiB", 2.0 * GIB), ("300 Mib", 300.0 * 2**20), ("1.5 gb", 1.5e9),
        ("400000 k", 4e8), ("1 t", 1e12), ("1000000000", 1e9), ("1 B", 2.0**28),
    ],
)  # fmt: skip
def test_a_stated_size_counts_and_is_never_less_than_a_library_needs(machine, monkeypatch, words, memory):
    monkeypatch.setenv(MEMORY, words)
    assert ReadingLimits.of(10**11) == pytest.approx((memory, 20.0 + 2.5e5), rel=1e-12)  # rounding


@pytest.mark.parametrize(("words", "time"), [("2 s", 2.0), ("90", 90.0), ("1.5 min", 90.0), ("2h", 7200.0)])
def test_a_stated_time_counts(machine, monkeypatch, words, time):
    monkeypatch.setenv(TIME, words)
    assert ReadingLimits.of(0) == (GIB, time)


def test_the_sentence_of_a_limit_states_more_than_it_and_raising_it_to_that_helps(machine, monkeypatch):
    limits = ReadingLimits(4 * 10**9, 30.0)
    said = str(limits.no_memory("a.h5"))
    assert "takes more than 3.73 GiB" in said and f"{MEMORY}='8 GB' allows more" in said and said.startswith("a.h5: ")
    assert f"{MEMORY}='2 GB'" in str(ReadingLimits(1 << 28, 1.0).no_memory("a"))
    late = str(limits.no_time("a.h5"))
    assert "within 30 s" in late and f"{TIME}='120 s' allows more" in late and late.startswith("a.h5: ")
    monkeypatch.setenv(MEMORY, "8 GB")
    monkeypatch.setenv(TIME, "120 s")
    assert ReadingLimits.of(0) > limits and ReadingLimits.of(0).time > limits.time


def test_content_is_refused_before_it_is_unpacked_only_in_a_process_that_may_be_ended(monkeypatch):
    isolation.check_unpacked(math.inf)
    monkeypatch.setattr(isolation, "inside", ReadingLimits(800, 1.0))
    isolation.check_unpacked(100.0)
    with pytest.raises(MemoryError):
        isolation.check_unpacked(100.1)


def test_a_library_says_in_many_words_that_there_was_no_memory():
    for error in (MemoryError(), OSError("Unable to Allocate 3 TiB"), ValueError("polars ran OUT OF MEMORY")):
        assert isolation.lacks_memory(error)
    assert not isolation.lacks_memory(ValueError("a comma is missing"))


def test_small_answers_hold_within_their_block_and_nest():
    default = isolation._largest_answer.get()
    with isolation.small_answers(100):
        with isolation.small_answers(10):
            assert isolation._largest_answer.get() == 10
        assert isolation._largest_answer.get() == 100
    assert isolation._largest_answer.get() == default > 10**15


class Reader:
    """A process that waits: alive, gone, or that of a parent."""

    def __init__(self, alive=True, owner=None):
        self.owner = os.getpid() if owner is None else owner
        self.process, self.ended = SimpleNamespace(poll=lambda: None if alive else 1), False

    def end(self):
        self.ended = True


def test_one_living_process_is_kept_for_the_next_file_unless_a_large_one_made_it_large(monkeypatch):
    monkeypatch.setattr(isolation, "_idle", idle := [])
    first, second, large, gone = Reader(), Reader(), Reader(), Reader(alive=False)
    isolation._give(large, isolation.KEPT + 1)
    isolation._give(gone, 1)
    assert large.ended and gone.ended and not idle
    isolation._give(first, isolation.KEPT)
    isolation._give(second, 1)
    assert idle == [first] and second.ended and not first.ended
    assert isolation._take() is first and not idle


def test_a_process_that_is_gone_or_a_parent_s_is_never_used(monkeypatch):
    good, gone, parents = Reader(), Reader(alive=False), Reader(owner=-1)
    monkeypatch.setattr(isolation, "_idle", idle := [good, gone, parents])
    assert isolation._take() is good and gone.ended and parents.ended and not idle
    monkeypatch.setattr(isolation, "_Reader", lambda *_: "new")
    assert isolation._take() == "new"


def test_a_process_begins_before_it_is_needed_once_for_a_file_to_parse_and_where_a_processor_is_free(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(isolation, "_idle", idle := [])
    monkeypatch.setattr(isolation, "_Reader", lambda module: module)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    (tmp_path / "A.XLSX").write_bytes(b"")
    (tmp_path / "a.csv").write_bytes(b"")
    isolation.start_for(["read", str(tmp_path / "a.csv"), str(tmp_path / "b.xlsx"), str(tmp_path)], "m")
    assert not idle
    for count in (None, 1):
        monkeypatch.setattr(os, "cpu_count", lambda count=count: count)
        isolation.start("m")
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setattr(isolation, "inside", ReadingLimits(1, 1.0))
    isolation.start("m")
    assert not idle
    monkeypatch.setattr(isolation, "inside", None)
    for _ in range(2):
        isolation.start_for(["read", str(tmp_path / "A.XLSX")], "m")
    assert idle == ["m"]


def test_closing_ends_every_process_that_waits(monkeypatch):
    waiting = [Reader(), Reader()]
    monkeypatch.setattr(isolation, "_idle", idle := [*waiting])
    isolation.close()
    assert not idle and all(one.ended for one in waiting)


def test_a_process_that_may_be_ended_reads_at_once_and_needs_no_other(monkeypatch):
    monkeypatch.setattr(isolation, "inside", ReadingLimits(1, 1.0))
    monkeypatch.setattr(isolation, "_take", None)
    assert isolation.call_outside(lambda path, *a, **b: (path, a, b), Path("x"), 1, c=2) == (Path("x"), (1,), {"c": 2})


def test_what_a_function_does_becomes_its_answer_its_refusal_or_a_lack_of_memory(monkeypatch, tmp_path):
    import sys

    module = SimpleNamespace(
        reads=lambda path, *words, **more: [str(path), *words, more],
        refuses=lambda path: (_ for _ in ()).throw(InputError("a", 1, "must be 2")),
        lacks=lambda path: (_ for _ in ()).throw(MemoryError),
        says=lambda path: (_ for _ in ()).throw(OSError("malloc failed: Allocation of 9 bytes")),
        breaks=lambda path: (_ for _ in ()).throw(KeyError("a" * 500 + "\n b")),
    )
    monkeypatch.setitem(sys.modules, "of_a_test", module)
    assert isolation._outcome("of_a_test:reads", ["x", 1], {"b": 2}) == ("done", ["x", 1, {"b": 2}])
    assert isolation._outcome("of_a_test:lacks", ["x"], {}) == isolation._outcome("of_a_test:says", ["x"], {})
    assert isolation._outcome("of_a_test:lacks", ["x"], {}) == ("memory", None)
    for name, said in (("refuses", "a must be 2, got 1"), ("breaks", "file cannot be read (KeyError: 'aaa")):
        kind, (title, arguments, state) = isolation._outcome(f"of_a_test:{name}", ["x"], {})
        error = isolation._error(title, arguments, state)
        assert kind == "error" and type(error) is InputError and said in str(error) and len(str(error)) < 250


def answering(tree, layouts, data=b""):
    """A process that has answered this much."""
    text = json.dumps([tree, layouts]).encode()
    reader = object.__new__(isolation._Reader)
    reader.process = SimpleNamespace(stdout=io.BytesIO(isolation._LENGTH.pack(len(text)) + text + data))
    return reader, len(text)


def test_an_answer_is_taken_up_to_the_memory_that_was_allowed_and_no_part_of_it_is_guessed():
    numbers = np.arange(40.0)
    said = (["done", 1], [["<f8", [5, 8]], ["|u1", [0]], ["<U1", [1]]], numbers.tobytes() + "b".encode("utf-32-le"))
    tree, arrays = answering(*said)[0]._answer(ReadingLimits(324, 1.0))
    first, empty, text = arrays
    assert tree == ["done", 1] and first.shape == (5, 8) and np.array_equal(first.ravel(), numbers)
    assert empty.size == 0 and text.tolist() == ["b"]
    reader, length = answering(["done", "a" * 400], [])
    assert reader._answer(ReadingLimits(length, 1.0))[0][1] == "a" * 400
    for layouts, data, memory, error in (
        ([["<f8", [5, 8]], ["|u1", [0]], ["<U1", [1]]], numbers.tobytes() + b"b\0\0\0", 323, ValueError),
        ([], b"", 10, ValueError),  # the words alone are longer
        ([["<f8", [-1]]], b"", 400, ValueError),
        ([["|O", [1]]], b"", 400, ValueError),
        ([["<f8", [5]]], bytes(39), 400, EOFError),
    ):
        with pytest.raises(error):
            answering(["done", 1], layouts, data)[0]._answer(ReadingLimits(memory, 1.0))


def test_a_process_that_is_ended_is_waited_for_and_that_of_a_parent_is_only_forgotten():
    for own in (True, False):
        calls, reader = [], object.__new__(isolation._Reader)
        streams = [io.BytesIO() for _ in range(3)]
        reader.owner, reader.complaints = os.getpid() if own else -1, streams[2]
        reader.process = SimpleNamespace(
            kill=lambda calls=calls: calls.append("kill"), wait=lambda calls=calls: calls.append("wait"),
            stdin=streams[0], stdout=streams[1], returncode=None,
        )  # fmt: skip
        reader.end()
        assert calls == (["kill", "wait"] if own else []) and all(one.closed for one in streams)
        assert reader.process.returncode == (None if own else 0)  # else its end would be waited for after all


def test_a_process_that_may_be_ended_has_its_memory_and_five_seconds_more_than_its_time(monkeypatch):
    resource = pytest.importorskip("resource")
    calls = []
    monkeypatch.setattr(isolation, "inside", None)
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (1, 1 << 40))
    monkeypatch.setattr(resource, "setrlimit", lambda *limit: calls.append(limit))
    monkeypatch.setattr(isolation.signal, "signal", lambda *way: calls.append(way))
    monkeypatch.setattr(isolation.signal, "setitimer", lambda *timer: calls.append(timer))
    limits = ReadingLimits(1 << 30, 20.0)
    isolation.enter(limits)
    alarm = (isolation.signal.SIGALRM, isolation.signal.SIG_DFL)
    timer = isolation.signal.ITIMER_REAL
    assert isolation.inside == limits
    assert calls == [(resource.RLIMIT_DATA, (1 << 30, 1 << 40)), alarm, (timer, 25.0)]
    isolation.leave()
    assert calls[3:] == [(timer, 0.0)]


def test_what_a_pipe_takes_in_parts_is_written_whole():
    taken = bytearray()

    class Narrow:
        def write(self, view):
            taken.extend(view[:3])
            return min(3, len(view))

    isolation._write(Narrow(), b"0123456789")
    assert taken == b"0123456789"


def test_a_machine_that_does_not_say_its_memory_counts_as_one_of_eight_gib(monkeypatch):
    pages = {"SC_PHYS_PAGES": 1000, "SC_PAGE_SIZE": 4096}
    monkeypatch.setattr(os, "sysconf", pages.__getitem__)
    assert isolation._physical() == 4096000

    def sysconf(name):
        raise ValueError("unrecognized configuration name")

    monkeypatch.setattr(os, "sysconf", sysconf)
    assert isolation._physical() == 8 * GIB
