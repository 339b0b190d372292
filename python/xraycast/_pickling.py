"""What pickles of objects hold: functions that make them again, and these functions' arguments."""
import warnings

from . import _core
from ._errors import InputError


def scan(self):
    """A scan by its file where it was read from one, else with its voxels."""
    if self._file:
        return open_again, (self._file, self.hu.shape, self.spacing_mm, self.origin_mm)
    return of_array, (self.hu, self.spacing_mm, self.origin_mm)


def of_array(hu, spacing_mm, origin_mm):
    return _core.Scan.from_array(hu, spacing_mm, origin_mm)


def open_again(file, shape, spacing_mm, origin_mm):
    path, series, keep_slices, skip_damaged = file
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they were given when it was first read
        found = _core.open(path, series=series, keep_slices=keep_slices, skip_damaged=skip_damaged)
    if (found.hu.shape, found.spacing_mm, found.origin_mm) != (shape, spacing_mm, origin_mm):
        raise InputError(f"{path}: is not the scan that was pickled; pickle it again")
    return found


def opacity(self):
    return _core.Opacity, (self.knots, self.name)


def tree(self):
    return _core.VesselTree, ([(self[i].points, self[i].parent) for i in range(len(self))],)
