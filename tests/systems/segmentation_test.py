"""PROGRAM VENV: a DICOM Segmentation of ours, as highdicom reads it. VENV is a virtual environment that has it. Exits with
77 without one."""
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import unittest

PROGRAM, VENV = sys.argv[1:3]
if pathlib.Path(sys.prefix).resolve() != pathlib.Path(VENV).resolve():
    python = pathlib.Path(VENV) / "bin" / "python"
    if not python.exists() or subprocess.run([python, "-c", "import highdicom"], capture_output=True).returncode != 0:
        print(f"skipped: {VENV} has no highdicom; run ./dev test-systems")
        sys.exit(77)
    os.execv(python, [str(python), *sys.argv])
del sys.argv[1:3]

import highdicom  # noqa: E402
import numpy  # noqa: E402
import pydicom  # noqa: E402


def run(*words):
    return subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True, text=True, timeout=300)


class Segmentation(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.folder = folder = pathlib.Path(cls.temporary.name)
        # 91 x 91 x 67 bits end within a byte, and in an odd one.
        run("phantom", "thorax", "-o", folder / "scan.nrrd", "--size", "91x91x67", "--truth", folder / "truth")
        run("convert", folder / "scan.nrrd", "-o", folder / "series", "--patient", "Doe^Jane,1")
        run("segment", folder / "series", "--from-mask", folder / "truth" / "mask.nrrd", "-o", folder / "vessels")
        data = (folder / "vessels" / "mask.nrrd").read_bytes().partition(b"\n\n")[2]
        cls.mask = numpy.frombuffer(data, numpy.uint8).reshape(67, 91, 91)
        cls.slices = sorted((pydicom.dcmread(f) for f in (folder / "series").iterdir()),
                            key=lambda slice: slice.ImagePositionPatient[2])
        cls.seg = highdicom.seg.segread(folder / "vessels" / "mask.seg.dcm")

    def test_finds_the_mask_by_the_slices_that_it_was_made_of(self):
        pixels = self.seg.get_pixels_by_source_instance([s.SOPInstanceUID for s in self.slices], segment_numbers=[1])
        self.assertGreater(self.mask.sum(), 1000)
        self.assertTrue((pixels[..., 0] == self.mask).all())

    def test_finds_the_mask_on_the_grid_of_the_series(self):
        scan = highdicom.get_volume_from_series(self.slices)
        volume = self.seg.get_volume(segment_numbers=[1])
        # Sixteen characters of decimals.
        self.assertLess(numpy.abs(volume.affine - scan.affine).max(), 1e-9)
        self.assertEqual(volume.frame_of_reference_uid, self.slices[0].FrameOfReferenceUID)
        # highdicom orders slices from the head down.
        self.assertTrue((volume.array[::-1, ..., 0] == self.mask).all())

    def test_finds_the_mask_by_the_frames_of_one_file(self):
        for data in self.slices:
            data.StudyDate, data.StudyTime, data.StudyID, data.AccessionNumber = "20260101", "120000", "1", ""
        shuffled = list(self.slices)
        random.Random(4).shuffle(shuffled)
        enhanced = highdicom.legacy.LegacyConvertedEnhancedCTImage(
            shuffled, series_instance_uid=highdicom.UID(), series_number=2, sop_instance_uid=highdicom.UID(),
            instance_number=1)
        enhanced.save_as(self.folder / "enhanced.dcm")
        run("segment", self.folder / "enhanced.dcm", "--from-mask", self.folder / "truth" / "mask.nrrd", "-o",
            self.folder / "of frames")
        seg = highdicom.seg.segread(self.folder / "of frames" / "mask.seg.dcm")
        heights = [g.PlanePositionSequence[0].ImagePositionPatient[2] for g in enhanced.PerFrameFunctionalGroupsSequence]
        numbers = [1 + i for i in numpy.argsort([float(h) for h in heights])]
        pixels = seg.get_pixels_by_source_frame(enhanced.SOPInstanceUID, numbers, segment_numbers=[1])
        self.assertTrue((pixels[..., 0] == self.mask).all())
        self.assertEqual(len(seg.ReferencedSeriesSequence[0].ReferencedInstanceSequence), 1)

    def test_finds_one_segment_of_vessels(self):
        self.assertEqual(self.seg.number_of_segments, 1)
        vessels = self.seg.get_segment_description(1)
        self.assertEqual(vessels.segmented_property_type, highdicom.sr.CodedConcept("91747007", "SCT",
                                                                                     "Lumen of blood vessel"))
        self.assertEqual(vessels.algorithm_type.value, "SEMIAUTOMATIC")


if __name__ == "__main__":
    unittest.main()
