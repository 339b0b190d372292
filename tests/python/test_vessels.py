"""Vessels, and a catheter in them."""
import json

import os
import pickle
import signal
import threading

import numpy as np
import pytest
import xraycast as xc


@pytest.fixture(scope="module")
def tube(tmp_path_factory):
    """A straight vessel of radius 5 mm, 300 mm upwards."""
    file = tmp_path_factory.mktemp("tree") / "tree.json"
    points = [[0, 0, float(z), 5] for z in range(0, 301, 5)]
    file.write_text(json.dumps({"branches": [{"id": 0, "parent": -1, "points": points}]}))
    return xc.VesselTree.read(file)


def test_vessels_are_segmented():
    scan = xc.phantom("thorax", spacing_mm=3, noise_hu=0)
    vessels = scan.segment(max_radius_mm=20)
    assert vessels.mask.shape == scan.hu.shape and vessels.mask.dtype == np.uint8 and vessels.mask.max() == 1
    assert len(vessels.tree) > 1 and vessels.surface.triangles.max() < len(vessels.surface.points_mm)
    # The arteries are bright with contrast agent.
    assert np.median(scan.hu[vessels.mask == 1]) > 150
    with pytest.raises(xc.InputError, match="seeds"):
        scan.segment(seeds=[(190, -190, 0)])
    with pytest.raises(xc.InputError, match="points"):
        scan.segment(seeds=[1, 2])


def test_a_mask_is_what_lies_above_zero():
    scan = xc.phantom("thorax", spacing_mm=4, noise_hu=0)
    found = scan.segment(max_radius_mm=20).mask
    for given in (found, np.where(found > 0, 1, -1), np.where(found > 0, 0.5, 0.0), found > 0):
        assert np.array_equal(scan.segment(from_mask=given).mask, scan.segment(from_mask=found).mask), given.dtype
    with pytest.raises(xc.InputError, match="from_mask: must be numbers, above 0 in vessels; it has NaN"):
        scan.segment(from_mask=np.where(found > 0, 1.0, np.nan))


def test_a_tree_shows_its_centrelines(tube, tmp_path):
    assert len(tube) == 1 and tube.root == 0 and tube[0].parent == -1
    assert tube[0].points.shape == (61, 4) and tube[0].length_mm == pytest.approx(300)
    tube.write(tmp_path / "tree.vtp")
    assert np.array_equal(xc.VesselTree.read(tmp_path / "tree.vtp")[0].points, tube[0].points)


def test_a_catheter_advances_and_turns(tube):
    run = xc.Catheter(tube, "guidewire-035-j")
    for _ in range(40):
        state = run.step(push_mm=1, turn_deg=2, ms=10)
    assert state.time_s == pytest.approx(0.4) and state.insertion_mm == pytest.approx(40)
    assert state.rotation_deg == pytest.approx(80) and not state.is_held
    # The foremost node is about as far in the vessel as the hub has moved; the guide wire's J points back.
    assert 25 < run.nodes_mm[:, 2].max() < 41 and state.branch == 0
    assert run.nodes_mm.shape[1] == 3 and np.allclose(run.nodes_mm[-1], state.tip_mm)


def test_one_call_is_many_steps(tube):
    once, often = xc.Catheter(tube, "cobra-5f"), xc.Catheter(tube, "cobra-5f")
    for _ in range(20):
        often.step(push_mm=0.2, ms=1)
    # The hub's path is the same but for rounding.
    assert np.allclose(once.step(push_mm=4, ms=20).tip_mm, often.state.tip_mm, atol=1e-6)


@pytest.mark.parametrize("arguments, words", [
    (dict(ms=0), "ms"), (dict(push_mm=float("nan")), "push_mm"), (dict(turn_deg=float("inf")), "turn_deg"),
])
def test_steps_that_are_none_are_rejected(tube, arguments, words):
    with pytest.raises(xc.InputError, match=words):
        xc.Catheter(tube, "cobra-5f").step(**arguments)


def test_balloons_and_sheaths_that_there_are_not_are_told(tube):
    for model, arguments, words in (("cobra-5f", dict(inflate_bar=1), "cobra-5f has no balloon"),
                                    ("balloon-6x20", dict(release_mm=5), "balloon-6x20 has no stent in a sheath")):
        with pytest.raises(xc.InputError, match=words):
            xc.Catheter(tube, model).step(**arguments)


