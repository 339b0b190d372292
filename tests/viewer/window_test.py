"""PROGRAM FOLDER TEST...: the viewer's window on a virtual display, driven by xdotool as a hand would, and by a
small source of dragged files. Without TEST, all of them; `prepare` makes the files that they open.

What happened is read from the session that Ctrl+S saves, from pictures that the viewer saves, and from the
screen. Everything is waited for by what can be seen of it, since a loaded machine takes its time. With
XRAYCAST_SCREENSHOTS set to a folder, what was on the screen is kept there."""
import array
import ctypes
import json
import os
import pathlib
import random
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import zlib

PROGRAM, FILES = sys.argv[1], pathlib.Path(sys.argv[2])
PATIENCE_S = 30
INK, ROAD_MAP = (255, 210, 90), (190, 150, 60)
DONE = (120, 210, 140)  # of an exercise
XRAYS, HELD, CAP = (255, 196, 60), (130, 190, 255), (46, 52, 60)  # on the operator's screen


def run(*words, **options):
    return subprocess.run(words, check=True, capture_output=True, text=True, timeout=PATIENCE_S, **options).stdout


def prepare():
    FILES.mkdir(parents=True, exist_ok=True)
    scan = FILES / "scan.nrrd"
    run(PROGRAM, "phantom", "thorax", "-o", scan, "--size", "96x96x80", "--truth", FILES / "truth")
    run(PROGRAM, "cast", scan, "-o", FILES / "map.exr", "--layers", "4", "--angles", "90", "--keep-basis", FILES / "map.basis")
    run(PROGRAM, "phantom", "thorax", "-o", FILES / "other.nrrd", "--size", "64x64x48")
    run(PROGRAM, "cast", FILES / "other.nrrd", "-o", FILES / "other.exr", "--layers", "4", "--angles", "90", "--keep-basis", FILES / "other.basis")
    run(PROGRAM, "phantom", "thorax", "-o", FILES / "rest.nrrd", "--size", "64x64x80", "--truth", FILES / "rest", "--motion", FILES / "motion")
    run(PROGRAM, "cast", FILES / "rest.nrrd", "-o", FILES / "moving.exr", "--layers", "4", "--angles", "90", "--motion", FILES / "motion/motion.json",
        "--keys", "breath=2", "--keys", "heart=6")
    (FILES / "damaged.exr").write_bytes((FILES / "map.exr").read_bytes()[:3000])
    # A long scan that takes no room on the disk.
    with open(FILES / "long.raw", "wb") as raw:
        raw.truncate(512 * 512 * 3000 * 2)
    (FILES / "long.mhd").write_text("ObjectType = Image\nNDims = 3\nBinaryData = True\nElementSpacing = 1 1 1\n"
                                    "DimSize = 512 512 3000\nElementType = MET_SHORT\nElementDataFile = long.raw\n")


class Screen:
    """What a display shows: width, height, and rows of (r, g, b)."""

    def __init__(self, dump):
        header = struct.unpack(">25I", dump[:100])
        self.width, self.height, little, bits, self.row_B = header[4], header[5], header[7] == 0, header[11], header[12]
        assert bits in (24, 32) and little, header
        self.pixel_B, self.bytes = bits // 8, dump[header[0] + 12 * header[19]:]

    def at(self, x, y):
        b, g, r = self.region(x, y, 1, 1)[:3]
        return r, g, b

    def region(self, x, y, width, height):
        starts = (j * self.row_B + self.pixel_B * x for j in range(y, y + height))
        return b"".join(self.bytes[start:start + self.pixel_B * width] for start in starts)

    def find(self, colour, x, y, width, height):
        """Where a region has a colour."""
        r, g, b = colour
        wanted, places = bytes((b, g, r)), []
        for j in range(y, y + height):
            row = self.region(x, j, width, 1)
            at = lambda i: row[self.pixel_B * i:self.pixel_B * i + 3]
            places += [(x + i, j) for i in range(width) if at(i) == wanted] if wanted in row else []
        return places

    def write(self, path):
        rows = bytearray()
        for y in range(self.height):
            row, rgb = self.region(0, y, self.width, 1), bytearray(3 * self.width)
            for channel in range(3):
                rgb[channel::3] = row[2 - channel::self.pixel_B]
            rows += b"\0" + rgb
        chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        header = struct.pack(">IIBBBBB", self.width, self.height, 8, 2, 0, 0, 0)
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(rows))) +
                         chunk(b"IEND", b""))


class Desktop:
    """A user's settings, and a source of dragged files, by version 5 of the XDND protocol."""

    def __init__(self, display):
        self.x = ctypes.CDLL("libX11.so.6")
        for name in ("XOpenDisplay", "XCreateSimpleWindow", "XInternAtom", "XDefaultRootWindow"):
            getattr(self.x, name).restype = ctypes.c_ulong
        self.display = ctypes.c_void_p(self.x.XOpenDisplay(display.encode()))
        root = ctypes.c_ulong(self.x.XDefaultRootWindow(self.display))
        self.window = self.x.XCreateSimpleWindow(self.display, root, 0, 0, 1, 1, 0, ctypes.c_ulong(0), ctypes.c_ulong(0))

    def atom(self, name):
        return self.x.XInternAtom(self.display, name.encode(), 0)

    def set_density(self, dots_per_inch):
        """As desktops tell new windows how dense a screen is."""
        text = f"Xft.dpi: {dots_per_inch}\n".encode()
        root = ctypes.c_ulong(self.x.XDefaultRootWindow(self.display))
        kind = ctypes.c_ulong(31)  # a string
        self.x.XChangeProperty(self.display, root, ctypes.c_ulong(self.atom("RESOURCE_MANAGER")), kind, 8, 0, text, len(text))
        self.x.XFlush(self.display)

    def tell(self, target, kind, *values):
        """A ClientMessage: type, serial, send_event, display, window, message type, format, five longs."""
        event = struct.pack("@i4xLi4xPLLi4x5l", 33, 0, 1, self.display.value, target, self.atom(kind), 32,
                            *(list(values) + [0] * (5 - len(values))))
        self.x.XSendEvent(self.display, ctypes.c_ulong(target), 0, ctypes.c_long(0), event.ljust(192, b"\0"))
        self.x.XFlush(self.display)

    def next_event(self):
        end = time.monotonic() + PATIENCE_S
        while not self.x.XPending(self.display):
            assert time.monotonic() < end, "the window does not answer"
            time.sleep(0.01)
        event = ctypes.create_string_buffer(192)
        self.x.XNextEvent(self.display, event)
        return struct.unpack("@i", event.raw[:4])[0], event.raw

    def answer(self, request, text):
        """Gives the window what it asks for: a SelectionRequest's requestor, selection, target, property, time."""
        requestor, selection, target, place, when = struct.unpack("@5L", request[40:80])
        self.x.XChangeProperty(self.display, ctypes.c_ulong(requestor), ctypes.c_ulong(place), ctypes.c_ulong(target), 8, 0, text, len(text))
        event = struct.pack("@i4xLi4xPLLLLL", 31, 0, 1, self.display.value, requestor, selection, target, place, when)
        self.x.XSendEvent(self.display, ctypes.c_ulong(requestor), 0, ctypes.c_long(0), event.ljust(192, b"\0"))
        self.x.XFlush(self.display)

    def drop(self, target, *paths):
        text = "".join(path.resolve().as_uri() + "\r\n" for path in paths).encode()
        selection = self.atom("XdndSelection")
        self.x.XSetSelectionOwner(self.display, ctypes.c_ulong(selection), ctypes.c_ulong(self.window), ctypes.c_ulong(0))
        self.tell(target, "XdndEnter", self.window, 5 << 24, self.atom("text/uri-list"))
        self.tell(target, "XdndPosition", self.window, 0, 600 << 16 | 400, 0, self.atom("XdndActionCopy"))
        dropped = False
        while True:
            kind, event = self.next_event()
            message = struct.unpack("@L", event[40:48])[0]
            if kind == 33 and message == self.atom("XdndStatus") and not dropped:
                self.tell(target, "XdndDrop", self.window)
                dropped = True
            elif kind == 30:
                self.answer(event, text)
            elif kind == 33 and message == self.atom("XdndFinished"):
                return


