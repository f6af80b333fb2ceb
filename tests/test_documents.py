"""A file is written whole, or what stood there stays; whoever reads meets one or the other."""

import json
import os
import re
import threading
import time
from pathlib import Path

import pytest

import mckibben
from mckibben.documents import (
    DEEPEST,
    ErrorKeepingFile,
    editable_toml,
    no_file,
    parse_json,
    parse_toml,
    read_text,
    read_toml,
    with_own_paths,
    write_text,
    write_whole,
)
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


DEEP = 5_000
NESTED = {
    "a table's name": "[" + ".".join("a" * DEEP) + "]\n",
    "a name with quotes and blanks": "[" + ' . "a.b" '.join("a" * DEEP) + "]\n",
    "a key": ".".join("a" * DEEP) + " = 1\n",
    "tables one below the other": "".join(f"[{'.'.join('a' * n)}]\n" for n in range(1, 1_000)),
    "lists": "a = " + "[" * DEEP + "]" * DEEP + "\n",
    "lists that do not end": "a = " + "[" * DEEP,
    "tables in lines": "a = " + "{a = " * DEEP + "1" + "}" * DEEP + "\n",
    "keys in tables in lists": "a.b.c.d.e.f = [" + "{a.b.c.d.e.f.g.h = [" * 10 + "]}" * 10 + "]\n",
}


@pytest.mark.parametrize("text", NESTED.values(), ids=NESTED)
def test_what_is_nested_too_deeply_is_refused_at_once(text):
    begun = time.process_time()
    with pytest.raises(InputError, match=f"x.toml: rig must have at most {DEEPEST} tables"):
        parse_toml(text, where="x.toml", field="rig")
    # measured: 3 ms at most; a second, for other work may run beside it. Python's own parser takes 0.7 s for the fourth
    assert time.process_time() - begun < 1.0


def test_signs_in_strings_and_comments_make_nothing_deep():
    signs = "[{." * DEEP
    lines = [
        f'a = "{signs}"', f"b = '{signs}'", f'c = """{signs}\n\\"""\n{signs}"""""', f"d = '''{signs}\n{signs}'''''",
        f"e = 1 # {signs}\"'", f'"{signs}" = 1', f"f = [{', '.join(['1.5'] * DEEP)}]", "g = [{h = 1}, {h = [1]}]", "i = ''",
    ]  # fmt: skip
    assert len(parse_toml("\n".join(lines), where="x.toml")) == len(lines)


def test_as_many_levels_as_are_allowed_are_read():
    for wide in (0, 1):  # one key counts as a level
        n = DEEPEST - 1 + wide
        texts = [
            "a = " + "[" * n + "]" * n,
            ".".join("a" * (n + 1)) + " = 1",
            json.dumps({"a": json.loads("[" * n + "]" * n)}),
        ]
        for read, text in zip((*[lambda t: parse_toml(t, where="x")] * 2, parse_json), texts, strict=True):
            if wide:
                with pytest.raises(ValueError, match=str(DEEPEST)):
                    read(text)
            else:
                read(text)


def test_json_is_bounded_too():
    for text in ("[" * 200_000, '{"a":' * 200_000, '"\\"[' * DEEP, "1" * 5_000):
        with pytest.raises(ValueError):
            parse_json(text)
    assert parse_json(json.dumps(["[" * 200_000, [[]] * 1_000])) == ["[" * 200_000, [[]] * 1_000]
    assert parse_json(b"[1]") == [1]


def test_a_file_that_is_too_long_is_refused_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr("mckibben.documents.LONGEST", 1 << 20)
    for place in (tmp_path / "long.toml", "/dev/zero"):
        if place != "/dev/zero":
            place.write_bytes(b"a" * ((1 << 20) + 1))
        elif not os.path.exists(place):
            continue
        with pytest.raises(InputError, match="must be at most 1 MiB long"):
            read_toml(place)
    with pytest.raises(InputError, match="must be at most 1 MiB long"):
        parse_toml("#" * ((1 << 20) + 1), where="x.toml")


