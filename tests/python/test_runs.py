"""Runs by a script, and their pages."""
import json
import os
import re
import subprocess

import numpy as np
import pytest
import xraycast as xc

PROGRAM = os.environ.get("XRAYCAST_PROGRAM")
PAIR = ["microcatheter-27f", "guidewire-014-angled"]
SCRIPT = [(0, 5, 0, 10, 0), (0.1, 15, 10, 25, 20), (0.2, 20, 20, 40, 0)]


@pytest.fixture(scope="module")
def tree():
    return xc.VesselTree([(np.array([[0, 0, -90, 3.0], [0, 0, 90, 3.0]]), -1)])


@pytest.fixture(scope="module")
def small_map():
    return xc.phantom("cylinder", size=(60, 60, 60), spacing_mm=4).cast(layers=2, angles=16)


def header_of(page):
    return json.loads(re.search(r'id="session">(.*?)</script>', page.read_text(), re.DOTALL)[1])


def test_records_are_a_structured_array(tree):
    run = xc.simulate(tree, instruments=PAIR, script=SCRIPT, entry=0)
    assert run.records.shape == (3, 2) and run.instruments == PAIR
    assert run.records["time_s"][:, 0] == pytest.approx([0, 0.1, 0.2])
    assert run.records["insertion_mm"] == pytest.approx(np.array([[5, 10], [15, 25], [20, 40]]))
    assert run.records["rotation_deg"][1] == pytest.approx([10, 20])
    assert run.records["tip_mm"].shape == (3, 2, 3)
    assert run.last["tip_mm"].shape == (2, 3)
    np.testing.assert_array_equal(run.last["tip_mm"], run.records["tip_mm"][-1])
    assert run.entry_branch == 0 and run.entry_mm == pytest.approx((0, 0, -90), abs=4)
    assert run.notes == [] and run.held_s == 0
    assert repr(run) == "<xraycast.Run of microcatheter-27f, guidewire-014-angled: 3 records>"


def test_pressures_are_those_of_a_pulse(tree):
    run = xc.simulate(tree, PAIR, [(0, 5, 0, 10, 0), (1, 15, 10, 25, 20)], entry=0)
    assert run.pressures.shape == (101, 4) and run.pressure_plot().shape == (560, 900, 3)
    np.testing.assert_allclose(run.pressures[:, 0], np.arange(101) / 100, atol=1e-9)
    assert 60 < run.pressures[:, 1:].min() < 85 and 105 < run.pressures[:, 1:].max() < 135
    assert run.records["aortic_mmHg"][0, 0] == run.pressures[0, 1] and run.records["pressure_mmHg"][0, 1] == run.pressures[0, 3]
    steady = xc.simulate(tree, PAIR, SCRIPT, entry=0, heart_rate_bpm=0)
    assert np.ptp(steady.pressures[:, 1]) < 1 and steady.last["aortic_mmHg"][0] == pytest.approx(93, abs=1)
    measured = [(0, 0), (0.1, 400), (0.3, 0), (0.75, 0)]
    own = xc.simulate(tree, PAIR, SCRIPT, entry=0, heart_waveform=measured)
    assert np.ptp(own.pressures[:, 1]) > 10
    for waveform, message in [([(0, 0), (0.4, -100), (0.8, 0)], "heart_waveform: its mean is -50 ml/s"),
                              ([(0, 0, 0)], "heart_waveform: must be a file or"), ("nowhere.csv", "nowhere.csv")]:
        with pytest.raises(xc.InputError, match=message):
            xc.simulate(tree, PAIR, SCRIPT, entry=0, heart_waveform=waveform)
    with pytest.raises(xc.InputError, match="heart_waveform: paces the heart; leave heart_rate_bpm out"):
        xc.flow(tree, heart_waveform=measured, heart_rate_bpm=60)
    with pytest.raises(xc.InputError, match="heart_rate_bpm 7: must be 0, for a steady flow, or 20 to 250"):
        xc.simulate(tree, PAIR, SCRIPT, entry=0, heart_rate_bpm=7)


