"""A promise that something will be done, as Bluesky's plans wait for it."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable


class DeviceStatus:
    """Something that goes on, and ends once; safe for use by several threads.

    Args:
        what: description for the user.
    """

    def __init__(self, what: str = "") -> None:
        self.what = what
        self._ended, self._lock = threading.Event(), threading.Lock()
        self._error: BaseException | None = None
        self._callbacks: list[Callable[[DeviceStatus], None]] = []

    @classmethod
    def of(cls, what: str, work: Callable[[DeviceStatus], object]) -> DeviceStatus:
        """That of some work, which is given it, in a thread of its own; it fails with what the work raises."""
        status = cls(what)

        def do() -> None:
            try:
                work(status)
            except BaseException as error:
                status.finish(error)
            else:
                status.finish()

        threading.Thread(target=do, name=what, daemon=True).start()
        return status

    def finish(self, error: BaseException | None = None) -> None:
        """It is done, or failed with an error; what is said after the first time is not heard."""
        with self._lock:
            if self._ended.is_set():
                return
            self._error = error
            self._ended.set()
            told, self._callbacks = self._callbacks, []
        for callback in told:
            self._tell(callback)

    def add_callback(self, callback: Callable[[DeviceStatus], None]) -> None:
        """Tell somebody when it is done, or now if it is; an error of theirs is logged and goes no further."""
        with self._lock:
            if not self._ended.is_set():
                self._callbacks.append(callback)
                return
        self._tell(callback)

    def _tell(self, callback: Callable[[DeviceStatus], None]) -> None:
        try:
            callback(self)
        except Exception:
            logging.getLogger(__name__).exception("a callback of %r failed", self)

    @property
    def done(self) -> bool:
        """Whether it has ended, well or not."""
        return self._ended.is_set()

    @property
    def success(self) -> bool:
        """Whether it has ended well."""
        return self._ended.is_set() and self._error is None

    def exception(self, timeout: float | None = 0.0) -> BaseException | None:
        """Why it failed; None if it did not.

        Args:
            timeout: longest time to wait for its end [s]; None: as long as it takes.

        Raises:
            TimeoutError: if it has not ended by then.
        """
        if not self._ended.wait(timeout):
            raise TimeoutError(f"{self.what} goes on after {timeout:g} s" if timeout else f"{self.what} goes on")
        return self._error

    def wait(self, timeout: float | None = None) -> None:
        """Until it is done.

        Args:
            timeout: longest time to wait [s]; None: as long as it takes.

        Raises:
            TimeoutError: if it has not ended by then.
            BaseException: why it failed.
        """
        error = self.exception(timeout)
        if error is not None:
            raise error

    def __repr__(self) -> str:
        state = "goes on" if not self.done else "done" if self.success else f"failed: {self._error}"
        return f"DeviceStatus({self.what}: {state})"
