#!/usr/bin/python3
"""usage: phantom_motion_picture.py PROGRAM OUTPUT.png

Makes docs/images/phantom-motion.png: coronal slices of the thorax phantom at three phases of a breath, and axial ones through the
heart at four phases of a beat.
"""
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image

SIZE = 288, 288, 405
CORONAL_MM, AXIAL_MM = -5, 108


def slices(program, folder, breath, heart):
    """The voxels (z, y, x) of a phase, their spacing and the place of the first, in mm."""
    file = folder / "phantom.nrrd"
    subprocess.run([program, "phantom", "thorax", "--coronaries", "--noise", "0", "--size", "x".join(map(str, SIZE)), "-o", file,
                    "--phase", f"breath={breath}", "--phase", f"heart={heart}", "--quiet"], check=True)
    header, voxels = file.read_bytes().split(b"\n\n", 1)
    fields = dict(line.split(": ", 1) for line in header.decode().splitlines() if ": " in line)
    origin = np.fromstring(fields["space origin"].strip("()"), sep=",")
    steps = [np.fromstring(step, sep=",") for step in fields["space directions"].strip("()").split(") (")]
    return np.frombuffer(voxels, "<i2").reshape(SIZE[::-1]), np.diag(steps), origin


def grey(hu):
    """Lungs and tissue, each in a window of its own."""
    return np.clip(np.where(hu < -400, (hu + 1000) / 600 * 70, 70 + (hu + 160) / 560 * 185), 0, 255).astype(np.uint8)


def resized(pixels, size):
    return np.asarray(Image.fromarray(pixels).resize(size))


def main(program, output):
    breaths, beats = [], []
    with tempfile.TemporaryDirectory() as name:
        for breath in (0, 0.5, 1):
            hu, spacing, origin = slices(program, pathlib.Path(name), breath, 0)
            rows = SIZE[2]
            coronal = grey(hu[::-1, int((CORONAL_MM - origin[1]) / spacing[1])])
            breaths.append(resized(coronal[int(rows * 0.12):int(rows * 0.72), 24:-24], (320, 324)))
        for heart in (0, 0.2, 0.4, 0.6):
            hu, spacing, origin = slices(program, pathlib.Path(name), 0, heart)
            axial = grey(hu[int((AXIAL_MM - origin[2]) / spacing[2])])
            beats.append(resized(axial[40:-60, 40:-40], (240, 217)))
    Image.fromarray(np.vstack([np.hstack(breaths), np.hstack(beats)])).save(output, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
