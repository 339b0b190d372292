#!/usr/bin/env python3
"""How near a picture of registered bones through the fluoroscope's chain is to the X-ray: prints the table of docs/realism.md.

usage: realism.py PACKAGE DATA [FOLDER], by an interpreter with NumPy and Pillow. DATA holds wrist-xrays, of which the poses are in
tests/systems/wrist_poses.json; FOLDER gets pictures to look at, X-ray and ours side by side.
"""
import json
import pathlib
import sys

import numpy as np
from PIL import Image

sys.path.insert(0, sys.argv[1])
import xraycast as xc  # noqa: E402

DATA = pathlib.Path(sys.argv[2], "wrist-xrays")
FOLDER = pathlib.Path(sys.argv[3]) if len(sys.argv) > 3 else None
POSES = json.loads((pathlib.Path(__file__).parents[2] / "tests/systems/wrist_poses.json").read_text())
SPACING_MM = (0.39625, 0.39625, 0.625)
OPACITY = xc.Opacity([(0, 0), (4095, 0.1)], "grey")
CONE_MM = (1040, 1200)  # the bones are 1.02 to 1.07 m from the sources; the detectors' distance is not told
PLATE_MM = 5
WRONG_MM = 5
COMPRESSIONS = (0, 0.6)  # of the display
SOFTER = 0.86  # pixels of a Gaussian by which our edges are as soft as the X-ray's
FOREARM = ("rad", "uln")


# ---- what is there --------------------------------------------------------------------------------


def camera(number):
    lines = [line.strip() for line in (DATA / f"xr_calib_wrist_cam0{number}.txt").read_text().splitlines()]
    rows = lambda name: np.array([[float(x) for x in lines[lines.index(name) + 1 + i].split(",")] for i in range(3)])  # noqa: E731
    return rows("camera matrix"), np.hstack([rows("rotation"), rows("translation")])


def grey_picture(path):
    return np.asarray(Image.open(path).convert("L"), dtype=float)


def bone_scan(bone):
    stack = Image.open(DATA / f"{bone}_dcm_cropped.tif")
    voxels = []
    for page in range(stack.n_frames):
        stack.seek(page)
        voxels.append(np.asarray(stack, dtype=np.int16))
    return np.array(voxels)


def depths_of(voxels, K, RT, size):
    return xc.Scan.from_array(voxels, SPACING_MM).project(K=K, RT=RT, size=size, opacity=OPACITY).tau.astype(float)


# ---- filters --------------------------------------------------------------------------------------


def blurred(picture, sigma):
    reach = int(3 * sigma + 1)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    weights /= weights.sum()
    for axis in (0, 1):
        padded = np.pad(picture, [(reach, reach) if a == axis else (0, 0) for a in (0, 1)], "edge")
        picture = sum(w * np.take(padded, np.arange(i, i + picture.shape[axis]), axis) for i, w in enumerate(weights))
    return picture


def near(mask, pixels):
    """Pixels within a square around those of the mask."""
    mask = mask.copy()
    for axis in (0, 1):
        ways = [np.roll(mask, way, axis) for way in range(-pixels, pixels + 1)]
        mask = np.any(ways, axis=0)
    return mask


def ssim(a, b, mask, most):
    """Wang et al., IEEE Trans. Image Process. 13, 2004: Gaussian windows of 1.5 pixels."""
    c1, c2 = (0.01 * most) ** 2, (0.03 * most) ** 2
    blur = lambda p: blurred(p, 1.5)  # noqa: E731
    ma, mb = blur(a), blur(b)
    va, vb, ab = blur(a * a) - ma * ma, blur(b * b) - mb * mb, blur(a * b) - ma * mb
    return ((2 * ma * mb + c1) * (2 * ab + c2) / ((ma ** 2 + mb ** 2 + c1) * (va + vb + c2)))[mask].mean()


# ---- our picture ----------------------------------------------------------------------------------


