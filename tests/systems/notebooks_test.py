"""Runs the notebooks of examples/python, and looks at what they store.

usage: notebooks_test.py PACKAGE_FOLDER NOTEBOOKS_FOLDER [--keep], by an interpreter that has nbclient, ipykernel and Pillow;
--keep stores the outputs of this run in the notebooks.
"""
import base64
import io
import os
import pathlib
import shutil
import sys
import tempfile

SKIPPED = 77
NOTEBOOKS = {"drr-to-map-to-recast.ipynb": 4, "registration.ipynb": 2, "vessels-to-catheter-to-cine.ipynb": 2}  # and their pictures
MOST_BYTES = 700_000  # of a notebook in the repository


def pictures_of(notebook):
    from PIL import Image
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    return [Image.open(io.BytesIO(base64.b64decode(output.data["image/png"]))) for output in outputs
            if "image/png" in output.get("data", {})]


def check_pictures(notebook, name, count, what):
    pictures = pictures_of(notebook)
    assert len(pictures) == count, f"{name}: {len(pictures)} pictures {what}, not {count}"
    for picture in pictures:
        low, high = picture.convert("L").getextrema()
        assert high - low > 100, f"{name}: an even picture {what}"


def main(package, folder, *options):
    try:
        import ipykernel  # noqa: F401
        import nbclient
        import nbformat
        import PIL  # noqa: F401
    except ImportError as error:
        print(f"skipped: {error}")
        return SKIPPED
    os.environ["PYTHONPATH"] = os.path.abspath(package)
    with tempfile.TemporaryDirectory() as scratch:
        shutil.copy(pathlib.Path(folder, "register.py"), scratch)
        os.environ.update(IPYTHONDIR=scratch, JUPYTER_CONFIG_DIR=scratch)
        for name, count in NOTEBOOKS.items():
            path = pathlib.Path(folder, name)
            notebook = nbformat.read(path, as_version=4)
            if "--keep" not in options:
                check_pictures(notebook, name, count, "in the repository")
                assert path.stat().st_size < MOST_BYTES, f"{name}: {path.stat().st_size} bytes"
            nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", record_timing=False,
                                    resources={"metadata": {"path": scratch}}).execute()
            check_pictures(notebook, name, count, "of this run")
            if "--keep" in options:
                nbformat.write(notebook, path)
            print(f"{name}: {count} pictures", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
