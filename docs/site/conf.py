"""The site's settings: docs/tools/site.py gathers the pages and calls Sphinx."""
import pathlib
import re
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE / "python"))

project = "xraycast"
release = re.search(r"project\(xraycast VERSION ([0-9.]+)", (HERE / "CMakeLists.txt").read_text())[1]
root_doc = "index"
extensions = ["myst_parser", "sphinx.ext.autodoc"]
exclude_patterns = ["README.md", "**/node_modules", "docs/site", "docs/tools", "docs/images"]
html_theme = "furo"
html_title = f"xraycast {release}"
html_copy_source = False
html_show_sourcelink = False

# Headings have anchors as the forge makes them.
myst_heading_anchors = 4


def without_folders(app, page, source):
    """A link to a folder, which the forge shows, leads to the folder's page, or is its words."""
    here = pathlib.Path(app.env.doc2path(page)).parent

    def link(found):
        words, target = found.groups()
        folder = here / target
        if not folder.is_dir():
            return found[0]
        return f"[{words}]({target}/README.md)" if (folder / "README.md").is_file() else words

    source[0] = re.sub(r"(?<!!)\[([^\[\]]+)\]\(([\w./-]+)\)", link, source[0])


def arguments_apart(app, what, name, thing, options, lines):
    """A docstring has a line for each argument, `name: what it is`, which becomes a paragraph."""
    lines[:] = [part for line in lines for part in (["", line] if re.match(r"[A-Za-z_][\w, ]*: ", line) else [line])]


def setup(app):
    app.connect("autodoc-process-docstring", arguments_apart)
    app.connect("source-read", without_folders)


autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_mock_imports = ["gymnasium", "torch"]
python_use_unqualified_type_names = True
