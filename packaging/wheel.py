"""wheel.py WHEEL FOLDER: makes a wheel that runs on any Linux of glibc 2.36 or later, in FOLDER, of one that pip built here.

What the module needs is bundled by auditwheel and patchelf, with each library's licence, which must be known from
wheel_licences.txt and must not be the GPL.
"""
import hashlib
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile

PLATFORM = "manylinux_2_36_x86_64"
MOST_BYTES = 120_000_000
# auditwheel leaves these to the system, but a system without a display has none.
ALSO_BUNDLED = ("libX11.so.6", "libXext.so.6", "libXrender.so.1")
GIVEN = pathlib.Path(__file__).with_name("wheel_licences.txt")


class Refused(Exception):
    pass


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


# ---- licences -------------------------------------------------------------------------------------

def licences_in(text):
    """From package to SPDX expression: a line each, with blanks between."""
    lines = (line.split("#")[0].strip() for line in text.splitlines())
    return dict(line.split(None, 1) for line in lines if line)


def is_gpl(expression):
    """Whether a licence leaves no choice but the GPL; libraries of the compiler have its runtime exception."""
    choices = [choice.strip(" ()") for choice in expression.split(" OR ")]
    bound = [any(re.match(r"A?GPL-", part.strip(" ()")) and "WITH GCC-exception-3.1" not in part
                 for part in choice.split(" AND ")) for choice in choices]
    return all(bound)


def licence_of(package, library, known):
    if package not in known:
        raise Refused(f"{library}: the licence of Debian's package {package} is not in {GIVEN.name}; read "
                      f"/usr/share/doc/{package}/copyright and add a line")
    if is_gpl(known[package]):
        raise Refused(f"{library}: Debian's package {package} is under {known[package]}, and cannot be in the wheel")
    return known[package]


# ---- libraries ------------------------------------------------------------------------------------

def system_libraries():
    """The files that the linker's cache knows, by name."""
    paths = (pathlib.Path(line.split("=> ")[1]).resolve() for line in run("/sbin/ldconfig", "-p").splitlines() if "x86-64" in line)
    return {path.name: path for path in paths}


def original_of(bundled, system):
    """The file of which auditwheel, or bundle_more, made one with a hash in its name: libfmt-1a2b3c4d.so.9.1.0 of libfmt.so.9.1.0."""
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


def bundle_more(libraries, system):
    """Puts ALSO_BUNDLED beside the other libraries, and makes these need them by their new names."""
    for name in ALSO_BUNDLED:
        path = pathlib.Path(f"/usr/lib/x86_64-linux-gnu/{name}").resolve()
        hash_ = hashlib.sha256(path.read_bytes()).hexdigest()[:8]
        made = libraries / path.name.replace(".so", f"-{hash_}.so", 1)
        shutil.copy(path, made)
        run("patchelf", "--set-soname", made.name, "--set-rpath", "$ORIGIN", made)
    names = {run("patchelf", "--print-soname", original_of(path, system)).strip(): path.name for path in libraries.iterdir()}
    for library in libraries.iterdir():
        for name in needed(library):
            if name in names:
                run("patchelf", "--replace-needed", name, names[name], library)


# ---- the wheel ------------------------------------------------------------------------------------

def add_licences(libraries, system):
    """LICENSES.txt beside the libraries, and Debian's copyright file of each package."""
    known, lines, folder = licences_in(GIVEN.read_text()), [], libraries / "licenses"
    folder.mkdir()
    for library in sorted(path for path in libraries.iterdir() if path.is_file()):
        package = package_of(original_of(library, system))
        lines.append(f"{library.name}: {licence_of(package, library.name, known)} (Debian's package {package}, licenses/{package})")
        shutil.copy(f"/usr/share/doc/{package}/copyright", folder / package)
    (libraries / "LICENSES.txt").write_text(
        "The libraries in this folder are Debian's, unchanged but for their names and where they look for each other.\n"
        "The sources are in Debian's archive.\n\n" + "\n".join(lines) + "\n")


def check_loads_nothing_else(root):
    """Everything that a library needs is bundled, or part of any Linux with Python."""
    base = re.compile(r"(ld-linux-x86-64|lib(c|m|dl|rt|pthread|gcc_s|stdc\+\+|z|expat))\.so\.\d+$")
    bundled = {path.name for path in root.rglob("*.so*")}
    for library in root.rglob("*.so*"):
        for name in needed(library):
            if name not in bundled and not base.match(name):
                raise Refused(f"{library.name}: needs {name}, which is not in the wheel")


def repaired(wheel, folder):
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        run(sys.executable, "-m", "auditwheel", "repair", "--plat", PLATFORM, "--only-plat", "-w", scratch, wheel)
        made, = scratch.glob("*.whl")
        run(sys.executable, "-m", "wheel", "unpack", "-d", scratch, made)
        made.unlink()
        root, = (path for path in scratch.iterdir() if path.is_dir())
        libraries, = root.glob("*.libs")
        system = system_libraries()
        bundle_more(libraries, system)
        check_loads_nothing_else(root)
        add_licences(libraries, system)
        folder.mkdir(parents=True, exist_ok=True)
        run(sys.executable, "-m", "wheel", "pack", "-d", scratch, root)
        packed, = scratch.glob("*.whl")
        if packed.stat().st_size > MOST_BYTES:
            raise Refused(f"{packed.name}: {packed.stat().st_size / 1e6:.0f} MB are more than {MOST_BYTES / 1e6:.0f}")
        return shutil.move(packed, folder / packed.name)


def main(wheel, folder):
    try:
        made = repaired(pathlib.Path(wheel), pathlib.Path(folder))
    except Refused as reason:
        sys.exit(f"wheel.py: {reason}")
    except subprocess.CalledProcessError as failed:
        sys.exit(f"wheel.py: {' '.join(map(str, failed.cmd[:4]))}: {failed.stderr.strip()[-2000:]}")
    libraries = sum(".libs/" in name and ".so" in name for name in zipfile.ZipFile(made).namelist())
    print(f"{made}: {pathlib.Path(made).stat().st_size / 1e6:.1f} MB with {libraries} bundled libraries")


if __name__ == "__main__":
    main(*sys.argv[1:])
