#!/usr/bin/env python3
"""The benchmarks of the Python package: prints rows as xraycast_bench does, and adds them to bench.json.

usage: python_rows.py PACKAGE_FOLDER FOLDER [NANODRR_PYTHON [ROW...]]
"""
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

SIZE, CONE_MM = (640, 480), (1000, 1500)
SAMPLES = 500  # nanodrr's own default


# ---- projections ----------------------------------------------------------------------------------


def project_python_640x480(package, python):
    """Ten poses of the thorax, 360 MB, against nanodrr's; both with the scan resident, interleaved."""
    import xraycast as xc
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "thorax.nrrd")
        scan = xc.phantom("thorax", spacing_mm=1)
        scan.write(path)
        poses = [scan.project(lao, 10, (64, 48), CONE_MM, pixel_mm=9) for lao in range(0, 200, 20)]
        script = pathlib.Path(__file__).with_name("nanodrr_project.py")
        peer = subprocess.Popen([python, script, package, path, *map(str, (*SIZE, SAMPLES))], stdin=subprocess.PIPE,
                                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        said = peer.stdout.readline().strip()
        if said != "ready":
            print(f"No baseline for the Python projections, since nanodrr cannot be had: {said}", file=sys.stderr)
            return None
        ours_ms, theirs_ms = [], []
        for number, frame in enumerate([poses[0], *poses]):  # at first use a driver compiles
            K = frame.K.copy()
            K[:2] *= SIZE[0] / 64  # ten times the pixels in the same field
            K[:2, 2] += (SIZE[0] / 64 - 1) / 2
            peer.stdin.write(json.dumps({"K": K.tolist(), "RT": frame.RT.tolist(), "source_detector_mm": CONE_MM[1]}) + "\n")
            peer.stdin.flush()
            theirs, ours, rms = map(float, peer.stdout.readline().split())
            assert rms < 0.02, f"nanodrr's picture is another one, and no baseline: {rms}"  # 500 samples: some 1 mm apart
            if number > 0:
                ours_ms.append(ours)
                theirs_ms.append(theirs)
        peer.stdin.close()
        peer.wait()
    return statistics.median(ours_ms), "nanodrr, 500 samples", statistics.median(theirs_ms), ">=", 25


# ---- learning -------------------------------------------------------------------------------------


def gym_step_10ms(package, python):
    """A step of the environment, 10 ms of simulated time, on one core; stEVE on SOFA publishes 6 ms a step of the rod."""
    import numpy as np
    import xraycast as xc
    from xraycast.gym import ReachTarget
    tree = xc.phantom("thorax", spacing_mm=2).segment().tree
    env = ReachTarget(tree, "cobra-5f", ms=10)
    random = np.random.default_rng(1)
    times = []
    env.reset(seed=1)
    for _ in range(600):
        action = (random.uniform(0.2, 1), random.uniform(-1, 1))
        begin = time.perf_counter()
        _, _, ended, cut, _ = env.step(action)
        times.append(1000 * (time.perf_counter() - begin))
        if ended or cut:
            env.reset()
    mean = statistics.mean(times[100:])  # once it is inserted
    print(f"gym_step_10ms: {1000 / mean:.0f} steps a second and core", file=sys.stderr)
    return mean, "stEVE's step, as published", 6.0, "", 0


# ---- cohorts --------------------------------------------------------------------------------------


def make_scans(folder, count, size):
    import xraycast as xc
    folder.mkdir()
    for number in range(count):
        xc.phantom("thorax", size=(size,) * 3, seed=number).write(folder / f"p{number:03}.nrrd")


def run_cohort(package, source, out, workers):
    """The records of the ledger, and the seconds of the run."""
    begin = time.monotonic()
    subprocess.run([sys.executable, "-m", "xraycast.cohort", "run", source, "-o", out, "--steps", "info,cast", "--layers", "16",
                    "--workers", str(workers), "--threads", "1", "-q"], check=True, env={**os.environ, "PYTHONPATH": package})
    seconds = time.monotonic() - begin
    return [json.loads(line) for line in open(out / "ledger.jsonl")], seconds


def ms_a_scan(out):
    """Between the end of the fourth scan and that of the last: workers have started, and read their kernels."""
    ends = sorted(path.stat().st_mtime for path in out.glob("scans/*/record.json"))
    return 1000 * (ends[-1] - ends[3]) / (len(ends) - 4)


def cohort_two_workers_256(package, python):
    """Scans of 256^3 by two workers of one thread, against one."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        make_scans(folder / "in", 30, 256)
        times = {1: [], 2: []}
        for repetition in range(3):
            for workers in (1, 2):
                out = folder / f"out{workers}-{repetition}"
                run_cohort(package, folder / "in", out, workers)
                times[workers].append(ms_a_scan(out))
        return statistics.median(times[2]), "one worker", statistics.median(times[1]), ">=", 1.7


def cohort_overhead_64(package, python):
    """What a scan of 64^3 takes beside its steps: of 60 scans more in a run, on one worker."""
    few, many = 20, 80
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        make_scans(folder / "in", many, 64)
        (folder / "few").mkdir()
        for path in sorted((folder / "in").iterdir())[:few]:
            os.link(path, folder / "few" / path.name)
        overheads = []
        for repetition in range(3):
            beside = []
            for source in ("few", "in"):
                records, seconds = run_cohort(package, folder / source, folder / f"out-{source}-{repetition}", 1)
                beside.append(seconds - sum(sum(record["seconds"].values()) for record in records))
            overheads.append(1000 * (beside[1] - beside[0]) / (many - few))
        return statistics.median(overheads), "50 ms allowed", 50.0, "<=", 1


# ---- the table ------------------------------------------------------------------------------------


def print_row(name, value, baseline, baseline_ms, bar, limit):
    ratio = baseline_ms / value if bar == ">=" else value / baseline_ms
    verdict = "reported"
    if bar:
        is_met = ratio >= limit if bar == ">=" else ratio <= limit
        verdict = f"{bar} {limit:g}: {'met' if is_met else 'missed'}"
    print(f"{name:<24} {value:>8.2f} ms  {baseline:<28} {baseline_ms:>8.2f} ms {ratio:>8.3f}  {verdict}", flush=True)
    return {"name": name, "value_ms": value, "baseline": baseline, "baseline_ms": baseline_ms, "ratio": ratio}


def main(package, folder, python=sys.executable, *names):
    package = os.path.abspath(package)
    sys.path.insert(0, package)
    rows = []
    for measure in (project_python_640x480, gym_step_10ms, cohort_two_workers_256, cohort_overhead_64):
        if names and measure.__name__ not in names:
            continue
        result = measure(package, python)
        if result:
            rows.append(print_row(measure.__name__, *result))
    path = pathlib.Path(folder, "bench.json")
    before = json.loads(path.read_text()) if path.exists() else []
    kept = [row for row in before if row["name"] not in {row["name"] for row in rows}]
    path.write_text(json.dumps(kept + rows, indent=2) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
