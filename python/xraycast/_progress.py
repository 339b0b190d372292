"""What `progress=` takes: a callable (fraction, stage), a tqdm bar, or the class tqdm itself."""
from collections.abc import Callable
from typing import Protocol

from ._errors import InputError


class Bar(Protocol):
    """What is used of tqdm."""

    def set_description(self, desc: str | None = None, refresh: bool | None = True) -> object: ...

    def close(self) -> object: ...


Listener = Callable[[float, str], object] | Bar | type[Bar]


class _Call:
    def __init__(self, function):
        self.function = function

    def __call__(self, stage, done, total, unit):
        self.function(done / total if total else 0.0, stage)

    def close(self):
        pass


class _Bar:
    def __init__(self, bar):
        self.is_own = isinstance(bar, type)
        self.bar = bar() if self.is_own else bar

    def __call__(self, stage, done, total, unit):
        self.bar.set_description(stage, refresh=False)
        self.bar.total = total
        self.bar.unit = unit
        self.bar.n = done
        self.bar.refresh()

    def close(self):
        if self.is_own:
            self.bar.close()


def listener_of(progress):
    """A function of stage, done, total and unit, with a method close()."""
    if hasattr(progress, "set_description"):
        return _Bar(progress)
    if callable(progress):
        return _Call(progress)
    raise InputError("progress: must be a callable (fraction, stage), or tqdm")
