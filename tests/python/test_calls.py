"""What all long calls have in common: progress, cancelling, threads, errors."""
import multiprocessing
import os
import pathlib
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import xraycast as xc

ROOT = pathlib.Path(__file__).resolve().parents[2]


def run_python(code, **environment):
    return subprocess.run([sys.executable, "-c", code], env={**os.environ, **environment}, capture_output=True, text=True,
                          timeout=120)


def test_progress_is_told(tmp_path, body):
    body.write(tmp_path / "scan.nrrd")
    told = []
    xc.open(tmp_path / "scan.nrrd", progress=lambda fraction, stage: told.append((fraction, stage)))
    assert "reading" in {stage for _, stage in told} and all(0 <= fraction <= 1 for fraction, _ in told)


def test_tqdm_is_told(body):
    class Bar:  # what is used of tqdm
        total, n, closed = None, 0, False

        def set_description(self, text, refresh=True):
            self.text = text

        def refresh(self):
            made.append((self.text, self.n, self.total))

        def close(self):
            self.closed = True

    made = []
    body.cast(layers=2, progress=Bar)
    body.cast(layers=2, progress=(bar := Bar()))
    assert any(text == "casting" for text, _, _ in made) and not bar.closed


def test_an_exception_of_the_listener_cancels():
    def refuse(fraction, stage):
        raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        xc.phantom("thorax", progress=refuse)


def test_ctrl_c_cancels():
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        for _ in range(100):
            xc.phantom("thorax", spacing_mm=1)
    assert time.monotonic() - start < 20  # the call that ran ends at its next slice
    assert xc.phantom("sphere", spacing_mm=8).hu.max() == 0  # and the next one works


def test_ctrl_c_stops_a_catheter(tmp_path):
    file = tmp_path / "tree.json"
    points = ", ".join(f"[0, 0, {z}, 5]" for z in range(0, 301, 5))
    file.write_text('{"branches": [{"id": 0, "parent": -1, "points": [%s]}]}' % points)
    run = xc.Catheter(xc.VesselTree.read(file), "cobra-5f")
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        run.step(push_mm=200, ms=3_000_000)


def test_other_threads_run_meanwhile(body):
    counts, done = [0], threading.Event()

    def count():
        while not done.is_set():
            counts[0] += 1
            time.sleep(1e-3)

    thread = threading.Thread(target=count)
    thread.start()
    start = time.monotonic()
    while time.monotonic() - start < 0.5:
        body.cast(layers=16, angles=720)
    done.set()
    thread.join()
    assert counts[0] > 50  # with the interpreter's lock held it would get its turn some ten times


def test_calls_of_several_threads_wait_for_each_other(body):
    expected = body.project(lao=30).tau
    results = [None] * 4
    threads = [threading.Thread(target=lambda i=i: results.__setitem__(i, body.project(lao=30).tau)) for i in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert all(np.array_equal(result, expected) for result in results)


def test_errors_are_what_python_expects():
    assert issubclass(xc.InputError, ValueError) and issubclass(xc.DeviceError, RuntimeError)
    assert issubclass(xc.InputError, xc.Error) and issubclass(xc.DeviceError, xc.Error)


def test_a_missing_device_is_named():
    result = run_python("import xraycast as xc\ntry: xc.phantom('box')\nexcept xc.DeviceError as e: print(e)",
                        XRAYCAST_DEVICE="no-such-device")
    assert "no OpenCL device matches 'no-such-device'" in result.stdout and result.stdout.count("\n") == 1


def _in_a_fork(queue):
    try:
        xc.phantom("box", spacing_mm=16)
        queue.put("it worked")
    except xc.DeviceError as error:
        queue.put(str(error))


def test_a_forked_process_is_told_to_be_spawned(body):
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(target=_in_a_fork, args=(queue,))
    process.start()
    assert "spawn" in queue.get(timeout=60)
    process.join()
    assert process.exitcode == 0


FORK_WHILE_BUSY = """
import os, sys, threading, time, xraycast as xc
body = xc.phantom('thorax', spacing_mm=4)
map_ = body.cast(layers=2)
{first}
def go_on():
    while True: {call}
threading.Thread(target=go_on, daemon=True).start()
time.sleep(0.3)
child = os.fork()
if child == 0:
    try: {call}
    except xc.Error as error: print(error)
    sys.exit(0)
print('child', os.waitpid(child, 0)[1], flush=True)
os._exit(0)
"""


@pytest.mark.parametrize("call", ["body.cast(layers=16)", "map_.render(lao=30)", "xc.devices()"])
def test_a_fork_while_a_thread_computes_is_told(call):
    result = run_python(FORK_WHILE_BUSY.format(first=call, call=call))
    assert "spawn" in result.stdout and "child 0" in result.stdout, result.stderr


def test_a_forked_process_leaves_the_kernels():
    code = """
import ctypes, os, sys, xraycast as xc
xc.phantom('box', spacing_mm=8)
getenv = ctypes.CDLL(None).getenv
getenv.restype = ctypes.c_char_p
folder = getenv(b'POCL_CACHE_DIR')
child = os.fork()
if child == 0: sys.exit(0)
print(os.waitpid(child, 0)[1], os.path.isdir(folder), folder.decode())
"""
    environment = {name: value for name, value in os.environ.items() if name != "POCL_CACHE_DIR"}
    environment.update(HOME="/dev/null", XDG_CACHE_HOME="/dev/null")
    result = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120)
    status, is_there, folder = result.stdout.split()
    assert (status, is_there) == ("0", "True") and not os.path.exists(folder)


