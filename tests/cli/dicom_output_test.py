"""PROGRAM [TEST...]: the DICOM files that the program writes, as pydicom and dciodvfy read them."""
import json
import pathlib
import random
import re
import subprocess
import sys
import tempfile
import unittest

import numpy
import pydicom

PROGRAM = sys.argv.pop(1)
FULL = 4095


def run(*words):
    return subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True, text=True, timeout=100)


def refusal(*words):
    done = subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, timeout=100)
    return done.returncode, done.stderr


def write_nrrd(path, voxels, spacing_mm):
    """int16 HU, axes z, y, x; centred on the origin."""
    origin = [-0.5 * (n - 1) * spacing_mm for n in voxels.shape[::-1]]
    header = ("NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\n"
              f"sizes: {' '.join(map(str, voxels.shape[::-1]))}\nendian: little\nencoding: raw\n"
              f"space directions: ({spacing_mm},0,0) (0,{spacing_mm},0) (0,0,{spacing_mm})\n"
              f"space origin: ({origin[0]},{origin[1]},{origin[2]})\n\n")
    path.write_bytes(header.encode() + voxels.astype("<i2").tobytes())


def read_float_nrrd(path):
    header, _, data = path.read_bytes().partition(b"\n\n")
    width, height = map(int, re.search(rb"sizes: (\d+) (\d+)", header).groups())
    return numpy.frombuffer(data, "<f4").reshape(height, width)


class Pose:
    """A C-arm as the tags say: LPS mm, about the isocentre that the derivation tells."""

    def __init__(self, data):
        a, t = numpy.radians([float(data.PositionerPrimaryAngle), float(data.PositionerSecondaryAngle)])
        self.isocentre = numpy.array([float(v) for v in re.search(
            r"Isocentre in the scan: (\S+) (\S+) (\S+) mm", data.DerivationDescription).groups()])
        self.to_detector = numpy.array([numpy.sin(a) * numpy.cos(t), -numpy.cos(a) * numpy.cos(t), numpy.sin(t)])
        self.right = numpy.array([numpy.cos(a), numpy.sin(a), 0])
        self.down = numpy.cross(self.right, self.to_detector)
        self.source_detector = float(data.DistanceSourceToDetector)
        self.source = self.isocentre - float(data.DistanceSourceToPatient) * self.to_detector

    def on_detector_mm(self, point):
        """From the detector's middle, along rows and columns."""
        ray = point - self.source
        hit = ray * self.source_detector / ray.dot(self.to_detector)
        return numpy.array([hit.dot(self.right), hit.dot(self.down)])