def test_toml_and_json_are_parsed_in_one_place():
    """There the bounds are."""
    root = Path(mckibben.__file__).parent
    parsing = re.compile(
        r"tomllib\.loads?\(|tomlkit\.(parse|loads?)\(|json\.loads?\(|pickle\.loads?\(|\beval\(|\bexec\("
    )
    found = {str(p.relative_to(root)) for p in root.rglob("*.py") if parsing.search(p.read_text(encoding="utf-8"))}
    assert found == {
        "documents.py",
        "registry.py",  # runs a file of the user, as Python
        "components/programs.py",  # its own words, just written
        "isolation.py",  # from a process that it has started
        "batch/drive.py",  # likewise, and between machines of one cluster
    }


def test_paths_in_a_document_are_those_of_its_folder_and_names_stay():
    document = {
        "muscle": "own.toml",
        "title": "own.toml",
        "loads": [{"muscle": "nylon"}, {"muscle": "/a/B.TOML"}],
        "muscle_": 1,
    }
    assert with_own_paths(document, "folder/system.toml", "muscle") == {
        "muscle": "folder/own.toml",
        "title": "own.toml",
        "loads": [{"muscle": "nylon"}, {"muscle": "/a/B.TOML"}],
        "muscle_": 1,
    }


def test_an_edited_document_keeps_its_comments_and_a_broken_one_is_refused():
    document = editable_toml("# why\na = 1  # one\nb = 2\n", where="a.toml")
    document["a"] = 3
    assert document.as_string() == "# why\na = 3  # one\nb = 2\n"
    with pytest.raises(InputError, match=r"a\.toml"):
        editable_toml("a = ", where="a.toml")


@pytest.mark.parametrize("full", [False, True])
def test_a_file_that_keeps_its_error_reads_back_what_was_written_and_zeros_where_nothing_could(tmp_path, full):
    file = ErrorKeepingFile(tmp_path / "a")
    file.write(b"abcdef")
    if full:
        file.error = OSError(28, "No space left on device")
    file.seek(6)
    assert file.write(b"ghi") == 3
    file.seek(4)
    buffer = bytearray(b"?" * 8)
    assert file.readinto(buffer) == 5 and file.readinto(bytearray(4)) == 0
    assert bytes(buffer) == (b"ef\0\0\0" if full else b"efghi") + b"\0\0\0"
    file.error = None
    file.close()


@pytest.mark.parametrize(
    ("number", "sound"), [(2**63 - 1, True), (-(2**63), False), (2**63, False), (10**400, False), (5, True)]
)
def test_whole_numbers_of_more_than_64_bits_are_refused_at_any_depth(number, sound):
    for text in (f"a = {number}", f"a = [[{number}]]", f"[a.b.c]\nd = {number}"):
        if sound:
            parse_toml(text, where="a.toml")
        else:
            with pytest.raises(InputError, match=r"a\.toml"):
                parse_toml(text, where="a.toml")


def test_a_number_of_json_may_have_three_hundred_digits_and_no_more():
    assert parse_json("[" + "1" * 300 + "]") == [int("1" * 300)]
    with pytest.raises(ValueError, match="more than 300 digits"):
        parse_json("[" + "1" * 301 + "]")


def test_a_pipe_and_a_folder_are_no_file_and_a_missing_one_is_not_found(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name, said in (("pipe", "a pipe, socket or device"), ("none.toml", "not found"), ("", "it is a folder")):
        assert said in str(no_file(tmp_path / name))
    with pytest.raises(InputError, match="a pipe, socket or device"):
        read_text(tmp_path / "pipe")


def test_what_is_no_path_or_no_text_is_refused_by_its_field(tmp_path):
    (tmp_path / "a.toml").write_bytes(b"a = 1\n\xff\xfe")
    for path, field, says in (
        (3, "rig", "rig must be a name or the path of a file, got 3"),
        (None, "file", "file must be a name or the path of a file, got None"),
        ("a\0b", "rig", "Rig file not found"),
        ("a\0b", "file", "File not found"),
        (tmp_path, "rig", "rig must be a TOML file, got "),
        (tmp_path / "b.toml", "rig", "Rig file not found: "),
        (tmp_path / "b.toml", "file", "File not found: "),
        (tmp_path / "b.toml", "--rig", "File not found: "),
        (tmp_path / "a.toml" / "c", "rig", "it cannot be read (Not a directory)"),
        (tmp_path / "a.toml", "rig", "a.toml: rig must be TOML in UTF-8"),
    ):
        with pytest.raises(InputError) as refused:
            read_text(path, field=field)
        assert says in str(refused.value)