def test_flow_has_the_curves_of_a_beat(tmp_path):
    def line(start, end, radius_mm):
        points = np.linspace(start, end, 61)
        return np.column_stack([points, np.full(61, radius_mm)])
    narrow = line((10, 0, 0), (60, 0, -60), 1.6)
    narrow[25:35, 3] *= 0.5
    coronaries = xc.VesselTree([(line((0, 0, 0), (10, 0, 0), 2.0), -1, "left main coronary artery"),
                                (narrow, 0, "left anterior descending artery"),
                                (line((10, 0, 0), (10, 50, -40), 1.5), 0, "circumflex artery")])
    rest, flow = xc.flow(coronaries), xc.flow(coronaries, hyperaemia=True)
    samples = len(flow.time_s)
    assert flow.flow_ml_s.shape == flow.pressure_mmHg.shape == (samples, 3) and flow.aortic_mmHg.shape == (samples,)
    # What enters a bifurcation leaves it.
    np.testing.assert_allclose(flow.flow_ml_s[:, 0], flow.flow_ml_s[:, 1:].sum(axis=1), atol=1e-9)
    # Behind the stenosis it falls far below what is normal at hyperaemia, 0.94 and more (Pijls et al.).
    assert 0.6 < flow.pressure_ratio[1] < 0.9 < flow.pressure_ratio[2] < 1
    assert flow.pressure_ratio[1] == pytest.approx(flow.pressure_mmHg[:, 1].mean() / flow.aortic_mmHg.mean())
    assert rest.pressure_ratio[1] > 0.9 and flow.flow_ml_s[:, 0].mean() > 2 * rest.flow_ml_s[:, 0].mean()
    flow.write(tmp_path / "flow.csv")
    lines = (tmp_path / "flow.csv").read_text().splitlines()
    assert len(lines) == 4 and lines[0].startswith("branch,vessel,flow_ml_s,") and lines[2].startswith("1,left anterior")
    assert repr(flow) == "<xraycast.BloodFlow of 3 branches>"
    if PROGRAM:
        coronaries.write(tmp_path / "tree.json")
        words = [PROGRAM, "flow", tmp_path / "tree.json", "--hyperaemia", "--json", "-o", tmp_path / "told.csv"]
        told = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
        (tmp_path / "heart.csv").write_text("time_s,flow_ml_s\n0,0\n0.1,400\n0.3,0\n0.75,0\n")
        heart = [PROGRAM, "flow", tmp_path / "tree.json", "--heart-waveform", tmp_path / "heart.csv", "--json"]
        own = json.loads(subprocess.run(heart, check=True, capture_output=True, text=True).stdout)
        for waveform in (tmp_path / "heart.csv", np.loadtxt(tmp_path / "heart.csv", delimiter=",", skiprows=1)):
            beat = xc.flow(coronaries, heart_waveform=waveform)
            assert beat.time_s[-1] == pytest.approx(0.75)
            assert own["vessels"][1]["flow_ml_s"]["mean"] == pytest.approx(beat.flow_ml_s[:, 1].mean(), rel=1e-9)
        assert told["vessels"][1]["pressure_ratio"] == pytest.approx(flow.pressure_ratio[1], rel=1e-9)
        assert (tmp_path / "told.csv").read_text() == (tmp_path / "flow.csv").read_text()


def test_a_run_is_that_of_steps(tree):
    steps = [(0, 0, 0), (0.05, 10, 45)]
    run = xc.simulate(tree, ["microcatheter-27f"], steps, interval_s=0.001)
    assert len(run.records) == 51
    state = xc.Catheter(tree, "microcatheter-27f").step(push_mm=10, turn_deg=45, ms=50)
    # The same motion, whose poses differ by rounding.
    assert run.last["tip_mm"][0] == pytest.approx(state.tip_mm, abs=1e-9)
    assert run.last["force_N"][0] == pytest.approx(state.force_N, abs=1e-9)


