"""OUT/report.html: how many scans were done, what was wrong with the others, times, and a sheet of previews."""
import base64
import collections
import html
import statistics

from .._errors import InputError
from .ledger import read_ledger

MOST_PREVIEWS = 200
MOST_EXAMPLES = 5
TEMPLATE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><title>Cohort {name}</title>
<style>
body {{ font: 15px/1.4 sans-serif; margin: 2em auto; max-width: 75em; padding: 0 1em; }}
table {{ border-collapse: collapse; margin: 1em 0; }}
td, th {{ border-bottom: 1px solid #ccc; padding: .25em .8em; text-align: left; vertical-align: top; }}
.number {{ text-align: right; }}
.sheet {{ display: flex; flex-wrap: wrap; gap: 1em; }}
figure {{ margin: 0; width: 180px; }}
figure img {{ width: 180px; height: 180px; object-fit: contain; background: #000; }}
figcaption {{ font-size: 12px; overflow-wrap: anywhere; }}
</style>
<h1>Cohort {name}</h1>
<p>{summary} Not for clinical use.</p>
{tables}
</html>
"""


def write_report(out):
    """Returns the page's path. Raises InputError."""
    records = list(read_ledger(out / "ledger.jsonl"))
    if not records:
        raise InputError(f"{out}: has no ledger.jsonl with lines; give the folder of a run")
    last = {record["scan"]: record for record in records}
    good = [record for record in last.values() if record["error"] is None]
    bad = [record for record in last.values() if record["error"] is not None]
    summary = f"{len(last)} scans: {len(good)} done, {len(bad)} bad; {len(records)} attempts by {_count_workers(records)} workers."
    tables = _errors(records, last) + _times(good) + _sheet(out, good)
    page = out / "report.html"
    unfinished = out / ".report.html"
    unfinished.write_text(TEMPLATE.format(name=html.escape(out.name), summary=summary, tables=tables), encoding="utf-8")
    unfinished.replace(page)
    return page


def _count_workers(records):
    return len({str(worker) for record in records if (worker := record.get("worker"))})


def _table(title, heads, rows):
    if not rows:
        return ""
    cells = "\n".join("<tr>" + "".join(_cell(value) for value in row) + "</tr>" for row in rows)
    return f"<h2>{title}</h2>\n<table><tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>\n{cells}</table>\n"


def _cell(value):
    if isinstance(value, (int, float)):
        return f'<td class="number">{value:,}</td>'
    return f"<td>{'<br>'.join(html.escape(line) for line in value.splitlines())}</td>"


def _errors(records, last):
    """By class: attempts, scans that stayed bad, and some of their lines."""
    attempts = collections.Counter(record["error"]["class"] for record in records if record["error"])
    rows = []
    for name, count in attempts.most_common():
        lines = [record["error"]["line"] for record in last.values() if record["error"] and record["error"]["class"] == name]
        more = [f"and {len(lines) - MOST_EXAMPLES} more"] if len(lines) > MOST_EXAMPLES else []
        rows.append((name, count, len(lines), "\n".join(lines[:MOST_EXAMPLES] + more)))
    return _table("Errors", ("class", "attempts", "scans still bad", "lines"), rows)


def _times(good):
    by_step = collections.defaultdict(list)
    for record in good:
        for step, seconds in record.get("seconds", {}).items():
            by_step[step].append(seconds)
    rows = [(step, round(statistics.median(seconds), 3), round(max(seconds), 3), round(sum(seconds) / 3600, 3))
            for step, seconds in by_step.items()]
    return _table("Times", ("step", "median, s", "longest, s", "sum, hours"), rows)


def _sheet(out, good):
    """The previews lie in the page itself, so that it can be sent; an even choice where there are many."""
    shown = [(record["scan"], preview) for record in good if (preview := _preview_of(record))]
    step = max(1, -(-len(shown) // MOST_PREVIEWS))
    figures = [f'<figure><img alt="" src="data:image/png;base64,{data}"><figcaption>{html.escape(scan)}</figcaption></figure>'
               for scan, preview in sorted(shown)[::step] if (data := _encoded(out, preview))]
    if not figures:
        return ""
    title = f"{len(figures)} of {len(shown)} previews" if step > 1 else "Previews"
    return f'<h2>{title}</h2>\n<div class="sheet">{"".join(figures)}</div>\n'


def _preview_of(record):
    return next((path for path in record.get("outputs", ()) if path.endswith(("/map.png", "/frames/0000.png"))), None)


def _encoded(out, preview):
    """Of the run's own folder alone."""
    try:
        path = (out / preview).resolve()
        return base64.b64encode(path.read_bytes()).decode() if path.is_relative_to(out.resolve()) else ""
    except (OSError, ValueError):
        return ""
