"""A scan at an instant of its motion."""
import json

import numpy as np
import pytest
import xraycast as xc

# x shows what lies 8 mm to its left, and 2 mm and a tenth of the way to z = 0 higher.
AFFINE = ("#Insight Transform File V1.0\nTransform: AffineTransform_double_3_3\n"
          "Parameters: 1 0 0 0 1 0 0 0 0.9 8 0 2\nFixedParameters: 0 0 0\n")


@pytest.fixture
def motion(tmp_path):
    (tmp_path / "a.tfm").write_text(AFFINE)
    file = tmp_path / "motion.json"
    file.write_text(json.dumps({"version": 1, "modes": [{"name": "breath", "period_s": 4, "phases": [
        {"phase": 0}, {"phase": 1, "field": "a.tfm"}]}]}))
    return file


@pytest.fixture(scope="module")
def scan():
    hu = np.full((20, 24, 30), -1000, np.int16)
    hu[4:16, 6:18, 6:24] = np.random.default_rng(1).integers(-200, 200, (12, 12, 18))
    return xc.Scan.from_array(hu, (4, 4, 4), (-58, -46, -38))


def test_displacements_and_their_inverse(motion):
    read = xc.Motion.read(motion)
    assert read.modes == ["breath"] and read.warnings == []
    assert read.phases(1) == {"breath": pytest.approx(0.5)}
    places = np.array([[1, 2, 30], [0, 0, 0.]])
    assert read.displacement(places, phase={"breath": 0.5}) == pytest.approx(np.array([[4, 0, -0.5], [4, 0, 1]]))
    there = places + read.displacement(places, time=2)
    assert read.inverse(there, time=2) == pytest.approx(places, abs=0.05)


def test_moved_scan_shows_what_lies_there(motion, scan):
    moved = scan.moved(motion, phase={"breath": 1})
    assert moved.hu.shape == scan.hu.shape and moved.spacing_mm == scan.spacing_mm
    z = -38 + 4 * 10  # a voxel that shows 0.9 z + 2 = 3.8 mm, 10.45 slices up
    index = (0.9 * z + 2 + 38) / 4
    below, share = int(index), index - int(index)
    expected = (1 - share) * scan.hu[below, :, 2:] + share * scan.hu[below + 1, :, 2:]
    assert np.abs(moved.hu[10, :, :-2] - expected).max() <= 0.5 + 1e-6  # rounded to whole HU
    assert np.array_equal(scan.moved(motion, phase={"breath": 0}).hu, scan.hu)


def test_project_and_cast_take_the_moved_scan(motion, scan):
    moved = scan.moved(motion, time=2)
    view = {"lao": 30, "size": (32, 32), "pixel_mm": 4, "centre_mm": (0, 0, 0)}
    assert np.array_equal(scan.project(**view, motion=motion, time=2).tau, moved.project(**view).tau)
    assert not np.array_equal(scan.project(**view).tau, moved.project(**view).tau)
    assert np.array_equal(scan.cast(layers=2, motion=motion, phase={"breath": 1}).tau, moved.cast(layers=2).tau)


def test_a_map_moves(motion, scan, tmp_path):
    body = scan.cast(layers=2, motion=motion, keys={"breath": 3}, knots_hu=[])
    assert body.modes == {"breath": [0, 0.5, 1]} and scan.cast(layers=2).modes == {}
    body.write(tmp_path / "map.exr")
    read = xc.BodyMap.read(tmp_path / "map.exr")
    assert np.array_equal(read.at(time=1).tau, body.at(phase={"breath": 0.5}).tau)
    assert np.array_equal(read.tau, read.at().tau) and not np.array_equal(read.tau, read.at(time=1).tau)
    assert read.at(time=1).modes == {}
    view = {"size": (32, 32), "pixel_mm": 4}
    assert not np.array_equal(body.render(**view).tau, body.render(**view, phase={"breath": 1}).tau)
    assert np.array_equal(body.render(**view, time=2).tau, body.render(**view, phase={"breath": 1}).tau)
    assert body.basis.recast("paper").modes == body.modes
    close = xc.compare(scan.moved(motion, phase={"breath": 1}), body, views=2).mean["psnr_db"]
    assert close > xc.compare(scan, body.at(), views=2).mean["psnr_db"] - 1
    for call, message in [(lambda: scan.cast(layers=2).render(time=1), "the map stands still"),
                          (lambda: body.at(phase={"heart": 1}), "choose one of breath"),
                          (lambda: body.write(tmp_path / "m.exr", precision="float"), "stored in bytes"),
                          (lambda: scan.cast(motion=motion, keys={"breath": 1.5}), "must be a whole number"),
                          (lambda: scan.cast(motion=motion, keys=3), "must be a dict of modes")]:
        with pytest.raises(xc.InputError, match=message):
            call()


def test_convert_writes_the_moved_scan(motion, scan, tmp_path):
    scan.write(tmp_path / "scan.nrrd")
    xc.convert(tmp_path / "scan.nrrd", tmp_path / "moved.nrrd", motion=motion, phase={"breath": 0.5})
    assert np.array_equal(xc.open(tmp_path / "moved.nrrd").hu, scan.moved(motion, phase={"breath": 0.5}).hu)


@pytest.mark.parametrize("arguments, message", [
    ({"phase": {"breath": 1}}, "phase needs a motion; give motion too"),
    ({"motion": "MOTION"}, "at which instant"),
    ({"motion": "MOTION", "phase": {"breath": 1}, "time": 1}, "give only one of them"),
    ({"motion": "MOTION", "phase": {"heart": 1}}, "no such mode; choose one of breath"),
    ({"motion": "MOTION", "phase": {"breath": 1.5}}, "must be 0 to 1"),
    ({"motion": "MOTION", "time": 1, "vessels": "vessels"}, "moves the scan, not its vessels and instruments"),
    ({"motion": "MOTION", "phase": 0.5}, "phase: must be a dict of modes and their phases"),
    ({"motion": "nowhere.json", "time": 1}, "nowhere.json: no such file"),
])
def test_refuses_what_is_no_instant(motion, scan, arguments, message):
    arguments = {name: motion if value == "MOTION" else value for name, value in arguments.items()}
    with pytest.raises(xc.InputError, match=message):
        scan.project(**arguments)
