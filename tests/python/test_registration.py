"""Registration of pictures to a scan: the example, and xc.register."""
import pathlib
import sys

import numpy as np
import pytest
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
        # The picture is the scan's own projection: what is left is rounding.
        assert register.error_mm(found, target.RT, corners) < 0.01 and before > 1


def test_moving_by_nothing_changes_nothing():
    rt = np.column_stack([np.eye(3), [1, 2, 3]])
    assert np.allclose(register.moved(rt, np.zeros(6), np.array([4, 5, 6])), rt, atol=1e-12)


@pytest.fixture(scope="module")
def seen():
    scan = xc.phantom("thorax", spacing_mm=4)
    return scan, scan.project(25, -8, (128, 128), (785, 1200), pixel_mm=3, opacity="bilinear")


@pytest.mark.parametrize("contrast", [lambda tau: 9000 * np.exp(-0.6 * tau) + 400, lambda tau: 3 + tau], ids=["dark", "bright"])
def test_pictures_of_any_contrast_are_registered(seen, contrast):
    scan, frame = seen
    centre = np.array(scan.centre_mm)
    start = register.moved(frame.RT, np.array([15, -10, 20, 0.1, -0.1, 0.12]), centre)
    found = xc.register(scan, [contrast(frame.tau)], K=frame.K, RT=start, search_deg=10, search_mm=30)
    assert found.converged and found.poses[0].similarity > 0.9
    assert (found.poses[0].lao, found.poses[0].cranial) == pytest.approx((25, -8), abs=0.1)
    # A fifth of a voxel.
    assert register.error_mm(found.poses[0].RT, frame.RT, register.corners_of(scan)) < 0.8


def test_a_film_is_followed(seen):
    scan, first = seen
    frames = [scan.project(25 + 0.8 * i, -8, (128, 128), (785, 1200), pixel_mm=3, opacity="bilinear",
                           centre_mm=np.add(scan.centre_mm, [0, 0, 1.5 * i])) for i in range(4)]
    start = register.moved(first.RT, np.array([10, -8, 15, 0.05, -0.05, 0.06]), np.array(scan.centre_mm))
    found = xc.track(scan, [[frame.tau] for frame in frames], K=first.K, RT=start, search_deg=5, search_mm=20)
    assert len(found) == 4 and all(one.converged for one in found)
    for one, frame in zip(found, frames):
        # A fifth of a voxel.
        assert register.error_mm(one.poses[0].RT, frame.RT, register.corners_of(scan)) < 0.8
    # Only the first is searched for.
    assert all(one.evaluations < found[0].evaluations / 4 for one in found[1:])
    with pytest.raises(xc.InputError, match="as many pictures as the first, 1; one has 2"):
        xc.track(scan, [[first.tau], [first.tau] * 2], K=first.K, RT=start)
    with pytest.raises(xc.InputError, match="frames: must be a list"):
        xc.track(scan, [], K=first.K, RT=start)


def test_what_cannot_be_registered_is_refused(seen):
    scan, frame = seen
    for message, pictures, k in [("is none|no X-ray", [], frame.K), ("all its pixels are 1", [np.ones((128, 128))], frame.K),
                                 ("rows x columns", [np.ones(5)], frame.K), ("must be a list", 3, frame.K),
                                 ("there are 3 for 1", [frame.tau], [frame.K] * 3)]:
        with pytest.raises(xc.InputError, match=message):
            xc.register(scan, pictures, K=k, RT=frame.RT)
    with pytest.raises(xc.InputError, match="search_mm -1"):
        xc.register(scan, [frame.tau], K=frame.K, RT=frame.RT, search_mm=-1)


def test_similarities_have_their_derivatives():
    random = np.random.default_rng(1)
    fixed, moving = random.normal(size=(2, 20, 30))
    for similarity in (xc.similarity.ncc, xc.similarity.gradient_ncc):
        value, slope = similarity(fixed, moving)
        along = (similarity(fixed, moving + 1e-3 * fixed)[0] - similarity(fixed, moving - 1e-3 * fixed)[0]) / 2e-3
        assert (slope * fixed).sum() == pytest.approx(along, rel=0.01)
        assert similarity(fixed, 3 * fixed + 2)[0] == pytest.approx(1, abs=1e-5)
    assert xc.similarity.mutual_information(fixed, fixed)[0] > 2 * xc.similarity.mutual_information(fixed, moving)[0]
    for similarity in (xc.similarity.ncc, xc.similarity.gradient_ncc, xc.similarity.mutual_information):
        with pytest.raises(xc.InputError, match="greys must fit in 32-bit floats"):
            similarity(fixed, 1e39 * moving)
