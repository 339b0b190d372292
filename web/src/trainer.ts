// A session without a server: the simulation runs in a worker of the page.
import type { LinkListener, SessionLink } from "./connection";
import type { Trainer } from "./data";
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

export class TrainerLink implements SessionLink {
  private readonly worker: Worker;

  constructor(private readonly trainer: Trainer, private readonly listener: TrainerListener) {
    const address = URL.createObjectURL(new Blob([kWorker], { type: "text/javascript" }));
    this.worker = new Worker(address);
    this.worker.addEventListener("message", ({ data }: MessageEvent<FromWorker>) => this.take(data));
    this.worker.addEventListener("error", (event) => listener.failed(event.message || "its worker did not start"));
    void this.start(trainer);
    listener.has_role({ steers: true, browsers: 1 });
  }

  send(message: object): void {
    this.post(message as Order);
  }

  count_dose(dose: Dose): void {
    this.post({ dose });
  }

  private async start({ code, setup, fluoroscope, pulses_per_s }: Trainer): Promise<void> {
    try {
      const module = await WebAssembly.compile(code);
      this.post({ code: module, setup, pulses_per_s });
      this.listener.compiled(module, fluoroscope);
    } catch (error) {
      this.listener.failed((error as Error).message);
    }
  }

  private post(message: ToWorker): void {
    this.worker.postMessage(message);
  }

  private take(message: FromWorker): void {
    if ("message" in message) {
      this.post("read");
      this.listener.moved(message.steps);
      this.listener.told(message.message);
    } else if ("report" in message) {
      this.listener.reported(this.report_of(message.report));
    } else if ("saved" in message) {
      this.listener.saves(this.report_of(message.saved));
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
    return report;
  }

  /** The simulation knows instruments by their numbers. */
  private named(text: string): string {
    return text.replace(/instrument (\d+)/g, (words, number) => this.trainer.choices[Number(number)]?.name ?? words);
  }
}