def test_a_wire_is_moved_in_a_catheter_and_exchanged(tube):
    run = xc.CoaxialInstruments(tube, ["vertebral-5f", "guidewire-035-angled"])
    assert len(run) == 2 and run.models == ["vertebral-5f", "guidewire-035-angled"]
    outer, inner = run.step(push_mm=(30, 60), turn_deg=(0, 90), ms=600)
    assert outer.insertion_mm == pytest.approx(30) and inner.insertion_mm == pytest.approx(60)
    assert inner.rotation_deg == pytest.approx(90) and inner.time_s == pytest.approx(0.6)
    assert inner.tip_mm[2] > outer.tip_mm[2] + 20
    assert np.allclose(run.nodes_mm(1)[-1], run.states[1].tip_mm)
    assert not run.has_free_lumen(0)
    with pytest.raises(xc.InputError, match="draw it back to 0"):
        run.exchange(1, "exchange-035-stiff")
    run.step(push_mm=(0, -60), ms=600)
    run.exchange(1, "exchange-035-stiff")
    assert run.models[1] == "exchange-035-stiff" and run.has_free_lumen(0)


def test_coaxial_instruments_are_checked(tube):
    with pytest.raises(xc.InputError, match="does not fit into the lumen"):
        xc.CoaxialInstruments(tube, ["microcatheter-24f", "guidewire-035-j"])
    with pytest.raises(xc.InputError, match="0 instruments; give one to 3"):
        xc.CoaxialInstruments(tube, [])
    with pytest.raises(xc.InputError, match="must be a list"):
        xc.CoaxialInstruments(tube, "cobra-5f")
    run = xc.CoaxialInstruments(tube, ["cobra-5f", "guidewire-035-j"])
    for models in (None, 3):
        with pytest.raises(xc.InputError, match="^models: must be a list"):
            xc.CoaxialInstruments(tube, models)
    with pytest.raises(xc.InputError, match=r"^models\[1\]: must be the name of an instrument"):
        xc.CoaxialInstruments(tube, ["cobra-5f", 3])
    for model in (None, 3):
        with pytest.raises(xc.InputError, match="^model: must be the name of an instrument"):
            run.exchange(1, model)
    for push_mm in ([1], 3, [[1, 2]]):
        with pytest.raises(xc.InputError, match="^push_mm: must be 2 numbers, one an instrument"):
            run.step(push_mm=push_mm)
    with pytest.raises(xc.InputError, match="^push_mm: must be numbers$"):
        run.step(push_mm=["a", 1])
    with pytest.raises(xc.InputError, match="turn_deg: holds nan; all numbers must be finite"):
        run.step(turn_deg=[0, float("nan")])
    with pytest.raises(xc.InputError, match="instrument 2: must be 0 to 1"):
        run.nodes_mm(2)


def test_models_and_entries_are_checked(tube):
    with pytest.raises(xc.InputError, match="no-such"):
        xc.Catheter(tube, "no-such-model")
    with pytest.raises(xc.InputError, match="entry"):
        xc.Catheter(tube, "cobra-5f", entry=7)
    for entry in ((900, 0, 0), -1, 2**40, 2**80, 0.5):
        with pytest.raises(xc.InputError, match="entry"):
            xc.Catheter(tube, "cobra-5f", entry=entry)
    for entry in (0, np.int64(0), (0, 0, 0), np.zeros(3)):
        assert xc.Catheter(tube, "cobra-5f", entry=entry).state.branch == 0


def test_a_signal_handler_is_told_that_a_step_is_under_way(tube):
    run, told = xc.Catheter(tube, "cobra-5f"), []

    def ask(*_):
        for call in (lambda: run.state, lambda: run.nodes_mm, run.step):
            with pytest.raises(xc.Error, match="a step of this catheter is under way") as error:
                call()
            told.append(error)
        raise InterruptedError

    before = signal.signal(signal.SIGUSR1, ask)
    try:
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGUSR1)).start()
        with pytest.raises(InterruptedError):
            run.step(ms=3_000_000)
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert len(told) == 3 and run.state.time_s > 0


def test_a_tree_is_made_of_arrays_and_pickled():
    stem = np.array([[0, 0, float(z), 6] for z in range(0, 101, 5)])
    arm = np.array([[float(x), 0, 100, 4] for x in range(0, 31, 5)])
    tree = pickle.loads(pickle.dumps(xc.VesselTree([(stem, -1), (arm, 0)])))
    assert len(tree) == 2 and np.array_equal(tree[0].points, stem) and tree[1].parent == 0
    opacity = pickle.loads(pickle.dumps(xc.Opacity([(-1000, 0), (0, 0.02)], "water")))
    assert opacity.name == "water" and opacity.knots == [(-1000, 0), (0, 0.02)]


@pytest.mark.parametrize("branches, words", [
    ([], "branches"), ([1], r"branches\[0\]: must be"), ([([[0, 0, 0, 1], [0, 0, 9, 1]], 0.5)], "parent must be"),
    ([([[0, 0, 0], [0, 0, 9]], -1)], "points must be"), ([([[0, 0, 0, 1], [0, 0, 9, -1]], -1)], "radius")])
def test_branches_that_make_no_tree_are_rejected(branches, words):
    with pytest.raises(xc.InputError, match=words):
        xc.VesselTree(branches)
