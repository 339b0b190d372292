"""PROGRAM: our DICOM files on their way through an archive. Sends them with dcmtk's storescu to an Orthanc of the test's
own, on 127.0.0.1, and compares what its REST interface gives back."""
import io
import json
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request

import numpy
import pydicom

PROGRAM = sys.argv.pop(1)


def tool(name):
    found = shutil.which(name) or shutil.which(name, path="/usr/sbin")
    if not found:
        sys.exit(f"{name} is not installed; install the packages under [systems] in packages.txt, as ./dev test-systems does")
    return found


ORTHANC, STORESCU = tool("Orthanc"), tool("storescu")


def run(*words):
    return subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True, text=True, timeout=300)


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for s in sockets:
        s.bind(("127.0.0.1", 0))
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


class Archive:
    """An Orthanc that stores into a folder, takes connections of this machine alone, and ends with the test."""

    def __init__(self, folder):
        self.http, self.dicom = free_ports(2)
        settings = folder / "orthanc.json"
        settings.write_text(json.dumps({
            "StorageDirectory": str(folder / "storage"), "IndexDirectory": str(folder / "storage"), "Plugins": [],
            "HttpPort": self.http, "RemoteAccessAllowed": False, "AuthenticationEnabled": False,
            "DicomPort": self.dicom, "DicomCheckModalityHost": True, "DicomAlwaysAllowStore": False,
            "DicomModalities": {"test": ["STORESCU", "127.0.0.1", 104]}}))
        self.log = open(folder / "orthanc.log", "w+")
        self.process = subprocess.Popen([ORTHANC, settings], stdout=self.log, stderr=self.log)
        for _ in range(300):
            if self.answers():
                return
            time.sleep(0.2)
        self.end()
        raise AssertionError("Orthanc did not start within a minute")

    def answers(self):
        if self.process.poll() is not None:
            self.log.seek(0)
            raise AssertionError(f"Orthanc ended at once: {self.log.read()[-500:]}")
        try:
            self.get("system")
            return True
        except OSError:
            return False

    def end(self):
        self.process.terminate()
        try:
            self.process.wait(60)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.log.close()

    def get(self, path, accept="*/*", data=None):
        request = urllib.request.Request(f"http://127.0.0.1:{self.http}/{path}", data, {"Accept": accept})
        with urllib.request.urlopen(request, timeout=60) as answer:
            return answer.read()

    def store(self, *files):
        done = subprocess.run([STORESCU, "-R", "127.0.0.1", str(self.dicom), *map(str, files)], capture_output=True,
                              text=True, timeout=300)
        assert done.returncode == 0, done.stderr

    def instance(self, uid):
        found = [f["ID"] for f in json.loads(self.get("tools/lookup", data=uid.encode())) if f["Type"] == "Instance"]
        assert len(found) == 1, found
        return f"instances/{found[0]}"

    def dataset(self, uid):
        return pydicom.dcmread(io.BytesIO(self.get(self.instance(uid) + "/file")))

    def pixels(self, uid, frame, kind):
        """`kind`: rendered, image-uint8, image-uint16, or image-int16."""
        pam = self.get(f"{self.instance(uid)}/frames/{frame}/{kind}", "image/x-portable-arbitrarymap")
        header, _, data = pam.partition(b"ENDHDR\n")
        fields = dict(line.split() for line in header.decode().splitlines()[1:])
        word = ">u1" if int(fields["MAXVAL"]) < 256 else ">i2" if kind == "image-int16" else ">u2"
        return numpy.frombuffer(data, word).reshape(int(fields["HEIGHT"]), int(fields["WIDTH"])).astype(int)


def windowed(data, pixels):
    """Greys under the file's own window, as Orthanc takes it: from edge to edge (PS3.3, C.11.2.1.3.2)."""
    return 255 * numpy.clip((pixels - float(data.WindowCenter)) / float(data.WindowWidth) + 0.5, 0, 1)


class Orthanc(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.folder = pathlib.Path(cls.temporary.name)
        scan, truth = cls.folder / "scan.nrrd", cls.folder / "truth"
        run("phantom", "thorax", "-o", scan, "--size", "96x96x80", "--truth", truth)
        run("convert", scan, "-o", cls.folder / "series", "--patient", "Müller^Jörg,12")
        cls.archive = Archive(cls.folder)
        cls.addClassCleanup(cls.archive.end)

    def expect_kept(self, file):
        """The archive gives each element back as it was, and each byte of the pixels."""
        self.archive.store(file)
        sent = pydicom.dcmread(file)
        kept = self.archive.dataset(sent.SOPInstanceUID)
        self.assertEqual(kept, sent)
        self.assertEqual(kept.PixelData, sent.PixelData)
        return sent

    def test_a_picture_is_kept_and_shown_as_it_is(self):
        file = self.folder / "picture.dcm"
        run("project", self.folder / "series", "-o", file, "--angle", 30, "--cone", "780,1200", "--size", "96x72")
        sent = self.expect_kept(file)
        shown = self.archive.pixels(sent.SOPInstanceUID, 0, "image-uint16")
        self.assertTrue((shown == sent.pixel_array).all())
        # A viewer may round or cut off.
        rendered = self.archive.pixels(sent.SOPInstanceUID, 0, "rendered")
        self.assertLessEqual(numpy.abs(rendered - windowed(sent, sent.pixel_array)).max(), 1)

    def test_a_cine_is_kept_frame_by_frame(self):
        body_map, file = self.folder / "map.exr", self.folder / "run.dcm"
        run("cast", self.folder / "series", "-o", body_map, "--layers", 4, "--angles", 90)
        run("render", body_map, "-o", file, "--cine=-30:30:12.5", "--cone", "780,1200", "--size", "64x48")
        sent = self.expect_kept(file)
        for frame, picture in enumerate(sent.pixel_array):
            with self.subTest(frame):
                shown = self.archive.pixels(sent.SOPInstanceUID, frame, "image-uint16")
                self.assertTrue((shown == picture).all())

    def test_a_series_and_its_segmentation_lie_in_one_study(self):
        run("segment", self.folder / "series", "--from-mask", self.folder / "truth" / "mask.nrrd", "-o",
            self.folder / "vessels")
        seg = self.expect_kept(self.folder / "vessels" / "mask.seg.dcm")
        slices = [self.expect_kept(file) for file in sorted((self.folder / "series").iterdir())]
        for data in slices:
            shown = self.archive.pixels(data.SOPInstanceUID, 0, "image-int16")
            self.assertTrue((shown == data.pixel_array).all())
        parents = {self.archive.get(self.archive.instance(uid) + "/study")
                   for uid in (seg.SOPInstanceUID, slices[0].SOPInstanceUID)}
        self.assertEqual(len(parents), 1)
        self.assertIn("Müller^Jörg", json.loads(parents.pop())["PatientMainDicomTags"]["PatientName"])


if __name__ == "__main__":
    unittest.main()
