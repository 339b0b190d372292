"""pages_test.py PROGRAM PACKAGING: the manual page and the completions against what --help names."""
import functools
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

PACKAGING, PROGRAM = sys.argv.pop(), sys.argv.pop()


@functools.cache
def help_of(*words):
    return subprocess.run([PROGRAM, *words, "--help"], check=True, capture_output=True, text=True).stdout


def options_in(text):
    """The names at the beginnings of --help's lines."""
    heads = re.findall(r"^  (-\S+)", text.partition("\nExamples:")[0], re.MULTILINE)
    return [name for head in heads for name in head.split(",")]


SUBCOMMANDS = re.findall(r"^  ([a-z]+) ", help_of().partition("Subcommands:")[2], re.MULTILINE)


class Pages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.made = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.made.name)
        subprocess.run([sys.executable, f"{PACKAGING}/pages.py", PROGRAM, cls.folder], check=True)

    @classmethod
    def tearDownClass(cls):
        cls.made.cleanup()

    def complete(self, *words):
        """What bash offers behind these words, of which the last is being typed."""
        script = f'. {self.folder}/xraycast.bash; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _xraycast; echo "${{COMPREPLY[@]}}"'
        return subprocess.run(["bash", "-c", script, "bash", "xraycast", *words], check=True, capture_output=True,
                              text=True).stdout.split()

    def test_help_names_subcommands_with_options(self):
        self.assertIn("cast", SUBCOMMANDS)
        self.assertIn("--layers", options_in(help_of("cast")))

    def test_manual_has_every_subcommand_and_option(self):
        manual = (self.folder / "xraycast.1").read_text()
        sections = dict(re.findall(r"^\.SS (\S+)\n(.*?)(?=^\.S[SH])", manual, re.MULTILINE | re.DOTALL))
        self.assertEqual(list(sections), SUBCOMMANDS)
        for subcommand, section in sections.items():
            entries = " ".join(re.findall(r"^\.B (.*)", section, re.MULTILINE)).replace("\\-", "-")
            for option in options_in(help_of(subcommand)):
                self.assertRegex(entries, rf"(^|[ ,]){option}([ ,]|$)", f"{subcommand} {option}")

    def test_bash_completes_every_subcommand_and_option(self):
        self.assertLessEqual(set(SUBCOMMANDS), set(self.complete("")))
        for subcommand in SUBCOMMANDS:
            self.assertLessEqual(set(options_in(help_of(subcommand))), set(self.complete(subcommand, "-")))

    def test_bash_completes_words_to_choose_from(self):
        self.assertEqual(self.complete("cast", "--projection", "s"), ["sphere"])

    def test_zsh_completes_every_subcommand_and_option(self):
        completion = (self.folder / "_xraycast").read_text()
        for subcommand in SUBCOMMANDS:
            self.assertIn(f"    '{subcommand}:", completion)
            arguments = re.search(rf"^    {subcommand}\)\n(.*?);;", completion, re.MULTILINE | re.DOTALL)[1]
            for option in options_in(help_of(subcommand)):
                self.assertIn(f"'*{option}[", arguments)


if __name__ == "__main__":
    unittest.main()