def through_the_chain(tau, dose="cine", seed=1, compression=0):
    """A fluoroscope's pulse behind those optical depths: a plate of as many voxels as pixels, in the isocentre."""
    rows, columns = tau.shape
    pixel_mm = CONE_MM[1] / 6167  # the focal length in pixels
    voxel_mm = pixel_mm * CONE_MM[0] / CONE_MM[1]
    hu = np.full((rows, 3, columns), -1024.0)
    hu[:, 1] = 1024 * (np.flipud(tau) / PLATE_MM / 0.02 - 1)
    scan = xc.Scan.from_array(np.clip(np.round(hu), -1024, 32767).astype(np.int16), (voxel_mm, PLATE_MM, voxel_mm))
    return scan.project(size=(columns, rows), cone_mm=CONE_MM, pixel_mm=pixel_mm, centre_mm=scan.centre_mm,
                        fluoroscope=xc.Fluoroscope(dose=dose, seed=seed, compression=compression))


def with_soft_tissue(bones, real, mask):
    """Optical depths: the bones' times a factor and a polynomial of the third degree, which together fit the X-ray best."""
    y, x = (np.indices(real.shape) / np.array(real.shape)[:, None, None] * 2 - 1)
    terms = [bones] + [x ** i * y ** j for i in range(4) for j in range(4 - i)]
    matrix = np.array([term[mask] for term in terms]).T
    factors = np.linalg.lstsq(matrix, real[mask], rcond=None)[0]
    return np.maximum(sum(f * term for f, term in zip(factors, terms)), 0)


def compare(ours, real, mask):
    """Correlation, gradient correlation and SSIM of greys, of which ours take the X-ray's mean and spread."""
    ours = (ours - ours[mask].mean()) / ours[mask].std() * real[mask].std() + real[mask].mean()
    correlation = np.corrcoef(ours[mask], real[mask])[0, 1]
    smooth = [blurred(picture, 2).astype(np.float32) for picture in (real, ours)]
    return np.array([correlation, xc.similarity.gradient_ncc(*smooth, mask=mask)[0], ssim(ours, real, mask, 255)]), ours


def noise_of(picture, mask):
    """The standard deviation within squares of 16 pixels about a plane, as a share of their mean: the median of the squares."""
    side, shares = 16, []
    y, x = np.indices((side, side)) / side
    matrix = np.array([np.ones(side * side), x.ravel(), y.ravel(), (x * y).ravel(), (x * x).ravel(), (y * y).ravel()]).T
    for row in range(0, picture.shape[0] - side, side):
        for column in range(0, picture.shape[1] - side, side):
            part = np.s_[row:row + side, column:column + side]
            if not mask[part].all():
                continue
            values = picture[part].ravel()
            rest = values - matrix @ np.linalg.lstsq(matrix, values, rcond=None)[0]
            shares.append(rest.std() / values.mean())
    return np.median(shares)


# ---- the sharpness of an edge ---------------------------------------------------------------------


def mtf_half(picture, low, high):
    """Cycles a pixel at which the MTF of a vertical edge is a half: the spread of its right side, from `low` to `high`, on both sides."""
    places, rows = np.arange(-2, 33) / 4, []
    for row in picture:
        i = np.flatnonzero((row[:-1] < (low + high) / 2) & (row[1:] >= (low + high) / 2))[-1]
        middle = i + ((low + high) / 2 - row[i]) / (row[i + 1] - row[i])
        rows.append(np.interp(middle + places, np.arange(len(row)), row))
    edge = np.mean(rows, 0)
    half = np.maximum(edge[4:] - edge[:-4], 0)[:30] * np.hanning(60)[30:]  # slopes over a pixel, from the edge's middle on
    frequencies = np.arange(0, 0.5, 0.001)
    mtf = np.array([(half * np.cos(2 * np.pi * f * np.arange(30) / 4)).sum() - 0.5 * half[0] for f in frequencies])
    return frequencies[np.argmax(mtf < 0.5 * mtf[0])]


# ---- the table ------------------------------------------------------------------------------------


