"""The scans of a cohort: from a CSV file, or found in a folder."""
import csv
import dataclasses
import fnmatch
import io
import os
import pathlib
import re
import urllib.parse

from .._errors import InputError

VOLUMES = (".nrrd", ".nhdr", ".nii", ".nii.gz", ".mha", ".mhd", ".vti", ".vtk", ".zip")
DICOM_MAGIC_AT = 128
URL = re.compile(r"([a-z0-9+.-]+::)*[a-z0-9+.-]+://", re.I)  # chained ones of fsspec too
MOST_HEADER = 1 << 20  # letters
MOST_LETTERS = 255  # of a folder's name, in all common file systems


@dataclasses.dataclass(frozen=True)
class CohortScan:
    """name is unique in the cohort; path is a local path or a URL that fsspec knows."""
    name: str
    path: str

    @property
    def folder(self):
        """The name as that of one folder: different names give different folders."""
        quoted = urllib.parse.quote(self.name.replace("/", "\0"), safe=" ").replace("%00", "+")
        return "%2E" + quoted[1:] if quoted.startswith(".") else quoted


def is_url(path):
    return bool(URL.match(path))


def read_cohort(source):
    """The scans of a manifest (.csv) or folder, local or by URL, in order. Raises InputError."""
    try:
        scans = read_manifest(source) if source.lower().endswith(".csv") else find_scans(source)
    except csv.Error as error:
        raise InputError(f"{source}: {error}; correct or remove that line") from None
    _check_names(scans, source)
    return scans


def read_manifest(source):
    """From the columns path and, if wanted, name. Local paths are relative to the manifest."""
    rows = csv.DictReader(io.StringIO(_text_of(source), newline=""))
    if "path" not in (rows.fieldnames or []):
        raise InputError(f"{source}: has no column path; its first line must name the column path and optionally name")
    scans = []
    for row in rows:
        if None in row:
            raise InputError(f"{source} line {rows.line_num}: more cells than columns; quote a cell that holds a comma")
        path = (row["path"] or "").strip()
        if not path:
            raise InputError(f"{source} line {rows.line_num}: path is empty; name a scan, or remove the line")
        located = path if is_url(path) else _beside(source, path)
        if not is_url(located) and not os.path.exists(located):
            raise InputError(f"{source} line {rows.line_num}: path {path}: no such file; correct or remove the line")
        scans.append(CohortScan((row.get("name") or "").strip() or path, located))
    if not scans:
        raise InputError(f"{source}: names no scan; add a line for each")
    return scans


def _text_of(source):
    try:
        if is_url(source):
            import fsspec
            with fsspec.open(source, "rt", encoding="utf-8-sig", newline="") as file:
                return file.read()
        with open(source, encoding="utf-8-sig", newline="") as file:
            return file.read()
    except (OSError, ImportError, UnicodeDecodeError, ValueError) as error:
        reason = "cannot be read as UTF-8" if isinstance(error, UnicodeDecodeError) else getattr(error, "strerror", None) or error
        if isinstance(error, FileNotFoundError):
            reason = "no such file"
        raise InputError(f"{source}: {reason}; give a manifest (.csv) or a folder of scans") from None


def _beside(source, path):
    if is_url(source):
        return source.rsplit("/", 1)[0] + "/" + path
    return os.path.join(os.path.dirname(os.path.abspath(source)), path)


def find_scans(source):
    """Each volume file is a scan, and so is each folder that holds DICOM files."""
    if is_url(source):
        scans = _found_by_url(source)
    elif os.path.isdir(source):
        scans = _found_below(pathlib.Path(source).absolute())
    else:
        raise InputError(f"{source}: no such folder; give a manifest (.csv) or a folder of scans")
    if not scans:
        raise InputError(f"{source}: holds no scan; give a folder of {', '.join(VOLUMES)} files or DICOM folders")
    return sorted(scans, key=lambda scan: scan.name)


def _found_below(root):
    folders = {pathlib.Path(folder).relative_to(root).as_posix(): files for folder, _, files in os.walk(root)}
    return _scans_in(folders, root.name, lambda name: str(root / name), _is_dicom)


def _found_by_url(source):
    import fsspec
    try:
        system, root = fsspec.core.url_to_fs(source)
        paths = system.find(root)
    except (OSError, ImportError, ValueError) as error:
        raise InputError(f"{source}: {error}; give the URL of a folder of scans") from None
    folders = {}
    for path in paths:
        folder, name = os.path.split(os.path.relpath(path, root))
        folders.setdefault(folder or ".", []).append(name)
    root = root.rstrip("/")
    return _scans_in(folders, os.path.basename(root), lambda name: system.unstrip_protocol(f"{root}/{name}" if name != "." else root),
                     lambda url: _is_dicom_by_url(system, url))


