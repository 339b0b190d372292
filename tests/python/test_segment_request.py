"""Requests to segment, by the command line and by Python; what both refuse is in test_bad_requests.py."""
import os
import subprocess

import numpy as np
import pytest
import xraycast as xc

PROGRAM = os.environ.get("XRAYCAST_PROGRAM")


@pytest.fixture(scope="module")
def scan(tmp_path_factory, angiogram):
    """An angiogram, with its mask; the current folder is theirs."""
    folder = tmp_path_factory.mktemp("scan")
    before = os.getcwd()
    os.chdir(folder)
    hu, tube = angiogram
    made = xc.Scan.from_array(hu, (1, 1, 1), (-40, -40, -40))
    made.write("ct.nrrd")
    xc.Scan.from_array(tube.astype(np.int16), (1, 1, 1), (-40, -40, -40)).write("mask.nrrd")
    yield made
    os.chdir(before)


def test_vessels_of_a_mask_are_the_same_from_a_file_an_array_and_vessels(scan):
    mask = xc.open("mask.nrrd").hu
    first = scan.segment(from_mask="mask.nrrd")
    for given in (mask, mask.astype(float), first):
        again = scan.segment(from_mask=given)
        assert np.array_equal(again.mask, first.mask) and np.array_equal(again.lumen, first.lumen)
        assert np.array_equal(again.tree[0].points, first.tree[0].points)
    with pytest.raises(xc.InputError, match="from_mask: must be of the scan's shape"):
        scan.segment(from_mask=mask[1:])


def test_the_program_and_python_write_the_same_files(scan, tmp_path):
    vessels = scan.segment(from_mask="mask.nrrd", surface="tubes", root_mm=(12, 0, 40))
    vessels.write(tmp_path / "python")
    names = {"mask.nrrd", "lumen.nrrd", "tree.vtp", "tree.json", "names.json", "surface.vtp", "surface.stl"}
    assert {file.name for file in (tmp_path / "python").iterdir()} == names
    if not PROGRAM:
        pytest.skip("without the program")
    subprocess.run([PROGRAM, "segment", "ct.nrrd", "-o", tmp_path / "program", "--from-mask", "mask.nrrd", "--surface",
                    "tubes", "--root", "12,0,40", "--quiet"], check=True)
    for name in names:
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "program" / name).read_bytes(), name
    picture = np.asarray(pytest.importorskip("PIL.Image").open(tmp_path / "program/report.png"))
    title = 28  # rows; it names the scan
    assert np.array_equal(vessels.report(scan)[title:], picture[title:])


def test_a_report_shows_how_the_vessels_were_found(scan):
    mask = xc.open("mask.nrrd").hu
    reports = [vessels.report(scan) for vessels in (scan.segment(from_mask=mask), scan.segment(seeds=[(12, 0, 0)]))]
    assert all(report.shape == (860, 1500, 3) and report.dtype == np.uint8 for report in reports)
    assert not np.array_equal(*reports)
    with pytest.raises(xc.InputError, match="vessels' mask: has"):
        scan.segment(from_mask=mask).report(xc.Scan.from_array(scan.hu, (1, 1, 2)))


def test_vessels_tell_how_they_were_found(scan):
    steps = []
    vessels = scan.segment(seeds=[(12, 0, 0)], explain=lambda step, mask: steps.append((step, mask.copy())))
    assert [step for step, _ in steps][:2] == ["window", "body"] and np.array_equal(steps[-1][1], vessels.mask)
    low, high = vessels.window_hu
    assert low < 350 < high and vessels.evidence is None
    assert vessels.noise_hu == 0 and vessels.weak_fraction == 0
    # The tube has a radius of 5 mm and a length of 80 mm; a voxel's rim is the least that can be wrong.
    assert vessels.lumen_mm3 == pytest.approx(np.pi * 25 * 80, rel=0.2)
    assert vessels.loops == [] and vessels.gaps_mm == [] and vessels.parts_left_out == 0 and vessels.notes == []


def test_an_exception_of_the_explaining_function_ends_the_call(scan):
    def fail(step, mask):
        raise LookupError(step)
    with pytest.raises(LookupError, match="window"):
        scan.segment(seeds=[(12, 0, 0)], explain=fail)
