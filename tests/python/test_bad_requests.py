"""Bad values of requests, told alike by the command line and by Python: each spells the fields as its own."""
import os
import pathlib
import re
import subprocess

import numpy as np
import pytest
import xraycast as xc

PROGRAM = os.environ.get("XRAYCAST_PROGRAM")
HEAD = "time_s,insertion_mm,rotation_deg\n"
HEAD_2 = "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n"
OPTIONS = {"instruments": "--device-model"}  # others are named as their fields

# Of a microcatheter in a tube, what is changed, and the message, with fields in backquotes.
BAD_RUNS = {
    "no such branch": ({"entry": 7}, "`entry` 7: there is no branch 7; the tree has branches 0 to 0"),
    "far entry": ({"entry": (0, 0, 900)}, "the nearest vessel end, 0,0,90, is 810 mm away"),
    "unknown device": ({"instruments": ["cobra5f"]}, "cobra5f: unknown device; did you mean cobra-5f?"),
    "too many devices": ({"instruments": ["guide-6f", "jb1-5f", "microcatheter-24f", "guidewire-014-angled"]},
                         "4 devices; give one to 3"),
    "thick in thin": ({"instruments": ["microcatheter-27f", "cobra-5f"]}, "list the outermost device first"),
    "too thick for the vessel": ({"instruments": ["thick.json"]}, "choose a thinner device"),
    "script of two": ({"script": HEAD_2 + "0,0,0,0,0\n"},
                      "script.csv: line 1: a script of 2 devices; give `instruments` for each, the outermost first"),
    "script of one": ({"instruments": ["microcatheter-27f", "guidewire-014-angled"]},
                      "script.csv: line 1: no column insertion_2_mm; a script of 2 devices has"),
    "back in time": ({"script": HEAD + "0,0,0\n2,5,0\n1,6,0\n"},
                     "script.csv: line 4: time_s 1 is not later than 2, that of line 3"),
    "too fast": ({"script": HEAD + "0,0,0\n1,301,0\n"}, "script.csv: line 3: the hub would move at 301 mm/s"),
    "too deep": ({"script": HEAD + "0,0,0\n20,1500,0\n"},
                 "script.csv: line 3: insertion_mm 1500; microcatheter-27f can be inserted by at most 1280 mm"),
    "drawn out": ({"script": HEAD + "0,-5,0\n"}, "script.csv: line 2: insertion_mm -5 is below zero"),
    "no rows": ({"script": HEAD}, "script.csv: no rows after the first line"),
    "unreachable": ({"instruments": ["exchange-035-stiff"], "script": HEAD + "0,900,0\n1,900,0\n"}, "of 900 mm, where 3 N do not push it further"),
}

