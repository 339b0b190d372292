"""The contents of pickled objects: functions that make the objects again, and these functions' arguments."""
import os
import tempfile
import warnings
import zlib

from . import _core
from ._errors import InputError


def scan(self):
    """The file's name and a checksum of a scan that was read from a file, else the voxels."""
    if self._file:
        return open_again, (self._file, self.hu.shape, self.spacing_mm, self.origin_mm, zlib.crc32(self.hu))
    return of_array, (self.hu, self.spacing_mm, self.origin_mm, *self._description, self.notes, self.warnings)


def of_array(hu, spacing_mm, origin_mm, *description):
    return _core.Scan._of_array(hu, spacing_mm, origin_mm, *description)


def open_again(file, shape, spacing_mm, origin_mm, checksum):
    path, series, keep_slices, skip_damaged, offset_hu = file
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they were given when it was first read
        found = _core.open(path, series=series, keep_slices=keep_slices, skip_damaged=skip_damaged,
                           offset_hu=offset_hu)
    is_same_grid = (found.hu.shape, found.spacing_mm, found.origin_mm) == (shape, spacing_mm, origin_mm)
    if not is_same_grid or zlib.crc32(found.hu) != checksum:
        raise InputError(f"{path}: is not the scan that was pickled; pickle it again")
    return found


def opacity(self):
    return _core.Opacity, (self.knots, self.name)


def tree(self):
    return _core.VesselTree, ([(b.points, b.parent, b.name) for b in self.branches],)


def body_map(self):
    """The bytes of the map's file."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "map.exr")
        self.write(path)
        with open(path, "rb") as file:
            return map_of, (file.read(),)


def map_of(bytes_):
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "map.exr")
        with open(path, "wb") as file:
            file.write(bytes_)
        return _core.BodyMap.read(path)
