"""wheel.py WHEEL FOLDER: makes a wheel that runs on any Linux of glibc 2.36 or later, in FOLDER, of one that pip built here.

What the module needs is bundled by auditwheel and patchelf, with the texts of all licences. Each licence must be known from
wheel_licences.txt, and must be one that the wheel can be passed on under: not the GPL.
"""
import importlib.metadata
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import urllib.parse
import zipfile

PLATFORM = "manylinux_2_36_x86_64"
MOST_BYTES = 50_000_000
# patchelf appends a copy of all names of a library for each that it changes: three times 22 MB in OpenVDB's.
MOST_UNPACKED_BYTES = 260_000_000
# auditwheel leaves these to the system. A system without a display has no X11, and not every Python brings expat.
ALSO_BUNDLED = {"libX11.so.6", "libXext.so.6", "libXrender.so.1", "libexpat.so.1"}
# OpenCV is linked to LAPACK, of which nothing here is called: the reference takes 11 MB less than OpenBLAS.
ALGEBRA = [folder for folder in map(pathlib.Path, ("/usr/lib/x86_64-linux-gnu/lapack", "/usr/lib/x86_64-linux-gnu/blas"))
           if folder.is_dir()]
GIVEN = pathlib.Path(__file__).with_name("wheel_licences.txt")
DOCUMENTS = pathlib.Path("/usr/share/doc")
COMMON = pathlib.Path("/usr/share/common-licenses")
ALLOWED = {"Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "BSL-1.0", "FTL", "GPL-3.0-or-later WITH GCC-exception-3.1",
           "HPND-sell-variant", "ISC", "LGPL-2.1-only", "LGPL-2.1-or-later", "LicenseRef-public-domain", "MIT", "MPL-1.1",
           "MPL-2.0", "Zlib", "bzip2-1.0.6", "libpng-2.0"}
# Debian's packages whose headers or static libraries are compiled into the module.
COMPILED_IN = ("libeigen3-dev", "libglm-dev", "libimgui-dev", "nlohmann-json3-dev", "opencl-clhpp-headers")


class Refused(Exception):
    pass


def run(*command, **environment):
    return subprocess.run(command, check=True, capture_output=True, text=True, env={**os.environ, **environment}).stdout


# ---- licences -------------------------------------------------------------------------------------

def licences_in(text):
    """From package to SPDX expression and the reason to believe it against Debian's copyright file, mostly empty. A line
    each: package, expression, and after a semicolon the reason."""
    known = {}
    for line in text.splitlines():
        line = line.split("#")[0].strip()
        if line:
            package, rest = line.split(None, 1)
            expression, _, reason = rest.partition(";")
            known[package] = expression.strip(), reason.strip()
    return known


class _Expression:
    """An SPDX expression: AND binds more than OR."""

    def __init__(self, text):
        self.text, self.words = text, re.findall(r"[()]|[^\s()]+", text)

    def is_allowed(self):
        allowed = self._either()
        if self.words:
            raise Refused(f"{self.text}: is no SPDX expression")
        return allowed

    def _either(self):
        allowed = self._both()
        while self._take("OR"):
            allowed = self._both() or allowed
        return allowed

    def _both(self):
        allowed = self._one()
        while self._take("AND"):
            allowed = self._one() and allowed
        return allowed

    def _one(self):
        if self._take("("):
            allowed = self._either()
            if not self._take(")"):
                raise Refused(f"{self.text}: is no SPDX expression")
            return allowed
        name = self._name()
        return (f"{name} WITH {self._name()}" if self._take("WITH") else name) in ALLOWED

    def _name(self):
        if not self.words or self.words[0] in ("(", ")", "AND", "OR", "WITH"):
            raise Refused(f"{self.text}: is no SPDX expression")
        return self.words.pop(0)

    def _take(self, word):
        if self.words[:1] != [word]:
            return False
        self.words.pop(0)
        return True


def is_allowed(expression):
    """Whether the licences, or a choice of them, are all in ALLOWED. Throws Refused."""
    return _Expression(expression).is_allowed()


def calls_all_gpl(copyright):
    """Whether a copyright file of Debian's format has the GPL for the package or for its Files: *."""
    paragraphs = re.split(r"\n[ \t]*\n", copyright)
    of_all = [p for i, p in enumerate(paragraphs) if i == 0 or re.search(r"^Files:[ \t\n]*\*[ \t]*$", p, re.MULTILINE)]
    licences = (re.search(r"^License:(.*)$", paragraph, re.MULTILINE) for paragraph in of_all)
    return any(found and re.search(r"(?<![A-Za-z])A?GPL|GNU General Public", found[1]) for found in licences)