@pytest.mark.skipif(not PROGRAM, reason="XRAYCAST_PROGRAM names no program")
def test_python_and_the_command_line_write_the_same(tree, small_map, tmp_path):
    tree.write(tmp_path / "tree.vtp")
    small_map.write(tmp_path / "map.exr")
    script = tmp_path / "pair.csv"
    script.write_text("time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n"
                      + "".join(",".join(map(str, row)) + "\n" for row in SCRIPT))
    options = [word for name in PAIR for word in ("--device-model", name)] + ["--script", script, "--entry", "0", "-q"]
    subprocess.run([PROGRAM, "simulate", tmp_path, *options, "-o", tmp_path / "log.csv"], check=True)
    subprocess.run([PROGRAM, "export", tmp_path / "map.exr", "--vessels", tmp_path, *options, "-o", tmp_path / "a.html"],
                   check=True)
    read = xc.VesselTree.read(tmp_path)
    run = xc.simulate(read, PAIR, script, entry=0)
    run.write(tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "log.csv").read_bytes()
    xc.export(xc.BodyMap.read(tmp_path / "map.exr"), tmp_path / "b.html", vessels=tmp_path, run=run)
    assert (tmp_path / "b.html").read_bytes() == (tmp_path / "a.html").read_bytes()


def test_exports_pages_and_scenes(tree, small_map, tmp_path):
    run = xc.simulate(tree, ["microcatheter-27f"], [(0, 0, 0), (0.2, 20, 0)], entry=0)
    xc.export(small_map, tmp_path / "page.html", vessels=tree, run=run, title="Tube", precision="half")
    header = header_of(tmp_path / "page.html")
    assert header["title"] == "Tube" and header["map"]["precision"] == "half"
    assert header["run"]["pictures"] == 4  # at 15 a second: 0, 67, 133 and 200 ms
    xc.export(small_map, tmp_path / "plain.html")
    plain = header_of(tmp_path / "plain.html")
    assert plain["run"] is None and plain["vessels"] is None and plain["title"] == "Fluoroscopy"
    xc.export(small_map, tmp_path / "scene.glb", vessels=tree)
    assert (tmp_path / "scene.glb").read_bytes().startswith(b"glTF")
    frame = small_map.render()  # after surfaces were drawn
    np.testing.assert_array_equal(frame.tau, small_map.render().tau)


def test_exports_a_page_that_steers(tree, small_map, tmp_path):
    page = tmp_path / "page.html"
    xc.export(small_map, page, vessels=tree, live=["microcatheter-27f"], devices=["microcatheter-24f"], entry=0)
    header = header_of(page)
    assert [choice["name"] for choice in header["trainer"]["choices"]] == ["microcatheter-27f", "microcatheter-24f"]
    assert header["trainer"]["used"] == [0] and header["live"]["has_hub"]
    fluoroscope = xc.Fluoroscope(c_arm="mobile-flat-panel", dose="low", pulse_rate=7.5, compression=0.6)
    xc.export(small_map, page, vessels=tree, live=["microcatheter-27f"], fluoroscope=fluoroscope)
    header = header_of(page)
    assert [header["trainer"][name] for name in ("dose", "pulses_per_s", "compression")] == [0, 7.5, 0.6]
    assert header["cone"] is not None
    held = xc.Fluoroscope(kvp=80)
    for wrong, words in [({"live": ["microcatheter-27f"]}, "live: steers in a tree"),
                         ({"fluoroscope": fluoroscope}, "exercise, fluoroscope: without live"),
                         ({"vessels": tree, "live": ["microcatheter-27f"], "fluoroscope": held}, "leave out the others"),
                         ({"devices": ["microcatheter-27f"]}, "devices, entry, exercise, fluoroscope: without live"),
                         ({"vessels": tree, "live": "microcatheter-27f"}, "live: must be a list")]:
        with pytest.raises(xc.InputError, match=words):
            xc.export(small_map, page, **wrong)


@pytest.fixture
def task(tmp_path):
    file = tmp_path / "task.json"
    file.write_text(json.dumps({"title": "Up", "task": "Go up.", "instruments": ["microcatheter-27f"], "entry": [0, 0, -90],
                                "targets": [{"at_mm": [0, 0, -75]}, {"at_mm": [0, 0, 80]}], "limits": {"force_N": 3}}))
    return file


