"""Frames of a fluoroscope, with vessels and instruments; the learning environment and training frames draw them alike."""
import json

import numpy as np
import pytest
import xraycast as xc
from xraycast._pictures import project_points

POSE = dict(lao=20, size=(96, 80), pixel_mm=3, cone_mm=(785, 1200))


@pytest.fixture(scope="module")
def tree():
    """A straight vessel up the middle of the trunk."""
    return xc.VesselTree([(np.array([[0, 0, z, 5.0] for z in range(-150, 151, 5)]), -1)])


@pytest.fixture(scope="module")
def map_(body):
    return body.cast(layers=4)


@pytest.fixture(scope="module")
def wire(tree):
    run = xc.Catheter(tree, "guidewire-035-j")
    run.step(push_mm=100, ms=1000)
    return run


def test_a_fluoroscopes_frames_hold_pulse_and_exposure(map_):
    fluoroscope = xc.Fluoroscope(c_arm="mobile-flat-panel", dose="low", seed=3)
    frame = map_.render(**POSE, fluoroscope=fluoroscope)
    assert frame.shown.dtype == np.uint8 and frame.codes.dtype == np.uint16 and frame.signal_kev.dtype == np.float32
    assert frame.shown.shape == frame.codes.shape == frame.signal_kev.shape == frame.shape == (80, 96)
    np.testing.assert_array_equal(frame.tau, map_.render(**POSE).tau)  # the rays' own depths, without noise
    exposure = frame.exposure
    assert exposure.c_arm == "mobile-flat-panel" and exposure.pulses == 1 and exposure.images == 0 and exposure.has_dose
    assert exposure.kvp >= 40 and exposure.mas > 0 and exposure.air_kerma_mGy > 0 and exposure.dap_Gycm2 > 0
    again = map_.render(**POSE, fluoroscope=fluoroscope)
    np.testing.assert_array_equal(again.codes, frame.codes)
    other = map_.render(**POSE, fluoroscope=xc.Fluoroscope(c_arm="mobile-flat-panel", dose="low", seed=4))
    assert (other.codes != frame.codes).any()


def test_a_list_of_poses_is_a_run_of_pulses(map_):
    frames = map_.render(**{**POSE, "lao": [0, 5, 10]}, fluoroscope=xc.Fluoroscope(dose="cine"))
    assert [frame.exposure.images for frame in frames] == [1, 2, 3]
    kerma = [frame.exposure.air_kerma_mGy for frame in frames]
    assert kerma[0] < kerma[1] < kerma[2]


def test_a_c_arm_sets_the_view_that_is_left_open(map_, body):
    fluoroscope = xc.Fluoroscope(c_arm="fixed-single-plane", field_mm=220)
    for frame in (map_.render(fluoroscope=fluoroscope), body.project(fluoroscope=fluoroscope)):
        assert frame.cone_mm == (785, 1200) and frame.shape == frame.shown.shape
        assert frame.shape[0] * frame.pixel_mm == pytest.approx(220, rel=0.01)


def test_a_scans_pulse_follows_its_spectrum(body):
    frame = body.project(**POSE, opacity="spectrum:80", fluoroscope=xc.Fluoroscope(dose="cine", seed=1))
    assert frame.exposure.kvp == 80 and frame.shown.std() > 0


def test_frames_without_a_fluoroscope_have_no_pulse(map_):
    frame = map_.render(**POSE)
    assert frame.exposure is None
    with pytest.raises(xc.InputError, match="shown: this frame is no fluoroscope's"):
        frame.shown


