import subprocess
import sys

import pytest
import xraycast as xc

pytest.importorskip("distributed")


@pytest.fixture(scope="session")
def phantoms(tmp_path_factory):
    """Four scans, one of them in a folder below, and two broken files."""
    folder = tmp_path_factory.mktemp("scans")
    (folder / "more").mkdir()
    for name, size in {"a": 24, "b": 25, "c": 26, "more/d": 27}.items():
        xc.phantom("thorax", size=(size, 32, 32)).write(folder / f"{name}.nrrd")
    (folder / "cut.nrrd").write_bytes((folder / "a.nrrd").read_bytes()[:2000])
    (folder / "text.nrrd").write_text("no")
    return folder


@pytest.fixture(scope="session")
def cohort():
    """Runs xraycast-cohort in a process of its own."""
    def run(*arguments, **options):
        return subprocess.run([sys.executable, "-m", "xraycast.cohort", *map(str, arguments)], capture_output=True, text=True,
                              timeout=120, **options)
    return run
