"""RO-Crates: a recording as data repositories take it, a zip file of plain files and a description that machines read.

Inside are ``recording.nc`` and ``recording.csv``, which both hold all that the recording has, ``metadata.json`` with the
whole metadata, and ``ro-crate-metadata.json``: title, date, software, muscle, rig, protocol, every channel with its SI unit
and range, and the papers that the run cites. Source: RO-Crate Metadata Specification 1.1, doi:10.5281/zenodo.4541002.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from ..citations import doi, known_keys, reference
from ..documents import write_text
from ..errors import InputError
from ..isolation import check_unpacked
from .sidecar import unreadable
from .store import read_netcdf, write_csv, write_netcdf
from .table import FileFormat, ForeignTable, Samples, StoredRecording

PROFILE = "https://w3id.org/ro/crate/1.1"
CONTEXT = [f"{PROFILE}/context", {"sha256": "http://schema.org/sha256"}]  # younger than the terms of version 1.1
FILES = {"recording.nc": "application/x-netcdf", "recording.csv": "text/csv", "metadata.json": "application/json"}
ASKED = {"license": "a licence", "author": "an author"}  # what repositories ask for, by the entry of the metadata


def write_crate(recording: Samples, path: Path) -> list[str]:
    """Write a ``.zip`` file; a remark says what a repository will ask for and the metadata do not state."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        remarks = [*write_netcdf(recording, folder / "recording.nc"), *write_csv(recording, folder / "recording.csv")]
        text = json.dumps(_plain(recording.meta), indent=1, ensure_ascii=False)
        write_text(folder / "metadata.json", text)
        graph = _graph(recording, {name: (folder / name).read_bytes() for name in FILES})
        described = json.dumps({"@context": CONTEXT, "@graph": graph}, indent=1, ensure_ascii=False)
        write_text(folder / "ro-crate-metadata.json", described)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
            for name in ("ro-crate-metadata.json", *FILES):
                # a date that is always the same: equal recordings are equal files
                packed.writestr(zipfile.ZipInfo(name), (folder / name).read_bytes(), zipfile.ZIP_DEFLATED)
    lacking = " and ".join(words for name, words in ASKED.items() if not recording.meta.get(name))
    asks = f"the crate states no {lacking.replace('an ', '').replace('a ', '')}, which repositories ask for"
    return [*remarks, *([f"{asks}: with_meta({', '.join(f'{n}=..' for n in ASKED)}) adds them"] if lacking else [])]


def _plain(value: Any) -> Any:
    """What plain JSON can hold: what is not a number is null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _graph(recording: Samples, files: Mapping[str, bytes]) -> list[dict[str, Any]]:
    """The entities of the description, each under an id that others refer to."""
    meta = recording.meta
    created = str(meta.get("created") or datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"))
    parts: list[dict[str, Any]] = []

    def add(kind: str, identity: str, **said: Any) -> dict[str, str]:
        single = {
            key: value[0] if isinstance(value, list) and len(value) == 1 else value for key, value in said.items()
        }
        parts.append({"@id": identity, "@type": kind} | {key: value for key, value in single.items() if value})
        return {"@id": identity}

    held = [
        add("File", n, name=n, encodingFormat=FILES[n], contentSize=str(len(b)), sha256=hashlib.sha256(b).hexdigest())
        for n, b in files.items()
    ]
    channels = []
    for name, c in (("time", None), *recording.channels.items()):
        values = recording.time if c is None else c.values[np.isfinite(c.values)]
        ends = {"minValue": float(values.min()), "maxValue": float(values.max())} if len(values) else {}
        unit, meaning, kind = ("s", "time of the sample", "") if c is None else (c.unit, c.meaning, c.kind)
        about = {"name": name, "unitText": unit, "description": meaning, "measurementTechnique": kind}
        channels.append(add("PropertyValue", f"#channel-{quote(name)}", **about))
        parts[-1] |= ends
    things = {}
    for key, kind in (("specimen", "IndividualProduct"), ("rig", "IndividualProduct"), ("protocol", "HowTo")):
        if stated := meta.get(key):
            table = stated if isinstance(stated, Mapping) else meta.get(f"{key}_document")
            table = table if isinstance(table, Mapping) else {}
            name = str(table.get("title") or table.get("name") or table.get("id") or stated)
            note = str(table.get("note") or table.get("sentence") or "")
            things[key] = add(kind, f"#{key}", name=name, description=note, identifier=str(table.get("id") or ""))
    version = str(meta["versions"].get("mckibben", "")) if isinstance(meta.get("versions"), Mapping) else ""
    software = add("SoftwareApplication", "#mckibben", name="mckibben", softwareVersion=version)
    instruments = [software, *([things["rig"]] if "rig" in things else [])]
    add(
        "CreateAction", "#run", name=str(meta.get("title") or "recording"), instrument=instruments, result=held,
        object=things.get("specimen"), endTime=created, description=str(meta.get("sentence") or ""),
    )  # fmt: skip
    papers = []
    for key in meta.get("citations") or ():
        number = doi(key) if key in known_keys() else None
        identity = f"https://doi.org/{number}" if number else f"#paper-{key}"
        papers.append(add("ScholarlyArticle", identity, name=reference(key) if key in known_keys() else str(key)))
    home = str(meta.get("affiliation") or "")
    house = add("Organization", "#affiliation", name=home) if home else None
    author = add("Person", "#author", name=str(meta["author"]), affiliation=house) if meta.get("author") else None
    terms = str(meta.get("license") or "not stated")
    place = terms if terms.startswith(("http://", "https://")) else "#license"
    use = (
        f"Licence of the recording: {terms}"
        if meta.get("license")
        else "No licence is stated: ask the author before use"
    )
    license_ = add("CreativeWork", place, name=terms, description=use)  # a crate without one is not valid
    root = {
        "name": str(meta.get("title") or "recording"), "datePublished": created[:10], "license": license_,
        "description": str(meta.get("sentence") or meta.get("title") or "Recording of a muscle"), "author": author,
        "hasPart": held, "variableMeasured": channels, "mentions": [*things.values(), {"@id": "#run"}], "citation": papers,
        "publisher": house,
    }  # fmt: skip
    add("Dataset", "./", **root)
    described = {"@type": "CreativeWork", "conformsTo": {"@id": PROFILE}, "about": {"@id": "./"}}
    return [{"@id": "ro-crate-metadata.json"} | described, *parts]


def read_crate(path: Path) -> StoredRecording | ForeignTable:
    """Read the recording of a crate.

    Raises:
        InputError: it is no zip file, or no crate with a recording of mckibben.
    """
    with unreadable("a zip file", str(path)), zipfile.ZipFile(path) as packed:
        if "recording.nc" not in packed.namelist():
            problem = "must hold recording.nc, as a crate of mckibben does; unpack others and read what is inside"
            raise InputError("file", path.name, problem, where=str(path))
        check_unpacked(packed.getinfo("recording.nc").file_size)
        with tempfile.NamedTemporaryFile(suffix=".nc") as unpacked:
            with packed.open("recording.nc") as stored:
                shutil.copyfileobj(stored, unpacked)
            unpacked.flush()
            return read_netcdf(Path(unpacked.name))


FORMAT = FileFormat(title="RO-Crates", read=read_crate, write=write_crate)
