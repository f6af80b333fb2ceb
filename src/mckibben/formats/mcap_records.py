"""The records of an MCAP file, as far as they are sound: nothing here trusts a length or a checksum that was not compared.

Chunks and attachments carry checksums. Where a record is damaged, the next sound one is looked for, so that a flipped byte
costs its own chunk and a file that ends anywhere costs its last one. The work is bounded by the size of the file.
"""

from __future__ import annotations

import io
import re
import struct
import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, ATTACHMENT = 1, 2, 3, 4, 5, 6, 7, 9
MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")  # opcode, length
_CHUNK_HEAD = struct.Struct("<QQQII")  # first time, last time, size, checksum, length of the compression's name
_LONGEST_OPEN = 1 << 16  # [B], of a record that has no checksum; longer ones are indexes, which are not needed
_MOST = 1 << 28  # [B], of a chunk when decompressed
_START = re.compile(rb"[\x06\x09]")
_PATIENCE = 4  # times the size of the file: what may be summed up in vain


class McapRecord(NamedTuple):
    """A sound record: where it begins, its opcode, its content (of a chunk, the records inside), and where it ends."""

    at: int
    opcode: int
    body: memoryview
    end: int


class ByteGap(NamedTuple):
    """Bytes that are no sound record, from one offset to another."""

    start: int
    end: int


def records(data: memoryview) -> Iterator[McapRecord | ByteGap]:
    """The sound records of a file in their order, and the gaps between them.

    Args:
        data: the file.
    """
    at, end = len(MAGIC), len(data)
    in_vain = 0
    while at < end:
        if end - at == len(MAGIC) and data[at:] == MAGIC:
            return
        record = _record(data, at)
        if record is not None:
            yield record
            at = record.end
            continue
        begun = at
        while record is None:
            match = _START.search(data, at + 1)
            if match is None or in_vain > _PATIENCE * end:
                yield ByteGap(begun, end)
                return
            at = match.start()
            if _promising(data, at):
                record = _record(data, at)
                in_vain += 0 if record else _HEAD.unpack_from(data, at)[1]
        yield ByteGap(begun, at)


def records_inside(chunk: memoryview, at: int = 0) -> Iterator[McapRecord]:
    """The records inside a sound chunk from an offset on."""
    while (record := record_at(chunk, at)) is not None:
        yield record
        at = record.end


def record_at(chunk: memoryview, at: int) -> McapRecord | None:
    """The record at an offset inside a sound chunk, or None behind the last."""
    if at + _HEAD.size > len(chunk):
        return None
    opcode, length = _HEAD.unpack_from(chunk, at)
    end = at + _HEAD.size + length
    return None if end > len(chunk) else McapRecord(at, opcode, chunk[at + _HEAD.size : end], end)


def attachment(body: memoryview) -> tuple[str, bytes]:
    """Name and content of an attachment that `records` record."""
    (named,) = struct.unpack_from("<I", body, 16)
    (kind,) = struct.unpack_from("<I", body, 20 + named)
    start = 32 + named + kind
    return bytes(body[20 : 20 + named]).decode("utf-8", "replace"), bytes(body[start:-4])


def _record(data: memoryview, at: int) -> McapRecord | None:
    """The record at an offset, if it is sound."""
    if len(data) - at < _HEAD.size:
        return None
    opcode, length = _HEAD.unpack_from(data, at)
    end = at + _HEAD.size + length
    if not 0 < opcode < 16 or end > len(data):
        return None
    body = data[at + _HEAD.size : end]
    if opcode == CHUNK:
        content = _chunk(body)
        return None if content is None else McapRecord(at, opcode, content, end)
    if opcode == ATTACHMENT:
        sound = _promising(data, at) and zlib.crc32(body[:-4]) == struct.unpack("<I", body[-4:])[0]
        return McapRecord(at, opcode, body, end) if sound else None
    long = length > _LONGEST_OPEN and not (opcode == INDEX and struct.unpack_from("<I", body, 2)[0] == length - 6)
    # Without a checksum, what follows must look like a record too: a wrong length shall not jump over sound chunks.
    follows = data[end : end + _HEAD.size]
    if len(follows) == _HEAD.size and bytes(follows[: len(MAGIC)]) != MAGIC:
        next_code, next_length = _HEAD.unpack(follows)
        if not 0 < next_code < 16 or next_length > len(data) - end or long:
            return None
    return McapRecord(at, opcode, body, end)


