// The page's fluoroscope: the program's, compiled to WebAssembly (web/native/fluoroscope.cpp).
import { instance_of } from "./wasm_instance";
import type { View } from "./view";

interface Exports {
  memory: WebAssembly.Memory;
  _initialize(): void;
  room_for(count: number): number;
  fluoroscope_open(): number;
  fluoroscope_rays(pixels: number): number;
  fluoroscope_dose(level: number): void;
  fluoroscope_blades(width_mm: number, height_mm: number): number;
  fluoroscope_compression(share: number): number;
  fluoroscope_subtract(subtracts: boolean): void;
  fluoroscope_new_mask(): void;
  fluoroscope_road_map(shows: boolean): void;
  fluoroscope_maximum_opacification(shows: boolean): void;
  fluoroscope_match_masks(mode: number, wraps: boolean, cycle_s: number): void;
  fluoroscope_expose(): number;
  fluoroscope_image(): number;
  fluoroscope_codes(): number;
}

export const kDoses = ["low", "normal", "cine"] as const;

/** What is set on the console. */
export interface ConsoleSettings {
  dose: number; // of kDoses
  blades_mm: readonly [number, number] | null; // width and height at the isocentre; none: they are open
  subtracts: boolean;
  shows_maximum: boolean; // opacification, of a subtraction
  shows_road_map: boolean; // of the vessels that were opacified, behind the live picture
  mask_matching: MaskMatching | null; // none: a mask is the mean of a few pulses
  compression: number; // of the display's range, 0 to 1
}

/** By the phase of which of the body's modes masks are matched (viewer/xraycast/acquisition/mask_phase.hpp). */
export interface MaskMatching {
  mode: number;
  wraps: boolean;
  cycle_s: number;
}

export interface Pulse {
  view: View;
  count: number; // since the last one that was drawn, itself included
  pause_s: number | null; // before it; none: the pedal was down
  motion: BodyMotion;
}

/** Of a body that moves. */
export interface BodyMotion {
  phases: readonly number[]; // none: it stands still
  speed: number;
}

/** What a pulse gave. */
export interface Exposed {
  kvp: number;
  mas: number;
  kerma_mGy_min: number;
  air_kerma_mGy: number;
  dap_Gycm2: number;
  fluoroscopy_s: number;
  images: number;
  is_saturated: boolean;
  is_masking: boolean; // pulses are taken for a mask
  has_angiogram: boolean; // vessels were opacified since the mask
  has_lost_road_map: boolean; // another view has none
}

/** The usual settings. */
export const kOpen: ConsoleSettings = {
  dose: kDoses.indexOf("normal"), blades_mm: null, subtracts: false, shows_maximum: false, shows_road_map: false, mask_matching: null, compression: 0,
};

export class Fluoroscope {
  private settings: ConsoleSettings | null = null;

  private constructor(private readonly calls: Exports) {}

  /** Of an exported page's setup (viewer/xraycast/trainer/fluoroscope_setup.hpp). Throws where that is damaged. */
  static async of(code: WebAssembly.Module | BufferSource, setup: Float64Array): Promise<Fluoroscope> {
    const fluoroscope = new Fluoroscope((await instance_of(code)).exports as unknown as Exports);
    fluoroscope.put(setup);
    fluoroscope.check(fluoroscope.calls.fluoroscope_open());
    return fluoroscope;
  }

  /** Throws where blades leave nothing open. */
  set(settings: ConsoleSettings): void {
    const { calls, settings: before } = this;
    this.settings = settings;
    if (settings.dose !== before?.dose) calls.fluoroscope_dose(settings.dose);
    if (settings.subtracts !== (before?.subtracts ?? false)) calls.fluoroscope_subtract(settings.subtracts);
    if (settings.shows_maximum !== before?.shows_maximum) calls.fluoroscope_maximum_opacification(settings.shows_maximum);
    if (settings.shows_road_map !== before?.shows_road_map) calls.fluoroscope_road_map(settings.shows_road_map);
    if (settings.mask_matching?.mode !== before?.mask_matching?.mode) {
      const { mode, wraps, cycle_s } = settings.mask_matching ?? { mode: -1, wraps: false, cycle_s: 0 };
      calls.fluoroscope_match_masks(mode, wraps, cycle_s);
    }
    if (settings.compression !== before?.compression) this.check(calls.fluoroscope_compression(settings.compression));
    const [width_mm, height_mm] = settings.blades_mm ?? [0, 0];
    if (settings.blades_mm?.join() !== before?.blades_mm?.join()) this.check(calls.fluoroscope_blades(width_mm, height_mm));
  }

  take_new_mask(): void {
    this.calls.fluoroscope_new_mask();
  }

  /** A pulse through optical depths, which lie `stride` apart, the lowest row first, as graphics devices give them. */
  expose({ view: v, count, pause_s, motion }: Pulse, depths: Float32Array, stride: number): Exposed {
    const { calls } = this, { width, height } = v, at = calls.fluoroscope_rays(width * height), rays = new Float32Array(calls.memory.buffer, at, width * height);
    for (let j = 0, to = 0; j < height; ++j)
      for (let i = 0, from = stride * width * (height - 1 - j); i < width; ++i, from += stride) rays[to++] = depths[from]!;
    this.put([v.lao_rad, v.cranial_rad, ...v.centre_mm, width, height, v.pixel_mm, v.cone?.source_axis_mm ?? 0, v.cone?.source_detector_mm ?? 0, count, pause_s ?? -1, motion.speed, ...motion.phases]);
    this.check(calls.fluoroscope_expose());
    const kNumbers = 11, [kvp, mas, kerma_mGy_min, air_kerma_mGy, dap_Gycm2, fluoroscopy_s, images, saturated, masking, angiogram, road_map] = new Float64Array(calls.memory.buffer, calls.room_for(kNumbers), kNumbers);
    return {
      kvp: kvp!, mas: mas!, kerma_mGy_min: kerma_mGy_min!, air_kerma_mGy: air_kerma_mGy!, dap_Gycm2: dap_Gycm2!, fluoroscopy_s: fluoroscopy_s!, images: images!,
      is_saturated: saturated === 1, is_masking: masking === 1, has_angiogram: angiogram === 1,
      has_lost_road_map: this.settings!.shows_road_map && road_map !== 1,
    };
  }

  /** Greys of the last pulse, row 0 on top. */
  image({ width, height }: View): Uint8Array {
    return new Uint8Array(this.calls.memory.buffer, this.calls.fluoroscope_image(), width * height).slice();
  }

  /** What the detector sent of it. */
  codes({ width, height }: View): Uint16Array {
    return new Uint16Array(this.calls.memory.buffer, this.calls.fluoroscope_codes(), width * height).slice();
  }

  private put(numbers: ArrayLike<number>): void {
    const at = this.calls.room_for(numbers.length); // memory may grow, and has another buffer then
    new Float64Array(this.calls.memory.buffer, at, numbers.length).set(numbers);
  }

  private check(at: number): void {
    if (at === 0) return;
    const bytes = new Uint8Array(this.calls.memory.buffer);
    throw new Error(new TextDecoder().decode(bytes.subarray(at, bytes.indexOf(0, at))));
  }
}
