"""xraycast-cohort from outside, on workers of this machine."""
import json
import os
import signal
import subprocess
import sys
import time

import pytest
import xraycast as xc
from xraycast.cohort.cli import main


def records(out):
    return [json.loads(line) for line in open(out / "ledger.jsonl")]


@pytest.fixture
def restored_signals():
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    [signal.signal(number, handler) for number, handler in handlers.items()]


@pytest.fixture(scope="module")
def first_run(cohort, phantoms, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    return out, cohort("run", phantoms, "-o", out, "--steps", "info,cast", "--layers", 2, "--workers", 2)


def test_every_scan_has_a_line(first_run):
    out, result = first_run
    assert result.returncode == 1  # two scans are bad
    assert result.stderr == f"xraycast-cohort: 4 of 6 scans done, 2 bad; {out}/ledger.jsonl gives the reasons\n"
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
    cohort(*again, "--again")
    assert sorted(record["scan"] for record in records(out)[6:]) == ["b.nrrd", "cut.nrrd", "text.nrrd"]


@pytest.mark.parametrize("arguments, status, reason", [
    (("run", "{scans}/none", "-o", "{out}"), 3, "none: no such folder"),
    (("run", "{scans}", "-o", "{out}", "--scheduler", "tcp://127.0.0.1:9"), 3, "no scheduler answers"),
    (("run", "{scans}", "-o", "{out}", "--scheduler", "nonsense://x"), 3, "not an address"),
    (("run", "{scans}", "-o", "{out}", "--steps", "wash"), 3, "--steps wash: unknown step; choose from info, cast"),
    (("run", "{scans}", "-o", "{out}", "--opacity", "none.json"), 3, "--opacity none.json: No such file"),
    (("run", "{scans}", "-o", "{out}", "--opacity", "none"), 3, "none"),
    (("run", "{scans}", "-o", "{out}", "--poses", "{scans}/text.nrrd"), 3, "must have the columns lao and cranial"),
    (("run", "{scans}", "-o", "{out}", "--catheter", "cobra-5f"), 3, "give --steps segment,frames"),
    (("report", "{scans}"), 3, "has no ledger.jsonl"),
    (("run", "{scans}", "-o", "{scans}/text.nrrd"), 1, "give a folder that can be written")])
def test_bad_input_is_one_line(phantoms, tmp_path, capsys, monkeypatch, restored_signals, arguments, status, reason):
    monkeypatch.setattr("xraycast.cohort.cluster.ANSWER_S", 1)
    assert main([argument.format(scans=phantoms, out=tmp_path) for argument in arguments]) == status
    errors = capsys.readouterr().err
    assert errors.startswith("xraycast-cohort: ") and reason in errors and errors.count("\n") == 1


@pytest.mark.parametrize("arguments", [("run", "x"), ("run", "x", "-o", "y", "--workers", "0"), ("run", "x", "-o", "y", "--part", "2/2"),
                                       ("run", "x", "-o", "y", "--resources", "GPU"), ("run", "x", "-o", "y", "--size", "9")])
def test_wrong_usage_is_told(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_cleanly(phantoms, tmp_path, number):
    # Maps so large that the run lasts until the signal comes.
    process = subprocess.Popen([sys.executable, "-m", "xraycast.cohort", "run", phantoms, "-o", tmp_path, "--workers", "1",
                                "--angles", "3600", "--layers", "256"], stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + 60
    while not (tmp_path / "ledger.jsonl").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(2)
    os.killpg(process.pid, number) if number == signal.SIGINT else process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert errors == f"xraycast-cohort: stopped by {number.name}; run again to process the remaining scans\n"
    with pytest.raises(ProcessLookupError):  # no worker is left
        for _ in range(100):
            os.killpg(process.pid, 0)
            time.sleep(0.05)


@pytest.mark.skipif(os.cpu_count() == 1, reason="one core needs no limit")
def test_threads_are_limited():
    def threads(limit):
        code = (f"import os, xraycast as xc; from xraycast.cohort.threads import limit_threads; {limit};"
                "xc.phantom('sphere', spacing_mm=8).cast(); print(len(os.listdir('/proc/self/task')))")
        return int(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60).stdout)

    assert threads("limit_threads(1)") < threads("pass")
