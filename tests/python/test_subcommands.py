"""docs/python.md has a Python call for each subcommand of the program, with an argument for each option, or a reason why not."""
import ast
import os
import pathlib
import re
import subprocess

import pytest
import xraycast as xc

PROGRAM = os.environ.get("XRAYCAST_PROGRAM")
PAGE = pathlib.Path(__file__).resolve().parents[2] / "docs/python.md"
OWNERS = {"xc": xc, "scan": xc.Scan, "body": xc.BodyMap, "basis": xc.Basis, "frame": xc.Frame, "vessels": xc.Vessels,
          "run": xc.Run, "flow": xc.BloodFlow, "comparison": xc.Comparison, "edited": xc.EditedVessels}
# Arguments with another name than their option's, but for units.
NAMES = {"output": "path|folder|output", "heart_rate": "heart_rate_bpm", "device": "name", "isocentre": "centre_mm", "device_model": "instruments",
         "label": "labels", "not": "not_vessels", "seed": "seeds", "period": "period_s", "object": "objects",
         "injection_rate": "injection_rate_ml_s"}
pytestmark = pytest.mark.skipif(not PROGRAM, reason="XRAYCAST_PROGRAM names no program")


def help_of(*subcommand):
    return subprocess.run([PROGRAM, *subcommand, "--help"], check=True, capture_output=True, text=True).stdout


def options_of(text):
    """The names of each: ["--angle", "--lao"]."""
    lines = re.findall(r"^  ((?:-\w,)?--[\w,-]+)", text, re.MULTILINE)
    return [names for line in lines if "--help" not in (names := re.findall(r"--[\w-]+", line))]


def arguments_of(owner, name):
    call = OWNERS[owner]
    for part in name.split("."):
        call = getattr(call, part)
    signatures = (call.__init__ if isinstance(call, type) else call).__nb_signature__
    texts = [text.partition(" -> ")[0] for text, *_ in signatures]  # the types of arrays are no Python
    parsed = [ast.parse(re.sub(r"\\\d+", "None", text) + ": ...").body[0].args for text in texts]
    return {argument.arg for arguments in parsed for argument in arguments.args + arguments.kwonlyargs}


def is_argument(option, arguments):
    name = option[2:].replace("-", "_")
    pattern = f"({name}|{NAMES.get(name, name)})(_mm|_hu|_mg_ml|_B)?"
    return any(re.fullmatch(pattern, argument) for argument in arguments)


def reasons_of(cell):
    """The options of "`--a`, `--b`: why; `--c`: why"."""
    for part in filter(None, cell.split("; ")):
        options, _, why = part.partition(": ")
        assert why, f"{part}: say why"
        yield from re.findall(r"`(--[\w-]+)`", options)


def test_each_has_a_python_call_or_a_reason_why_not():
    lines = [re.split(r" *\| *", line) for line in PAGE.read_text().splitlines()]
    rows = {line[1].strip("`"): line[2:4] for line in lines if len(line) == 5}
    subcommands = re.findall(r"^  (\w+) ", help_of().partition("Subcommands:")[2], re.MULTILINE)
    faults = []
    for name, text in [("all", help_of())] + [(name, help_of(name)) for name in subcommands]:
        python, reasons = rows.get(name, ("", ""))
        if python.startswith("none: "):
            continue
        calls = re.findall(r"`(\w+)\.([\w.]+)\(", python)
        # A call makes what an option of its name writes.
        arguments = set().union(*(arguments_of(*call) | {call[1]} for call in calls))
        excused = set(reasons_of(reasons))
        faults += [] if calls else [f"{name} has no call; show one, or say `none: ` and why"]
        for names in options_of(text):
            ways = any(is_argument(option, arguments) for option in names) + bool(excused & set(names))
            faults += [] if ways == 1 else [f"{name} {names[0]} needs an argument or a reason why not; it has {ways} of them"]
            excused -= set(names)
        faults += [f"{name} has no option {option}" for option in excused]
    assert len(subcommands) > 10 and not faults, "; ".join(faults) + f": correct the table in {PAGE.name}"