def licence_of(package, library, known, copyright=""):
    """(expression, reason). Throws Refused."""
    if package not in known:
        raise Refused(f"{library}: the licence of Debian's package {package} is not in {GIVEN.name}; read "
                      f"{DOCUMENTS}/{package}/copyright and add a line")
    expression, reason = known[package]
    if not is_allowed(expression):
        raise Refused(f"{library}: Debian's package {package} is under {expression}, and cannot be in the wheel")
    if calls_all_gpl(copyright) and not reason:
        raise Refused(f"{library}: {DOCUMENTS}/{package}/copyright has the GPL for all of it; write in {GIVEN.name}, after a "
                      f"semicolon, why the library is not under it")
    return expression, reason


def common_licences_in(copyright):
    """The names of the files of COMMON to which a copyright file points."""
    return sorted({name.rstrip(".") for name in re.findall(rf"{COMMON}/([\w.+-]+)", copyright)})


# ---- libraries ------------------------------------------------------------------------------------

def system_libraries():
    """The files that the linker's cache knows, and those of ALGEBRA, by name."""
    paths = (pathlib.Path(line.split("=> ")[1]).resolve() for line in run("/sbin/ldconfig", "-p").splitlines() if "x86-64" in line)
    return {path.name: path for path in (*paths, *(path.resolve() for folder in ALGEBRA for path in folder.glob("*.so.*")))}


def original_of(bundled, system):
    """The file of which auditwheel made one with a hash in its name: libfmt-1a2b3c4d.so.9.1.0 of libfmt.so.9.1.0."""
    name = re.sub(r"-[0-9a-f]{8}(?=\.)", "", bundled.name)
    if name not in system:
        raise Refused(f"{bundled.name}: the linker's cache knows no {name}")
    return system[name]


def package_of(path):
    for candidate in (path, pathlib.Path(str(path).removeprefix("/usr"))):
        found = subprocess.run(["dpkg", "-S", candidate], capture_output=True, text=True)
        if found.returncode == 0:
            return found.stdout.split(":")[0]
    raise Refused(f"{path}: is in none of Debian's packages")


def needed(library):
    return run("patchelf", "--print-needed", library).split()


def audit():
    """auditwheel's command line, with ALSO_BUNDLED taken from what it leaves to the system."""
    import dataclasses

    from auditwheel import main, policy

    class Policy(policy.Policy):
        def __init__(self, **fields):
            super().__init__(**{**fields, "whitelist": fields["whitelist"] - ALSO_BUNDLED})

    policy.Policy = dataclasses.dataclass(frozen=True, init=False)(Policy)
    return main.main()


# ---- the wheel ------------------------------------------------------------------------------------

class _Licences:
    """LICENSES.txt beside the libraries, and all licences' texts in the folder licenses."""

    def __init__(self, libraries):
        self.known, self.lines, self.libraries, self.folder = licences_in(GIVEN.read_text()), [], libraries, libraries / "licenses"
        self.folder.mkdir()

    def add_package(self, package, name):
        file = DOCUMENTS / package / "copyright"
        copyright = file.read_text(errors="replace")
        expression, reason = licence_of(package, name, self.known, copyright)
        version = run("dpkg-query", "-W", "-f=${Version}", package)
        self.lines.append(f"{name}: {expression} (Debian's package {package} {version}, licenses/{package})" + (f"; {reason}" if reason else ""))
        shutil.copy(file, self.folder / package)
        for common in common_licences_in(copyright):
            if (COMMON / common).is_file():
                (self.folder / "common-licenses").mkdir(exist_ok=True)
                shutil.copy(COMMON / common, self.folder / "common-licenses" / common)

    def add_nanobind(self):
        """Which pip brought to build the module, and the part of it by another author."""
        found = importlib.metadata.distribution("nanobind")
        text, = (file for file in found.files if file.name == "LICENSE")
        shutil.copy(text.locate(), self.folder / "nanobind")
        header, = (file for file in found.files if file.name == "robin_map.h")
        (self.folder / "robin-map").write_text(header.locate().read_text().split("*/")[0] + "*/\n")
        self.lines.append(f"nanobind: BSD-3-Clause (PyPI's nanobind {found.version}, licenses/nanobind)")
        self.lines.append("robin-map: MIT (in nanobind, licenses/robin-map)")

    def write(self):
        (self.libraries / "LICENSES.txt").write_text(
            "The libraries in this folder are Debian's, unchanged but for their names and where they look for each other. The\n"
            "others named below are compiled into the module. The sources are in Debian's archive, and nanobind's at PyPI. Texts\n"
            "name licences in /usr/share/common-licenses; these are in licenses/common-licenses, also where they are those of other\n"
            "parts of a package than what is in the wheel.\n\n"
            "libgdcmjpeg8, libgdcmjpeg12 and libgdcmjpeg16: this software is based in part on the work of the Independent JPEG Group.\n\n"
            + "\n".join(self.lines) + "\n")


