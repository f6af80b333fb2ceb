"""What processes of their own are given to read with; in a file that is soon imported."""

import os

from mckibben.errors import InputError


def who(path, words):
    """Which process reads, and what."""
    return os.getpid(), path.read_text(), words


def refuse(path):
    """As a reader does."""
    raise InputError("row 3", "x", "must be a number", where=path.name)


def die(path):
    """As a process does that a damaged file brings down."""
    os.kill(os.getpid(), 9)


def read_for_ever(path):
    """Of a pipe into which nobody writes."""
    return path.read_bytes()


def cells(path):
    """A reader that holds the interpreter."""
    return len([line.split(",") for line in path.read_text().splitlines()])
