"""Phantoms in motion, and the model of a scan's motion."""
import json

import numpy as np
import pytest
import xraycast as xc


def test_phases_move_the_phantom():
    rest = xc.phantom("thorax", spacing_mm=6, noise_hu=0)
    inspired = xc.phantom("thorax", spacing_mm=6, noise_hu=0, phase={"breath": 1})
    assert np.array_equal(xc.phantom("thorax", spacing_mm=6, noise_hu=0, phase={"breath": 0}).hu, rest.hu)
    # The lungs, of -850 HU, are larger.
    assert np.sum(np.abs(inspired.hu + 850) < 50) > np.sum(np.abs(rest.hu + 850) < 50)
    assert np.any(xc.phantom("thorax", spacing_mm=6, noise_hu=0, coronaries=True).hu != rest.hu)


def test_phases_are_those_that_there_are():
    with pytest.raises(xc.InputError, match="phase cough: the phantom thorax has no such movement; choose one of breath, heart"):
        xc.phantom("thorax", spacing_mm=6, phase={"cough": 1})
    with pytest.raises(xc.InputError, match="coronaries: the phantom head has none"):
        xc.phantom("head", spacing_mm=6, coronaries=True)


def test_a_scan_writes_a_model_of_its_motion(tmp_path):
    scan = xc.phantom("thorax", spacing_mm=4)
    with pytest.raises(xc.InputError, match="give breath_mm, heart or both"):
        scan.write_motion(tmp_path / "none")
    assert not (tmp_path / "none").exists()
    scan.write_motion(tmp_path / "motion", breath_mm=12, heart=True, spacing_mm=8)
    motion = json.loads((tmp_path / "motion/motion.json").read_text())
    assert [mode["name"] for mode in motion["modes"]] == ["breath", "heart"]
    for mode in motion["modes"]:
        for phase in mode["phases"]:
            assert "field" not in phase or (tmp_path / "motion" / phase["field"]).is_file()
