"""A file is written whole, or what stood there stays; whoever reads meets one or the other."""

import os
import threading

import pytest

from mckibben.documents import read_text, write_text, write_whole
from mckibben.errors import InputError


def test_what_stood_there_stays_when_writing_breaks_off(tmp_path):
    place = tmp_path / "rig.toml"
    write_text(place, "schema = 1\n")

    def half(part):
        part.write_text("sche")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(place, half)
    assert read_text(place) == "schema = 1\n" and os.listdir(tmp_path) == ["rig.toml"]


def test_a_reader_never_meets_half_a_file(tmp_path):
    place, sizes, ended = tmp_path / "rig.toml", set(), threading.Event()
    texts = [letter * (1 << 20) for letter in "ab"]
    write_text(place, texts[0])

    def read():
        while not ended.is_set():
            found = read_text(place)
            sizes.add((len(found), len(set(found))))

    reader = threading.Thread(target=read)
    reader.start()
    for turn in range(20):
        write_text(place, texts[turn % 2])
    ended.set()
    reader.join()
    assert sizes == {(1 << 20, 1)}


def test_lines_and_letters_are_written_as_they_are(tmp_path):
    write_text(tmp_path / "a.txt", "µm\r\n°\n")
    assert (tmp_path / "a.txt").read_bytes() == "µm\r\n°\n".encode()


def test_no_folder_and_a_folder_in_the_place_are_said_in_a_line(tmp_path):
    with pytest.raises(InputError, match="there is no folder"):
        write_text(tmp_path / "missing" / "a.txt", "")
    (tmp_path / "b.txt").mkdir()
    with pytest.raises(InputError, match=r"report is .*b.txt.* cannot be written"):
        write_text(tmp_path / "b.txt", "", field="report")
    assert os.listdir(tmp_path) == ["b.txt"]
