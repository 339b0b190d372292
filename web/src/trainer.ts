// A session without a server: the simulation runs in a worker of the page.
import type { LinkListener, SessionLink } from "./connection";
import type { MotionHeader, Trainer } from "./data";
import type { BodyChange } from "./live_body";
import type { RunReport } from "./report";
import type { Dose } from "./simulation";
import type { FromWorker, Order, ToWorker } from "./trainer_worker";

declare const kWorker: string; // its program, which build.mjs puts here

export interface TrainerListener extends LinkListener {
  moved(steps: Float64Array): void;
  exchanged(instrument: number, choice: number): void;
  refused(why: string): void;
  failed(why: string): void;
  compiled(code: WebAssembly.Module, fluoroscope: Float64Array): void;
  reported(report: RunReport): void;
  saves(report: RunReport): void;
}

// Modules of a function each: one has vectors, the other catches exceptions. The simulation has both.
const kVectors = [0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11];
const kExceptions = [0, 97, 115, 109, 1, 0, 0, 0, 1, 4, 1, 96, 0, 0, 3, 2, 1, 0, 10, 8, 1, 6, 0, 6, 64, 25, 11, 11];

/** Whether this browser can have one. */
export const can_simulate = (): boolean =>
  typeof WebAssembly === "object" && typeof Worker === "function" && [kVectors, kExceptions].every((module) => WebAssembly.validate(Uint8Array.from(module)));

/** The worker, which starts while the page still opens: what it tells until then waits. */
export class TrainerWorker {
  private readonly worker = new Worker(URL.createObjectURL(new Blob([kWorker], { type: "text/javascript" })));
  private readonly early: FromWorker[] = [];
  private listener: ((message: FromWorker) => void) | null = null;

  /** Of the simulation's code, deflated, in base64. */
  constructor(simulation: string) {
    this.worker.addEventListener("message", ({ data }: MessageEvent<FromWorker>) => this.tell(data));
    this.worker.addEventListener("error", (event) => this.tell({ failure: event.message || "its worker did not start" }));
    this.post({ simulation });
  }

  /** `motion`: of a body that moves. */
  begin({ setup, pulses_per_s }: Trainer, modes: string[], motion: MotionHeader | null): void {
    const body: BodyChange = motion ? { hold: motion.held, speed: motion.speed, gate: motion.gate } : {};
    this.post({ setup, pulses_per_s, modes, body });
  }

  listen(listener: (message: FromWorker) => void): void {
    this.listener = listener;
    this.early.splice(0).forEach(listener);
  }

  post(message: ToWorker): void {
    this.worker.postMessage(message);
  }

  private tell(message: FromWorker): void {
    if (this.listener) this.listener(message);
    else this.early.push(message);
  }
}

export class TrainerLink implements SessionLink {
  constructor(private readonly trainer: Trainer, private readonly worker: TrainerWorker, private readonly listener: TrainerListener) {
    listener.has_role({ steers: true, browsers: 1 });
    setTimeout(() => worker.listen((message) => this.take(message))); // once its owner has it
  }

  send(message: object): void {
    this.post(message as Order);
  }

  count_dose(dose: Dose): void {
    this.post({ dose });
  }

  private post(message: ToWorker): void {
    this.worker.post(message);
  }

  private take(message: FromWorker): void {
    if ("message" in message) {
      this.post("read");
      this.listener.moved(message.steps);
      this.listener.told(message.message);
    } else if ("compiled" in message) {
      this.listener.compiled(message.compiled, this.trainer.fluoroscope);
    } else if ("report" in message) {
      this.listener.reported(this.report_of(message.report));
    } else if ("saved" in message) {
      this.listener.saves(this.report_of(message.saved));
    } else if ("refusal" in message) {
      this.listener.refused(message.refusal);
    } else if ("failure" in message) {
      this.listener.failed(this.named(message.failure));
    } else {
      const { instrument, choice, refusal } = message.exchanged;
      if (refusal !== null) this.listener.refused(this.named(refusal));
      else this.listener.exchanged(instrument, choice);
    }
  }

  private report_of(text: string): RunReport {
    const report = JSON.parse(text) as RunReport;
    for (const instrument of report.instruments) instrument.name = this.named(instrument.name);
    for (const treatment of report.treatments ?? []) treatment.device = this.named(treatment.device);
    return report;
  }

  /** The simulation knows instruments by their numbers. */
  private named(text: string): string {
    return text.replace(/instrument (\d+)/g, (words, number) => this.trainer.choices[Number(number)]?.name ?? words);
  }
}
