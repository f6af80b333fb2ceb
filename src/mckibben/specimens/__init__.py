"""Published muscles as data: every number with its unit, its source, and whether it was inferred.

This room parses and builds nothing: `mckibben.muscles.from_specimen` makes laws and muscles of what is read here. Users
add their own files beside the shipped ones: name a ``.toml`` file, or put it in a folder listed in the environment
variable ``MCKIBBEN_SPECIMENS``.
"""

from .model import (
    KNOWN_PROPERTIES,
    Specimen,
    SpecimenNumber,
    find_specimen,
    map_file,
    muscle_specimen,
    save_specimen,
    specimen,
    specimen_ids,
    specimen_toml,
    specimens,
)

__all__ = [
    "KNOWN_PROPERTIES", "Specimen", "SpecimenNumber", "find_specimen", "map_file", "muscle_specimen", "save_specimen",
    "specimen", "specimen_ids", "specimen_toml", "specimens",
]  # fmt: skip
