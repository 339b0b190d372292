#!/usr/bin/python3
"""usage: motion_picture.py PROGRAM OUTPUT.jpg

Makes docs/images/motion.jpg: the thorax phantom at three phases of a breath, made by a field of 20 mm at the diaphragm that
fades towards neck, spine and pelvis, and what has changed from the first phase to the last.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image

STEP_MM, DIAPHRAGM_MM, CHEST_MM = 8, 20, 6
ROWS, COLUMNS = slice(30, 300), slice(90, 310)


def run(*words):
    return subprocess.run([*map(str, words)], check=True, capture_output=True, text=True).stdout


def smooth(share):
    share = np.clip(share, 0, 1)
    return share * share * (3 - 2 * share)


def write_field(path, volume):
    lower = np.array(volume["origin_mm"])
    extent = (np.array(volume["size"]) - 1) * np.array(volume["spacing_mm"])
    nodes = np.ceil(extent / STEP_MM).astype(int) + 1
    z, y, x = np.meshgrid(*(np.linspace(0, 1, n) for n in nodes[::-1]), indexing="ij")
    d = np.zeros((*z.shape, 3), "<f4")
    along, in_front = smooth((0.95 - z) / 0.4) * smooth(z / 0.45), smooth((0.8 - y) / 0.4)
    d[..., 2] = DIAPHRAGM_MM * along * in_front
    d[..., 1] = CHEST_MM * along * in_front
    step = extent / (nodes - 1)
    header = ("NRRD0005\ntype: float\ndimension: 4\nspace: left-posterior-superior\nsizes: 3 {} {} {}\n"
              "space directions: none ({},0,0) (0,{},0) (0,0,{})\nkinds: vector domain domain domain\nendian: little\n"
              "encoding: raw\nspace origin: ({},{},{})\n\n").format(*nodes, *step, *lower)
    path.write_bytes(header.encode() + d.tobytes())


def main(program, output):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        scan, motion = folder / "thorax.nrrd", folder / "motion.json"
        run(program, "phantom", "thorax", "--spacing", "1.5", "-o", scan)
        write_field(folder / "inhaled.nrrd", json.loads(run(program, "info", scan, "--json"))["volume"])
        motion.write_text(json.dumps({"version": 1, "modes": [{"name": "breath", "period_s": 4, "phases": [
            {"phase": 0}, {"phase": 1, "field": "inhaled.nrrd"}]}]}))
        pictures, depths = [], []
        for phase in (0, 0.5, 1):
            words = ["project", scan, "--motion", motion, "--phase", f"breath={phase}", "--size", "400x400", "--cone", "780,1200"]
            run(program, *words, "-o", folder / "p.png")
            run(program, *words, "-o", folder / "p.tif")
            pictures.append(np.asarray(Image.open(folder / "p.png").convert("L")))
            depths.append(np.asarray(Image.open(folder / "p.tif")))
        change = depths[2] - depths[0]
        pictures.append(np.clip(128 + 127 * change / np.percentile(np.abs(change), 99), 0, 255).astype(np.uint8))
        Image.fromarray(np.hstack([picture[ROWS, COLUMNS] for picture in pictures])).save(output, quality=88)


main(*sys.argv[1:])
