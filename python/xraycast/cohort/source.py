"""A scan's files on the worker: local ones where they lie, others fetched into a cache beside it."""
import contextlib
import fcntl
import hashlib
import json
import os
import pathlib
import shutil
import tempfile

from .manifest import identity_of, is_url


@contextlib.contextmanager
def local_files(path, cache, cache_gb):
    """A path that xraycast.open() takes, valid inside the `with`. cache: a folder, by default one of this user's in TMPDIR."""
    if not is_url(path):
        yield path
        return
    cache = pathlib.Path(cache or pathlib.Path(tempfile.gettempdir(), f"xraycast-cohort-{os.getuid()}"))
    cache.mkdir(mode=0o700, parents=True, exist_ok=True)
    if cache.stat().st_uid != os.getuid():
        raise PermissionError(f"{cache}: belongs to another user; name a cache by --cache")
    key = hashlib.sha256(json.dumps([path, identity_of(path)]).encode()).hexdigest()[:32]
    with open(cache / f"{key}.lock", "a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # two workers on one machine fetch a scan once
        entry = cache / key
        if not entry.exists():
            _fetch(path, entry)
        os.utime(entry)
        fcntl.flock(lock, fcntl.LOCK_SH)  # while it is read it is not removed
        _shrink(cache, cache_gb * 1e9)
        yield str(next(entry.iterdir()))


def _fetch(path, entry):
    import fsspec
    system, root = fsspec.core.url_to_fs(path)
    unfinished = tempfile.mkdtemp(prefix="fetching-", dir=entry.parent)
    try:
        target = os.path.join(unfinished, os.path.basename(root.rstrip("/")) or "scan")
        system.get(root, target, recursive=system.isdir(root))
        os.rename(unfinished, entry)
    except BaseException:
        shutil.rmtree(unfinished, ignore_errors=True)
        raise


def _shrink(cache, most_bytes):
    """Removes what was used longest ago and is not in use, until the rest fits."""
    entries = [(path.stat().st_mtime, _size_of(path), path) for path in cache.iterdir()
               if path.is_dir() and not path.name.startswith("fetching-")]
    excess = sum(size for _, size, _ in entries) - most_bytes
    for _, size, path in sorted(entries):
        if excess <= 0:
            return
        with open(f"{path}.lock", "a") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            shutil.rmtree(path, ignore_errors=True)
        excess -= size


def _size_of(folder):
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
