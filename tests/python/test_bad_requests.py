"""Bad values of requests, told alike by the command line and by Python: each spells the fields as its own."""
import os
import pathlib
import re
import subprocess

import numpy as np
import pytest
import xraycast as xc

PROGRAM = os.environ.get("XRAYCAST_PROGRAM")
MIB = 1 << 20
HEAD = "time_s,insertion_mm,rotation_deg\n"
HEAD_2 = "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n"
MASK = "does not apply to `from_mask`, whose voxels are the vessels; leave it out"

# Of each subcommand: what differs from a good request, and the message, with fields in backquotes and "..." for what is left
# out of it. A `script` is what its file holds.
BAD = {
    "cast": {
        "no layers": (dict(layers=0), "`layers` 0: must be 1 to 256"),
        "too many layers": (dict(layers=300), "`layers` 300: must be 1 to 256"),
        "no angles": (dict(angles=0), "map: 0 angles, but there must be 1 to 16384"),
        "angles below zero": (dict(angles=-5), "map: -5 angles, but there must be 1 to 16384"),
        "no views": (dict(projection="rectangle", views=0), "map: 0 views, but there must be 1 to 3600"),
        "views of a cylinder": (dict(views=8), "`views` does not apply to `projection` cylinder; leave it out"),
        "layers of a rectangle": (dict(projection="rectangle", layers=8),
                                  "`layers` does not apply to `projection` rectangle; leave it out"),
        "outline of a rectangle": (dict(projection="rectangle", outline="body"),
                                   "`outline` does not apply to `projection` rectangle; leave it out"),
        "no radius": (dict(radius_mm=0), "`radius_mm` is 0 mm, but must be above 0"),
        "unknown rule": (dict(radii="thin"), "`radii` thin: must be equal-area, equal-thickness, near-skin or all edges in mm, "
                                             "innermost first"),
        "one edge": (dict(radii=[4]), "`radii` 4: must be equal-area, equal-thickness, near-skin or all edges in mm, innermost "
                                      "first"),
        "descending edges": (dict(radii=[4, 2]), "map: radii[1] of 2 mm does not exceed the one before it, 4 mm"),
        "edges of other layers": (dict(radii=[0, 2, 4], layers=3),
                                  "`radii` 0,2,4 makes 2 layers, but `layers` asks for 3; leave `layers` out"),
        "edges of another radius": (dict(radii=[0, 2.5, 4], radius_mm=5),
                                    "`radii` 0,2.5,4 ends at a radius other than `radius_mm` 5; leave `radius_mm` out"),
        "centre outside": (dict(centre_mm=(500, 0)), "the centre (500, 0, 0) mm lies outside the scan, which spans -0.5 to "
                                                     "7.5 mm in x, -0.5 to 7.5 mm in y and -0.5 to 63.5 mm in z"),
        "line of a sphere": (dict(projection="sphere", centre_line="l.csv"),
                             "`centre_line` does not apply to `projection` sphere; leave it out"),
        "two centres": (dict(centre_mm=(1, 1.5), centre_line="l.csv"),
                        "`centre_mm` 1,1.5 and `centre_line` l.csv: give only one of them"),
        "missing line": (dict(centre_line="l.csv"), "l.csv: no such file; check its name"),
        "table of circles": (dict(keep_table=True, outline="circle"),
                             "`keep_table`: circles always include the table; leave out `keep_table` or `outline` circle"),
        "unknown opacity": (dict(opacity="fog"),
                            "fog: unknown opacity; give paper, bilinear, subtracted or a readable JSON file"),
        "iodine without a spectrum": (dict(iodine="m.nrrd"), "`iodine` m.nrrd: needs a spectrum; add `opacity` spectrum:KVP"),
        "no vessels": (dict(without_vessels="gone"), "gone/mask.nrrd: no such file or folder; check its name"),
        "basis of a sphere": (dict(projection="sphere", knots_hu=[]),
                              "only cylinder maps cast with an opacity have a basis"),
        "basis of a spectrum": (dict(opacity="spectrum:80", knots_hu=[]),
                                "only cylinder maps cast with an opacity have a basis"),
        "descending knots": (dict(knots_hu=[0, -5]), "`knots_hu` 0,-5: knot 1 at -5 HU is not above the one before it, 0 HU"),
        "basis of slabs": (dict(knots_hu=[], memory_limit_B=100),
                           "a basis needs the whole scan in memory; raise `memory_limit_B`"),
        "spectrum of slabs": (dict(opacity="spectrum:80", memory_limit_B=8192),
                              "a spectrum map needs the whole scan in memory; raise `memory_limit_B`"),
        "sphere of slabs": (dict(projection="sphere", memory_limit_B=8192),
                            "a sphere map needs the whole scan at once, since its rays cross slices; raise the memory limit"),
        "too small a limit": (dict(memory_limit_B=100), "a memory limit of 0 MiB is below the 1 MiB that 16 slices of 8 x 8 "
                                                        "take; raise it"),
    },
    "segment": {
        "no radius": (dict(max_radius_mm=0), "`max_radius_mm` 0: must be above zero"),
        "radius below zero": (dict(max_radius_mm=-2), "`max_radius_mm` -2: must be above zero"),
        "radius that is no number": (dict(max_radius_mm=float("nan")), "`max_radius_mm` nan: must be above zero"),
        "infinite radius": (dict(max_radius_mm=float("inf")), "`max_radius_mm` inf: must be above zero"),
        "few triangles": (dict(triangles=99), "`triangles` 99: must be 100 or more"),
        "unknown surface": (dict(surface="cubes"), "`surface` cubes: must be isosurface or tubes"),
        "window upside down": (dict(window_hu=(300, 200)),
                               "`window_hu` 300,200: must be two CT numbers in HU, the lower one first"),
        "window of nothing": (dict(window_hu=(9, 9)), "`window_hu` 9,9: must be two CT numbers in HU, the lower one first"),
        "markers of a mask": (dict(from_mask="mask.nrrd", not_vessels=[(1, 2, 3)]), f"`not_vessels` {MASK}"),
        "window of a mask": (dict(from_mask="mask.nrrd", window_hu=(1, 2)), f"`window_hu` {MASK}"),
        "radius of a mask": (dict(from_mask="mask.nrrd", max_radius_mm=9), f"`max_radius_mm` {MASK}"),
        "far root": (dict(root_mm=(0, 0, 9000), from_mask="mask.nrrd"), "`root_mm` 0,0,9000: the nearest vessel end, ..."),
        "another scan's mask": (dict(from_mask="other.nrrd"), "`from_mask` other.nrrd: has ..."),
        "seed in tissue": (dict(seeds=[(0, 0, 0)]),
                           "...lies in tissue without contrast agent (0 HU); give `seeds` in a vessel..."),
        "window without the seed": (dict(window_hu=(500, 600), seeds=[(12, 0, -20)]),
                                    "...; give a `window_hu` that includes it, or leave `window_hu` out"),
    },
    "simulate": {
        "no such branch": (dict(entry=7), "`entry` 7: there is no branch 7; the tree has branches 0 to 0"),
        "far entry": (dict(entry=(0, 0, 900)), "...the nearest vessel end, 0,0,90, is 810 mm away..."),
        "unknown instrument": (dict(instruments=["cobra5f"]), "cobra5f: unknown instrument; did you mean cobra-5f?..."),
        "too many instruments": (dict(instruments=["guide-6f", "jb1-5f", "microcatheter-24f", "guidewire-014-angled"]),
                             "4 instruments; give one to 3..."),
        "thick in thin": (dict(instruments=["microcatheter-27f", "cobra-5f"]), "...list the outermost instrument first..."),
        "too thick for the vessel": (dict(instruments=["thick.json"]), "...choose a thinner instrument..."),
        "script of two": (dict(script=HEAD_2 + "0,0,0,0,0\n"),
                          "script.csv: line 1: a script of 2 instruments; give `instruments` for each, the outermost first"),
        "script of one": (dict(instruments=["microcatheter-27f", "guidewire-014-angled"]),
                          "script.csv: line 1: no column insertion_2_mm; a script of 2 instruments has..."),
        "back in time": (dict(script=HEAD + "0,0,0\n2,5,0\n1,6,0\n"),
                         "script.csv: line 4: time_s 1 is not later than 2, that of line 3..."),
        "too fast": (dict(script=HEAD + "0,0,0\n1,301,0\n"), "script.csv: line 3: the hub would move at 301 mm/s..."),
        "too deep": (dict(script=HEAD + "0,0,0\n20,1500,0\n"),
                     "script.csv: line 3: insertion_mm 1500; microcatheter-27f can be inserted by at most 1280 mm"),
        "drawn out": (dict(script=HEAD + "0,-5,0\n"),
                      "script.csv: line 2: insertion_mm -5 is below zero; at 0 the tip is at the vessel's end"),
        "no rows": (dict(script=HEAD), "script.csv: no rows after the first line; correct the script"),
        "unreachable": (dict(instruments=["exchange-035-stiff"], script=HEAD + "0,900,0\n1,900,0\n"),
                        "...of 900 mm, where 3 N do not push it further..."),
    },
    "export": {
        "unknown format": (dict(path="page.pdf"), "page.pdf: must end in .html, for a page, or in .glb, for a glTF scene"),
        "no such folder": (dict(path="none/page.html"), "none: the output folder does not exist; create it first"),
        "another scan's vessels": (dict(vessels="elsewhere"),
                                   "...most of it lies outside the body map; give the vessels of the scan that was cast"),
        "missing vessels": (dict(vessels="gone.vtp"), "gone.vtp: no such file or folder; check its name"),
        "too many layers": (dict(body="many.exr"), "...129 layers of 4 x 60 texels, but a page holds at most 128 of them; cast "
                                                   "it with `layers` 128"),
        "too many angles": (dict(body="wide.exr"), "...2048 angles, but a page holds at most 2047; cast it with `angles` 2047"),
        "too long a run": (dict(script=HEAD + "0,0,0\n601,20,0\n"),
                           "script.csv: lasts 601 s, but an export holds a run of at most 600 s; shorten it"),
    },
    "compare": {
        "no views": (dict(views=0), "`views` 0: must be 1 to 3600"),
        "too many views": (dict(views=3601), "`views` 3601: must be 1 to 3600"),
        "another scan's map": (dict(), "...was not cast from ...: it has 60 rows, but the scan has 64 slices; give its own scan"),
    },
    "convert": {
        "missing scan": (dict(input="gone.nrrd"), "gone.nrrd: no such file or folder; check its name"),
        "unknown format": (dict(output="ct.pdf"), "ct.pdf: unknown volume format..."),
        "patient of no DICOM": (dict(patient="Doe^Jane,1"),
                                "`patient` does not apply to out.nrrd, which is not DICOM; leave it out or name a folder"),
        "patient without an ID": (dict(patient="Doe", output="series"), "`patient` Doe: must be NAME,ID, such as Doe^Jane,12345"),
        "series of no DICOM": (dict(series="3"),
                               "water.nrrd: not DICOM, so there are no series to choose from; leave out `series` 3"),
        "infinite offset": (dict(offset_hu=float("inf")), "water.nrrd: the offset of inf HU must be within 65536 of 0"),
    },
}
CASES = [(subcommand, name) for subcommand, cases in BAD.items() for name in cases]


