"""The folders of the sources against rooms.txt: run as `rooms_test.py REPOSITORY`."""
import pathlib
import re
import sys
import unittest

ROOT = pathlib.Path(sys.argv.pop(1))
MAX_LINES = 4000  # what one can still read in a day
LIBRARIES = ("host", "segmentation", "simulation", "viewer", "python")


def read_rooms():
    """{room: its private headers}, from the ground up."""
    rooms = {}
    for line in (ROOT / "rooms.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            room, _, private = line.partition(":")
            rooms[room] = private.split()
    return rooms


ROOMS = read_rooms()
ORDER = list(ROOMS)


def sources(room):
    return [f for f in (ROOT / room).iterdir() if f.suffix in (".cpp", ".hpp", ".h", ".cl")]


def headers():
    """{as it is included: (room, file)}."""
    found = {}
    for room in ROOMS:
        for file in sources(room):
            if file.suffix in (".hpp", ".h"):
                found["/".join(file.relative_to(ROOT).parts[1:])] = (room, file)
    return found


HEADERS = headers()


def includes(file):
    """The project's own headers that a file includes."""
    names = re.findall(r'^#include "([^"]+)"', file.read_text(), re.MULTILINE)
    return [name for name in names if name in HEADERS]


def is_private(name):
    room, file = HEADERS[name]
    return file.stem in ROOMS[room]


class Rooms(unittest.TestCase):
    def test_every_source_lies_in_a_room(self):
        listed = {ROOT / room for room in ROOMS}
        for library in LIBRARIES:
            for file in (ROOT / library).rglob("*.[ch]pp"):
                self.assertIn(file.parent, listed, f"{file.relative_to(ROOT)}: its folder is not in rooms.txt")

    def test_no_include_points_upwards(self):
        for room in ROOMS:
            for file in sources(room):
                for name in includes(file):
                    below = HEADERS[name][0]
                    self.assertLessEqual(ORDER.index(below), ORDER.index(room), f"{file.relative_to(ROOT)} includes {name}")

    def test_no_public_header_includes_a_private_one(self):
        for name, (room, file) in HEADERS.items():
            for included in [] if is_private(name) else includes(file):
                self.assertFalse(is_private(included), f"{file.relative_to(ROOT)} includes {included}")

    def test_private_headers_stay_in_their_library(self):
        for room in ROOMS:
            for file in sources(room):
                for name in includes(file):
                    if is_private(name):
                        library = HEADERS[name][0].split("/")[0]
                        self.assertEqual(room.split("/")[0], library, f"{file.relative_to(ROOT)} includes {name}")

    def test_sampling_and_scene_are_free_of_opengl(self):
        for room in ("viewer/xraycast/sampling", "viewer/xraycast/scene"):
            for file in sources(room):
                self.assertNotRegex(file.read_text(), "#include <(epoxy|GL|GLFW|EGL|imgui)", file.relative_to(ROOT))

    def test_private_headers_exist(self):
        for room, private in ROOMS.items():
            for name in private:
                self.assertTrue((ROOT / room / f"{name}.hpp").exists(), f"rooms.txt: {room} has no {name}.hpp")

    def test_no_room_is_too_large(self):
        for room in ROOMS:
            lines = sum(len(file.read_text().splitlines()) for file in sources(room))
            self.assertLessEqual(lines, MAX_LINES, f"{room}: {lines} lines; part it")


if __name__ == "__main__":
    unittest.main()
