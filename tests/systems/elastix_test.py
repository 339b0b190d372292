"""PACKAGE DATA PROGRAM: motions from phases by elastix, against known ones: the thorax phantom that breathes, with noise, and the
chest of DATA, where there is one, moved by the model of its breath. Exits with 77 without elastix.

No real 4D CT is at hand: what moves here moves by known fields, so that errors are known everywhere.
"""
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np

sys.path.insert(0, sys.argv[1])
DATA, PROGRAM = pathlib.Path(sys.argv[2]), sys.argv[3]
if not shutil.which("elastix") or not shutil.which("transformix"):
    print("skipped: there is no elastix; apt-get install elastix")
    sys.exit(77)
import xraycast as xc

RNG = np.random.default_rng(6)
FAULTS = []


def expect(what, is_so):
    print(("ok    " if is_so else "FAULT ") + what, flush=True)
    if not is_so:
        FAULTS.append(what)


def noisy(scan, sd_hu):
    hu = np.clip(scan.hu + RNG.normal(0, sd_hu, scan.hu.shape), -1024, 3000).astype(np.int16)
    return xc.Scan.from_array(hu, scan.spacing_mm, scan.origin_mm)


def places(scan, indices):
    return np.asarray(indices, float)[:, ::-1] * scan.spacing_mm + scan.origin_mm


def landmarks(scan, truth, file, count=200):
    """Edges and vessels within the lungs, and where they are in the phase."""
    hu = scan.hu
    body = np.argwhere((hu > -400) & (hu < 100))
    body = body[RNG.choice(len(body), min(len(body), 40000), replace=False)]
    reach = np.maximum(1, np.round(6 / np.array(scan.spacing_mm[::-1]))).astype(int)
    body = body[((body >= reach) & (body < np.array(hu.shape) - reach)).all(1)]
    mean = np.array([hu[tuple(slice(c - r, c + r + 1) for c, r in zip(at, reach))].mean() for at in body])
    here = places(scan, body[(mean < -650) & (mean > -900)][:count])
    there = truth.inverse(here, phase={"breath": 1})
    file.write_text("phase,x,y,z,x,y,z\n" + "".join(
        "1," + ",".join(f"{v:.4f}" for v in (*a, *b)) + "\n" for a, b in zip(here, there) if np.isfinite(b).all()))


def errors(scan, found, truth):
    """Of 20,000 places in the body, and of those among them that move by more than 3 mm."""
    body = np.argwhere(scan.hu > -950)
    x = places(scan, body[RNG.choice(len(body), 20000, replace=False)])
    wanted = truth.displacement(x, phase={"breath": 1})
    error = np.linalg.norm(found.displacement(x, phase={"breath": 1}) - wanted, axis=1)
    return error, error[np.linalg.norm(wanted, axis=1) > 3]


def keep_what_elastix_found(folder):
    """An elastix in front of PATH that keeps its TransformParameters in the folder KEPT of the environment."""
    wrapper = folder / "bin/elastix"
    wrapper.parent.mkdir()
    wrapper.write_text(f"""#!/bin/sh
{shutil.which("elastix")} "$@" || exit 1
while [ $# -gt 0 ]; do case $1 in -out) cp $2/TransformParameters.0.txt "$KEPT";; esac; shift; done
""")
    wrapper.chmod(0o755)
    os.environ["PATH"] = f"{wrapper.parent}:{os.environ['PATH']}"


def loss_of_field(folder, found):
    """The distance of our field of 4 mm from transformix' own, at voxels."""
    parameters = folder / "TransformParameters.0.txt"
    parameters.write_text(parameters.read_text().replace('(ResultImageFormat "nii")', '(ResultImageFormat "mhd")'))
    subprocess.run(["transformix", "-def", "all", "-tp", parameters, "-out", folder], check=True, capture_output=True)
    field = next(folder.glob("deformationField.*h*"))
    (folder / "theirs.json").write_text('{"version": 1, "modes": [{"name": "breath", "period_s": 4, "phases": [{"phase": 0}, '
                                        f'{{"phase": 1, "field": "{field.name}"}}]}}]}}')
    theirs = xc.Motion.read(folder / "theirs.json")
    return lambda x: np.linalg.norm(found.displacement(x, phase={"breath": 1}) - theirs.displacement(x, phase={"breath": 1}), axis=1)


