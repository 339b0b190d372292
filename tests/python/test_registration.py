"""The example that registers a picture to a scan."""
import pathlib
import sys

import numpy as np
import xraycast as xc

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "examples" / "python"))
import register  # noqa: E402


def test_it_finds_the_pose_of_a_picture():
    scan = xc.phantom("thorax", spacing_mm=2, noise_hu=0)
    target = scan.project(20, 5, register.SIZE, register.CONE_MM)
    corners, pyramid, random = register.corners_of(scan), register.pyramid_of(scan), np.random.default_rng(2)
    for _ in range(2):
        start = register.start_near(target.RT, np.array(scan.centre_mm), random)
        before = register.error_mm(start, target.RT, corners)
        found = register.register(pyramid, target.tau, target.K, start)
        # Means over 4 x 4 pixels are no single rays, which leaves some tenths of a millimetre.
        assert register.error_mm(found, target.RT, corners) < 1 < before


def test_moving_by_nothing_changes_nothing():
    rt = np.column_stack([np.eye(3), [1, 2, 3]])
    assert np.allclose(register.moved(rt, np.zeros(6), np.array([4, 5, 6])), rt, atol=1e-12)
