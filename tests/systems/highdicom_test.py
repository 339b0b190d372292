"""PROGRAM VENV: a DICOM Segmentation of ours, as highdicom reads it. VENV is a virtual environment that has it."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAM, VENV = sys.argv[1:3]
if pathlib.Path(sys.prefix).resolve() != pathlib.Path(VENV).resolve():
    python = pathlib.Path(VENV) / "bin" / "python"
    if not python.exists():
        sys.exit(f"{VENV}: there is no highdicom; ./dev test-systems installs it")
    os.execv(python, [str(python), *sys.argv])
del sys.argv[1:3]

import highdicom  # noqa: E402
import numpy  # noqa: E402
import pydicom  # noqa: E402


def run(*words):
    return subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True, text=True, timeout=300)


class Highdicom(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        folder = pathlib.Path(cls.temporary.name)
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

    def test_finds_one_segment_of_vessels(self):
        self.assertEqual(self.seg.number_of_segments, 1)
        vessels = self.seg.get_segment_description(1)
        self.assertEqual(vessels.segmented_property_type, highdicom.sr.CodedConcept("91747007", "SCT",
                                                                                     "Lumen of blood vessel"))
        self.assertEqual(vessels.algorithm_type.value, "SEMIAUTOMATIC")


if __name__ == "__main__":
    unittest.main()
