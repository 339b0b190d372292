"""PACKAGE DATA: motion against SimpleITK. Its transforms take 1,000 places where ours do, within 0.01 mm; scans moved by affine
and sine fields, and by fields with noise and on turned grids, are its resampled ones within 10 HU at 99 % of the voxels.

Run by an interpreter that has SimpleITK, as `./dev test-systems` makes it. Exits with 77 without one. The chest of DATA is
moved too where there is one.
"""
import json
import pathlib
import sys
import tempfile

import numpy as np

sys.path.insert(0, sys.argv[1])
DATA = pathlib.Path(sys.argv[2])
try:
    import SimpleITK as sitk
except ImportError:
    print(f"skipped: {sys.executable} has no SimpleITK; run ./dev test-systems")
    sys.exit(77)
import xraycast as xc

RNG = np.random.default_rng(4)
FAULTS = []
AIR = -1024


def expect(what, is_so):
    print(("ok    " if is_so else "FAULT ") + what)
    if not is_so:
        FAULTS.append(what)


def turned(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def domain(size, spacing, origin, direction):
    image = sitk.Image([int(n) for n in size], sitk.sitkFloat32)
    image.SetSpacing([float(mm) for mm in spacing])
    image.SetOrigin([float(mm) for mm in origin])
    image.SetDirection(np.asarray(direction, float).ravel().tolist())
    return image


def field_on(image, vectors):
    """vectors(places): (n, 3) -> (n, 3)."""
    nx, ny, nz = image.GetSize()
    k, j, i = np.meshgrid(np.arange(nz), np.arange(ny), np.arange(nx), indexing="ij")
    direction = np.array(image.GetDirection()).reshape(3, 3)
    places = np.array(image.GetOrigin()) + (np.stack([i, j, k], -1) * np.array(image.GetSpacing())) @ direction.T
    field = sitk.GetImageFromArray(vectors(places.reshape(-1, 3)).reshape(nz, ny, nx, 3).astype(np.float64), isVector=True)
    field.CopyInformation(image)
    return field


def around(lower, upper, count, direction):
    """A grid of that many nodes along each axis whose axes are turned, and which encloses the box."""
    middle, half = (lower + upper) / 2, np.linalg.norm(upper - lower) / 2 + 5
    return domain([count] * 3, [2 * half / (count - 1)] * 3, middle - np.asarray(direction) @ np.full(3, half), direction)


def motion_of(folder, field):
    file = folder / "motion.json"
    file.write_text(json.dumps({"version": 1, "modes": [{"name": "breath", "period_s": 4, "phases": [
        {"phase": 0}, {"phase": 1, "field": field}]}]}))
    return file


def transforms():
    affine = sitk.AffineTransform(3)
    affine.SetMatrix((1, .1, 0, -.05, .9, .05, .02, 0, 1.1))
    affine.SetTranslation((1, 2, 3))
    affine.SetCenter((10, 20, 30))
    grid = domain([20, 22, 18], [9, 9, 9], [-90, -90, -80], turned(12))
    yield "affine", affine
    yield "rigid", sitk.Euler3DTransform((1, 2, 3), .1, .2, .3, (4, 5, 6))
    yield "versor", sitk.VersorRigid3DTransform((0, .6, .8), .3, (1, 2, 3), (5, 6, 7))
    yield "similarity", sitk.Similarity3DTransform(1.2, (0, 1, 0), .2, (1, 2, 3), (4, 5, 6))
    splines = []
    for order in (1, 2, 3):
        spline = sitk.BSplineTransformInitializer(grid, [6, 7, 5], order)
        spline.SetParameters(RNG.normal(0, 4, len(spline.GetParameters())).tolist())
        splines.append(spline)
        yield f"B-spline of order {order}", spline
    field = sitk.DisplacementFieldTransform(sitk.Image(field_on(grid, lambda x: RNG.normal(0, 4, x.shape))))
    yield "field", field
    yield "composite", sitk.CompositeTransform([affine, splines[2], sitk.TranslationTransform(3, (3, -2, 1)), field])


def test_transforms(folder):
    places = RNG.uniform(-110, 110, (1000, 3))
    for name, transform in transforms():
        theirs = np.array([transform.TransformPoint(x.tolist()) for x in places])
        for extension in ("tfm", "h5"):
            file = folder / f"transform.{extension}"
            sitk.WriteTransform(transform, str(file))
            ours = places + xc.Motion.read(motion_of(folder, file.name)).displacement(places, phase={"breath": 1})
            worst = np.abs(ours - theirs).max()
            expect(f"{name} as .{extension}: 1,000 places within {worst:.2g} mm", worst < 0.01)
    sitk.WriteTransform(next(transforms())[1], str(folder / "transform.mat"))
    ours = places + xc.Motion.read(motion_of(folder, "transform.mat")).displacement(places, phase={"breath": 1})
    expect("affine as .mat", np.abs(ours - np.array([next(transforms())[1].TransformPoint(x.tolist()) for x in places])).max() < 0.01)


def test_inverse(folder):
    grid = around(np.full(3, -100.), np.full(3, 100.), 30, turned(20))
    field = field_on(grid, lambda x: np.array([4, -6, 12]) * np.sin(x[:, [1, 2, 0]] / 25))
    sitk.WriteImage(field, str(folder / "sine.nrrd"))
    motion = xc.Motion.read(motion_of(folder, "sine.nrrd"))
    there = RNG.uniform(-90, 90, (1000, 3))
    for phase in (0.3, 1):
        back = motion.inverse(there, phase={"breath": phase})
        residual = np.linalg.norm(back + motion.displacement(back, phase={"breath": phase}) - there, axis=1).max()
        expect(f"inverse at phase {phase}: residual {residual:.2g} mm", residual < 0.05)


def fields(folder, lower, upper):
    """Files of fields that cover the box, and their transforms."""
    middle, size = (lower + upper) / 2, upper - lower

    def sine(x):
        return np.array([3, 6, 14]) * np.sin(np.pi * (x - lower) / size)

    straight = domain([24, 24, 30], size / np.array([23, 23, 29]), lower, np.eye(3))
    for name, image in (("sine.nrrd", field_on(straight, sine)), ("sine.mha", field_on(straight, sine)),
                        ("sine.nii.gz", field_on(straight, sine)), ("turned.nrrd", field_on(around(lower, upper, 20, turned(25)), sine)),
                        ("noise.nrrd", field_on(straight, lambda x: sine(x) + RNG.normal(0, 3, x.shape)))):
        sitk.WriteImage(image, str(folder / name))
        yield name, sitk.DisplacementFieldTransform(sitk.Image(image))
    affine = sitk.AffineTransform(3)
    affine.SetCenter(middle.tolist())
    affine.SetMatrix((1.02, .03, 0, -.02, .97, .01, 0, .02, 1.05))
    affine.SetTranslation((2, -3, 4))
    sitk.WriteTransform(affine, str(folder / "affine.tfm"))
    yield "affine.tfm", affine
    spline = sitk.BSplineTransformInitializer(straight, [5, 5, 5], 3)
    spline.SetParameters(RNG.normal(0, 5, len(spline.GetParameters())).tolist())
    sitk.WriteTransform(spline, str(folder / "spline.h5"))
    yield "spline.h5", spline


def test_scan(folder, scan, name):
    image = scan.to_sitk()
    lower = np.array(scan.origin_mm)
    upper = lower + (np.array(image.GetSize()) - 1) * np.array(scan.spacing_mm)
    for file, transform in fields(folder, lower, upper):
        theirs = sitk.GetArrayFromImage(sitk.Resample(image, transform, sitk.sitkLinear, AIR))
        ours = scan.moved(motion_of(folder, file), phase={"breath": 1}).hu
        share = np.mean(np.abs(ours.astype(int) - theirs) <= 10)
        expect(f"{name} by {file}: {100 * share:.3f} % of the voxels within 10 HU", share >= 0.99)


def main():
    with tempfile.TemporaryDirectory(prefix="motion-") as name:
        folder = pathlib.Path(name)
        test_transforms(folder)
        test_inverse(folder)
        test_scan(folder, xc.phantom("thorax", spacing_mm=2.5), "thorax")
        if (DATA / "chest-dicom").exists():
            test_scan(folder, xc.open(DATA / "chest-dicom"), "chest")
    return 1 if FAULTS else 0


sys.exit(main())
