"""The errors of the package; their messages are those of the command line."""
import ast
import re


class Error(Exception):
    """A call failed, for example because the disk is full."""


class InputError(Error, ValueError):
    """Data or arguments cannot be used; the message names them and says what to do."""


class DeviceError(Error, RuntimeError):
    """OpenCL is missing or failed."""


def in_one_line(message):
    """What nanobind says of arguments that a function does not take: which one, what was given, and what it takes."""
    try:
        signature, given = re.fullmatch(r".*?^    1\. (.*?\)) -> .*?^Invoked with types: (.*)", message, re.M | re.S).groups()
        function = ast.parse(f"def {signature}: ...").body[0]
        positional, _, named = _short(given).removesuffix(" }").partition("kwargs = { ")
        positional = [kind for kind in positional.split(", ") if kind]
        named = [pair.rsplit(": ", 1) for pair in named.split(", ") if pair]
        call = positional[0] if function.name == "__init__" else function.name
        message = f"{call}: {_complaint(function.args, positional, named)}"
    except Exception:  # a default or a name that is none in Python
        pass
    return " ".join(message.split())


def _short(text):
    return re.sub(r"\b(xraycast\._core|collections\.abc|numpy\.typing|xraycast\._progress)\.", "", text).replace("NoneType", "None")


def _in_words(annotation):
    words = re.sub(r"\bArrayLike\b", "numbers", re.sub(r"^object\b", "a value", _short(annotation)))
    return re.sub(r"^bool\b", "True or False", words)


def _complaint(arguments, positional, named):
    """`arguments` as ast has them; the types of what was given."""
    places = arguments.posonlyargs + arguments.args
    takes = {a.arg: _in_words(ast.unparse(a.annotation)) for a in places + arguments.kwonlyargs if a.annotation}  # all but self
    if len(positional) > len(places):
        selfs = sum(a.arg not in takes for a in places)
        return f"takes {len(places) - selfs} arguments by position, but was given {len(positional) - selfs}"
    given = dict(zip([a.arg for a in places], positional))
    for name, kind in named:
        if name in given:
            return f"{name} is given twice"
        if name not in takes:
            return f"there is no argument {name}; it takes {', '.join(takes) or 'none'}"
        given[name] = kind
    optional = places[len(places) - len(arguments.defaults):]
    optional += [a for a, default in zip(arguments.kwonlyargs, arguments.kw_defaults) if default]
    for name in takes:
        if name not in given and name not in [a.arg for a in optional]:
            return f"{name} is missing; it takes {takes[name]}"
    for name, kind in given.items():
        if name in takes and not _may_take(takes[name], kind):
            return f"{name} takes {takes[name]}, but was given {kind}"
    # Its value must decide: an integer that is too large, a list of something else.
    suspects = {name: kind for name, kind in given.items() if name in takes and not _takes_all(takes[name])}
    suspects = {name: kind for name, kind in suspects.items() if kind not in ("str", "bool", "None")} or suspects
    return "; or ".join(f"{name} takes {takes[name]}, but not this {kind}" for name, kind in suspects.items()) or (
        f"self must be of its class, but is {given.get('self')}")


def _takes_all(takes):
    """Whether the function itself looks at what is given (python/arguments.hpp)."""
    return bool(set(re.findall(r"\w+", takes)) & {"value", "object", "numbers", "Listener", "Any", "Fluoroscope", "Vessels", "Catheter"})


def _may_take(takes, kind):
    """Whether some values of the kind are taken."""
    words = set(re.findall(r"\w+", takes))
    if kind == "None":
        return "None" in words
    if _takes_all(takes) or kind in words:
        return True
    if kind == "bool" and "True" in words:
        return True
    if re.fullmatch(r"bool|int|(u?int|float)\d+", kind):  # or NumPy's
        return bool(words & {"int", "float"})
    if kind.startswith("pathlib."):
        return "PathLike" in words
    return "Sequence" in words and kind in ("list", "tuple", "range", "ndarray")
