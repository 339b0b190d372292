"""PROGRAM [TEST...]: scans that other programs wrote, dcmtk and pydicom among them, as the program reads them."""
import json
import os
import pathlib
import random
import re
import struct
import subprocess
import sys
import tempfile
import unittest
import zipfile

import nibabel
import numpy
import pydicom
import pydicom.dataset
import pydicom.sequence
import pydicom.uid

PROGRAM = sys.argv.pop(1)
SLICES, ROWS, COLUMNS = 6, 40, 48
SPACING_MM = (0.7, 0.8, 1.5)  # columns, rows, slices
CT, ENHANCED_CT = "1.2.840.10008.5.1.4.1.1.2", "1.2.840.10008.5.1.4.1.1.2.1"


def run(*words):
    done = subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, timeout=100)
    if done.returncode != 0:
        raise AssertionError(f"{words}: {done.stderr}")
    return done


def tool(*words):
    subprocess.run([*map(str, words)], check=True, capture_output=True, timeout=100)


def read_nrrd(path):
    """Voxels z, y, x, and the header's lines about where they lie."""
    header, _, data = path.read_bytes().partition(b"\n\n")
    fields = dict(line.split(b": ", 1) for line in header.splitlines() if b": " in line)
    shape = [int(n) for n in fields[b"sizes"].split()][::-1]
    return numpy.frombuffer(data, "<i2").reshape(shape), fields[b"space directions"], fields[b"space origin"]


def stored_pixels(z):
    """12 bits, smooth enough for codecs and different in every slice."""
    y, x = numpy.mgrid[:ROWS, :COLUMNS]
    return ((50 * z + 37 * x + 11 * y * (z + 1)) % 4096).astype("<u2")


def common(data):
    """What a slice and a file of frames share."""
    data.PatientName, data.PatientID = "Test^Scan", "1"
    data.PatientBirthDate = data.PatientSex = ""
    data.StudyDate, data.StudyTime, data.StudyID = "20260101", "120000", "1"
    data.AccessionNumber = data.ReferringPhysicianName = data.Manufacturer = ""
    data.Modality = "CT"
    data.StudyInstanceUID, data.SeriesInstanceUID = "1.2.3", "1.2.3.4"
    data.FrameOfReferenceUID = "1.2.3.5"
    data.SeriesNumber = 7
    data.Rows, data.Columns, data.SamplesPerPixel = ROWS, COLUMNS, 1
    data.PhotometricInterpretation = "MONOCHROME2"
    data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, 12, 11, 0


def new_dataset(path, sop_class, uid):
    meta = pydicom.dataset.FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = sop_class, uid
    meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
    data = pydicom.dataset.FileDataset(str(path), {}, file_meta=meta, preamble=b"\0" * 128)
    data.is_little_endian, data.is_implicit_VR = True, False
    data.SOPClassUID, data.SOPInstanceUID = sop_class, uid
    common(data)
    return data


def position_of(z):
    return [-20, 10, 100 + SPACING_MM[2] * z]


def item(**values):
    data = pydicom.dataset.Dataset()
    for name, value in values.items():
        setattr(data, name, value)
    return data


def sequence(**values):
    return pydicom.sequence.Sequence([item(**values)])


DIRECTIONS = [1, 0, 0, 0, 1, 0]
PIXEL_SPACING = [SPACING_MM[1], SPACING_MM[0]]


def write_slice(path, z):
    data = new_dataset(path, CT, f"1.2.3.6.{z}")
    data.ImageType = ["ORIGINAL", "PRIMARY", "AXIAL"]
    data.InstanceNumber, data.SliceThickness = z + 1, SPACING_MM[2]
    data.ImagePositionPatient, data.ImageOrientationPatient = position_of(z), DIRECTIONS
    data.PixelSpacing = PIXEL_SPACING
    data.RescaleSlope, data.RescaleIntercept = 1, -1024
    data.PixelData = stored_pixels(z).tobytes()
    data.save_as(path)


def write_series(folder):
    folder.mkdir(exist_ok=True)
    for z in range(SLICES):
        write_slice(folder / f"slice{z}.dcm", z)


