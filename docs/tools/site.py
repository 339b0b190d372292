#!/usr/bin/env python3
"""Makes the site of all documents.

    docs/tools/site.py STUB FOLDER [CPP]

STUB: _core.pyi, from which the pages of the Python package are made; the compiled module is not needed. FOLDER: the site. CPP: the
folder of Doxygen's pages, which the site takes in. Fails on a warning, such as a link to nothing.
"""
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Beside README.md, which is the first page: what is shown, in this order.
CHAPTERS = {
    "Use": ["docs/guide", "docs/commands", "docs/web", "docs/python", "docs/cohorts", "docs/exercises", "docs/haptics", "docs/gallery"],
    "Models and figures": ["docs/fluoroscopy", "docs/vessels", "docs/lesions", "docs/angiography", "docs/blood-flow", "docs/simulation", "docs/motion",
                           "docs/motion-models", "docs/moving-maps", "docs/registration", "docs/realism",
                           "docs/accuracy", "docs/performance", "docs/reliability", "docs/glossary", "simulation/instruments/README"],
    "Interfaces": ["python-api", "docs/api", "examples/README"],
    "Development": ["docs/architecture", "CONTRIBUTING", "CHANGELOG", "SECURITY"],
}
GATHERED = ("CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "LICENSE", "CMakeLists.txt", "docs", "examples", "rooms.txt",
            "stable.txt", "simulation", "web")
MODULES = {"xraycast.gym": "An environment of Gymnasium", "xraycast.torch": "Gradients in PyTorch", "xraycast.similarity": "Similarities of pictures"}


HEADERS = """# The C++ headers

<a href="cpp/index.html">The pages of all public headers</a>, made by Doxygen; [The C++ libraries](docs/api.md) says which are stable.
"""


def first_page(has_cpp):
    """README.md, with the contents of the site."""
    lines = [(ROOT / "README.md").read_text()]
    for caption, pages in CHAPTERS.items():
        pages = pages + (["headers"] if has_cpp and caption == "Interfaces" else [])
        lines += ["```{toctree}", ":hidden:", f":caption: {caption}", "", *pages, "```", ""]
    return "\n".join(lines)


def python_page(names):
    """What the package exports, from the stub."""
    lines = ["# The Python package", "", "What `import xraycast` gives; [Python](docs/python.md) tells how it goes together.", "",
             "```{eval-rst}", ".. currentmodule:: xraycast", ""]
    for name, kind in names:
        lines += [f".. auto{kind}:: {name}"] + ([] if kind == "function" else ["   :members:", "   :undoc-members:", "   :special-members: __call__, __len__, __getitem__"]) + [""]
    lines += ["```", ""]
    for module, purpose in MODULES.items():
        lines += [f"## {purpose}", "", "```{eval-rst}", f".. automodule:: {module}", "   :members:", "```", ""]
    return "\n".join(lines)


def gather(stub, source):
    """All pages in one folder, where their links to each other hold."""
    for name in GATHERED:
        (source / name).symlink_to(ROOT / name)
    shutil.copy(ROOT / "docs/site/conf.py", source)
    package = source / "python" / "xraycast"
    shutil.copytree(ROOT / "python" / "xraycast", package, ignore=shutil.ignore_patterns("cohort", "__pycache__"))
    # Annotations are not evaluated, and so a stub is a module.
    (package / "_core.py").write_text("from __future__ import annotations\nimport typing\n" + stub.read_text() + '\n__version__ = ""\n')


def exported(source):
    """(name, kind for autodoc), in the order of __all__."""
    code = ("import inspect, xraycast as x\n"
            "for n in x.__all__: v = getattr(x, n); print(n, 'function' if not inspect.isclass(v) else 'exception' if issubclass(v, Exception) "
            "else 'class')")
    return [line.split() for line in subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True,
                                                    cwd=source / "python").stdout.splitlines()]


def main(stub, folder, cpp=None):
    folder = pathlib.Path(folder)
    with tempfile.TemporaryDirectory() as scratch:
        source = pathlib.Path(scratch) / "source"
        source.mkdir()
        gather(pathlib.Path(stub), source)
        (source / "index.md").write_text(first_page(cpp))
        if cpp:
            (source / "headers.md").write_text(HEADERS)
        (source / "python-api.md").write_text(python_page(exported(source)))
        shutil.rmtree(folder, ignore_errors=True)
        made = subprocess.run([sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-d", f"{scratch}/cache", source, folder])
        if made.returncode:
            return made.returncode
    if cpp:
        shutil.copytree(cpp, folder / "cpp")
    return 0


if __name__ == "__main__":
    if not 3 <= len(sys.argv) <= 4:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