def _promising(data: memoryview, at: int) -> bool:
    """Whether the lengths inside a chunk or an attachment agree with its own."""
    if len(data) - at < _HEAD.size:
        return False
    opcode, length = _HEAD.unpack_from(data, at)
    body = at + _HEAD.size
    if length > len(data) - body or length < 36:
        return False
    if opcode == CHUNK:
        name = _CHUNK_HEAD.unpack_from(data, body)[4]
        if length < 40 or name > 16 or length < 40 + name:
            return False
        return bool(length == 40 + name + struct.unpack_from("<Q", data, body + 32 + name)[0])
    named = struct.unpack_from("<I", data, body + 16)[0]
    if length < 36 + named:
        return False
    kind = struct.unpack_from("<I", data, body + 20 + named)[0]
    if length < 36 + named + kind:
        return False
    return bool(length == 36 + named + kind + struct.unpack_from("<Q", data, body + 24 + named + kind)[0])


def _chunk(body: memoryview) -> memoryview | None:
    """The records of a chunk, decompressed, if all its sizes and its checksum agree."""
    if len(body) < 40:
        return None
    *_, size, crc, named = _CHUNK_HEAD.unpack_from(body)
    if named > 16 or len(body) < 40 + named:
        return None
    compression, packed = bytes(body[32 : 32 + named]), body[40 + named :]
    if struct.unpack_from("<Q", body, 32 + named)[0] != len(packed) or size > max(_MOST, len(packed)):
        return None
    content = packed if not compression else _unpacked(compression, bytes(packed), size)
    if content is None or len(content) != size or (crc and zlib.crc32(content) != crc):
        return None
    return memoryview(content)


def _unpacked(compression: bytes, packed: bytes, size: int) -> bytes | None:
    import lz4.frame
    import zstandard

    try:
        if compression == b"zstd" and zstandard.frame_content_size(packed) in (-1, size):
            return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        if compression == b"lz4":
            unpacked: bytes | None = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size)
            return unpacked
    except (zstandard.ZstdError, RuntimeError, EOFError, ValueError):
        return None
    return None


class Topic(NamedTuple):
    """Content of a channel record: its number, that of its schema, its name, the encoding of its messages, and the rest."""

    number: int
    schema: int
    name: str
    encoding: str
    metadata: dict[str, str]


class MessageSchema(NamedTuple):
    """Content of a schema record: its number, name, encoding and content."""

    number: int
    name: str
    encoding: str
    data: bytes

    @property
    def text(self) -> str:
        """The content as text."""
        return self.data.decode("utf-8", "replace")


def read_topic(body: memoryview) -> Topic | None:
    """Topic of a channel record, or None where the record is damaged."""
    from mcap.records import Channel

    channel = _parsed(Channel, body)
    return channel and Topic(channel.id, channel.schema_id, channel.topic, channel.message_encoding, channel.metadata)


def read_schema(body: memoryview) -> MessageSchema | None:
    """A schema record, or None of one that cannot be."""
    from mcap.records import Schema

    schema = _parsed(Schema, body)
    return schema and MessageSchema(schema.id, schema.name, schema.encoding, schema.data)


def _parsed(kind: Any, body: memoryview) -> Any:
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError

    try:
        return kind.read(ReadDataStream(io.BytesIO(body)))
    except (McapError, struct.error, UnicodeDecodeError, ValueError, OverflowError):
        return None