# Of a map in two layers, what is changed, and the message.
BAD_EXPORTS = {
    "unknown format": ({"path": "page.pdf"}, "page.pdf: must end in .html, for a page, or in .glb, for a glTF scene"),
    "no such folder": ({"path": "none/page.html"}, "none: the output folder does not exist; create it first"),
    "another scan's vessels": ({"vessels": "elsewhere.vtp"},
                               "most of it lies outside the body map; give the vessels of the scan that was cast"),
    "missing vessels": ({"vessels": "gone.vtp"}, "gone.vtp: no such file or folder; check its name"),
    "too many layers": ({"map": "many.exr"}, "129 layers of 4 x 60 texels, but a page holds at most 128 of them; "
                                            "cast it with `layers` 128"),
    "too many angles": ({"map": "wide.exr"}, "2048 angles, but a page holds at most 2047; cast it with `angles` 2047"),
    "too long a run": ({"script": HEAD + "0,0,0\n601,20,0\n"},
                       "script.csv: lasts 601 s, but an export holds a run of at most 600 s; shorten it"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("requests")
    for name, x, radius_mm in (("tree", 0, 3), ("elsewhere", 500, 3)):
        points = np.array([[x, 0, -90, radius_mm], [x, 0, 90, radius_mm]], float)
        xc.VesselTree([(points, -1)]).write(folder / f"{name}.vtp")
    (folder / "thick.json").write_text(
        '{"name": "thick", "radius_mm": 4, "density_g_cm3": 1, "axial_stiffness_N": 1000, "static_friction": 0.1, '
        '"kinetic_friction": 0.1, "sections": [{"length_mm": 1000, "bending_stiffness_Nmm2": 500, '
        '"torsional_stiffness_Nmm2": 500}]}')
    scan = xc.phantom("cylinder", size=(60, 60, 60), spacing_mm=4)
    for name, layers, angles in (("map", 2, 16), ("many", 129, 4), ("wide", 1, 2048)):
        scan.cast(layers=layers, angles=angles).write(folder / f"{name}.exr")
    return folder


def spelled(message, front_end):
    """The message as a front end spells its fields."""
    def spell(match):
        field = match[1]
        return OPTIONS.get(field, "--" + field.replace("_", "-")) if front_end == "command line" else field
    return re.sub("`(\\w+)`", spell, message)


def refusal_of_program(folder, *words):
    if not PROGRAM:
        pytest.skip("XRAYCAST_PROGRAM names no program")
    done = subprocess.run([PROGRAM, *map(str, words)], cwd=folder, capture_output=True, text=True, timeout=120)
    assert done.returncode == 3, done.stderr
    assert done.stderr.count("\n") == 1
    return done.stderr


def refusal_of_python(call):
    with pytest.raises(xc.InputError) as error:
        call()
    return str(error.value)


def run_words(bad):
    words = [word for name in bad.get("instruments", ["microcatheter-27f"]) for word in ("--device-model", name)]
    if "entry" in bad:
        words += ["--entry", re.sub("[() ]", "", str(bad["entry"]))]
    return words + ["--script", "script.csv"]


def run_of(bad):
    return xc.simulate(xc.VesselTree.read("tree.vtp"), bad.get("instruments", ["microcatheter-27f"]), "script.csv",
                       entry=bad.get("entry"))


@pytest.mark.parametrize("front_end", ["command line", "Python"])
@pytest.mark.parametrize("name", BAD_RUNS)
def test_of_runs_are_told(folder, monkeypatch, name, front_end):
    bad, message = BAD_RUNS[name]
    monkeypatch.chdir(folder)
    pathlib.Path("script.csv").write_text(bad.get("script", HEAD + "0,0,0\n0.1,5,0\n"))
    if front_end == "command line":
        told = refusal_of_program(folder, "simulate", "tree.vtp", *run_words(bad), "-o", "log.csv")
    else:
        told = refusal_of_python(lambda: run_of(bad))
    assert spelled(message, front_end) in told


@pytest.mark.parametrize("front_end", ["command line", "Python"])
@pytest.mark.parametrize("name", BAD_EXPORTS)
def test_of_exports_are_told(folder, monkeypatch, name, front_end):
    bad, message = BAD_EXPORTS[name]
    monkeypatch.chdir(folder)
    path, body, vessels = bad.get("path", "page.html"), bad.get("map", "map.exr"), bad.get("vessels", "tree.vtp")
    if "script" in bad:
        pathlib.Path("script.csv").write_text(bad["script"])
    if front_end == "command line":
        if vessels.endswith("elsewhere.vtp"):  # a surface, as the tree's is for Python
            pathlib.Path("elsewhere").mkdir(exist_ok=True)
            pathlib.Path("elsewhere/tree.vtp").write_bytes(pathlib.Path(vessels).read_bytes())
            vessels = "elsewhere"
        elif vessels == "tree.vtp":
            pathlib.Path("vessels").mkdir(exist_ok=True)
            pathlib.Path("vessels/tree.vtp").write_bytes(pathlib.Path(vessels).read_bytes())
            vessels = "vessels"
        run = run_words(bad) if "script" in bad else []
        told = refusal_of_program(folder, "export", body, "-o", path, "--vessels", vessels, *run)
    else:
        told = refusal_of_python(lambda: xc.export(
            xc.BodyMap.read(body), path, run=run_of(bad) if "script" in bad else None,
            vessels=vessels if vessels == "gone.vtp" else xc.VesselTree.read(vessels)))
    assert spelled(message, front_end) in told
    assert not pathlib.Path(path).exists()
