// What a run's instruments did so far, as a table and as a file (simulation/xraycast/simulation/run_report.hpp).
import { fixed } from "./fixed";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

const kDegrees = 180 / Math.PI;

/** In the order in which the simulation has them; `name` is that of the file. */
const kFigures = [
  { name: "tip_path_mm", words: "path of the tip", unit: "mm", digits: 0, times: 1 },
  { name: "turned_deg", words: "turned", unit: "°", digits: 0, times: kDegrees },
  { name: "reversals", words: "reversals", unit: "", digits: 0, times: 1 },
  { name: "largest_force_N", words: "largest force at the hub", unit: "N", digits: 2, times: 1 },
  { name: "mean_force_N", words: "mean force at the hub", unit: "N", digits: 2, times: 1 },
  { name: "largest_torque_mNm", words: "largest torque at the hub", unit: "mN m", digits: 2, times: 1000 },
  { name: "largest_wall_force_N", words: "largest force on the wall", unit: "N", digits: 2, times: 1 },
  { name: "wall_impulse_Ns", words: "impulse on the wall above 0.1 N", unit: "N s", digits: 2, times: 1 },
  { name: "exchanges", words: "exchanges", unit: "", digits: 0, times: 1 },
] as const;

/** Of the procedure, which the session's messages tell. */
export interface Use {
  fluoroscopy_s: number;
  injected_ml: number;
}

export interface Figures extends Use {
  time_s: number;
  idle_s: number;
  instruments: Record<string, number>[]; // by the names above
}

export function figures_of(numbers: ArrayLike<number>, { fluoroscopy_s, injected_ml }: Use): Figures {
  const count = Math.floor((numbers.length - 2) / kFigures.length);
  const instruments = Array.from({ length: count }, (_, d) => Object.fromEntries(kFigures.map(({ name, times }, k) => [name, times * numbers[2 + d * kFigures.length + k]!])));
  return { time_s: numbers[0]!, idle_s: numbers[1]!, fluoroscopy_s, injected_ml, instruments };
}

export class Report {
  private readonly list = element<HTMLDetailsElement>("report");
  private readonly table = element<HTMLTableElement>("report-table");
  private figures: Figures | null = null;

  constructor(private readonly names: readonly string[], save: (text: string) => void) {
    this.list.hidden = false;
    this.list.addEventListener("toggle", () => this.show());
    element("save-report").addEventListener("click", () => save(this.json()));
  }

  told(figures: Figures): void {
    this.figures = figures;
    this.show();
  }

  json(): string {
    const instruments = this.figures?.instruments.map((figures, d) => ({ name: this.names[d], ...figures }));
    return `${JSON.stringify({ version: 1, ...this.figures, instruments }, null, 1)}\n`;
  }

  private show(): void {
    if (!this.list.open || !this.figures) return;
    const { time_s, idle_s, fluoroscopy_s, injected_ml, instruments } = this.figures;
    const row = (kind: "td" | "th", words: string, ...values: string[]) => {
      const row = document.createElement("tr"), name = Object.assign(document.createElement("th"), { scope: "row", textContent: words });
      row.append(name, ...values.map((textContent) => Object.assign(document.createElement(kind), { textContent })));
      return row;
    };
    this.table.replaceChildren(
      row("td", "time", `${fixed(time_s, 0)} s`), row("td", "idle", `${fixed(idle_s, 0)} s`), row("td", "fluoroscopy", `${fixed(fluoroscopy_s, 0)} s`),
      row("td", "contrast agent", `${fixed(injected_ml, 0)} ml`), row("th", "", ...this.names),
      ...kFigures.map(({ name, words, unit, digits }) => row("td", words, ...instruments.map((figures) => `${fixed(figures[name]!, digits)}${unit === "°" ? "" : " "}${unit}`.trim()))),
    );
  }
}
