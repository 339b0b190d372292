// The worker of a page that steers by itself: steps the simulation by the clock, a step a millisecond, whatever the picture does.
import { inflated } from "./inflated";
import type { BodyChange } from "./live_body";
import { Dose, HandHolds, Simulation } from "./simulation";

/** The first message: the code, deflated, in base64, which takes a while. */
export interface Code {
  simulation: string;
}

/** The second one. */
export interface Start {
  setup: Float64Array;
  pulses_per_s: number; // 0: an exposure with every message
  modes: string[]; // of the body in motion
  body: BodyChange; // as it is at first
}

/** All others: what a page tells the server of a live session, or that it has read a message. */
export interface Order extends HandHolds {
  next_hub?: boolean;
  valve?: boolean;
  exchange?: { instrument: number; choice: number };
  balloon?: { instrument: number; bar: number };
  sheath?: { instrument: number; mm: number };
  detach?: { instrument: number };
  particles?: { mm: number }; // in the agent from now on
  body?: BodyChange;
  shows_series?: boolean; // of reports from now on
  save_report?: boolean;
}
export type ToWorker = Code | Start | Order | { dose: Dose } | "read";

/** The code, once it is compiled; a message of the simulation, with the steps to it; what its instruments did so far; that to be saved; what became of an exchange; or why it ended. */
export type FromWorker = { compiled: WebAssembly.Module } | { message: ArrayBuffer; steps: Float64Array } | { report: string } | { saved: string } | { exchanged: { instrument: number; choice: number; refusal: string | null } } | { refusal: string } | { failure: string };

const kWait_ms = 2, kMessages_ms = 1000 / 30; // at least between two of them
const kReports_ms = 500, kSeries_ms = 2000; // between reports, and between those with values over time
const kMostLate_ms = 100; // after which the clock is reset, as of a machine that was suspended
const kMostSteps = 20; // before messages are read

const scope = self as unknown as { postMessage(message: FromWorker, transfer?: Transferable[]): void };
let code: Promise<WebAssembly.Module> | null = null;
let simulation: Simulation | null = null, is_read = true;
let stepped_ms = 0, told_ms = -Infinity, reported_ms = -Infinity, series_ms = -Infinity, shows_series = false, modes: readonly string[] = [];

function tick(): void {
  const now_ms = performance.now();
  if (now_ms - stepped_ms > kMostLate_ms) stepped_ms = now_ms - kMostLate_ms;
  const steps = Math.min(kMostSteps, Math.floor(now_ms - stepped_ms));
  simulation!.advance(steps);
  stepped_ms += steps;
  if (is_read && now_ms - told_ms >= kMessages_ms) {
    told_ms = now_ms;
    is_read = false;
    const message = simulation!.message(), poses = simulation!.take_steps();
    scope.postMessage({ message, steps: poses }, [message, poses.buffer as ArrayBuffer]);
    if (now_ms - reported_ms >= kReports_ms) {
      reported_ms = now_ms;
      const has_series = shows_series && now_ms - series_ms >= kSeries_ms;
      if (has_series) series_ms = now_ms;
      scope.postMessage({ report: simulation!.report(has_series) });
    }
  }
  setTimeout(guarded, steps === kMostSteps ? 0 : kWait_ms);
}

function guarded(): void {
  try {
    tick();
  } catch (error) {
    scope.postMessage({ failure: (error as Error).message });
  }
}

async function compile(packed: string): Promise<WebAssembly.Module> {
  const compiled = await WebAssembly.compile(await inflated(packed));
  scope.postMessage({ compiled });
  return compiled;
}

async function start({ setup, pulses_per_s, modes: names, body }: Start): Promise<void> {
  try {
    simulation = await Simulation.of(await code!, setup);
    simulation.set_pulse_rate(pulses_per_s);
    modes = names;
    change_body(body);
    stepped_ms = performance.now();
    guarded();
  } catch (error) {
    scope.postMessage({ failure: (error as Error).message });
  }
}

function change_body(change: BodyChange): void {
  const refusal = simulation!.change_body(change, modes);
  if (refusal !== null) scope.postMessage({ refusal });
}

function obey(order: Order): void {
  if (!simulation) return;
  simulation.hold(order);
  if (order.next_hub) simulation.hold_next_hub();
  if (order.valve) simulation.toggle_valve();
  if (order.shows_series !== undefined) {
    shows_series = order.shows_series;
    series_ms = -Infinity;
  }
  if (order.balloon) simulation.inflate(order.balloon.instrument, order.balloon.bar);
  if (order.sheath) simulation.draw_sheath(order.sheath.instrument, order.sheath.mm);
  if (order.detach) simulation.detach(order.detach.instrument);
  if (order.particles) simulation.mix_in(order.particles.mm);
  if (order.body) change_body(order.body);
  if (order.save_report) scope.postMessage({ saved: simulation.report(true) });
  if (!order.exchange) return;
  const { instrument, choice } = order.exchange;
  scope.postMessage({ exchanged: { instrument, choice, refusal: simulation.exchange(instrument, choice) } });
}

addEventListener("message", ({ data }: MessageEvent<ToWorker>) => {
  if (data === "read") is_read = true;
  else if ("simulation" in data) code = compile(data.simulation);
  else if ("setup" in data) void start(data);
  else if ("dose" in data) simulation?.count_dose(data.dose);
  else obey(data);
});
