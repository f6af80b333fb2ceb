"""Take away from Python what only Linux has; a folder for PYTHONPATH, so that processes of a program lack it too.

No `fork`, no priorities, no counting of cores by affinity, no pseudo-terminals, no hang-up; neither `resource` nor `fcntl`
can be imported; nothing below /proc or /dev/shm can be opened. What the interpreter's own subprocesses need is left.
"""

import multiprocessing
import os
import signal
import sys

GONE = (
    "fork", "forkpty", "nice", "sched_getaffinity", "sched_setscheduler", "sched_param", "getloadavg", "openpty", "ttyname",
    "wait4", "setsid", "killpg", "sysconf", "statvfs", "mkfifo", "posix_fadvise", "posix_fallocate", "geteuid", "O_NONBLOCK",
)  # fmt: skip


class _Absent:
    def find_spec(self, name, path=None, target=None):
        if name in ("resource", "fcntl", "termios", "tty", "pty", "pwd", "grp"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return None


def _open(event, arguments):
    if event in ("open", "os.listdir", "os.scandir") and str(arguments[0]).startswith(("/proc", "/dev/shm")):
        raise FileNotFoundError(2, "No such file or directory", arguments[0])


multiprocessing.set_start_method("spawn")
for module, names in ((os, GONE), (signal, ("SIGHUP", "SIGALRM", "setitimer"))):
    for name in names:
        if hasattr(module, name):
            delattr(module, name)
sys.meta_path.insert(0, _Absent())
for name in ("resource", "fcntl", "termios", "tty", "pty", "pwd", "grp"):
    sys.modules.pop(name, None)
sys.addaudithook(_open)
