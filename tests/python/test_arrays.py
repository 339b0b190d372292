"""Arrays that are shared rather than copied, and scans made of arrays."""
import copy
import pickle

import numpy as np
import pytest
import xraycast as xc


def address(array):
    return np.asarray(array).__array_interface__["data"][0]


def test_ct_numbers_are_not_copied(body):
    assert body.hu.dtype == np.int16 and body.hu.ndim == 3
    assert address(body.hu) == address(body.hu) and not body.hu.flags.writeable


def test_a_scan_shares_its_array(hu):
    scan = xc.Scan.from_array(hu, (1, 2, 3))
    assert address(scan.hu) == address(hu)
    assert scan.spacing_mm == (1, 2, 3) and scan.origin_mm == (0, 0, 0)
    assert np.array_equal(scan.direction, np.eye(3))


def test_an_array_outlives_its_scan(hu):
    expected = hu.copy()
    held = xc.Scan.from_array(hu.copy(), (1, 1, 1)).hu
    assert np.array_equal(held, expected)


def test_values_below_padding_become_padding_in_a_copy(hu):
    hu[0, 0, 0] = -2000
    scan = xc.Scan.from_array(hu, (1, 1, 1))
    assert scan.hu[0, 0, 0] == -1024 and hu[0, 0, 0] == -2000


def test_a_strided_array_is_taken(hu):
    assert np.array_equal(xc.Scan.from_array(hu[:, :, ::2], (1, 1, 1)).hu, hu[:, :, ::2])


def test_an_unaligned_array_is_taken(hu):
    unaligned = np.frombuffer(b"x" + hu.tobytes(), np.int16, offset=1).reshape(hu.shape)
    scan = xc.Scan.from_array(unaligned, (1, 1, 1))
    assert not unaligned.flags.aligned and np.array_equal(scan.hu, hu) and address(scan.hu) % 2 == 0


@pytest.mark.parametrize("kind", [MemoryError, KeyboardInterrupt])
def test_exceptions_of_an_array_go_on(kind):
    class Array:
        def __array__(self, dtype=None, copy=None):
            raise kind

    for call in (lambda: xc.Scan.from_array(Array(), (1, 1, 1)), lambda: xc.Opacity(Array())):
        with pytest.raises(kind):
            call()


def test_a_phantom_has_whole_voxels():
    with pytest.raises(xc.InputError, match="size: .* whole numbers"):
        xc.phantom("box", size=(10.7, 10, 10))


def test_directions_reorient_the_scan(hu):
    scan = xc.Scan.from_array(hu, (1, 2, 3), (10, 20, 30), np.diag([-1.0, -1.0, 1.0]))
    assert np.array_equal(scan.hu, hu[:, ::-1, ::-1])
    # The last voxels of a row and a column become the first: x = 10 - 6 * 1, y = 20 - 5 * 2.
    assert scan.origin_mm == (4, 10, 30)


def test_pictures_and_maps_are_not_copied(body):
    frame, map_ = body.project(), body.cast(layers=2)
    assert address(frame) == address(frame.tau) == address(np.asarray(frame))
    assert address(map_.tau) == address(map_.tau)
    assert address(np.array(frame)) != address(frame)
    assert np.asarray(frame, dtype=np.float64).dtype == np.float64


def test_dlpack_shares_memory(body):
    frame = body.project()
    assert address(np.from_dlpack(frame)) == address(frame.tau)
    assert address(np.from_dlpack(body.hu)) == address(body.hu)


@pytest.mark.parametrize("array, words", [
    (np.zeros((3, 3), np.int16), "shape (z, y, x)"),
    (np.zeros((3, 3, 3)), "not float64"),
    (np.zeros((0, 3, 3), np.int16), "is empty"),
    ("text", "hu: must be"),
])
def test_arrays_of_a_wrong_kind_are_rejected(array, words):
    with pytest.raises(xc.InputError) as error:
        xc.Scan.from_array(array, (1, 1, 1))
    assert words in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("arguments, words", [
    (((1, 1),), "spacing_mm"),
    (((1, -1, 1),), "spacing_mm: -1 must be above zero"),
    (((1, 1, 1), (0, float("nan"), 0)), "origin_mm"),
    (((1, 1, 1), (0, 0, 0), np.eye(2)), "direction"),
    (((1, 1, 1), (0, 0, 0), 2 * np.eye(3)), "length 1"),
    (((1, 1, 1), (0, 0, 0), [[1, 1, 0], [0, 0, 0], [0, 0, 1]]), "direction"),
    (((1, 1, 1), (0, 0, 0), np.full((3, 3), np.inf)), "direction"),
])
def test_geometries_that_are_none_are_rejected(hu, arguments, words):
    with pytest.raises(xc.InputError, match=words.replace("(", r"\(")):
        xc.Scan.from_array(hu, *arguments)


