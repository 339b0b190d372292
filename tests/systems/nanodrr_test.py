"""Ten poses of a chest against PyPI's nanodrr, a projector in PyTorch that samples along rays by trilinear interpolation.

usage: nanodrr_test.py PACKAGE_FOLDER DATA_FOLDER, by an interpreter that has nanodrr.
"""
import os
import pathlib
import sys

SKIPPED = 77
SIZE, CONE_MM, PIXEL_MM = (64, 48), (1000, 1500), 3
SAMPLES = 3000  # on the way through the scan: 0.2 mm apart; their weights are 1 / 2999 of the way, not 1 / 3000
POSES = [(0, 0), (30, 0), (-45, 0), (90, 0), (30, 10), (-30, -10), (60, 20), (-60, 20), (10, -25), (150, 15)]


def main(package, data):
    sys.path.insert(0, os.path.abspath(package))
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "bench"))
    try:
        import nanodrr_pictures
    except ImportError as error:
        print(f"skipped: {error}")
        return SKIPPED
    folder = pathlib.Path(data, "chest-dicom")
    if not folder.is_dir():
        print(f"skipped: no {folder}")
        return SKIPPED
    import numpy as np
    import xraycast as xc
    scan = nanodrr_pictures.without_rim(xc.open(folder))
    subject = nanodrr_pictures.subject_of(scan)
    worst, worst_rms = 0.0, 0.0
    for lao, cranial in POSES:
        ours = scan.project(lao, cranial, SIZE, CONE_MM, pixel_mm=PIXEL_MM, opacity=nanodrr_pictures.OPACITY)
        theirs = nanodrr_pictures.tau_of(subject, ours.K, ours.RT, SIZE, CONE_MM[1], SAMPLES)
        by_matrices = scan.project(K=ours.K, RT=ours.RT, size=SIZE, opacity=nanodrr_pictures.OPACITY)
        assert np.abs(by_matrices.tau - ours.tau).max() < 1e-5 * ours.tau.max()  # 32-bit coordinates
        difference = by_matrices.tau - theirs
        most, rms = np.abs(difference).max() / theirs.max(), np.sqrt(np.mean(difference**2) / np.mean(theirs**2))
        print(f"LAO {lao}, cranial {cranial}: at most {most:.2e} of the largest depth, RMS {rms:.2e}", flush=True)
        worst, worst_rms = max(worst, most), max(worst_rms, rms)
    # Joseph's method interpolates within planes, nanodrr between eight voxels. The two differ where voxels do, both ways;
    # over a picture, nearly nothing of it is left.
    assert worst_rms < 1e-3, worst_rms
    assert worst < 3e-3, worst  # at 45 deg, where Joseph's planes are farthest apart
    print(f"ten poses: at most {worst:.2e}, RMS at most {worst_rms:.2e}")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
