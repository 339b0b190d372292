"""What calls say of arguments that they do not take: one line with the argument, what was given and what it takes."""
import inspect
import pathlib

import numpy as np
import pytest
import xraycast as xc

CASES = {
    "unknown name": (lambda box: box.cast_basis(5, pose=1),
                     "cast_basis: there is no argument pose; it takes layers, angles, opacity, outline, projection, views, radii, "
                     "radius_mm, centre_mm, centre_line, keep_table, iodine, without_vessels, memory_limit_B, knots_hu, "
                     "motion, phase, time, keys, progress"),
    "unknown name of nothing": (lambda box: xc.devices(a=1), "devices: there is no argument a; it takes none"),
    "name of two lines": (lambda box: xc.use_device(**{"a\nb": 1}), "use_device: there is no argument a b; it takes name"),
    "no name of Python's": (lambda box: xc.use_device(**{"a, b": 1}),
                            "use_device(): incompatible function arguments. The following argument types are supported: "
                            "1. use_device(name: str) -> None Invoked with types: kwargs = { a, b: int }"),
    "given twice": (lambda box: box.cast(1, layers=2), "cast: layers is given twice"),
    "missing": (lambda box: xc.use_device(), "use_device: name is missing; it takes str"),
    "missing in a class": (lambda box: xc.CoaxialInstruments(), "CoaxialInstruments: tree is missing; it takes VesselTree"),
    "missing of any type": (lambda box: xc.open(), "open: path is missing; it takes str | os.PathLike[str]"),
    "too many": (lambda box: box.cast(1, 2, 3), "cast: takes 2 arguments by position, but was given 3"),
    "by position": (lambda box: xc.Fluoroscope("cine"), "Fluoroscope: takes 0 arguments by position, but was given 1"),
    "None": (lambda box: box.project(lao=None), "project: lao takes numbers, but was given None"),
    "None as text": (lambda box: xc.phantom(None), "phantom: name takes str, but was given None"),
    "a text": (lambda box: box.cast("8"), "cast: layers takes int | None, but was given str"),
    "a fraction": (lambda box: box.cast(2.5), "cast: layers takes int | None, but was given float"),
    "an integer too large": (lambda box: box.cast(10**20), "cast: layers takes int | None, but not this int"),
    "an integer below zero": (lambda box: xc.phantom("box", seed=-1), "phantom: seed takes int, but not this int"),
    "one of several": (lambda box: box.cast(10**20, angles=np.int64(9)),
                       "cast: layers takes int | None, but not this int; or angles takes int | None, but not this int64"),
    "a list of texts": (lambda box: box.cast(radii=["a"]), "cast: radii takes str | Sequence[float] | None, but not this list"),
    "an integer as bool": (lambda box: box.cast(keep_table=1), "cast: keep_table takes True or False, but was given int"),
    "NumPy's bool": (lambda box: box.cast(keep_table=np.True_), "cast: keep_table takes True or False, but not this bool"),
    "a path as a name": (lambda box: xc.use_device(pathlib.Path("a")),
                         "use_device: name takes str, but was given pathlib.PosixPath"),
    "text beyond UTF-8": (lambda box: xc.use_device("\ud800"), "use_device: name takes str, but not this str"),
    "another class": (lambda box: xc.Catheter(box, "cobra-5f"), "Catheter: tree takes VesselTree, but was given Scan"),
    "another self": (lambda box: xc.Scan.cast(3), "cast: self must be of its class, but is int"),
}


@pytest.mark.parametrize("case", CASES)
def test_is_refused_in_one_line(box, case):
    call, message = CASES[case]
    with pytest.raises(TypeError) as error:
        call(box)
    assert str(error.value) == message


def bound_functions():
    yield from ((name, getattr(xc, name)) for name in ("compare", "devices", "open", "phantom", "use_device"))
    for name in xc.__all__:
        kind = getattr(xc, name)
        if inspect.isclass(kind) and kind.__module__ == "xraycast._core":
            yield from ((f"{name}.{method}", function) for method, function in vars(kind).items()
                        if type(function).__name__ in ("nb_func", "nb_method"))


@pytest.mark.parametrize("name, function", list(bound_functions()))
def test_every_function_speaks_in_one_line(name, function):
    with pytest.raises(TypeError) as error:
        function(*[object()] * 30)
    assert "takes" in str(error.value) and "by position" in str(error.value) and "\n" not in str(error.value)