def test_a_scan_is_written_and_read(body, tmp_path):
    body.write(tmp_path / "scan.nrrd")
    again = xc.open(tmp_path / "scan.nrrd")
    assert np.array_equal(again.hu, body.hu) and again.origin_mm == body.origin_mm
    with pytest.raises(xc.InputError, match="no such file"):
        xc.open(tmp_path / "missing.nrrd")


def test_a_scan_tells_of_its_values(body, tmp_path):
    numbers = body.hu.astype(np.float32) + 1024 + np.random.default_rng(1).normal(0, 15, body.hu.shape).astype(np.float32)
    numbers = np.maximum(numbers, 0)
    numbers[0, 0, :3] = np.nan
    size = " ".join(map(str, numbers.shape[::-1]))
    header = f"NRRD0004\ntype: float\ndimension: 3\nspace: LPS\nsizes: {size}\n" \
             "space directions: (4,0,0) (0,4,0) (0,0,4)\nencoding: raw\nendian: little\n\n"
    file = tmp_path / "scan.nrrd"
    file.write_bytes(header.encode() + numbers.tobytes())
    with pytest.warns(UserWarning, match="3 voxels are not numbers"), pytest.warns(UserWarning, match="give offset_hu -1024"):
        shifted = xc.open(file)
    assert len(shifted.warnings) == 2
    with pytest.warns(UserWarning, match="3 voxels are not numbers"):
        scan = xc.open(file, offset_hu=-1024)
    assert len(scan.warnings) == 1 and scan.hu.min() == -1024
    assert np.array_equal(pickle.loads(pickle.dumps(scan)).hu, scan.hu)


def test_simple_itk_values_are_clamped():
    sitk = pytest.importorskip("SimpleITK")
    image = sitk.GetImageFromArray(np.array([[[-40000, -2000, 50], [40000, 65536, 32767]]], np.int32))
    assert xc.Scan.from_sitk(image).hu.tolist() == [[[-1024, -1024, 50], [32767, 32767, 32767]]]


def test_simple_itk_images_come_back(hu):
    pytest.importorskip("SimpleITK")
    scan = xc.Scan.from_array(hu, (1, 2, 3), (4, 5, 6))
    again = xc.Scan.from_sitk(scan.to_sitk())
    assert np.array_equal(again.hu, hu) and again.spacing_mm == (1, 2, 3) and again.origin_mm == (4, 5, 6)


def test_a_scan_of_an_array_is_pickled_with_its_voxels(hu):
    scan = xc.Scan.from_array(hu, (1, 2, 3), (4, 5, 6))
    again = pickle.loads(pickle.dumps(scan))
    assert np.array_equal(again.hu, hu) and again.spacing_mm == (1, 2, 3) and again.origin_mm == (4, 5, 6)


def test_a_scan_of_a_file_is_pickled_as_its_name(body, tmp_path, monkeypatch):
    body.write(tmp_path / "scan.nrrd")
    monkeypatch.chdir(tmp_path)
    pickled = pickle.dumps(xc.open("scan.nrrd"))
    monkeypatch.chdir("/")
    assert len(pickled) < 1000 and np.array_equal(pickle.loads(pickled).hu, body.hu)
    xc.phantom("box", spacing_mm=8).write(tmp_path / "scan.nrrd")
    with pytest.raises(xc.InputError, match="scan.nrrd: is not the scan that was pickled"):
        pickle.loads(pickled)


def test_a_file_with_other_voxels_is_not_the_scan_that_was_pickled(hu, tmp_path):
    file = tmp_path / "scan.nrrd"
    xc.Scan.from_array(hu, (1, 2, 3)).write(file)
    pickled = pickle.dumps(xc.open(file))
    assert np.array_equal(pickle.loads(pickled).hu, hu)
    hu[2, 3, 4] += 1
    xc.Scan.from_array(hu, (1, 2, 3)).write(file)
    with pytest.raises(xc.InputError, match="scan.nrrd: is not the scan that was pickled; pickle it again"):
        pickle.loads(pickled)


def test_a_pickled_scan_tells_what_it_is(hu):
    phantom = xc.phantom("box", spacing_mm=8)
    turned = xc.Scan.from_array(hu, (1, 2, 3), (0, 0, 0), [[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    for scan in (phantom, turned):
        again = pickle.loads(pickle.dumps(scan))
        assert repr(again) == repr(scan) and again.notes == scan.notes and again.warnings == scan.warnings
    assert "phantom box" in repr(phantom) and turned.notes


def test_copies_of_a_scan_share_its_voxels(body, tmp_path):
    body.write(tmp_path / "scan.nrrd")
    scan = xc.open(tmp_path / "scan.nrrd")
    (tmp_path / "scan.nrrd").unlink()
    for again in (copy.copy(scan), copy.deepcopy(scan), copy.deepcopy([scan])[0]):
        assert address(again.hu) == address(scan.hu)
