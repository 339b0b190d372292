"""A scan at an instant of its motion."""
import json
import os
import subprocess

import numpy as np
import pytest
import xraycast as xc

PROGRAM = os.environ.get("XRAYCAST_PROGRAM")

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


@pytest.fixture(scope="module")
def tube():
    return xc.VesselTree([(np.array([[0, 0, -90, 3.0], [0, 0, 90, 3.0]]), -1)])


@pytest.fixture
def bending(tmp_path):
    """Takes the tube aside, by up to 9 mm at its far end and not at its entry, there and back in a second."""
    (tmp_path / "bend.tfm").write_text("#Insight Transform File V1.0\nTransform: AffineTransform_double_3_3\n"
                                       "Parameters: 1 0 0.05 0 1 0 0 0 1 4.5 0 0\nFixedParameters: 0 0 0\n")
    file = tmp_path / "bending.json"
    file.write_text(json.dumps({"version": 1, "modes": [{"name": "heart", "period_s": 1, "phases": [
        {"phase": 0}, {"phase": 1, "field": "bend.tfm"}]}]}))
    return file


def test_instruments_move_with_the_body(tube, bending):
    script = [(0, 5, 0), (0.5, 100, 0), (2.5, 100, 0)]
    run = xc.simulate(tube, ["microcatheter-27f"], script, entry=0, interval_s=0.01, motion=bending)
    assert run.modes == ["heart"] and run.notes == []
    heart = [xc.Motion.read(bending).phases(time)["heart"] for time in run.records["time_s"][:, 0]]
    assert run.phases[:, 0] == pytest.approx(heart, abs=1e-9)
    tip, scan = run.records["tip_mm"][:, 0], run.records["tip_scan_mm"][:, 0]
    # In the tube, as far as 3 mm leave room, which is where the body shows it.
    assert np.abs(scan[:, 0]).max() < 3
    assert scan[:, 0] - tip[:, 0] == pytest.approx(run.phases[:, 0] * 0.05 * (tip[:, 2] + 90), abs=1e-3)
    assert np.ptp(tip[-100:, 0]) > 3
    assert run.records["wall_work_J"][-1, 0] != 0


def test_what_is_held_at_the_scan_itself_is_still(tube, bending):
    script = [(0, 5, 0), (0.3, 60, 90)]
    still = xc.simulate(tube, ["microcatheter-27f"], script, entry=0)
    held = xc.simulate(tube, ["microcatheter-27f"], script, entry=0, motion=bending, phase={"heart": 0})
    assert np.array_equal(still.records, held.records)
    assert still.modes == [] and still.phases.shape == (2, 0)


def test_a_catheter_steps_in_a_body_that_moves(tube, bending):
    catheter = xc.Catheter(tube, "microcatheter-27f", entry=0, motion=bending)
    state = catheter.step(push_mm=60, ms=500)
    assert state.phases == [pytest.approx(1)]
    assert state.tip_scan_mm[0] - state.tip_mm[0] == pytest.approx(0.05 * (state.tip_mm[2] + 90), abs=1e-3)
    with pytest.raises(xc.InputError, match="phase needs a motion"):
        xc.Catheter(tube, "microcatheter-27f", phase={"heart": 0})


@pytest.mark.skipif(not PROGRAM, reason="XRAYCAST_PROGRAM names no program")
def test_the_program_writes_the_same_run(tube, bending, tmp_path):
    tube.write(tmp_path / "tree.vtp")
    (tmp_path / "push.csv").write_text("time_s,insertion_mm,rotation_deg\n0,5,0\n0.4,60,0\n")
    done = subprocess.run([PROGRAM, "simulate", tmp_path, "--device-model", "microcatheter-27f", "--script", tmp_path / "push.csv",
                           "--entry", "0", "--motion", bending, "-o", tmp_path / "log.csv", "--json"], check=True,
                          capture_output=True)
    result = json.loads(done.stdout)
    assert result["phases"] == {"heart": pytest.approx(0.5 - 0.5 * np.cos(0.8 * np.pi))}
    assert len(result["tip"]["scan_mm"]) == 3 and "wall_work_J" in result["tip"]
    xc.simulate(xc.VesselTree.read(tmp_path), ["microcatheter-27f"], tmp_path / "push.csv", entry=0,
                motion=bending).write(tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "log.csv").read_bytes()
