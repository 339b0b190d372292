"""Body maps: cast, recast, drawn, written."""
import pickle

import numpy as np
import pytest
import xraycast as xc


def test_a_map_holds_the_whole_attenuation(body):
    map_ = body.cast(layers=16)
    assert map_.tau.shape == (16, body.hu.shape[0], 360) and map_.tau.dtype == np.float32
    assert len(map_.radii_mm) == 17
    # The layers of a map add up to one layer's.
    one = body.cast(layers=1).tau.sum(0)
    np.testing.assert_allclose(map_.tau.sum(0), one, atol=1e-4 * one.max())


def test_recasting_is_casting_with_another_opacity(body):
    bone = xc.Opacity([(-1000, 0), (150, 0), (1000, 0.06)], "bone")
    basis = body.cast_basis(layers=4, knots_hu=[-1000, 150, 1000])
    recast, cast = basis.recast(bone), body.cast(layers=4, opacity=bone)
    # The weights are rounded by a shell's thickness / 131070 of mu's change, 0.06/mm; float32 sums by some 1e-5.
    thickness_mm = np.diff(recast.radii_mm).max()
    np.testing.assert_allclose(recast.tau, cast.tau, rtol=0, atol=thickness_mm / 131070 * 0.06 + 1e-5)
    assert recast.opacity.name == "bone" and recast.opacity.knots == bone.knots
    with pytest.raises(xc.InputError, match="knot"):
        basis.recast(xc.Opacity([(-900, 0), (0, 0.02)]))


def test_a_frame_resembles_the_projection(body):
    map_ = body.cast(layers=16)
    frame = np.asarray(map_.render(lao=30, size=(120, 90), pixel_mm=4, centre_mm=body.centre_mm))
    drr = np.asarray(body.project(lao=30, size=(120, 90), pixel_mm=4, centre_mm=body.centre_mm))
    assert frame.shape == drr.shape == (90, 120)
    assert np.corrcoef(frame.ravel(), drr.ravel())[0, 1] > 0.98  # a map of 16 layers is an approximation
    assert map_.render([0, 30]).shape[0] == 2


def test_maps_and_bases_are_written_and_read(body, tmp_path):
    map_ = body.cast(layers=2)
    map_.write(tmp_path / "map.exr")
    assert np.array_equal(xc.BodyMap.read(tmp_path / "map.exr").tau, map_.tau)
    assert np.array_equal(pickle.loads(pickle.dumps(map_)).tau, map_.tau)
    basis = body.cast_basis(layers=2)
    basis.write(tmp_path / "map.basis")
    assert np.array_equal(xc.Basis.read(tmp_path / "map.basis").recast("paper").tau, basis.recast("paper").tau)
    told = []
    xc.BodyMap.read(tmp_path / "map.exr", progress=lambda fraction, stage: told.append((fraction, stage)))
    map_.write(tmp_path / "map.exr", progress=lambda fraction, stage: told.append((fraction, stage)))
    assert (1.0, "reading") in told and (1.0, "writing") in told
    assert map_._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize("precision", ["half", "byte"])
def test_a_map_is_written_in_a_precision(body, tmp_path, precision):
    map_ = body.cast(layers=2)
    map_.write(tmp_path / "map.exr", precision=precision)
    stored = xc.BodyMap.read(tmp_path / "map.exr")
    for layer, tau in zip(stored.tau, map_.tau):
        # 16-bit floats have 11 significant bits; bytes are rounded to a 255th of the layer's range of values.
        tolerance = 2**-11 * tau.max() if precision == "half" else 0.501 / 255 * (tau.max() - tau.min())
        assert 0 < np.abs(layer - tau).max() <= tolerance
    stored.write(tmp_path / "again.exr")
    assert (tmp_path / "again.exr").read_bytes() == (tmp_path / "map.exr").read_bytes()
    with pytest.raises(xc.InputError, match="unknown precision 'double'; choose float, half or byte"):
        map_.write(tmp_path / "map.exr", precision="double")


