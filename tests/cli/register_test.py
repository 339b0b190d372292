"""PROGRAM [TEST...]: `register` on files: X-rays and cameras in their formats, starts, films, and what is refused."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy
import pydicom
import pydicom.uid

PROGRAM = sys.argv.pop(1)
ANGLES, SIZE = (20, 5), 128
MIDDLE = numpy.zeros(3)  # of the phantom, mm


def call(*words):
    return subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, timeout=200)


def run(*words):
    done = call(*words)
    if done.returncode != 0:
        raise AssertionError(f"{words}: {done.stderr}")
    return done


def write_pgm(path, picture, depth=255):
    path.write_bytes(f"P5\n{picture.shape[1]} {picture.shape[0]}\n{depth}\n".encode() + picture.astype("u1").tobytes())


def yaml_matrix(name, rows):
    data = ", ".join(repr(float(number)) for row in rows for number in row)
    return f"{name}: !!opencv-matrix\n   rows: {len(rows)}\n   cols: {len(rows[0])}\n   dt: d\n   data: [ {data} ]\n"


class Register(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        path = pathlib.Path(cls.folder.name)
        cls.scan, cls.xray, cls.pgm = path / "ct.nrrd", path / "x.dcm", path / "x.pgm"
        run("phantom", "thorax", "-o", cls.scan, "--spacing", 5)
        run("project", cls.scan, "-o", cls.xray, "--angle", ANGLES[0], "--tilt", ANGLES[1], "--cone", "785,1200",
            "--size", f"{SIZE}x{SIZE}", "--pixel", 3)
        pixels = pydicom.dcmread(cls.xray).pixel_array.astype(float)
        write_pgm(cls.pgm, 255 * (pixels - pixels.min()) / (pixels.max() - pixels.min()))
        run("register", cls.scan, cls.xray, "-o", path / "truth.json", "--search", "0,0")
        cls.truth = json.loads((path / "truth.json").read_text())["poses"][0]

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def setUp(self):
        self.own = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.own.name)

    def tearDown(self):
        self.own.cleanup()

    def pose(self, *words, xray=None, search="4,8"):
        out = self.path / "pose.json"
        run("register", self.scan, xray or self.xray, "-o", out, "--search", search, *words)
        found = json.loads(out.read_text())
        self.assertTrue(found["converged"])
        return found

    def expect_truth(self, found, mm=0.5):
        """A tenth of a voxel, and twice that along the ray, where the depth is hardly seen; 8-bit greys take some."""
        rt, wanted = (numpy.array(pose["RT"]) for pose in (found["poses"][0], self.truth))
        points = 100 * (2.0 * numpy.indices((2, 2, 2)).reshape(3, 8).T - 1) + MIDDLE
        difference = points @ (rt - wanted)[:, :3].T + (rt - wanted)[:, 3]
        self.assertLess(numpy.hypot(difference[:, 0], difference[:, 1]).mean(), mm)
        self.assertLess(abs(difference[:, 2]).mean(), 6 * mm)

    def camera(self, **changes):
        return json.dumps({"K": self.truth["K"], "RT": self.truth["RT"], **changes})

    def test_dicom_says_where_to_start(self):
        found = self.pose()
        self.assertAlmostEqual(found["poses"][0]["lao_deg"], ANGLES[0], delta=0.1)
        self.assertAlmostEqual(found["poses"][0]["cranial_deg"], ANGLES[1], delta=0.1)
        self.assertGreater(found["poses"][0]["similarity"], 0.9)

    def test_compressed_x_rays_are_those_they_were(self):
        plain = self.pose()
        packed = self.path / "packed.dcm"
        for command in (["dcmcrle"], ["dcmcjpls"], ["dcmcjpeg"], ["dcmconv", "+td"], ["dcmconv", "+tb"]):
            with self.subTest(command):
                subprocess.run([*command, str(self.xray), str(packed)], check=True, capture_output=True)
                self.assertNotEqual(pydicom.dcmread(packed).file_meta.TransferSyntaxUID, pydicom.uid.ExplicitVRLittleEndian)
                self.assertEqual(self.pose(xray=packed)["poses"][0]["RT"], plain["poses"][0]["RT"])

    def test_signed_and_8_bit_x_rays(self):
        plain = self.pose()["poses"][0]
        data = pydicom.dcmread(self.xray)
        values = data.pixel_array.astype(int)
        data.PixelData, data.PixelRepresentation = (values - values.max() // 2).astype("<i2").tobytes(), 1
        data.save_as(self.path / "signed.dcm")
        self.assertEqual(self.pose(xray=self.path / "signed.dcm")["poses"][0]["RT"], plain["RT"])
        data.PixelData, data.PixelRepresentation = (values * 255 // values.max()).astype("u1").tobytes(), 0
        data.BitsAllocated = data.BitsStored = 8
        data.HighBit = 7
        data["PixelData"].VR = "OB"
        data.save_as(self.path / "8.dcm")
        self.expect_truth(self.pose(xray=self.path / "8.dcm"))

    def test_cameras_of_json_opencv_and_autoscoper(self):
        k, rt = numpy.array(self.truth["K"]), numpy.array(self.truth["RT"])
        # Seen from the source, as OpenCV's and Autoscoper's cameras see it: the focal length is positive.
        k = [[-k[0, 0], 0, SIZE - 1 - k[0, 2]], k[1].tolist(), [0, 0, 1]]
        flipped = numpy.fromfile(self.pgm, "u1")[-SIZE * SIZE:].reshape(SIZE, SIZE)[:, ::-1]
        write_pgm(self.path / "flipped.pgm", flipped)
        r, t = rt[:, :3].tolist(), rt[:, 3:].tolist()
        numbers = lambda rows: "\n".join(",".join(map(repr, map(float, row))) for row in rows)  # noqa: E731
        cameras = {
            "c.json": json.dumps({"K": k, "RT": rt.tolist()}),
            "c.yml": "%YAML:1.0\n---\n" + f"image_width: {SIZE}\nimage_height: {SIZE}\n" + yaml_matrix("camera_matrix", k) +
                     yaml_matrix("distortion_coefficients", [[0.0]] * 5) + yaml_matrix("R", r) + yaml_matrix("T", t),
            "rt.yaml": "%YAML:1.0\n---\n" + yaml_matrix("K", k) + yaml_matrix("RT", rt.tolist()),
            "c.txt": f"image size\n{SIZE},{SIZE}\n\ncamera matrix\n{numbers(k)}\n\nrotation\n{numbers(r)}\n\n"
                     f"translation\n{numbers(t)}\n"}
        for name, text in cameras.items():
            with self.subTest(name):
                (self.path / name).write_text(text)
                self.expect_truth(self.pose("--camera", self.path / name, xray=self.path / "flipped.pgm"))

    def test_starts_by_angles_and_by_motions(self):
        (self.path / "far.json").write_text(self.camera(RT=(numpy.array(self.truth["RT"]) @ numpy.vstack(
            [numpy.column_stack([turned(25), MIDDLE - turned(25) @ MIDDLE]), [0, 0, 0, 1]])).tolist()))
        angles = self.pose("--camera", self.path / "far.json", "--start", f"{ANGLES[0]},{ANGLES[1]}", xray=self.pgm)
        self.expect_truth(angles)
        # What was found is where the next one starts.
        (self.path / "pose.json").rename(self.path / "found.json")
        again = self.pose("--camera", self.path / "far.json", "--start", self.path / "found.json", xray=self.pgm, search="0,0")
        self.expect_truth(again)

    def test_films_are_followed(self):
        data = pydicom.dcmread(self.xray)
        data.PixelData, data.NumberOfFrames = data.PixelData * 3, 3
        data.save_as(self.path / "film.dcm")
        found = self.pose("--track", xray=self.path / "film.dcm")
        self.assertEqual(len(found["poses"]), 3)
        refused = call("register", self.scan, self.path / "film.dcm", "-o", self.path / "p.json")
        self.assertIn("3 frames; give --track", refused.stderr)

    def test_what_cannot_be_used_is_refused_in_a_line(self):
        picture = numpy.fromfile(self.pgm, "u1")[-SIZE * SIZE:].reshape(SIZE, SIZE)
        write_pgm(self.path / "small.pgm", picture[:100])
        write_pgm(self.path / "flat.pgm", numpy.full((SIZE, SIZE), 7))
        write_pgm(self.path / "tiny.pgm", picture[:8, :8])
        (self.path / "cut.dcm").write_bytes(self.xray.read_bytes()[:9000])
        rt = numpy.array(self.truth["RT"])
        behind, beside, mirrored, scaled = (rt.copy() for _ in range(4))
        behind[2, 3], beside[0, 3] = -rt[2, 3], 5000
        mirrored[0] *= -1
        scaled[:, :3] *= 2
        yaml = "%YAML:1.0\n---\n" + yaml_matrix("camera_matrix", self.truth["K"])
        texts = {
            "good.json": self.camera(), "behind.json": self.camera(RT=behind.tolist()),
            "beside.json": self.camera(RT=beside.tolist()), "scaled.json": self.camera(RT=scaled.tolist()),
            "nan.json": self.camera().replace(repr(self.truth["RT"][0][0]), "NaN"),
            "huge.json": self.camera().replace(repr(self.truth["RT"][0][3]), "1e999"),
            "flat.json": self.camera(K=[[0, 0, 1], [0, 0, 1], [0, 0, 1]]), "nothing.json": "{}", "words.txt": "no camera",
            "left.yml": yaml + yaml_matrix("R", mirrored[:, :3].tolist()) + yaml_matrix("T", mirrored[:, 3:].tolist()),
            "nan.yml": yaml + yaml_matrix("RT", rt.tolist()).replace(repr(float(rt[0, 0])), ".Nan"),
            "bent.yml": yaml + yaml_matrix("dist_coeffs", [[0.1, 0, 0, 0, 0]]) + yaml_matrix("RT", rt.tolist()),
            "half.yml": yaml, "broken.yml": "%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: [",
            "left-motion.json": json.dumps({"motion": (numpy.diag([-1, 1, 1]) @ numpy.eye(3, 4)).tolist()}),
            "size.yml": yaml + "image_width: 64\nimage_height: 64\n" + yaml_matrix("RT", rt.tolist())}
        for name, text in texts.items():
            (self.path / name).write_text(text)
        own, camera = self.path, lambda name: ("--camera", self.path / name)  # noqa: E731
        for message, words in [
                ("does not say how it was taken", [self.pgm]),
                ("has 128 x 100 pixels, and its camera 128 x 128|its camera 64 x 64", [self.pgm, *camera("size.yml")]),
                ("all its pixels are 7", [own / "flat.pgm", *camera("good.json")]),
                ("at least 16 x 16", [own / "tiny.pgm", *camera("good.json")]),
                ("does not look at the scan", [self.pgm, *camera("behind.json")]),
                ("the scan lies beside the picture", [self.pgm, *camera("beside.json")]),
                ("must be a rotation", [self.pgm, *camera("scaled.json")]),
                ("nan.json", [self.pgm, *camera("nan.json")]),
                ("huge.json", [self.pgm, *camera("huge.json")]),
                ("K", [self.pgm, *camera("flat.json")]),
                ('must hold "K"', [self.pgm, *camera("nothing.json")]),
                ("is no camera|words.txt", [self.pgm, *camera("words.txt")]),
                ("R: is a mirror image", [self.pgm, *camera("left.yml")]),
                ("RT: some of its numbers are not finite", [self.pgm, *camera("nan.yml")]),
                ("undistort the X-ray first", [self.pgm, *camera("bent.yml")]),
                ("half.yml: must hold", [self.pgm, *camera("half.yml")]),
                ("cannot be read as OpenCV's", [self.pgm, *camera("broken.yml")]),
                ("no such file", [own / "none.png", *camera("good.json")]),
                ("none.json", [self.pgm, *camera("none.json")]),
                ("cut.dcm", [own / "cut.dcm"]),
                ("--camera: give one for each of the 2 X-rays", [self.pgm, self.pgm, *camera("good.json")]),
                ("motion: is a mirror image", [self.pgm, *camera("good.json"), "--start", own / "left-motion.json"]),
                ("must be LAO,CRANIAL", [self.pgm, *camera("good.json"), "--start", "near"]),
                ("within 180 and 90", [self.pgm, *camera("good.json"), "--start", "20,95"]),
                ("--search 15: must be DEG,MM", [self.pgm, *camera("good.json"), "--search", "15"]),
                ("--search", [self.pgm, *camera("good.json"), "--search", "-1,5"]),
                ("only a stack of pictures", [self.pgm, *camera("good.json"), "--mirror"])]:
            with self.subTest(message):
                (own / "pose.json").unlink(missing_ok=True)
                (own / "o.png").unlink(missing_ok=True)
                refused = call("register", self.scan, *words, "-o", own / "pose.json", "--overlay", own / "o.png")
                self.assertEqual(refused.returncode, 3, refused.stderr)
                self.assertEqual(refused.stderr.count("\n"), 1, refused.stderr)
                self.assertTrue(any(part in refused.stderr for part in message.split("|")), refused.stderr)
                self.assertEqual([], [file.name for file in (own / "pose.json", own / "o.png") if file.exists()])

    def test_a_picture_of_noise_is_not_sure(self):
        write_pgm(self.path / "noise.pgm", numpy.random.default_rng(1).integers(0, 255, (SIZE, SIZE)))
        (self.path / "c.json").write_text(self.camera())
        done = run("register", self.scan, self.path / "noise.pgm", "--camera", self.path / "c.json", "-o", self.path / "p.json",
                   "--search", "2,4")
        self.assertFalse(json.loads((self.path / "p.json").read_text())["converged"])
        self.assertIn("not to be relied on", done.stdout + done.stderr)


def turned(degrees):
    c, s = numpy.cos(numpy.radians(degrees)), numpy.sin(numpy.radians(degrees))
    return numpy.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


if __name__ == "__main__":
    unittest.main()
