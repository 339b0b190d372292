"""xraycast-cohort from outside, on workers of this machine."""
import json
import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest
import xraycast as xc


def records(out):
    return [json.loads(line) for line in open(out / "ledger.jsonl")]


@pytest.fixture(scope="module")
def first_run(cohort, phantoms, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    return out, cohort("run", phantoms, "-o", out, "--steps", "info,cast", "--layers", 2, "--workers", 2)


def test_every_scan_has_a_line(first_run):
    out, result = first_run
    assert result.returncode == 1  # two scans are bad
    assert result.stderr == f"xraycast-cohort: 4 of 6 scans done, 2 bad; {out}/ledger.jsonl tells why\n"
    lines = {record["scan"]: record for record in records(out)}
    assert len(records(out)) == len(lines) == 6
    assert {name for name, record in lines.items() if record["error"]} == {"cut.nrrd", "text.nrrd"}
    assert lines["cut.nrrd"]["error"]["class"] == "InputError" and "truncated" in lines["cut.nrrd"]["error"]["line"]
    good = lines["more/d.nrrd"]
    assert good["version"] == xc.__version__ and good["worker"].startswith("tcp://")
    assert set(good["seconds"]) == {"fetch", "read", "info", "cast"}
    assert good["outputs"] == [f"scans/more+d.nrrd/{name}" for name in ("info.json", "map.exr", "map.png")]


def test_outputs_are_those_of_the_package(first_run, phantoms):
    out, _ = first_run
    body = xc.BodyMap.read(out / "scans/a.nrrd/map.exr")
    expected = xc.open(phantoms / "a.nrrd").cast(layers=2)
    assert abs(body.tau - expected.tau).max() <= 1e-3 * expected.tau.max()  # half floats in the file
    assert json.loads((out / "scans/a.nrrd/info.json").read_text())["size"] == [24, 32, 32]
    assert not (out / "unfinished").exists()


def test_another_run_does_what_is_missing(first_run, cohort, phantoms):
    out, _ = first_run
    before = records(out)
    again = ("run", phantoms, "-o", out, "--steps", "info,cast", "--layers", 2, "--workers", 2)
    assert "4 of 6 scans done (4 before), 2 bad" in cohort(*again).stderr
    assert records(out) == before
    os.rename(out / "scans/b.nrrd", out / "scans/moved")
    cohort(*again)
    assert [record["scan"] for record in records(out)[6:]] == ["b.nrrd"]
    cohort(*again, "--again")
    assert sorted(record["scan"] for record in records(out)[7:]) == ["cut.nrrd", "text.nrrd"]


def test_bad_input_is_one_line(cohort, phantoms, tmp_path):
    for arguments, status, reason in [
            (("run", tmp_path / "none", "-o", tmp_path / "out"), 3, "none: no such folder"),
            (("run", phantoms, "-o", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:9"), 3, "no scheduler answers"),
            (("run", phantoms, "-o", tmp_path / "out", "--steps", "wash"), 3, "--steps wash: must be of info, cast"),
            (("run", phantoms, "-o", tmp_path / "out", "--opacity", "none.json"), 3, "--opacity none.json: No such file"),
            (("run", phantoms, "-o", phantoms / "text.nrrd"), 1, "give a folder that can be written")]:
        result = cohort(*arguments)
        assert (result.returncode, result.stderr.count("\n")) == (status, 1), result.stderr
        assert result.stderr.startswith("xraycast-cohort: ") and reason in result.stderr
    assert cohort("run", phantoms).returncode == 2
    assert cohort("run", phantoms, "-o", tmp_path, "--workers", "0").returncode == 2


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_cleanly(phantoms, tmp_path, number):
    process = subprocess.Popen([sys.executable, "-m", "xraycast.cohort", "run", phantoms, "-o", tmp_path, "--workers", "1"],
                               stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + 60
    while not (tmp_path / "ledger.jsonl").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(1)
    os.killpg(process.pid, number) if number == signal.SIGINT else process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert errors == f"xraycast-cohort: stopped by {number.name}; run again to do what is missing\n"
    with pytest.raises(ProcessLookupError):  # no worker is left
        for _ in range(100):
            os.killpg(process.pid, 0)
            time.sleep(0.05)


def test_threads_are_limited():
    code = ("import os, xraycast as xc; from xraycast.cohort.threads import limit_threads; limit_threads(1);"
            "xc.phantom('sphere', spacing_mm=8).cast(); print(len(os.listdir('/proc/self/task')))")
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    # Python's own, PoCL's one, and those of a call; with all cores of a large machine there would be one for each.
    assert int(result.stdout) <= 8 + (pathlib.Path("/proc").exists() and 0), result.stderr
