"""The line on stderr that tells how far a run is."""
import sys
import time

INTERVAL_S = 0.5


class ProgressLine:
    """On a terminal only, unless it is quiet."""

    def __init__(self, total, is_quiet):
        self._total, self._is_shown = total, sys.stderr.isatty() and not is_quiet
        self._start = time.monotonic()
        self._shown = 0.0

    def show(self, ended, bad):
        now = time.monotonic()
        if not self._is_shown or now - self._shown < INTERVAL_S:
            return
        self._shown = now
        rate = ended / (now - self._start)
        left = f", {_duration(round((self._total - ended) / rate))} left" if ended else ""
        sys.stderr.write(f"\r\033[K{ended} of {self._total} scans, {bad} bad, {rate:.2g} a second{left}")
        sys.stderr.flush()

    def clear(self):
        if self._is_shown:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()


def _duration(seconds):
    hours, seconds = divmod(seconds, 3600)
    return f"{hours} h {seconds // 60} min" if hours else f"{seconds // 60} min {seconds % 60} s" if seconds > 99 else f"{seconds} s"
