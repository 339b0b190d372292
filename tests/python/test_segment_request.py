"""Requests to segment: the command line and Python refuse the same values in the same words."""
import os
import subprocess

import numpy as np
import pytest
import xraycast as xc

PROGRAM = os.environ.get("XRAYCAST_PROGRAM")
MASK = "does not apply to {from_mask}, whose voxels are the vessels; leave it out"

# Options, arguments, and the message, in which {field} stands for the name that either gives a field.
BAD_VALUES = [
    ("--max-radius 0", dict(max_radius_mm=0), "{max_radius_mm} 0: must be above zero"),
    ("--max-radius -2", dict(max_radius_mm=-2), "{max_radius_mm} -2: must be above zero"),
    ("--max-radius nan", dict(max_radius_mm=float("nan")), "{max_radius_mm} nan: must be above zero"),
    ("--max-radius inf", dict(max_radius_mm=float("inf")), "{max_radius_mm} inf: must be above zero"),
    ("--triangles 99", dict(triangles=99), "{triangles} 99: must be 100 or more"),
    ("--surface cubes", dict(surface="cubes"), "{surface} cubes: must be isosurface or tubes"),
    ("--window 300,200", dict(window_hu=(300, 200)), "{window_hu} 300,200: must be two CT numbers in HU, the lower one first"),
    ("--window 9,9", dict(window_hu=(9, 9)), "{window_hu} 9,9: must be two CT numbers in HU, the lower one first"),
    ("--from-mask mask.nrrd --not 1,2,3", dict(from_mask="mask.nrrd", not_vessels=[(1, 2, 3)]), "{not_vessels} " + MASK),
    ("--from-mask mask.nrrd --window 1,2", dict(from_mask="mask.nrrd", window_hu=(1, 2)), "{window_hu} " + MASK),
    ("--from-mask mask.nrrd --max-radius 9", dict(from_mask="mask.nrrd", max_radius_mm=9), "{max_radius_mm} " + MASK),
    ("--root 0,0,9000 --from-mask mask.nrrd", dict(root_mm=(0, 0, 9000), from_mask="mask.nrrd"),
     "{root_mm} 0,0,9000: the nearest vessel end, "),
    ("--from-mask other.nrrd", dict(from_mask="other.nrrd"), "{from_mask} other.nrrd: has "),
    ("--seed 0,0,0", dict(seeds=[(0, 0, 0)]), "lies in tissue without contrast agent (0 HU); give {seeds} in a vessel"),
    ("--window 500,600 --seed 12,0,-20", dict(window_hu=(500, 600), seeds=[(12, 0, -20)]),
     "; give a {window_hu} that includes it, or leave {window_hu} out"),
]
OPTIONS = {"max_radius_mm": "--max-radius", "triangles": "--triangles", "surface": "--surface", "window_hu": "--window",
           "from_mask": "--from-mask", "not_vessels": "--not", "root_mm": "--root", "seeds": "--seed"}
FIELDS = {field: field for field in OPTIONS}


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """A tube of contrast agent in a body, with its mask, and one on another grid; the current folder is theirs."""
    folder = tmp_path_factory.mktemp("scan")
    before = os.getcwd()
    os.chdir(folder)
    z, y, x = np.mgrid[-40:40, -40:40, -40:40]
    hu = np.where(np.hypot(x, y) < 36, 0, -1000).astype(np.int16)
    tube = np.hypot(x - 12, y) < 5
    hu[tube] = 350
    made = xc.Scan.from_array(hu, (1, 1, 1), (-40, -40, -40))
    made.write("ct.nrrd")
    xc.Scan.from_array(tube.astype(np.int16), (1, 1, 1), (-40, -40, -40)).write("mask.nrrd")
    xc.Scan.from_array(tube[1:].astype(np.int16), (1, 1, 1), (-40, -40, -40)).write("other.nrrd")
    yield made
    os.chdir(before)


@pytest.mark.parametrize("options, arguments, message", BAD_VALUES)
def test_the_command_line_and_python_refuse_a_value_alike(scan, options, arguments, message):
    with pytest.raises(xc.InputError) as error:
        scan.segment(**arguments)
    assert message.format(**FIELDS) in str(error.value)
    if not PROGRAM:
        pytest.skip("without the program")
    done = subprocess.run([PROGRAM, "segment", "ct.nrrd", "-o", "out", *options.split()], capture_output=True, text=True)
    assert done.returncode == 3 and done.stderr.count("\n") == 1
    assert message.format(**OPTIONS) in done.stderr
    assert not os.path.exists("out")


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
    names = {"mask.nrrd", "lumen.nrrd", "tree.vtp", "tree.json", "surface.vtp", "surface.stl"}
    assert {file.name for file in (tmp_path / "python").iterdir()} == names
    if not PROGRAM:
        pytest.skip("without the program")
    subprocess.run([PROGRAM, "segment", "ct.nrrd", "-o", tmp_path / "program", "--from-mask", "mask.nrrd", "--surface",
                    "tubes", "--root", "12,0,40", "--quiet"], check=True)
    for name in names:
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "program" / name).read_bytes(), name


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