def test_a_run_has_a_report(tree, task, tmp_path):
    run = xc.simulate(tree, ["microcatheter-27f"], [(0, 0, 0), (0.5, 30, 90)], exercise=task)
    report = run.report(tmp_path / "run.json")
    assert report["instruments"][0]["tip_path_mm"] == pytest.approx(30, abs=1) and report["time_s"] == pytest.approx(0.5)
    assert [target["reached_s"] is None for target in report["exercise"]["targets"]] == [False, True]
    assert "fluoroscopy_s" not in report and len(report["series"]["time_s"]) == 3
    assert json.loads((tmp_path / "run.json").read_text())["exercise"] == report["exercise"]
    run.report(tmp_path / "run.html")
    with pytest.raises(xc.InputError, match="must end in .html"):
        run.report(tmp_path / "run.txt")
    with pytest.raises(xc.InputError, match="not allowed in the exercise"):
        xc.simulate(tree, ["cobra-5f"], [(0, 0, 0)], exercise=task)


def test_steps_have_the_same_report(tree, task):
    catheter = xc.Catheter(tree, "microcatheter-27f", exercise=task)
    catheter.step(push_mm=30, turn_deg=90, ms=500)
    report = xc.simulate(tree, ["microcatheter-27f"], [(0, 0, 0), (0.5, 30, 90)], exercise=task).report()
    now = catheter.report(series=True)
    assert now["exercise"] == report["exercise"] and now["instruments"][0]["reversals"] == report["instruments"][0]["reversals"]
    assert now["instruments"][0]["tip_path_mm"] == pytest.approx(report["instruments"][0]["tip_path_mm"], abs=1e-6)
    assert "series" in now and "series" not in catheter.report()


def test_an_exchange_keeps_to_the_instruments_of_the_exercise(tree, task):
    document = json.loads(task.read_text()) | {"devices": ["microcatheter-24f"]}
    task.write_text(json.dumps(document))
    steered = xc.CoaxialInstruments(tree, ["microcatheter-27f"], exercise=task)
    with pytest.raises(xc.InputError, match="guidewire-014-straight: is not allowed in the exercise"):
        steered.exchange(0, "guidewire-014-straight")
    assert steered.models == ["microcatheter-27f"]
    steered.exchange(0, "microcatheter-24f")
    assert steered.models == ["microcatheter-24f"] and steered.report()["instruments"][0]["exchanges"] == 1


def test_exports_exercises(tree, small_map, task, tmp_path):
    page = tmp_path / "page.html"
    xc.export(small_map, page, vessels=tree, live=["microcatheter-27f"], exercise=[task])
    exercise, = header_of(page)["trainer"]["exercises"]
    assert exercise["title"] == "Up" and exercise["used"] == [0] and exercise["targets"][1]["at_mm"] == [0, 0, 80]
    with pytest.raises(xc.InputError, match="without live"):
        xc.export(small_map, page, vessels=tree, exercise=[task])


