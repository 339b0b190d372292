// The fluoroscope's controls on the page, and what it has given.
import { ConsoleSettings, Exposed, kDoses, kOpen, MaskMatching } from "./fluoroscope";
import { fixed } from "./fixed";
import { clamp } from "./vectors";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

const kLeast_mm = 20; // between the blades
const kStep = 0.9; // of a key

type Blades = ConsoleSettings["blades_mm"];

/** What the panel is connected with. */
export interface ExposureActions {
  set(settings: ConsoleSettings): void;
  take_new_mask(): void;
  /** The picture's width and height in mm at the isocentre. */
  field_mm(): readonly [number, number];
}

export class ExposurePanel {
  settings: ConsoleSettings;
  private exposed: Exposed | null = null;
  private readonly sliders = (["blades-width", "blades-height"] as const).map((id) => element<HTMLInputElement>(id));
  private readonly compression = element<HTMLInputElement>("compression");

  /** With what is set at first, and how masks of a body that moves can be matched. */
  constructor(private readonly actions: ExposureActions, settings: Pick<ConsoleSettings, "dose" | "compression">, matching: MaskMatching | null) {
    this.settings = { ...kOpen, ...settings };
    for (const id of ["exposure-buttons", "dose-readout"]) element(id).hidden = false;
    const dose = element<HTMLSelectElement>("dose");
    dose.append(...kDoses.map((name, level) => new Option(name, String(level))));
    dose.addEventListener("change", () => {
      this.set({ dose: Number(dose.value) });
      dose.blur(); // keys steer again
    });
    element("subtract").addEventListener("click", () => this.set({ subtracts: !this.settings.subtracts }));
    element("new-mask").addEventListener("click", () => actions.take_new_mask());
    element("angiogram-map").addEventListener("click", () => this.toggle_road_map());
    element("max-opacification").addEventListener("click", () => this.set({ shows_maximum: !this.settings.shows_maximum }));
    element("phase-masks").addEventListener("click", () => this.set({ mask_matching: this.settings.mask_matching ? null : matching }));
    element("phase-masks").hidden = matching === null;
    this.compression.addEventListener("input", () => this.set({ compression: Number(this.compression.value) }));
    for (const slider of [this.compression, ...this.sliders]) slider.addEventListener("pointerup", () => slider.blur());
    for (const slider of this.sliders) slider.addEventListener("input", () => this.set_blades(this.sliders.map(({ value }) => Number(value))));
    this.show_settings();
  }

  /** Whether it was a key of these controls. */
  takes(key: string): boolean {
    const keys: Record<string, () => void> = {
      d: () => this.set({ dose: (this.settings.dose + 1) % kDoses.length }), s: () => this.set({ subtracts: !this.settings.subtracts }), n: () => this.actions.take_new_mask(), a: () => this.toggle_road_map(),
      "[": () => this.narrow(kStep, 1), "]": () => this.narrow(1 / kStep, 1), "{": () => this.narrow(1, kStep), "}": () => this.narrow(1, 1 / kStep),
    };
    keys[key]?.();
    return key in keys;
  }

  show(exposed: Exposed): void {
    this.exposed = exposed;
    if (exposed.has_lost_road_map && this.settings.shows_road_map) return this.set({ shows_road_map: false });
    this.show_subtraction();
    this.show_readout();
  }

  /** After the picture shows another field. */
  show_settings(): void {
    const { dose, blades_mm, compression } = this.settings, field_mm = this.actions.field_mm();
    element<HTMLSelectElement>("dose").value = String(dose);
    this.compression.value = String(compression);
    this.show_subtraction();
    this.sliders.forEach((slider, axis) => {
      const most = Math.max(kLeast_mm + 1, Math.round(field_mm[axis]!));
      Object.assign(slider, { min: String(kLeast_mm), max: String(most), value: String(blades_mm?.[axis] ?? most) });
      slider.setAttribute("aria-valuetext", blades_mm ? `${Math.round(blades_mm[axis]!)} mm` : "open");
    });
    this.show_readout();
  }

  /** Also after a pulse, which may be the first that fills vessels. */
  private show_subtraction(): void {
    const { subtracts, shows_maximum, shows_road_map, mask_matching } = this.settings, has_angiogram = this.exposed?.has_angiogram ?? false;
    show_toggle("subtract", true, subtracts);
    element<HTMLButtonElement>("new-mask").disabled = !subtracts;
    show_toggle("max-opacification", subtracts, subtracts && shows_maximum);
    show_toggle("phase-masks", subtracts, subtracts && mask_matching !== null);
    show_toggle("angiogram-map", has_angiogram || shows_road_map, shows_road_map);
  }

  /** It lies behind the picture that is not subtracted. */
  private toggle_road_map(): void {
    if (this.exposed?.has_angiogram || this.settings.shows_road_map) this.set({ shows_road_map: !this.settings.shows_road_map, subtracts: false });
  }

  private narrow(across: number, along: number): void {
    const [width_mm, height_mm] = this.settings.blades_mm ?? this.actions.field_mm();
    this.set_blades([across * width_mm, along * height_mm]);
  }

  /** Blades that leave the picture's field free are open. */
  private set_blades(wanted_mm: readonly number[]): void {
    const field_mm = this.actions.field_mm(), [width_mm, height_mm] = wanted_mm.map((mm, axis) => clamp(mm, kLeast_mm, Math.max(kLeast_mm, field_mm[axis]!))) as [number, number];
    const is_open = width_mm >= field_mm[0] - 1 && height_mm >= field_mm[1] - 1;
    this.set({ blades_mm: is_open ? null : [width_mm, height_mm] });
  }

  private set(change: Partial<ConsoleSettings>): void {
    this.settings = { ...this.settings, ...change };
    this.show_settings();
    this.actions.set(this.settings);
  }

  private show_readout(): void {
    element("dose-readout").textContent = [...(this.exposed ? words_of_dose(this.exposed) : ["no X-rays yet"]), ...this.words_of_settings].join("  ·  ");
  }

  private get words_of_settings(): string[] {
    const { subtracts, shows_road_map, blades_mm } = this.settings, is_masking = this.exposed?.is_masking ?? true;
    return [...(subtracts ? [is_masking ? "subtraction: hold the pedal for the mask" : "subtraction"] : []), ...(shows_road_map ? ["road map of the angiogram"] : []), ...words_of_blades(blades_mm)];
  }
}

/** What has no use now stays where it is: buttons that came and went would change the picture's size, and with it lose mask and angiogram. */
function show_toggle(id: string, is_of_use: boolean, is_on: boolean): void {
  element<HTMLButtonElement>(id).disabled = !is_of_use;
  element(id).setAttribute("aria-pressed", String(is_on));
}

const words_of_blades = (blades_mm: Blades): string[] => (blades_mm ? [`blades ${Math.round(blades_mm[0])} × ${Math.round(blades_mm[1])} mm`] : []);

const words_of_dose = ({ kvp, mas, kerma_mGy_min, air_kerma_mGy, dap_Gycm2, images, is_saturated }: Exposed): string[] => [
  `${kvp} kVp, ${significant(mas)} mAs${is_saturated ? ", detector saturated" : ""}`, `${significant(kerma_mGy_min)} mGy/min`, `air kerma ${significant(air_kerma_mGy)} mGy`,
  `dose-area product ${significant(dap_Gycm2)} Gy cm²`, ...(images > 0 ? [`${fixed(images, 0)} images recorded`] : []),
];

/** Three digits, without exponents. */
const significant = (value: number): string => (value > 0 ? value.toFixed(Math.max(0, Math.min(4, 2 - Math.floor(Math.log10(value))))) : "0");
