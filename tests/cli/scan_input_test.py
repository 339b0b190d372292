"""PROGRAM [TEST...]: scans that other programs wrote, dcmtk and pydicom among them, as the program reads them."""
import json
import pathlib
import random
import subprocess
import sys
import tempfile
import unittest
import zipfile

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

    # ---- the series itself ------------------------------------------------------------------------

    def test_series_is_what_was_written(self):
        voxels, _, _ = self.voxels(self.series)
        for z in range(SLICES):
            numpy.testing.assert_array_equal(voxels[z], stored_pixels(z).astype(int) - 1024)

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
        self.assertIn("6 slices dropped", run("info", path).stdout)

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
        self.fails(path, "frame 5", "truncated")
        voxels, _, _ = self.voxels(path, "--skip-damaged")
        self.assertEqual(len(voxels), SLICES - 2)

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