def test_exports_a_map_that_moves(tree, tmp_path):
    for name in ("breath", "heart"):
        (tmp_path / f"{name}.tfm").write_text("#Insight Transform File V1.0\nTransform: TranslationTransform_double_3_3\n"
                                              "Parameters: 0 0 5\nFixedParameters:\n")
    motion = tmp_path / "motion.json"
    motion.write_text(json.dumps({"version": 1, "modes": [
        {"name": "breath", "period_s": 4, "phases": [{"phase": 0}, {"phase": 1, "field": "breath.tfm"}]},
        {"name": "heart", "period_s": 1, "phases": [{"phase": 0}, {"phase": 0.5, "field": "heart.tfm"}]}]}))
    body = xc.Scan.from_array(np.zeros((30, 20, 20), np.int16), (10, 10, 10), (-95, -95, -145)).cast(
        layers=2, motion=motion, keys={"breath": 3, "heart": 4})
    page = tmp_path / "page.html"
    xc.export(body, page, vessels=tree, phase={"breath": 0.5}, gate={"heart": 0.75}, motion_speed=2, keys={"heart": 2})
    moves = header_of(page)["motion"]
    assert [mode["phases"] for mode in moves["modes"]] == [[0, 0.5, 1], [0, 0.5]] and len(moves["rows"]) == 6
    assert moves["held"] == {"breath": 0.5} and moves["gate"] == {"mode": "heart", "phase": 0.75} and moves["speed"] == 2
    assert moves["lattice"]["nodes"] > 8  # by the motion that the map names
    run = xc.simulate(tree, ["microcatheter-27f"], [(0, 0, 0), (0.2, 20, 0)], entry=0, motion=motion, phase={"breath": 0.25})
    xc.export(body, page, vessels=tree, run=run)
    assert header_of(page)["run"]["moves"] and header_of(page)["motion"]["held"] == {"breath": 0.25}
    still = xc.simulate(tree, ["microcatheter-27f"], [(0, 0, 0), (0.2, 20, 0)], entry=0)
    with pytest.warns(UserWarning, match="in a body that stood still"):
        xc.export(body, page, run=still)
    assert header_of(page)["motion"] is None
    for arguments, words in [(dict(keys={"heart": 9}), "keys heart=9|2 to 4"), (dict(gate={"hart": 0.5}), "gate"),
                             (dict(gate={"breath": 0, "heart": 0}), "gate: must be a dict of one"),
                             (dict(precision="half"), "precision"), (dict(run=run, motion_speed=2), "run: has a motion")]:
        with pytest.raises(xc.InputError, match=words):
            xc.export(body, page, **arguments)


def test_exports_a_session_as_it_was_saved(small_map, tmp_path):
    (tmp_path / "s.json").write_text(json.dumps({
        "xraycast_session": 1, "files": {},
        "simulation": {"nodes_mm": [[0, 0, -90], [0, 0, -80], [0, 0, -70], [1, 0, -60]], "radius_mm": 0.8, "road_map": True},
        "camera": {"angle_deg": 30, "tilt_deg": -10, "table_mm": 20, "zoom": 1.5},
        "style": {"look": "surface", "compositing": "path", "continuous": False, "strengths": []}}))
    with pytest.warns(UserWarning, match="constant shells are not exported"):
        xc.export(small_map, tmp_path / "page.html", session=tmp_path / "s.json")
    header = header_of(tmp_path / "page.html")
    assert header["pose"]["lao_deg"] == pytest.approx(30) and len(header["catheters"]) == 1


def test_a_stent_is_released_from_its_sheath(tree):
    catheter = xc.Catheter(tree, "stent-self-8x40", entry=0)
    catheter.step(push_mm=100, ms=1000)
    assert catheter.state.free_rings == 0 and catheter.state.release_mm == 0
    catheter.step(release_mm=42.3, ms=1000)
    state = catheter.step(ms=20)  # stents are looked at every 10 ms
    assert state.free_rings == 16 and state.release_mm == pytest.approx(42.3)
    treatment, = catheter.report()["treatments"]
    assert treatment["stent_mm"] == pytest.approx(6.16, abs=0.01) and treatment["oversizing"] == pytest.approx(8 / 6, abs=0.01)
    with pytest.raises(xc.InputError, match="release_mm -1: a sheath does not go back over its stent; give 0 or more"):
        catheter.step(release_mm=-1)
    run = xc.simulate(tree, ["stent-self-8x40"], [(0, 100, 0, 0, 0), (1, 100, 0, 0, 42.3), (1.1, 100, 0, 0, 42.3)], entry=0)
    assert run.report()["treatments"][0]["stent_mm"] == pytest.approx(treatment["stent_mm"], abs=1e-6)
    assert xc.Catheter(tree, "cobra-5f").state.free_rings is None