def write_enhanced(path, order, per_frame_geometry, slope_of=lambda z: 1, change=lambda data: None):
    """Frames in any order; orientation, spacing and rescale in the shared groups or in each frame's own."""
    data = new_dataset(path, ENHANCED_CT, "1.2.3.7")
    data.ImageType = ["ORIGINAL", "PRIMARY", "VOLUME", "NONE"]
    data.NumberOfFrames = len(order)

    def geometry(group, z):
        group.PlaneOrientationSequence = sequence(ImageOrientationPatient=DIRECTIONS)
        group.PixelMeasuresSequence = sequence(PixelSpacing=PIXEL_SPACING, SliceThickness=SPACING_MM[2])
        group.PixelValueTransformationSequence = sequence(
            RescaleIntercept=-1024, RescaleSlope=slope_of(z), RescaleType="HU")

    shared = pydicom.dataset.Dataset()
    if not per_frame_geometry:
        geometry(shared, 0)
    data.SharedFunctionalGroupsSequence = pydicom.sequence.Sequence([shared])
    frames = []
    for z in order:
        frame = pydicom.dataset.Dataset()
        frame.FrameContentSequence = sequence(StackID="1", InStackPositionNumber=z + 1, TemporalPositionIndex=1)
        frame.PlanePositionSequence = sequence(ImagePositionPatient=position_of(z))
        if per_frame_geometry:
            geometry(frame, z)
        frames.append(frame)
    data.PerFrameFunctionalGroupsSequence = pydicom.sequence.Sequence(frames)
    data.PixelData = b"".join((stored_pixels(z) // slope_of(z)).astype("<u2").tobytes() for z in order)
    change(data)
    data.save_as(path)


class ScanInput(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="scan-input-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.temporary = self.folder / "tmp"
        self.temporary.mkdir()
        before = os.environ.get("TMPDIR")
        os.environ["TMPDIR"] = str(self.temporary)
        self.addCleanup(lambda: os.environ.pop("TMPDIR") if before is None else os.environ.update(TMPDIR=before))
        self.series = self.folder / "series"
        write_series(self.series)

    def voxels(self, path, *options):
        target = self.folder / "out.nrrd"
        run("convert", path, "-o", target, "-q", *options)
        return read_nrrd(target)

    def assert_equals_series(self, path, *options):
        expected, actual = self.voxels(self.series), self.voxels(path, *options)
        self.assertEqual(expected[1:], actual[1:])
        numpy.testing.assert_array_equal(expected[0], actual[0])

    def fails(self, path, *words):
        """One line, exit status 3, with these words in it."""
        done = subprocess.run([PROGRAM, "info", str(path)], capture_output=True, text=True, timeout=100)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)
        return done.stderr

    # ---- archives -----------------------------------------------------------------------------------

    def zipped(self, names=lambda name: f"CD/images/{name}", extra=(), **options):
        path = self.folder / "scan.zip"
        with zipfile.ZipFile(path, "w", **options) as archive:
            for file in sorted(self.series.iterdir()):
                archive.write(file, names(file.name))
            for name, content in extra:
                archive.writestr(name, content)
        return path

    def leftovers(self):
        return list(self.temporary.iterdir())

    def test_zip_equals_its_folder(self):
        for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            self.assert_equals_series(self.zipped(compression=method, extra=[("CD/readme.txt", "no scan")]))
        # Its files may have any names.
        self.assert_equals_series(self.zipped(names=lambda name: f"../../{name}"))
        self.assert_equals_series(self.zipped(names=lambda name: f"/etc/{name}"))
        self.assertEqual(list(self.folder.parent.glob("slice*.dcm")), [])
        self.assertEqual(self.leftovers(), [])

    def test_what_a_killed_run_left_is_removed(self):
        abandoned = self.temporary / "xraycast-zip-0123456789abcdef"
        (abandoned / "000000").mkdir(parents=True)
        abandoned.chmod(0o700)
        run("info", self.zipped())
        self.assertFalse(abandoned.exists())

    def test_damaged_zip_ends_in_one_line(self):
        path = self.zipped(compression=zipfile.ZIP_DEFLATED)
        whole = path.read_bytes()
        bad = bytearray(whole)
        bad[2000] ^= 0x55
        bomb = self.zipped(compression=zipfile.ZIP_DEFLATED, extra=[("bomb", bytes(1 << 28))]).read_bytes()
        path.write_bytes(whole[:len(whole) // 2])
        self.fails(path, "scan.zip", "not a complete zip archive")
        path.write_bytes(bad)
        self.fails(path, "scan.zip/CD/images/slice0.dcm", "damaged")
        path.write_bytes(bomb)
        self.fails(path, "scan.zip", "times its size")
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("notes.txt", "no scan")
        self.fails(path, "scan.zip", "no images")
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("a.dcm", (self.series / "slice0.dcm").read_bytes()[:-100])
        said = self.fails(path, "scan.zip/a.dcm", "truncated")
        self.assertNotIn("xraycast-zip", said)
        self.assertEqual(self.leftovers(), [])

    # ---- NIfTI --------------------------------------------------------------------------------------

    def assert_lies_where_nibabel_says(self, path):
        image = nibabel.load(path)
        voxels, directions, origin = self.voxels(path)
        numbers = [float(v) for v in re.findall(rb"[-+.e0-9]+", directions + origin)]
        ours = numpy.eye(4)
        ours[:3, :3], ours[:3, 3] = numpy.reshape(numbers[:9], (3, 3)).T, numbers[9:]
        ours = numpy.diag([-1, -1, 1, 1]) @ ours  # to RAS
        theirs = numpy.asarray(image.dataobj)
        found = 0
        # Voxels are delivered along the patient's axes: where theirs lie, ours have the same value.
        for index in numpy.ndindex(theirs.shape):
            at = numpy.linalg.solve(ours, image.affine @ [*index, 1])[:3]
            numpy.testing.assert_allclose(at, at.round(), atol=1e-3)
            self.assertEqual(voxels[tuple(at.round().astype(int)[::-1])], theirs[index])
            found += 1
        self.assertEqual(found, voxels.size)

    def test_nifti_of_both_versions(self):
        chance = numpy.random.default_rng(6)
        data = chance.integers(-1000, 2000, (4, 5, 6)).astype("<i2")
        for kind in (nibabel.Nifti1Image, nibabel.Nifti2Image):
            for turns in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                for codes in ((1, 1), (1, 0), (0, 2)):  # of sform and qform
                    affine = numpy.zeros((4, 4))
                    for column, axis in enumerate(turns):
                        affine[axis, column] = chance.choice([-1, 1]) * (0.5 + column)
                    affine[:, 3] = [-10, 20, 30, 1]
                    image = kind(data, affine)
                    image.set_sform(affine, codes[0])
                    image.set_qform(affine, codes[1])
                    for name in ("scan.nii", "scan.nii.gz"):
                        with self.subTest((kind.__name__, turns, codes, name)):
                            nibabel.save(image, self.folder / name)
                            self.assert_lies_where_nibabel_says(self.folder / name)

    def test_sform_and_qform_that_disagree_are_told(self):
        path, data = self.folder / "scan.nii.gz", numpy.arange(60, dtype="<i2").reshape(3, 4, 5)
        affine = numpy.array([[-0.7, 0, 0, 90.3], [0, 0.7, 0, -80.2], [0, 0, 1.5, 12.6], [0, 0, 0, 1]])

        def turned(deg):
            c, s = numpy.cos(numpy.radians(deg)), numpy.sin(numpy.radians(deg))
            return numpy.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])

        for kind in (nibabel.Nifti1Image, nibabel.Nifti2Image):
            for change, told in ((numpy.eye(4), None), (turned(0.09), None), (turned(0.11), "0.11 deg"),
                                 (numpy.diag([1, 1, 1.1, 1]), "0.75 mm"), (numpy.diag([-1, 1, 1, 1]), "180 deg")):
                for unit, scale in (("mm", 1), ("meter", 1e-3)):
                    with self.subTest((kind.__name__, told, unit)):
                        image = kind(data, None)
                        size = numpy.diag([scale, scale, scale, 1])
                        moved = affine @ change
                        moved[:3, 3] = affine[:3, 3]
                        image.set_sform(size @ affine, 1)
                        image.set_qform(size @ moved, 1)
                        image.header.set_xyzt_units(unit)
                        nibabel.save(image, path)
                        warnings = json.loads(run("info", path, "--json").stdout)["warnings"]
                        self.assertEqual(len(warnings), 0 if told is None else 1, warnings)
                        self.assertIn(told or "", (warnings or [""])[0])
                        self.assertEqual("left and right" in str(warnings), "deg" in (told or ""), warnings)
        shifted = affine.copy()
        for shift, count in ((0.09, 0), (0.11, 1)):
            shifted[0, 3] = affine[0, 3] + shift
            image = nibabel.Nifti1Image(data, None)
            image.set_sform(affine, 1)
            image.set_qform(shifted, 1)
            nibabel.save(image, path)
            self.assertEqual(len(json.loads(run("info", path, "--json").stdout)["warnings"]), count)
        # A row of zeros says nothing: the qform is taken, and without one the file is refused.
        image = nibabel.Nifti1Image(data, None)
        image.set_qform(affine, 1)
        image.set_sform(affine, 1)
        image.header["srow_y"] = 0
        nibabel.save(nibabel.Nifti1Image(data, None, image.header), path)
        by_qform = self.voxels(path)
        warnings = json.loads(run("info", path, "--json").stdout)["warnings"]
        self.assertEqual(len(warnings), 1, warnings)
        self.assertIn("sform (srow_x, srow_y, srow_z) is a singular matrix; the qform was taken", warnings[0])
        image.header["sform_code"] = 0
        nibabel.save(nibabel.Nifti1Image(data, None, image.header), path)
        expected = self.voxels(path)
        numpy.testing.assert_array_equal(by_qform[0], expected[0])
        self.assertEqual(by_qform[1:], expected[1:])
        image.header["sform_code"], image.header["qform_code"] = 1, 0
        nibabel.save(nibabel.Nifti1Image(data, None, image.header), path)
        self.fails(path, "scan.nii.gz", "sform (srow_x, srow_y, srow_z) is a singular matrix", "export the file again")

    def test_nifti_in_the_other_byte_order(self):
        data = numpy.arange(60).reshape(3, 4, 5)
        for kind, header in ((nibabel.Nifti1Image, nibabel.Nifti1Header), (nibabel.Nifti2Image, nibabel.Nifti2Header)):
            image = kind(data.astype(">i2"), numpy.diag([1, 2, 3, 1]), header(endianness=">"))
            image.set_data_dtype(">i2")
            nibabel.save(image, self.folder / "swapped.nii")
            self.assertEqual(int.from_bytes((self.folder / "swapped.nii").read_bytes()[:4], "big"),
                             348 if kind is nibabel.Nifti1Image else 540)
            self.assert_lies_where_nibabel_says(self.folder / "swapped.nii")

    def test_damaged_nifti_ends_in_one_line(self):
        path = self.folder / "scan.nii"
        nibabel.save(nibabel.Nifti2Image(numpy.zeros((3, 4, 5), "<i2"), numpy.eye(4)), path)
        whole = path.read_bytes()

        def with_number(offset, code, value):
            return whole[:offset] + struct.pack(code, value) + whole[offset + struct.calcsize(code):]

        for content, words in ((whole[:300], ["header"]), (whole[:-3], ["truncated"]),
                               (with_number(24, "<q", 1 << 60), ["1 to 65536"]),
                               (with_number(24, "<q", -1), ["dim"]), (with_number(16, "<q", 1 << 40), ["dim"]),
                               (with_number(112, "<d", float("nan")), ["pixdim"]),
                               (with_number(168, "<q", 1 << 62), ["vox_offset"]),
                               (with_number(12, "<h", 128), ["datatype"]),
                               (with_number(400, "<d", float("inf")), ["sform"])):
            with self.subTest(words):
                path.write_bytes(content)
                self.fails(path, "scan.nii", *words)

    # ---- the series itself ------------------------------------------------------------------------

    def test_series_is_what_was_written(self):
        voxels, _, _ = self.voxels(self.series)
        for z in range(SLICES):
            numpy.testing.assert_array_equal(voxels[z], stored_pixels(z).astype(int) - 1024)

    def test_studies_and_patients_in_one_folder(self):
        def other(data, number, study, date, patient):
            data.SeriesInstanceUID, data.SeriesNumber = f"1.2.9.{number}", number
            data.StudyInstanceUID, data.StudyDate, data.PatientID = study, date, patient
            data.PatientName = "Secret^Other"

        both = self.folder / "both"
        both.mkdir()
        write_enhanced(both / "a.dcm", range(SLICES), True)
        self.assertNotIn("warning", run("info", both).stdout)
        write_enhanced(both / "b.dcm", range(3), True, change=lambda data: other(data, 8, "1.2.8", "20251224", "1"))
        write_enhanced(both / "c.dcm", range(2), True, change=lambda data: other(data, 9, "1.2.10", "20250131", "2"))
        for words in (("info", both), ("convert", both, "-o", self.folder / "both.nrrd")):
            done = run(*words)
            said = (done.stdout if words[0] == "info" else done.stderr).splitlines()
            about = [line for line in said if "studies" in line]
            self.assertEqual(len(about), 1, said)
            self.assertIn("3 series of 3 studies of 2 patients in the folder, the one with the most slices was chosen", about[0])
            self.assertIn("study of 2026-01-01); choose another series by its number, description or UID", about[0])
            self.assertEqual(sum("in the folder" in line for line in said), 1, said)
            self.assertNotIn("Secret", done.stdout + done.stderr)
        said = json.loads(run("info", both, "--json").stdout)
        self.assertEqual((said["studies"], said["patients"]), (3, 2))
        self.assertEqual([s["study_date"] for s in said["all_series"]], ["2026-01-01", "2025-12-24", "2025-01-31"])
        self.assertEqual(sum("3 studies" in warning for warning in said["warnings"]), 1)
        # Who names a series has chosen.
        self.assertNotIn("studies", run("info", both, "--series", "9").stdout)

    # ---- frames -----------------------------------------------------------------------------------

    def test_frames_out_of_order_equal_slices(self):
        for seed, per_frame in ((1, False), (2, True)):
            order = list(range(SLICES))
            random.Random(seed).shuffle(order)
            path = self.folder / "enhanced.dcm"
            write_enhanced(path, order, per_frame)
            self.assert_equals_series(path)

    def test_frames_have_their_own_rescale(self):
        path = self.folder / "enhanced.dcm"
        write_enhanced(path, [2, 0, 1, 5, 4, 3], True, slope_of=lambda z: z + 1)
        voxels, _, _ = self.voxels(path)
        for z in range(SLICES):
            numpy.testing.assert_array_equal(voxels[z], stored_pixels(z) // (z + 1) * (z + 1) - 1024.0)

    def test_info_counts_frames(self):
        path = self.folder / "enhanced.dcm"
        write_enhanced(path, range(SLICES), False)
        said = json.loads(run("info", path, "--json").stdout)
        self.assertEqual(said["size"], [COLUMNS, ROWS, SLICES])
        self.assertEqual([series["slices"] for series in said["all_series"]], [SLICES])
        numpy.testing.assert_allclose(said["spacing_mm"], SPACING_MM)

    def test_frames_among_other_files(self):
        folder = self.folder / "mixed"
        folder.mkdir()
        (folder / "notes.txt").write_text("no scan\n")

        def other_series(data):
            data.SeriesInstanceUID, data.SeriesNumber = "1.2.9", 9

        write_enhanced(folder / "b.dcm", list(reversed(range(SLICES))), True)
        write_enhanced(folder / "a.dcm", range(3), True, change=other_series)
        self.assert_equals_series(folder)
        said = json.loads(run("info", folder, "--json").stdout)
        self.assertEqual([(s["number"], s["slices"]) for s in said["all_series"]], [("7", SLICES), ("9", 3)])
        voxels, _, _ = self.voxels(folder, "--series", "9")
        self.assertEqual(len(voxels), 3)

    def test_frames_in_several_files(self):
        folder = self.folder / "parts"
        folder.mkdir()
        write_enhanced(folder / "b.dcm", [1, 0, 2], False)
        write_enhanced(folder / "a.dcm", [5, 4, 3], True)
        self.assert_equals_series(folder)

    def test_first_time_is_taken(self):
        def later_first(data):
            groups = data.PerFrameFunctionalGroupsSequence
            for k, group in enumerate(groups):
                group.FrameContentSequence[0].TemporalPositionIndex = 2 if k < SLICES else 1
            later = (numpy.frombuffer(data.PixelData[:len(data.PixelData) // 2], "<u2") // 2).astype("<u2")
            data.PixelData = later.tobytes() + data.PixelData[len(data.PixelData) // 2:]

        path = self.folder / "times.dcm"
        write_enhanced(path, [*range(SLICES), *range(SLICES)], True, change=later_first)
        self.assert_equals_series(path)
        self.assertIn("6 slices left out", run("info", path).stdout)

    def test_largest_stack_is_taken(self):
        def two_stacks(data):
            for group in data.PerFrameFunctionalGroupsSequence[SLICES:]:
                group.FrameContentSequence[0].StackID = "2"
                group.PlaneOrientationSequence[0].ImageOrientationPatient = [0, 1, 0, 0, 0, -1]

        path = self.folder / "stacks.dcm"
        write_enhanced(path, [*range(SLICES), 0, 1], True, change=two_stacks)
        self.assert_equals_series(path)
        self.assertIn("of 2 stacks", run("info", path).stdout)

    def test_frames_in_every_transfer_syntax(self):
        plain = self.folder / "enhanced.dcm"
        write_enhanced(plain, [3, 1, 0, 2, 5, 4], True)
        packed = self.folder / "packed.dcm"
        for words in (("dcmconv", "+ti"), ("dcmconv", "+tb"), ("dcmconv", "+td"), ("dcmconv", "-e"), ("dcmcrle",),
                      ("dcmcrle", "+ot"), ("dcmcjpls",), ("dcmcjpeg",), ("dcmcjpeg", "+fs", "1")):
            with self.subTest(words):
                tool(*words, plain, packed)
                self.assert_equals_series(packed)

    def test_damaged_frames_end_in_one_line(self):
        path = self.folder / "bad.dcm"

        def without_position(data):
            del data.PerFrameFunctionalGroupsSequence[2].PlanePositionSequence

        write_enhanced(path, range(SLICES), True, change=without_position)
        self.fails(path, "frame 3", "ImagePositionPatient")
        run("info", path, "--skip-damaged")

        def too_many(data):
            data.NumberOfFrames = SLICES + 1

        write_enhanced(path, range(SLICES), True, change=too_many)
        self.fails(path, "NumberOfFrames")

        def without_groups(data):
            del data.PerFrameFunctionalGroupsSequence

        write_enhanced(path, range(SLICES), True, change=without_groups)
        self.fails(path, "NumberOfFrames", "functional groups")

        write_enhanced(path, range(SLICES), True)
        path.write_bytes(path.read_bytes()[:-ROWS * COLUMNS * 3])
        self.fails(path, "truncated, 4 of 6 frames are there; copy the file again, or leave damaged slices out by --skip-damaged")
        voxels, _, _ = self.voxels(path, "--skip-damaged")
        self.assertEqual(len(voxels), SLICES - 2)
        said = json.loads(run("info", path, "--skip-damaged", "--json").stdout)
        self.assertEqual(said["all_series"][0]["slices"], SLICES)
        self.assertEqual(said["left_out"], {"damaged": 2, "same_place": 0})
        self.assertEqual(said["size"][2], SLICES - 2)
        text = run("info", path, "--skip-damaged").stdout
        self.assertIn(f"left out of {SLICES} slices: 2 damaged", text)
        self.assertIn("left out 2 frames of ", text)

    # ---- transfer syntaxes --------------------------------------------------------------------------

    def converted(self, *words):
        folder = self.folder / "converted"
        folder.mkdir(exist_ok=True)
        for file in self.series.iterdir():
            tool(*words, file, folder / file.name)
        return folder

    def test_every_transfer_syntax(self):
        for words, syntax in ((("dcmconv", "+ti"), "1.2.840.10008.1.2"),
                              (("dcmconv", "+td"), "1.2.840.10008.1.2.1.99"),
                              (("dcmconv", "+tb"), "1.2.840.10008.1.2.2"),
                              (("dcmcrle",), "1.2.840.10008.1.2.5"),
                              (("dcmcjpls",), "1.2.840.10008.1.2.4.80"),
                              (("dcmcjpeg",), "1.2.840.10008.1.2.4.70"),
                              (("dcmcjpeg", "+el"), "1.2.840.10008.1.2.4.57")):
            with self.subTest(words):
                folder = self.converted(*words)
                self.assertEqual(pydicom.dcmread(folder / "slice0.dcm", stop_before_pixels=True)
                                 .file_meta.TransferSyntaxUID, syntax)
                self.assert_equals_series(folder)

    def test_eight_bits_are_noted(self):
        for file in self.series.iterdir():
            data = pydicom.dcmread(file)
            data.BitsAllocated = data.BitsStored = 8
            data.HighBit, data.RescaleIntercept = 7, 0
            data.PixelData = (numpy.frombuffer(data.PixelData, "<u2") // 16).astype("u1").tobytes()
            data.save_as(file)
        self.assertIn("no Hounsfield units", run("info", self.series).stdout)
        path = self.folder / "scan.nii"
        nibabel.save(nibabel.Nifti1Image(numpy.zeros((3, 4, 5), "u1"), numpy.eye(4)), path)
        self.assertIn("no Hounsfield units", run("info", path).stdout)
        nibabel.save(nibabel.Nifti1Image(numpy.zeros((3, 4, 5), "<i2"), numpy.eye(4)), path)
        self.assertNotIn("no Hounsfield units", run("info", path).stdout)

    def test_near_lossless_stays_within_its_bound(self):
        folder = self.converted("dcmcjpls", "+en", "+md", "2")
        self.assertEqual(pydicom.dcmread(folder / "slice0.dcm", stop_before_pixels=True)
                         .file_meta.TransferSyntaxUID, "1.2.840.10008.1.2.4.81")
        difference = self.voxels(folder)[0].astype(int) - self.voxels(self.series)[0]
        self.assertLessEqual(abs(difference).max(), 2)
        self.assertGreater(abs(difference).max(), 0)

    def test_damaged_data_end_in_one_line(self):
        """Every run ends by itself; where it fails, it says why in one line."""
        for words in (("dcmconv", "+td"), ("dcmconv", "+tb"), ("dcmcrle",), ("dcmcjpls",), ("dcmcjpeg",)):
            folder = self.converted(*words)
            whole = (folder / "slice3.dcm").read_bytes()
            chance = random.Random(5)
            cuts = [whole[:len(whole) * k // 5] for k in range(1, 5)]
            flips = []
            for _ in range(4):
                bad = bytearray(whole)
                for _ in range(20):
                    bad[chance.randrange(len(bad) // 2, len(bad))] ^= 1 << chance.randrange(8)
                flips.append(bytes(bad))
            for k, content in enumerate(cuts + flips):
                with self.subTest((words, k)):
                    (folder / "slice3.dcm").write_bytes(content)
                    done = subprocess.run([PROGRAM, "info", str(folder)], capture_output=True, text=True, timeout=100)
                    self.assertIn(done.returncode, (0, 3), done.stderr)
                    self.assertEqual(len(done.stderr.splitlines()), 0 if done.returncode == 0 else 1, done.stderr)
                    if content in cuts:
                        self.assertEqual(done.returncode, 3)
                        self.assertIn("slice3.dcm", done.stderr)

    def test_dicomdir_opens_its_folder(self):
        media = self.folder / "media"
        media.mkdir()
        for z in range(SLICES):
            (media / f"IM{z}").write_bytes((self.series / f"slice{z}.dcm").read_bytes())
        subprocess.run(["dcmmkdir", "-Pgp", "-W", "-Nxc", *[f"IM{z}" for z in range(SLICES)]], cwd=media,
                       check=True, capture_output=True, timeout=100)
        self.assert_equals_series(media / "DICOMDIR")


if __name__ == "__main__":
    unittest.main()
