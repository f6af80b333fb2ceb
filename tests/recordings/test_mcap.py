"""A damaged log gives back what is sound and never crashes or hangs; MCAP files of others are read, or refused in a line."""

import dataclasses
import io
import json
import math
import struct
import tempfile
import time as clock
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer

from mckibben.errors import InputError
from mckibben.formats.live_log import HEAD
from mckibben.formats.mcap import is_log, write_log
from mckibben.formats.mcap_records import ATTACHMENT, CHUNK, MESSAGE, ByteGap, attachment, records, records_inside
from mckibben.formats.mcap_records import _unpacked as unpack
from mckibben.formats.messages import LoggedMessage, json_message, protobuf_decoder, ros_message
from mckibben.formats.sidecar import KEY
from mckibben.recordings import Channel, LiveLog, Recording, read_any
from mckibben.recordings.files import read_log

N = 200
CHANNELS = {"a": Channel([], "N", "measured", "left"), "b_abs": Channel([], "Pa", "true")}
TIME = 1e-3 * np.arange(N)
VALUES = np.stack([np.sin(40.0 * TIME), np.where(TIME > 0.15, np.nan, 1e5 + TIME)], axis=1)


def log_bytes(closed: bool = True) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        log = LiveLog(Path(folder) / "a.mcap", CHANNELS, {"title": "t", "list": [1, math.inf]}, flush=0.01, sync=None)
        for at, row in zip(TIME, VALUES, strict=True):
            log.append(at, row)
        log.annotate("near the end", 0.19)
        data = log.path.read_bytes()
        log.close("DONE")
        return log.path.read_bytes() if closed else data


CLOSED, OPEN = log_bytes(), log_bytes(closed=False)


def read_bytes(data: bytes):
    """A log of these bytes, or the line of its refusal; in bounded time."""
    with tempfile.NamedTemporaryFile(suffix=".mcap") as file:
        file.write(data)
        file.flush()
        begun = clock.process_time()
        try:
            found = read_log(file.name)
        except InputError as error:
            assert "\n" not in str(error)
            found = None
        # 10 KB take some ms; a busy machine may count a little of others.
        assert clock.process_time() - begun < 1.0
    return found


def chunks(data: bytes) -> list[tuple[int, int, np.ndarray]]:
    """Where each chunk begins and ends, and the numbers of the samples in it."""
    found, before = [], 0
    for record in records(memoryview(data)):
        if not isinstance(record, ByteGap) and record.opcode == CHUNK:
            count = sum(1 for r in records_inside(record.body) if r.opcode == MESSAGE and r.body[:2] == b"\x01\x00")
            found.append((record.at, record.end, np.arange(before, before + count)))
            before += count
    return found


CHUNKS = {False: chunks(OPEN), True: chunks(CLOSED)}
(HEAD_END,) = {
    r.end for r in records(memoryview(CLOSED)) if not isinstance(r, ByteGap) and r.opcode == ATTACHMENT
    and attachment(r.body)[0] == HEAD
}  # fmt: skip


def assert_sound(found, wanted: np.ndarray) -> None:
    """Every sample that is given back went in, bit for bit, and the wanted ones are all there."""
    record = found.recording
    numbers = np.searchsorted(TIME, record.time)
    assert np.array_equal(TIME[numbers], record.time)
    for name, column in zip(CHANNELS, VALUES.T, strict=True):
        assert record[name].tobytes() == column[numbers].tobytes()
        assert record.channels[name] == CHANNELS[name].with_values(record[name])
    assert set(wanted) <= set(numbers)
    if len(record) < N:
        assert found.remarks


def test_the_log_of_these_tests_has_many_chunks() -> None:
    for closed, data in ((True, CLOSED), (False, OPEN)):
        assert len(CHUNKS[closed]) >= 10
        assert read_bytes(data).whole == closed
    assert sum(len(numbers) for *_, numbers in CHUNKS[True]) == N


@pytest.mark.parametrize("closed", [True, False])
def test_a_log_cut_at_any_byte_gives_back_every_whole_chunk(closed: bool) -> None:
    data = CLOSED if closed else OPEN
    borders = {cut for start, end, _ in CHUNKS[closed] for cut in (start - 1, start, start + 1, end - 1, end)}
    for cut in sorted(borders | set(range(0, len(data), 97)) | set(range(len(data) - 12, len(data)))):
        found = read_bytes(data[:cut])
        whole = [numbers for _, end, numbers in CHUNKS[closed] if end <= cut]
        if not whole:
            assert found is None
            continue
        assert_sound(found, np.concatenate(whole))
        assert len(found.recording) == len(np.concatenate(whole))
        if closed and cut < CHUNKS[True][-1][1]:
            assert "was not closed" in found.remarks[-1]


