"""Texts and names of files that are not UTF-8."""
import os
import struct

import numpy as np
import pytest
import xraycast as xc


def element(group, number, kind, value):
    if isinstance(value, str):
        value = value.encode("latin-1")
    value += (b"\0" if kind in (b"UI", b"OW") else b" ") * (len(value) % 2)
    length = struct.pack("<HI", 0, len(value)) if kind == b"OW" else struct.pack("<H", len(value))
    return struct.pack("<HH", group, number) + kind + length + value


def dicom_slice(series, index, description):
    """An axial CT slice of 4 x 4 voxels of 1 mm; explicit VR, little endian."""
    uid = f"1.2.3.{series}"
    short = lambda value: struct.pack("<H", value)  # noqa: E731
    head = element(2, 0x02, b"UI", "1.2.840.10008.5.1.4.1.1.2") + element(2, 0x03, b"UI", f"{uid}.{index + 1}")
    head += element(2, 0x10, b"UI", "1.2.840.10008.1.2.1")
    elements = [
        (0x08, 0x05, b"CS", "ISO_IR 100"), (0x08, 0x16, b"UI", "1.2.840.10008.5.1.4.1.1.2"),
        (0x08, 0x18, b"UI", f"{uid}.{index + 1}"), (0x08, 0x60, b"CS", "CT"), (0x08, 0x103E, b"LO", description),
        (0x20, 0x0D, b"UI", "1.2.3"), (0x20, 0x0E, b"UI", uid), (0x20, 0x11, b"IS", str(series)),
        (0x20, 0x13, b"IS", str(index + 1)), (0x20, 0x32, b"DS", f"0\\0\\{index}"),
        (0x20, 0x37, b"DS", "1\\0\\0\\0\\1\\0"), (0x20, 0x52, b"UI", "1.2.4"), (0x28, 0x02, b"US", short(1)),
        (0x28, 0x04, b"CS", "MONOCHROME2"), (0x28, 0x10, b"US", short(4)), (0x28, 0x11, b"US", short(4)),
        (0x28, 0x30, b"DS", "1\\1"), (0x28, 0x100, b"US", short(16)), (0x28, 0x101, b"US", short(16)),
        (0x28, 0x102, b"US", short(15)), (0x28, 0x103, b"US", short(1)), (0x28, 0x1052, b"DS", "0"),
        (0x28, 0x1053, b"DS", "1"), (0x7FE0, 0x10, b"OW", bytes(32))]
    start = bytes(128) + b"DICM" + element(2, 0, b"UL", struct.pack("<I", len(head))) + head
    return start + b"".join(element(*one) for one in elements)


def test_a_latin_1_description_is_told(tmp_path):
    for series, slices in ((1, 5), (2, 4)):
        for index in range(slices):
            (tmp_path / f"{series}-{index}.dcm").write_bytes(dicom_slice(series, index, "Sch\xe4del"))
    with pytest.warns(UserWarning, match="series"):
        scan = xc.open(tmp_path)
    assert scan.hu.shape == (5, 4, 4)
    assert any("Sch\ufffddel" in line for line in scan.notes + scan.warnings)


@pytest.mark.parametrize("of", [os.fsencode, os.fsdecode])
def test_a_name_that_is_no_text_is_opened(tmp_path, hu, of):
    name = of(os.fsencode(tmp_path) + b"/sch\xe4del.nrrd")
    scan = xc.Scan.from_array(hu, (1, 1, 1))
    scan.write(name)
    again = xc.open(name)
    assert os.path.exists(name) and np.array_equal(again.hu, hu) and "sch\ufffddel.nrrd" in repr(again)
    with pytest.raises(xc.InputError, match=r"sch\\xe4del\.json"):
        xc.Opacity.named(name.replace(*((b"nrrd", b"json") if isinstance(name, bytes) else ("nrrd", "json"))))


def test_a_name_with_a_zero_byte_is_refused():
    with pytest.raises(xc.InputError, match="scan: holds a zero byte"):
        xc.open("scan\0.nrrd")
