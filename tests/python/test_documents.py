"""The code that README.md and the Python page show, as it stands there but for larger voxels."""
import pathlib
import re

import pytest
import xraycast as xc

ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("page", ["README.md", "docs/python.md", "python/README.md"])
def test_the_first_block_of_a_page_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # it saves what it finds
    code = re.search(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)[1]
    assert 'xc.phantom("thorax")' in code
    names = {}
    exec(compile(code.replace('xc.phantom("thorax")', 'xc.phantom("thorax", spacing_mm=3)'), page, "exec"), names)
    assert names["drr"].shape == (480, 640) and names["body"].tau.shape[0] == 16 and isinstance(names["frame"], xc.Frame)
    if "vessels" in names:
        assert len(names["vessels"].tree) > 1 and names["state"].insertion_mm == pytest.approx(0.2)
