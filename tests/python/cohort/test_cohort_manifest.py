"""Which scans a manifest or folder holds, and what tells that one has changed."""
import os

import fsspec
import pytest
import xraycast as xc
from xraycast.cohort.manifest import CohortScan, identity_of, read_cohort


def test_files_and_dicom_folders_are_scans(phantoms, tmp_path):
    (tmp_path / "patient" / "series").mkdir(parents=True)
    (tmp_path / "patient" / "series" / "1").write_bytes(bytes(128) + b"DICM")
    (tmp_path / "head.nii.gz").write_bytes(b"")
    (tmp_path / "notes.txt").write_text("not a scan")
    assert [scan.name for scan in read_cohort(str(tmp_path))] == ["head.nii.gz", "patient/series"]
    assert [scan.name for scan in read_cohort(str(phantoms))] == [
        "a.nrrd", "b.nrrd", "c.nrrd", "cut.nrrd", "more/d.nrrd", "text.nrrd"]


def test_a_manifest_names_scans_beside_itself(tmp_path):
    (tmp_path / "scan.nrrd").write_bytes(b"")
    (tmp_path / "list.csv").write_text("path,name\nscan.nrrd,first\ns3://bucket/scan.nrrd,\n")
    assert read_cohort(str(tmp_path / "list.csv")) == [CohortScan("first", str(tmp_path / "scan.nrrd")),
                                                       CohortScan("s3://bucket/scan.nrrd", "s3://bucket/scan.nrrd")]


@pytest.mark.parametrize("text, reason", [
    ("path\nmissing.nrrd\n", "line 2: path missing.nrrd: no such file"),
    ("file\nscan.nrrd\n", "has no column path"),
    ("path\n", "names no scan"),
    ("path,name\nscan.nrrd,x\nscan.nrrd,x\n", "two scans have the name x"),
    ("path,name\n,x\n", "line 2: path is empty"),
    ("name,path\nx\n", "line 2: path is empty"),
    ("path,name\nscan.nrrd,x,y\n", "line 2: more cells than columns; quote a cell that holds a comma"),
    ('path,name\n"scan.nrrd,x\n', "line 2: path scan.nrrd,x: no such file"),
    (f"path,name\nscan.nrrd,{'x' * 200000}\n", "field larger than field limit (131072); correct or remove that line"),
    (f"path{'x' * 200000}\n", "field larger than field limit (131072); correct or remove that line"),
    (f"path,name\nscan.nrrd,{'x' * 256}\n", "is too long for a folder; give it a shorter one"),
    ("path,name\nscan.nrrd,x\0y\n", "the name 'x\\x00y' holds a zero byte; remove it"),
    ("path\nscan\0.nrrd\n", "no such file"),
])
def test_a_bad_manifest_is_refused_in_one_line(tmp_path, text, reason):
    (tmp_path / "scan.nrrd").write_bytes(b"")
    (tmp_path / "list.csv").write_text(text)
    with pytest.raises(xc.InputError) as error:
        read_cohort(str(tmp_path / "list.csv"))
    assert str(tmp_path / "list.csv") in str(error.value) and reason in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("source, reason", [("no-such-folder", "no such folder"), ("none.csv", "no such file")])
def test_a_missing_source_is_refused(tmp_path, source, reason):
    with pytest.raises(xc.InputError, match=reason):
        read_cohort(str(tmp_path / source))


def test_an_empty_folder_is_refused(tmp_path):
    with pytest.raises(xc.InputError, match="holds no scan"):
        read_cohort(str(tmp_path))


def test_a_file_whose_name_is_no_utf_8_is_refused(tmp_path):
    (tmp_path / "\udcff.nrrd").write_bytes(b"")
    with pytest.raises(xc.InputError) as error:
        read_cohort(str(tmp_path))
    assert str(error.value) == f"{tmp_path}: the name '\\udcff.nrrd' or the path of its file is no UTF-8; rename it"


@pytest.mark.parametrize("name, folder", [
    ("../../escape", "%2E.+..+escape"), ("/etc", "+etc"), ("<script>alert(1)</script>", "%3Cscript%3Ealert%281%29%3C+script%3E"),
    ("=cmd|' /C calc'!A0", "%3Dcmd%7C%27 +C calc%27%21A0"), ("two\nlines", "two%0Alines"), ("$(reboot)", "%24%28reboot%29"),
])
def test_a_folder_stays_in_its_place(name, folder):
    assert CohortScan(name, "").folder == folder


def test_different_names_have_different_folders():
    names = ["a/b", "a+b", "a b", "a%2Bb", ".", "..", "../a", ".hidden", "ä", "a//b", "-a"]
    folders = [CohortScan(name, "").folder for name in names]
    assert len(set(folders)) == len(names)
    assert not any("/" in folder or folder.startswith(".") for folder in folders)
    assert CohortScan("patient/p1.nrrd", "").folder == "patient+p1.nrrd"


