"""Coroutines in a loop of their own."""

import asyncio
from collections.abc import Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Any


def completed(work: Coroutine[Any, Any, Any]) -> Any:
    """What a coroutine returns; in a separate thread, for a loop of the browser's driver may run in this one."""
    with ThreadPoolExecutor(1) as one:
        return one.submit(asyncio.run, work).result(60.0)
