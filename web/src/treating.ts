// What the hub that is held does besides: the pressure of a balloon, the sheath of a stent, and the coil on a wire.
import type { InstrumentHeader } from "./data";
import { fixed } from "./fixed";
import type { LiveCoil, LiveInstrument } from "./live_message";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

/** An order to an instrument, from the outermost on. */
export type TreatingOrder = { balloon: { instrument: number; bar: number } } | { sheath: { instrument: number; mm: number } } | { detach: { instrument: number } };

const kPercent = 100;

function coil_state({ loop_mm, length_mm, laid_mm, is_outside }: LiveCoil, packing: number): string {
  const packed = packing > 0 ? `, packing density ${fixed(kPercent * packing, 1)} %` : "";
  if (length_mm === 0) return `no coil: draw the wire back to 0 for the next one${packed}`;
  return `coil of ${Number(loop_mm.toFixed(1))} by ${fixed(length_mm, 0)} mm: ${fixed(laid_mm, 0)} mm in the aneurysm${is_outside ? "; lead the tip around it into one" : ""}${packed}`;
}

/** How its balloon, stent or coil is; null where it has none. `packing`: of the sac with the most coils. */
export function state_of({ radius_mm, balloon_bar, sheath, coils }: InstrumentHeader, now: LiveInstrument, packing = 0): string | null {
  const kNothing_mm = 0.1;
  if (balloon_bar !== undefined) {
    if (now.balloon_mm > 2 * radius_mm + kNothing_mm) return `balloon ${fixed(now.inflation_bar, 1)} bar, ${fixed(now.balloon_mm, 2)} mm`;
    return now.inflation_bar > 0.5 ? "balloon folded: advance it out of what is around it" : "balloon folded";
  }
  if (coils) return coil_state(now.coil, packing);
  if (!sheath) return null;
  if (now.free_rings === 0 && now.release_mm >= sheath.mm - kNothing_mm) return "the stent is not free: advance it out of what is around it";
  return `${now.free_rings} of ${sheath.rings} rings of the stent are free`;
}

export class Treating {
  private readonly bar = element<HTMLInputElement>("balloon-bar");
  private readonly mm = element<HTMLInputElement>("sheath-mm");
  private readonly detach = element<HTMLButtonElement>("detach");
  private hub = -1;
  private name = "";
  private released_mm = 0;

  constructor(private readonly order: (order: TreatingOrder) => void) {
    this.bar.addEventListener("input", () => this.order({ balloon: { instrument: this.hub, bar: Number(this.bar.value) } }));
    this.mm.addEventListener("input", () => {
      this.mm.value = String(Math.max(Number(this.mm.value), this.released_mm)); // it does not go back over the stent
      this.order({ sheath: { instrument: this.hub, mm: Number(this.mm.value) } });
    });
    this.detach.addEventListener("click", () => this.detach.getAttribute("aria-disabled") === "false" && this.order({ detach: { instrument: this.hub } }));
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
  show(hub: number, { name, balloon_bar, sheath, coils }: InstrumentHeader, now: LiveInstrument): void {
    const is_other = hub !== this.hub || name !== this.name;
    this.hub = hub;
    this.name = name;
    this.released_mm = now.release_mm;
    element("treating").hidden = balloon_bar === undefined && !sheath && !coils;
    element("balloon").hidden = balloon_bar === undefined;
    element("sheath").hidden = !sheath;
    this.detach.hidden = !coils;
    this.detach.setAttribute("aria-disabled", String(!now.coil.can_be_detached)); // it takes no focus away
    this.bar.max = String(balloon_bar ?? 0);
    this.mm.max = String(sheath?.mm ?? 0);
    if (!is_other) return; // sliders say what is wanted, which comes about in seconds
    this.bar.value = String(now.inflation_bar);
    this.mm.value = String(now.release_mm);
  }
}
