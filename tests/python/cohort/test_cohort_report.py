"""The page of a cohort, and the array job for Slurm."""
import html.parser
import json
import os
import re
import subprocess

import pytest
import xraycast as xc
from xraycast.cohort.ledger import Ledger
from xraycast.cohort.report import write_report


def record(scan, error=None, **more):
    return {"scan": scan, "hash": "1", "version": "0", "worker": "tcp://1", "seconds": {"read": 1.0, "cast": 3.0},
            "outputs": [f"scans/{scan}/map.png"], "error": error and {"class": error, "line": f"{scan} <was> bad"}, **more}


def test_the_page_counts_scans_errors_and_times(tmp_path):
    ledger = Ledger(tmp_path / "ledger.jsonl")
    for line in [record("a", "WorkerDied"), record("a"), record("b", seconds={"read": 3.0, "cast": 5.0}, worker="tcp://2"),
                 *[record(f"bad{i}", "InputError") for i in range(7)]]:
        ledger.append(line)
    (tmp_path / "scans/a").mkdir(parents=True)
    (tmp_path / "scans/a/map.png").write_bytes(b"picture")
    page = write_report(tmp_path).read_text()
    assert "9 scans: 2 done, 7 bad; 10 attempts by 2 workers." in page
    rows = re.findall(r"<tr>(<td>.*?)</tr>", page)
    cells = {row[0]: row[1:] for row in (re.findall(r"<td[^>]*>(.*?)</td>", row) for row in rows)}
    assert cells["InputError"][:2] == ["7", "7"] and cells["InputError"][2].endswith("bad4 &lt;was&gt; bad<br>and 2 more")
    assert cells["WorkerDied"] == ["1", "0", ""]
    assert cells["read"][:2] == ["2.0", "3.0"] and cells["cast"][:2] == ["4.0", "5.0"]
    assert page.count("<figure>") == 1 and "cGljdHVyZQ==" in page


class Elements(html.parser.HTMLParser):
    """The names of a page's elements and attributes."""

    def __init__(self, page):
        super().__init__()
        self.names = set()
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.names |= {tag, *(name for name, _ in attributes)}


def test_no_text_of_a_run_becomes_markup(tmp_path):
    out = tmp_path / "<script>alert(0)<"
    attack = "\"'><script>alert(1)</script><img src=x onerror=alert(2)>&lt;b onload='x'>"
    ledger_of = lambda folder: Ledger((folder.mkdir(), folder / "ledger.jsonl")[1])
    plain, attacked = ledger_of(tmp_path / "plain"), ledger_of(out)
    for ledger, text in ((plain, "text"), (attacked, attack)):
        ledger.append(record(text, outputs=["scans/a/map.png"], seconds={text: 1.0}, worker=text))
        ledger.append({**record("bad"), "error": {"class": text, "line": f"{text}\n{text}"}})
    for folder in (tmp_path / "plain", out):
        (folder / "scans/a").mkdir(parents=True)
        (folder / "scans/a/map.png").write_bytes(b"picture")
    page = write_report(out).read_text()
    assert Elements(page).names == Elements(write_report(tmp_path / "plain").read_text()).names
    assert page.count("&lt;script&gt;") >= 6 and "<script" not in page and 'alt=""' in page


@pytest.mark.parametrize("preview", ["../secret/map.png", "{}/secret/map.png", "scans/link/map.png", "scans/\0/map.png"])
def test_a_page_holds_no_pictures_of_other_folders(tmp_path, preview):
    out, secret = tmp_path / "out", tmp_path / "secret"
    (out / "scans").mkdir(parents=True)
    secret.mkdir()
    (secret / "map.png").write_bytes(b"secret")
    (out / "scans/link").symlink_to(secret)
    Ledger(out / "ledger.jsonl").append(record("a", outputs=[preview.format(tmp_path)]))
    assert "<figure>" not in write_report(out).read_text()


def test_a_folder_of_two_lines_is_no_part_of_a_job(cohort, phantoms, tmp_path):
    done = cohort("slurm", phantoms, "-o", f"{tmp_path}/out\nreboot")
    assert (done.returncode, done.stdout) == (3, "") and "a job's comments hold no line break" in done.stderr


def test_a_report_of_nothing_is_refused(tmp_path):
    with pytest.raises(xc.InputError, match="has no ledger.jsonl with lines"):
        write_report(tmp_path)


def test_the_parts_of_an_array_job_make_the_whole_cohort(cohort, phantoms, tmp_path):
    script = cohort("slurm", phantoms, "-o", tmp_path / "out", "--array", "2", "--", "--steps", "info").stdout
    assert "#SBATCH --array=0-1\n" in script and "6 scans in 2 parts" in script
    for part in "01":
        result = subprocess.run(["bash", "-c", script], env={**os.environ, "SLURM_ARRAY_TASK_ID": part, "SLURM_CPUS_PER_TASK": "1"},
                                capture_output=True, text=True, timeout=120)
        assert result.returncode in (0, 1), result.stderr
    lines = [json.loads(line) for line in open(tmp_path / "out/ledger.jsonl")]
    assert sorted(line["scan"] for line in lines) == ["a.nrrd", "b.nrrd", "c.nrrd", "cut.nrrd", "more/d.nrrd", "text.nrrd"]
    assert "6 scans: 4 done, 2 bad" in write_report(tmp_path / "out").read_text()
