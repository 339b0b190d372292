"""PROGRAM: a client of OpenIGTLink that watches a body in motion over `xraycast serve`, and holds, gates and releases it.
Messages are made and read here, by the protocol's version 1."""
import pathlib
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest

PROGRAM = sys.argv.pop(1)
HEADER = struct.Struct(">H12s20sQQQ")
PATIENCE_S = 30
BEAT_S = 60 / 70  # of the phantom's heart


def run(*words):
    subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True, timeout=300)


def crc64(data):
    """ECMA-182."""
    crc = 0
    for byte in data:
        crc ^= byte << 56
        for _ in range(8):
            crc = (crc << 1 ^ (0x42F0E1EBA9EA3693 if crc >> 63 else 0)) & (1 << 64) - 1
    return crc


def message(type_name, name, body=b""):
    return HEADER.pack(1, type_name.encode(), name.encode(), 0, len(body), crc64(body)) + body


def string(name, text):
    return message("STRING", name, struct.pack(">HH", 3, len(text)) + text.encode())


class Server:
    def __init__(self, *words):
        self.process = subprocess.Popen([PROGRAM, "serve", *map(str, words), "--haptic", "none", "--listen", "127.0.0.1:0"],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.said = ""
        for line in self.process.stderr:
            self.said += line
            if found := re.search(r"serving OpenIGTLink at 127\.0\.0\.1:(\d+)", line):
                self.port = int(found[1])
                break
        else:
            raise AssertionError(self.said)
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        for line in self.process.stderr:
            self.said += line

    def wait_for(self, words):
        end = time.monotonic() + PATIENCE_S
        while words not in self.said:
            assert time.monotonic() < end, (words, self.said)
            time.sleep(0.02)

    def end(self):
        self.process.send_signal(signal.SIGTERM)
        status = self.process.wait(PATIENCE_S)
        self.reader.join(PATIENCE_S)
        self.process.stderr.close()
        return status


class Client:
    """Holds the pedal down, and collects pictures."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
        self.send(message("STT_IMAGE", ""))
        self.pictures, self.ends = [], False
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()
        self.press("down")

    def send(self, data):
        self.socket.sendall(data)

    def press(self, way):
        self.send(string("Pedal", way))

    def body(self, text):
        self.send(string("Body", text))

    def exactly(self, size):
        data = b""
        while len(data) < size:
            portion = self.socket.recv(size - len(data))
            if not portion:
                raise ConnectionError
            data += portion
        return data

    def read(self):
        try:
            while not self.ends:
                _, kind, _, _, size, _ = HEADER.unpack(self.exactly(HEADER.size))
                body = self.exactly(size)
                if kind.rstrip(b"\0") == b"IMAGE":
                    self.pictures.append((time.monotonic(), body[72:]))
        except (ConnectionError, OSError):
            pass

    def watch(self, seconds):
        """Pictures from now on. Whatever was under way has come by then."""
        time.sleep(0.5)
        begin = len(self.pictures)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            time.sleep(0.5)
            self.press("down")  # a silent client lets go
        return [picture for _, picture in self.pictures[begin:]]

    def end(self):
        self.ends = True
        self.socket.shutdown(socket.SHUT_RDWR)
        self.reader.join(PATIENCE_S)
        self.socket.close()


class ServeInMotion(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = folder = pathlib.Path(temporary.name)
        run("phantom", "thorax", "--size", "64x64x80", "-o", folder / "rest.nrrd", "--truth", folder / "rest", "--motion", folder / "motion")
        run("cast", folder / "rest.nrrd", "-o", folder / "moving.exr", "--layers", 4, "--angles", 90, "--motion",
            folder / "motion/motion.json", "--keys", "breath=2", "--keys", "heart=6")

    def serve(self, *words):
        server = Server(self.folder / "moving.exr", "--vessels", self.folder / "rest", "--size", "160x120", *words)
        self.addCleanup(lambda: server.process.poll() is None and server.process.kill())
        return server, Client(server.port)

    def test_moves_until_it_is_held(self):
        server, client = self.serve()
        moving = client.watch(2)
        self.assertGreater(len(set(moving)), 8, "a picture is another one as the body moves")
        client.body("hold breath")
        self.assertGreater(len(set(client.watch(1))), 3, "the heart beats on")
        client.body("hold heart")
        held = client.watch(1)
        self.assertGreater(len(held), 3, "pictures come")
        self.assertEqual(len(set(held)), 1, "of a body that is held")
        client.body("release breath")
        self.assertGreater(len(set(client.watch(3))), 3, "a breath of 4 s rests for a second at its end, and begins slowly")
        client.body("hold breath 0.25")
        client.body("hold heart 0")
        quarter = set(client.watch(1))
        client.body("hold breath 1")
        self.assertEqual(len(quarter | set(client.watch(1))), 2, "each phase has its picture")
        client.body("hold breath 0.25")
        self.assertEqual(set(client.watch(1)), quarter, "to which it comes back")
        client.end()
        self.assertEqual(server.end(), 128 + signal.SIGTERM)

    def test_exposes_once_a_beat_where_it_is_gated(self):
        server, client = self.serve("--phase", "breath=0", "--gate", "heart=0.75")
        gated = client.watch(6)
        self.assertAlmostEqual(len(gated), 6 / BEAT_S, delta=2)
        # All at one phase: a step or two of the simulation late, in which the heart hardly moves. Greys of 8 bits.
        spread = lambda pictures: max(max(abs(a - b) for a, b in zip(pictures[0], other)) for other in pictures[1:])
        self.assertLessEqual(spread(gated), 3)
        client.body("gate off")
        free = client.watch(2)
        self.assertGreater(len(free), 15)
        self.assertGreater(spread(free), 3)
        client.body("speed 2")
        client.body("gate heart 0.75")
        self.assertAlmostEqual(len(client.watch(6)), 12 / BEAT_S, delta=3)
        client.body("hold heart 0")
        self.assertEqual(client.watch(2), [], "a gate that never opens")
        client.end()
        server.end()

    def test_passes_over_what_a_body_cannot_do(self):
        server, client = self.serve()
        for text, why in (("hold cough", "cough: the body has no such mode"), ("dance", "must be 'hold MODE'"), ("gate heart 2", "must be 0 to 1")):
            client.body(text)
            server.wait_for("the body goes on as it did")
            server.wait_for(why)
        client.body("x" * 200)
        server.wait_for("STRING Body of 200 characters")
        self.assertGreater(len(set(client.watch(1))), 3)
        client.end()
        server.end()

    def test_refuses_what_no_motion_has(self):
        for words, why in ((("--gate", "cough=1"), "no such mode; choose one of breath, heart"), (("--motion-speed", "-1"), "--motion-speed -1: must be 0 to 100"),
                           (("--gate", "heart"), "--gate heart: must be a mode and its phase"), (("--phase", "heart=2"), "heart"),
                           (("--phase", "heart=0", "--gate", "heart=0.5"), "never has this phase")):
            done = subprocess.run([PROGRAM, "serve", self.folder / "moving.exr", "--vessels", self.folder / "rest", "--listen", "127.0.0.1:0", *words],
                                  capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 3, done.stderr)
            self.assertIn(why, done.stderr)


if __name__ == "__main__":
    unittest.main()