@pytest.mark.parametrize("arguments, words", [
    (dict(layers=0), "layers"), (dict(layers=5000), "layers 5000: must be 1 to 256"), (dict(outline="square"), "outline"),
    (dict(angles=0), "angles"),
])
def test_arguments_that_make_no_map_are_rejected(body, arguments, words):
    with pytest.raises(xc.InputError, match=words):
        body.cast(**arguments)


def test_a_cast_takes_every_choice_of_the_command_line(body, tmp_path):
    sphere = body.cast(layers=2, angles=60, projection="sphere", centre_mm=body.centre_mm, radius_mm=150)
    assert sphere.tau.shape == (2, 30, 60)
    rectangle = body.cast(projection="rectangle", views=3, radius_mm=np.float32(150))
    assert rectangle.tau.shape[0] == 3
    circles = body.cast(outline="circle", radii=np.array([0, 20, 30.5]), centre_mm=[-3.5, 2])
    assert circles.radii_mm == [0, 20, 30.5] and circles.notes == []
    assert body.cast(layers=4, radii="equal-thickness", outline="circle", radius_mm=100).radii_mm == [0, 25, 50, 75, 100]
    assert body.cast(keep_table=True).radii_mm[-1] >= body.cast().radii_mm[-1]
    (tmp_path / "line.csv").write_text("0,0,-400\n5,0,400\n")
    assert body.cast(centre_line=tmp_path / "line.csv").tau.shape == body.cast().tau.shape
    tree = xc.VesselTree([([(10, 20, 0, 2), (10, 20, 30, 2)], -1)])
    assert np.array_equal(body.cast(centre_mm=tree).tau, body.cast(centre_mm=(10, 20)).tau)
    with pytest.raises(TypeError):
        body.cast(layers="many")


def test_a_cast_by_slabs_is_the_same_map(body):
    slabs = body.cast(layers=2, memory_limit_B=1_500_000)
    assert np.array_equal(slabs.tau, body.cast(layers=2).tau)
    with pytest.raises(xc.InputError, match="raise memory_limit_B"):
        body.cast_basis(memory_limit_B=1_500_000)


def test_a_cast_says_what_its_outline_leaves_out(body):
    left_out = "left out: everything outside the outline; keep_table includes the table"
    assert body.cast(radius_mm=150).notes == [left_out]
    assert body.cast().notes == ["cut off: the scan ends within the body at its right and left side; pictures that are wider than "
                                 "the scan have straight edges there", left_out]


def test_a_map_has_its_basis_where_knots_are_given(body):
    assert body.cast().basis is None
    map_ = body.cast(layers=2, knots_hu=[])
    assert map_.basis.knots_hu == body.cast_basis(layers=2).knots_hu
    assert map_.basis.recast("bilinear").opacity.name == "bilinear"


def test_a_map_by_a_spectrum_holds_masses_and_is_drawn(body):
    map_ = body.cast(layers=16, opacity="spectrum:80")
    masses = map_.masses_g_cm2
    assert list(masses) == ["water", "bone", "iodine"] and map_.opacity is None
    assert masses["water"].shape == (16, body.hu.shape[0], 360) and masses["water"].dtype == np.float32
    assert masses["water"].max() > 1 and masses["bone"].max() > 0.1 and not masses["iodine"].any()
    with pytest.raises(xc.InputError, match="masses_g_cm2"):
        map_.tau
    view = dict(lao=30, size=(120, 90), pixel_mm=4, centre_mm=body.centre_mm)
    frame, drr = np.asarray(map_.render(**view)), np.asarray(body.project(opacity="spectrum:80", **view))
    assert np.corrcoef(frame.ravel(), drr.ravel())[0, 1] > 0.98  # as of an opacity
    assert map_._repr_png_().startswith(b"\x89PNG")
    assert pickle.loads(pickle.dumps(map_)).masses_g_cm2["bone"].max() == masses["bone"].max()
    assert body.cast().masses_g_cm2 == {}