@settings(max_examples=150, deadline=None)
@given(
    st.booleans(),
    st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=6),
)
@example(True, [(0.5, 255)])
def test_flipped_bytes_cost_the_chunks_that_they_hit(closed: bool, flips: list[tuple[float, int]]) -> None:
    data = bytearray(CLOSED if closed else OPEN)
    places = {int(share * len(data)): mask for share, mask in flips}
    for place, mask in places.items():
        data[place] ^= mask
    found = read_bytes(bytes(data))
    sound = [n for start, end, n in CHUNKS[closed] if not any(start <= place < end for place in places)]
    first = CHUNKS[closed][0]
    if all(place >= HEAD_END for place in places) or not any(first[0] <= place < first[1] for place in places):
        assert_sound(found, np.concatenate(sound))
    elif found is not None:
        assert_sound(found, np.array([], int))


def test_the_kind_of_every_record_may_be_flipped() -> None:
    for start, end, lost in CHUNKS[True]:
        for opcode in (*range(18), 255):
            data = bytearray(CLOSED)
            data[start] = opcode
            if opcode != CHUNK:
                found = read_bytes(bytes(data))
                assert len(found.recording) == N - len(lost), (start, end, opcode)
                assert any(f"{len(lost)} samples" in line for line in found.remarks), found.remarks


def test_a_damaged_head_costs_the_meta_only() -> None:
    at = CLOSED.index(b'"title": "t"')
    found = read_bytes(CLOSED[:at] + b"?" + CLOSED[at + 1 :])
    assert_sound(found, np.arange(N))
    assert "title" not in found.recording.meta
    assert found.recording.meta["result"] == "DONE"
    assert "head of the log is damaged" in found.remarks[0]
    assert found.recording.meta["warnings"] == found.remarks
    assert len(found.recording) == N


def test_a_log_is_known_by_either_of_two_places_near_its_start_and_by_no_later_one(tmp_path: Path) -> None:
    key, head = struct.pack("<I", len(KEY)) + KEY.encode(), HEAD.encode()
    neither = CLOSED.replace(key, b"?" * len(key)).replace(head, b"?" * len(head))
    path = tmp_path / "a.mcap"
    for data, known in (
        (CLOSED, True),
        (CLOSED.replace(head, b"?" * len(head)), True),
        (CLOSED.replace(key, b"?" * len(key)), True),
        (neither, False),
        (neither.ljust(4096, b"?") + head, False),
    ):
        path.write_bytes(data)
        assert is_log(path) is known


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=400), st.integers(0, len(CLOSED)), st.integers(0, len(CLOSED)))
def test_any_bytes_anywhere_are_read_or_refused(noise: bytes, start: int, end: int) -> None:
    found = read_bytes(CLOSED[:start] + noise + CLOSED[end:])
    if found is not None:
        assert_sound(found, np.array([], int))


def test_a_file_made_of_promises_takes_bounded_time() -> None:
    # Each says that it is a chunk as long as the rest of the file: summed up one by one, 30 GB.
    size, promise = 2_000_000, 57
    parts = [b"\x89MCAP0\r\n\x00"]
    for at in range(9, size, promise):
        length = size - at - 9
        if length > 40:
            parts.append(
                struct.pack("<BQQQQIIQ", 6, length, 0, 0, length - 40, 1, 0, length - 40) + bytes(promise - 49)
            )
    data = b"".join(parts)
    begun = clock.process_time()
    assert read_bytes_slowly(data + bytes(size - len(data))) is None
    assert clock.process_time() - begun < 10.0  # some tenths of a second on an idle machine


def read_bytes_slowly(data: bytes):
    with tempfile.NamedTemporaryFile(suffix=".mcap") as file:
        file.write(data)
        file.flush()
        with pytest.raises(InputError):
            read_log(file.name)


def test_a_log_of_a_newer_version_is_refused(monkeypatch) -> None:
    monkeypatch.setattr("mckibben.formats.sidecar.SCHEMA", 2)
    data = log_bytes()
    monkeypatch.undo()
    with tempfile.NamedTemporaryFile(suffix=".mcap") as file:
        file.write(data)
        file.flush()
        with pytest.raises(
            InputError, match=r"\.mcap: schema must be at most 1 for this version of mckibben, got 2; a newer"
        ):
            read_log(file.name)


