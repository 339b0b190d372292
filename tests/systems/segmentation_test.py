"""PROGRAM VENV: a DICOM Segmentation of ours, as highdicom reads it. VENV is a virtual environment that has it. Exits with
77 without one."""
import json
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

    def segmentation_of(self, masks, kind):
        """A DICOM Segmentation as highdicom writes it, which leaves out frames without voxels."""
        codes = highdicom.sr.CodedConcept("91747007", "SCT", "Lumen of blood vessel")
        segments = [highdicom.seg.SegmentDescription(
            segment_number=number, segment_label=label, segmented_property_category=codes, segmented_property_type=codes,
            algorithm_type=highdicom.seg.SegmentAlgorithmTypeValues.MANUAL)
            for number, label in enumerate(masks, start=1)]
        pixels = numpy.stack(list(masks.values()), axis=-1)
        if kind == "LABELMAP":
            pixels = (pixels * numpy.arange(1, len(masks) + 1)).max(axis=-1)
        seg = highdicom.seg.Segmentation(
            source_images=self.slices, pixel_array=pixels.astype(float if kind == "FRACTIONAL" else numpy.uint8),
            segmentation_type=kind, segment_descriptions=segments, series_instance_uid=highdicom.UID(), series_number=7,
            sop_instance_uid=highdicom.UID(), instance_number=1, manufacturer="none", manufacturer_model_name="none",
            software_versions="1", device_serial_number="1", omit_empty_frames=True)
        path = self.folder / f"{kind}.dcm"
        seg.save_as(path)
        return path

    def mask_of(self, folder):
        return numpy.frombuffer((folder / "mask.nrrd").read_bytes().partition(b"\n\n")[2], numpy.uint8).reshape(self.mask.shape)

    def test_segments_of_others_are_vessels(self):
        above = numpy.zeros_like(self.mask)
        above[40:] = self.mask[40:]
        masks = {"aorta_and_arch": above, "below": self.mask - above}
        for kind in ("BINARY", "FRACTIONAL", "LABELMAP"):
            with self.subTest(kind):
                seg, folder = self.segmentation_of(masks, kind), self.folder / kind
                self.assertLess(pydicom.dcmread(seg).NumberOfFrames, 2 * len(self.slices), "frames are left out")
                run("vessels", seg, "-o", folder, "--like", self.folder / "series")
                # The largest component alone: all but what the phantom's mask has apart.
                kept = self.mask_of(folder)
                self.assertTrue((kept <= self.mask).all())
                self.assertGreater(kept.sum(), 0.98 * self.mask.sum())
                names = {entry["name"] for entry in json.loads((folder / "names.json").read_text())["names"]}
                self.assertEqual(names, {"aorta and arch", "below"})
                run("vessels", seg, "-o", folder, "--like", self.folder / "series", "--label", "2")
                self.assertEqual(self.mask_of(folder)[40:].sum(), 0)
        told = subprocess.run([PROGRAM, "vessels", seg, "-o", folder, "--label", "spleen"], capture_output=True, text=True)
        self.assertIn("--label spleen: there is no such segment; the file has 1 (aorta_and_arch), 2 (below)", told.stderr)

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
