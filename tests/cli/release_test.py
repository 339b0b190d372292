#!/usr/bin/env python3
"""What packaging/release.py refuses, and what it makes. usage: release_test.py PACKAGING_FOLDER [RELEASE_FOLDER]; with a folder
that `./dev release` made, that is looked at too."""
import hashlib
import json
import pathlib
import re
import subprocess
import sys
import tarfile
import tempfile
import unittest
import zipfile

MADE = pathlib.Path(sys.argv.pop()) if len(sys.argv) > 2 else None
sys.path.insert(0, sys.argv.pop())
import release  # noqa: E402

CHANGELOG = "# Changelog\n\n## 1.2.0\n\n### Added\n\n- A window.\n\n## 1.1.0\n\n- A door.\n"


def git(root, *arguments):
    subprocess.run(["git", "-C", root, "-c", "user.name=x", "-c", "user.email=x@localhost", "-c", "commit.gpgsign=false", *arguments],
                   check=True, capture_output=True)


class Checks(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        (self.root / "CHANGELOG.md").write_text(CHANGELOG)
        (self.root / "CMakeLists.txt").write_text("project(xraycast VERSION 1.2.0 LANGUAGES CXX)\n")
        git(self.root, "init", "-q")
        git(self.root, "add", ".")
        git(self.root, "commit", "-qm", "all: Begin")

    def refused(self, tag, words):
        with self.assertRaises(release.Refused) as refused:
            release.check(tag, self.root)
        self.assertRegex(str(refused.exception), words)
        self.assertNotIn("\n", str(refused.exception))

    def test_a_clean_tag_passes(self):
        git(self.root, "tag", "1.2.0")
        release.check("1.2.0", self.root)
        git(self.root, "tag", "-d", "1.2.0")
        git(self.root, "tag", "-a", "1.2.0", "-m", "with a message of its own")
        release.check("1.2.0", self.root)

    def test_refuses_what_is_no_version(self):
        for tag in ("", "v1.2.0", "1.2", "1.2.0-rc1", "../1.2.0", "1.2.0\n"):
            with self.subTest(tag):
                self.refused(tag, "must be a version")

    def test_refuses_a_missing_tag(self):
        self.refused("1.2.0", "there is no tag 1.2.0; ")

    def test_a_branch_is_no_tag(self):
        git(self.root, "branch", "1.2.0")
        self.refused("1.2.0", "there is no tag 1.2.0; ")

    def test_refuses_another_commit(self):
        git(self.root, "tag", "1.2.0")
        git(self.root, "commit", "--allow-empty", "-qm", "all: Go on")
        self.refused("1.2.0", "`git checkout 1.2.0` first")

    def test_refuses_what_is_changed_or_new(self):
        git(self.root, "tag", "1.2.0")
        (self.root / "new.txt").write_text("")
        self.refused("1.2.0", "^new.txt is changed or new")
        (self.root / "new.txt").unlink()
        (self.root / "CMakeLists.txt").write_text("project(xraycast VERSION 1.2.0)\n")
        self.refused("1.2.0", "^CMakeLists.txt is changed or new")

    def test_refuses_without_a_section(self):
        git(self.root, "tag", "1.3.0")
        self.refused("1.3.0", "no section `## 1.3.0`")

    def test_refuses_an_empty_section(self):
        (self.root / "CHANGELOG.md").write_text("## 1.2.0\n\n## 1.1.0\n\n- A door.\n")
        git(self.root, "commit", "-aqm", "all: Go on")
        git(self.root, "tag", "1.2.0")
        self.refused("1.2.0", "no section `## 1.2.0`")

    def test_refuses_the_version_of_another_build(self):
        git(self.root, "tag", "1.1.0")
        self.refused("1.1.0", "CMakeLists.txt says that this is 1.2.0, not 1.1.0")


class Parts(unittest.TestCase):
    def test_notes_are_the_section(self):
        self.assertEqual(release.section_of(CHANGELOG, "1.2.0"), "### Added\n\n- A window.\n")
        self.assertEqual(release.section_of(CHANGELOG, "1.1.0"), "- A door.\n")
        self.assertRaises(release.Refused, release.section_of, CHANGELOG, "1x2.0")  # a dot is a dot

    def test_first_choices_of_dependencies(self):
        self.assertEqual(release.names_needed("libc6 (>= 2.36), libgl1 | libopengl0, python3:any, x(= 1)"), {"libc6", "libgl1", "python3", "x"})

    def files(self, *without):
        debs = ["xraycast_1.2.0_amd64.deb", "libxraycast1.2_1.2.0_amd64.deb", "libxraycast-c1.2_1.2.0_amd64.deb",
                "libxraycast-dev_1.2.0_amd64.deb", "python3-xraycast_1.2.0_amd64.deb"]
        wheels = [f"xraycast-1.2.0-{tags}-manylinux_2_36_x86_64.whl" for tags in ("cp312-abi3", "cp311-cp311")]
        return [pathlib.Path(name) for name in debs + wheels if name not in without]

    def test_all_files_must_be_there(self):
        release.check_files(self.files(), "1.2.0")
        for file in self.files():
            with self.subTest(file.name), self.assertRaises(release.Refused):
                release.check_files(self.files(file.name), "1.2.0")

    def test_files_of_another_version_are_refused(self):
        with self.assertRaisesRegex(release.Refused, "xraycast_1.2.0_amd64.deb: is not of version 1.3.0"):
            release.check_files(self.files(), "1.3.0")

    def test_sums_are_those_of_sha256sum(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            (folder / "a").write_bytes(b"abc")
            release.write_sums(folder)
            # FIPS 180-2, B.1
            self.assertEqual((folder / "SHA256SUMS").read_text(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  a\n")
            subprocess.run(["sha256sum", "--check", "--strict", "--quiet", "SHA256SUMS"], cwd=folder, check=True)


@unittest.skipUnless(MADE, "needs the folder of a release")
class Made(unittest.TestCase):
    def test_sums_are_right_and_of_all_files(self):
        subprocess.run(["sha256sum", "--check", "--strict", "--quiet", "SHA256SUMS"], cwd=MADE, check=True)
        listed = [line.split("  ")[1] for line in (MADE / "SHA256SUMS").read_text().splitlines()]
        self.assertEqual(sorted([*listed, "SHA256SUMS"]), sorted(file.name for file in MADE.iterdir()))

    def test_packages_and_wheels_are_all_there(self):
        release.check_files([file for file in MADE.iterdir() if file.suffix in (".deb", ".whl")], MADE.name)

    def test_notes_are_the_section_of_the_archive(self):
        with tarfile.open(MADE / f"xraycast-{MADE.name}.tar.gz") as archive:
            names = archive.getnames()
            changelog = archive.extractfile(f"xraycast-{MADE.name}/CHANGELOG.md").read().decode()
        self.assertEqual((MADE / "NOTES.md").read_text(), release.section_of(changelog, MADE.name))
        self.assertIn(f"xraycast-{MADE.name}/dev", names)
        self.assertFalse([name for name in names if "/build/" in name or "/.git/" in name])

    def check_sbom(self, file):
        sbom = json.loads(file.read_text())
        self.assertEqual(sbom["bomFormat"], "CycloneDX")
        for component in sbom["components"]:
            self.assertTrue(component["name"] and component["version"], component)
        return {component["name"]: component for component in sbom["components"]}

    def test_sbom_of_the_packages_names_what_they_need(self):
        found = self.check_sbom(MADE / f"xraycast-{MADE.name}.cdx.json")
        for name in ("xraycast", "python3-xraycast", "ocl-icd-libopencl1", "pocl-opencl-icd", "libopencv-imgproc406", "libopenvdb10.0",
                     "libopenimageio2.4", "libgdcm3.0", "libglfw3", "libopenigtlink1.11", "libc6"):
            self.assertIn(name, found)
        self.assertEqual(found["xraycast"]["version"], MADE.name)
        self.assertEqual(found["xraycast"]["licenses"], [{"license": {"id": "Apache-2.0"}}])
        self.assertEqual(found["xraycast"]["purl"], f"pkg:generic/xraycast@{MADE.name}")
        self.assertRegex(found["libopenvdb10.0"]["purl"], r"^pkg:deb/debian/libopenvdb10\.0@10")

    def test_sbom_of_a_wheel_names_what_it_bundles(self):
        for wheel in MADE.glob("*.whl"):
            found = self.check_sbom(MADE / f"{wheel.name}.cdx.json")
            bundled = {re.sub(r"-[0-9a-f]{8}(?=\.).*", "", pathlib.Path(name).name) for name in zipfile.ZipFile(wheel).namelist()
                       if ".libs/lib" in name}
            for name, library in (("ocl-icd-libopencl1", "libOpenCL"), ("libopencv-imgproc406", "libopencv_imgproc"), ("libopenvdb10.0", "libopenvdb")):
                self.assertIn(name, found)
                self.assertIn(library, bundled)


class OtherProcessors(unittest.TestCase):
    def test_leaves_what_it_has_not_made(self):
        with tempfile.TemporaryDirectory() as folder:
            kept = pathlib.Path(folder, "root", "kept.txt")
            kept.parent.mkdir()
            kept.write_text("kept")
            script = pathlib.Path(release.__file__).with_name("arm64.sh")
            done = subprocess.run(["bash", script, folder], capture_output=True, text=True)
            self.assertEqual(done.returncode, 2)
            self.assertRegex(done.stderr, r"\Aarm64.sh: [^\n]*root is there and was not made by this script[^\n]*\n\Z")
            self.assertEqual(kept.read_text(), "kept")


if __name__ == "__main__":
    unittest.main()
