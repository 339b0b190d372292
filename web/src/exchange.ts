// The list from which another instrument is taken instead of the one that is held.
import type { Trainer } from "./data";

export interface ExchangeOrder {
  instrument: number;
  choice: number;
}

export class Exchange {
  private readonly choice = document.getElementById("exchange") as HTMLSelectElement;
  private readonly used: number[];
  private hub = 0;

  constructor({ choices, used }: Trainer, private readonly ask: (order: ExchangeOrder) => void) {
    this.used = [...used];
    this.choice.append(...choices.map(({ name }, c) => new Option(name, String(c))));
    document.getElementById("exchange-choice")!.hidden = false;
    this.choice.addEventListener("change", () => {
      this.ask({ instrument: this.hub, choice: Number(this.choice.value) });
      this.choice.blur(); // keys steer again
    });
    this.show(0);
  }

  took(instrument: number, choice: number): void {
    this.used[instrument] = choice;
    this.show(this.hub);
  }

  /** Of the hub that is held, unless somebody chooses. */
  show(hub: number): void {
    this.hub = hub;
    if (document.activeElement !== this.choice) this.choice.value = String(this.used[hub]);
  }
}
