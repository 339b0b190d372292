// The worker of a page that steers by itself: steps the simulation by the clock, a step a millisecond, whatever the picture does.
import { HandHolds, Simulation } from "./simulation";

/** The first message. */
export interface Start {
  code: ArrayBuffer;
  setup: Float64Array;
}

/** All others: what a page tells the server of a live session, or that it has read a message. */
export interface Order extends HandHolds {
  next_hub?: boolean;
  valve?: boolean;
  exchange?: { instrument: number; choice: number };
}
export type ToWorker = Start | Order | "read";

/** A message of the simulation, what its instruments did so far, what became of an exchange, or why it ended. */
export type FromWorker = ArrayBuffer | { figures: Float64Array } | { exchanged: { instrument: number; choice: number; refusal: string | null } } | { failure: string };

const kWait_ms = 2, kMessages_ms = 1000 / 30; // at least between two of them
const kFigures_ms = 500; // between reports
const kMostLate_ms = 100; // after which the clock is reset, as of a machine that was suspended
const kMostSteps = 20; // before messages are read

const scope = self as unknown as { postMessage(message: FromWorker, transfer?: Transferable[]): void };
let simulation: Simulation | null = null, is_read = true;
let stepped_ms = 0, told_ms = -Infinity, reported_ms = -Infinity;

function tick(): void {
  const now_ms = performance.now();
  if (now_ms - stepped_ms > kMostLate_ms) stepped_ms = now_ms - kMostLate_ms;
  const steps = Math.min(kMostSteps, Math.floor(now_ms - stepped_ms));
  simulation!.advance(steps);
  stepped_ms += steps;
  if (is_read && now_ms - told_ms >= kMessages_ms) {
    told_ms = now_ms;
    is_read = false;
    const message = simulation!.message();
    scope.postMessage(message, [message]);
    if (now_ms - reported_ms >= kFigures_ms) {
      reported_ms = now_ms;
      scope.postMessage({ figures: simulation!.figures() });
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

async function start({ code, setup }: Start): Promise<void> {
  try {
    simulation = await Simulation.of(code, setup);
    stepped_ms = performance.now();
    guarded();
  } catch (error) {
    scope.postMessage({ failure: (error as Error).message });
  }
}

function obey(order: Order): void {
  if (!simulation) return;
  simulation.hold(order);
  if (order.next_hub) simulation.hold_next_hub();
  if (order.valve) simulation.toggle_valve();
  if (!order.exchange) return;
  const { instrument, choice } = order.exchange;
  scope.postMessage({ exchanged: { instrument, choice, refusal: simulation.exchange(instrument, choice) } });
}

addEventListener("message", ({ data }: MessageEvent<ToWorker>) => {
  if (data === "read") is_read = true;
  else if ("code" in data) void start(data);
  else obey(data);
});
