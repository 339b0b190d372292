"""PROGRAM: the server with clients of PyPI's pyigtl, which steer, watch and command; how many pictures two watchers
receive, what they cost the simulation, and what one costs that does not read. Prints what was measured."""
import json
import pathlib
import re
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import numpy
import pyigtl

PROGRAM = sys.argv.pop(1)
SIZE = (640, 480)


class Sensor(pyigtl.messages.MessageBase):
    def _unpack_content(self, content):
        count, _, self.unit = struct.unpack("> B B Q", content[:10])
        self.values = struct.unpack(f"> {count}d", content[10:])


class Request(pyigtl.messages.MessageBase):
    """GET_, STT_ or STP_ of a type, with an interval in ms."""

    def __init__(self, type_name, interval_ms=None):
        super().__init__()
        self._message_type, self.interval_ms, self._valid_message = type_name, interval_ms, True

    def _pack_content(self):
        return b"" if self.interval_ms is None else struct.pack("> i", self.interval_ms)


pyigtl.messages.message_type_to_class_constructor["SENSOR"] = Sensor


def run(*words):
    subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True, text=True, timeout=300)


def hub_pose(insertion_mm, rotation_rad=0.0):
    matrix = numpy.eye(4)
    c, s = numpy.cos(rotation_rad), numpy.sin(rotation_rad)
    matrix[:2, :2] = [[c, -s], [s, c]]
    matrix[2, 3] = insertion_mm
    return pyigtl.TransformMessage(matrix, device_name="Hub")


def c_arm_pose(angle_deg, tilt_deg, isocentre_mm):
    a, t = numpy.radians([angle_deg, tilt_deg])
    right = [numpy.cos(a), numpy.sin(a), 0]
    towards_source = [-numpy.sin(a) * numpy.cos(t), numpy.cos(a) * numpy.cos(t), -numpy.sin(t)]
    matrix = numpy.eye(4)
    matrix[:3, 0], matrix[:3, 2], matrix[:3, 3] = right, towards_source, isocentre_mm
    matrix[:3, 1] = numpy.cross(towards_source, right)
    return matrix


