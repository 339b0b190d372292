"""release.py check TAG: whether a release can be made of the tag: its commit is checked out and unchanged, and is of that version.
release.py files TAG FOLDER FILE...: fills FOLDER with the release: the wheels and Debian's packages FILE..., the source archive,
what each is made of as CycloneDX (SBOM), the notes, and SHA256SUMS.

The SBOM of the packages is made by PyPI's distro2sbom of what is installed here; that of a wheel is auditwheel's.
"""
import hashlib
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
# Debian's packages of a release; the headers' package needs those that build.
RUNTIME = ("xraycast", "libxraycast", "libxraycast-c", "python3-xraycast")
PACKAGES = (*RUNTIME, "libxraycast-dev")
STATUS = pathlib.Path("/var/lib/dpkg/status")


class Refused(Exception):
    pass


def run(*command, **options):
    return subprocess.run(command, check=True, capture_output=True, text=True, **options).stdout


# ---- what is checked first ------------------------------------------------------------------------

def section_of(changelog, version):
    """The section of a version, without its heading. Throws Refused."""
    found = re.search(rf"^## {re.escape(version)}\s*\n(.*?)(?=^## |\Z)", changelog, re.MULTILINE | re.DOTALL)
    if not found or not found[1].strip():
        raise Refused(f"CHANGELOG.md has no section `## {version}`; write it first")
    return found[1].strip() + "\n"


def check(tag, root=ROOT):
    """Throws Refused."""
    git = lambda *arguments: subprocess.run(["git", "-C", root, *arguments], capture_output=True, text=True)
    if not re.fullmatch(r"\d+\.\d+\.\d+", tag):
        raise Refused(f"{tag!r}: must be a version and its tag's name, such as 1.2.0")
    commit = git("rev-parse", "--verify", "--quiet", f"refs/tags/{tag}^{{commit}}")
    if commit.returncode != 0:
        raise Refused(f"there is no tag {tag}; make it by `git tag {tag}`")
    if git("rev-parse", "HEAD").stdout != commit.stdout:
        raise Refused(f"another commit than the tag's is checked out; `git checkout {tag}` first")
    changed = git("status", "--porcelain").stdout.splitlines()
    if changed:
        raise Refused(f"{changed[0][3:]} is changed or new, so that this is not {tag}; commit or remove it first")
    section_of((root / "CHANGELOG.md").read_text(), tag)
    version = re.search(r"project\(xraycast VERSION ([0-9.]+)", (root / "CMakeLists.txt").read_text())[1]
    if version != tag:
        raise Refused(f"CMakeLists.txt says that this is {version}, not {tag}; change it first")


def name_of_package(deb):
    """Without the version that is part of a shared library's package: libxraycast of libxraycast0.2_0.2.0_amd64.deb."""
    return re.sub(r"^(lib\w+(?:-c)?)\d+\.\d+$", r"\1", deb.name.split("_")[0])


def check_files(files, version):
    """Throws Refused unless there are all packages, and wheels of the stable interface and of Debian's Python."""
    debs = sorted(name_of_package(file) for file in files if file.suffix == ".deb")
    if debs != sorted(PACKAGES):
        raise Refused(f"these are not the packages of a release: {', '.join(debs) or 'none'}; it has {', '.join(sorted(PACKAGES))}")
    wheels = [file.name for file in files if file.suffix == ".whl"]
    for kind, need in (("-abi3-", "a Python from 3.12 on, which makes it"), ("-cp311-cp311-", "Debian's Python")):
        if sum(kind in name for name in wheels) != 1:
            raise Refused(f"there must be one wheel *{kind}*; that takes {need}")
    for file in files:
        if not re.search(rf"[-_]{re.escape(version)}[-_]", file.name):
            raise Refused(f"{file.name}: is not of version {version}")


# ---- what the packages are made of ----------------------------------------------------------------

def names_needed(depends):
    """The first choice of each dependency."""
    return {re.split(r"[ (:|]", need.strip(), 1)[0] for need in depends.split(",") if need.strip()}


