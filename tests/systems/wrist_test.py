"""PROGRAM DATA: the radius in two real X-rays at once, from starts about the pose that a wide search found and its overlay
confirmed: all end within 0.5 degrees and 0.5 mm of their median."""
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

PROGRAM, DATA = sys.argv[1], pathlib.Path(sys.argv[2], "wrist-xrays")
STARTS, MOST_DEG, MOST_MM = 4, 2, 2
SIZE_MM = np.array([68, 86, 128]) * (0.39625, 0.39625, 0.625)
# Of the stack's mm in the rig's.
POSE = np.array([[-0.955162, 0.293994, 0.035112, 114.022598], [-0.01636, -0.170812, 0.985168, 122.692019],
                 [0.295631, 0.940421, 0.167963, 48.836415]])


def rotation(vector):
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def start_near(random):
    turn, middle = random.normal(size=3), POSE[:, :3] @ SIZE_MM / 2 + POSE[:, 3]
    turn = rotation(turn / np.linalg.norm(turn) * np.radians(random.uniform(0.1, MOST_DEG)))
    moved = random.normal(size=3)
    moved *= random.uniform(0, MOST_MM) / np.linalg.norm(moved)
    return np.column_stack([turn @ POSE[:, :3], turn @ (POSE[:, 3] - middle) + middle + moved])


def main():
    if not DATA.is_dir():
        print(f"skipped: no {DATA}")
        return 77
    found = []
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "grey.json").write_text('{"name": "grey", "unit": "1/mm", "knots": [[0, 0], [4095, 0.1]]}')
        for number in range(STARTS):
            motion = start_near(np.random.default_rng(number))
            (folder / "start.json").write_text(json.dumps({"motion": motion.tolist()}))
            subprocess.run([PROGRAM, "register", DATA / "rad_dcm_cropped.tif",
                            *(DATA / f"xr_rad_uln_cam0{c}_UND.0002.tif" for c in (1, 2)),
                            *(word for c in (1, 2) for word in ("--camera", DATA / f"xr_calib_wrist_cam0{c}.txt")),
                            "--spacing", "0.39625,0.39625,0.625", "--opacity", folder / "grey.json", "--start", folder / "start.json",
                            "--search", "0,0", "-o", folder / f"{number}.json"], check=True, capture_output=True)
            result = json.loads((folder / f"{number}.json").read_text())
            found.append(np.array(result["poses"][0]["motion"]))
            print(number, [round(pose["similarity"], 3) for pose in result["poses"]], result["seconds"], flush=True)
    middles = np.array([m[:, :3] @ SIZE_MM / 2 + m[:, 3] for m in found])
    off_mm = np.linalg.norm(middles - np.median(middles, 0), axis=1)
    nearest = found[int(np.argmin(off_mm))]
    off_deg = [np.degrees(np.arccos(np.clip((np.trace(m[:, :3].T @ nearest[:, :3]) - 1) / 2, -1, 1))) for m in found]
    print("off their median by", np.round(off_mm, 3), "mm, and", np.round(off_deg, 3), "degrees")
    return 0 if max(off_mm) < 0.5 and max(off_deg) < 0.5 else 1


if __name__ == "__main__":
    sys.exit(main())