@pytest.mark.parametrize("name", ["pulse.png", "pulse.exr", "pulse.dcm"])
def test_pulses_and_differences_are_written(map_, tree, tmp_path, name):
    for more in (dict(), dict(vessels=tree, look="dsa")):
        frame = map_.render(**POSE, fluoroscope=xc.Fluoroscope(seed=2), **more)
        frame.write(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 1000


def test_vessels_of_any_kind_attenuate(map_, body, tree, tmp_path):
    tree.write(tmp_path / "tree.vtp")
    bare = map_.render(**POSE)
    filled = map_.render(**POSE, vessels=tree, contrast_mg_ml=300)
    np.testing.assert_array_equal(map_.render(**POSE, vessels=tmp_path, contrast_mg_ml=300).tau, filled.tau)
    alone = bare.absorption(vessels=tree, contrast_mg_ml=300)
    # Both are sums of floats of some 10.
    np.testing.assert_allclose(filled.tau, bare.tau + alone, atol=1e-5)
    assert alone.max() > 1 and (alone == 0).mean() > 0.8
    dsa = map_.render(**POSE, vessels=tree, contrast_mg_ml=300, look="dsa")
    np.testing.assert_allclose(dsa.tau, alone, atol=1e-5)
    drr = body.project(**POSE, vessels=tree, contrast_mg_ml=300)
    np.testing.assert_allclose(drr.tau, body.project(**POSE).tau + drr.absorption(vessels=tree, contrast_mg_ml=300), atol=1e-5)


def test_instruments_have_their_own_diameters_and_materials(map_, tree, wire):
    pair = xc.CoaxialInstruments(tree, ["guide-6f", "guidewire-014-straight"])
    guide, thin = pair.shapes
    assert guide.diameter_mm == pytest.approx(2.0, abs=0.15) and not guide.is_wire
    assert thin.diameter_mm == pytest.approx(0.356, abs=0.01) and thin.is_wire
    assert wire.shape.diameter_mm == pytest.approx(0.889, abs=0.01) and wire.shape.is_wire
    np.testing.assert_array_equal(wire.shape.nodes_mm, wire.nodes_mm)
    fine = {**POSE, "pixel_mm": 0.3, "centre_mm": (0, 0, -100)}
    bare = map_.render(**fine)
    depths = bare.absorption(instruments=wire)
    columns = (depths[40] > 0).sum()
    # The wire's width on the detector, in pixels, and one more where it covers parts of two.
    assert columns == pytest.approx(0.889 * 1200 / 785 / 0.3, abs=1.5)
    np.testing.assert_allclose(map_.render(**fine, instruments=[wire]).tau, bare.tau + depths, atol=1e-5)


def test_markers_are_seen_where_they_are(map_, tree):
    micro = xc.Catheter(tree, "microcatheter-27f")
    micro.step(push_mm=60, ms=600)
    shape = micro.shape
    assert [(m.material, m.length_mm, m.from_tip_mm) for m in shape.markers] == [("platinum", 0.8, 0.7)]
    bare = map_.render(**{**POSE, "pixel_mm": 0.2, "centre_mm": tuple(shape.nodes_mm[-1])})
    without = xc.InstrumentShape(shape.nodes_mm, shape.diameter_mm, markers=[])
    added = bare.absorption(instruments=shape) - bare.absorption(instruments=without)
    row, column = np.unravel_index(added.argmax(), added.shape)
    seen = project_points(shape.marker_middles_mm, bare.K, np.array(bare.RT)[:3])[0]
    # A band of 0.8 by 0.9 mm covers some 6 x 7 of these pixels; it is darkest at its sides.
    assert np.hypot(column - seen[0], row - seen[1]) < 6
    assert 0 < (added > 0.1).sum() < 150
    gold = xc.InstrumentShape(shape.nodes_mm, shape.diameter_mm, markers=[xc.Marker(2, 5, material="gold", thickness_mm=0.04)])
    assert np.linalg.norm(gold.marker_middles_mm[0] - shape.nodes_mm[-1]) == pytest.approx(6, abs=0.1)
    far = xc.InstrumentShape(shape.nodes_mm, shape.diameter_mm, markers=[xc.Marker(2, 900)])
    assert np.isnan(far.marker_middles_mm).all() and len(xc.InstrumentShape(shape.nodes_mm, 0.9, is_wire=True).markers) == 1
    for bad in (dict(length_mm=0), dict(length_mm=1, material="lead"), dict(length_mm=1, from_tip_mm=-1)):
        with pytest.raises(xc.InputError, match="Marker: markers"):
            xc.Marker(**bad)
    with pytest.raises(xc.InputError, match="thickness_mm"):
        xc.InstrumentShape(shape.nodes_mm, 0.9, markers=[xc.Marker(1, thickness_mm=0.6)])


def test_the_environments_pixels_are_renders(map_, tree):
    pytest.importorskip("gymnasium")
    from xraycast._pictures import greys
    from xraycast.gym import ReachTarget
    env = ReachTarget(tree, "guidewire-035-j", target=0, body=map_, size=(64, 64))
    env.reset(seed=1)
    for _ in range(40):
        observation, *_ = env.step([1, 0.5])
    scope = env.fluoroscope
    frame = scope.frame
    with_wire = map_.render(lao=0, size=(64, 64), cone_mm=frame.cone_mm, pixel_mm=frame.pixel_mm, centre_mm=frame.centre_mm,
                            instruments=env.run)
    depths = with_wire.tau - frame.tau
    picture = greys(frame.tau + np.float32(scope.gain) * depths, scope.limits)
    # The subtraction rounds: by a grey at most.
    assert np.abs(picture.astype(int) - observation[..., 0]).max() <= 1
    assert (depths > 0.01).sum() > 20


def test_training_frames_are_projections_with_the_instrument(tmp_path, tree):
    Image = pytest.importorskip("PIL.Image")
    from xraycast._pictures import grey_range, greys
    from xraycast.cohort import frames
    from xraycast.cohort.options import Options

    scan = xc.phantom("box", spacing_mm=8)
    shapes = []

    class Vessels:
        mask = np.zeros(scan.hu.shape, np.uint8)
    Vessels.tree = tree
    take = frames.CatheterRun.next_shape
    try:
        frames.CatheterRun.next_shape = lambda run: shapes.append(take(run)) or shapes[-1]
        frames.write_frames(scan, tmp_path / "frames", Options(frames=2, size=(64, 64), catheter="guidewire-014-straight",
                                                               poses=((0.0, 0.0),)), Vessels, "a")
    finally:
        frames.CatheterRun.next_shape = take
    for number, shape in enumerate(shapes):
        frame = scan.project(size=(64, 64), cone_mm=frames.CONE_MM, instruments=shape)
        written = np.array(Image.open(tmp_path / "frames" / f"{number:04}.png"))
        # Sums of floats in another order: by a grey at most.
        assert np.abs(written.astype(int) - greys(frame.tau, grey_range(frame.tau))).max() <= 1
        assert shape.diameter_mm == pytest.approx(0.356, abs=0.01)
    labels = json.loads((tmp_path / "frames" / "coco.json").read_text())
    assert any(annotation["category_id"] == 2 for annotation in labels["annotations"])


@pytest.mark.parametrize("arguments, words", [
    (dict(c_arm="x"), "unknown C-arm"), (dict(dose="high"), "^dose high: must be low, normal or cine"),
    (dict(field_mm=100), "^field_mm 100: is a field of a C-arm; add c_arm"), (dict(kvp=300), "300 kVp"),
    (dict(stages="x"), "unknown stage"), (dict(stages=["quanta", "x"]), "unknown stage"),
    (dict(collimate=(1,)), "^collimate 1: must be WIDTH,HEIGHT"), (dict(photons=5, mas=1), "give one of them"),
    (dict(pulse_rate=1), "must be 3 to 30"),
    (dict(compression=1.5), "a compression of 1.5: must be 0 to 1"),
])
def test_fluoroscopes_that_cannot_be_are_refused(arguments, words):
    with pytest.raises(xc.InputError, match=words):
        xc.Fluoroscope(**arguments)


@pytest.mark.parametrize("arguments, words", [
    (dict(look="x"), "^look x: must be fluoro, surface or dsa"), (dict(look="dsa"), "^look dsa: there are no vessels"),
    (dict(look="surface"), "there is nothing to shade"), (dict(compositing="x"), "unknown compositing"),
    (dict(fluoroscope="fixed-single-plane"), "^fluoroscope: must be a Fluoroscope"), (dict(instruments=5), "^instruments: must be"),
    (dict(instruments="cobra-5f"), "^instruments: must be"), (dict(vessels="nowhere.vtp"), "no such file"),
    (dict(vessels=".", contrast_mg_ml=-1), "^contrast_mg_ml -1: must be 0 to 400"),
])
def test_pictures_that_cannot_be_are_refused(map_, arguments, words):
    with pytest.raises(xc.InputError, match=words):
        map_.render(**POSE, **arguments)


def test_matrices_place_no_c_arm(body, tree):
    frame = body.project(**POSE)
    for more, words in ((dict(fluoroscope=xc.Fluoroscope()), "fluoroscope: K and RT"), (dict(vessels=tree), "vessels, instruments and objects: K")):
        with pytest.raises(xc.InputError, match=words):
            body.project(K=frame.K, RT=frame.RT, size=(96, 80), **more)
    with pytest.raises(xc.InputError, match="have no gradient"):
        body.project(**POSE, gradient=True, vessels=tree)
    with pytest.raises(xc.InputError, match="take no spectrum"):
        body.project(**POSE, vessels=tree, opacity="spectrum:80")
    with pytest.raises(xc.InputError, match="nodes_mm: must be at least 4 points"):
        xc.InstrumentShape([(0, 0, 0)], 1.0)