@pytest.fixture(scope="module")
def folder(tmp_path_factory, angiogram):
    """What the requests read."""
    folder = tmp_path_factory.mktemp("requests")
    for name, x_mm in (("vessels", 0), ("elsewhere", 500)):
        (folder / name).mkdir()
        xc.VesselTree([(np.array([[x_mm, 0, -90, 3], [x_mm, 0, 90, 3]], float), -1)]).write(folder / name / "tree.vtp")
    (folder / "thick.json").write_text(
        '{"name": "thick", "radius_mm": 4, "density_g_cm3": 1, "axial_stiffness_N": 1000, "static_friction": 0.1, '
        '"kinetic_friction": 0.1, "sections": [{"length_mm": 1000, "bending_stiffness_Nmm2": 500, '
        '"torsional_stiffness_Nmm2": 500}]}')
    cylinder = xc.phantom("cylinder", size=(60, 60, 60), spacing_mm=4)
    for name, layers, angles in (("map", 2, 16), ("many", 129, 4), ("wide", 1, 2048)):
        cylinder.cast(layers=layers, angles=angles).write(folder / f"{name}.exr")
    # Water of 64 slices, of which 16 take less than the whole.
    xc.Scan.from_array(np.zeros((64, 8, 8), np.int16), (1, 1, 1)).write(folder / "water.nrrd")
    hu, tube = angiogram
    for name, voxels in (("tube", hu), ("mask", tube), ("other", tube[1:])):
        xc.Scan.from_array(voxels.astype(np.int16), (1, 1, 1), (-40, -40, -40)).write(folder / f"{name}.nrrd")
    return folder


