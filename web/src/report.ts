// What a run's instruments did so far, as a table, over its time, and as a file (docs/exercises.md).
import { SeriesChart } from "./series_chart";
import { fixed } from "./fixed";
import { words_of_limit, words_of_use } from "./exercise";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

interface Figure {
  name: string; // in the file
  words: string;
  unit: string;
  digits: number;
}

const figure = (name: string, words: string, unit = "", digits = 0): Figure => ({ name, words, unit, digits });

const kOfRun = [
  figure("time_s", "time", "s"), figure("idle_s", "idle", "s"), figure("fluoroscopy_s", "fluoroscopy", "s"), figure("exposures", "exposures"), figure("air_kerma_mGy", "air kerma", "mGy", 2), figure("dap_Gycm2", "dose-area product", "Gy cm²", 2), figure("injected_ml", "contrast agent", "ml"),
];
const kOfInstrument = [
  figure("tip_path_mm", "path of the tip", "mm"), figure("idle_s", "idle", "s"), figure("turned_deg", "turned", "°"), figure("turn_backs", "changes of the turn"), figure("reversals", "reversals"),
  figure("largest_force_N", "largest force at the hub", "N", 2), figure("mean_force_N", "mean force at the hub", "N", 2), figure("largest_torque_mNm", "largest torque at the hub", "mN m", 2),
  figure("mean_torque_mNm", "mean torque at the hub", "mN m", 2), figure("largest_wall_force_N", "largest force on the wall", "N", 2), figure("wall_impulse_Ns", "impulse on the wall above 0.1 N", "N s", 2),
  figure("slips", "slips"), figure("whips", "whips"), figure("exchanges", "exchanges"),
];
const kOfTreatment = [
  figure("largest_bar", "largest pressure", "bar", 1), figure("opened_mm", "opened to", "mm", 2), figure("occluded_s", "vessel filled by the balloon", "s", 1), figure("reference_mm", "reference diameter", "mm", 2),
  figure("balloon_to_vessel", "balloon to vessel", "", 2), figure("least_before_mm", "least diameter before", "mm", 2), figure("least_after_mm", "least diameter after", "mm", 2),
  figure("stenosis_before_percent", "stenosis before", "%"), figure("residual_stenosis_percent", "residual stenosis", "%"), figure("oversizing", "stent to vessel", "", 2),
  figure("sheathed_rings", "rings still in the sheath"), figure("stent_mm", "stent's diameter", "mm", 2), figure("malapposition_mm", "struts off the wall, largest", "mm", 2),
  figure("coil_mm", "coil in the sac", "mm"), figure("sac_mm3", "volume of the sac", "mm³"), figure("packing_percent", "packing density", "%", 1), figure("inflow_percent", "the sac's inflow, of that without coils", "%"),
  figure("particles", "particles"), figure("periphery_percent", "conductance left of the periphery", "%"),
];
const kOverTime = [figure("insertion_mm", "insertion", "mm"), figure("force_N", "force at the hub", "N", 2), figure("wall_force_N", "force on the wall", "N", 2), figure("pressure_mmHg", "mean pressure at the tip", "mmHg")];

type Figures = Record<string, number>;

export interface ExerciseReport {
  is_complete: boolean;
  is_passed: boolean;
  targets: { name: string; reached_s: number | null }[];
  forbidden: string[];
  forbidden_entries: { name: string; time_s: number }[];
  limits: { name: string; limit: number; largest?: number | null; passed_s: number | null }[];
}

export interface RunReport {
  instruments: (Figures & { name: string })[];
  treatments?: (Figures & { device: string; vessel: string })[];
  exercise?: ExerciseReport;
  series?: { time_s: number[]; instruments: Record<string, number[]>[] };
}

/** What became of an exercise: of itself, its targets, forbidden vessels and limits. */
function outcomes_of({ is_complete, is_passed, targets, forbidden_entries, limits }: ExerciseReport): (readonly [string, string])[] {
  const at = (time_s: number | null) => (time_s === null ? "not reached" : `${fixed(time_s, 1)} s`), last_s = Math.max(...targets.map(({ reached_s }) => reached_s ?? 0));
  return [
    ["result", is_complete ? `${is_passed ? "passed" : "complete, but not passed"}, after ${at(last_s)}` : "not complete"],
    ...targets.map(({ name, reached_s }) => [`target: ${name}`, at(reached_s)] as const),
    ...forbidden_entries.map(({ name, time_s }) => [`forbidden: ${name}`, at(time_s)] as const),
    ...limits.map((limit) => [`limit: ${words_of_limit(limit.name)[0]}`, words_of_use(limit) + (limit.passed_s === null ? "" : `, passed after ${at(limit.passed_s)}`)] as const),
  ];
}

const shown = (figures: Figures, { name, unit, digits }: Figure) => (figures[name] === undefined ? "" : `${fixed(figures[name], digits)}${unit === "°" ? "" : " "}${unit}`.trim());

export class Report {
  private readonly list = element<HTMLDetailsElement>("report");
  private readonly table = element<HTMLTableElement>("report-table");
  private readonly charts: SeriesChart[];
  private report: RunReport | null = null;

  constructor(show_series: (is_shown: boolean) => void, save: () => void) {
    this.list.hidden = false;
    this.charts = kOverTime.map(({ words, unit, digits }) => new SeriesChart(element("report-charts"), `${words}, ${unit}`, digits));
    this.list.addEventListener("toggle", () => {
      show_series(this.list.open);
      this.show();
    });
    element("save-report").addEventListener("click", save);
  }

  /** Whether anything was done. */
  get has_run(): boolean {
    return ((this.report as unknown as Figures | null)?.time_s ?? 0) > 0;
  }

  told(report: RunReport): void {
    this.report = report;
    this.show();
    if (!report.series || !this.list.open) return;
    const { time_s, instruments } = report.series;
    kOverTime.forEach(({ name }, k) => this.charts[k]!.draw(time_s, instruments.map((values, d) => ({ name: report.instruments[d]!.name, values: values[name] ?? [] }))));
  }

  private show(): void {
    if (!this.list.open || !this.report) return;
    const { instruments, treatments = [], exercise } = this.report, run = this.report as unknown as Figures;
    const row = (kind: "td" | "th", words: string, ...values: string[]) => {
      const row = document.createElement("tr"), name = Object.assign(document.createElement("th"), { scope: "row", textContent: words });
      row.append(name, ...values.map((textContent) => Object.assign(document.createElement(kind), { textContent })));
      return row;
    };
    this.table.replaceChildren(
      ...(exercise ? outcomes_of(exercise).map(([words, what]) => row("td", words, what)) : []), ...kOfRun.map((figure) => row("td", figure.words, shown(run, figure))), row("th", "", ...instruments.map(({ name }) => name)),
      ...kOfInstrument.map((figure) => row("td", figure.words, ...instruments.map((figures) => shown(figures, figure)))),
      ...(treatments.length === 0 ? [] : [row("th", "treated", ...treatments.map(({ device, vessel }) => `${vessel}: ${device}`))]),
      ...kOfTreatment.filter(({ name }) => treatments.some((one) => one[name] !== undefined)).map((figure) => row("td", figure.words, ...treatments.map((figures) => shown(figures, figure)))),
    );
  }
}