class DicomOutput(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.addClassCleanup(cls.temporary.cleanup)

    def phantom(self):
        scan = self.folder / "scan.nrrd"
        if not scan.exists():
            run("phantom", "thorax", "-o", scan, "--size", "96x96x80")
        return scan

    def map(self):
        body_map = self.folder / "map.exr"
        if not body_map.exists():
            run("cast", self.phantom(), "-o", body_map, "--layers", 4, "--angles", 90)
        return body_map

    def series(self):
        series = self.folder / "thorax"
        if not series.exists():
            run("convert", self.phantom(), "-o", series, "--patient", "Doe^Jane,1")
        return series

    def vessels(self):
        """The phantom's own: mask and tree."""
        truth = self.folder / "truth"
        if not truth.exists():
            run("phantom", "thorax", "-o", self.folder / "again.nrrd", "--size", "96x96x80", "--truth", truth)
        return truth

    def segment(self, scan, folder):
        """From the phantom's mask, which takes no time."""
        return run("segment", scan, "-o", folder, "--from-mask", self.vessels() / "mask.nrrd").stdout

    def expect_valid(self, *files):
        for file in files:
            told = subprocess.run(["dciodvfy", file], capture_output=True, text=True).stderr
            self.assertEqual([line for line in told.splitlines() if line.startswith("Error")], [], file)

    def expect_full_disk(self, largest_kB, file, *words):
        limited = ["bash", "-c", f'ulimit -f {largest_kB}; exec "$@"', "-", PROGRAM, *map(str, words)]
        done = subprocess.run(limited, capture_output=True, text=True, timeout=100)
        self.assertEqual((done.returncode, done.stderr.count("\n")), (1, 1), done.stderr)
        self.assertIn(f"{file}: could not be written completely", done.stderr)

    def test_a_picture_is_whole_or_not_there(self):
        file = self.folder / "whole.dcm"
        file.write_text("an older one")
        before = set(self.folder.iterdir()) | {self.phantom()}
        # What LLVM and PoCL write on the way is smaller.
        self.expect_full_disk(1000, "whole.dcm", "project", self.phantom(), "-o", file, "--size", "1024x768",
                              "--cone", "780,1200")
        self.assertEqual((set(self.folder.iterdir()), file.read_text()), (before, "an older one"))

    def test_a_picture_is_a_valid_xa_in_either_intensity(self):
        view = ("--angle", 30, "--tilt", 10, "--cone", "780,1200", "--size", "96x72")
        tau = self.folder / "tau.nrrd"
        run("project", self.phantom(), "-o", tau, *view)
        # exp and round in double precision on both sides: half a grey, and a float's rounding of tau.
        tolerance = 0.51
        for intensity, expected in (("log", FULL - 256 * read_float_nrrd(tau)),
                                    ("linear", FULL * numpy.exp(-read_float_nrrd(tau)))):
            with self.subTest(intensity):
                file = self.folder / f"{intensity}.dcm"
                run("project", self.phantom(), "-o", file, *view, "--intensity", intensity)
                self.expect_valid(file)
                data = pydicom.dcmread(file)
                self.assertEqual(data.SOPClassUID, "1.2.840.10008.5.1.4.1.1.12.1")
                self.assertEqual(data.PixelIntensityRelationship, {"log": "LOG", "linear": "LIN"}[intensity])
                self.assertEqual((data.PhotometricInterpretation, data.BitsAllocated, data.BitsStored, data.HighBit),
                                 ("MONOCHROME2", 16, 12, 11))
                self.assertLess(numpy.abs(data.pixel_array - numpy.clip(expected, 0, FULL)).max(), tolerance)
                self.assertRegex(data.DerivationDescription, "^Simulated .* not for clinical use")
                self.assertRegex(data.SOPInstanceUID, r"^2\.25\.\d{30,39}$")
                self.assertRegex(data.FrameOfReferenceUID, r"^2\.25\.\d{30,39}$")

    def test_the_lookup_table_leads_from_logarithmic_pixels_to_the_intensity(self):
        from pydicom.pixel_data_handlers import util
        file = self.folder / "table.dcm"
        run("project", self.phantom(), "-o", file, "--size", "96x72")
        data = pydicom.dcmread(file)
        tau = (FULL - data.pixel_array.astype(float)) / 256
        # Rounded to 16 bits.
        self.assertLess(numpy.abs(util.apply_modality_lut(data.pixel_array, data) - 65535 * numpy.exp(-tau)).max(), 0.51)

    def test_fifty_random_poses_are_read_back(self):
        # One dense voxel shows where the rays went; what surrounds it, nothing.
        voxels, spacing_mm = numpy.zeros((41, 41, 41), int), 2
        voxels[25, 13, 29] = 30000
        marker_mm = spacing_mm * (numpy.array([29, 13, 25]) - 20.0)
        scan, opacity = self.folder / "marker.nrrd", self.folder / "marker.json"
        write_nrrd(scan, voxels, spacing_mm)
        opacity.write_text(json.dumps({"name": "marker", "unit": "1/mm", "knots": [[0, 0], [30000, 1]]}))
        random.seed(1)
        for _ in range(50):
            lao, cranial, axis = random.uniform(-180, 180), random.uniform(-89, 89), random.uniform(600, 1000)
            detector = axis + random.uniform(200, 500)
            with self.subTest(lao=lao, cranial=cranial, axis=axis, detector=detector):
                file = self.folder / "pose.dcm"
                run("project", scan, "-o", file, f"--lao={lao}", f"--cranial={cranial}", "--cone", f"{axis},{detector}",
                    "--size", "240x220", "--pixel", 0.6, "--opacity", opacity)
                data = pydicom.dcmread(file)
                self.assertLess(abs(data.PositionerPrimaryAngle - lao), 0.1)
                self.assertLess(abs(data.PositionerSecondaryAngle - cranial), 0.1)
                self.assertLess(abs(data.DistanceSourceToPatient - axis), 0.1)
                self.assertLess(abs(data.DistanceSourceToDetector - detector), 0.1)
                weights = FULL - data.pixel_array.astype(float)
                rows, columns = numpy.indices(weights.shape)
                spacing = [float(mm) for mm in data.ImagerPixelSpacing]
                seen_mm = [((columns - 119.5) * weights).sum() / weights.sum() * spacing[1],
                           ((rows - 109.5) * weights).sum() / weights.sum() * spacing[0]]
                # What the pose is promised to.
                self.assertLess(numpy.abs(Pose(data).on_detector_mm(marker_mm) - seen_mm).max(), 0.1)

    def test_a_cine_is_one_file_with_an_angle_a_frame(self):
        run_file, frame = self.folder / "run.dcm", self.folder / "frame.dcm"
        view = ("--tilt", 5, "--cone", "780,1200", "--size", "64x48")
        run("render", self.map(), "-o", run_file, "--cine=-30:30:12.5", *view)
        self.expect_valid(run_file)
        data = pydicom.dcmread(run_file)
        angles = [-30, -17.5, -5, 7.5, 20]
        self.assertEqual(data.NumberOfFrames, len(angles))
        self.assertEqual(data.FrameIncrementPointer, 0x00181063)
        self.assertEqual(data.FrameTime, 50)
        self.assertEqual(data.PositionerMotion, "DYNAMIC")
        self.assertEqual([data.PositionerPrimaryAngle + step for step in data.PositionerPrimaryAngleIncrement], angles)
        self.assertEqual(list(data.PositionerSecondaryAngleIncrement), [0] * len(angles))
        for angle, picture in zip(angles, data.pixel_array):
            run("render", self.map(), "-o", frame, f"--angle={angle}", *view)
            self.assertTrue((pydicom.dcmread(frame).pixel_array == picture).all(), angle)

    def test_a_whole_turn_goes_on_beyond_half_of_it(self):
        file = self.folder / "turn.dcm"
        run("render", self.map(), "-o", file, "--cine", "0:360:90", "--size", "32x32")
        self.expect_valid(file)
        self.assertEqual(list(pydicom.dcmread(file).PositionerPrimaryAngleIncrement), [0, 90, 180, 270])

    def test_a_cine_that_does_not_fit_is_refused(self):
        file = self.folder / "long.dcm"
        for words, reason in ((("--cine", "0:360:0.1", "--size", "1024x1024"), "one DICOM file holds at most 2047"),
                              (("--cine", "0:360:90", "--inverted"), "--inverted does not apply"),
                              (("--cine", "0:360:90", "--annotations"), "--annotations does not apply")):
            status, told = refusal("render", self.map(), "-o", file, "--cone", "780,1200", *words)
            self.assertEqual((status, told.count("\n")), (3, 1), told)
            self.assertIn(reason, told)
        self.assertFalse(file.exists())

    def test_a_parallel_beam_has_no_distances_and_says_so(self):
        file = self.folder / "parallel.dcm"
        self.assertIn("a parallel beam has no source", run("project", self.phantom(), "-o", file).stderr)
        self.expect_valid(file)
        data = pydicom.dcmread(file)
        self.assertNotIn("DistanceSourceToDetector", data)
        self.assertNotIn("DistanceSourceToPatient", data)
        self.assertEqual(list(data.PatientOrientation), ["L", "F"])

    def test_the_patient_is_nobody_but_for_the_option(self):
        file = self.folder / "patient.dcm"
        run("project", self.phantom(), "-o", file, "--size", "32x32")
        self.assertEqual((pydicom.dcmread(file).PatientName, pydicom.dcmread(file).PatientID), ("", ""))
        run("project", self.phantom(), "-o", file, "--size", "32x32", "--patient", "Škoda^Jan,A 12")
        self.expect_valid(file)
        self.assertEqual((pydicom.dcmread(file).PatientName, pydicom.dcmread(file).PatientID), ("Škoda^Jan", "A 12"))
        for patient in ("Jan", "Jan,", ",12", "a\\b,1", "x" * 65 + ",1"):
            status, told = refusal("project", self.phantom(), "-o", file, "--patient", patient)
            self.assertEqual((status, told.count("\n")), (3, 1), told)
            self.assertIn("patient", told)
            self.assertNotIn("parallel", told)

    def test_a_spectrum_gives_the_tube_voltage(self):
        file = self.folder / "kvp.dcm"
        run("project", self.phantom(), "-o", file, "--size", "32x32", "--opacity", "spectrum:80")
        self.assertEqual(pydicom.dcmread(file).KVP, 80)

    def test_what_does_not_fit_is_refused(self):
        for words, reason in ((("-o", self.folder / "x.dcm", "--tilt", 100), "-90 to 90"),
                              (("-o", self.folder / "x.png", "--patient", "a,b"), "--patient does not apply"),
                              (("-o", self.folder / "x.exr", "--intensity", "log"), "--intensity does not apply"),
                              (("-o", self.folder / "x.dcm", "--gamma", 2), "--gamma does not apply")):
            status, told = refusal("project", self.phantom(), *words)
            self.assertEqual((status, told.count("\n")), (3, 1), told)
            self.assertIn(reason, told)
        self.assertFalse((self.folder / "x.dcm").exists())


    def test_a_run_of_a_catheter_is_one_file_under_a_still_c_arm(self):
        # Pixels about as fine as the catheter, so that no frame loses it between them.
        script, file = self.folder / "push.csv", self.folder / "push.dcm"
        script.write_text("time_s,insertion_mm,rotation_deg\n0,0,0\n1,60,0\n")
        words = ("simulate", self.vessels(), "--device-model", "cobra-5f", "--script", script, "-o",
                 self.folder / "push.log", "--map", self.map(), "--cine", file, "--size", "480x360")
        told = json.loads(run(*words, "--lao", 20, "--cranial", 10, "--cone", "780,1200", "--patient", "Doe^Jane,1",
                              "--json").stdout)
        self.assertEqual(told["frame_of_reference"], "new")
        self.expect_valid(file)
        data = pydicom.dcmread(file)
        # At 0, 0.1 and so on to 1 s; the last step may end a rounding before it.
        self.assertIn(data.NumberOfFrames, (10, 11))
        self.assertEqual(data.FrameTime, 100)
        self.assertEqual((data.PositionerPrimaryAngle, data.PositionerSecondaryAngle), (20, 10))
        self.assertEqual((data.DistanceSourceToPatient, data.DistanceSourceToDetector), (780, 1200))
        self.assertEqual(data.PositionerMotion, "STATIC")
        self.assertNotIn("PositionerPrimaryAngleIncrement", data)
        self.assertEqual(data.PatientName, "Doe^Jane")
        alone = self.folder / "alone.dcm"
        run("render", self.map(), "-o", alone, "--size", "480x360", "--lao", 20, "--cranial", 10, "--cone", "780,1200")
        body = pydicom.dcmread(alone).pixel_array.astype(int)
        first, last = (data.pixel_array[i].astype(int) for i in (0, -1))
        # The catheter absorbs: nothing is lighter than the body alone. Its tip is in the first frame already, and
        # moves sideways, so that frames may be lighter than one another.
        self.assertGreaterEqual((body - data.pixel_array.astype(int)).min(), 0)
        # It darkens its pixels by its share of them, by some 45 of 255 here.
        self.assertGreater((first - last).max(), 30)
        status, told = refusal(*words[:-3], self.folder / "push.gif", "--size", "96x72", "--patient", "Doe^Jane,1")
        self.assertEqual((status, told.count("\n")), (3, 1), told)
        self.assertIn("--patient does not apply", told)

    def test_a_gated_run_has_the_times_of_its_frames_and_the_r_waves(self):
        folder, script = self.folder, self.folder / "slow.csv"
        run("phantom", "thorax", "-o", folder / "rest.nrrd", "--size", "48x48x60", "--truth", folder / "rest", "--motion", folder / "motion")
        run("cast", folder / "rest.nrrd", "-o", folder / "moving.exr", "--layers", 2, "--angles", 60, "--motion", folder / "motion/motion.json",
            "--keys", "breath=2", "--keys", "heart=4")
        script.write_text("time_s,insertion_mm,rotation_deg\n0,0,0\n3,30,0\n")
        words = ("simulate", folder / "rest", "--device-model", "cobra-5f", "--script", script, "-o", folder / "slow.log", "--map",
                 folder / "moving.exr", "--motion", folder / "motion/motion.json", "--size", "64x48")
        beat_ms = 60000 / 70  # the phantom's
        gated, free = folder / "gated.dcm", folder / "free.dcm"
        run(*words, "--cine", gated, "--gate", "heart=0.75")
        run(*words, "--cine", free)
        self.expect_valid(gated, free)
        data = pydicom.dcmread(gated)
        self.assertEqual(data.NumberOfFrames, 3, "at three quarters of the first beat, and of the two after")
        self.assertEqual(data.FrameIncrementPointer, 0x00181065)
        self.assertNotIn("FrameTime", data)
        times = [float(step) for step in data.FrameTimeVector]
        self.assertEqual(times[0], 0)
        for step in times[1:]:
            self.assertAlmostEqual(step, beat_ms, delta=1.01)  # a step of the run
        self.assertEqual(data.ScanOptions, "EKG")
        self.assertEqual(data[0x0028, 0x6040].value, [2, 3], "the R wave at 0 s is before the first frame")
        data = pydicom.dcmread(free)
        self.assertEqual((data.FrameIncrementPointer, data.FrameTime), (0x00181063, 100))
        self.assertNotIn("FrameTimeVector", data)
        self.assertNotIn("ScanOptions", data)
        # R waves at 0.857, 1.714 and 2.571 s: in the frames at 0.9, 1.8 and 2.6 s, of which the first is at 0.
        self.assertEqual(data[0x0028, 0x6040].value, [10, 19, 27])

    def test_the_frame_of_reference_is_the_scans_where_it_is_known(self):
        scans = pydicom.dcmread(next(self.series().iterdir())).FrameOfReferenceUID
        body_map, recast, file = (self.folder / name for name in ("dicom.exr", "recast.exr", "framed.dcm"))
        basis, opacity = self.folder / "dicom.basis", self.folder / "bone.json"
        opacity.write_text(json.dumps({"name": "bone", "unit": "1/mm", "knots": [[-1000, 0], [0, 0], [1000, 0.06]]}))
        run("cast", self.series(), "-o", body_map, "--layers", 4, "--angles", 90, "--keep-basis", basis,
            "--opacity", opacity)
        run("recast", basis, "-o", recast, "--opacity", opacity)
        other = ("--patient", "Doe^Jane,1")
        for words, expected in ((("project", self.series()), "scan"), (("render", body_map), "scan"),
                                (("render", recast), "scan"), (("project", self.phantom()), "new"),
                                (("render", self.map()), "new"),
                                # Another patient does not lie in the same frame.
                                (("project", self.series(), *other), "new"), (("render", body_map, *other), "new")):
            with self.subTest(words=words):
                told = json.loads(run(*words, "-o", file, "--size", "32x32", "--json").stdout)
                data = pydicom.dcmread(file)
                self.assertEqual(told["frame_of_reference"], expected)
                self.assertEqual(data.FrameOfReferenceUID == scans, expected == "scan")
                self.assertIn({"scan": "is the scan's.", "new": "is new, since the " +
                               ("patient was given" if other[0] in words else "scan's is unknown")}[expected], data.DerivationDescription)

    def test_a_mask_is_a_valid_segmentation_of_its_series(self):
        series, folder = self.folder / "whose", self.folder / "whose vessels"
        run("convert", self.phantom(), "-o", series)
        for file in series.iterdir():
            data = pydicom.dcmread(file)
            data.SpecificCharacterSet = "ISO_IR 100"
            data.PatientName, data.PatientID, data.PatientBirthDate, data.PatientSex = "Groß^Jörg", "7", "19500102", "M"
            data.AccessionNumber, data.StudyID, data.StudyDate = "A77", "S1", "20200304"
            data.save_as(file)
        self.assertNotIn("no mask.seg.dcm", self.segment(series, folder))
        file = folder / "mask.seg.dcm"
        self.expect_valid(file)
        seg, slices = pydicom.dcmread(file), self.read_series(series)[1]
        mask = numpy.frombuffer((folder / "mask.nrrd").read_bytes().partition(b"\n\n")[2], "u1").reshape(80, 96, 96)
        self.assertGreater(mask.sum(), 0)
        self.assertTrue((seg.pixel_array == mask).all())
        self.assertEqual((seg.SOPClassUID, seg.SegmentationType), ("1.2.840.10008.5.1.4.1.1.66.4", "BINARY"))
        for same in ("StudyInstanceUID", "FrameOfReferenceUID", "PatientName", "PatientID", "PatientBirthDate",
                     "PatientSex", "AccessionNumber", "StudyID", "StudyDate", "StudyTime"):
            self.assertEqual(seg[same].value, slices[0][same].value, same)
        self.assertEqual(str(seg.PatientName), "Groß^Jörg")
        self.assertNotEqual(seg.SeriesInstanceUID, slices[0].SeriesInstanceUID)
        self.assertEqual(seg.ReferencedSeriesSequence[0].SeriesInstanceUID, slices[0].SeriesInstanceUID)
        self.assertEqual([s.ReferencedSOPInstanceUID for s in seg.ReferencedSeriesSequence[0].ReferencedInstanceSequence],
                         [s.SOPInstanceUID for s in slices])
        shared = seg.SharedFunctionalGroupsSequence[0]
        self.assertEqual(shared.PixelMeasuresSequence[0].PixelSpacing, slices[0].PixelSpacing)
        self.assertEqual(shared.PlaneOrientationSequence[0].ImageOrientationPatient, slices[0].ImageOrientationPatient)
        for number, (frame, source) in enumerate(zip(seg.PerFrameFunctionalGroupsSequence, slices, strict=True), 1):
            self.assertEqual(frame.PlanePositionSequence[0].ImagePositionPatient, source.ImagePositionPatient)
            self.assertEqual(frame.DerivationImageSequence[0].SourceImageSequence[0].ReferencedSOPInstanceUID,
                             source.SOPInstanceUID)
            self.assertEqual(frame.FrameContentSequence[0].DimensionIndexValues, [1, number])

    def test_a_mask_on_another_grid_is_no_segmentation_and_the_reason_is_told(self):
        folder, prone = self.folder / "some vessels", self.folder / "prone"
        run("convert", self.phantom(), "-o", prone)
        for file in prone.iterdir():
            data = pydicom.dcmread(file)
            data.ImageOrientationPatient = [-1, 0, 0, 0, -1, 0]
            data.ImagePositionPatient = [-data.ImagePositionPatient[0], -data.ImagePositionPatient[1],
                                         data.ImagePositionPatient[2]]
            data.save_as(file)
        self.segment(self.series(), folder)
        self.assertTrue((folder / "mask.seg.dcm").exists())
        # The file of the earlier run would belong to another scan.
        self.assertIn("no mask.seg.dcm: the slices were resampled or reoriented", self.segment(prone, folder))
        self.assertFalse((folder / "mask.seg.dcm").exists())
        self.assertTrue((folder / "mask.nrrd").exists())
        self.assertIn("no mask.seg.dcm: the scan is NRRD", self.segment(self.phantom(), folder))

    def test_a_mask_of_slices_that_share_no_frame_of_reference_has_its_own(self):
        series, folder = self.folder / "apart", self.folder / "apart vessels"
        run("convert", self.phantom(), "-o", series)
        scans = set()
        for file in series.iterdir():
            data = pydicom.dcmread(file)
            data.FrameOfReferenceUID = pydicom.uid.generate_uid()
            scans.add(data.FrameOfReferenceUID)
            data.save_as(file)
        self.assertIn("mask.seg.dcm: has its own frame of reference", self.segment(series, folder))
        self.expect_valid(folder / "mask.seg.dcm")
        self.assertNotIn(pydicom.dcmread(folder / "mask.seg.dcm").FrameOfReferenceUID, scans)

    def read_series(self, folder):
        """HU, axes z, y, x, from the most inferior slice; and its slices."""
        slices = sorted((pydicom.dcmread(f) for f in folder.iterdir()), key=lambda d: d.ImagePositionPatient[2])
        return numpy.stack([d.pixel_array * float(d.RescaleSlope) + float(d.RescaleIntercept) for d in slices]), slices

    def test_a_scan_becomes_a_series_and_comes_back_as_it_was(self):
        voxels = numpy.random.default_rng(1).integers(-1024, 32768, (5, 7, 6))
        scan, series, back = self.folder / "noise.nrrd", self.folder / "noise series", self.folder / "back.nrrd"
        # A third has no end in decimal strings.
        write_nrrd(scan, voxels, 1 / 3)
        run("convert", scan, "-o", series, "--patient", "Doe^Jane,1")
        self.expect_valid(*series.iterdir())
        hu, slices = self.read_series(series)
        self.assertTrue((hu == voxels).all())
        # 16 bytes of decimals.
        self.assertLess(abs(slices[0].ImagePositionPatient[0] + 2.5 / 3), 1e-12)
        self.assertLess(abs(slices[4].ImagePositionPatient[2] - 2 / 3), 1e-12)
        self.assertLess(abs(slices[0].PixelSpacing[1] - 1 / 3), 1e-12)
        self.assertEqual(list(slices[0].ImageOrientationPatient), [1, 0, 0, 0, 1, 0])
        for shared in ("SeriesInstanceUID", "StudyInstanceUID", "FrameOfReferenceUID", "PatientName"):
            self.assertEqual(len({str(d[shared].value) for d in slices}), 1, shared)
        self.assertEqual(len({d.SOPInstanceUID for d in slices}), 5)
        self.assertEqual(slices[0].PatientName, "Doe^Jane")
        told = run("convert", series, "-o", back).stderr
        self.assertEqual(told, "")
        self.assertEqual(back.read_bytes().partition(b"\n\n")[2], voxels.astype("<i2").tobytes())

    def test_a_series_of_a_series_keeps_its_frame_of_reference(self):
        source, scans = self.read_series(self.series())[1], pydicom.uid.generate_uid()
        folder, turned, apart = (self.folder / name for name in ("kept frame", "turned frame", "no frame"))
        # Slices that lie the other way round are reoriented, in the same frame.
        for copy, frame_of in ((turned, lambda: scans), (apart, pydicom.uid.generate_uid)):
            copy.mkdir()
            for data in source:
                data.FrameOfReferenceUID, data.ImageOrientationPatient = frame_of(), [-1, 0, 0, 0, -1, 0]
                data.save_as(copy / pathlib.Path(data.filename).name)
        for scan, kept in ((self.series(), None), (turned, scans), (apart, "")):
            with self.subTest(scan=scan):
                target = folder / scan.name
                folder.mkdir(exist_ok=True)
                told = json.loads(run("convert", scan, "-o", target, "--json").stdout)
                frames = {data.FrameOfReferenceUID for data in self.read_series(target)[1]}
                self.expect_valid(*target.iterdir())
                before = {data.FrameOfReferenceUID for data in self.read_series(scan)[1]}
                self.assertEqual(len(frames), 1)
                self.assertEqual(frames <= before, kept != "")
                self.assertEqual(told["frame_of_reference"], "scan" if kept != "" else "new")
        # Another patient does not lie in the same frame.
        named = self.folder / "named"
        told = json.loads(run("convert", self.series(), "-o", named, "--patient", "Doe^Jane,1", "--json").stdout)
        self.assertEqual(told["frame_of_reference"], "new")
        self.assertTrue({data.FrameOfReferenceUID for data in source}.isdisjoint(
            data.FrameOfReferenceUID for data in self.read_series(named)[1]))
        study = {data.StudyInstanceUID for data in source}
        self.assertTrue(study.isdisjoint(data.StudyInstanceUID for data in self.read_series(folder / "thorax")[1]))

    def test_a_scan_is_converted_to_every_format_and_back(self):
        expected = None
        for name in ("phantom", "a.nii", "a.nii.gz", "a.nrrd", "a.mha", "a.mhd"):
            run("convert", self.phantom(), "-o", self.folder / name)
            run("convert", self.folder / name, "-o", self.folder / "again.nrrd")
            voxels = (self.folder / "again.nrrd").read_bytes().partition(b"\n\n")[2]
            expected = expected or self.phantom().read_bytes().partition(b"\n\n")[2]
            self.assertEqual(voxels, expected, name)

    def test_a_series_is_written_whole_or_not_at_all(self):
        series = self.folder / "series"
        before = set(self.folder.iterdir()) | {self.phantom()}
        self.expect_full_disk(10, "series/slice-0001.dcm", "convert", self.phantom(), "-o", series)
        self.assertEqual(set(self.folder.iterdir()), before)
        # What a dead process left goes with the next run; an empty folder is filled, any other left alone.
        left = self.folder / ".series.0123456789abcdef.part"
        left.mkdir()
        (left / "slice-0001.dcm").touch()
        series.mkdir()
        run("convert", self.phantom(), "-o", f"{series}/")
        self.assertEqual(set(self.folder.iterdir()), before | {series})
        self.assertEqual(len(list(series.iterdir())), 80)
        status, told = refusal("convert", self.phantom(), "-o", series)
        self.assertEqual((status, told.count("\n")), (3, 1), told)
        self.assertIn("is not an empty folder", told)

    def test_a_conversion_that_cannot_be_is_refused(self):
        for words, reason in ((("-o", self.folder / "x.stl"), "unknown volume format"),
                              (("-o", self.folder / "x.nrrd", "--patient", "a,b"), "--patient does not apply"),
                              (("-o", self.folder / "x", "--patient", "a"), "NAME,ID"),
                              (("-o", self.folder / "none" / "x"), "the output folder does not exist")):
            status, told = refusal("convert", self.phantom(), *words)
            self.assertEqual((status, told.count("\n")), (3, 1), told)
            self.assertIn(reason, told)


if __name__ == "__main__":
    unittest.main()
