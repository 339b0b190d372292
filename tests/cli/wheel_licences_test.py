#!/usr/bin/env python3
"""The licences that packaging/wheel.py lets into a wheel. usage: wheel_licences_test.py PACKAGING_FOLDER"""
import pathlib
import sys
import unittest

sys.path.insert(0, sys.argv.pop())
import wheel  # noqa: E402


class WheelLicences(unittest.TestCase):
    known = wheel.licences_in("liba BSD-3-Clause\n# a comment\nlibb GPL-2.0-or-later\n"
                              "libc GPL-3.0-or-later WITH GCC-exception-3.1  # the compiler's\nlibd FTL OR GPL-2.0-or-later\n"
                              "libe MIT AND GPL-3.0-only\nlibf LGPL-2.1-or-later\nlibg AGPL-3.0-only OR GPL-2.0-only\n")

    def test_refuses_the_gpl(self):
        for package in ("libb", "libe", "libg"):
            with self.assertRaisesRegex(wheel.Refused, f"lib.so: Debian's package {package} is under .*GPL"):
                wheel.licence_of(package, "lib.so", self.known)

    def test_takes_exceptions_choices_and_the_lesser_gpl(self):
        for package in ("liba", "libc", "libd", "libf"):
            self.assertNotIn("#", wheel.licence_of(package, "lib.so", self.known))

    def test_refuses_what_nobody_has_read(self):
        with self.assertRaisesRegex(wheel.Refused, "libx is not in wheel_licences.txt; read"):
            wheel.licence_of("libx", "libx.so", self.known)

    def test_all_that_are_known_may_be_in_the_wheel(self):
        known = wheel.licences_in(pathlib.Path(wheel.GIVEN).read_text())
        self.assertGreater(len(known), 40)
        for package in known:
            wheel.licence_of(package, package, known)


if __name__ == "__main__":
    unittest.main()
