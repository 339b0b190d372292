"""What to do with each scan; the same for all of a run."""
import csv
import dataclasses
import hashlib
import json
import math
import pathlib

from .. import _core
from .._errors import InputError

STEPS = ("info", "cast", "segment", "frames")


@dataclasses.dataclass(frozen=True)
class Options:
    """All of it changes the outputs, so all of it is part of an attempt's hash."""
    steps: tuple = ("info", "cast")
    layers: int = 1
    angles: int = 360
    opacity: str = "paper"
    frames: int = 16
    size: tuple = (512, 512)
    seed: int = 1
    poses: tuple = ()  # of (lao, cranial) in degrees; else random ones
    catheter: str = ""
    opacity_digest: str = ""  # of the opacity's file, if it is one

    def hash_with(self, identity):
        """Of the options and the identity of a scan's files."""
        text = json.dumps([dataclasses.asdict(self), identity], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:32]


def steps_of(text):
    """Steps in the order in which they are taken. Raises InputError."""
    names = text.split(",")
    for name in names:
        if name not in STEPS:
            raise InputError(f"--steps {name}: unknown step; choose from {', '.join(STEPS)}")
    return tuple(step for step in STEPS if step in names)


def opacity_of(name):
    """An opacity's name or absolute path, and the digest of its file. Raises InputError."""
    if not name.endswith(".json"):
        if not name.startswith("spectrum:"):
            _core.Opacity.named(name)  # throws where there is none
        return name, ""
    path = pathlib.Path(name).resolve()
    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"--opacity {name}: {error.strerror}; name a file that can be read") from None
    _core.Opacity.named(str(path))
    return str(path), digest


def poses_of(path):
    """Pairs of angles from a CSV file with the columns lao and cranial. Raises InputError."""
    try:
        with open(path, newline="", encoding="utf-8") as file:
            poses = tuple((float(row["lao"]), float(row["cranial"])) for row in csv.DictReader(file))
    except OSError as error:
        raise InputError(f"--poses {path}: {error.strerror}; name a file that can be read") from None
    except (KeyError, TypeError, ValueError):
        poses = ()
    if not poses or not all(math.isfinite(angle) for pose in poses for angle in pose):
        raise InputError(f"--poses {path}: must have the columns lao and cranial, in degrees, and a line for each pose")
    return poses
