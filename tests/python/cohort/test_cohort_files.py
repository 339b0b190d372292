"""The ledger, the lock, outputs that appear whole, and the cache."""
import json
import multiprocessing
import os

import fsspec
import pytest
import xraycast as xc
from xraycast.cohort.ledger import Ledger, read_ledger
from xraycast.cohort.lock import RunLock
from xraycast.cohort.manifest import CohortScan
from xraycast.cohort.outputs import finished_record, publish, unfinished_folder
from xraycast.cohort.source import local_files

LINE = {"scan": "a", "hash": "1", "error": None}
SCAN = CohortScan("a", "/a")


def append_many(path, name, count):
    ledger = Ledger(path)
    for number in range(count):
        ledger.append({**LINE, "scan": name, "number": number, "filling": "x" * 5000})  # more than a pipe takes at once
    ledger.close()


def test_lines_of_several_processes_are_whole(tmp_path):
    path = tmp_path / "ledger.jsonl"
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=append_many, args=(path, name, 200)) for name in "abc"]
    [process.start() for process in processes]
    [process.join() for process in processes]
    records = list(read_ledger(path))
    for name in "abc":
        assert [record["number"] for record in records if record["scan"] == name] == list(range(200))


@pytest.mark.parametrize("torn", [b'{"scan": "b"', b"x" * 10000])
def test_a_line_that_was_cut_off_is_removed(tmp_path, torn):
    path = tmp_path / "ledger.jsonl"
    Ledger(path).append(LINE)
    with open(path, "ab") as file:
        file.write(torn)
    assert list(read_ledger(path)) == [LINE]
    Ledger(path).append({**LINE, "scan": "c"})
    assert [record["scan"] for record in read_ledger(path)] == ["a", "c"]
    assert len([json.loads(line) for line in open(path)]) == 2


@pytest.mark.parametrize("line", [
    "nonsense", "[]", "null", '{"scan": "a"}', '{"scan": 1, "hash": "1", "error": null}', '{"scan": "a", "hash": "1"}',
    '{"scan": "a", "hash": "1", "error": {}}', '{"scan": "a", "hash": "1", "error": null, "seconds": {"read": "<b>"}}',
    '{"scan": "a", "hash": "1", "error": null, "outputs": [1]}', '{"scan": "a", "hash": {}, "error": null}'])
def test_a_line_that_is_no_record_is_named(tmp_path, line):
    path = tmp_path / "ledger.jsonl"
    path.write_text(json.dumps(LINE) + f"\n{line}\n")
    with pytest.raises(xc.InputError, match="line 2: not a record"):
        list(read_ledger(path))


def test_two_runs_on_one_folder_exclude_each_other(tmp_path):
    first = RunLock(tmp_path)
    with pytest.raises(xc.InputError, match=f"another run writes to this folder .process {os.getpid()} on"):
        RunLock(tmp_path)
    with pytest.raises(xc.InputError, match="another run"):
        RunLock(tmp_path, (0, 2))
    first.close()
    RunLock(tmp_path).close()


def test_parts_run_side_by_side_but_not_twice(tmp_path):
    parts = [RunLock(tmp_path, (0, 2)), RunLock(tmp_path, (1, 2))]
    with pytest.raises(xc.InputError, match="lock-1-of-2: another run"):
        RunLock(tmp_path, (1, 2))
    with pytest.raises(xc.InputError, match="another run"):
        RunLock(tmp_path)
    [part.close() for part in parts]


def write_output(out, hash_, text):
    with unfinished_folder(out) as folder:
        (folder / "map.txt").write_text(text)
        return publish(folder, out, SCAN, {"scan": "a", "hash": hash_, "text": text})


def test_outputs_appear_with_their_record(tmp_path):
    record = write_output(tmp_path, "1", "first")
    assert record["outputs"] == ["scans/a/map.txt"]
    assert finished_record(tmp_path, SCAN, "1") == record and finished_record(tmp_path, SCAN, "2") is None
    assert os.listdir(tmp_path / "unfinished") == []


@pytest.mark.parametrize("text", ["", "[]", "null", "no", "\udcff"])
def test_outputs_with_a_damaged_record_are_made_again(tmp_path, text):
    write_output(tmp_path, "1", "first")
    (tmp_path / "scans/a/record.json").write_text(text, errors="surrogateescape")
    assert finished_record(tmp_path, SCAN, "1") is None
    assert write_output(tmp_path, "1", "second")["text"] == "second"


def test_of_two_attempts_the_first_counts(tmp_path):
    write_output(tmp_path, "1", "first")
    assert write_output(tmp_path, "1", "second")["text"] == "first"
    assert (tmp_path / "scans/a/map.txt").read_text() == "first"


def test_outputs_of_other_options_are_replaced(tmp_path):
    write_output(tmp_path, "1", "first")
    assert write_output(tmp_path, "2", "second")["text"] == "second"
    assert (tmp_path / "scans/a/map.txt").read_text() == "second" and os.listdir(tmp_path / "unfinished") == []


def test_a_failed_attempt_leaves_nothing(tmp_path):
    with pytest.raises(KeyError), unfinished_folder(tmp_path) as folder:
        (folder / "map.txt").write_text("half")
        raise KeyError
    assert os.listdir(tmp_path / "unfinished") == [] and not (tmp_path / "scans").exists()


@pytest.fixture
def memory():
    system = fsspec.filesystem("memory")
    yield system
    system.rm("/", recursive=True)


def test_a_local_scan_is_read_where_it_lies(tmp_path):
    with local_files(str(tmp_path / "x"), tmp_path / "cache", 1) as path:
        assert path == str(tmp_path / "x") and not (tmp_path / "cache").exists()


def test_a_scan_is_fetched_once_and_again_when_it_changes(tmp_path, memory, monkeypatch):
    memory.pipe("/scans/a.nrrd", b"first")
    for text in (b"first", b"second"):
        memory.pipe("/scans/a.nrrd", text)
        with local_files("memory://scans/a.nrrd", tmp_path, 1) as path:
            assert open(path, "rb").read() == text and path.endswith("/a.nrrd")
    monkeypatch.setattr("xraycast.cohort.source._fetch", None)
    with local_files("memory://scans/a.nrrd", tmp_path, 1) as path:
        assert open(path, "rb").read() == b"second"


def test_a_folder_is_fetched_whole(tmp_path, memory):
    for number in range(3):
        memory.pipe(f"/scans/ct/{number}.dcm", bytes([number]))
    with local_files("memory://scans/ct", tmp_path, 1) as path:
        assert sorted(os.listdir(path)) == ["0.dcm", "1.dcm", "2.dcm"]


def test_the_cache_stays_small(tmp_path, memory):
    for number in range(4):
        memory.pipe(f"/scans/{number}.nrrd", bytes(1000))
        with local_files(f"memory://scans/{number}.nrrd", tmp_path, 2.5e-6) as path:
            assert os.path.getsize(path) == 1000  # also when it is itself what does not fit
    assert len([entry for entry in os.listdir(tmp_path) if not entry.endswith(".lock")]) == 2
