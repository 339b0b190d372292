#!/usr/bin/env python3
"""Registers an X-ray picture to a CT scan: finds the pose from which the scan's projection is the picture.

    register.py SCAN [STARTS]

makes a picture of the scan from a known pose, starts from as many random poses (10 by default) within 20 mm and 10 deg of
it, and prints how far each ends from the truth: the mean distance over the corners of the body's box.

Gauss and Newton's method with Levenberg's and Marquardt's damping on the difference of optical depths, from a coarse scan
and a small picture to fine ones. The derivatives are those of `project(..., gradient=True)`.
"""
import sys
import time
from typing import Any

import numpy as np
import xraycast as xc
from numpy.typing import NDArray

Array = NDArray[Any]
SIZE, CONE_MM = (640, 480), (1000, 1500)
LEVELS = ((8, 16), (4, 8), (1, 4))  # voxels averaged along each axis, and pixels


def averaged(array: Array, factor: int) -> Array:
    """Means over blocks of `factor` along every axis; what does not fill a block is left out."""
    for axis in range(array.ndim):
        count = array.shape[axis] // factor
        array = np.take(array, range(count * factor), axis)
        array = array.reshape(*array.shape[:axis], count, factor, *array.shape[axis + 1:]).mean(axis + 1)
    return array


def coarser(scan: xc.Scan, factor: int) -> xc.Scan:
    """The scan in voxels of so many voxels along x and y, and of about their size along z."""
    if factor == 1:
        return scan
    spacing = np.array(scan.spacing_mm)
    along_z = max(1, round(factor * spacing[0] / spacing[2]))
    hu = averaged_volume(scan.hu, along_z, factor)
    factors = np.array([factor, factor, along_z])
    origin = np.array(scan.origin_mm) + (factors - 1) / 2 * spacing
    return xc.Scan.from_array(hu, spacing * factors, origin)


def averaged_volume(hu: Array, along_z: int, factor: int) -> Array:
    slices, rows, columns = (hu.shape[0] // along_z, hu.shape[1] // factor, hu.shape[2] // factor)
    hu = hu[:slices * along_z, :rows * factor, :columns * factor]
    sums: Array = np.add.reduce(hu.reshape(slices, along_z, rows, factor, columns, factor), axis=(1, 3, 5), dtype=np.float32)
    rounded: Array = np.round(sums / (along_z * factor * factor)).astype(np.int16)
    return rounded


def smaller(k: Array, factor: int) -> Array:
    """The camera of a picture whose pixels are means of `factor` x `factor`."""
    k = k.copy()
    k[:2, 2] = (k[:2, 2] - (factor - 1) / 2) / factor
    k[0, 0] /= factor
    k[1, 1] /= factor
    return k


def sampled(picture: Array, k: Array, factor: int) -> tuple[Array, Array]:
    """Every so many pixels along rows and columns, and their camera."""
    first = factor // 2
    k = k.copy()
    k[:2, 2] = (k[:2, 2] - first) / factor
    k[0, 0] /= factor
    k[1, 1] /= factor
    return picture[first::factor, first::factor], k


def rotation(vector: Array) -> Array:
    """The rotation by a vector in rad, by Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle if angle > 0 else vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: Array = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turned


def moved(rt: Array, motion: Array, centre: Array) -> Array:
    """RT after source and detector moved by `motion`: mm along x, y and z, then a rotation vector about `centre`."""
    turn = rotation(motion[3:])
    back = np.column_stack([turn.T, turn.T @ (-centre - motion[:3]) + centre])  # of the points in the camera's eyes
    after: Array = rt[:, :3] @ back + np.column_stack([np.zeros((3, 3)), rt[:, 3]])
    return after


def refine(scan: xc.Scan, picture: Array, k: Array, rt: Array, centre: Array, iterations: int = 30) -> Array:
    """Gauss-Newton steps while they help."""
    size = picture.shape[::-1]
    scale = np.repeat([1.0, 1 / 100], 3)  # a hundredth of a radian moves the body's border by as much as a millimetre
    frame = scan.project(K=k, RT=rt, size=size, gradient=True)
    residual, damping = picture - frame.tau, 1e-3
    for _ in range(iterations):
        slopes = frame.gradient.reshape(-1, 6) * scale
        hessian, slope = slopes.T @ slopes, slopes.T @ residual.ravel()
        step = scale * np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), slope)
        trial = moved(rt, step, centre)
        after = scan.project(K=k, RT=trial, size=size, gradient=True)
        left = picture - after.tau
        if np.square(left).sum() < np.square(residual).sum():
            gain = 1 - np.square(left).sum() / np.square(residual).sum()
            rt, frame, residual, damping = trial, after, left, damping / 5
            if gain < 1e-4:
                break
        else:
            damping *= 10
            if damping > 1e6:
                break
    return rt


def register(pyramid: list[xc.Scan], picture: Array, k: Array, rt: Array) -> Array:
    """The pose of a picture of optical depths, from one near to it; `pyramid` as `pyramid_of` makes it."""
    for (_, pixels), scan in zip(LEVELS, pyramid):
        rt = refine(scan, averaged(picture, pixels), smaller(k, pixels), rt, np.array(scan.centre_mm))
    # Means over pixels are not what single rays meet, above all where the scan cuts the body off: at last, compare rays.
    seen, camera = sampled(picture, k, LEVELS[-1][1])
    return refine(pyramid[-1], seen, camera, rt, np.array(pyramid[-1].centre_mm))


def pyramid_of(scan: xc.Scan) -> list[xc.Scan]:
    return [coarser(scan, voxels) for voxels, _ in LEVELS]


def corners_of(scan: xc.Scan) -> Array:
    """Of the box around what is denser than -300 HU."""
    lower, upper = [], []
    for axis in (2, 1, 0):
        inside = np.flatnonzero((scan.hu > -300).any(axis=tuple(a for a in range(3) if a != axis)))
        lower.append(inside[0])
        upper.append(inside[-1])
    box = np.array([lower, upper]) * scan.spacing_mm + scan.origin_mm
    return np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def error_mm(rt: Array, truth: Array, corners: Array) -> float:
    """The mean distance between the corners as either camera sees them."""
    seen = [corners @ m[:, :3].T + m[:, 3] for m in (rt, truth)]
    return float(np.linalg.norm(seen[0] - seen[1], axis=1).mean())


def start_near(truth: Array, centre: Array, random: np.random.Generator) -> Array:
    """A pose within 20 mm and 10 deg of the truth."""
    direction, axis = random.normal(size=(2, 3))
    motion = np.concatenate([random.uniform(0, 20) * direction / np.linalg.norm(direction),
                             np.radians(random.uniform(0, 10)) * axis / np.linalg.norm(axis)])
    return moved(truth, motion, centre)


def main(path: str, starts: str = "10") -> None:
    scan = xc.open(path)
    target = scan.project(20, 5, SIZE, CONE_MM)
    corners, pyramid, random = corners_of(scan), pyramid_of(scan), np.random.default_rng(1)
    errors, times = [], []
    for number in range(int(starts)):
        start = start_near(target.RT, np.array(scan.centre_mm), random)
        began = time.monotonic()
        found = register(pyramid, target.tau, target.K, start)
        times.append(time.monotonic() - began)
        errors.append(error_mm(found, target.RT, corners))
        print(f"{number}: {error_mm(start, target.RT, corners):.1f} mm -> {errors[-1]:.3f} mm in {times[-1]:.2f} s", flush=True)
    print(f"{sum(e < 1 for e in errors)} of {len(errors)} within 1 mm; median {np.median(errors):.3f} mm, {np.median(times):.2f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
