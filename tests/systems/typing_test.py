"""What type checkers say: the stub of the package leaves nothing open, and the examples pass mypy --strict and pyright.

usage: typing_test.py PACKAGE_FOLDER EXAMPLES_FOLDER, by an interpreter that has mypy, numpy, Pillow and pyright.
"""
import ast
import importlib.util
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

EXAMPLES, PACKAGE = pathlib.Path(sys.argv.pop()).resolve(), pathlib.Path(sys.argv.pop()).resolve()
STUB = PACKAGE / "xraycast/_core.pyi"
FOLDER = pathlib.Path(__file__).resolve().parents[2] / "python"


def functions(tree, of=""):
    """(qualified name, function) of all in a module."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            yield from functions(node, f"{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            yield of + node.name, node


def arguments_of(function):
    return [a for a in function.args.posonlyargs + function.args.args + function.args.kwonlyargs if a.arg not in ("self", "cls")]


def is_object(annotation):
    """Whether it is `object`, alone or as a choice."""
    if isinstance(annotation, ast.BinOp):
        return is_object(annotation.left) or is_object(annotation.right)
    return isinstance(annotation, ast.Name) and annotation.id == "object"


def code_of(notebook):
    cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
    return "\n\n".join("".join(cell["source"]) for cell in cells) + "\n"


class Stub(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.functions = list(functions(ast.parse(STUB.read_text())))

    def test_no_argument_is_any_object(self):
        self.assertGreater(len(self.functions), 150)
        is_left_open = [f"{name}({a.arg})" for name, function in self.functions for a in arguments_of(function)
                        if a.annotation is None or is_object(a.annotation)]
        self.assertEqual(is_left_open, [])

    def test_is_object_finds_it(self):
        of = lambda text: ast.parse(text, mode="eval").body
        self.assertTrue(is_object(of("object")) and is_object(of("int | object | None")))
        self.assertFalse(is_object(of("Callable[[str], object] | None")))

    def test_overloads_have_the_functions_arguments(self):
        """python/stub_patterns.txt tells of functions in its own words; the functions' own are in what they say of a wrong call."""
        code = ("import xraycast as xc\nfor f in (xc.Scan.project, xc.BodyMap.render):\n"
                "    print(f.__doc__.splitlines()[0])")
        shown = subprocess.run([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": str(PACKAGE)}, capture_output=True, text=True)
        if shown.returncode:
            self.skipTest("the module is for another Python: " + shown.stderr.strip().splitlines()[-1])
        for line in shown.stdout.splitlines():
            name = line.split("(")[0]
            own = re.findall(r"(?:\(|, )(?:\*, )?(\w+): ", line.rpartition(" -> ")[0])
            ours = [[a.arg for a in arguments_of(function)] for full, function in self.functions if full.endswith(f".{name}")]
            self.assertIn(len(ours), (2, 3), name)
            for arguments in ours:
                self.assertEqual(arguments, own)


class Examples(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        made = tempfile.TemporaryDirectory()
        cls.addClassCleanup(made.cleanup)
        cls.folder = pathlib.Path(made.name)
        for script in EXAMPLES.glob("*.py"):
            (cls.folder / script.name).write_text(script.read_text())
        for notebook in EXAMPLES.glob("*.ipynb"):
            (cls.folder / f"{notebook.stem.replace('-', '_')}_notebook.py").write_text(code_of(notebook))
        cls.scripts = [script.name for script in EXAMPLES.glob("*.py")]
        cls.notebooks = [script.name for script in cls.folder.glob("*_notebook.py")]
        # Displays come with Jupyter, which these checks need not.
        (cls.folder / "IPython").mkdir()
        (cls.folder / "IPython/__init__.pyi").write_text("")
        (cls.folder / "IPython/display.pyi").write_text("class Image:\n    def __init__(self, data: bytes) -> None: ...\n")
        # The package is checked where it is made; here it is one that is installed.
        (cls.folder / "mypy.ini").write_text("[mypy]\nstrict = True\n[mypy-xraycast.*]\nfollow_imports = silent\nfollow_imports_for_stubs = True\n")

    def mypy(self, *arguments):
        done = subprocess.run([sys.executable, "-m", "mypy", "--config-file", "mypy.ini", "--cache-dir", "cache", *arguments],
                              cwd=self.folder, env={**os.environ, "MYPYPATH": str(PACKAGE)}, capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    def pyright(self, *files):
        (self.folder / "pyrightconfig.json").write_text(json.dumps({"extraPaths": [str(PACKAGE)], "include": [*files], "reportMissingModuleSource": False}))
        done = subprocess.run([sys.executable, "-m", "pyright", "--pythonpath", sys.executable], cwd=self.folder, capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    def test_scripts_pass_mypy_strict(self):
        status, said = self.mypy(*self.scripts)
        self.assertEqual(status, 0, said)

    def test_notebooks_pass_mypy_strict_but_for_functions_without_types(self):
        for notebook in self.notebooks:
            status, said = self.mypy("--allow-untyped-defs", "--allow-untyped-calls", notebook)
            self.assertEqual(status, 0, said)

    def test_all_pass_pyright(self):
        status, said = self.pyright(*self.scripts, *self.notebooks)
        self.assertEqual(status, 0, said)

    def test_wrong_calls_do_not_pass(self):
        (self.folder / "wrong.py").write_text("import xraycast as xc\nscan = xc.phantom('box', size=(8, 8, 8))\nscan.project(lao=object())\n"
                                              "scan.cast().render(vessels=3)\nxc.open(5)\n")
        status, said = self.mypy("wrong.py")
        self.assertEqual(status, 1, said)
        status, said_too = self.pyright("wrong.py")
        self.assertEqual(status, 1, said_too)
        for line in (3, 4, 5):
            self.assertRegex(said, rf"wrong\.py:{line}: error")
            self.assertRegex(said_too, rf"wrong\.py:{line}:\d+ - error")


if __name__ == "__main__":
    if missing := [name for name in ("mypy", "numpy", "PIL", "pyright") if not importlib.util.find_spec(name)]:
        print(f"skipped: there is no {', '.join(missing)}; ./dev test-systems installs it")
        sys.exit(77)
    unittest.main()
