"""Files of TOML: read whole, or one clear line."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any

from .errors import InputError


def read_text(path: str | os.PathLike[str], *, field: str = "file") -> str:
    """The text of a file.

    Args:
        path: of a file in UTF-8.
        field: what a complaint calls it.

    Raises:
        InputError: there is no such file, or it is no text.
    """
    where = os.fspath(path)
    try:
        return Path(path).read_bytes().decode("utf-8")
    except IsADirectoryError:
        raise InputError(field, where, "it is a folder; allowed is a TOML file") from None
    except FileNotFoundError:
        raise InputError(field, where, "no such file") from None
    except OSError as error:
        raise InputError(field, where, f"it cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise InputError(field, "not TOML", f"allowed is TOML in UTF-8: {error}", where=where) from None


def parse_toml(text: str, *, where: str, field: str = "file") -> dict[str, Any]:
    """The tables of a text.

    Raises:
        InputError: says where it is no TOML.
    """
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number of 5,000 digits is a plain ValueError
        raise InputError(field, "not TOML", str(error), where=where) from None


def read_toml(path: str | os.PathLike[str], *, field: str = "file") -> dict[str, Any]:
    """The tables of a file.

    Raises:
        InputError: as `read_text` and `parse_toml`.
    """
    return parse_toml(read_text(path, field=field), where=os.fspath(path), field=field)
