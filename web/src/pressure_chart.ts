// The pressure of the blood at an instrument's tip and in the aorta, as a pressure line shows it.
import { fixed } from "./fixed";
import type { PressureReading } from "./live_message";
import { draw_strip } from "./strip_chart";

/** At even times up to now. */
export interface Pressures {
  instrument: string;
  tip_mmHg: readonly number[];
  aortic_mmHg: readonly number[];
  reading: PressureReading;
}

const kLeastTop_mmHg = 160;

const words_of = ({ systolic_mmHg, diastolic_mmHg, mean_mmHg }: PressureReading) => `${fixed(systolic_mmHg, 0)}/${fixed(diastolic_mmHg, 0)} mmHg, mean ${fixed(mean_mmHg, 0)}`;

export class PressureChart {
  private readonly canvas = document.getElementById("pressure-chart") as HTMLCanvasElement;

  constructor(private readonly pressures: () => Pressures) {
    this.canvas.hidden = false;
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  draw(): void {
    const { tip_mmHg, aortic_mmHg, reading } = this.pressures();
    const high = Math.max(kLeastTop_mmHg, ...tip_mmHg, ...aortic_mmHg), of_both = { low: 0, high };
    draw_strip(this.canvas, [
      { values: tip_mmHg, colour: "--pressure", words: `tip ${words_of(reading)}`, ...of_both },
      { values: aortic_mmHg, colour: "--faint", words: "aorta", ...of_both },
    ], tip_mmHg.length - 1);
  }

  /** Also in words. */
  show(): void {
    const { instrument, reading } = this.pressures();
    this.canvas.setAttribute("aria-label", `Pressure of the blood at the tip of the ${instrument}: ${words_of(reading)}`);
    this.draw();
  }
}
