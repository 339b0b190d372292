"""One run at a time writes to an OUT; the parts of an array job may run side by side."""
import fcntl
import os
import socket

from .._errors import InputError


class RunLock:
    """Holds OUT/lock, and of a part its own lock too, until close() or the process's end. Raises InputError."""

    def __init__(self, out, part=None):
        self._files = []
        self._take(out / "lock", fcntl.LOCK_SH if part else fcntl.LOCK_EX)
        if part:
            self._take(out / f"lock-{part[0]}-of-{part[1]}", fcntl.LOCK_EX)

    def _take(self, path, mode):
        file = open(path, "a+")
        self._files.append(file)
        try:
            fcntl.flock(file, mode | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            holder = file.read().strip()
            self.close()
            raise InputError(f"{path}: another run writes to this folder{f' ({holder})' if holder else ''}; "
                             "wait for it, or give another folder by -o") from None
        if mode == fcntl.LOCK_EX:
            file.truncate(0)
            file.write(f"process {os.getpid()} on {socket.gethostname()}\n")
            file.flush()

    def close(self):
        for file in self._files:
            file.close()
        self._files = []
