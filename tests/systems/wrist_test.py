"""PROGRAM DATA [--starts N] [--within DEG,MM] [--search DEG,MM] [--bones a,b] [--frames a,b] [--single] [--share S]: bones in two
real X-rays at once, from starts about the poses in wrist_poses.json, which wide searches found and overlays confirmed. All but a
share of the starts must end within 0.5 degrees and 0.5 mm of their median. --single also registers each view by itself, from the
median: they agree within 1 mm in their planes. Without options the radius of one frame, refined from 2 degrees and 2 mm off.
"""
import argparse
import json
import pathlib
import resource
import subprocess
import sys
import tempfile

import numpy as np

parser = argparse.ArgumentParser()
parser.add_argument("program")
parser.add_argument("data", type=pathlib.Path)
parser.add_argument("--starts", type=int, default=4)
parser.add_argument("--within", default="2,2")
parser.add_argument("--search", default="0,0")
parser.add_argument("--bones", default="rad")
parser.add_argument("--frames", default="0002")
parser.add_argument("--single", action="store_true")
parser.add_argument("--share", type=float, default=1)
options = parser.parse_args()
DATA = options.data / "wrist-xrays"
POSES = json.loads(pathlib.Path(__file__).with_name("wrist_poses.json").read_text())  # of the stack's mm in the rig's
SPACING_MM = (0.39625, 0.39625, 0.625)
SIZES = {"rad": (68, 86, 128), "uln": (65, 45, 112), "mc3": (60, 59, 116)}
MOST_DEG, MOST_MM = map(float, options.within.split(","))


def rotation(vector):
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def middle_of(bone, pose):
    return pose[:, :3] @ np.multiply(SIZES[bone], SPACING_MM) / 2 + pose[:, 3]


def start_near(pose, bone, random):
    turn, middle = random.normal(size=3), middle_of(bone, pose)
    turn = rotation(turn / np.linalg.norm(turn) * np.radians(random.uniform(0.1, MOST_DEG)))
    moved = random.normal(size=3)
    moved *= random.uniform(0, MOST_MM) / np.linalg.norm(moved)
    return np.column_stack([turn @ pose[:, :3], turn @ (pose[:, 3] - middle) + middle + moved])


def register(folder, bone, frame, start, search, cameras=(1, 2)):
    (folder / "grey.json").write_text('{"name": "grey", "unit": "1/mm", "knots": [[0, 0], [4095, 0.1]]}')
    (folder / "start.json").write_text(json.dumps({"motion": start.tolist()}))
    subprocess.run([options.program, "register", DATA / f"{bone}_dcm_cropped.tif",
                    *(DATA / f"xr_rad_uln_cam0{c}_UND.{frame}.tif" for c in cameras),
                    *(word for c in cameras for word in ("--camera", DATA / f"xr_calib_wrist_cam0{c}.txt")),
                    "--spacing", ",".join(map(str, SPACING_MM)), "--opacity", folder / "grey.json", "--start", folder / "start.json",
                    "--search", search, "-o", folder / "pose.json"], check=True, capture_output=True)
    result = json.loads((folder / "pose.json").read_text())
    return np.array(result["poses"][0]["motion"]), result


def processor_s():
    """Of the registrations so far, on all cores."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def difference(a, b, bone):
    """Degrees, and mm of the bone's middle."""
    turn = np.degrees(np.arccos(np.clip((np.trace(a[:, :3].T @ b[:, :3]) - 1) / 2, -1, 1)))
    return turn, np.linalg.norm(middle_of(bone, a) - middle_of(bone, b))


def check_single_views(folder, bone, frame, pair, faults):
    for camera in (1, 2):
        alone, result = register(folder, bone, frame, pair, "0,0", [camera])
        RT = np.array(result["poses"][0]["RT"])
        rig = RT[:, :3] @ alone[:, :3].T  # of the camera
        seen = rig @ middle_of(bone, pair) + RT[:, 3] - rig @ alone[:, 3]
        off, ray = rig @ (middle_of(bone, alone) - middle_of(bone, pair)), seen / np.linalg.norm(seen)
        aside_mm = np.linalg.norm(off - ray * (off @ ray))
        print(f"{bone} {frame}: camera {camera} alone is {aside_mm:.2f} mm beside the pair in its plane", flush=True)
        if aside_mm > 1:
            faults.append(f"{bone} {frame}: camera {camera} alone is {aside_mm:.2f} mm off")


def check_bone(folder, bone, frame, faults):
    pose, found, seconds, processor = np.array(POSES[frame][bone]), [], [], []
    for number in range(options.starts):
        before = processor_s()
        motion, result = register(folder, bone, frame, start_near(pose, bone, np.random.default_rng(number)), options.search)
        found.append(motion)
        seconds.append(result["seconds"])
        processor.append(processor_s() - before)
        print(number, [round(pose["similarity"], 3) for pose in result["poses"]], result["seconds"], processor[-1], flush=True)
    middles = np.array([middle_of(bone, motion) for motion in found])
    # The pose that is nearest to all others is their median.
    sums = [sum(np.hypot(*difference(a, b, bone)) for b in found) for a in found]
    median = found[int(np.argmin(sums))]
    off_mm = np.linalg.norm(middles - middle_of(bone, median), axis=1)
    off_deg = np.array([difference(motion, median, bone)[0] for motion in found])
    share = np.mean((off_mm < 0.5) & (off_deg < 0.5))
    print(f"{bone} {frame}: {share:.0%} within 0.5 degrees and 0.5 mm of their median; medians {np.median(off_deg):.2f} degrees, "
          f"{np.median(off_mm):.3f} mm; {np.median(seconds):.1f} s, {np.median(processor):.1f} s of the processor; the stored pose is {difference(median, pose, bone)[0]:.2f} degrees, "
          f"{difference(median, pose, bone)[1]:.2f} mm off it", flush=True)
    if share < options.share:
        faults.append(f"{bone} {frame}: {share:.0%} end at their median")
    if options.single:
        check_single_views(folder, bone, frame, median, faults)


def main():
    if not DATA.is_dir():
        print(f"skipped: no {DATA}")
        return 77
    faults = []
    with tempfile.TemporaryDirectory() as folder:
        for frame in options.frames.split(","):
            for bone in options.bones.split(","):
                if bone in POSES[frame]:
                    check_bone(pathlib.Path(folder), bone, frame, faults)
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
