"""What casts refuse, alike on the command line and in Python but for the names of options and arguments."""
import os
import subprocess

import numpy as np
import pytest
import xraycast as xc

MIB = 1 << 20

# Arguments of Scan.cast, and the message, in which the names of arguments are in backquotes.
CASES = {
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
    "centre outside": (dict(centre_mm=(500, 0)), "the centre (500, 0, 0) mm lies outside the scan, which spans -0.5 to 7.5 mm in "
                                                 "x, -0.5 to 7.5 mm in y and -0.5 to 63.5 mm in z"),
    "line of a sphere": (dict(projection="sphere", centre_line="l.csv"),
                         "`centre_line` does not apply to `projection` sphere; leave it out"),
    "two centres": (dict(centre_mm=(1, 1.5), centre_line="l.csv"),
                    "`centre_mm` 1,1.5 and `centre_line` l.csv: give only one of them"),
    "missing line": (dict(centre_line="l.csv"), "l.csv: no such file; check its name"),
    "table of circles": (dict(keep_table=True, outline="circle"),
                         "`keep_table`: circles always include the table; leave out `keep_table` or `outline` circle"),
    "unknown opacity": (dict(opacity="fog"), "fog: unknown opacity; give paper, bilinear, subtracted or a readable JSON file"),
    "iodine without a spectrum": (dict(iodine="m.nrrd"), "`iodine` m.nrrd: needs a spectrum; add `opacity` spectrum:KVP"),
    "no vessels": (dict(without_vessels="vessels"), "vessels/mask.nrrd: no such file or folder; check its name"),
    "basis of a sphere": (dict(projection="sphere", knots_hu=[]), "only cylinder maps cast with an opacity have a basis"),
    "basis of a spectrum": (dict(opacity="spectrum:80", knots_hu=[]), "only cylinder maps cast with an opacity have a basis"),
    "descending knots": (dict(knots_hu=[0, -5]), "`knots_hu` 0,-5: knot 1 at -5 HU is not above the one before it, 0 HU"),
    "basis of slabs": (dict(knots_hu=[], memory_limit_B=100),
                       "a basis needs the whole scan in memory; raise `memory_limit_B`"),
    "spectrum of slabs": (dict(opacity="spectrum:80", memory_limit_B=8192),
                          "a spectrum map needs the whole scan in memory; raise `memory_limit_B`"),
    "sphere of slabs": (dict(projection="sphere", memory_limit_B=8192),
                        "a sphere map needs the whole scan at once, since its rays cross slices; raise the memory limit"),
    "too small a limit": (dict(memory_limit_B=100), "a memory limit of 0 MiB is below the 1 MiB that 16 slices of 8 x 8 take; "
                                                    "raise it"),
}


def option(name):
    """`radius_mm` is --radius."""
    for unit in ("_mm", "_hu", "_B"):
        name = name.removesuffix(unit)
    return "--" + name.replace("_", "-")


def options(arguments):
    """Those of the command line that mean the same."""
    words = []
    for name, value in arguments.items():
        if name == "knots_hu":
            words += ["--keep-basis=basis"] + [f"--knots={','.join(map(str, value))}"] * bool(value)
        elif name == "memory_limit_B":
            words.append(f"--memory-limit={value / MIB:.9f}M")
        elif value is True:
            words.append(option(name))
        else:
            words.append(f"{option(name)}={','.join(map(str, value)) if isinstance(value, (list, tuple)) else value}")
    return words


def spelled(message, spell):
    parts = message.split("`")
    return "".join(spell(part) if i % 2 else part for i, part in enumerate(parts))


@pytest.fixture
def water(tmp_path, monkeypatch):
    """A scan of 64 slices, of which 16 take less than the whole; also as ct.nrrd in the working folder."""
    monkeypatch.chdir(tmp_path)
    scan = xc.Scan.from_array(np.zeros((64, 8, 8), np.int16), (1, 1, 1))
    scan.write("ct.nrrd")
    return scan


@pytest.mark.parametrize("case", CASES)
def test_is_refused_in_python(water, case):
    arguments, message = CASES[case]
    with pytest.raises(xc.InputError) as error:
        water.cast(**arguments)
    assert str(error.value) == spelled(message, str)


@pytest.mark.skipif("XRAYCAST_PROGRAM" not in os.environ, reason="XRAYCAST_PROGRAM names no program")
@pytest.mark.parametrize("case", CASES)
def test_is_refused_on_the_command_line(water, case):
    arguments, message = CASES[case]
    done = subprocess.run([os.environ["XRAYCAST_PROGRAM"], "cast", "ct.nrrd", "-o", "map.exr", *options(arguments)],
                          capture_output=True, text=True)
    assert done.returncode == 3
    assert done.stderr == f"xraycast: {spelled(message, option)}\n"
