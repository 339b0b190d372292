"""Lesions and variants of the thorax phantom's vessels, and of its scan."""
import json
import math
import os
import subprocess

import numpy as np
import pytest
import xraycast as xc

PROGRAM = os.environ.get("XRAYCAST_PROGRAM")
STENOSIS = "left renal artery,15,12,70"
CONTRAST_HU = 300  # of lumen over the tissue around it, about

pytestmark = pytest.mark.skipif(not PROGRAM, reason="XRAYCAST_PROGRAM names no program")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The thorax phantom without noise, as ct.nrrd, and its vessels in truth."""
    folder = tmp_path_factory.mktemp("edit")
    subprocess.run([PROGRAM, "phantom", "thorax", "--spacing", "1.5", "--noise", "0", "-o", folder / "ct.nrrd", "--truth",
                    folder / "truth"], check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def scan(folder):
    return xc.open(folder / "ct.nrrd")


@pytest.fixture(scope="module")
def narrowed(folder, scan):
    return xc.edit(folder / "truth", stenosis=[STENOSIS], scan=scan)


def changes(scan, made):
    """HU that each voxel has more, and where the voxels are that differ, (n, 3) mm."""
    more = made.scan.hu.astype(float) - scan.hu
    z, y, x = np.nonzero(more)
    return more, np.stack([x, y, z], -1) * np.asarray(scan.spacing_mm) + np.asarray(scan.origin_mm)


def test_a_stenosis_takes_contrast_agent_out_of_its_throat_and_changes_nothing_elsewhere(scan, narrowed):
    (lesion,) = narrowed.lesions
    more, places_mm = changes(scan, narrowed)
    # The lesion's half length, the vessel's radius, and the blur of three voxels.
    reach_mm = 0.5 * lesion["length_mm"] + 0.5 * lesion["reference_mm"] + 3 * max(scan.spacing_mm)
    assert np.linalg.norm(places_mm - lesion["place_mm"], axis=1).max() < reach_mm
    # Plaque is where contrast agent was; what sharp edges gain beside it is a small part of that.
    assert more.min() < -0.5 * CONTRAST_HU
    assert more[more > 0].sum() < -0.05 * more[more < 0].sum()
    assert lesion["least_mm"] == pytest.approx(0.3 * lesion["reference_mm"], rel=0.01)


@pytest.mark.parametrize("lao_deg", [0, 70])
def test_a_drr_loses_at_the_lesion_what_its_voxels_lost(scan, narrowed, lao_deg):
    view = {"lao": lao_deg, "size": (400, 500), "pixel_mm": 1.2}
    less = scan.project(**view).tau.astype(float) - narrowed.scan.project(**view).tau
    more, _ = changes(scan, narrowed)
    # In a parallel beam the sum over pixels is that over voxels; mu is linear in HU.
    per_hu = xc.Opacity.named("paper")(1) - xc.Opacity.named("paper")(0)
    lost = -more.sum() * per_hu * math.prod(scan.spacing_mm)
    # Pixels of 1.2 mm sample a lesion of some ten of them.
    assert less.sum() * 1.2**2 == pytest.approx(lost, rel=0.1)
    # Nothing but the lesion: it is within one patch of the picture.
    rows, columns = np.nonzero(np.abs(less) > 0.05 * less.max())
    assert np.ptp(rows) * 1.2 < 40 and np.ptp(columns) * 1.2 < 40


def test_calcium_is_brighter_than_the_lumen_that_it_replaces(folder, scan):
    made = xc.edit(folder / "truth", stenosis=[STENOSIS + ",calcium"], scan=scan)
    more, _ = changes(scan, made)
    assert more.max() > 0.5 * CONTRAST_HU


def test_an_aneurysm_adds_its_ball_of_contrast_agent(folder, scan):
    aorta = next(b for b in xc.VesselTree.read(folder / "truth/tree.vtp").branches if "aorta" in b.name)
    before, here, behind = aorta.points[len(aorta.points) // 2 + np.array([-1, 0, 1])]
    aside = np.cross((behind - before)[:3], [0, 1, 0])
    x, y, z = here[:3] + aside / np.linalg.norm(aside) * here[3]
    made = xc.edit(folder / "truth", aneurysm=[f"{x:.3f},{y:.3f},{z:.3f},16,8"], scan=scan)
    (lesion,) = made.lesions
    assert lesion["kind"] == "aneurysm"
    _, places_mm = changes(scan, made)
    sac_mm = np.asarray(lesion["sac"]["centre_mm"])
    assert np.linalg.norm(places_mm - sac_mm, axis=1).max() < 0.5 * 16 + 4 * max(scan.spacing_mm)
    # The ball without what lies in the aorta already: more than a half of it, and no more than all. Whatever it displaces,
    # a voxel is in it from half the contrast on.
    level, ball_mm3 = 0.5 * CONTRAST_HU, math.pi / 6 * 16**3
    gained_mm3 = np.count_nonzero((made.scan.hu > level) & (scan.hu < level)) * math.prod(scan.spacing_mm)
    assert 0.5 * ball_mm3 < gained_mm3 < ball_mm3


def test_edits_that_are_given_again_make_the_same_files(folder, scan, narrowed, tmp_path):
    narrowed.write(tmp_path / "first")
    xc.edit(folder / "truth", edits=tmp_path / "first/edits.json", scan=scan).write(tmp_path / "again")
    names = sorted(path.name for path in (tmp_path / "first").iterdir())
    assert "edited.nii.gz" in names and "edits.json" in names
    assert names == sorted(path.name for path in (tmp_path / "again").iterdir())
    for name in names:
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name


def test_the_program_writes_what_python_does(folder, narrowed, tmp_path):
    subprocess.run([PROGRAM, "edit", folder / "truth", "-o", tmp_path / "cli", "--scan", folder / "ct.nrrd", "--stenosis", STENOSIS],
                   check=True, capture_output=True)
    assert np.array_equal(xc.open(tmp_path / "cli/edited.nii.gz").hu, narrowed.scan.hu)
    said = json.loads((tmp_path / "cli/edits.json").read_text())
    assert said["lesions"][0]["least_mm"] == pytest.approx(narrowed.lesions[0]["least_mm"])


@pytest.mark.parametrize("words", ["left renal artery,15,12,100", "left renal artery,1500,12,50", "no such vessel,15,12,50"])
def test_what_cannot_be_made_is_refused_and_nothing_written(folder, words, tmp_path):
    with pytest.raises(xc.InputError):
        xc.edit(folder / "truth", stenosis=[words])
    done = subprocess.run([PROGRAM, "edit", folder / "truth", "-o", tmp_path / "out", "--stenosis", words], capture_output=True,
                          text=True, check=False)
    assert done.returncode == 3 and len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()