def add_licences(libraries, system):
    bundled = sorted(path for path in libraries.iterdir() if path.is_file())
    licences = _Licences(libraries)
    for library in bundled:
        licences.add_package(package_of(original_of(library, system)), library.name)
    for package in COMPILED_IN:
        licences.add_package(package, package)
    licences.add_nanobind()
    licences.write()


def complete_sbom(file, packages):
    """Adds packages that auditwheel did not find: dpkg knows files of /lib by that name only."""
    sbom = json.loads(file.read_text())
    for package in sorted(set(packages) - {component["name"] for component in sbom["components"]}):
        version = run("dpkg-query", "-W", "-f=${Version}", package)
        purl = f"pkg:deb/debian/{package}@{urllib.parse.quote(version)}"
        sbom["components"].append({"type": "library", "bom-ref": purl, "name": package, "version": version, "purl": purl})
        sbom["dependencies"].append({"ref": purl})
        sbom["dependencies"][0].setdefault("dependsOn", []).append(purl)
    file.write_text(json.dumps(sbom))


def check_needs(library, names, bundled):
    """`names` are bundled, or part of any Linux; none is under the GPL and makes what is linked to it so."""
    base = re.compile(r"(ld-linux-x86-64|lib(c|m|dl|rt|pthread|gcc_s|stdc\+\+|z))\.so\.\d+$")
    for name in names:
        if name.startswith("libfftw"):
            raise Refused(f"{library}: needs {name}, which is under the GPL")
        if name not in bundled and not base.match(name):
            raise Refused(f"{library}: needs {name}, which is not in the wheel")


def check_size(what, bytes_, most):
    if bytes_ > most:
        raise Refused(f"{what}: {bytes_ / 1e6:.0f} MB are more than {most / 1e6:.0f}")


def repaired(wheel, folder):
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        run(sys.executable, __file__, "auditwheel", "repair", "--plat", PLATFORM, "--only-plat", "-w", scratch, wheel,
            LD_LIBRARY_PATH=":".join(map(str, ALGEBRA)))
        made, = scratch.glob("*.whl")
        run(sys.executable, "-m", "wheel", "unpack", "-d", scratch, made)
        made.unlink()
        root, = (path for path in scratch.iterdir() if path.is_dir())
        libraries, = root.glob("*.libs")
        bundled = {path.name for path in root.rglob("*.so*")}
        for library in root.rglob("*.so*"):
            check_needs(library.name, needed(library), bundled)
        system = system_libraries()
        sbom, = root.glob("*.dist-info/sboms/*.json")
        complete_sbom(sbom, {package_of(original_of(path, system)) for path in libraries.iterdir()})
        add_licences(libraries, system)
        folder.mkdir(parents=True, exist_ok=True)
        run(sys.executable, "-m", "wheel", "pack", "-d", scratch, root)
        packed, = scratch.glob("*.whl")
        check_size(packed.name, packed.stat().st_size, MOST_BYTES)
        check_size(f"{packed.name}, unpacked", sum(path.stat().st_size for path in root.rglob("*") if path.is_file()), MOST_UNPACKED_BYTES)
        return shutil.move(packed, folder / packed.name)


def main(wheel, folder):
    try:
        made = repaired(pathlib.Path(wheel), pathlib.Path(folder))
    except Refused as reason:
        sys.exit(f"wheel.py: {reason}")
    except subprocess.CalledProcessError as failed:
        sys.exit(f"wheel.py: {' '.join(map(str, failed.cmd[:4]))}: {failed.stderr.strip()[-2000:]}")
    names = zipfile.ZipFile(made).infolist()
    libraries = sum(".libs/" in name.filename and ".so" in name.filename for name in names)
    print(f"{made.name}: {made.stat().st_size / 1e6:.1f} MB, {sum(name.file_size for name in names) / 1e6:.0f} MB unpacked, with "
          f"{libraries} bundled libraries", file=sys.stderr)
    print(made)


if __name__ == "__main__":
    if sys.argv[1:2] == ["auditwheel"]:
        sys.argv.pop(0)
        sys.exit(audit())
    main(*sys.argv[1:])
