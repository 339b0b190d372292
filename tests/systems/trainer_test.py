"""PROGRAM LIBRARY NODE: the simulation of a page that steers by itself, in Node's WebAssembly, against the native one of the
library for C, step by step along scripts of 10 s."""
import array
import ctypes
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAM, LIBRARY, NODE = sys.argv[1:4]
del sys.argv[1:4]
NUMBERS = 5  # of a hub's pose
TRACE = pathlib.Path(__file__).with_name("trainer_trace.mjs")


class Setup(ctypes.Structure):
    _fields_ = [("tree_file", ctypes.c_char_p), ("branches", ctypes.c_void_p), ("branch_count", ctypes.c_size_t),
                ("instruments", ctypes.POINTER(ctypes.c_char_p)), ("instrument_count", ctypes.c_size_t),
                ("entry_mm", ctypes.c_void_p), ("step_s", ctypes.c_double)]


class Device(ctypes.Structure):
    _fields_ = [("balloon_bar", ctypes.c_double), ("balloon_mm", ctypes.c_double), ("sheath_mm", ctypes.c_double), ("carried_rings", ctypes.c_int)]


class Tip(ctypes.Structure):
    _fields_ = [("position_mm", ctypes.c_double * 3), ("direction", ctypes.c_double * 3), ("branch", ctypes.c_int),
                ("arc_length_mm", ctypes.c_double)]


def native_trace(tree, instruments, poses):
    """As trainer_trace.mjs."""
    library = ctypes.CDLL(LIBRARY)
    names = (ctypes.c_char_p * len(instruments))(*(name.encode() for name in instruments))
    setup = Setup(str(tree).encode(), None, 0, names, len(instruments), None, 0)
    simulation, trace = ctypes.c_void_p(), array.array("d")
    assert library.xrc_create(ctypes.byref(setup), ctypes.byref(simulation)) == 0
    width, tip, load, device = NUMBERS * len(instruments), Tip(), (ctypes.c_double * 2)(), Device()
    widest_mm = 0
    for at in range(0, len(poses), width):
        moves = [value for hub in range(at, at + width, NUMBERS) for value in poses[hub:hub + 2]]
        hubs = (ctypes.c_double * len(moves))(*moves)
        for instrument, hub in enumerate(range(at, at + width, NUMBERS)):
            assert library.xrc_inflate(simulation, ctypes.c_size_t(instrument), ctypes.c_double(poses[hub + 2])) == 0
            assert library.xrc_draw_sheath(simulation, ctypes.c_size_t(instrument), ctypes.c_double(poses[hub + 3])) == 0
        assert library.xrc_step(simulation, hubs, ctypes.c_size_t(len(instruments))) == 0
        for instrument in range(len(instruments)):
            library.xrc_get_tip(simulation, ctypes.c_size_t(instrument), ctypes.byref(tip))
            library.xrc_get_load(simulation, ctypes.c_size_t(instrument), load)
            trace.extend([*tip.position_mm, *load])
            library.xrc_get_device(simulation, ctypes.c_size_t(instrument), ctypes.byref(device))
            widest_mm = max(widest_mm, device.balloon_mm)
    library.xrc_destroy(simulation)
    return trace, widest_mm


def script(rows):
    """Poses every millisecond, linear between rows of a time and, for each hub, an insertion, a rotation in degrees, a pressure, a
    sheath's way and coils to be detached."""
    poses = array.array("d")
    for (from_s, *a), (to_s, *b) in zip(rows, rows[1:]):
        steps = round(1000 * (to_s - from_s))
        for k in range(1, steps + 1):
            for i, (start, end) in enumerate(zip(a, b)):
                value = start + (end - start) * k / steps
                poses.append(math.radians(value) if i % NUMBERS == 1 else value)
    return poses


def moved(*rows):
    """Without balloons and sheaths."""
    return [(time_s, *(value for hub in range(0, len(hubs), 2) for value in (*hubs[hub:hub + 2], 0, 0, 0))) for time_s, *hubs in rows]


ONE = moved((0, 0, 0), (1, 40, 180), (6, 420, 180), (8, 380, 540), (10, 470, 540))
PAIR = moved((0, 0, 0, 0, 0), (4, 0, 0, 330, 90), (8, 260, 90, 330, 90), (10, 300, 200, 280, 0))
BALLOON = [(0, 0, 0, 0, 0, 0), (5, 250, 90, 0, 0, 0), (7, 250, 90, 10, 0, 0), (8, 250, 90, 10, 0, 0), (9, 250, 90, 0, 0, 0), (10, 150, 90, 0, 0, 0)]
SHEATH = [(0, 0, 0, 0, 0, 0), (5, 250, 90, 0, 0, 0), (9, 250, 90, 0, 42.4, 0), (10, 150, 90, 0, 42.4, 0)]


class Trainer(unittest.TestCase):
    def compare(self, instruments, rows):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            words = [word for name in instruments for word in ("--device-model", name)]
            run = lambda *words: subprocess.run([*map(str, words)], check=True, capture_output=True, text=True, timeout=600).stdout
            run(PROGRAM, "phantom", "thorax", "--size", "96x96x120", "-o", folder / "thorax.nrrd", "--truth", folder / "truth")
            run(PROGRAM, "cast", folder / "thorax.nrrd", "-o", folder / "map.exr", "--layers", "2")
            run(PROGRAM, "export", folder / "map.exr", "--vessels", folder / "truth", "--live", *words, "-o", folder / "trainer.html")
            poses, page = script(rows), array.array("d")
            (folder / "poses").write_bytes(poses.tobytes())
            step_ms = float(run(NODE, TRACE, folder / "trainer.html", folder / "poses", folder / "trace"))
            page.frombytes((folder / "trace").read_bytes())
            native, self.widest_mm = native_trace(folder / "truth" / "tree.vtp", instruments, poses)
        self.assertEqual(len(page), len(native))
        apart = [abs(a - b) for a, b in zip(page, native)]
        tips_mm, forces_N = max(x for i, x in enumerate(apart) if i % 5 < 3), max(apart[3::5])
        same = next((i // (5 * len(instruments)) for i, x in enumerate(apart) if x != 0), len(poses))
        print(f"{' and '.join(instruments)}: tips within {tips_mm:.3g} mm, forces {forces_N:.3g} N, torques {max(apart[4::5]):.3g} N m; "
              f"equal up to step {same}; {step_ms:.3f} ms a step in Node", flush=True)
        self.assertGreater(max(abs(native[-5 + i] - native[i]) for i in range(3)), 100)  # it went somewhere
        self.assertLess(tips_mm, 1e-6)
        self.assertLess(forces_N, 1e-6)

    def test_one_catheter(self):
        self.compare(["cobra-5f"], ONE)

    def test_a_stent_on_a_balloon(self):
        self.compare(["stent-6x18"], BALLOON)
        self.assertGreater(self.widest_mm, 5.5)

    def test_a_stent_in_a_sheath(self):
        self.compare(["stent-self-8x40"], SHEATH)

    def test_a_wire_in_a_catheter(self):
        self.compare(["cobra-5f", "guidewire-035-j"], PAIR)


if __name__ == "__main__":
    unittest.main()
