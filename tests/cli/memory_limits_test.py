"""PROGRAM [TEST...]: the program under limits of memory: it is done, or says in one line what is missing."""
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv.pop(1)
MB = 1 << 20
# From what `info` can start with to more than most need.
FEW_MB = (128, 256, 384, 512, 640, 1024)
MANY_MB = (*range(96, 800, 16), *range(800, 2049, 96))
GROUPS = pathlib.Path("/sys/fs/cgroup")


def run(words, before=None):
    """A hang is a failure too."""
    return subprocess.run([PROGRAM, *words.split(), "--quiet"], capture_output=True, text=True, timeout=250,
                          preexec_fn=before)


def limit_address_space(limit_mb):
    return lambda: resource.setrlimit(resource.RLIMIT_AS, (limit_mb * MB, limit_mb * MB))


class Group:
    """A control group of this test's own, of either version, with a limit of memory and without swap."""

    def __init__(self, limit_mb):
        version_2 = (GROUPS / "cgroup.controllers").exists()
        self.folder = (GROUPS if version_2 else GROUPS / "memory") / f"xraycast-test-{os.getpid()}"
        self.folder.mkdir()
        (self.folder / ("memory.max" if version_2 else "memory.limit_in_bytes")).write_text(str(limit_mb * MB))

    def enter(self):
        (self.folder / "cgroup.procs").write_text(str(os.getpid()))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.folder.rmdir()


def can_make_groups():
    try:
        with Group(64):
            return True
    except OSError:
        return False


class MemoryLimits(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        os.chdir(cls.temporary.name)
        for words in ("phantom thorax --size 128x128x128 -o ct.nrrd", "cast ct.nrrd --layers 4 -o map.exr"):
            done = run(words)
            assert done.returncode == 0, done.stderr

    @classmethod
    def tearDownClass(cls):
        os.chdir("/")
        cls.temporary.cleanup()

    def expect_done_or_one_line(self, done, when):
        self.assertIn(done.returncode, (0, 1, 4), f"{when}: {done.stderr}")
        if done.returncode != 0:
            self.assertRegex(done.stderr, r"\Axraycast: [^\n]*(memory|ulimit)[^\n]*\n\Z", when)

    def sweep(self, words, least_mb, done_mb, limits_mb=FEW_MB):
        """Done from `done_mb` on; from `least_mb` on it starts, which the loader needs memory for, too."""
        for limit_mb in limits_mb:
            if limit_mb < least_mb:
                continue
            when = f"{words} with {limit_mb} MB"
            done = run(words, limit_address_space(limit_mb))
            self.expect_done_or_one_line(done, when)
            if limit_mb >= done_mb:
                self.assertEqual(done.returncode, 0, f"{when}: {done.stderr}")

    # Each `done_mb` has the share above what is needed here that a machine of 16 cores takes for its threads.
    def test_info(self):
        self.sweep("info ct.nrrd", 128, 256)

    def test_cast(self):
        self.sweep("cast ct.nrrd -o cast.exr", 128, 1024)

    def test_project(self):
        self.sweep("project ct.nrrd -o project.png", 128, 1024)

    def test_segment(self):
        self.sweep("segment ct.nrrd -o vessels", 128, 2048)

    def test_render(self):
        self.sweep("render map.exr -o render.png", 128, 1024)

    def test_pictures_larger_than_memory(self):
        for words in ("render map.exr -o large.png --size 16384x16384",
                      "project ct.nrrd -o large.exr --size 16384x16384"):
            done = run(words, limit_address_space(1000))
            self.assertIn(done.returncode, (1, 3, 4))
            self.assertRegex(done.stderr, r"\Axraycast: [^\n]*memory[^\n]*\n\Z")

    def test_a_control_group(self):
        if not can_make_groups():
            self.skipTest("control groups can be made by root alone, and not in every container")
        for limit_mb in (64, 96, 128, 192, 256, 512):
            for words in ("info ct.nrrd", "cast ct.nrrd -o cast.exr", "render map.exr -o render.png",
                          "segment ct.nrrd -o vessels"):
                with Group(limit_mb) as group:
                    done = run(words, group.enter)
                when = f"{words} in a group of {limit_mb} MB"
                self.expect_done_or_one_line(done, when)
                if limit_mb == 512 or words.startswith("info"):
                    self.assertEqual(done.returncode, 0, f"{when}: {done.stderr}")


class EveryLimit(MemoryLimits):
    """A finer sweep, which takes minutes."""

    def sweep(self, words, least_mb, done_mb, limits_mb=MANY_MB):
        super().sweep(words, least_mb, done_mb, limits_mb)


if __name__ == "__main__":
    unittest.main()
