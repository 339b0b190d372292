"""PROGRAM [TEST...]: every command ends soon after a signal, wherever it is, and leaves no file that is not whole."""
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = sys.argv.pop(1)
PROMISED_S = 2
TREE = '{"branches": [{"id": 0, "parent": -1, "points": [[0, 0, -200, 4], [0, 0, 200, 4]]}]}'
PUSH = "time_s,insertion_mm,rotation_deg\n0,0,0\n20,300,90\n"
ENDINGS = {".png": b"IEND\xae\x42\x60\x82", ".gif": b";", ".html": b"</html>\n", ".vtp": b"</VTKFile>\n"}

COMMANDS = {
    "info": "info ct.nrrd",
    "convert": "convert ct.nrrd -o out/ct.nii.gz",
    "series": "convert ct.nrrd -o out/series",
    "phantom": "phantom thorax --size {size} -o out/ct.nrrd --truth out/truth",
    "cast": "cast ct.nrrd --layers 16 -o out/map.exr --preview out/map.png --keep-basis out/map.basis",
    "recast": "recast ct.basis --opacity bilinear -o out/map.exr --preview out/map.png",
    "project": "project ct.nrrd --size 1500x1500 --cone 1000,1500 -o out/p.exr",
    "compare": "compare ct.nrrd map.exr --views 12 --plot out/plot.png --pictures out/pictures",
    "render": "render map.exr --cine 0:360:2 -o out/frames",
    "cine": "render map.exr --cine 0:360:4 -o out/turn.gif",
    "segment": "segment ct.nrrd -o out/vessels --explain out/steps",
    "evidence": "segment angiogram.nrrd -o out/vessels",
    "vessels": "vessels truth/surface.vtp --like ct.nrrd -o out/vessels",
    "motion": "motion ct.nrrd --breath 12 --heart -o out/motion",
    "phases": "motion ct.nrrd inhaled.nrrd --at 1 -o out/motion",
    "moving": "cast ct.nrrd --layers 8 --angles 180 --motion motion/motion.json --keys breath=3 -o out/map.exr --preview out/map.png",
    "register": "register ct.nrrd xray.dcm --search 15,40 -o out/pose.json --overlay out/fits.png",
    "vesselness": "vesselness ct.nrrd -o out/v.nrrd",
    "simulate": "simulate tree.json --device-model cobra-5f --script push.csv -o out/log.csv --map map.exr --cine out/c.gif",
    "export": "export map.exr -o out/page.html",
    "demo": "demo -o out",
}

# What only some of them read, by how its name begins.
INPUTS = {
    "truth/": "phantom thorax --size {size} -o other.nrrd --truth truth",
    "motion/": "phantom thorax --size {size} -o other.nrrd --motion motion",
    "inhaled.nrrd": "phantom thorax --size {size} -o inhaled.nrrd --phase breath=1",
    "xray.dcm": "project ct.nrrd --size 256x256 --cone 1000,1500 -o xray.dcm",
}


def run(words):
    done = subprocess.run([PROGRAM, *words.split(), "--quiet"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def busyness():
    """How many times longer than alone a thread takes, as other programs want the processor too."""
    wall_s, cpu_s = time.monotonic(), time.thread_time()
    while time.thread_time() - cpu_s < 0.1:
        pass
    return (time.monotonic() - wall_s) / (time.thread_time() - cpu_s)


class Signals(unittest.TestCase):
    size, moments = "128x128x180", 2

    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        os.chdir(cls.temporary.name)
        pathlib.Path("tree.json").write_text(TREE)
        pathlib.Path("push.csv").write_text(PUSH)
        run(f"phantom thorax --size {cls.size} -o ct.nrrd")
        run("phantom head --noise 900 --spacing 2 -o angiogram.nrrd")
        run("cast ct.nrrd --layers 16 -o map.exr --keep-basis ct.basis")

    @classmethod
    def tearDownClass(cls):
        os.chdir("/")
        cls.temporary.cleanup()

    def expect_whole_files(self, when):
        for file in pathlib.Path("out").rglob("*"):
            self.assertNotIn(".part", file.name, when)
            if file.suffix in ENDINGS:
                self.assertTrue(file.read_bytes().endswith(ENDINGS[file.suffix]), f"{when}: {file}")

    def start(self, name):
        shutil.rmtree("out", ignore_errors=True)
        os.mkdir("out")
        words = COMMANDS[name].format(size=self.size).split()
        return subprocess.Popen([PROGRAM, *words, "--quiet"], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)

    def interrupt(self, name):
        for begin, command in INPUTS.items():
            if any(word.startswith(begin) for word in COMMANDS[name].split()):
                run(command.format(size=self.size))
        begin = time.monotonic()
        process = self.start(name)
        _, err = process.communicate()
        took_s = time.monotonic() - begin
        self.assertEqual(process.returncode, 0, err)
        for k in range(self.moments):
            number = (signal.SIGTERM, signal.SIGINT)[k % 2]
            at_s = (k + 0.5) / self.moments * took_s
            when = f"{name}: {number.name} after {at_s:.2f} of {took_s:.2f} s"
            process = self.start(name)
            time.sleep(at_s)
            process.send_signal(number)
            begin = time.monotonic()
            before = busyness()
            _, err = process.communicate()
            waited_s = time.monotonic() - begin
            # Before the program's own code runs, the system ends it.
            self.assertIn(process.returncode, (0, 128 + number, -number), f"{when}: {err}")
            # The time on a processor of its own: others' work stretches it as it does that of this thread.
            self.assertLess(waited_s, PROMISED_S * max(before, busyness()), when)
            self.expect_whole_files(when)


class EveryMoment(Signals):
    size, moments = "320x320x448", 10


for command in COMMANDS:
    setattr(Signals, f"test_{command}", lambda self, name=command: self.interrupt(name))

if __name__ == "__main__":
    unittest.main()
