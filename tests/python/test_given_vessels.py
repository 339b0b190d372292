"""Vessels of other programs, as `xraycast vessels` makes them."""
import pickle

import numpy
import pytest

import xraycast as xc


def tube(path, scale=1.0):
    """A tube of 5 mm radius along z, from 0 to 60 mm, as ASCII PLY."""
    sides, rings = 24, 31
    angles = numpy.arange(sides) * 2 * numpy.pi / sides
    points = [(5 * numpy.cos(a) * scale, 5 * numpy.sin(a) * scale, 2.0 * k * scale) for k in range(rings) for a in angles]
    faces = [(k * sides + i, k * sides + (i + 1) % sides, (k + 1) * sides + (i + 1) % sides, (k + 1) * sides + i)
             for k in range(rings - 1) for i in range(sides)]
    path.write_text("ply\nformat ascii 1.0\n" + f"element vertex {len(points)}\nproperty float x\nproperty float y\n"
                    f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
                    + "".join("%g %g %g\n" % p for p in points) + "".join("4 %d %d %d %d\n" % f for f in faces))


def test_a_surface_in_metres_has_its_tree(tmp_path):
    tube(tmp_path / "tube.ply", scale=0.001)
    vessels = xc.vessels(tmp_path / "tube.ply", unit="m")
    assert len(vessels.tree) == 1
    points = numpy.asarray(vessels.tree[0].points)
    assert numpy.abs(points[:, :2]).max() < 0.1, "the axis"
    numpy.testing.assert_allclose(sorted(points[[0, -1], 2]), [0, 60], atol=1e-3)
    assert abs(numpy.median(points[:, 3]) / 5 - 1) < 0.02, "24 flat sides have a radius less by 0.9 %"
    assert vessels.report().shape[2] == 3
    vessels.write(tmp_path / "vessels")
    assert (tmp_path / "vessels" / "tree.vtp").exists() and not (tmp_path / "vessels" / "mask.nrrd").exists()


def test_branches_have_names(tmp_path):
    fork = [([(0, 0, 90, 5), (0, 0, 40, 5)], -1, "aorta"), ([(0, 0, 40, 3), (40, 0, 0, 3)], 0, "left iliac artery"),
            ([(0, 0, 40, 3), (-40, 0, 0, 3)], 0)]
    tree = xc.VesselTree(fork)
    assert [branch.name for branch in tree.branches] == ["aorta", "left iliac artery", ""]
    assert tree.named("Left_iliac_artery") == [1]
    assert [branch.name for branch in pickle.loads(pickle.dumps(tree)).branches] == ["aorta", "left iliac artery", ""]
    tree.write(tmp_path / "tree.json")
    (tmp_path / "names.json").write_text('{"names": [{"branch": 2, "name": "right iliac artery"}]}')
    assert xc.VesselTree.read(tmp_path / "tree.json").branches[2].name == "right iliac artery"
    run = xc.Catheter(tree, "cobra-5f", entry="left iliac artery")
    assert run.state.branch == 1 and run.state.vessel == "left iliac artery"
    for call, words in [(lambda: tree.named("spleen"), 'name "spleen": no branch of the tree has this name; it has aorta, left'),
                        (lambda: xc.Catheter(tree, "cobra-5f", entry="spleen"), "entry spleen: no branch of the tree"),
                        (lambda: xc.VesselTree([(fork[0][0], -1, 7)]), "branches[0]: name must be text"),
                        (lambda: xc.VesselTree([(fork[0][0], -1, "a" * 81)]), "more than 80 bytes")]:
        with pytest.raises(xc.InputError) as error:
            call()
        assert words in str(error.value)


def test_bad_requests(tmp_path):
    tube(tmp_path / "tube.ply")
    for arguments, words in [(dict(unit="inch"), "unit inch: must be mm, cm, m or um"),
                             (dict(frame="left"), "frame left: must be lps or ras"),
                             (dict(triangles=5), "triangles 5: must be 100 or more"),
                             (dict(radius_mm=-1.0), "radius_mm -1: must be above zero")]:
        with pytest.raises(xc.InputError) as error:
            xc.vessels(tmp_path / "tube.ply", **arguments)
        assert words in str(error.value)
