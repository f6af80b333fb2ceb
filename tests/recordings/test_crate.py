"""RO-Crates: a description in which every reference leads somewhere, and the recording as it was."""

import hashlib
import json
import zipfile

import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben.recordings import convert, write

META = {
    "title": "Loop at 3 bar", "sentence": "One triangle.", "specimen": "nylon", "rig": "modern",
    "created": "2026-03-31T12:00:00+00:00",
    "rig_document": {"title": "Test machine", "note": "16 bit"}, "protocol": {"name": "quasi-static", "title": "Triangle"},
    "citations": ["chou1996"], "versions": {"mckibben": "0.1.0"}, "seed": 0,
}  # fmt: skip


@pytest.fixture
def recording():
    channels = {"span": mk.Channel([0.12, 0.13, 0.12], "m", "measured", "span by the encoder")}
    channels["load cell no. 1"] = mk.Channel([20.0, float("nan"), 21.0], "N", "measured")
    return mk.Recording([0.0, 0.1, 0.2], channels, META)


def graph_of(path):
    with zipfile.ZipFile(path) as packed:
        return json.loads(packed.read("ro-crate-metadata.json"))["@graph"]


# What the context of RO-Crate 1.1 has no term for, its schema.org being of 2020; a validator refuses keys without one.
YOUNGER = {"sha256"}


def references(value):
    """All ids that a value refers to."""
    if isinstance(value, dict):
        yield from [value["@id"]] if set(value) == {"@id"} else [one for v in value.values() for one in references(v)]
    elif isinstance(value, list):
        yield from (one for v in value for one in references(v))


def test_a_crate_reads_back_as_the_recording_that_it_was(recording, tmp_path):
    write(recording, tmp_path / "loop.zip")
    assert mk.read(tmp_path / "loop.zip") == recording
    convert(tmp_path / "loop.zip", tmp_path / "loop.nc")
    assert mk.read(tmp_path / "loop.nc") == recording


def test_every_reference_of_the_description_leads_to_an_entity_or_a_page(recording, tmp_path):
    write(recording, tmp_path / "loop.zip")
    graph = graph_of(tmp_path / "loop.zip")
    ids = [one["@id"] for one in graph]
    assert len(ids) == len(set(ids))
    assert {one for entity in graph for one in references(list(entity.values()))} <= {
        *ids,
        "https://w3id.org/ro/crate/1.1",
    }


def test_terms_that_are_younger_than_the_context_are_declared(recording, tmp_path):
    write(recording, tmp_path / "loop.zip")
    with zipfile.ZipFile(tmp_path / "loop.zip") as packed:
        base, own = json.loads(packed.read("ro-crate-metadata.json"))["@context"]
    assert base == "https://w3id.org/ro/crate/1.1/context" and set(own) == YOUNGER


def test_the_description_has_files_units_muscle_rig_protocol_and_paper(recording, tmp_path):
    write(recording, tmp_path / "loop.zip")
    entities = {one["@id"]: one for one in graph_of(tmp_path / "loop.zip")}
    root = entities["./"]
    assert root["datePublished"] == "2026-03-31" and root["name"] == META["title"]
    with zipfile.ZipFile(tmp_path / "loop.zip") as packed:
        for part in root["hasPart"]:
            assert entities[part["@id"]]["sha256"] == hashlib.sha256(packed.read(part["@id"])).hexdigest()
    channels = {entities[one["@id"]]["name"]: entities[one["@id"]] for one in root["variableMeasured"]}
    assert {name: one["unitText"] for name, one in channels.items()} == {
        "time": "s",
        "span": "m",
        "load cell no. 1": "N",
    }
    assert (channels["load cell no. 1"]["minValue"], channels["load cell no. 1"]["maxValue"]) == (20.0, 21.0)
    assert [entities[one["@id"]]["name"] for one in root["mentions"]][:3] == ["nylon", "Test machine", "Triangle"]
    assert root["citation"] == {"@id": "https://doi.org/10.1109/70.481753"}
    assert {"@id": "#rig"} in entities["#run"]["instrument"] and entities["#run"]["object"] == {"@id": "#specimen"}


def test_what_a_repository_asks_for_is_said_until_it_is_stated(recording, tmp_path):
    assert "licence and author" in write(recording, tmp_path / "loop.zip")[-1]
    entities = {one["@id"]: one for one in graph_of(tmp_path / "loop.zip")}
    assert "ask the author before use" in entities[entities["./"]["license"]["@id"]]["description"]
    assert write(recording.with_meta(license="CC-BY-4.0", author="A. B."), tmp_path / "loop.zip") == []
    entities = {one["@id"]: one for one in graph_of(tmp_path / "loop.zip")}
    root = entities["./"]
    assert entities[root["license"]["@id"]]["name"] == "CC-BY-4.0" and root["author"] == {"@id": "#author"}
    write(recording.with_meta(license="https://example.org/terms", author="A. B."), tmp_path / "loop.zip")
    root = next(one for one in graph_of(tmp_path / "loop.zip") if one["@id"] == "./")
    assert root["license"] == {"@id": "https://example.org/terms"}


def test_equal_recordings_are_equal_crates_but_for_the_time_in_netcdf(recording, tmp_path):
    write(recording, tmp_path / "a.zip")
    write(recording, tmp_path / "b.zip")
    with zipfile.ZipFile(tmp_path / "a.zip") as a, zipfile.ZipFile(tmp_path / "b.zip") as b:
        for name in ("recording.csv", "metadata.json"):
            assert a.read(name) == b.read(name)


def test_a_zip_file_of_others_is_refused_in_one_sentence(tmp_path):
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as packed:
        packed.writestr("data.csv", "1,2")
    with pytest.raises(InputError, match="recording.nc"):
        mk.read(tmp_path / "other.zip")
    (tmp_path / "broken.zip").write_bytes(b"PK\x03\x04")
    with pytest.raises(InputError, match="zip file"):
        mk.read(tmp_path / "broken.zip")
