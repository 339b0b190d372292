"""PROGRAM [TEST...]: the fluoroscope's pictures in files that the program writes."""
import json
import math
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

import numpy
import pydicom

PROGRAM = sys.argv.pop(1)
REPOSITORY = pathlib.Path(__file__).resolve().parents[2]


def run(*words):
    return subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True, text=True, timeout=200)


def read_float_nrrd(path):
    header, _, data = path.read_bytes().partition(b"\n\n")
    width, height = map(int, re.search(rb"sizes: (\d+) (\d+)", header).groups())
    return numpy.frombuffer(data, "<f4").reshape(height, width).astype(float)


def write_steps(path):
    """Water steps of 0, 10, 20 and 30 cm from front to back, each 80 mm wide; voxels of 10 mm."""
    hu = numpy.full((16, 32, 34), -1000, "<i2")
    for step in range(4):
        hu[:, :10 * step, 1 + 8 * step:9 + 8 * step] = 0
    header = ("NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 34 32 16\n"
              "endian: little\nencoding: raw\nspace directions: (10,0,0) (0,10,0) (0,0,10)\n"
              "space origin: (0,0,0)\n\n")
    path.write_bytes(header.encode() + hu.tobytes())


def read_grey_png(path):
    """8-bit greys; the filters of PNG's rows are undone."""
    data = path.read_bytes()
    width, height, depth, colour = struct.unpack(">IIBB", data[16:26])
    assert (depth, colour) == (8, 0), "not 8-bit grey"
    packed, at = b"", 8
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        packed += data[at + 8:at + 8 + length] if kind == b"IDAT" else b""
        at += length + 12
    lines = zlib.decompress(packed)
    rows = numpy.zeros((height + 1, width + 1), int)  # with a row above and a column on the left
    for j in range(height):
        kind, line = lines[j * (width + 1)], lines[j * (width + 1) + 1:(j + 1) * (width + 1)]
        for i in range(width):
            left, above, corner = rows[j + 1, i], rows[j, i + 1], rows[j, i]
            nearest = min((abs(above - corner), 0, left), (abs(left - corner), 1, above),
                          (abs(left + above - 2 * corner), 2, corner))[2]
            rows[j + 1, i + 1] = (line[i] + (0, left, above, (left + above) // 2, nearest)[kind]) % 256
    return rows[1:, 1:].astype(float)


def write_slab(path, water_cm):
    """A slab of water, 60 cm wide; voxels of 10 mm."""
    hu = numpy.full((60, water_cm + 4, 60), -1000, "<i2")
    hu[:, 2:-2] = 0
    header = (f"NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 60 {water_cm + 4} 60\n"
              "endian: little\nencoding: raw\nspace directions: (10,0,0) (0,10,0) (0,0,10)\n"
              "space origin: (0,0,0)\n\n")
    path.write_bytes(header.encode() + hu.tobytes())


def delays(path):
    """How long a GIF shows each frame, in hundredths of a second, from its graphic control extensions."""
    return [int.from_bytes(delay, "little") for delay in re.findall(rb"\x21\xf9\x04.(..).\x00", path.read_bytes(), re.S)]


def snr2(values):
    return values.mean() ** 2 / values.var()


class Fluoroscopy(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.scan = self.folder / "steps.nrrd"
        write_steps(self.scan)

    def project(self, name, *options):
        out = self.folder / name
        run("project", self.scan, "-o", out, "--opacity", "spectrum:80", "--size", "500x150", "--pixel", 1, *options)
        return read_float_nrrd(out) if name.endswith(".nrrd") else out

    def steps(self, picture, edge):
        """The middles of the steps, 50 mm wide; the first of water begins at the column `edge`."""
        middles = [edge - 40 + 80 * step for step in range(4)]
        return [picture[20:130, middle - 25:middle + 25] for middle in middles]

    def test_quanta_keep_their_law_behind_water_steps(self):
        whole = self.project("silent.nrrd", "--photons", 1, "--stages", "none")
        edge = int(numpy.argmax(whole[75] < 0.6 * whole[75].max()))
        silent = self.steps(whole, edge)
        for photons in (1e4, 1e5, 1e6):
            for seed in (1, 2):
                noisy = self.steps(self.project("noisy.nrrd", "--photons", photons, "--stages", "quanta", "--seed", seed),
                                   edge)
                for expected, seen in zip(silent, noisy):
                    energy_kev = photons * expected.mean()
                    self.assertAlmostEqual(seen.mean() / energy_kev, 1, delta=0.01)
                    # Quanta of 40 to 75 keV, which spread by up to a quarter. 5,500 values: 2 %.
                    quanta_at_most, quanta_at_least = energy_kev / 40, energy_kev / 75
                    self.assertLess(snr2(seen), 1.06 * quanta_at_most)
                    self.assertGreater(snr2(seen), 0.9 * quanta_at_least)
        ratio = [snr2(b) / snr2(a) for a, b in zip(
            self.steps(self.project("a.nrrd", "--photons", 1e5, "--stages", "quanta"), edge), noisy)]
        numpy.testing.assert_allclose(ratio, 10, rtol=0.09)  # three standard deviations

    def test_noise_of_all_stages_together_is_the_predicted_one(self):
        """One energy, so that the prediction needs no spectrum of the program's: 60 keV, by NIST 0.2059 cm2/g."""
        energy_kev, photons, water_cm, pixel_mm, field_mm, side = 60, 1e4, 20, 0.308, 160, 520
        preset = json.loads((REPOSITORY / "viewer/c_arms/fixed-single-plane.json").read_text())
        detector, grid = preset["detector"], preset["grid"]
        write_slab(self.folder / "slab.nrrd", water_cm)
        (self.folder / "mono.txt").write_text(f"{energy_kev} 1\n")

        def picture(name, seed):
            run("project", self.folder / "slab.nrrd", "-o", self.folder / name, "--opacity",
                f"spectrum:{self.folder}/mono.txt", "--photons", photons, "--c-arm", "fixed-single-plane", "--field",
                field_mm, "--size", f"{side}x{side}", "--pixel", pixel_mm, "--seed", seed, "--compression", 0)  # a window of known width
            return (read_float_nrrd if name.endswith("nrrd") else read_grey_png)(self.folder / name)[middle, middle]

        middle = slice(side // 2 - 128, side // 2 + 128)
        # Scatter is that of a Gaussian of 60 mm from the whole field, 0.154 of the primary for each cm.
        x_mm = (numpy.arange(256) - 127.5) * pixel_mm
        edge = numpy.vectorize(lambda x: math.erf(x / 60 / math.sqrt(2)))
        across = (edge(0.5 * field_mm - x_mm) + edge(0.5 * field_mm + x_mm)).mean() / 2
        scattered = 0.154 * water_cm * across ** 2 * grid["scatter_transmission"] / grid["primary_transmission"]
        quanta = photons * math.exp(-0.2059 * water_cm) * (1 + scattered)
        # Lag is steady: traps hold a share of this pulse's noise back, and give the mean of earlier ones.
        released = 1 - sum(trap["fraction"] for trap in detector["lag"])
        mean_kev = quanta * energy_kev

        frequency = numpy.fft.fftfreq(256)
        fx, fy = numpy.meshgrid(frequency, frequency)
        cycles = numpy.hypot(fx, fy)
        blur = detector["blur"]

        def light(across, down):
            """Transfer of the scintillator and of a pixel's area."""
            squared = (math.pi / pixel_mm) ** 2 * (across ** 2 + down ** 2)
            bell = lambda spread_mm: numpy.exp(-2 * spread_mm ** 2 * squared)
            return ((1 - blur["wide_share"]) * bell(blur["narrow_mm"]) + blur["wide_share"] * bell(blur["wide_mm"])) \
                * numpy.sinc(across) * numpy.sinc(down)

        # Quanta fall anywhere in a pixel: noise of all frequencies that the pixels take for one adds up.
        mtf2 = sum(light(fx + k, fy + n) ** 2 for k in range(-6, 7) for n in range(-6, 7))
        electronic_kev = detector["electronic_noise_kev"] * pixel_mm / detector["pixel_mm"]
        code_kev = energy_kev * 1.25 * photons / 2 ** detector["bits"]  # the open field just fits
        power = quanta * (energy_kev * released) ** 2 * mtf2 + electronic_kev ** 2 + code_kev ** 2 / 12

        pairs = [(picture("a.nrrd", seed), picture("b.nrrd", seed + 1)) for seed in (1, 3, 5)]
        # 0.5 % each: NIST's and xraylib's attenuation through 20 cm, and oblique rays; the cells of the scatter.
        self.assertAlmostEqual(numpy.mean(pairs) / mean_kev, 1, delta=0.02)
        # What two seeds have in common is not noise.
        noise = [(a - b) / math.sqrt(2) for a, b in pairs]
        self.assertAlmostEqual(numpy.var(noise) / power.mean(), 1, delta=0.05)  # the bar; 200,000 values: 0.5 %
        measured = numpy.mean([abs(numpy.fft.fft2(one)) ** 2 for one in noise], axis=0) / 256 ** 2
        for nearest in numpy.arange(0, 0.5, 0.1):
            band = (cycles > nearest) & (cycles <= nearest + 0.1)
            # The bar; the first band has 2,058 frequencies, half of them independent, three times: 1.8 %.
            self.assertAlmostEqual(measured[band].mean() / power[band].mean(), 1, delta=0.05, msg=str(nearest))

        # The display: 255 greys on 2.4 of the logarithm, edges enhanced by 0.8 of the mean of 3 x 3 pixels less that of 3 mm at the isocentre.
        reach = round(1.5 / (pixel_mm * preset["source_axis_mm"] / preset["source_detector_mm"]))

        def mean(reach):
            """Transfer of the mean of a square about a pixel."""
            along = lambda f: (1 + 2 * sum(numpy.cos(2 * math.pi * k * f) for k in range(1, reach + 1))) / (2 * reach + 1)
            return along(fx) * along(fy)

        enhanced = power * (1 + 0.8 * (mean(1) - mean(reach))) ** 2
        grey = (255 / 2.4 / mean_kev) ** 2 * enhanced.mean() + 1 / 12
        shown = (picture("a.png", 1) - picture("b.png", 2)) / math.sqrt(2)
        # The logarithm of a noise of 4 % adds 0.3 %.
        self.assertAlmostEqual(shown.var() / grey, 1, delta=0.05)

    def test_the_same_seed_gives_the_same_file(self):
        for name in ("a.nrrd", "a.exr", "a.png"):
            contents = []
            for seed in (3, 3, 4):
                self.project(name, "--seed", seed, "--dose", "low")
                contents.append((self.folder / name).read_bytes())
            self.assertEqual(contents[0], contents[1])
            self.assertNotEqual(contents[0], contents[2])

    def test_a_dicom_file_holds_codes_and_the_exposure(self):
        for c_arm, bits in (("fixed-single-plane", 14), ("mobile-intensifier", 12)):
            out = self.folder / "x.dcm"
            done = run("project", self.scan, "-o", out, "--c-arm", c_arm, "--dose", "low", "--json")
            told = json.loads(done.stdout)["fluoroscope"]
            data = pydicom.dcmread(out)
            self.assertLess(data.pixel_array.max(), 2 ** bits)
            self.assertGreater(data.pixel_array.max(), 2 ** (bits - 4))
            self.assertEqual(data.BitsStored, 16 if bits == 14 else 12)
            self.assertEqual(float(data.KVP), told["kvp"])
            self.assertAlmostEqual(float(data.ExposureInuAs), 1000 * told["mas"], delta=0.5)
            self.assertAlmostEqual(float(data.ImageAndFluoroscopyAreaDoseProduct) / 10, told["dap_Gycm2"],
                                   delta=1e-5 * told["dap_Gycm2"])
            self.assertEqual((data.RadiationSetting, data.RadiationMode), ("SC", "PULSED"))
            found = subprocess.run(["dciodvfy", out], capture_output=True, text=True)
            self.assertEqual([line for line in found.stderr.splitlines() if line.startswith("Error")], [])

    def test_the_dose_follows_the_level(self):
        kerma = {}
        for dose in ("low", "normal", "cine"):
            done = run("project", self.scan, "-o", self.folder / "x.png", "--dose", dose, "--opacity", "spectrum:80",
                       "--size", "500x150", "--pixel", 1, "--json")
            kerma[dose] = json.loads(done.stdout)["fluoroscope"]["air_kerma_mGy"]
        # At one voltage, by the preset's doses at the detector; the control holds still within 3 %.
        self.assertAlmostEqual(kerma["normal"] / kerma["low"], 2, delta=0.12)
        self.assertAlmostEqual(kerma["cine"] / kerma["normal"], 5, delta=0.3)

    def test_runs_of_a_map_and_a_catheter_count_their_dose(self):
        run("phantom", "thorax", "--size", "96x96x135", "-o", self.folder / "ct.nrrd", "--truth", self.folder / "truth")
        body_map, script = self.folder / "map.exr", self.folder / "push.csv"
        run("cast", self.folder / "ct.nrrd", "-o", body_map, "--layers", 8)
        script.write_text("time_s,insertion_mm,rotation_deg\n0,0,0\n0.5,5,0\n")
        run("render", body_map, "-o", self.folder / "cine.dcm", "--cine", "0:20:5", "--size", "96x96", "--dose", "low")
        self.assertEqual(pydicom.dcmread(self.folder / "cine.dcm").pixel_array.shape, (4, 96, 96))
        done = run("simulate", self.folder / "truth", "--device-model", "cobra-5f", "--script", script, "-o",
                   self.folder / "log.csv", "--map", body_map, "--cine", self.folder / "run.dcm", "--size", "96x96",
                   "--dose", "low", "--pulse-rate", 10, "--json")
        self.assertIn("shows no vessels without contrast agent: add --inject FROM_S,TO_S", done.stderr)
        told = json.loads(done.stdout)["fluoroscope"]
        data = pydicom.dcmread(self.folder / "run.dcm")
        self.assertEqual((told["pulses"], told["images"]), (data.NumberOfFrames, 0))
        self.assertAlmostEqual(told["fluoroscopy_s"], 0.1 * told["pulses"], delta=1e-9)
        self.assertEqual(float(data.FrameTime), 100)
        self.assertGreater(told["air_kerma_mGy"], 0)
        for rate, hundredths in ((3, {33, 34}), (10, {10})):
            run("render", body_map, "-o", self.folder / "turn.gif", "--cine", "0:20:5", "--size", "96x96", "--dose",
                "low", "--pulse-rate", rate)
            self.assertEqual(set(delays(self.folder / "turn.gif")), hundredths)

    def test_the_isocentre_is_in_the_middle_of_the_picture(self):
        """20 mm to the patient's left and 10 mm up, in parallel frontal pictures with pixels of 1 mm."""
        scan, truth, body_map, script = (self.folder / name for name in ("ct.nrrd", "truth", "map.exr", "push.csv"))
        run("phantom", "thorax", "--size", "96x96x135", "-o", scan, "--truth", truth)
        run("cast", scan, "-o", body_map, "--layers", 8)
        script.write_text("time_s,insertion_mm,rotation_deg\n0,0,0\n0.1,1,0\n")
        draw, run_file, view = self.folder / "x.nrrd", self.folder / "x.dcm", ("--size", "120x100", "--pixel", 1)

        def drawn(command, picture, *options):
            told = json.loads(run(command, picture, "-o", draw, *view, "--json", *options).stdout)
            return told["image"]["centre_mm"], read_float_nrrd(draw)

        def cine_of(*options):
            run("simulate", truth, "--device-model", "cobra-5f", "--script", script, "-o", self.folder / "log.csv", "--map",
                body_map, "--cine", run_file, *view, *options)
            return pydicom.dcmread(run_file).pixel_array[0].astype(float)

        def moved(centre_mm):
            return f"--isocentre={centre_mm[0] + 20},{centre_mm[1]},{centre_mm[2] + 10}"

        for command, source in (("project", scan), ("render", body_map)):
            centre_mm, usual = drawn(command, source)
            told_mm, other = drawn(command, source, moved(centre_mm))
            numpy.testing.assert_allclose(numpy.subtract(told_mm, centre_mm), (20, 0, 10), atol=1e-9)
            # The same rays, to what floats lose from another origin.
            numpy.testing.assert_allclose(other[10:, :-20], usual[:-10, 20:], atol=2e-3)
        # The same in steps of 1/256, whose rounding may differ.
        self.assertLessEqual(abs(cine_of(moved(centre_mm))[10:, :-20] - cine_of()[:-10, 20:]).max(), 1)

    def test_a_session_keeps_its_pose_on_a_c_arm(self):
        run("phantom", "thorax", "--size", "96x96x135", "-o", self.folder / "ct.nrrd")
        body_map, session = self.folder / "map.exr", self.folder / "session.json"
        run("cast", self.folder / "ct.nrrd", "-o", body_map, "--layers", 8)
        seen = {}
        for angle in (0, 40):
            camera = {"angle_deg": angle, "tilt_deg": 10, "table_mm": 12, "zoom": 1}
            session.write_text(json.dumps({
                "xraycast_session": 1, "files": {"map": "map.exr"}, "camera": camera,
                "style": {"look": "fluoro", "compositing": "path", "continuous": True, "strengths": []}}))
            done = run("render", "--session", session, "-o", self.folder / "x.png", "--c-arm", "mobile-flat-panel",
                       "--json")
            seen[angle] = json.loads(done.stdout)["image"]
        self.assertAlmostEqual(seen[0].pop("angle_deg"), 0)
        self.assertAlmostEqual(seen[40].pop("angle_deg"), 40)
        self.assertEqual(seen[0], seen[40])
        self.assertAlmostEqual(seen[40]["tilt_deg"], 10)
        # Its cone too, without a C-arm.
        drawn = []
        for cone in ({}, {"cone_mm": [780, 1200]}):
            text = json.loads(session.read_text())
            text["camera"] |= cone
            session.write_text(json.dumps(text))
            run("render", "--session", session, "-o", self.folder / "cone.png")
            drawn.append((self.folder / "cone.png").read_bytes())
        self.assertNotEqual(*drawn)
        done = run("render", "--session", session, "-o", self.folder / "x.png", "--angle", 70, "--c-arm",
                   "mobile-flat-panel", "--pixel", 0.5, "--json")
        other = json.loads(done.stdout)["image"]
        self.assertAlmostEqual(other["angle_deg"], 70)
        self.assertAlmostEqual(other["tilt_deg"], 10)
        self.assertEqual((other["pixel_mm"], other["centre_mm"]), (0.5, seen[40]["centre_mm"]))
        done = run("render", "--session", session, "-o", self.folder / "x.png", "--angle", 70, "--json")
        self.assertAlmostEqual(json.loads(done.stdout)["image"]["angle_deg"], 70)
        # The largest field, by its pixels two by two.
        self.assertEqual((seen[40]["width"], seen[40]["pixel_mm"]), (976, 0.304))

    def test_a_spectrum_from_a_file_is_the_beam(self):
        for name in ("mono.txt", "123", "99999999999"):
            spectrum = self.folder / name
            spectrum.write_text("60 1\n")
            run("project", self.scan, "-o", self.folder / "x.dcm", "--opacity", f"spectrum:{spectrum}", "--photons", 1000,
                "--size", "100x50", "--pixel", 5)
            data = pydicom.dcmread(self.folder / "x.dcm")
            self.assertNotIn("ImageAndFluoroscopyAreaDoseProduct", data)
            self.assertEqual((data.ExposureTime, data.KVP), (None, None))
            self.assertEqual(data.RadiationSetting, "SC")
        for energy_kev, options, message in ((60, "--kvp 80", "both set the tube voltage"), (1.5, "", "a harder")):
            (self.folder / "mono.txt").write_text(f"{energy_kev} 1\n")
            done = subprocess.run([PROGRAM, "project", self.scan, "-o", self.folder / "y.png", "--photons", "1000", "--opacity",
                                   f"spectrum:{self.folder}/mono.txt", *options.split()], capture_output=True, text=True)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (3, 1), done.stderr)
            self.assertIn(message, done.stderr)

    def test_photons_that_no_tube_gives_leave_the_exposure_out(self):
        out = self.folder / "x.dcm"
        done = run("project", self.scan, "-o", out, "--photons", 1e7, "--pixel", 0.1, "--size", "32x32", "--json")
        self.assertEqual(json.loads(done.stdout)["fluoroscope"]["dap_Gycm2"], 0)
        self.assertNotIn("ExposureInuAs", pydicom.dcmread(out))

    def test_exposures_by_hand_are_not_blank(self):
        for mas in (0.05, 2, 6):
            picture = self.project("x.nrrd", "--kvp", 80, "--mas", mas, "--c-arm", "fixed-single-plane")
            for seen in self.steps(picture, int(numpy.argmax(picture[75] < 0.6 * picture[75].max())))[1:]:
                self.assertGreater(seen.std(), 0.001 * seen.mean())

    def test_saturation_gets_one_line(self):
        write_slab(self.folder / "thin.nrrd", 1)
        done = run("project", self.folder / "thin.nrrd", "-o", self.folder / "x.png", "--mas", 6, "--size", "32x32",
                   "--pixel", 1)
        self.assertIn("saturates the detector", done.stderr)

    def test_subtraction_of_one_frame_is_zero_where_nothing_came(self):
        run("phantom", "thorax", "--size", "96x96x135", "-o", self.folder / "ct.nrrd", "--truth", self.folder / "truth")
        body_map = self.folder / "map.exr"
        run("cast", self.folder / "ct.nrrd", "-o", body_map, "--layers", 8)
        words = ("render", body_map, "--look", "dsa", "--vessels", self.folder / "truth", "--size", "160x160")
        run(*words, "-o", self.folder / "x.nrrd", "--stages", "lag")
        self.assertAlmostEqual(numpy.median(read_float_nrrd(self.folder / "x.nrrd")), 0, delta=1e-3)
        run(*words, "-o", self.folder / "x.dcm", "--dose", "low")
        data = pydicom.dcmread(self.folder / "x.dcm")
        # The noise is whole: zero lies 256 levels, a tau of 1, below white.
        self.assertAlmostEqual(numpy.median(data.pixel_array), 4095 - 256, delta=8)
        self.assertLess((data.pixel_array == 4095).mean(), 0.01)
        self.assertGreater(float(data.KVP), 40)
        self.assertGreater(float(data.ImageAndFluoroscopyAreaDoseProduct), 0)
        greys = []
        for option in ((), ("--inverted",), ("--gamma", 2)):
            run(*words, "-o", self.folder / "x.png", "--dose", "low", *option)
            greys.append((self.folder / "x.png").read_bytes())
        self.assertEqual(len(set(greys)), 3)

    def test_bad_options_get_one_line(self):
        for options, message in (("--photons 0", "above 0"), ("--mas inf", "at most"), ("--kvp 300", "allows"),
                                 ("--collimate 0,10", "shut"), ("--pulse-rate 0", "3 to 30"),
                                 ("--stages quanta,x", "unknown stage"), ("--c-arm x", "unknown C-arm"),
                                 ("--photons 5 --mas 1", "give one of them"), ("--mas 100", "at most"),
                                 ("--stages quanta,", "unknown stage"), ("--field 100", "add --c-arm"),
                                 ("--pixel 0.005 --size 16x16 --photons 9 --opacity spectrum:80", "too fine for the blur")):
            done = subprocess.run([PROGRAM, "project", self.scan, "-o", self.folder / "x.png", *options.split()],
                                  capture_output=True, text=True)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (3, 1), options + done.stderr)
            self.assertIn(message, done.stderr)
            self.assertFalse((self.folder / "x.png").exists())


if __name__ == "__main__":
    unittest.main()