def test_particles_embolise_what_lies_behind(tree):
    script = [(0, 30, 0), (1.5, 30, 0)]
    run = xc.simulate(tree, ["cobra-5f"], script, entry=0, inject=(0.2, 1.2), injection_rate_ml_s=2, particles_mm=0.3)
    assert run.embolised[0][0] == 0 and run.embolised[0][2] < 1
    counted = sum(particles for _, particles, _ in run.embolised)
    assert counted == pytest.approx(2 * 60 / 0.014137, rel=1e-3)  # 2 ml of 60 mm3 a ml
    assert run.report()["injected_ml"] == pytest.approx(2, abs=1e-6)
    assert [t.get("branch", -1) for t in run.report()["treatments"]] == [branch for branch, *_ in run.embolised]
    within = xc.simulate(tree, ["guide-6f", "microcatheter-27f"], [(0, 30, 0, 40, 0), (1.5, 30, 0, 40, 0)], entry=0, inject=(0.2, 1.2), particles_mm=0.9)
    assert not within.embolised and "do not pass the lumen; take smaller ones" in within.notes[-1]
    blocked = xc.simulate(tree, ["cobra-5f", "guidewire-035-j"], [(0, 30, 0, 40, 0), (1.5, 30, 0, 40, 0)], entry=0, inject=(0.2, 1.2), particles_mm=0.3)
    assert not blocked.embolised and "5.0 ml of contrast agent were not injected" in blocked.notes[-1]
    assert not xc.simulate(tree, ["cobra-5f"], script, entry=0, inject=(0.2, 1.2)).embolised
    for arguments, message in [({"particles_mm": 0.3}, "needs inject too"), ({"injection_rate_ml_s": 2}, "injection_rate_ml_s 2: needs inject too"), ({"inject": (1, 0.5)}, "must begin at 0 s or later"),
                               ({"inject": 3}, "must be the times"), ({"inject": (0.2, 1), "particles_mm": 5}, "a diameter of 0.1 to 1.2 mm")]:
        with pytest.raises(xc.InputError, match=message):
            xc.simulate(tree, ["cobra-5f"], script, entry=0, **arguments)


def basilar_tip():
    """A vessel that forks around an aneurysm of 10 mm straight ahead."""
    def line(start, end, radius_mm):
        return np.column_stack([np.linspace(start, end, 41), np.full(41, radius_mm)])
    to_centre_mm = 2 + np.sqrt(25 - 6.25)
    at_mm = to_centre_mm * np.arange(37) / 24
    sac = np.column_stack([0 * at_mm, 0 * at_mm, 100 + at_mm, np.maximum(1, 5 - abs(at_mm - to_centre_mm))])
    return xc.VesselTree([(line((0, 0, 0), (0, 0, 100), 2), -1, "basilar artery"), (line((0, 0, 100), (40, 0, 110), 1.5), 0, "right artery"),
                          (line((0, 0, 100), (-40, 0, 110), 1.5), 0, "left artery"), (sac, 0, "aneurysm")])


def test_a_coil_is_detached_in_an_aneurysm():
    tree = basilar_tip()
    coil = xc.CoaxialInstruments(tree, ["microcatheter-24f", "coil-10x30"], entry=0)
    coil.step([106, 106], ms=1000)
    coil.step([0, 150], ms=1000)
    inner = coil.step(detach=[0, 1], ms=20)[1]  # coils are looked at every 10 ms
    assert inner.coil_mm == pytest.approx(150) and inner.coils_detached == 0, "half of it is in the catheter still"
    coil.step([0, 150], ms=1000)
    inner = coil.step(detach=[0, 1], ms=20)[1]
    assert inner.coils_detached == 1 and inner.coil_mm == 0 and inner.packing == pytest.approx(0.0591, abs=1e-3)
    treatment, = coil.report()["treatments"]
    assert treatment["vessel"] == "aneurysm" and treatment["coil_mm"] == pytest.approx(300) and 40 < treatment["inflow_percent"] < 99
    with pytest.raises(xc.InputError, match="detach 2: a wire has one coil at a time"):
        coil.step(detach=[0, 2])
    with pytest.raises(xc.InputError, match="detach: .* has no coils; give it 0, or take coil-10x30, say"):
        coil.step(detach=[1, 0])
    rows = [(0, 106, 0, 0, 0, 0, 106, 0, 0, 0, 0), (2, 106, 0, 0, 0, 0, 406, 0, 0, 0, 0), (2.1, 106, 0, 0, 0, 0, 406, 0, 0, 0, 1), (2.2, 106, 0, 0, 0, 0, 406, 0, 0, 0, 1)]
    run = xc.simulate(tree, ["microcatheter-24f", "coil-10x30"], rows, entry=0)
    assert run.notes == [] and run.report()["treatments"][0]["packing_percent"] == pytest.approx(5.91, abs=0.1)
    assert xc.Catheter(tree, "microcatheter-24f", entry=0).state.coil_mm is None
    with pytest.raises(xc.InputError, match="coil-10x30: pushes coils through a catheter; give one before it"):
        xc.Catheter(tree, "coil-10x30", entry=0)


