"""DRRs by PyPI's nanodrr, on the processor: for the test of systems and the benchmark."""
import numpy as np
import torch
import xraycast as xc
from nanodrr.data import Subject
from nanodrr.drr.renderer import render

# Linear over all CT numbers: nanodrr interpolates mu, and we CT numbers.
LEAST_HU, MOST_HU, MOST_MU = -1024, 3071, 0.08
OPACITY = xc.Opacity([(LEAST_HU, 0), (MOST_HU, MOST_MU)], "linear")


def without_rim(scan):
    """The scan with air in its outermost voxels: beyond its centres nanodrr fades into air, and we hold them up to their faces."""
    hu = scan.hu.copy()
    for axis in range(3):
        np.moveaxis(hu, axis, 0)[[0, -1]] = LEAST_HU
    return xc.Scan.from_array(hu, scan.spacing_mm, scan.origin_mm)


def with_half_voxels(scan):
    """The same field, linear between eight voxels, of voxels of half the size."""
    hu = scan.hu.astype(np.float32)
    for axis in range(3):
        hu = np.moveaxis(hu, axis, 0)
        halves = np.empty((2 * len(hu) - 1, *hu.shape[1:]), np.float32)
        halves[::2], halves[1::2] = hu, (hu[1:] + hu[:-1]) / 2
        hu = np.moveaxis(halves, 0, axis)
    return xc.Scan.from_array(np.rint(hu).astype(np.int16), np.divide(scan.spacing_mm, 2), scan.origin_mm)


def subject_of(scan):
    """The scan's attenuation, as nanodrr takes it."""
    mu = np.interp(scan.hu.astype(np.float32), (LEAST_HU, MOST_HU), (0, MOST_MU)).astype(np.float32)
    to_world = np.diag([*scan.spacing_mm, 1.0])
    to_world[:3, 3] = scan.origin_mm
    image = torch.from_numpy(mu)[None, None]
    label = torch.zeros(1, 1, 1, 1, 1)
    float32 = lambda array: torch.tensor(array, dtype=torch.float32)  # noqa: E731
    return Subject(image, label, float32(to_world), float32(np.linalg.inv(to_world)), Subject._make_voxel_to_grid(image.shape),
                   float32(scan.centre_mm), 0, convert_to_mu=False)


def tau_of(subject, K, RT, size, source_detector_mm, samples):
    """(rows, columns); nanodrr's pixel (0, 0) has its middle at (0.5, 0.5)."""
    shifted = np.array(K)
    shifted[:2, 2] += 0.5
    inverse = lambda matrix: torch.tensor(np.linalg.inv(matrix), dtype=torch.float32)[None]  # noqa: E731
    with torch.no_grad():
        picture = render(subject, inverse(shifted), inverse(np.vstack([RT, [0, 0, 0, 1]])), torch.tensor([float(source_detector_mm)]),
                         size[1], size[0], n_samples=samples)
    return picture[0, 0].numpy()
