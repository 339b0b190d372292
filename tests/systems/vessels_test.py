"""PROGRAM: a catheter in the tree that is found of a surface meets the forces that it meets in the true tree."""
import csv
import json
import math
import pathlib
import random
import struct
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv.pop(1)
SCRIPTS = 24
STEP_S = 0.05
# How far a tip goes beyond its hub in a step where it slips: then a difference of a hair decides when.
SLIP_MM = 0.5


def run(*words):
    return subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True, text=True, timeout=300)


def script(seed):
    """Two to four pushes of 40 to 110 mm at 20 to 60 mm/s, turning by up to 60 degrees, in steps."""
    chance = random.Random(seed)
    rows = [(0.0, 0.0, 0.0)]
    for _ in range(chance.randint(2, 4)):
        push_mm, speed, turn_deg = chance.uniform(40, 110), chance.uniform(20, 60), chance.uniform(-60, 60)
        time_s, inserted_mm, rotation_deg = rows[-1]
        steps = max(1, int(push_mm / speed / STEP_S))
        rows += [(time_s + push_mm / speed * k / steps, inserted_mm + push_mm * k / steps, rotation_deg + turn_deg * k / steps)
                 for k in range(1, steps + 1)]
    return "time_s,insertion_mm,rotation_deg\n" + "".join("%.4f,%.3f,%.3f\n" % row for row in rows)


class Run:
    def __init__(self, tree, motion, entry, log):
        run("-q", "simulate", tree, "--device-model", "cobra-5f", "--script", motion, "-o", log, "--entry", entry)
        with open(log) as file:
            rows = list(csv.DictReader(file))
        forces = [float(row["force_N"]) for row in rows]
        self.rms_N = math.sqrt(sum(force * force for force in forces) / len(forces))
        self.largest_N = max(map(abs, forces))
        tips = [[float(row[f"tip_{axis}_mm"]) for axis in "xyz"] for row in rows]
        inserted = [float(row["insertion_mm"]) for row in rows]
        self.slips = any(math.dist(a, b) - abs(i - j) > SLIP_MM for a, b, i, j in zip(tips, tips[1:], inserted, inserted[1:]))


def triangles_of(path):
    """Of a binary STL, (three corners) each."""
    data = path.read_bytes()
    for k in range(struct.unpack_from("<I", data, 80)[0]):
        numbers = struct.unpack_from("<9f", data, 84 + 50 * k + 12)
        yield numbers[0:3], numbers[3:6], numbers[6:9]


class VesselsOfTheThorax(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.folder = folder = pathlib.Path(cls.temporary.name)
        run("phantom", "thorax", "-o", folder / "scan.nrrd", "--size", "64x64x90", "--truth", folder / "truth")
        # In another frame and unit, as others have it: turned and ten times smaller.
        run("vessels", folder / "truth" / "surface.vtp", "-o", folder / "again")
        with open(folder / "cm.stl", "wb") as file:
            turned = [tuple((-x / 10, -y / 10, z / 10) for x, y, z in t) for t in triangles_of(folder / "again" / "surface.stl")]
            file.write(b"cm".ljust(80) + struct.pack("<I", len(turned)))
            for corners in turned:
                file.write(struct.pack("<12fH", 0, 0, 0, *corners[0], *corners[1], *corners[2], 0))
        run("vessels", folder / "cm.stl", "-o", folder / "found", "--unit", "cm", "--frame", "ras")

    def names(self, folder):
        return sorted(entry["name"] for entry in json.loads((self.folder / folder / "names.json").read_text())["names"])

    def test_branches_come_back_with_their_names(self):
        self.assertEqual(self.names("again"), self.names("truth"))
        # Made anew of fewer triangles, two vessels that leave at one place may do so at two.
        self.assertEqual(set(self.names("found")), set(self.names("truth")))

    def test_a_catheter_meets_the_same_forces(self):
        compared = 0
        for seed in range(SCRIPTS):
            motion = self.folder / "push.csv"
            motion.write_text(script(seed))
            entry = random.Random(seed).choice(["right external iliac artery", "left external iliac artery"])
            there, here = (Run(self.folder / tree, motion, entry, self.folder / "log.csv") for tree in ("truth", "again"))
            if there.slips or here.slips:
                continue
            compared += 1
            with self.subTest(seed=seed):
                # A twentieth is what is promised of each.
                self.assertLess(abs(here.rms_N / there.rms_N - 1), 0.05)
                self.assertLess(abs(here.largest_N / there.largest_N - 1), 0.05)
        self.assertGreater(compared, SCRIPTS // 3)


if __name__ == "__main__":
    unittest.main()