def test_scan(name, scan, phase, truth, folder, bars):
    os.environ["KEPT"] = str(folder)
    landmarks(scan, truth, folder / "pairs.csv")
    start = time.monotonic()
    numbers, = scan.register_phases([phase], folder / "motion", at=[1], landmarks=folder / "pairs.csv")
    took_s = time.monotonic() - start
    found = xc.Motion.read(folder / "motion/motion.json")
    error, moving = errors(scan, found, truth)
    median, most, moving_median = np.median(error), np.percentile(error, 95), np.median(moving)
    expect(f"{name}: error in the body {median:.2f} mm in the median, 95 % within {most:.2f}; where it moves by 3 mm or more {moving_median:.2f} "
           f"and {np.percentile(moving, 95):.2f}; {took_s:.0f} s", median < bars[0] and moving_median < bars[1])
    before, after = numbers["landmarks_before_mm"], numbers["landmarks_after_mm"]
    expect(f"{name}: landmarks {before:.2f} mm apart before, {after:.2f} after", after < before / 2.5)
    expect(f"{name}: difference {numbers['before_hu']:.0f} HU before, {numbers['after_hu']:.0f} after",
           numbers["after_hu"] < numbers["before_hu"] / 2)
    loss = loss_of_field(folder, found)(places(scan, RNG.integers(2, np.array(scan.hu.shape) - 2, (20000, 3))))
    expect(f"{name}: its field of 4 mm against transformix: {np.median(loss):.3f} mm in the median, 95 % within {np.percentile(loss, 95):.3f}, "
           f"worst {loss.max():.3f}", np.percentile(loss, 95) < 0.1)


def test_signals(folder, scan, phase):
    scan.write(folder / "a.nrrd")
    phase.write(folder / "b.nrrd")
    (folder / "tmp").mkdir()
    for wait_s in (1.5, 6):
        job = subprocess.Popen([PROGRAM, "motion", folder / "a.nrrd", folder / "b.nrrd", "-o", folder / "out", "--quiet"],
                               env=os.environ | {"TMPDIR": str(folder / "tmp")}, stderr=subprocess.PIPE)
        time.sleep(wait_s)
        start = time.monotonic()
        job.send_signal(signal.SIGINT)
        job.communicate(timeout=60)
        took_s = time.monotonic() - start
        expect(f"ends {took_s:.1f} s after Ctrl-C, with {job.returncode}", took_s < 2 and job.returncode == 130)
        expect("its temporary folder is gone", not list((folder / "tmp").glob("xraycast-elastix-*")))
        expect("it has written nothing", not (folder / "out").exists())


def main():
    with tempfile.TemporaryDirectory(prefix="elastix-") as name:
        folder = pathlib.Path(name)
        keep_what_elastix_found(folder)
        for part in ("thorax", "chest"):
            (folder / part).mkdir()
        options = {"spacing_mm": 3, "noise_hu": 20}
        subprocess.run([PROGRAM, "phantom", "thorax", "--spacing", "6", "-o", folder / "scan.nrrd", "--motion", folder / "truth", "--quiet"],
                       check=True)
        truth = xc.Motion.read(folder / "truth/motion.json")
        rest, inspired = xc.phantom("thorax", **options), xc.phantom("thorax", **options, seed=2, phase={"breath": 1})
        test_scan("thorax", rest, inspired, truth, folder / "thorax", (0.5, 2))
        test_signals(folder, rest, inspired)
        if (DATA / "chest-dicom").exists():
            chest = xc.open(DATA / "chest-dicom")
            chest.write_motion(folder / "model", breath_mm=12)
            moved = noisy(chest.moved(folder / "model/motion.json", phase={"breath": 1}), 20)
            test_scan("chest", chest, moved, xc.Motion.read(folder / "model/motion.json"), folder / "chest", (0.5, 1.2))
    return 1 if FAULTS else 0


sys.exit(main())