def without(paragraphs, names):
    """dpkg's status without some packages."""
    return [text for text in paragraphs if text.strip() and re.search(r"^Package: (\S+)", text, re.MULTILINE)[1] not in names]


def components(sbom):
    return {component["name"] for component in sbom["components"]}


def sbom_of_packages(debs, version):
    """CycloneDX of the packages and all they depend on, as if they were installed here. Throws Refused."""
    controls = [run("dpkg-deb", "--field", deb) for deb in debs]
    own = {re.search(r"^Package: (\S+)", text, re.MULTILINE)[1] for text in controls}
    whole = f"Package: xraycast-release\nVersion: {version}\nArchitecture: all\nMaintainer: xraycast\nDescription: xraycast\n" \
            f"Depends: {', '.join(sorted(own))}\n"
    installed = without(STATUS.read_text().split("\n\n"), own)
    made = [text.strip() + "\nStatus: install ok installed\n" for text in [*controls, whole]]
    with tempfile.TemporaryDirectory() as root:
        root = pathlib.Path(root)
        (root / "var/lib/dpkg").mkdir(parents=True)
        (root / "usr").symlink_to("/usr")
        (root / "var/lib/dpkg/status").write_text("\n\n".join(text.strip() for text in installed + made) + "\n")
        run(pathlib.Path(sys.executable).with_name("distro2sbom"), "--distro", "deb", "--name", "debian", "--release", "12", "--root",
            root, "--package", "xraycast-release", "--product-name", "xraycast", "--product-version", version,
            "--sbom", "cyclonedx", "--format", "json", "-o", root / "sbom.json")
        sbom = json.loads((root / "sbom.json").read_text())
    depends = ", ".join(found[1] for text in controls if (found := re.search(r"^Depends: (.*)$", text, re.MULTILINE)))
    if missing := sorted(names_needed(depends) - components(sbom)):
        raise Refused(f"{', '.join(missing)}: not installed here, where the SBOM is made; apt-get install it")
    for component in sbom["components"]:
        if component["name"] in own | {"xraycast-release"}:  # which are not in Debian's archive
            component["licenses"] = [{"license": {"id": "Apache-2.0"}}]
            component["purl"] = f"pkg:generic/{component['name']}@{version}"
            component.pop("cpe", None)
    return sbom


def sbom_of_wheel(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if re.search(r"\.dist-info/sboms/.*\.json$", name)]
        if len(names) != 1:
            raise Refused(f"{wheel.name}: holds no SBOM")
        return json.loads(archive.read(names[0]))


# ---- the folder -----------------------------------------------------------------------------------

def write_sums(folder):
    lines = [f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in sorted(folder.iterdir())]
    (folder / "SHA256SUMS").write_text("".join(lines))


def write_files(tag, folder, files):
    check_files(files, tag)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    run("git", "-C", ROOT, "archive", f"--prefix=xraycast-{tag}/", "-o", (folder / f"xraycast-{tag}.tar.gz").resolve(), f"refs/tags/{tag}")
    (folder / "NOTES.md").write_text(section_of((ROOT / "CHANGELOG.md").read_text(), tag))
    for file in files:
        shutil.copy(file, folder / file.name)
        if file.suffix == ".whl":
            (folder / f"{file.name}.cdx.json").write_text(json.dumps(sbom_of_wheel(file), indent=1) + "\n")
    runtime = [file for file in files if file.suffix == ".deb" and name_of_package(file) in RUNTIME]
    (folder / f"xraycast-{tag}.cdx.json").write_text(json.dumps(sbom_of_packages(runtime, tag), indent=1) + "\n")
    write_sums(folder)


def main(verb, tag, folder=None, *files):
    try:
        if verb == "check":
            check(tag)
        else:
            write_files(tag, pathlib.Path(folder), [pathlib.Path(file) for file in files])
    except Refused as reason:
        sys.exit(f"release.py: {reason}")
    except subprocess.CalledProcessError as failed:
        sys.exit(f"release.py: {' '.join(map(str, failed.cmd[:4]))}: {failed.stderr.strip()[-500:]}")


if __name__ == "__main__":
    main(*sys.argv[1:])
