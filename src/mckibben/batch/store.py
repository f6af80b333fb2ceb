"""Results of a sweep in a zarr group: parameters, result codes, messages and outputs of every variant.

    results.zarr/
      parameters/<path>     (variants,)          SI floats with a unit, or words
      code, message         (variants,)          `VariantOutcome` and its sentence; -1 where it has not been run
      duration              (variants,)          simulated time [s]
      written               (variants,)          how often a result was written: once
      outputs/<name>        (variants,) or (variants, samples)

A block of variants is a chunk of every array, and a chunk is written whole or not at all; the codes are written last. So a
store that was left at any moment says which variants it holds, and the others are run by the next call.
"""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import errno
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ..documents import locked
from ..errors import InputError
from ..extras import library
from .outputs import TIME, VariantOutcome
from .run import Results
from .sweep import Sweep
from .variants import Variants

NAME, LOCK = "results.zarr", "sweep.lock"
SAMPLES = 4096  # of a chunk of whole channels
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
KEY = "mckibben"


class ResultStore:
    """Results of one sweep in a folder; created by `opened`."""

    def __init__(self, folder: Path, group: Any, count: int, block: int) -> None:
        self.folder, self.group, self.count, self.block = folder, group, count, block

    @property
    def path(self) -> Path:
        """Path of the zarr group."""
        return self.folder / NAME

    def codes(self) -> np.ndarray:
        """Result codes of all variants."""
        return np.asarray(self.group["code"][:])

    def measured(self) -> Results:
        """All results but whole channels, which may not fit into the memory."""
        outputs = {n: np.asarray(a[:]) for n, a in sorted(self.group["outputs"].arrays()) if a.ndim == 1}
        message = [str(m) for m in self.group["message"][:]]
        return Results(self.codes(), message, np.asarray(self.group["duration"][:]), outputs)

    def missing(self) -> list[slice]:
        """Blocks without results."""
        codes = self.codes()
        parts = (slice(i, min(i + self.block, self.count)) for i in range(0, self.count, self.block))
        return [part for part in parts if (codes[part] == VariantOutcome.NOT_RUN).any()]

    def write(self, part: slice, results: Results) -> None:
        """Write the results of a block.

        Raises:
            InputError: if the disk is full; what was written before stays.
        """
        with _full(self):
            for name, values in results.outputs.items():
                array = self.group[f"outputs/{name}"]
                if values.ndim > 1:
                    if array.shape[1] < values.shape[1]:
                        array.resize((self.count, values.shape[1]))
                    array[part, : values.shape[1]] = values
                else:
                    array[part] = values
            self.group["duration"][part] = results.duration
            self.group["message"][part] = np.array(results.message, object)
            self.group["written"][part] = np.asarray(self.group["written"][part]) + 1
            self.group["code"][part] = results.code


@contextlib.contextmanager
def opened(folder: str | os.PathLike[str], sweep: Sweep, block: int) -> Iterator[ResultStore]:
    """Open the store of a sweep, new or of an earlier call; other writers are locked out.

    Args:
        folder: made if it is not there.
        sweep: checked already.
        block: variants of a block; a store that is there keeps its own.

    Raises:
        InputError: if another sweep wrote it, another process is writing to it, it cannot be read, or the disk has no room.
    """
    zarr = zarr_library()
    place = Path(folder)
    new = not place.exists()
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError("out", str(place), f"the folder cannot be made ({error.strerror})") from None
    with locked(place / LOCK) as alone:
        if not alone:
            raise InputError("out", str(place), "another sweep is writing to it; wait for its end")
        path = place / NAME
        if (path / "zarr.json").exists():
            yield _known(place, sweep)
            return
        if path.exists() and any(path.iterdir()):
            raise InputError("out", str(path), "it is there already and no results of a sweep; choose another folder")
        draft = place / f"{NAME}.new"  # so that a store is there whole or not at all
        shutil.rmtree(draft, ignore_errors=True)
        try:
            columns = len(sweep.variants.columns) + len(sweep.template.outputs)  # whole channels come on top
            need = len(sweep.variants) * (8.0 * columns + 100.0) + 1e5
            free = shutil.disk_usage(place).free
            if need > free:
                said = f"the results need {need / 1e6:.3g} MB, the disk has {free / 1e6:.3g} MB"
                raise InputError("out", str(place), said)
            # Made in memory: zarr writes to a folder from several threads, which go on after one of them has failed.
            made: dict[str, Any] = {}
            _create(zarr.open_group(zarr.storage.MemoryStore(made), mode="w"), sweep, block)
            with _full(None, place):
                for key, content in made.items():
                    (draft / key).parent.mkdir(parents=True, exist_ok=True)
                    (draft / key).write_bytes(content.to_bytes())
                draft.rename(path)
        except BaseException:
            shutil.rmtree(place if new else draft, ignore_errors=True)
            raise
        yield ResultStore(place, zarr.open_group(path, mode="r+"), len(sweep.variants), block)