def test_sound_checksums_over_nonsense_are_no_danger(tmp_path: Path) -> None:
    # As a program with a mistake would write it: times that fall, samples of another width, events that are none.
    path = tmp_path / "a.mcap"
    with LiveLog(path, CHANNELS, {"warnings": "one"}) as log:
        for i, at in enumerate([0.0, 1.0, math.nan, 0.5, 2.0]):
            data = b"\x00\x01\x00\x00" + struct.pack("<3d", at, i, i)
            log._writer.add_message(log._topic, 0, data if at != 2.0 else data[:-8], 0, i)
        log._writer.add_message(log._events, 0, b"[1", 0)
        log._writer.add_message(log._topic, 0, b"\x00\x01\x00\x00abc", 0)
    found = read_log(path)
    assert found.recording.time.tolist() == [0.0, 1.0]
    assert any("were left out" in line for line in found.remarks)
    assert found.recording.meta["warnings"][0] == "one"
    assert "events" not in found.recording.meta


def test_an_exported_recording_says_when_it_began(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    record = Recording([-1.0, 0.5, 1e12], {"a": Channel([1.0, 2.0, 3.0], "N")}, {"created": "2026-01-02T03:04:05Z"})
    write_log(record, tmp_path / "a.mcap")
    assert read_log(tmp_path / "a.mcap") == (record, True, [])
    with open(tmp_path / "a.mcap", "rb") as stream:
        stamps = [m.log_time for *_, m in make_reader(stream).iter_messages()]
    assert stamps[:2] == [1767323045 * 10**9, 1767323046_500_000_000]


# Files of others.


def foreign(path: Path, topics: dict, compression=CompressionType.ZSTD) -> Path:
    """Topics: name -> (encoding, schema's encoding, schema's text, [(log time [ns], data)])."""
    stream = io.BytesIO()
    writer = Writer(stream, compression=compression)
    writer.start()
    for name, (encoding, form, text, messages) in topics.items():
        schema = writer.register_schema(f"some/{encoding}", form, text.encode()) if form else 0
        topic = writer.register_channel(name, encoding, schema)
        for i, (stamp, data) in enumerate(messages):
            writer.add_message(topic, stamp, data, stamp, i)
    writer.finish()
    path.write_bytes(stream.getvalue())
    return path


def as_json(*values: dict, step: int = 10**7) -> tuple:
    return "json", "jsonschema", "{}", [(10**18 + i * step, json.dumps(v).encode()) for i, v in enumerate(values)]


@pytest.mark.parametrize("compression", list(CompressionType))
def test_json_topics_of_others_become_channels(tmp_path: Path, compression) -> None:
    messages = as_json(*({"tank": {"pressure": 1.0 + i}, "open": i > 1, "who": "me"} for i in range(4)))
    path = foreign(tmp_path / "a.mcap", {"/rig": messages}, compression)
    with pytest.raises(InputError, match=r"a\.mcap: tank\.pressure has no unit: state one, such as bar"):
        read_any(path)
    record = read_any(path, units={"tank.pressure": "bar"}).recording
    assert np.allclose(record.time, [0.0, 0.01, 0.02, 0.03], rtol=0, atol=1e-15)
    assert record["tank.pressure"].tolist() == [1e5, 2e5, 3e5, 4e5]
    assert (record["open"].tolist(), record.unit("open")) == ([0.0, 0.0, 1.0, 1.0], "1")


def test_plain_ros_messages_of_others_become_channels(tmp_path: Path) -> None:
    text = "# a force\nuint8 UNIT=1\nbool ok\nint16 count\nfloat64 force\nfloat32 small 0.5\n"
    data = [b"\x00\x01\x00\x00" + struct.pack("<?xh4xdf", True, -i, 0.1 * i, 0.5) for i in range(3)]
    cdr = ("cdr", "ros2msg", text, [(10**9 * i, d) for i, d in enumerate(data)])
    image = ("cdr", "ros2msg", "std_msgs/Header header\nuint8[] data", [(5, b"\x00\x01\x00\x00")])
    proto = ("protobuf", "protobuf", "", [(6, b"a")])
    path = foreign(tmp_path / "a.mcap", {"/force": cdr, "/camera": image, "/p": proto})
    read = read_any(path, units={"force": "kN", "small": "1", "count": "1"})
    assert read.recording.time.tolist() == [0.0, 1.0, 2.0]
    assert read.recording["force"].tolist() == [0.0, 100.0, 200.0]
    assert read.recording["count"].tolist() == [0.0, -1.0, -2.0]
    assert read.recording["small"].tolist() == [0.5] * 3
    assert any("/camera is left out" in line for line in read.remarks)
    assert any("/p is left out: its messages are protobuf" in line for line in read.remarks)


@dataclasses.dataclass
class Inner:
    force: float = 2.5


@dataclasses.dataclass
class Outer:
    inner: Inner = dataclasses.field(default_factory=Inner)
    ok: bool = True
    count: int = 3
    who: str = "me"
    samples: list[float] = dataclasses.field(default_factory=lambda: [1.0, 2.0])
    none: list[float] = dataclasses.field(default_factory=list)


def in_protobuf(message: Outer) -> LoggedMessage:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    kinds = {"force": 1, "ok": 8, "count": 5, "who": 9, "samples": 1, "none": 1, "inner": 11}
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", syntax="proto3")
    for name, fields in (("Inner", ["force"]), ("Outer", ["inner", "ok", "count", "who", "samples", "none"])):
        made = file.message_type.add(name=name)
        for number, field in enumerate(fields, 1):
            kept = made.field.add(
                name=field, number=number, type=kinds[field], label=3 if field in ("samples", "none") else 1
            )
            if field == "inner":
                kept.type_name = ".Inner"
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    values = dataclasses.asdict(message)
    data = message_factory.GetMessageClass(pool.FindMessageTypeByName("Outer"))(**values).SerializeToString()
    schema = descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
    return protobuf_decoder("Outer", schema, where="a.mcap")(data)


def test_a_message_says_the_same_in_every_encoding() -> None:
    one = LoggedMessage({"inner.force": 2.5, "ok": True, "count": 3.0}, None, ("samples",))
    for said in (json_message(dataclasses.asdict(Outer())), ros_message(Outer()), in_protobuf(Outer())):
        assert said == one
        assert [type(value) is bool for value in said.numbers.values()] == [False, True, False]


def test_lists_in_messages_are_left_out_with_a_word(tmp_path: Path) -> None:
    path = foreign(tmp_path / "a.mcap", {"/rig": as_json(*({"p": float(i), "raw": [1, 2]} for i in range(3)))})
    assert "/rig.raw is left out: it is a list" in read_any(path, units={"p": "N"}).remarks


def test_topics_of_two_clocks_are_one_record_on_the_finer_and_it_is_said(tmp_path: Path) -> None:
    topics = {"/a": as_json({"f": 1}, {"f": 2}), "/b": as_json({"p": 1}, {"p": 2}, {"p": 3}, step=10**6)}
    path = foreign(tmp_path / "a.mcap", topics)
    both = read_any(path, units={"a.f": "N", "b.p": "kPa"})
    assert "a.f is interpolated to the times of b.p" in both.remarks
    read = read_any(path, columns={"pressure": "b.p"}, units={"pressure": "kPa"})
    assert read.recording["pressure"].tolist() == [1e3, 2e3, 3e3]


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_damaged_files_of_others_are_read_or_refused(data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = foreign(Path(folder) / "a.mcap", {"/rig": as_json(*({"p": float(i)} for i in range(30)))})
        content = bytearray(path.read_bytes())
        for _ in range(data.draw(st.integers(1, 4))):
            content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
        path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
        try:
            read_any(path, units={"p": "N"})
        except InputError as error:
            assert "\n" not in str(error)


def test_a_chunk_is_unpacked_to_its_stated_size_whether_its_frame_states_one_or_not() -> None:
    import lz4.frame
    import zstandard

    data = b"0123456789" * 20
    zstd = [zstandard.ZstdCompressor(write_content_size=stated).compress(data) for stated in (True, False)]
    for kind, packed in (*((b"zstd", one) for one in zstd), (b"lz4", lz4.frame.compress(data))):
        assert unpack(kind, packed, len(data)) == data
        assert unpack(kind, packed[: len(packed) // 2], len(data)) != data
    for size in (0, 10, len(data) + 1):
        assert unpack(b"zstd", zstd[0], size) is None  # it states another one
    assert unpack(b"gzip", data, len(data)) is None and unpack(b"zstd", b"nothing", 7) is None


def test_a_bomb_is_not_unpacked(tmp_path: Path) -> None:
    import zstandard

    path = foreign(tmp_path / "a.mcap", {"/rig": as_json({"p": 1.0})})
    bomb = zstandard.compress(bytes(2**20))  # says 1 MiB itself, the chunk says 10 B
    body = struct.pack("<QQQII", 0, 0, 10, zlib.crc32(b""), 4) + b"zstd" + struct.pack("<Q", len(bomb)) + bomb
    path.write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, len(body)) + body)
    with pytest.raises(InputError, match="no message"):
        read_any(path)
