// The run: play, scrub, speed.
import type { Run } from "./data";
import { length_s, picture_at } from "./instrument_shape";
import type { Store } from "./state";
import { Loads, LoadChart } from "./load_chart";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

const kLongestStep_ms = 250; // of a run that was not drawn, as in a hidden tab

/** How far a run goes on between two pictures of the display. */
export const step_s = (from_ms: number, to_ms: number, speed: number): number =>
  (speed * Math.min(kLongestStep_ms, Math.max(0, to_ms - from_ms))) / 1000;

export class RunPlayer {
  is_playing = false;
  private last_ms = 0;
  private readonly play = element<HTMLButtonElement>("play");
  private readonly time = element<HTMLInputElement>("time");
  private readonly speed = element<HTMLSelectElement>("speed");
  private readonly chart: LoadChart;

  constructor(private readonly run: Run, private readonly store: Store) {
    element("run-player").hidden = false;
    this.time.max = String(length_s(run));
    this.time.step = String(run.step_s);
    this.chart = new LoadChart(run.instruments.map(({ name }) => name), (hub) => this.loads(hub));
    this.play.addEventListener("click", () => this.toggle());
    this.time.addEventListener("input", () => {
      this.stop();
      this.show(Number(this.time.value));
    });
    this.draw();
  }

  toggle(): void {
    if (this.is_playing) return this.stop();
    const { time_s } = this.store.state;
    if (time_s >= length_s(this.run) - 1e-6 || time_s === this.store.first.time_s) this.show(0); // from the end, or as it opened
    this.is_playing = true;
    this.mark();
    requestAnimationFrame((ms) => {
      this.last_ms = ms;
      this.advance(ms);
    });
  }

  /** Pictures on, or back. */
  step(pictures: number): void {
    this.stop();
    this.show(this.store.state.time_s + pictures * this.run.step_s);
  }

  draw(): void {
    const { time_s } = this.store.state;
    this.time.value = String(time_s);
    element("clock").textContent = `${time_s.toFixed(1)} of ${length_s(this.run).toFixed(1)} s`;
    this.chart.draw();
  }

  private loads(hub: number): Loads {
    const { name, force_N, torque_mNm } = this.run.instruments[hub]!;
    return { instrument: name, force_N, torque_mNm, length_s: length_s(this.run), now: picture_at(this.run, this.store.state.time_s) };
  }

  private show(time_s: number): void {
    this.store.update({ time_s });
  }

  private stop(): void {
    this.is_playing = false;
    this.store.update({}); // for a picture at rest
    this.mark();
  }

  private mark(): void {
    this.play.textContent = this.is_playing ? "Pause" : "Play";
  }

  private advance(now_ms: number): void {
    if (!this.is_playing) return;
    this.show(this.store.state.time_s + step_s(this.last_ms, now_ms, Number(this.speed.value)));
    this.last_ms = now_ms;
    if (this.store.state.time_s >= length_s(this.run)) return this.stop();
    requestAnimationFrame((ms) => this.advance(ms));
  }
}