def _known(place: Path, sweep: Sweep) -> ResultStore:
    try:
        group = zarr_library().open_group(place / NAME, mode="r+", zarr_format=3)
        about: Any = group.attrs[KEY]
        digest, count, block = str(about["digest"]), int(about["variants"]), int(about["block"])
    except (KeyError, ValueError, TypeError, OSError):
        raise InputError("out", str(place / NAME), "it is no store of a sweep, or damaged") from None
    if digest != sweep.digest:
        title = about.get("title") or "without a title"
        said = f"it holds the results of another sweep ({title}, {count} variants, hash {digest[:12]}; this one has"
        raise InputError("out", str(place), f"{said} {sweep.digest[:12]}); choose another folder")
    return ResultStore(place, group, count, block)


def _create(group: Any, sweep: Sweep, block: int) -> None:
    from ..recordings.provenance import versions

    count = len(sweep.variants)

    def array(name: str, kind: Any, fill: Any, **attributes: object) -> Any:
        shape = {"shape": (count,), "chunks": (block,), "dimension_names": ("variant",)}
        return group.create_array(name, dtype=kind, fill_value=fill, attributes=attributes, **shape)

    for path, values in sweep.variants.columns.items():
        kind, fill = (float, np.nan) if values.dtype == float else (str, "")
        array(f"parameters/{path}", kind, fill, unit=sweep.template.settings[path].unit)[:] = values
    array("code", "i1", -1, meaning={o.name.lower(): int(o) for o in VariantOutcome})
    array("message", str, "")
    array("duration", float, np.nan, unit="s")
    array("written", "u1", 0)
    channels = {o.name: o for o in sweep.template.outputs}
    whole = [n for n, o in channels.items() if o.reduce == "samples"]
    for name, one in channels.items():
        if name not in whole:
            array(f"outputs/{name}", float, np.nan, **{k: v for k, v in dataclasses.asdict(one).items() if k != "name"})
    for name in [TIME, *whole] if whole else []:
        shape = {"shape": (count, 1), "chunks": (block, SAMPLES), "dimension_names": ("variant", "sample")}
        group.create_array(f"outputs/{name}", dtype=float, fill_value=np.nan, **shape)
    group.attrs[KEY] = {
        **sweep.document(),
        "digest": sweep.digest,
        "block": block,
        "version": versions()["mckibben"],
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def read_results(path: str | os.PathLike[str]) -> tuple[Variants, Results]:
    """Read the variants and results of a store; missing ones have the code -1.

    Raises:
        InputError: the file is no store of a sweep.
    """
    with _read(path) as group:
        columns = {p: np.asarray(group[f"parameters/{p}"][:]) for p in group.attrs[KEY]["parameters"]}
        outputs: Any = group["outputs"] if "outputs" in group else {}
        arrays = {n: np.asarray(outputs[n][:]) for n in sorted(outputs)}
        message = [str(m) for m in group["message"][:]]
        codes, duration = np.asarray(group["code"][:]), np.asarray(group["duration"][:])
    variants = Variants({p: v if v.dtype == float else v.astype(object) for p, v in columns.items()})
    return variants, Results(codes, message, duration, arrays)


def parameter_units(path: str | os.PathLike[str]) -> dict[str, str]:
    """SI units of the varied parameters of a store by path, empty for words.

    Raises:
        InputError: the file is no store of a sweep.
    """
    with _read(path) as group:
        return {p: str(group[f"parameters/{p}"].attrs.get("unit") or "") for p in group.attrs[KEY]["parameters"]}


@contextlib.contextmanager
def _read(path: str | os.PathLike[str]) -> Iterator[Any]:
    """Open a store, or the folder of one, to read; what does not hold a sweep's results is refused."""
    place = Path(path)
    place = place / NAME if (place / NAME).exists() else place
    try:
        # Format 3 as we write it: filters of format 2 may unpickle.
        yield zarr_library().open_group(place, mode="r", zarr_format=3)
    except (KeyError, ValueError, TypeError, OSError) as error:
        if isinstance(error, InputError):  # such as a missing library
            raise
        raise InputError("store", str(place), "must be the folder of a sweep's results") from None


def zarr_library() -> ModuleType:
    """Load the library that stores results.

    Raises:
        MissingLibraryError: it is not installed.
    """
    return library("zarr", "Results of sweeps need")


@contextlib.contextmanager
def _full(store: ResultStore | None, folder: Path | None = None) -> Iterator[None]:
    """Convert the error of a full disk to a message that states what is safe."""
    try:
        yield
    except OSError as error:
        if error.errno not in FULL:
            raise
        place = store.folder if store is not None else folder
        safe = "nothing was run"
        if store is not None:
            done = int((store.codes() != VariantOutcome.NOT_RUN).sum())
            safe = f"{done} of {store.count} variants are safe; make room and run the same command again"
        raise InputError("out", str(place), f"the disk is full ({error.strerror}); {safe}") from None
