// A session without a server: the simulation runs in a worker of the page.
import type { LinkListener, SessionLink } from "./connection";
import type { Trainer } from "./data";
import type { FromWorker, Order, ToWorker } from "./trainer_worker";

declare const kWorker: string; // its program, which build.mjs puts here

export interface TrainerListener extends LinkListener {
  exchanged(instrument: number, choice: number): void;
  refused(why: string): void;
  failed(why: string): void;
}

/** Whether this browser can have one. */
export const can_simulate = (): boolean => typeof WebAssembly === "object" && typeof Worker === "function";

export class TrainerLink implements SessionLink {
  private readonly worker: Worker;

  constructor(private readonly trainer: Trainer, private readonly listener: TrainerListener) {
    const address = URL.createObjectURL(new Blob([kWorker], { type: "text/javascript" }));
    this.worker = new Worker(address);
    this.worker.addEventListener("message", ({ data }: MessageEvent<FromWorker>) => this.take(data));
    this.worker.addEventListener("error", (event) => listener.failed(event.message || "its worker did not start"));
    const { code, setup } = trainer;
    this.post({ code, setup });
    listener.has_role({ steers: true, browsers: 1 });
  }

  send(message: object): void {
    this.post(message as Order);
  }

  private post(message: ToWorker): void {
    this.worker.postMessage(message);
  }

  private take(message: FromWorker): void {
    if (message instanceof ArrayBuffer) {
      this.post("read");
      this.listener.told(message);
    } else if ("failure" in message) {
      this.listener.failed(this.named(message.failure));
    } else {
      const { instrument, choice, refusal } = message.exchanged;
      if (refusal !== null) this.listener.refused(this.named(refusal));
      else this.listener.exchanged(instrument, choice);
    }
  }

  /** The simulation knows instruments by their numbers. */
  private named(text: string): string {
    return text.replace(/instrument (\d+)/g, (words, number) => this.trainer.choices[Number(number)]?.name ?? words);
  }
}