def test_bad_arguments_are_named(tree, small_map, tmp_path):
    for script in ([(0, 0)], [1, 2, 3], [(0, 0, 0, 0, 0, 0, 0)], "no-such.csv"):
        with pytest.raises(xc.InputError, match="script|no-such.csv"):
            xc.simulate(tree, ["cobra-5f"], script)
    with pytest.raises(xc.InputError, match="^script: row 2: time_s 0.0 is not later than 0.0, that of row 1|row 1"):
        xc.simulate(tree, ["cobra-5f"], [(0, 0, 0), (0, 1, 0)])
    for instruments in ("cobra-5f", None, 3):
        with pytest.raises(xc.InputError, match="^instruments: must be a list of instruments"):
            xc.simulate(tree, instruments, [(0, 0, 0)])
    for interval_s in (-1, 1e-4, float("nan"), float("inf")):
        with pytest.raises(xc.InputError, match="^interval_s .*: must be 0"):
            xc.simulate(tree, ["cobra-5f"], [(0, 0, 0)], interval_s=interval_s)
    with pytest.raises(TypeError):
        xc.export(small_map, tmp_path / "page.html", run=3)
    with pytest.raises(xc.InputError, match="^contrast_mg_ml 401: must be 0 to 400"):
        xc.export(small_map, tmp_path / "page.html", vessels=tree, contrast_mg_ml=401)
    with pytest.raises(xc.InputError, match="single"):
        xc.export(small_map, tmp_path / "page.html", precision="single")


def test_a_run_is_plotted_instrument_by_instrument(tree):
    run = xc.simulate(tree, ["microcatheter-27f", "guidewire-014-angled"], [(0, 0, 0, 0, 0), (1, 5, 0, 25, 0)], interval_s=0.1)
    plots = [run.plot(), run.plot(instrument=1)]
    assert all(plot.shape == (560, 900, 3) and plot.dtype == np.uint8 for plot in plots)
    assert not np.array_equal(*plots)
    with pytest.raises(xc.InputError, match="^instrument 2: must be 0 to 1"):
        run.plot(2)


def test_a_run_can_be_cancelled(tree):
    def stop(fraction, stage):
        raise KeyboardInterrupt
    with pytest.raises(KeyboardInterrupt):
        xc.simulate(tree, ["cobra-5f"], [(0, 0, 0), (1, 1, 0), (500, 2, 0)], progress=stop)


def test_converts_a_scan(hu, tmp_path):
    xc.Scan.from_array(hu, (1, 1, 2)).write(tmp_path / "ct.nrrd")
    xc.convert(tmp_path / "ct.nrrd", tmp_path / "series", patient="Doe^Jane,1")
    assert len(list((tmp_path / "series").iterdir())) == 5
    xc.convert(tmp_path / "series", tmp_path / "ct.mha")
    np.testing.assert_array_equal(xc.open(tmp_path / "ct.mha").hu, hu)
    with pytest.raises(xc.InputError, match="is also the input and would be overwritten"):  # the program: of any two files
        xc.convert(tmp_path / "ct.nrrd", tmp_path / "ct.nrrd")
