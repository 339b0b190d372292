"""A scan's outputs: a folder that appears whole, with the record of the attempt that made it."""
import contextlib
import json
import os
import pathlib
import shutil
import uuid

SCANS, UNFINISHED, RECORD = "scans", "unfinished", "record.json"


def folder_of(out, scan):
    return pathlib.Path(out, SCANS, scan.folder)


def finished_record(out, scan, hash_):
    """The record of outputs that are there already, or None."""
    try:
        record = json.loads((folder_of(out, scan) / RECORD).read_text())
    except (OSError, ValueError):
        return None
    return record if isinstance(record, dict) and record.get("hash") == hash_ else None


@contextlib.contextmanager
def unfinished_folder(out):
    """A folder that is removed at the end unless it was published."""
    folder = pathlib.Path(out, UNFINISHED, uuid.uuid4().hex)
    folder.mkdir(parents=True)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def publish(folder, out, scan, record):
    """Moves a folder with its record to its place. Returns the record that is there then, of another attempt if that was first."""
    target = folder_of(out, scan)
    target.parent.mkdir(parents=True, exist_ok=True)
    record["outputs"] = sorted(f"{SCANS}/{scan.folder}/{file.relative_to(folder).as_posix()}"
                               for file in folder.rglob("*") if file.is_file())
    _write_synced(folder / RECORD, json.dumps(record, ensure_ascii=False))
    for _ in range(10):
        try:
            os.rename(folder, target)
            return record
        except OSError:
            if not target.exists():
                raise
        if first := finished_record(out, scan, record["hash"]):
            return first
        _remove(target, out)  # of other options, or of files that have changed since
    raise OSError(f"{target}: other programs write there; remove it and run again")


def _write_synced(path, text):
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def _remove(target, out):
    old = pathlib.Path(out, UNFINISHED, uuid.uuid4().hex)
    with contextlib.suppress(FileNotFoundError):
        os.rename(target, old)
        shutil.rmtree(old, ignore_errors=True)


def remove_unfinished(out):
    """Removes the folders that dead workers left."""
    shutil.rmtree(pathlib.Path(out, UNFINISHED), ignore_errors=True)