def test_opacities():
    bone = xc.Opacity([(-1000, 0), (1000, 0.06)])
    assert bone(0) == pytest.approx(0.03) and bone(5000) == pytest.approx(0.06)
    with pytest.raises(xc.InputError, match="knots"):
        xc.Opacity([1, 2, 3])
    with pytest.raises(xc.InputError):
        xc.Opacity([(0, -1)])


def test_too_many_frames_are_refused_before_the_first_is_drawn(body):
    map_ = body.cast()
    for make in (map_.render, body.project):
        with pytest.raises(xc.Error, match="2000 pictures of 16384 x 16384 pixels") as error:
            make(lao=[0] * 2000, size=(16384, 16384), pixel_mm=1, centre_mm=body.centre_mm)
        assert "\n" not in str(error.value)


def test_maps_are_compared_as_by_the_program(body, tmp_path):
    few, many = body.cast(layers=2), body.cast(layers=8)
    both = xc.compare(body, [few, many], views=2, cranial=10, cone_mm=(800, 1200))
    assert both.angles == [0, 180] and both.views.shape == (2, 2) and both.mean.shape == (2,)
    assert both.mean["psnr_db"][1] > both.mean["psnr_db"][0] + 3
    one = xc.compare(body, many, angles=[180], cranial=10, cone_mm=(800, 1200))
    assert one.views["psnr_db"][0, 0] == both.views["psnr_db"][1, 1]
    wall = xc.compare(body, many, angles=[0], compositing="wall")
    assert wall.views["ssim"][0, 0] < xc.compare(body, many, angles=[0]).views["ssim"][0, 0]
    assert xc.compare(body, many, angles=[0], reconstruction="constant").mean != xc.compare(body, many, angles=[0]).mean


@pytest.mark.parametrize("arguments, words", [
    (dict(maps=[]), "maps: there are none"), (dict(angles=[]), "angles: must be one angle"),
    (dict(angles=[float("nan")]), "angles: must be one angle"), (dict(reconstruction="cubic"), "choose linear or constant"),
    (dict(cone_mm=(0, 10)), "source"),
])
def test_what_cannot_be_compared_is_rejected(body, arguments, words):
    with pytest.raises(xc.InputError, match=words):
        xc.compare(body, **(dict(maps=body.cast()) | arguments))


def test_comparisons_have_pictures_and_a_plot(body):
    seen = []
    comparison = xc.compare(body, [body.cast(), body.cast(layers=4)], views=1, pictures=lambda *told: seen.append(told))
    assert [(number, angle) for number, angle, _ in seen] == [(0, 0), (1, 0)]
    picture = seen[1][2]
    assert picture.ndim == 2 and picture.dtype == np.uint8 and picture.shape[1] > 3 * 240
    plots = [comparison.plot(plot_of=measure) for measure in ("psnr", "ssim", "rmse")]
    assert all(plot.shape == (560, 900, 3) for plot in plots) and not np.array_equal(plots[0], plots[1])
    with pytest.raises(xc.InputError, match="plot_of mse: must be psnr, ssim or rmse"):
        comparison.plot(plot_of="mse")

    def fail(*_):
        raise KeyError("stop")
    with pytest.raises(KeyError):
        xc.compare(body, body.cast(), views=1, pictures=fail)
    # They would wait for each other.
    for work in (body.project, body.cast().render):
        with pytest.raises(xc.InputError, match="cannot render or project while maps are compared"):
            xc.compare(body, body.cast(), views=1, pictures=lambda *_: work())
        assert work().tau.max() > 0


def test_a_preview_shows_the_layers(body):
    map_ = body.cast(layers=2)
    preview = map_.preview()
    assert preview.dtype == np.uint8 and preview.shape[0] == 2 * (22 + body.hu.shape[0]) and preview.shape[2] == 3
    assert not np.array_equal(preview, map_.preview(preview_window="paper"))
    with pytest.raises(xc.InputError, match="preview_window grey: must be auto or paper"):
        map_.preview(preview_window="grey")