class Server:
    """`xraycast serve` on a free port, and its report at the end."""

    def __init__(self, folder, *words):
        self.process = subprocess.Popen(
            [PROGRAM, "serve", folder / "map.exr", "--vessels", folder / "truth", "--listen", "127.0.0.1:0", "--json",
             "--size", f"{SIZE[0]}x{SIZE[1]}", *map(str, words)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.said = ""
        for line in self.process.stderr:
            self.said += line
            if found := re.search(r"serving OpenIGTLink at 127\.0\.0\.1:(\d+)", line):
                self.port = int(found[1])
                break
        else:
            raise AssertionError(f"the server did not start: {self.said}")
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        for line in self.process.stderr:
            self.said += line

    def rss_MB(self):
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1000

    def end(self):
        self.process.send_signal(signal.SIGTERM)
        out = self.process.stdout.read()
        status = self.process.wait(30)
        assert status == 128 + signal.SIGTERM, (status, self.said)
        return json.loads(out)

    def kill(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.process.stdout.close()
        self.reader.join(10)
        self.process.stderr.close()


class Steerer(threading.Thread):
    """Moves the hub to and fro under fluoroscopy, as a device does."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.client = pyigtl.OpenIGTLinkClient("127.0.0.1", port)
        self.stops = False
        self.start()

    def run(self):
        self.client.send_message(pyigtl.StringMessage("down", device_name="Pedal"))
        begin = time.time()
        while not self.stops:
            phase = (time.time() - begin) / 10
            self.client.send_message(hub_pose(100 - 100 * numpy.cos(2 * numpy.pi * phase), phase))

    def end(self):
        self.stops = True
        self.join()
        self.client.stop()


class Watcher(threading.Thread):
    """Counts the pictures that it is sent."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.client = pyigtl.OpenIGTLinkClient("127.0.0.1", port)
        self.client.send_message(Request("STT_IMAGE"))
        self.pictures, self.stops = 0, False
        self.start()

    def run(self):
        while not self.stops:
            if self.client.wait_for_message("Fluoroscope", timeout=0.2):
                self.pictures += 1

    def end(self):
        self.stops = True
        self.join()
        self.client.stop()


def rates(watchers, seconds):
    """Pictures per second of each, from now on."""
    before, begin = [w.pictures for w in watchers], time.time()
    time.sleep(seconds)
    passed = time.time() - begin
    return [(w.pictures - b) / passed for w, b in zip(watchers, before)]


class Serve(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = pathlib.Path(temporary.name)
        run("phantom", "thorax", "-o", cls.folder / "scan.nrrd", "--truth", cls.folder / "truth", "--size", "160x160x140")
        run("cast", cls.folder / "scan.nrrd", "-o", cls.folder / "map.exr", "--layers", 8)

    def serve(self, *words):
        server = Server(self.folder, *words)
        self.addCleanup(server.kill)
        return server

    def connect(self, server):
        client = pyigtl.OpenIGTLinkClient("127.0.0.1", server.port)
        self.addCleanup(client.stop)
        return client

    def message(self, client, name, timeout=10):
        message = client.wait_for_message(name, timeout=timeout)
        self.assertIsNotNone(message, f"no {name}")
        return message

    def push(self, client, from_mm, to_mm, seconds):
        begin = time.time()
        while (share := (time.time() - begin) / seconds) < 1:
            client.send_message(hub_pose(from_mm + share * (to_mm - from_mm)))

    def test_tells_how_far_an_exercise_is(self):
        file = self.folder / "up.json"
        file.write_text(json.dumps({
            "title": "Up", "task": "Go up.", "instruments": ["cobra-5f"], "entry": [89, -54, -357],
            "targets": [{"at_mm": [88, -58, -325]}, {"vessel": "left common iliac artery", "depth_mm": 10}],
            "limits": {"fluoroscopy_s": 1}}))
        server = self.serve("--exercise", file, "--report", self.folder / "run.html")
        client = self.connect(server)
        client.send_message(Request("STT_STRING", 100))
        report = lambda: json.loads(self.message(client, "Report").string)
        self.assertEqual(report()["exercise"]["title"], "Up")
        client.send_message(pyigtl.StringMessage("down", device_name="Pedal"))
        self.push(client, 0, 80, 3)
        end = time.time() + 20
        while not (told := report())["exercise"]["limits"][0]["passed_s"] or not told["exercise"]["targets"][0]["reached_s"]:
            self.push(client, 80, 80, 0.2)
            self.assertLess(time.time(), end, told)
        self.assertGreater(told["instruments"][0]["tip_path_mm"], 30)
        self.assertNotIn("series", told)
        ended = server.end()["report"]["exercise"]
        self.assertEqual(ended["targets"][0], told["exercise"]["targets"][0])
        self.assertIn("place in left external iliac artery", (self.folder / "run.html").read_text())

    def test_steers_and_receives_pictures_points_tips_and_forces(self):
        server = self.serve()
        client = self.connect(server)
        for request in ("STT_IMAGE", "STT_POINT", "STT_TRANS"):
            client.send_message(Request(request))
        client.send_message(pyigtl.StringMessage("down", device_name="Pedal"))
        self.push(client, 0, 20, 1)
        before = self.message(client, "Fluoroscope")
        self.push(client, 20, 150, 4)
        self.push(client, 150, 150, 1)
        force, torque = self.message(client, "HubForce"), self.message(client, "HubTorque")
        self.assertNotEqual(force.values[2], 0)
        self.assertEqual((len(force.values), len(torque.values)), (3, 3))
        client.get_latest_messages()
        after, points, tip = (self.message(client, name) for name in ("Fluoroscope", "Device", "Tip"))

        self.assertEqual(after.image.shape, (1, SIZE[1], SIZE[0]))
        self.assertEqual(after.image.dtype, numpy.uint8)
        self.assertEqual(after.world_coordinate_system, "lps")
        controls = numpy.array(points.positions)
        length = numpy.linalg.norm(numpy.diff(controls, axis=0), axis=1).sum()
        self.assertGreater(length, 140, "what was pushed in")
        numpy.testing.assert_allclose(controls[-1], tip.matrix[:3, 3], atol=0.5)  # the hub still settles

        # The parallel beam shows the new part of the instrument where the picture's matrix puts it.
        to_pixel = numpy.linalg.inv(after.ijk_to_world_matrix)
        at = to_pixel @ numpy.c_[controls, numpy.ones(len(controls))].T
        changed = numpy.argwhere(numpy.abs(after.image[0].astype(int) - before.image[0]) > 8)
        self.assertGreater(len(changed), 20)
        nearest = [numpy.min(numpy.hypot(at[0] - i, at[1] - j)) for j, i in changed]
        # Control points are some pixels apart.
        self.assertLess(numpy.percentile(nearest, 95), 8, "changes lie along the instrument")
        i, j = (to_pixel @ tip.matrix[:, 3])[:2]
        self.assertLess(numpy.min(numpy.hypot(changed[:, 1] - i, changed[:, 0] - j)), 6, "and reach its tip")
        report = server.end()
        self.assertGreater(report["fluoroscopy_s"], 4)

    def test_commands_c_arm_and_contrast_and_releases_the_pedal(self):
        server = self.serve("--haptic", "none", "--bits", 16)
        client = self.connect(server)
        client.send_message(Request("STT_IMAGE", 40))
        first = self.message(client, "Fluoroscope")
        self.assertEqual(first.image.dtype, numpy.uint16)
        self.assertGreater(len(numpy.unique(first.image)), 256, "finer greys than eight bits hold")
        client.send_message(pyigtl.StringMessage("down", device_name="Pedal"))
        client.send_message(pyigtl.StringMessage("0.3 mm", device_name="Particles"))
        client.send_message(pyigtl.StringMessage("4 ml/s", device_name="Contrast"))
        centre = first.ijk_to_world_matrix @ [(SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2, 0, 1]
        wanted = c_arm_pose(30, -20, [0, 0, centre[2] + 25])
        client.send_message(pyigtl.TransformMessage(wanted, device_name="CArm"))
        time.sleep(1)
        client.get_latest_messages()
        turned = self.message(client, "Fluoroscope").ijk_to_world_matrix
        pixel_mm = numpy.linalg.norm(first.ijk_to_world_matrix[:3, 0])
        numpy.testing.assert_allclose(turned[:3, :3], pixel_mm * wanted[:3, :3], atol=1e-5)
        middle = turned @ [(SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2, 0, 1]
        self.assertAlmostEqual(middle[2], centre[2] + 25, places=3)
        client.stop()
        time.sleep(0.5)
        watcher = self.connect(server)
        watcher.send_message(Request("STT_IMAGE"))
        self.message(watcher, "Fluoroscope")
        self.assertIsNone(watcher.wait_for_message("Fluoroscope", timeout=1), "the pedal is up")
        report = server.end()
        self.assertGreater(report["injected_ml"], 2)
        self.assertLess(report["fluoroscopy_s"], 10)
        self.assertTrue(all(treatment["device"] == "particles" for treatment in report["report"]["treatments"]))
        # Of 0.3 mm: 60 mm3 a ml in spheres of 0.01414 mm3.
        particles = sum(treatment["particles"] for treatment in report["report"]["treatments"])
        self.assertAlmostEqual(particles / (report["injected_ml"] * 60 / 0.014137), 1, delta=0.35)

    def run_of(self, watchers, seconds):
        """The report of a steered session, and the rates of its watchers."""
        server = self.serve()
        steerer = Steerer(server.port)
        watching = [Watcher(server.port) for _ in range(watchers)]
        time.sleep(2)
        measured = rates(watching, seconds)
        for client in (*watching, steerer):
            client.end()
        return server.end(), measured

    def test_two_watchers_receive_fifteen_pictures_a_second_and_hardly_cost_a_step(self):
        # Other programs on the machine make steps late too: runs with and without watchers take turns.
        alone, watched, slowest = [], [], []
        for _ in range(5):
            alone.append(self.run_of(0, 6)[0]["late_percent"])
            report, measured = self.run_of(2, 6)
            watched.append(report["late_percent"])
            slowest.append(min(measured))
            print(f"late steps: {alone[-1]:.2f} % without watchers, {watched[-1]:.2f} % with two of {SIZE[0]} x {SIZE[1]}, "
                  f"which received {measured[0]:.1f} and {measured[1]:.1f} pictures/s", flush=True)
        without, with_two = statistics.median(alone), statistics.median(watched)
        print(f"medians: {without:.2f} % without, {with_two:.2f} % with", flush=True)
        if without > 1:
            self.skipTest(f"the machine is too busy: {without:.2f} % of the steps are late without watchers")
        self.assertLessEqual(with_two - without, 0.5)
        self.assertGreaterEqual(statistics.median(slowest), 15)

    def test_a_watcher_that_does_not_read_costs_nothing(self):
        server = self.serve()
        steerer = Steerer(server.port)
        watching = [Watcher(server.port) for _ in range(2)]
        time.sleep(2)
        before = rates(watching, 5)
        with socket.create_connection(("127.0.0.1", server.port)) as deaf:
            deaf.sendall(Request("STT_IMAGE").pack())
            time.sleep(2)
            rss_MB = server.rss_MB()
            during = rates(watching, 20)
            grown_MB = server.rss_MB() - rss_MB
            print(f"pictures/s: {before[0]:.1f} and {before[1]:.1f} before, {during[0]:.1f} and {during[1]:.1f} beside one "
                  f"that does not read; {grown_MB:.1f} MB more in 20 s", flush=True)
            self.assertGreaterEqual(min(during), 15)
            # A hundred pictures are 31 MB.
            self.assertLess(grown_MB, 6)
            # What it reads late are whole messages.
            deaf.settimeout(5)
            received = b""
            while len(received) < 3_000_000:
                received += deaf.recv(1 << 20)
            pictures, at = 0, 0
            while at + 58 <= len(received):
                header = pyigtl.messages.MessageBase.parse_header(received[at:at + 58])
                self.assertIn(header["message_type"], ("STATUS", "RTS_IMAGE", "IMAGE"))
                pictures += header["message_type"] == "IMAGE"
                at += 58 + header["body_size"]
            self.assertGreater(pictures, 5)
        for client in (*watching, steerer):
            client.end()
        server.end()

    def test_what_is_malformed_is_passed_over(self):
        server = self.serve("--haptic", "none")
        client = self.connect(server)
        client.send_message(pyigtl.StringMessage("sideways", device_name="Pedal"))
        client.send_message(pyigtl.StringMessage("hello", device_name="Greeting"))
        client.send_message(Request("STT_IMAGE", 10 ** 8))
        client.send_message(pyigtl.TransformMessage(numpy.diag([2, 1, 1, 1]), device_name="CArm"))
        with socket.create_connection(("127.0.0.1", server.port)) as noise:
            noise.sendall(b"noise" * 100)
        client.send_message(Request("GET_IMAGE"))
        self.message(client, "Fluoroscope")
        client.stop()
        time.sleep(1.5)  # the log counts lines of a kind for a second
        server.end()
        for text in ("neither 'down' nor 'up'", "none of Pedal, Contrast, Particles, Balloon, Sheath, Detach and Body", "beyond 60000 ms", "not a rotation",
                     "the message framing is lost"):
            self.assertIn(text, server.said)


if __name__ == "__main__":
    unittest.main(verbosity=2)
