"""Objects in the body: how they are drawn by each call, against closed forms."""
import numpy as np
import pytest
import xraycast as xc

WATER = xc.Opacity([(-1000, 0), (0, 0.02)])


def write_box(path, half_mm, middle_mm=(0, 0, 0)):
    """A box as ASCII STL, with normals outwards."""
    corners = [np.array([x, y, z]) * half_mm + middle_mm for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    lines = ["solid box"]
    for a, b, c, d in [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]:
        for triangle in [(a, b, c), (a, c, d)]:
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += ["vertex {:.6f} {:.6f} {:.6f}".format(*corners[i]) for i in triangle] + ["endloop", "endfacet"]
    path.write_text("\n".join(lines + ["endsolid box"]) + "\n")
    return path


@pytest.fixture()
def plate(tmp_path):
    return xc.Implant(write_box(tmp_path / "plate.stl", (20, 1.5, 20)), "titanium")


def test_a_plate_adds_its_thickness_to_every_picture(box, plate):
    size = dict(size=(41, 41), pixel_mm=1, centre_mm=(0, 0, 0))
    plain, with_plate = (box.project(opacity=WATER, objects=objects, **size).tau for objects in ([], [plate]))
    # 3 mm, of the 120 mm of water; a float32 sum of some hundred samples.
    assert with_plate[20, 20] - plain[20, 20] == pytest.approx(3 * plate.per_mm, rel=1e-4)
    assert with_plate[20, 20] - plain[20, 20] > 10 * 3 * 0.02  # denser than water by far
    body = box.cast(layers=4, angles=180)
    drawn = body.render(objects=[plate], **size)
    np.testing.assert_allclose(drawn.tau - body.render(**size).tau, drawn.absorption(objects=[plate]), atol=1e-4)


def test_a_spectrum_has_its_own_attenuation(box, plate):
    size = dict(size=(41, 41), pixel_mm=1, centre_mm=(0, 0, 0))
    added = {kvp: (box.project(opacity=f"spectrum:{kvp}", objects=[plate], **size).tau
                   - box.project(opacity=f"spectrum:{kvp}", **size).tau)[20, 20] for kvp in (80, 120)}
    assert 0.5 < added[120] / added[80] < 0.95  # titanium is more transparent to harder beams
    # A fluoroscope's pictures have it too, at its tube's voltage.
    c_arm = xc.Fluoroscope(c_arm="mobile-flat-panel")
    shown = [box.project(opacity="spectrum:80", objects=objects, fluoroscope=c_arm, size=(80, 80)).shown.astype(float)
             for objects in ([], [plate])]
    assert shown[1][35:45, 35:45].mean() < shown[0][35:45, 35:45].mean() - 20


def test_a_fluoroscope_shows_it(box, plate):
    c_arm = xc.Fluoroscope(c_arm="mobile-flat-panel")
    shown = [box.project(objects=objects, fluoroscope=c_arm, size=(80, 80)).shown.astype(float) for objects in ([], [plate])]
    assert shown[1][35:45, 35:45].mean() < shown[0][35:45, 35:45].mean() - 20


def test_a_mesh_is_one_too_and_faults_are_named(tmp_path, box):
    path = write_box(tmp_path / "rod.stl", (2, 2, 30))
    assert xc.Implant(path, "Al2O3", density_g_cm3=3.9).density_g_cm3 == 3.9
    with pytest.raises(xc.InputError, match="density"):
        xc.Implant(path, "Al2O3")
    text = path.read_text().split("facet normal")
    path.write_text("facet normal".join(text[:-1]) + "endsolid box\n")
    with pytest.raises(xc.InputError, match="3 edges are open"):
        xc.Implant(path, "steel")
    with pytest.raises(xc.InputError, match="list of Implant"):
        box.project(objects=["rod.stl"])
