#!/usr/bin/env python3
"""The site of `./dev docs`: all pages, and no link leads to nothing. usage: site_test.py ROOT STUB; 77 where Sphinx is missing."""
import html.parser
import importlib.util
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import urllib.parse

SKIPPED = 77
STUB, ROOT = pathlib.Path(sys.argv.pop()), pathlib.Path(sys.argv.pop())


class Page(html.parser.HTMLParser):
    def __init__(self, file):
        super().__init__()
        self.anchors, self.links = set(), []
        self.feed(file.read_text())

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name == "id" or (tag == "a" and name == "name"):
                self.anchors.add(value)
            elif name in ("href", "src") and value:
                self.links.append(value)


def dead_links(folder):
    """(page, link) of all whose file or anchor is not in the folder; those with a scheme are left out, for they take a network."""
    pages = {file.resolve(): Page(file) for file in folder.rglob("*.html")}
    dead = []
    for file, page in pages.items():
        for link in page.links:
            parts = urllib.parse.urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (file.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else file
            anchor = urllib.parse.unquote(parts.fragment)
            if not target.is_file() or not target.is_relative_to(folder.resolve()):
                dead.append((file.name, link))
            # An empty anchor is the page's top.
            elif anchor and target in pages and anchor not in pages[target].anchors:
                dead.append((file.name, link))
    return dead


class Checker(unittest.TestCase):
    def test_finds_what_is_dead_and_nothing_else(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            (folder / "sub").mkdir()
            (folder / "a.html").write_text('<h1 id="top">A</h1><a href="sub/b.html#part">b</a><a href="#top">t</a><a href="https://x">x</a>'
                                           '<a href="sub/none.html">n</a><a href="#bottom">b</a><img src="p.png"><a href="../outside">o</a>')
            (folder / "sub/b.html").write_text('<a name="part"></a><a href="../a.html#middle">m</a><a href="../a.html">a</a>')
            self.assertEqual(sorted(dead_links(folder)), [("a.html", "#bottom"), ("a.html", "../outside"), ("a.html", "p.png"),
                                                          ("a.html", "sub/none.html"), ("b.html", "../a.html#middle")])


class Site(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        made = tempfile.TemporaryDirectory()
        cls.addClassCleanup(made.cleanup)
        cls.folder = pathlib.Path(made.name) / "site"
        done = subprocess.run([sys.executable, ROOT / "docs/tools/site.py", STUB, cls.folder], capture_output=True, text=True)
        if done.returncode:  # Sphinx's warnings, such as a link to nothing
            raise AssertionError(done.stdout + done.stderr)

    def test_no_link_is_dead(self):
        self.assertEqual(dead_links(self.folder), [])

    def test_every_document_is_a_page_of_the_contents(self):
        first = Page(self.folder / "index.html").links
        for document in [*(ROOT / "docs").glob("*.md"), ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", ROOT / "SECURITY.md"]:
            self.assertIn(f"{document.relative_to(ROOT).with_suffix('.html')}", first)

    def test_python_page_tells_of_every_name(self):
        page = Page(self.folder / "python-api.html")
        init = (ROOT / "python/xraycast/__init__.py").read_text()
        names = re.findall(r'"(\w+)"', init.partition("__all__")[2])
        self.assertGreater(len(names), 20)
        for name in names:
            self.assertTrue({f"xraycast.{name}", f"xraycast._core.{name}"} & page.anchors, name)
        self.assertIn("xraycast.Scan.project", page.anchors)
        self.assertIn("xraycast.gym.ReachTarget", page.anchors)


class Gallery(unittest.TestCase):
    def test_shows_every_picture_with_the_line_that_made_it(self):
        text = (ROOT / "docs/gallery.md").read_text()
        for picture in (ROOT / "docs/images").iterdir():
            self.assertRegex(text, rf"!\[[^\]]+\]\(images/{re.escape(picture.name)}\)\n(!\[.*\n)*\n```\n\S", picture.name)


if __name__ == "__main__":
    if missing := [name for name in ("sphinx", "myst_parser", "furo") if not importlib.util.find_spec(name)]:
        print(f"skipped: there is no {', '.join(missing)}; ./dev setup installs it")
        sys.exit(SKIPPED)
    unittest.main()
