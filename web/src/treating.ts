// What the hub that is held does besides: the pressure of a balloon, and the sheath of a stent.
import type { InstrumentHeader } from "./data";
import { fixed } from "./fixed";
import type { LiveInstrument } from "./live_message";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

/** An order to an instrument, from the outermost on. */
export type TreatingOrder = { balloon: { instrument: number; bar: number } } | { sheath: { instrument: number; mm: number } };

/** How its balloon, or stent, is; null where it has none. */
export function state_of({ radius_mm, balloon_bar, sheath }: InstrumentHeader, now: LiveInstrument): string | null {
  const kNothing_mm = 0.1;
  if (balloon_bar !== undefined) {
    if (now.balloon_mm > 2 * radius_mm + kNothing_mm) return `balloon ${fixed(now.inflation_bar, 1)} bar, ${fixed(now.balloon_mm, 2)} mm`;
    return now.inflation_bar > 0.5 ? "balloon folded: advance it out of what is around it" : "balloon folded";
  }
  if (!sheath) return null;
  if (now.free_rings === 0 && now.release_mm >= sheath.mm - kNothing_mm) return "the stent is not free: advance it out of what is around it";
  return `${now.free_rings} of ${sheath.rings} rings of the stent are free`;
}

export class Treating {
  private readonly bar = element<HTMLInputElement>("balloon-bar");
  private readonly mm = element<HTMLInputElement>("sheath-mm");
  private hub = -1;
  private name = "";
  private released_mm = 0;

  constructor(private readonly order: (order: TreatingOrder) => void) {
    this.bar.addEventListener("input", () => this.order({ balloon: { instrument: this.hub, bar: Number(this.bar.value) } }));
    this.mm.addEventListener("input", () => {
      this.mm.value = String(Math.max(Number(this.mm.value), this.released_mm)); // it does not go back over the stent
      this.order({ sheath: { instrument: this.hub, mm: Number(this.mm.value) } });
    });
    element("fold").addEventListener("click", () => {
      this.bar.value = "0";
      this.order({ balloon: { instrument: this.hub, bar: 0 } });
    });
    // After a drag arrows steer again; by keys they move the slider that has the focus.
    for (const slider of [this.bar, this.mm]) slider.addEventListener("pointerup", () => slider.blur());
  }

  /** Sliders are set anew by the next state: somebody else has steered. */
  forget(): void {
    this.hub = -1;
  }

  /** Of the instrument that is held. */
  show(hub: number, { name, balloon_bar, sheath }: InstrumentHeader, now: LiveInstrument): void {
    const is_other = hub !== this.hub || name !== this.name;
    this.hub = hub;
    this.name = name;
    this.released_mm = now.release_mm;
    element("treating").hidden = balloon_bar === undefined && !sheath;
    element("balloon").hidden = balloon_bar === undefined;
    element("sheath").hidden = !sheath;
    this.bar.max = String(balloon_bar ?? 0);
    this.mm.max = String(sheath?.mm ?? 0);
    if (!is_other) return; // sliders say what is wanted, which comes about in seconds
    this.bar.value = String(now.inflation_bar);
    this.mm.value = String(now.release_mm);
  }
}
