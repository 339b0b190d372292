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
    ({"motion": "MOTION", "phase": 0.5}, "phase: must be a dict of modes and their phases"),
    ({"motion": "nowhere.json", "time": 1}, "nowhere.json: no such file"),
])
def test_refuses_what_is_no_instant(motion, scan, arguments, message):
    arguments = {name: motion if value == "MOTION" else value for name, value in arguments.items()}
    with pytest.raises(xc.InputError, match=message):
        scan.project(**arguments)



# What the motion above makes of a place y: 0.9 z' + 2 = z, and x' = x - 8.
def moved_place(x, y, z):
    return x - 8, y, (z - 2) / 0.9


def test_vessels_move_with_the_scan(motion, scan):
    tree = xc.VesselTree([([(4, -20, 6, 3), (4, 20, 6, 3)], -1)])
    there = xc.VesselTree([([(*moved_place(4, y, 6), 3) for y in (-20, 20)], -1)])
    view = {"lao": 0, "size": (480, 480), "pixel_mm": 0.25, "centre_mm": (0, 0, 0), "contrast_mg_ml": 300}
    moved = scan.moved(motion, phase={"breath": 1})
    drawn = scan.project(**view, vessels=tree, motion=motion, phase={"breath": 1}).tau - moved.project(**view).tau
    expected = moved.project(**view, vessels=there).tau - moved.project(**view).tau
    assert expected.max() > 0.1
    rows, columns = np.mgrid[:480, :480]
    for places in (rows, columns):  # of the centroids, within 0.1 mm
        assert np.average(places, weights=drawn) == pytest.approx(np.average(places, weights=expected), abs=0.4)
    # It grows along z by a ninth, as the scan does; a disc of 24 pixels across has 2 % more or less of them.
    assert drawn.sum() == pytest.approx(expected.sum() / 0.9, rel=0.03)
    # An instrument stays.
    wire = xc.InstrumentShape([(4, y, 6) for y in (-20, -7, 7, 20)], 2)
    held = scan.project(**view, instruments=wire, motion=motion, phase={"breath": 1}).tau - moved.project(**view).tau
    assert held == pytest.approx(moved.project(**view, instruments=wire).tau - moved.project(**view).tau, abs=1e-5)


def test_frames_of_a_map_show_the_vessels_at_an_instant(motion, scan):
    tree = xc.VesselTree([([(4, -20, 6, 3), (4, 20, 6, 3)], -1)])
    there = xc.VesselTree([([(*moved_place(4, y, 6), 3) for y in (-20, 20)], -1)])
    body = scan.cast(layers=2, motion=motion, phase={"breath": 1})
    view = {"lao": 0, "size": (60, 60), "pixel_mm": 2, "centre_mm": (0, 0, 0), "contrast_mg_ml": 300}
    frame = body.render(**view, vessels=tree, motion=motion, phase={"breath": 1})
    both = [np.average(np.mgrid[:60, :60], axis=(1, 2), weights=np.stack([f.tau - body.render(**view).tau] * 2))
            for f in (frame, body.render(**view, vessels=there))]
    assert both[0] == pytest.approx(both[1], abs=0.1)
    with pytest.raises(xc.InputError, match="give both of one instant"):
        scan.cast(layers=2).render(**view, vessels=tree, motion=motion, phase={"breath": 1})
    with pytest.raises(xc.InputError, match="motion: moves vessels; give vessels"):
        body.render(**view, motion=motion, phase={"breath": 1})


def test_phases_are_registered(scan, tmp_path, monkeypatch):
    # An elastix of our own, which finds a shift by 8 mm.
    (tmp_path / "elastix").write_text(f"""#!/bin/sh
[ "$1" = --version ] && exit 0
while [ $# -gt 0 ]; do case $1 in -out) out=$2;; esac; shift; done
cat > $out/TransformParameters.0.txt <<END
(Transform "BSplineTransform")
(TransformParameters{" 0" * 432}{" -8" * 216})
(InitialTransformParametersFileName "NoInitialTransform")
(GridSize 6 6 6)
(GridSpacing 60 60 60)
(GridOrigin -150 -150 -150)
(GridDirection 1 0 0 0 1 0 0 0 1)
(BSplineTransformSplineOrder 3)
(UseCyclicTransform "false")
END
""")
    (tmp_path / "elastix").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    up = xc.Scan.from_array(np.roll(scan.hu, 2, axis=0), scan.spacing_mm, scan.origin_mm)
    up.write(tmp_path / "up.nrrd")
    (tmp_path / "pairs.csv").write_text("1,0,0,0,0,0,8\n")
    found = scan.register_phases([up, tmp_path / "up.nrrd"], tmp_path / "motion", at=[0.5, 1], period_s=3,
                                 landmarks=tmp_path / "pairs.csv")
    assert [entry["phase"] for entry in found] == [0.5, 1]
    assert found[0]["after_hu"] == 0 and found[0]["before_hu"] > 100
    assert found[0]["landmarks_before_mm"] == 8 and found[0]["landmarks_after_mm"] == pytest.approx(0, abs=1e-5)
    assert found[1]["scan"].endswith("up.nrrd") and "landmarks_after_mm" not in found[1]
    assert (tmp_path / "motion/report.png").read_bytes().startswith(b"\x89PNG")
    read = xc.Motion.read(tmp_path / "motion/motion.json")
    assert read.displacement([(1, 2, 3)], phase={"breath": 1}) == pytest.approx(np.array([[0, 0, -8]]), abs=1e-4)
    with pytest.raises(xc.InputError, match="there are none"):
        scan.register_phases([], tmp_path / "none")
    with pytest.raises(xc.InputError, match="at holds 1 phase for 2 scans"):
        scan.register_phases([up, up], tmp_path / "none", at=[0.5])
    with pytest.raises(xc.InputError, match="phases: must be a list"):
        scan.register_phases("up.nrrd", tmp_path / "none")


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
