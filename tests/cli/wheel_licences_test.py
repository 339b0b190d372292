#!/usr/bin/env python3
"""The licences and libraries that packaging/wheel.py lets into a wheel. usage: wheel_licences_test.py PACKAGING_FOLDER"""
import json
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, sys.argv.pop())
import wheel  # noqa: E402

UNDER_THE_GPL = """Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
License: as Debian builds it, under the GPL

Files: *
License: Apache-2.0
"""
OF_UTIL_LINUX = "Format: 1.0\n\nFiles:\n *\nLicense: GPL-2+\n\nFiles: libuuid/*\nLicense: BSD-3-clause\n"
OF_A_LIBRARY = "Format: 1.0\n\nFiles: *\nLicense: LGPL-2.1+\n\nFiles: debian/*\nLicense: GPL-2+\n"


class WheelLicences(unittest.TestCase):
    def test_allows_what_is_listed(self):
        for expression in ("BSD-3-Clause", "GPL-3.0-or-later WITH GCC-exception-3.1", "FTL OR GPL-2.0-or-later", "LGPL-2.1-or-later",
                           "(MIT OR SSPL-1.0) AND Zlib", "GPL-2.0-only OR MIT AND Zlib"):
            with self.subTest(expression):
                self.assertTrue(wheel.is_allowed(expression))

    def test_refuses_all_else(self):
        for expression in ("GPL-2.0-or-later", "gpl-3.0-only", "GPL2", "SSPL-1.0", "MIT AND GPL-3.0-only", "AGPL-3.0-only OR GPL-2.0-only",
                           "GPL-2.0-only AND (MIT OR BSD-3-Clause)", "GPL-2.0-only AND MIT OR SSPL-1.0",
                           "GPL-2.0-only WITH Classpath-exception-2.0"):
            with self.subTest(expression):
                self.assertFalse(wheel.is_allowed(expression))
                with self.assertRaisesRegex(wheel.Refused, "lib.so: Debian's package libb is under "):
                    wheel.licence_of("libb", "lib.so", {"libb": (expression, "")})

    def test_refuses_what_is_no_expression(self):
        for text in ("", "MIT OR", "(MIT", "MIT)", "MIT BSD-3-Clause", "AND MIT", "MIT WITH"):
            with self.subTest(text), self.assertRaisesRegex(wheel.Refused, "is no SPDX expression"):
                wheel.is_allowed(text)

    def test_refuses_what_nobody_has_read(self):
        with self.assertRaisesRegex(wheel.Refused, "libx is not in wheel_licences.txt; read"):
            wheel.licence_of("libx", "libx.so", {})

    def test_wants_a_reason_where_the_package_is_under_the_gpl(self):
        known = wheel.licences_in("a Apache-2.0\nb Apache-2.0; it is linked to no FFTW  # read in May\n")
        for text in (UNDER_THE_GPL, OF_UTIL_LINUX):
            with self.assertRaisesRegex(wheel.Refused, "has the GPL for all of it; write in wheel_licences.txt"):
                wheel.licence_of("a", "liba.so", known, text)
            self.assertEqual(wheel.licence_of("b", "libb.so", known, text), ("Apache-2.0", "it is linked to no FFTW"))
        self.assertEqual(wheel.licence_of("a", "liba.so", known, OF_A_LIBRARY), ("Apache-2.0", ""))

    def test_all_that_are_known_may_be_in_the_wheel(self):
        known = wheel.licences_in(pathlib.Path(wheel.GIVEN).read_text())
        self.assertGreater(len(known), 40)
        for package in known:
            file = wheel.DOCUMENTS / package / "copyright"
            wheel.licence_of(package, package, known, file.read_text(errors="replace") if file.exists() else "")
        for package in wheel.COMPILED_IN:
            self.assertIn(package, known)

    def test_finds_the_common_licences(self):
        self.assertEqual(wheel.common_licences_in("see /usr/share/common-licenses/GPL-2.\n(/usr/share/common-licenses/Apache-2.0)"),
                         ["Apache-2.0", "GPL-2"])


class WheelLibraries(unittest.TestCase):
    def test_needs_are_bundled_or_of_any_linux(self):
        wheel.check_needs("liba.so", ["libc.so.6", "libstdc++.so.6", "libb-12345678.so.1"], {"libb-12345678.so.1"})
        for name in ("libexpat.so.1", "libX11.so.6", "libb.so.1"):
            with self.assertRaisesRegex(wheel.Refused, f"liba.so: needs {name}, which is not in the wheel"):
                wheel.check_needs("liba.so", [name], set())

    def test_fftw_is_refused_also_where_it_is_bundled(self):
        for name in ("libfftw3.so.3", "libfftw3f_threads-12345678.so.3"):
            with self.assertRaisesRegex(wheel.Refused, f"libx.so: needs {name}, which is under the GPL"):
                wheel.check_needs("libx.so", [name], {name})

    def test_sbom_names_what_auditwheel_did_not_find(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "sbom.json"
            file.write_text(json.dumps({"components": [{"name": "zlib1g"}], "dependencies": [{"ref": "x", "dependsOn": ["z"]}]}))
            wheel.complete_sbom(file, {"zlib1g", "libc6"})
            sbom = json.loads(file.read_text())
        self.assertEqual([component["name"] for component in sbom["components"]], ["zlib1g", "libc6"])
        self.assertRegex(sbom["components"][1]["purl"], r"^pkg:deb/debian/libc6@2\.\d+-\d[^+:]*$")
        self.assertEqual(sbom["dependencies"][0]["dependsOn"], ["z", sbom["components"][1]["bom-ref"]])

    def test_size_is_bounded(self):
        wheel.check_size("a.whl", 50_000_000, wheel.MOST_BYTES)
        with self.assertRaisesRegex(wheel.Refused, "a.whl: 51 MB are more than 50"):
            wheel.check_size("a.whl", 51_000_000, wheel.MOST_BYTES)


if __name__ == "__main__":
    unittest.main()
