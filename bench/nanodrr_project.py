"""Projects a scan by nanodrr, on request: the baseline of the Python package's projector.

usage: nanodrr_project.py PACKAGE_FOLDER SCAN WIDTH HEIGHT SAMPLES

Says "ready" in a line once the scan is there, or in a line why not. Then every line of its input is K and RT in JSON; the
answer is nanodrr's milliseconds, ours, both with the scan resident, and the relative RMS difference of the pictures.
"""
import json
import sys
import time

if __name__ == "__main__":
    package, path, *numbers = sys.argv[1:]
    width, height, samples = map(int, numbers)
    sys.path.insert(0, package)
    try:
        import nanodrr_pictures
        import numpy as np
        import xraycast as xc
        scan = nanodrr_pictures.without_rim(xc.open(path))
        subject = nanodrr_pictures.subject_of(scan)
    except Exception as error:
        print(" ".join(f"{type(error).__name__}: {error}".split()), flush=True)
        sys.exit(1)
    print("ready", flush=True)
    for line in sys.stdin:
        pose = json.loads(line)
        K, RT = np.array(pose["K"]), np.array(pose["RT"])
        begin = time.perf_counter()
        theirs = nanodrr_pictures.tau_of(subject, K, RT, (width, height), pose["source_detector_mm"], samples)
        between = time.perf_counter()
        ours = scan.project(K=K, RT=RT, size=(width, height), opacity=nanodrr_pictures.OPACITY).tau
        end = time.perf_counter()
        rms = float(np.sqrt(np.mean((ours - theirs) ** 2) / np.mean(theirs**2)))
        print(1000 * (between - begin), 1000 * (end - between), rms, flush=True)
