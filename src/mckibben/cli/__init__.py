"""The command line: it parses options with units, calls the functions of the package, and prints.

Every command that ends by itself takes ``--json`` and then prints exactly one JSON object. Exit codes: 0 done, 1 a
comparison fell short, 2 the user's input is wrong (one line on standard error).
"""

from .app import main

__all__ = ["main"]
