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


def differences(ours, theirs):
    """Of optical depths: the largest, as a share of the largest depth, and their RMS, as one of the depths' own."""
    import numpy as np
    difference = ours - theirs
    return np.abs(difference).max() / theirs.max(), np.sqrt(np.mean(difference**2) / np.mean(theirs**2))


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
    finer = nanodrr_pictures.with_half_voxels(scan)
    of_scan, of_finer = [], []
    for lao, cranial in POSES:
        ours = scan.project(lao, cranial, SIZE, CONE_MM, pixel_mm=PIXEL_MM, opacity=nanodrr_pictures.OPACITY)
        by_matrices, finer_tau = (one.project(K=ours.K, RT=ours.RT, size=SIZE, opacity=nanodrr_pictures.OPACITY).tau
                                  for one in (scan, finer))
        assert np.abs(by_matrices - ours.tau).max() < 1e-5 * ours.tau.max()  # 32-bit coordinates
        theirs = nanodrr_pictures.tau_of(subject, ours.K, ours.RT, SIZE, CONE_MM[1], SAMPLES)
        of_scan.append(differences(ours.tau, theirs))
        of_finer.append(differences(finer_tau, theirs))
        print("LAO {}, cranial {}: at most {:.2e} of the largest depth, RMS {:.2e}; of half the voxels {:.2e} and {:.2e}".format(
            lao, cranial, *of_scan[-1], *of_finer[-1]), flush=True)
    (most, rms), (finer_most, finer_rms) = np.max(of_scan, 0), np.max(of_finer, 0)
    print(f"ten poses: at most {most:.2e}, RMS at most {rms:.2e}; of half the voxels {finer_most:.2e} and {finer_rms:.2e}")
    # nanodrr interpolates between eight voxels, and Joseph's method within planes: exact where the voxels between which
    # eight interpolate are halved again and again, and off by a quarter as much with each halving.
    assert rms < 1e-3, rms
    assert finer_most < 1e-3, finer_most
    assert finer_rms < 0.4 * rms, (finer_rms, rms)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
