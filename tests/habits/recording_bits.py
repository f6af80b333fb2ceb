"""Whether the recordings of a set of runs have the same bits as before a change.

    python tests/habits/recording_bits.py keep FILE.json      before
    python tests/habits/recording_bits.py check FILE.json     after; exit code 1 where a channel differs

Every run is a command, as a user types it; each data set of its recording is reduced to a digest. Digests are compared
on one machine only: another processor may round a last digit otherwise.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

RUNS = {
    "isometric step on the paper's rig": "run isometric-step --muscle nylon",
    "isometric step on the modern rig": "run isometric-step --muscle nylon --rig modern --seed 3",
    "isotonic triangle": "run isotonic-triangle --muscle nylon --rig modern",
    "quasi-static triangle": "run quasi-static --muscle nylon",
    "sinusoids": "run sinusoids --muscle nylon --seed 7",
    "quick release": "run quick-release --muscle nylon --rig modern",
    "work loop": "run work-loop --muscle nylon --rig modern",
    "work loop of a fitted muscle": "run work-loop --muscle DMSP-20-300 --rig modern --seed 1",
    "isokinetic shortening": "run isokinetic --muscle nylon --rig modern",
    "isobaric map": "run isobaric-map --muscle nylon --rig modern",
    "preconditioning": "run preconditioning --muscle nylon --rig modern",
}


def digests(path: Path) -> dict[str, str]:
    """A digest of the bytes of each data set of a netCDF file."""
    found: dict[str, str] = {}

    def visit(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if isinstance(item, h5py.Dataset):
            values = np.asarray(item[()])
            content = repr(values.tolist()).encode() if values.dtype == object else values.tobytes()
            found[name] = hashlib.sha256(content).hexdigest()[:16]

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


def recorded(command: str, folder: Path) -> dict[str, str]:
    """Run a command, and reduce its recording to digests."""
    out = folder / "recording.nc"
    out.unlink(missing_ok=True)
    words = [sys.executable, "-m", "mckibben", *command.split(), "--out", str(out)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"mckibben {command} ended with exit code {done.returncode}: {done.stderr.strip()}")
    return digests(out)


def main() -> int:
    """Keep the digests of all runs, or compare with those that were kept."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["keep", "check"])
    parser.add_argument("file", type=Path, help="the JSON file of the digests")
    options = parser.parse_args()
    before = json.loads(options.file.read_text()) if options.action == "check" else {}
    now, differing = {}, 0
    with tempfile.TemporaryDirectory() as folder:
        for name, command in RUNS.items():
            now[name] = recorded(command, Path(folder))
            if options.action == "check":
                names = sorted(now[name].keys() | before.get(name, {}).keys())
                changed = [n for n in names if now[name].get(n) != before.get(name, {}).get(n)]
                differing += bool(changed)
                print(f"{name}: {'differs in ' + ', '.join(changed) if changed else 'the same bits'}", flush=True)
    if options.action == "keep":
        options.file.write_text(json.dumps(now, indent=1))
    return bool(differing)


if __name__ == "__main__":
    sys.exit(main())
