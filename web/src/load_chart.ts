// Force and torque at a hub over some time, as a chart with a mark at the present.
import { fixed } from "./fixed";
import { draw_strip } from "./strip_chart";

/** Of one hub: values at even times, and which of them is of now. */
export interface Loads {
  instrument: string;
  force_N: readonly number[];
  torque_mNm: readonly number[];
  length_s: number;
  now: number;
}

const kCurves = [{ name: "force", unit: "N", colour: "--force" }, { name: "torque", unit: "mN m", colour: "--torque" }] as const;

const values_of = (loads: Loads, k: number): readonly number[] => (k === 0 ? loads.force_N : loads.torque_mNm);

/** What a chart shows, in words. */
export function loads_text(loads: Loads): string {
  const range = (k: number) => {
    const values = values_of(loads, k);
    return values.length === 0 ? "none yet" : `${fixed(Math.min(...values), 2)} to ${fixed(Math.max(...values), 2)} ${kCurves[k]!.unit}`;
  };
  return `At the hub of the ${loads.instrument}: force ${range(0)}, torque ${range(1)}, over ${loads.length_s.toFixed(1)} s`;
}

export function draw_loads(canvas: HTMLCanvasElement, loads: Loads): void {
  draw_strip(canvas, kCurves.map(({ name, unit, colour }, k) => {
    const values = values_of(loads, k);
    return { values, colour, low: Math.min(0, ...values), high: Math.max(1e-3, ...values), words: `${name} ${fixed(values[loads.now] ?? 0, 2)} ${unit}` };
  }), loads.now);
}

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

/** The chart on the page, with a choice of the hub where there are several. */
export class LoadChart {
  private readonly canvas = element<HTMLCanvasElement>("load-chart");
  private readonly choice = element<HTMLSelectElement>("hub");

  constructor(names: readonly string[], private readonly loads_of: (hub: number) => Loads) {
    element("loads").hidden = false;
    element("hub-choice").hidden = names.length < 2;
    this.choice.append(...names.map((name, hub) => new Option(name, String(hub))));
    this.choice.addEventListener("change", () => this.show());
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.show();
  }

  get hub(): number {
    return Math.max(0, this.choice.selectedIndex);
  }

  choose(hub: number): void {
    if (hub === this.hub) return;
    this.choice.selectedIndex = hub;
    this.show();
  }

  rename(hub: number, name: string): void {
    this.choice.options[hub]!.text = name;
    this.show();
  }

  draw(): void {
    draw_loads(this.canvas, this.loads_of(this.hub));
  }

  /** Also in words. */
  show(): void {
    this.canvas.setAttribute("aria-label", loads_text(this.loads_of(this.hub)));
    this.draw();
  }
}