def view_of(frame, number):
    """The figures of a view: of the right pose, of that blurred, of a pose that is wrong by 5 mm; noise of the X-ray and of the former."""
    K, rig = camera(number)
    whole = grey_picture(DATA / f"xr_rad_uln_cam0{number}_UND.{frame}.tif")
    poses = {bone: np.array(POSES[frame][bone]) for bone in FOREARM}
    stacks = {bone: bone_scan(bone) for bone in FOREARM}
    size = whole.shape[::-1]

    def bones_of(moved_mm, only_ends=False):
        depths = np.zeros(whole.shape)
        for bone in FOREARM:
            RT = rig[:, :3] @ poses[bone] + np.column_stack([np.zeros((3, 3)), rig[:, 3]])
            RT[:, 3] += moved_mm
            voxels = stacks[bone].copy()
            if only_ends:
                voxels[:-4] = 0
            depths += depths_of(voxels, K, RT, size)
        return depths

    right, wrong = bones_of((0, 0, 0)), bones_of((WRONG_MM, 0, 0))
    # Around the bones, but not where CT ends and the X-ray goes on, nor the hand's bones, which are not in the scans.
    mask = near(right > 0, 20) & ~near(bones_of((0, 0, 0), only_ends=True) > 0, 40) & near(whole > 20, 0)
    rows, columns = (np.flatnonzero(mask.any(axis)) for axis in (1, 0))
    part = np.s_[rows[0] - 24:rows[-1] + 25, columns[0] - 24:columns[-1] + 25]
    real, mask = whole[part], mask[part]
    depths = -np.log((real + 1) / 256)
    figures, noise = [], [noise_of(real, mask)]
    for bones, softer in ((right, 0), (right, SOFTER), (wrong, 0)):
        codes = through_the_chain(with_soft_tissue(bones[part], depths, mask)).codes.astype(float)
        if softer:
            codes = blurred(codes, softer)
        found, ours = compare(codes, real, mask)
        figures.append(found)
        if bones is right:
            noise.append(noise_of(codes, mask))
        if FOLDER and bones is right and not softer:
            sheet = np.clip(np.hstack([real, ours, np.where(mask, ours, real)]), 0, 255).astype(np.uint8)
            Image.fromarray(sheet).save(FOLDER / f"realism-{frame}-{number}.png")
    ours = with_soft_tissue(right[part], depths, mask)
    shown = [displayed(ours, real, mask, compression, f"{frame}-{number}") for compression in COMPRESSIONS]
    return figures, noise, shown


def displayed(depths, real, mask, compression, name):
    """What the display makes of the pulse: as `compare`, then the share of pixels that are black or white."""
    shown = through_the_chain(depths, compression=compression).shown.astype(float)
    found, ours = compare(shown, real, mask)
    if FOLDER:
        sheet = np.clip(np.hstack([real, shown, ours]), 0, 255).astype(np.uint8)
        Image.fromarray(sheet).save(FOLDER / f"realism-{name}-shown-{compression}.png")
    return [*found, np.isin(shown[mask], (0, 255)).mean()]


def tell(figures, noise, shown):
    for name, (correlation, gradient, likeness), share in zip(("ours", "blurred", f"{WRONG_MM} mm off"), figures, (*noise[1:], noise[1])):
        print(f"  {name:<9} correlation {correlation:.3f}, gradient correlation {gradient:.3f}, SSIM {likeness:.3f}; "
              f"noise {share:.1%}, the X-ray's {noise[0]:.1%}", flush=True)
    for compression, (correlation, gradient, likeness, clipped) in zip(COMPRESSIONS, shown):
        print(f"  displayed, compression {compression}: correlation {correlation:.3f}, gradient correlation {gradient:.3f}, "
              f"SSIM {likeness:.3f}; black or white {clipped:.2%}", flush=True)


def main():
    if not DATA.is_dir():
        print(f"skipped: no {DATA}")
        return 77
    views = []
    for frame in POSES:
        for number in (1, 2):
            views.append(view_of(frame, number))
            print(f"frame {frame}, camera {number}")
            tell(*views[-1])
    print("mean")
    tell(*(np.mean(part, 0) for part in zip(*views)))
    letter = grey_picture(DATA / "xr_rad_uln_cam01_UND.0002.tif")[EDGE]
    low, high = np.percentile(letter, 2), np.percentile(letter, 98)
    y, x = np.indices((96, 96))
    step = through_the_chain(np.where(x + 0.05 * y > 50, 0.1, 0.1 + np.log(high / low))).codes.astype(float)[40:56, 36:80]
    print(f"MTF of an edge is a half at {mtf_half(letter, low, high):.3f} cycles a pixel, ours at "
          f"{mtf_half(step, np.percentile(step, 2), np.percentile(step, 98)):.3f}")
    return 0


EDGE = np.s_[863:877, 1649:1670]  # the right side of a letter of lead in the field of camera 1

if __name__ == "__main__":
    sys.exit(main())