def test_a_changed_file_has_another_identity(tmp_path):
    file = tmp_path / "slice"
    file.write_text("1")
    before = identity_of(str(tmp_path)), identity_of(str(file))
    assert (identity_of(str(tmp_path)), identity_of(str(file))) == before
    os.utime(file, ns=(1, 1))
    after = identity_of(str(tmp_path)), identity_of(str(file))
    assert after[0] != before[0] and after[1] != before[1]


def test_voxels_beside_a_header_count(tmp_path):
    (tmp_path / "a.mhd").write_text("header")
    (tmp_path / "a.raw").write_text("voxels")
    (tmp_path / "b.raw").write_text("others")
    before = identity_of(str(tmp_path / "a.mhd"))
    (tmp_path / "b.raw").write_text("other voxels")
    assert identity_of(str(tmp_path / "a.mhd")) == before
    (tmp_path / "a.raw").write_text("other voxels")
    assert identity_of(str(tmp_path / "a.mhd")) != before


def test_scans_are_found_by_url(phantoms):
    system = fsspec.filesystem("memory")
    system.pipe("/cohort/a.nrrd", (phantoms / "a.nrrd").read_bytes())
    system.pipe("/cohort/ct/1.dcm", b"")
    try:
        assert [(scan.name, scan.path) for scan in read_cohort("memory://cohort")] == [
            ("a.nrrd", "memory:///cohort/a.nrrd"), ("ct", "memory:///cohort/ct")]
        before = identity_of("memory:///cohort/a.nrrd")
        assert identity_of("memory:///cohort/a.nrrd") == before
        system.pipe("/cohort/a.nrrd", b"other")
        assert identity_of("memory:///cohort/a.nrrd") != before
    finally:
        system.rm("/cohort", recursive=True)


def test_a_folder_has_the_same_scans_by_url(tmp_path):
    slices = b"\0" * 128 + b"DICM"
    files = {"a.nrrd": b"", ".hidden.nrrd": b"", ".cache/b.nrrd": b"", "notes.txt": b"DICM", "one/1.2.840.1": slices, "one/more/2": slices,
             "two/IM0001": slices, "two/three/c.nrrd": b"", "four/readme": b"", "four/d.nii.gz": b""}
    system = fsspec.filesystem("memory")
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(content)
        system.pipe(f"/cohort/{name}", content)
    try:
        local, remote = read_cohort(str(tmp_path)), read_cohort("memory://cohort")
    finally:
        system.rm("/cohort", recursive=True)
    assert [scan.name for scan in local] == ["a.nrrd", "four/d.nii.gz", "one", "two"]
    assert [scan.name for scan in remote] == [scan.name for scan in local]


def test_slices_at_the_root_are_one_scan_of_its_name(tmp_path):
    system = fsspec.filesystem("memory")
    (tmp_path / "patient").mkdir()
    (tmp_path / "patient" / "1.dcm").write_bytes(b"")
    system.pipe("/patient/1.dcm", b"")
    try:
        assert [scan.name for scan in read_cohort("memory://patient")] == ["patient"]
    finally:
        system.rm("/patient", recursive=True)
    assert [scan.name for scan in read_cohort(str(tmp_path / "patient"))] == ["patient"]


def test_voxels_that_a_header_names_count(tmp_path):
    (tmp_path / "scan.mhd").write_text("ElementDataFile = case7.raw\n")
    (tmp_path / "stack.nhdr").write_text("data file: slice%03d.raw 1 2 1\n")
    for name in ("case7.raw", "slice001.raw", "slice002.raw", "other.raw"):
        (tmp_path / name).write_text("voxels")
    headers = [str(tmp_path / name) for name in ("scan.mhd", "stack.nhdr")]
    for changed, counts in ("case7.raw", [True, False]), ("slice002.raw", [False, True]), ("other.raw", [False, False]):
        before = [identity_of(header) for header in headers]
        (tmp_path / changed).write_text("other voxels")
        assert [identity_of(header) != was for header, was in zip(headers, before)] == counts


def test_a_folder_with_colons_is_no_url(tmp_path):
    folder = tmp_path / "study::1"
    folder.mkdir()
    (folder / "a.nrrd").write_bytes(b"")
    assert [scan.path for scan in read_cohort(str(folder))] == [str(folder / "a.nrrd")]


def test_a_manifest_that_cannot_be_opened_says_why():
    with pytest.raises(xc.InputError) as error:
        read_cohort("s4://bucket/list.csv")
    assert "Protocol not known" in str(error.value)