class Window(unittest.TestCase):
    def setUp(self):
        self.start_display("1280x800x24")
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="xraycast-window-"))
        self.viewer = None

    def start_display(self, size):
        told, tells = os.pipe()
        self.xvfb = subprocess.Popen(["Xvfb", "-displayfd", str(tells), "-noreset", "-screen", "0", size, "-nolisten", "tcp"],
                                     pass_fds=[tells], stderr=subprocess.DEVNULL)
        os.close(tells)
        with os.fdopen(told) as number:
            self.display = ":" + number.readline().strip()
        self.environment = dict(os.environ, DISPLAY=self.display)

    def stop_display(self):
        self.xvfb.kill()
        self.xvfb.communicate()

    def tearDown(self):
        try:
            if (kept := os.environ.get("XRAYCAST_SCREENSHOTS")) and self.viewer and self.viewer.poll() is None:
                self.screen().write(pathlib.Path(kept) / f"{self._testMethodName}.png")
        finally:
            for process in (self.viewer, self.xvfb):
                if process:
                    process.kill()
                    process.communicate()
            shutil.rmtree(self.folder)

    def view(self, *words):
        self.viewer = subprocess.Popen([PROGRAM, "view", *map(str, words)], env=self.environment, cwd=self.folder,
                                       stderr=subprocess.PIPE, text=True)
        self.window = int(self.wait_until(self.found, "a window").split()[0])
        self.do("windowfocus", self.window)
        if words:
            self.wait_until(lambda: self.session()["style"]["strengths"], "the map is shown")

    def found(self):
        """The windows' numbers."""
        return subprocess.run(["xdotool", "search", "--onlyvisible", "--name", "^xraycast$"], env=self.environment,
                              capture_output=True, text=True, timeout=PATIENCE_S).stdout

    def do(self, *words):
        return run("xdotool", *map(str, words), env=self.environment)

    def wait_until(self, condition, what):
        end = time.monotonic() + PATIENCE_S
        while not (found := condition()):
            self.assertLess(time.monotonic(), end, f"never: {what}")
            if self.viewer.poll() is not None:
                self.fail("the viewer has ended: " + self.viewer.stderr.read())
            time.sleep(0.03)
        return found

    def session(self):
        """What Ctrl+S saves: it comes after all keys and drags before it."""
        path = self.folder / "xraycast-session.json"
        path.unlink(missing_ok=True)
        self.do("key", "ctrl+s")
        self.wait_until(path.exists, "the session is saved")
        return json.loads(path.read_text())

    def screen(self):
        return Screen(subprocess.run(["xwd", "-root", "-silent"], check=True, capture_output=True, env=self.environment).stdout)

    def body(self):
        """The picture, without the panel on its left and what is written around it."""
        return self.screen().region(500, 100, 500, 500)

    def frame(self):
        """By the third session the window has taken in what was before the first, and drawn it."""
        for _ in range(3):
            self.session()

    def drag(self, button, x, y, dx, dy):
        for step in (("mousemove", x, y), ("mousedown", button), ("mousemove", x + dx // 2, y + dy // 2),
                     ("mousemove", x + dx, y + dy), ("mouseup", button)):
            self.do(*step)
            self.frame()

    def keep_screen(self, name):
        if kept := os.environ.get("XRAYCAST_SCREENSHOTS"):
            self.screen().write(pathlib.Path(kept) / f"{name}.png")

    def pictures(self):
        return sorted(self.folder.glob("xraycast-*.png"))

    # ---- the hand

    def test_rotates_travels_and_zooms(self):
        self.view(FILES / "map.exr")
        before = self.body()
        self.drag(1, 700, 400, 100, 0)
        # 0.4 deg a pixel.
        self.assertAlmostEqual(self.session()["camera"]["angle_deg"], -40, delta=1)
        self.wait_until(lambda: self.body() != before, "another picture")
        for _ in range(3):
            self.do("click", 4)
        # 1.1 times a notch.
        self.assertAlmostEqual(self.session()["camera"]["zoom"], 1.331, delta=1e-3)
        self.drag(2, 700, 400, 0, 60)
        self.assertGreater(self.session()["camera"]["table_mm"], 5)
        self.do("key", "r")
        camera = self.session()["camera"]
        self.assertEqual([camera["angle_deg"], camera["zoom"], camera["table_mm"]], [0, 1, 0])

    def test_changes_window_look_layers_and_compositing(self):
        self.view(FILES / "map.exr", "--vessels", FILES / "truth")
        self.assertNotIn("window", self.session())
        before = self.body()
        self.drag(3, 700, 400, -80, 60)
        window = self.session()["window"]
        self.assertTrue(0 <= window["dark"] < window["light"] <= 1, window)
        self.wait_until(lambda: self.body() != before, "another window")
        for key, name, value in (("f", "look", "surface"), ("c", "compositing", "wall"), ("2", "strengths", [1, 0, 1, 1])):
            before = self.body()
            self.do("key", key)
            self.assertEqual(self.session()["style"][name], value)
            self.wait_until(lambda: self.body() != before, f"another picture after {key}")
        self.do("key", "ctrl+z")
        self.assertEqual(self.session()["style"]["strengths"], [1, 1, 1, 1])
        self.do("key", "ctrl+y")
        self.assertEqual(self.session()["style"]["strengths"], [1, 0, 1, 1])

    def test_adapts_the_brightness_to_what_is_seen(self):
        self.view(FILES / "map.exr")
        self.frame()
        lightest = lambda: max(self.screen().region(430, 30, 820, 600)[::4])
        self.assertEqual(lightest(), 255, "the air beside the body")
        self.drag(3, 700, 400, 1, 0)  # a window chosen by hand, though nearly the same
        self.do("mousemove", 640, 360)
        for _ in range(18):
            self.do("click", 4)
        chosen = self.session()["window"]
        self.frame()
        dim = lightest()
        self.assertLess(dim, 200, "nothing but the abdomen")
        self.do("mousemove", 113, 137, "click", 1)  # automatic brightness
        self.wait_until(lambda: lightest() > dim + 20, "a brighter picture")
        self.assertNotIn("window", self.session())
        self.do("click", 1)
        self.assertLess(self.session()["window"]["light"], chosen["light"])

    def knot(self):
        """The middle of an opacity's knot in the panel, by its colour."""
        found = self.screen().find((255, 220, 150), 100, 100, 180, 500)
        return found[len(found) // 2] if found else None

    def test_recasts_while_a_knot_is_dragged(self):
        self.view(FILES / "map.exr", "--basis", FILES / "map.basis")
        self.assertNotIn("opacity", self.session())
        x, y = self.wait_until(self.knot, "a knot")
        before = self.body()
        for step in (("mousemove", x, y), ("mousedown", 1), ("mousemove", x, y - 40)):
            self.do(*step)
            self.frame()
        self.wait_until(lambda: self.body() != before, "another picture while the knot is held")
        self.do("mouseup", 1)
        self.assertIn("opacity", self.session())
        self.do("key", "ctrl+z")
        self.assertNotIn("opacity", self.session())
        self.wait_until(lambda: self.body() == before, "the picture as it was")

    def test_turns_until_it_is_told_to_stop(self):
        self.view(FILES / "map.exr")
        angle = lambda: self.session()["camera"]["angle_deg"]
        self.do("key", "space")
        first = angle()
        self.wait_until(lambda: angle() != first, "another angle")
        self.do("key", "space")
        last = angle()
        self.assertEqual(angle(), last)

    # ---- the vessels

    def test_names_the_branch_that_is_clicked_at(self):
        self.view(FILES / "map.exr", "--vessels", FILES / "truth")
        self.frame()
        before = self.body()
        self.do("mousemove", 650, 80, "click", 1)  # beside all vessels
        self.frame()
        self.assertEqual(self.body(), before)
        x, y = 645, 410  # in the aorta
        self.do("mousemove", x, y, "click", 1)
        # Smoothed letters: some pixels have all of the ink.
        words = lambda: self.screen().find(INK, x, y - 20, 350, 90)
        self.wait_until(lambda: len(words()) > 30, "the branch's name beside where it was clicked")
        self.frame()
        named = words()
        # Another place of it, and another one's name.
        self.do("mousemove", x, y + 50, "click", 1)
        self.wait_until(lambda: words() != named, "the name elsewhere")
        self.do("mousemove", 650, 80, "click", 1)
        self.wait_until(lambda: self.body() == before, "no name")
        self.assertEqual(self.session()["camera"]["angle_deg"], 0)

    # ---- the catheter

    def operate(self, *words):
        """A body with a catheter in it under a fluoroscope, whose first picture is there."""
        self.view(FILES / "map.exr", "--vessels", FILES / "truth", "--simulate", *words)
        self.wait_until(self.is_held, "the first picture")

    def steer(self, *words):
        """The same without noise and with the vessels' outline."""
        self.operate(*words)
        self.do("key", "e")
        self.wait_until(lambda: self.screen().find(ROAD_MAP, 500, 100, 400, 500), "the road map")
        self.frame()

    def picture(self):
        """Most of it, without what is written around it."""
        return self.screen().region(100, 100, 780, 490)

    def is_held(self):
        """What the upper right corner of the fluoroscope's picture says."""
        return self.screen().find(HELD, 700, 0, 200, 40)

    def is_live(self):
        return self.screen().find(XRAYS, 700, 0, 200, 40)

    def tip(self):
        """Of the first instrument, in mm, as the picture has it."""
        return self.session()["simulation"]["devices"][0]["nodes_mm"][-1]

    def hold(self, key, seconds):
        self.do("keydown", key)
        time.sleep(seconds)
        self.do("keyup", key)

    def fluoroscopy(self):
        """The time, as it stands on the screen."""
        return self.screen().region(1100, 78, 90, 30)

    def recording(self, number=1):
        """The rows (time_s, insertion_mm, rotation_deg) of a run that Enter has ended."""
        path = self.folder / f"xraycast-run-{number:03}.csv"
        self.wait_until(path.exists, "the recording")
        header, *rows = path.read_text().splitlines()
        self.assertEqual(header, "time_s,insertion_mm,rotation_deg")
        return [tuple(map(float, row.split(","))) for row in rows]

    def test_pushes_under_the_pedal_and_holds_the_last_image(self):
        self.steer()
        before, time_before = self.picture(), self.fluoroscopy()
        self.hold("Up", 1.5)
        self.frame()
        self.assertEqual(self.picture(), before, "without the pedal the last image is held")
        self.assertEqual(self.fluoroscopy(), time_before)
        self.do("keydown", "x")
        self.wait_until(lambda: self.picture() != before, "the catheter where it is now")
        self.wait_until(lambda: self.fluoroscopy() != time_before, "fluoroscopy time")
        seen = self.picture()
        self.do("keydown", "Up")
        self.wait_until(lambda: self.picture() != seen, "the catheter as it goes on")
        self.do("keyup", "Up")
        self.do("keyup", "x")
        self.frame()
        held, time_held = self.picture(), self.fluoroscopy()
        self.hold("Down", 1)
        self.frame()
        self.assertEqual(self.picture(), held)
        self.assertEqual(self.fluoroscopy(), time_held)

    def test_records_and_replays(self):
        self.steer()
        self.do("key", "Return")
        self.hold("Up", 1.5)
        self.hold("Right", 0.5)
        self.do("key", "Return")
        rows = self.recording()
        # At 40 mm/s and 120 deg/s, as long as a loaded machine held the keys.
        self.assertGreater(rows[-1][1], 30)
        self.assertGreater(rows[-1][2], 30)
        self.assertEqual(rows[0][0], 0)
        self.assertAlmostEqual(rows[0][1], 0, delta=0.1)
        self.do("key", "l")
        self.do("key", "Return")
        time.sleep(rows[-1][0] + 0.5)
        self.do("key", "Return")
        replayed = self.recording(2)
        # The hub comes to where the recording ends, to the digits of the file.
        self.assertAlmostEqual(replayed[-1][1], rows[-1][1], delta=2e-4)
        self.assertAlmostEqual(replayed[-1][2], rows[-1][2], delta=2e-4)
        # And then by hand again, from the entrance.
        self.do("key", "BackSpace")
        self.do("key", "Return")
        self.hold("Up", 0.5)
        self.do("key", "Return")
        last = self.recording(3)
        self.assertLess(last[0][1], 1)
        self.assertGreater(last[-1][1], 5)

    def test_injects_contrast_agent_downstream(self):
        self.steer()
        self.hold("Up", 3)
        self.do("keydown", "x")
        self.frame()
        self.do("key", "m")  # the road map would lie on the vessels' borders
        self.frame()
        before = self.picture()
        darker = lambda: sum(a > b + 8 for a, b in zip(before, self.picture()))
        self.frame()
        self.assertLess(darker(), 30, "nothing but the catheter moves")
        self.do("keydown", "i")
        self.wait_until(lambda: darker() > 600, "contrast agent")
        self.do("keyup", "i")
        self.wait_until(lambda: darker() < 100, "it is washed out")

    def test_shows_the_road_map(self):
        self.steer()
        lines = lambda: len(self.screen().find(ROAD_MAP, 500, 100, 400, 530))
        with_map = lines()
        self.assertGreater(with_map, 300)
        self.do("key", "m")
        self.wait_until(lambda: lines() == 0, "no road map")
        self.do("key", "m")
        self.wait_until(lambda: lines() == with_map, "the road map")

    # ---- the operator's screen

    def noise(self):
        """The mean difference of neighbours in the picture, in greys."""
        greys = self.screen().region(300, 150, 300, 200)[::4]
        return sum(abs(a - b) for a, b in zip(greys, greys[1:])) / len(greys)

    def test_opens_with_a_fluoroscopes_picture(self):
        self.operate()
        # Photons' noise makes 13 greys, the vessels' outline without it 3.
        self.wait_until(lambda: self.noise() > 8, "a picture, though nothing was pressed")
        # The shape of a fixed C-arm's detector, 381.9 x 295.7 mm, 651 pixels high.
        screen = self.screen()
        lit = [x for x in range(960) if screen.at(x, 300)[0] > 20]
        self.keep_screen("opened")
        self.assertAlmostEqual(lit[-1] - lit[0] + 1, 651 * 381.9 / 295.7, delta=2)
        held = self.picture()
        time.sleep(0.5)
        self.assertEqual(self.picture(), held, "without the pedal there are no pulses")
        tip_z, camera = self.tip()[2], self.session()["camera"]
        self.assertGreater(tip_z, -358)
        self.assertLess(camera["table_mm"], -200, "the table is where the catheter enters, not at mid-body")
        self.do("key", "e")
        self.wait_until(lambda: self.noise() < 5, "the picture without noise")
        self.do("key", "e")
        self.wait_until(lambda: self.noise() > 8, "the fluoroscope again, at once")

    def test_says_whether_the_picture_is_live_or_held(self):
        self.operate()
        self.assertFalse(self.is_live())
        lamp = lambda: self.screen().at(990, 15)
        self.assertEqual(lamp(), CAP)
        self.do("keydown", "x")
        self.wait_until(self.is_live, "X-rays on")
        self.assertEqual(lamp(), XRAYS)
        self.assertFalse(self.is_held())
        seen = self.picture()
        for _ in range(3):
            self.wait_until(lambda: self.picture() != seen, "another pulse, with other noise")
            seen = self.picture()
        self.do("keyup", "x")
        self.wait_until(self.is_held, "the last image, held")
        self.frame()
        held = self.picture()
        time.sleep(0.5)
        self.assertEqual(self.picture(), held)
        self.do("key", "x")
        self.wait_until(lambda: self.picture() != held, "a picture by a tap on the pedal")
        self.keep_screen("fluoroscope")

    def bar_px(self, y):
        places = self.screen().find(INK, 0, y, 965, 1)
        return places[-1][0] - places[0][0]

    def test_keeps_the_shape_of_a_held_picture(self):
        self.operate()
        self.frame()
        bar = self.bar_px(606)
        self.do("windowsize", "--sync", self.window, 1000, 700)
        self.wait_until(lambda: self.screen().at(1100, 300) == (0, 0, 0), "a smaller window")
        self.frame()
        # 685 pixels wide, and lower than the 631 there are for it.
        lit = lambda y: self.screen().at(600, y)[0] > 20
        self.assertEqual([lit(y) for y in (40, 60, 570, 600)], [False, True, True, False])
        self.assertAlmostEqual(self.bar_px(586), bar * 685 / 841, delta=2)
        self.do("key", "p")
        self.wait_until(self.pictures, "the stored image")
        self.assertEqual(struct.unpack(">II", self.pictures()[0].read_bytes()[16:24]), (685, 631))

    def test_forgets_a_message_with_the_next_key(self):
        self.operate()
        message = lambda: self.screen().find((255, 255, 255), 975, 553, 290, 60)
        self.session()
        self.wait_until(message, "saved ...")
        self.do("keydown", "Up", "keyup", "Up")
        self.session()
        self.assertTrue(message(), "what steers is no answer")
        self.do("key", "t")
        self.wait_until(lambda: not message(), "none")

    def monitor(self):
        """The numbers beside the picture, above the messages."""
        return self.screen().region(1100, 60, 170, 320)

    def test_shows_dose_time_and_loads(self):
        self.operate()
        before = self.monitor()
        time.sleep(0.5)
        self.assertEqual(self.monitor(), before)
        rows = {"air kerma": 80, "fluoroscopy": 200, "injected": 282, "inserted": 343}
        numbers = {name: self.screen().region(1100, y, 90, 28) for name, y in rows.items()}
        self.do("keydown", "x", "keydown", "Up", "keydown", "i")
        for name, y in rows.items():
            self.wait_until(lambda: self.screen().region(1100, y, 90, 28) != numbers[name], f"more {name}")
        self.do("keyup", "x", "keyup", "Up", "keyup", "i")
        self.keep_screen("monitor")

    def panels(self):
        """Where they cover the black beside the picture."""
        return self.screen().at(30, 200) != self.screen().at(30, 640)

    def test_has_the_panels_behind_a_key(self):
        self.operate()
        self.assertFalse(self.panels())
        monitor = self.monitor()
        self.do("key", "a")
        self.wait_until(self.panels, "the panels")
        self.assertNotEqual(self.monitor(), monitor, "the catheter's panel takes the monitor's place")
        self.keep_screen("panels")
        self.do("key", "a")
        self.wait_until(lambda: not self.panels(), "no panels")
        # Where nothing is steered they are there at first.
        self.viewer.kill()
        self.viewer.communicate()
        self.view(FILES / "map.exr")
        self.wait_until(self.panels, "the panels")
        self.do("key", "a")
        self.wait_until(lambda: not self.panels(), "no panels")

    def caps(self):
        """How many keys the strip below shows."""
        screen = self.screen()
        edges = lambda y: (screen.at(x, y) != CAP and screen.at(x + 1, y) == CAP for x in range(1279))
        return sum(map(sum, map(edges, (662, 690))))

    def test_lists_the_keys_that_are_usable_now(self):
        self.operate()
        self.frame()
        keys = self.wait_until(self.caps, "keys")
        self.do("key", "g", "d")
        self.do("keydown", "x", "keydown", "i")
        self.wait_until(lambda: self.caps() == keys + 2, "new mask, and road map")
        self.do("keyup", "x", "keyup", "i")
        self.do("key", "g", "Return", "Return")
        self.wait_until(self.folder.joinpath("xraycast-run-001.csv").exists, "a recording")
        self.wait_until(lambda: self.caps() == keys + 2, "road map, and replay")

    def first_steps(self):
        """The ground of the box over the picture."""
        return self.screen().at(252, 365) == self.screen().at(252, 420)

    def test_begins_with_four_lines_of_help(self):
        self.viewer = subprocess.Popen([PROGRAM, "view", FILES / "map.exr", "--vessels", FILES / "truth", "--simulate"],
                                       env=self.environment, cwd=self.folder, stderr=subprocess.PIPE, text=True)
        self.window = int(self.wait_until(self.found, "a window").split()[0])
        self.do("windowfocus", self.window)
        self.wait_until(self.is_held, "the first picture")
        time.sleep(0.5)
        self.assertTrue(self.first_steps())
        self.keep_screen("first-steps")
        self.do("keydown", "x")
        self.wait_until(lambda: not self.first_steps(), "the picture alone")
        self.do("keyup", "x")

    def place(self):
        """Of the tip in the picture, in pixels of a picture of 841 x 651."""
        self.frame()
        session, tip = self.session(), self.tip()
        camera = session["camera"]
        # The map is 720 mm high about 0 mm, and seen from the front.
        pixel_mm, across = 720 / 651 / camera["zoom"], camera.get("across_mm", [0, 0])
        return (tip[0] - across[0]) / pixel_mm + 420, 325 - (tip[2] - camera["table_mm"]) / pixel_mm

    def test_follows_the_tip(self):
        self.operate()
        table_mm = lambda: self.session()["camera"]["table_mm"]
        first = table_mm()
        self.do("key", "t")
        self.do("keydown", "x")
        self.hold("Up", 1)
        self.assertEqual(table_mm(), first, "switched off")
        self.do("key", "t")
        self.hold("Up", 4)
        self.assertGreater(table_mm(), first + 20)
        for _ in range(12):
            self.do("click", 4)
        self.frame()
        self.assertGreater(self.session()["camera"]["zoom"], 8)
        # What is near the tip is in the picture; six times magnified, without following, it would not be.
        x, y = self.place()
        self.assertTrue(0 < x < 841 and 0 < y < 651, (x, y))
        self.do("keyup", "x")

    def test_suggests_cine_for_subtraction(self):
        self.operate()
        advice = lambda: len(self.screen().find(XRAYS, 250, 35, 460, 60))
        self.assertEqual(advice(), 0)
        self.do("key", "g", "keydown", "x")
        many = self.wait_until(advice, "advice")
        time.sleep(1)
        self.assertTrue(advice(), "as long as the dose is normal")
        self.keep_screen("advice")
        self.do("key", "d")
        self.wait_until(lambda: not advice(), "none for a cine, once it has its mask")
        self.do("keyup", "x")

    def test_is_as_large_on_a_dense_screen(self):
        self.stop_display()
        self.start_display("2560x1600x24")
        Desktop(self.display).set_density(192)
        self.view(FILES / "map.exr", "--vessels", FILES / "truth", "--simulate")
        self.wait_until(lambda: self.screen().find(HELD, 1500, 0, 400, 80), "the first picture")
        screen = self.screen()
        width = max(x for x in range(2560) if screen.at(x, 1430) != (0, 0, 0)) + 1
        self.assertEqual(width, 2560)
        cap = [y for y in range(1300, 1370) if screen.at(40, y) == CAP]
        self.assertEqual(len(cap), 45, "a key's cap, twice as high")
        self.do("key", "p")
        self.wait_until(self.pictures, "the stored image")
        self.wait_until(lambda: self.pictures()[0].read_bytes()[-8:] == b"IEND\xaeB`\x82", "the whole of it")
        self.assertEqual(struct.unpack(">II", self.pictures()[0].read_bytes()[16:24]), (1682, 1302))

    def test_reaches_a_renal_artery(self):
        """As someone does who has read no more than what the window says."""
        self.operate("--entry", "89,-54,-357")
        self.do("keydown", "x", "keydown", "Up")
        in_it = lambda: (tip := self.tip())[0] > 27 and -65 < tip[2] < -40
        self.wait_until(in_it, "the tip in the left renal artery")
        self.do("keyup", "Up", "keydown", "i")

        def filled():
            x, y = (int(at) for at in self.place())  # the table follows the tip, and comes to rest after it
            return sum(g < 40 for g in self.screen().region(62 + x - 10, y - 40, 90, 80)[::4]) > 300

        self.wait_until(filled, "the left renal artery filled")
        self.keep_screen("renal-artery")
        self.do("keyup", "i", "keyup", "x")

    def test_subtracts_and_maps_the_road(self):
        self.operate()
        self.hold("Up", 4.2)
        self.do("keydown", "x")
        self.frame()
        self.do("keyup", "x")
        self.do("key", "g", "d")  # at the dose of a cine, subtracted
        self.do("keydown", "x")
        grey = lambda: self.screen().region(120, 110, 540, 480)[::4]
        light = lambda: sum(150 < g < 250 for g in grey()) / len(grey())
        dark = lambda: sum(g < 90 for g in grey())
        self.wait_until(lambda: light() > 0.98, "an even picture, subtracted from its mask")
        none = dark()
        self.do("keydown", "i")
        self.wait_until(lambda: dark() > none + 300, "contrast agent in the vessels")
        self.keep_screen("subtraction")
        self.do("keyup", "i")
        self.wait_until(lambda: dark() < none + 50, "it is washed out")
        bright = lambda: sum(g > 180 for g in grey())
        self.do("key", "g")
        self.wait_until(lambda: light() < 0.9, "the live picture")
        without = bright()
        self.do("key", "m")
        self.wait_until(lambda: bright() > without + 300, "the road map")
        self.do("keyup", "x")
        self.keep_screen("road-map")

    def test_shows_an_exercise_and_saves_its_report(self):
        file = self.folder / "task.json"
        file.write_text(json.dumps({
            "title": "Into the aorta", "task": "From the left groin, bring the Cobra into the aorta.", "entry": [89, -54, -357],
            "instruments": ["cobra-5f"], "devices": ["vertebral-5f"], "limits": {"time_s": 1, "wall_force_N": 100},
            "targets": [{"name": "the groin", "at_mm": [88, -58, -325]}, {"at_mm": [6, -9, -52]}],
            "forbidden": ["right external iliac artery"]}))
        self.view(FILES / "map.exr", "--vessels", FILES / "truth", "--exercise", file, "--report", self.folder / "run.json")
        self.wait_until(self.is_held, "the first picture")
        self.do("key", "t", "t")
        self.frame()
        words = lambda colour: len(self.screen().find(colour, 0, 0, 300, 300))
        self.assertTrue(words(HELD), "its title")
        self.assertFalse(words(DONE) or words(XRAYS), "nothing is reached or passed yet")
        self.do("keydown", "x", "keydown", "Up")
        self.wait_until(lambda: words(DONE), "the first target")
        one = self.wait_until(lambda: words(XRAYS), "the time is over")
        self.do("keyup", "Up", "keyup", "x")
        self.keep_screen("exercise")
        self.do("key", "ctrl+r")
        self.wait_until((self.folder / "run.json").exists, "the report")
        first = json.loads((self.folder / "run.json").read_text())
        self.assertEqual(first["exercise"]["title"], "Into the aorta")
        self.assertIsNotNone(first["exercise"]["targets"][0]["reached_s"])
        self.assertIsNotNone(first["exercise"]["limits"][0]["passed_s"])
        self.assertGreater(first["fluoroscopy_s"], 0)
        self.assertGreater(first["air_kerma_mGy"], 0)
        # A replay is nobody's work: the report stays that of the run before.
        self.do("key", "Return")
        self.hold("Up", 0.3)
        self.do("key", "Return", "key", "l")
        self.frame()
        self.do("key", "ctrl+r")
        self.wait_until(lambda: json.loads((self.folder / "run.json").read_text())["time_s"] > first["time_s"], "the longer run's report")
        self.do("key", "BackSpace")
        self.wait_until(lambda: not words(DONE) and words(XRAYS) < one, "the exercise from its beginning")
        self.do("key", "a")
        self.frame()
        self.assertFalse(words(HELD), "the panels take its place")
        self.viewer.terminate()
        self.assertEqual(self.viewer.wait(PATIENCE_S), 128 + signal.SIGTERM)
        last = json.loads((self.folder / "run.json").read_text())
        self.assertIsNone(last["exercise"]["targets"][0]["reached_s"])
        self.assertLess(last["time_s"], first["time_s"])

    def test_holds_the_hub_by_the_mouse(self):
        self.steer("--haptic", "mouse")
        self.do("key", "Return")
        self.do("key", "a")
        self.frame()
        pose = lambda: self.screen().region(970, 72, 300, 17)  # the panel's line
        self.do("keydown", "ctrl", "mousemove", 700, 400, "mousedown", 1)
        for step in (("mousemove", 720, 350), ("mousemove", 740, 300), ("mouseup", 1, "click", 4), ("click", 4)):
            before = pose()
            self.do(*step)
            self.wait_until(lambda: pose() != before, "another pose of the hub")
            self.wait_until(lambda: (now := pose()) == (time.sleep(0.3), pose())[1] and now, "the hub at rest")
        self.do("keyup", "ctrl", "key", "Return")
        rows = self.recording()
        # Half a millimetre and a degree a pixel, and 3 mm a notch; the walls push the hub back by little.
        self.assertAlmostEqual(rows[-1][1], 56, delta=1)
        self.assertAlmostEqual(rows[-1][2], 40, delta=1)
        self.assertEqual(self.session()["camera"]["angle_deg"], 0, "the C-arm stays where it is")

    def choose(self, choice):
        """From the list beside the second instrument, which is in the hand, by the number from the top."""
        self.do("mousemove", 1000, 274, "click", 1)
        self.frame()
        self.keep_screen("instruments")
        self.do("mousemove", 1000, 300 + 19 * choice, "click", 1)
        self.frame()

    def test_exchanges_a_wire_that_is_drawn_back(self):
        self.steer("--device-model", "guide-6f", "--device-model", "guidewire-035-j")
        self.do("key", "a")
        inner = lambda: self.session()["simulation"]["devices"][1]
        self.do("key", "Tab")
        self.do("keydown", "x")
        self.hold("Up", 1)
        self.frame()
        wire = inner()
        self.assertFalse(wire["has_lumen"])
        self.choose(4)  # microcatheter-27f
        self.assertFalse(inner()["has_lumen"], "it is not drawn back")
        self.keep_screen("exchange-refused")

        def is_exchanged():
            self.hold("Down", 1)
            self.choose(4)
            return inner()["has_lumen"]

        self.wait_until(is_exchanged, "the microcatheter")
        self.assertGreater(inner()["radius_mm"], wire["radius_mm"])
        # It is steered, from 0 mm on: its tip goes on.
        tip = inner()["nodes_mm"][-1]
        self.hold("Up", 1)
        self.wait_until(lambda: max(abs(a - b) for a, b in zip(inner()["nodes_mm"][-1], tip)) > 5, "its way")
        self.do("keyup", "x")

    def tau(self, *words):
        """The floats of what `render` makes of it."""
        path = self.folder / "tau.nrrd"
        run(PROGRAM, "render", *words, "-o", path)
        values = array.array("f")
        values.frombytes(path.read_bytes().split(b"\n\n", 1)[1])
        return values

    def test_saves_what_a_run_shows(self):
        self.steer()
        self.do("keydown", "x")
        self.hold("Up", 2)
        self.frame()
        self.do("keyup", "x")
        self.frame()
        shown = self.picture()
        self.drag(1, 700, 400, 100, 0)  # the C-arm turns, the last image is held
        saved = self.session()
        self.assertEqual(saved["camera"]["angle_deg"], 0)
        path = self.folder / "operation.json"
        path.write_text(json.dumps(saved))
        # The catheter and no vessels: against the body, few of the pixels absorb more, and as much as a catheter.
        with_it, drawn = self.tau("--session", path), self.folder / "drawn.png"
        body = self.folder / "body.json"
        body.write_text(json.dumps({name: value for name, value in saved.items() if name not in ("simulation", "files")} |
                                   {"files": {"map": saved["files"]["map"]}}))
        more = [a - b for a, b in zip(with_it, self.tau("--session", body))]
        self.assertGreater(max(more), 0.1)
        self.assertTrue(10 < sum(m > 1e-3 for m in more) < 0.02 * len(more), sum(m > 1e-3 for m in more))
        # Vessels that are asked for are drawn.
        vessels = [a - b for a, b in zip(self.tau("--session", path, "--vessels", FILES / "truth"), with_it)]
        self.assertGreater(sum(v > 1e-3 for v in vessels), 0.02 * len(vessels))
        # The road map is in the picture as long as it was.
        pictures = []
        for has_road_map in (True, False):
            saved["simulation"]["road_map"] = has_road_map
            path.write_text(json.dumps(saved))
            run(PROGRAM, "render", "--session", path, "-o", drawn)
            pictures.append(drawn.read_bytes())
        self.assertNotEqual(*pictures)
        # And a viewer that opens it shows what was shown, but for the grey window, which is chosen anew.
        saved["simulation"]["road_map"] = True
        path.write_text(json.dumps(saved))
        self.viewer.kill()
        self.viewer.communicate()
        self.view("--session", path)
        self.do("windowsize", "--sync", self.window, 965, 651)  # what the picture had of the window
        self.do("key", "a")
        differs = lambda: sum(abs(a - b) > 16 for a, b in zip(shown, self.picture())) / len(shown)
        self.wait_until(lambda: differs() < 1e-3, "the picture as it was")

    def test_ends_in_the_middle_of_a_run(self):
        self.steer()
        self.do("key", "Return")
        self.do("keydown", "x")
        self.do("keydown", "Up")
        time.sleep(0.5)
        desk = Desktop(self.display)
        desk.tell(self.window, "WM_PROTOCOLS", desk.atom("WM_DELETE_WINDOW"))
        self.assertEqual(self.viewer.wait(PATIENCE_S), 0)
        self.assertEqual(self.viewer.stderr.read(), "")

    # ---- the body

    def move(self, *words):
        """A body that breathes, with a beating heart and a catheter, under a fluoroscope."""
        self.view(FILES / "moving.exr", "--vessels", FILES / "rest", "--simulate", *words)
        self.wait_until(self.is_held, "the first picture")

    def still(self):
        """Whether two pictures half a second apart are the same."""
        before = self.body()
        time.sleep(0.5)
        return self.body() == before

    def labels(self):
        """How much is written below the upper right corner of the fluoroscope's picture."""
        return len(self.screen().find(HELD, 600, 34, 300, 90))

    def test_breathes_and_beats_until_it_is_held(self):
        self.view(FILES / "moving.exr", "--vessels", FILES / "rest")
        self.wait_until(lambda: not self.still(), "a body in motion")
        self.keep_screen("body-panel")
        self.do("key", "b")
        self.frame()
        self.assertFalse(self.still(), "the heart beats on")
        self.do("key", "k")
        self.wait_until(self.still, "breath held and heart arrested")
        # What is still is the map of these phases: it stays as the window is drawn again.
        held = self.body()
        self.frame()
        self.assertEqual(self.body(), held)
        self.do("key", "k")
        self.wait_until(lambda: not self.still(), "the heart beats")

    def test_holds_a_mode_from_the_start(self):
        self.view(FILES / "moving.exr", "--phase", "breath=1", "--phase", "heart=0")
        self.wait_until(self.still, "a body at rest")
        inhaled = self.body()
        self.viewer.kill()
        self.viewer.communicate()
        self.view(FILES / "moving.exr", "--phase", "breath=0", "--phase", "heart=0")
        self.wait_until(self.still, "a body at rest")
        self.assertGreater(sum(abs(a - b) > 20 for a, b in zip(inhaled, self.body())), 100,
                           "the diaphragm is elsewhere; nothing else differs")

    def test_shows_ecg_and_breath_and_what_is_held(self):
        self.move()
        green = lambda: self.screen().find((90, 220, 120), 970, 200, 300, 130)
        first = self.wait_until(green, "an ECG")
        self.wait_until(lambda: green() != first, "it goes on")
        marks = lambda: len(self.screen().find(XRAYS, 970, 200, 300, 130))
        self.assertEqual(marks(), 0)
        self.do("keydown", "x")
        self.wait_until(lambda: marks() > 20, "marks of exposures")
        self.assertEqual(self.labels(), 0)
        self.do("key", "b")
        one = self.wait_until(self.labels, "breath held")
        self.do("key", "k")
        self.wait_until(lambda: self.labels() > one, "heart arrested")
        self.keep_screen("body-held")
        self.do("key", "b", "k", "period")
        self.wait_until(lambda: 0 < self.labels(), "twice as fast")
        self.do("key", "comma")
        self.wait_until(lambda: self.labels() == 0, "as in a patient who breathes")
        self.do("keyup", "x")
        self.keep_screen("body-monitor")

    def pulses_in(self, seconds):
        """How many pictures come: each has other noise."""
        pictures, end = set(), time.monotonic() + seconds
        while time.monotonic() < end:
            pictures.add(self.screen().region(300, 200, 120, 20))
        return len(pictures)

    def test_gates_exposures_by_the_heart(self):
        self.move()
        self.do("keydown", "x")
        self.frame()
        free = self.pulses_in(3)
        self.do("key", "w")
        self.frame()
        gated = self.pulses_in(4)  # of a beat of 0.8 s to 1 s: four or five, and the one before
        self.assertGreater(free, 8, "a loaded machine draws fewer than 15 a second")
        self.assertTrue(3 <= gated <= 7, gated)
        self.keep_screen("gated")
        # A heart that is arrested elsewhere opens no gate, and that is said.
        self.do("key", "k")
        advice = lambda: self.screen().find(XRAYS, 250, 35, 460, 60)
        self.wait_until(advice, "that the gate never opens")
        self.keep_screen("gate-closed")
        self.assertEqual(self.pulses_in(2), 1)
        self.do("key", "w")
        self.wait_until(lambda: not advice(), "pulses without a gate")
        self.assertGreater(self.pulses_in(2), 3)
        self.do("keyup", "x")

    def test_keeps_the_road_map_where_it_was_taken(self):
        self.move("--phase", "heart=0")
        self.do("key", "e")
        road_map = lambda: self.screen().find(ROAD_MAP, 100, 60, 780, 530)
        first = self.wait_until(road_map, "the road map")
        self.do("key", "t")  # the table stays
        self.do("keydown", "x")
        seen = self.picture()
        self.wait_until(lambda: sum(a != b for a, b in zip(self.picture(), seen)) > 500, "the body moves")
        first = road_map()
        for _ in range(4):
            time.sleep(0.4)
            # The catheter and letters may lie on it; what is seen of it is where it was.
            self.assertLess(len(set(road_map()) ^ set(first)), 0.02 * len(first))
        self.do("key", "m")
        self.wait_until(lambda: not road_map(), "none")
        # Taken again at another phase of the breath it lies elsewhere.
        changed = []

        def is_elsewhere():
            time.sleep(0.3)
            self.do("key", "m")
            self.frame()
            changed.append(len(set(road_map()) ^ set(first)))
            self.do("key", "m")
            self.frame()
            return changed[-1] > 0.1 * len(first)

        self.wait_until(is_elsewhere, "a road map of another phase")
        self.do("keyup", "x")

    # ---- files

    def test_opens_what_is_dropped_and_survives_what_is_damaged(self):
        self.view()
        self.assertNotIn("files", self.session())
        Desktop(self.display).drop(self.window, FILES / "map.exr")
        self.wait_until(lambda: self.session()["style"]["strengths"] == [1, 1, 1, 1], "the map")
        before = self.body()
        Desktop(self.display).drop(self.window, FILES / "damaged.exr")
        Desktop(self.display).drop(self.window, FILES / "truth")
        self.wait_until(lambda: "vessels" in self.session()["files"], "vessels")
        self.assertTrue(self.session()["files"]["map"].endswith("map.exr"))
        self.wait_until(lambda: self.body() != before, "vessels in the picture")

    def test_opens_what_is_dropped_together(self):
        self.view()
        self.frame()
        Desktop(self.display).drop(self.window, FILES / "truth", FILES / "map.basis", FILES / "map.exr")
        self.wait_until(lambda: "map" in self.session().get("files", {}), "the map")
        self.assertEqual(sorted(self.session()["files"]), ["basis", "map", "vessels"])

    def test_refuses_what_is_of_another_scan(self):
        for words in (("--basis", FILES / "other.basis"), ("--scan", FILES / "other.nrrd")):
            ended = subprocess.run([PROGRAM, "view", FILES / "map.exr", *words], env=self.environment,
                                   capture_output=True, text=True, timeout=PATIENCE_S)
            self.assertEqual(ended.returncode, 3)
            self.assertRegex(ended.stderr, "^xraycast: .*map.exr was not cast from .*other.*: .*\n$")
        self.view(FILES / "map.exr", "--basis", FILES / "map.basis")
        self.frame()
        before, message = self.body(), lambda: self.screen().region(10, 400, 380, 300)
        without = message()
        self.type_path(FILES / "other.basis")
        self.wait_until(lambda: message() != without, "a message")
        self.frame()
        self.assertEqual(self.body(), before, "the map that is shown stays")
        self.assertTrue(self.session()["files"]["basis"].endswith("map.basis"))

    def ask(self):
        """Opens the dialogue, with its text marked, so that what is typed takes its place."""
        self.frame()
        before = self.screen().at(640, 400)
        self.do("key", "ctrl+o")
        self.wait_until(lambda: self.screen().at(640, 400) != before, "the dialogue")
        self.do("key", "ctrl+a")

    def type_path(self, path):
        self.ask()
        self.do("type", "--delay", 1, str(path.resolve()))
        self.do("key", "Return")

    def test_takes_the_next_key_after_the_dialogue(self):
        self.view(FILES / "map.exr")
        for answer, file in (("Escape", "map.exr"), ("Return", "damaged.exr")):
            self.ask()
            self.do("type", "--delay", 1, str(FILES.resolve() / file))
            self.do("key", answer, "2")
            self.assertEqual(self.session()["style"]["strengths"], [1, int(answer == "Return"), 1, 1])

    def test_opens_by_name_and_cancels_what_takes_long(self):
        self.view(FILES / "map.exr")
        status = pathlib.Path(f"/proc/{self.viewer.pid}/io")
        read_B = lambda: int(status.read_text().split()[1])
        start_B = read_B()
        self.type_path(FILES / "long.mhd")
        self.wait_until(lambda: read_B() > start_B + 20_000_000, "the scan is being read")
        self.do("key", "Escape")
        settled = [0, 1]

        def has_settled():
            settled.append(read_B())
            time.sleep(0.2)
            return settled[-1] == settled[-2] == settled[-3]

        self.wait_until(has_settled, "the end of reading")
        cpu_s = lambda: sum(map(int, pathlib.Path(f"/proc/{self.viewer.pid}/stat").read_text().split()[13:15])) / 100

        def has_ended():
            before_s = cpu_s()
            time.sleep(1)
            return cpu_s() - before_s < 0.5

        # A kernel that is under way comes to its end; what it made is not taken.
        self.wait_until(has_ended, "the end of the work")
        self.assertNotIn("scan", self.session()["files"])
        self.assertTrue(self.session()["style"]["strengths"])

    def test_projects_a_scan_beside_the_map(self):
        self.view(FILES / "map.exr", "--scan", FILES / "scan.nrrd")
        right = lambda: self.screen().region(900, 250, 100, 100)
        self.do("key", "s")
        first = self.wait_until(lambda: len(set(r := right())) > 20 and r, "the true projection")
        self.drag(1, 700, 400, 150, 0)
        self.wait_until(lambda: right() != first, "the true projection of another angle")

    # ---- the window

    def test_saves_pictures_of_any_size(self):
        self.view(FILES / "map.exr")
        self.do("key", "p")
        self.wait_until(self.pictures, "a picture")
        self.do("windowsize", "--sync", self.window, 700, 500)
        self.wait_until(lambda: self.screen().at(900, 600) == (0, 0, 0), "a smaller window")
        self.session()  # by then it has drawn a frame
        self.do("key", "p")
        self.wait_until(lambda: len(self.pictures()) == 2, "another picture")
        sizes = [struct.unpack(">II", path.read_bytes()[16:24]) for path in self.pictures()]
        self.assertEqual(sizes, [(1280, 720), (700, 500)])
        self.do("key", "p", "p", "p")
        self.wait_until(lambda: len(self.pictures()) == 5, "a picture for each key that is pressed")

    def test_is_killed_while_it_saves(self):
        """What it saves is whole or not there, and the next window that saves removes what a killed one left."""
        session, chance = self.folder / "xraycast-session.json", random.Random(4)
        pending = 0
        for round in range(4):
            self.view(FILES / "map.exr")
            count = len(self.pictures())
            keys = subprocess.Popen(["xdotool", "key", *["p", "ctrl+s"] * 20], env=self.environment)
            self.wait_until(lambda: len(self.pictures()) > count, "a picture")
            time.sleep(chance.uniform(0, 0.2))
            pending += keys.poll() is None
            self.viewer.send_signal(signal.SIGKILL if round % 2 == 0 else signal.SIGTERM)
            self.viewer.communicate()
            keys.wait(PATIENCE_S)
            if session.exists():
                json.loads(session.read_text())
            for path in self.pictures():
                self.assertEqual(path.read_bytes()[-8:], b"IEND\xaeB`\x82", path)
        self.assertGreater(pending, 0, "all keys were pressed before the signals")
        self.assertGreaterEqual(len(self.pictures()), 4)
        before = len(self.pictures())
        self.view(FILES / "map.exr")
        self.do("key", "p")
        self.wait_until(lambda: len(self.pictures()) > before, "a picture")
        self.session()
        self.assertEqual([path.name for path in self.folder.glob(".*")], [])

    def test_ends_when_it_is_closed(self):
        self.view(FILES / "map.exr")
        desk = Desktop(self.display)
        desk.tell(self.window, "WM_PROTOCOLS", desk.atom("WM_DELETE_WINDOW"))
        self.assertEqual(self.viewer.wait(PATIENCE_S), 0)
        self.assertEqual(self.viewer.stderr.read(), "")

    def test_says_that_there_is_no_display(self):
        environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        ended = subprocess.run([PROGRAM, "view", str(FILES / "map.exr")], env=environment, capture_output=True, text=True)
        self.assertEqual(ended.returncode, 1)
        self.assertRegex(ended.stderr, "^xraycast: no display .*\n$")


if __name__ == "__main__":
    if sys.argv[3:] == ["prepare"]:
        prepare()
    else:
        unittest.main(argv=["window_test.py", *(f"Window.{name}" for name in sys.argv[3:])])