def _scans_in(folders, root_name, located, is_dicom):
    """folders: the names of the files in each, by its path below the root, which is "." itself."""
    scans, dicom = [], set()
    for folder in sorted(folders):
        parts = pathlib.PurePosixPath(folder).parts
        ways = {"."} | {"/".join(parts[:count]) for count in range(1, len(parts) + 1)}
        if any(part.startswith(".") for part in parts) or (ways - {folder}) & dicom:
            continue  # hidden, or a part of the DICOM folder that it is in
        inside = "" if folder == "." else folder + "/"
        volumes, others = _sorted_out(folders[folder])
        scans += [CohortScan(inside + name, located(inside + name)) for name in volumes]
        if any(is_dicom(located(inside + name)) for name in others):
            scans.append(CohortScan(root_name if folder == "." else folder, located(folder)))
            dicom.add(folder)
    return scans


def _sorted_out(names):
    visible = sorted(name for name in names if not name.startswith("."))
    volumes = [name for name in visible if name.lower().endswith(VOLUMES)]
    return volumes, [name for name in visible if name not in set(volumes)]


def _is_dicom(path):
    if path.lower().endswith(".dcm"):
        return True
    try:
        with open(path, "rb") as file:
            return file.read(DICOM_MAGIC_AT + 4)[DICOM_MAGIC_AT:] == b"DICM"
    except OSError:
        return False


def _is_dicom_by_url(system, url):
    """Each look costs a request: only names that slices have without .dcm are looked into."""
    suffix = pathlib.PurePosixPath(url).suffix.lower()
    if suffix == ".dcm":
        return True
    if suffix and suffix != ".ima" and not suffix[1:].isdigit():
        return False
    try:
        return system.cat_file(url, start=DICOM_MAGIC_AT, end=DICOM_MAGIC_AT + 4) == b"DICM"
    except OSError:
        return False


def _check_names(scans, source):
    """Each becomes that of a folder, and is told in the ledger."""
    seen = set()
    for scan in scans:
        if reason := _fault_of(scan):
            raise InputError(f"{source}: the name {ascii(scan.name[:80])} {reason}")
        if scan.name in seen:
            raise InputError(f"{source}: two scans have the name {scan.name}; give each line another name")
        seen.add(scan.name)


def _fault_of(scan):
    if "\0" in scan.name:
        return "holds a zero byte; remove it"
    try:
        scan.path.encode()
        return "is too long for a folder; give it a shorter one" if len(scan.folder) > MOST_LETTERS else None
    except UnicodeEncodeError:
        return "or the path of its file is no UTF-8; rename it"


def identity_of(path):
    """What changes when a scan's files do: their names, sizes and times. Raises OSError."""
    if is_url(path):
        return _identity_by_url(path)
    if os.path.isdir(path):
        return [_identity_of_file(os.path.join(folder, name), path)
                for folder, folders, names in sorted(os.walk(path)) for name in sorted(names)]
    return [_identity_of_file(file, os.path.dirname(path)) for file in _with_voxels(path)]


def _identity_of_file(path, root):
    status = os.stat(path)
    return [os.path.relpath(path, root), status.st_size, status.st_mtime_ns]


def _with_voxels(path):
    """A header may have its voxels in other files: one of the same name, or those that it names, also by a pattern of slices."""
    if not path.lower().endswith((".mhd", ".nhdr")):
        return [path]
    header = pathlib.Path(path)
    stem = header.stem.split(".")[0]
    with open(path, encoding="utf-8", errors="replace") as file:
        words = set(re.split(r"[\s=:]+", re.sub(r"%\d*d", "*", file.read(MOST_HEADER))))
    patterns = [word for word in words if "*" in word]
    return sorted(str(file) for file in header.parent.iterdir() if file.name.split(".")[0] == stem or file.name in words
                  or any(fnmatch.fnmatch(file.name, pattern) for pattern in patterns))


def _identity_by_url(path):
    import fsspec
    system, root = fsspec.core.url_to_fs(path)
    if not system.isdir(root):
        return [[os.path.basename(root), str(system.size(root)), _time_at(system, root)]]
    return [[os.path.relpath(name, root), str(info.get("size")), _time_in(info)]
            for name, info in sorted(system.find(root, detail=True).items())]


def _time_at(system, path):
    return _time_in(system.info(path))


def _time_in(info):
    known = ("ETag", "etag", "md5", "mtime", "LastModified", "last_modified", "created")
    return next((str(info[name]) for name in known if info.get(name)), "")
