"""The command `xraycast` of a wheel, by the program of this build in the place of the wheel's own."""
import importlib
import os
import pathlib
import shutil
import subprocess
import sys
import tomllib

import pytest
import xraycast

PROGRAM = os.environ.get("XRAYCAST_PROGRAM", "")
CALL = "import sys; from xraycast._program import main; sys.exit(main())"


@pytest.fixture
def installed(tmp_path):
    """An environment in which the package has its program."""
    if not PROGRAM:
        pytest.skip("XRAYCAST_PROGRAM names no program")
    package = tmp_path / "xraycast"
    shutil.copytree(pathlib.Path(xraycast.__file__).parent, package, symlinks=True)
    (package / "bin").mkdir()
    shutil.copy(PROGRAM, package / "bin")  # away from what it loads, OpenImageIO
    return {**os.environ, "PYTHONPATH": str(tmp_path)}


def run(environment, *arguments, **options):
    return subprocess.run([sys.executable, "-c", CALL, *arguments], env=environment, capture_output=True, text=True, timeout=120, **options)


def test_is_the_program(installed):
    done = run(installed, "--version")
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, xraycast.__version__, "")
    done = run(installed, "info", "no such.nrrd")
    assert done.returncode == 3 and "no such.nrrd" in done.stderr
    assert run(installed, "--unknown").returncode == 2


def test_is_named_xraycast_and_takes_input(installed):
    assert "Usage: xraycast " in run(installed, "--help").stdout


def test_says_what_to_install_for_a_format_that_a_wheel_leaves_out(installed, tmp_path):
    made = run(installed, "phantom", "box", "--size", "16x16x16", "-o", "box.nrrd", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert run(installed, "project", "box.nrrd", "-o", "x.png", cwd=tmp_path).returncode == 0
    for name in ("x.jpg", "x.tif"):
        done = run(installed, "project", "box.nrrd", "-o", name, cwd=tmp_path)
        assert done.returncode == 1 and done.stderr.count("\n") == 1, done.stderr
        assert name in done.stderr and "name a .png or .exr, or install Debian's package xraycast" in done.stderr
        assert not (tmp_path / name).exists()


def test_says_what_to_do_where_the_program_is_missing(tmp_path):
    package = tmp_path / "xraycast"
    shutil.copytree(pathlib.Path(xraycast.__file__).parent, package, symlinks=True, ignore=shutil.ignore_patterns("bin"))
    done = run({**os.environ, "PYTHONPATH": str(tmp_path)}, "--version")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1 and "pip install --force-reinstall xraycast" in done.stderr


def test_commands_of_the_package_are_functions():
    project = tomllib.loads((pathlib.Path(__file__).parents[2] / "python/pyproject.toml").read_text())["project"]
    assert set(project["scripts"]) == {"xraycast", "xraycast-cohort"}
    for entry in project["scripts"].values():
        module, function = entry.split(":")
        assert callable(getattr(importlib.import_module(module), function))