def option(field):
    """`radius_mm` is --radius."""
    field = re.sub("(?<!offset)_(mm|hu|B)$", "", field)
    return "--" + {"instruments": "device-model", "seeds": "seed", "not_vessels": "not"}.get(field, field).replace("_", "-")


def options(arguments):
    """Those of the command line that mean the same."""
    def text(value):
        return ",".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
    for field, value in arguments.items():
        if field == "knots_hu":
            yield from ["--keep-basis=basis"] + [f"--knots={text(value)}"] * bool(value)
        elif field == "memory_limit_B":
            yield f"--memory-limit={value / MIB:.9f}M"
        elif field in ("instruments", "seeds", "not_vessels"):
            yield from (f"{option(field)}={text(one)}" for one in value)
        else:
            yield option(field) + (f"={text(value)}" if value is not True else "")


def by_program(subcommand, changed):
    """Runs it, and returns the line that it prints."""
    if not PROGRAM:
        pytest.skip("XRAYCAST_PROGRAM names no program")
    inputs = {"cast": ["water.nrrd", "-o", "out.exr"], "segment": ["tube.nrrd", "-o", "out"],
              "simulate": ["vessels", "-o", "log.csv"], "compare": ["water.nrrd", "map.exr"], "export": [changed.pop("body", "map.exr")],
              "convert": [changed.pop("input", "water.nrrd")]}[subcommand]
    for output in ("path", "output"):
        if output in changed:
            inputs += ["-o", changed.pop(output)]
    done = subprocess.run([PROGRAM, subcommand, *inputs, *options(changed)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 3, done.stderr
    assert done.stderr.startswith("xraycast: ") and done.stderr.count("\n") == 1
    return done.stderr.removeprefix("xraycast: ").rstrip("\n")


def by_python(subcommand, changed):
    """Calls it, and returns the message of its exception."""
    def run():
        fields = {field: changed.pop(field) for field in ("instruments", "script", "entry") if field in changed}
        return xc.simulate(xc.VesselTree.read("vessels"), **fields)
    with pytest.raises(xc.InputError) as error:
        if subcommand == "simulate":
            run()
        elif subcommand == "export":
            body = xc.BodyMap.read(changed.pop("body", "map.exr"))
            xc.export(body, run=run() if "script" in changed else None, **changed)
        elif subcommand == "compare":
            xc.compare(xc.open("water.nrrd"), xc.BodyMap.read("map.exr"), **changed)
        elif subcommand == "convert":
            xc.convert(changed.pop("input", "water.nrrd"), **changed)
        else:
            scan = xc.open("water.nrrd" if subcommand == "cast" else "tube.nrrd")
            getattr(scan, subcommand)(**changed)
    return str(error.value)


@pytest.mark.parametrize("front_end, spell", [(by_program, option), (by_python, str)])
@pytest.mark.parametrize("subcommand, name", CASES)
def test_are_told_alike(folder, monkeypatch, subcommand, name, front_end, spell):
    changed, message = BAD[subcommand][name]
    good = {"simulate": dict(instruments=["microcatheter-27f"], script=HEAD + "0,0,0\n0.1,5,0\n"),
            "export": dict(path="page.html", vessels="vessels"), "convert": dict(output="out.nrrd")}
    arguments = good.get(subcommand, {}) | changed
    monkeypatch.chdir(folder)
    if "script" in arguments:
        pathlib.Path("script.csv").write_text(arguments["script"])
        arguments |= dict(script="script.csv", instruments=arguments.get("instruments", ["microcatheter-27f"]))
    before = sorted(folder.rglob("*"))
    told = front_end(subcommand, arguments)
    spelled = re.sub("`(\\w+)`", lambda field: spell(field[1]), message)
    assert re.fullmatch(".*".join(map(re.escape, spelled.split("..."))), told), told
    assert sorted(folder.rglob("*")) == before  # nothing is written