def test_choosing_a_device_waits_without_the_interpreters_lock(body):
    counts, done = [0], threading.Event()

    def count():
        while not done.is_set():
            counts[0] += 1
            time.sleep(1e-3)

    def cast():
        while not done.is_set():
            body.cast(layers=16, angles=720)

    threads = [threading.Thread(target=count), threading.Thread(target=cast)]
    [thread.start() for thread in threads]
    start, longest = time.monotonic(), 0
    while time.monotonic() - start < 0.5:
        before, called = counts[0], time.monotonic()
        xc.use_device("")
        waited = time.monotonic() - called
        if waited > longest:
            longest, counted = waited, counts[0] - before
    done.set()
    [thread.join() for thread in threads]
    # With the interpreter's lock held nothing is counted while it waits, which takes a cast.
    assert counted > 100 * longest - 1


def test_the_interpreter_exits_cleanly():
    result = run_python("import xraycast as xc\nb = xc.phantom('box', spacing_mm=8).cast(layers=2)\nb.render(lao=30)\nprint('drawn')")
    assert (result.returncode, result.stdout, result.stderr) == (0, "drawn\n", "")


# From sources, an import of numpy takes longer than the threads have.
@pytest.mark.parametrize("is_compiled", [True, False])
@pytest.mark.parametrize("call", ["body.cast(layers=16, angles=720)", "map_.render(lao=30)", "run.step(ms=3_000_000)"])
def test_the_interpreter_exits_while_daemon_threads_compute(tmp_path, call, is_compiled):
    file = tmp_path / "tree.json"
    points = ", ".join(f"[0, 0, {z}, 5]" for z in range(0, 301, 5))
    file.write_text('{"branches": [{"id": 0, "parent": -1, "points": [%s]}]}' % points)
    result = run_python(f"""
import threading, time, xraycast as xc
body = xc.phantom('thorax', spacing_mm=4)
map_ = body.cast(layers=2)
run = xc.Catheter(xc.VesselTree.read({str(file)!r}), 'cobra-5f')
def go_on():
    while True: {call}
for _ in range(3): threading.Thread(target=go_on, daemon=True).start()
time.sleep(0.3)
print('ends')
""", **({} if is_compiled else {"PYTHONPYCACHEPREFIX": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}))
    assert (result.returncode, result.stdout) == (0, "ends\n"), result.stderr
    assert "terminate" not in result.stderr


def test_the_last_news_is_told():
    told = []

    def listen(fraction, stage):
        told.append(fraction)
        time.sleep(0.3)  # in which the work ends

    xc.phantom("box", spacing_mm=8, progress=listen)
    assert told[-1] == 1


def test_closing_a_bar_does_not_replace_an_exception():
    class Bar:
        total, n = None, 0

        def set_description(self, text, refresh=True):
            raise KeyError("enough")

        def close(self):
            raise OSError("closed")

    with pytest.raises(KeyError, match="enough"):
        xc.phantom("box", spacing_mm=8, progress=Bar)


def test_importing_is_quick_and_light():
    result = run_python("import sys, xraycast; print('numpy' in sys.modules)")
    assert result.stdout == "False\n"


def test_the_version_is_the_projects():
    version = re.search(r"project\(xraycast VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text())[1]
    assert xc.__version__ == version


def test_types_are_shipped():
    package = pathlib.Path(xc.__file__).parent
    stub = (package / "_core.pyi").read_text()
    compile(stub, "_core.pyi", "exec")
    assert (package / "py.typed").exists()
    for name in ("class Scan", "def project", "def cast_basis", "class Catheter", "def open"):
        assert name in stub
    assert stub.count(") -> Frame | Frames:") == 2
    assert all(getattr(xc, name).__doc__ for name in xc.__all__)
