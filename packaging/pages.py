"""pages.py PROGRAM FOLDER: the manual page xraycast.1 and the completions for bash and zsh, made from what PROGRAM's
--help says, so that they name every subcommand and option that it takes."""
import dataclasses
import pathlib
import re
import subprocess
import sys


@dataclasses.dataclass
class Option:
    usage: str  # as --help writes it: names, value, default
    purpose: str

    @property
    def names(self):
        return self.usage.split(" ")[0].split(",")

    @property
    def takes_value(self):
        return " " in self.usage.split(" Needs:")[0]

    @property
    def choices(self):
        listed = re.search(r"\{([^}]*)\}", self.usage)
        return listed[1].split(",") if listed else []


@dataclasses.dataclass
class Command:
    name: str
    purpose: str
    usage: str
    positionals: list
    options: list
    subcommands: list  # (name, purpose)
    footer: str


def parse(name, text):
    """--help as CLI11 writes it: purpose and usage, sections of entries, and from "Examples:" on the footer."""
    head, _, footer = text.partition("\nExamples:\n")
    purpose, usage = re.match(r"(.*)\nUsage: (.*)\n", head).groups()
    sections = {"Positionals:": [], "Options:": [], "Subcommands:": []}
    section = None
    for line in head.splitlines()[2:]:
        if line in sections:
            section = sections[line]
        elif re.match(r"  \S", line):
            entry, _, told = line[2:].partition("  ")
            section.append(Option(entry, told.strip()))
        elif line.strip():
            section[-1].purpose = (section[-1].purpose + " " + line.strip()).strip()
    return Command(name, purpose, usage, sections["Positionals:"], sections["Options:"],
                   [(s.usage, s.purpose) for s in sections["Subcommands:"]], footer.rstrip("\n"))


def read_commands(program):
    ask = lambda *words: subprocess.run([program, *words, "--help"], check=True, capture_output=True, text=True).stdout
    top = parse("xraycast", ask())
    return top, [parse(name, ask(name)) for name, _ in top.subcommands]


def roff(text):
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^([.'])", r"\\&\1", text, flags=re.MULTILINE)


def manual_of(entries):
    return [line for e in entries for line in (".TP", f".B {roff(e.usage)}", roff(e.purpose) or "\\&")]


def manual(top, commands, version):
    lines = [f'.TH XRAYCAST 1 "" "xraycast {version}" "User Commands"', ".SH NAME", roff("xraycast - " + top.purpose.removeprefix("xraycast ")),
             ".SH SYNOPSIS", ".B " + roff(top.usage), ".SH OPTIONS",
             "These are accepted after a subcommand too.", *manual_of(top.options), ".SH SUBCOMMANDS"]
    for command in commands:
        lines += [f".SS {roff(command.name)}", roff(command.purpose) + ".", ".PP", ".B " + roff(command.usage),
                  *manual_of(command.positionals + command.options), ".PP", "Examples:", ".PP", ".nf",
                  roff(command.footer), ".fi"]
    lines += [".SH EXIT STATUS",
              "0 done, 1 failed, 2 wrong usage, 3 unusable values or files, "
              "4 OpenCL device failed, 128 plus the signal's number after a signal.",
              ".SH ENVIRONMENT", ".TP", ".B XRAYCAST_DEVICE", roff("The OpenCL device, as --device."),
              ".TP", ".B XRAYCAST_GL_DEVICE", "The OpenGL device for drawing without a display, by number or part of its name."]
    return "\n".join(lines) + "\n"


def bash(top, commands):
    common = [name for option in top.options for name in option.names]
    lines = ["# bash completion for xraycast", "_xraycast() {",
             '  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} subcommand= options= w',
             '  for w in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do',
             f'    case $w in {"|".join(c.name for c in commands)}) subcommand=$w; break ;; esac',
             "  done", "  COMPREPLY=()", "  case $subcommand:$before in"]
    for command in commands:
        for option in command.options:
            if option.choices:
                pattern = "|".join(f"{command.name}:{name}" for name in option.names)
                lines.append(f'    {pattern}) COMPREPLY=($(compgen -W "{" ".join(option.choices)}" -- "$word")); return ;;')
    lines += ["  esac", "  case $subcommand in"]
    for command in commands:
        names = [name for option in command.options for name in option.names]
        lines.append(f'    {command.name}) options="{" ".join(dict.fromkeys(names + common))}" ;;')
    lines += [f'    *) options="{" ".join([c.name for c in commands] + common)}" ;;', "  esac",
              '  if [[ $word == -* || -z $subcommand ]]; then COMPREPLY=($(compgen -W "$options" -- "$word")); fi',
              "}", "complete -o default -F _xraycast xraycast"]
    return "\n".join(lines) + "\n"


def zsh_specs(options):
    quoted = lambda text: re.sub(r"([\[\]:\\])", r"\\\1", text).replace("'", "'\\''")
    for option in options:
        value = ":value:" + (f"({' '.join(option.choices)})" if option.choices else "_files") if option.takes_value else ""
        for name in option.names:
            yield f"'*{name}[{quoted(option.purpose)}]{value}'"


def zsh(top, commands):
    lines = ["#compdef xraycast", "_xraycast() {", "  local -a subcommands", "  subcommands=("]
    lines += ["    '{}:{}'".format(c.name, c.purpose.replace("'", "'\\''").replace(":", "\\:")) for c in commands]
    lines += ["  )", "  local subcommand=${words[(r)(" + "|".join(c.name for c in commands) + ")]}",
              "  case $subcommand in"]
    for command in commands:
        specs = " \\\n        ".join([*zsh_specs(command.options + top.options[1:]), "'*:file:_files'"])
        lines += [f"    {command.name})", f"      _arguments \\\n        {specs} ;;"]
    specs = " \\\n        ".join(zsh_specs(top.options))
    lines += ["    *)", f"      _arguments \\\n        {specs} \\\n        '1: :->subcommand'",
              "      _describe subcommand subcommands ;;", "  esac", "}", '_xraycast "$@"']
    return "\n".join(lines) + "\n"


def main(program, folder):
    top, commands = read_commands(program)
    version = subprocess.run([program, "--version"], check=True, capture_output=True, text=True).stdout.strip()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "xraycast.1").write_text(manual(top, commands, version))
    (folder / "xraycast.bash").write_text(bash(top, commands))
    (folder / "_xraycast").write_text(zsh(top, commands))


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]))
