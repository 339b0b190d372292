// The fluoroscope of a page without a server: pulses of the picture's rays go to its worker, of which the picture comes back.
import { BodyMotion, Exposed, kOpen, Pulse } from "./fluoroscope";
import type { FluoroscopeStart, FromFluoroscope, PulseOrder } from "./fluoroscope_worker";
import type { ComingReds } from "./gl";
import type { View } from "./view";

declare const kFluoroscopeWorker: string; // its program, which build.mjs puts here

const kPoll_ms = 3; // of the graphics device

/** A picture of the detector, row 0 on top. */
export interface DetectorImage {
  greys: Uint8Array;
  view: View;
  has_outline: boolean; // the graphics device has drawn where the vessels are
}

export interface FluoroscopyListener {
  shows(image: DetectorImage, exposed: Exposed): void;
  /** The next rays can be drawn. */
  is_ready(): void;
  failed(why: string): void;
}

export class Fluoroscopy {
  private readonly worker: Worker;
  private is_drawing = false; // rays, on the graphics device
  private readonly sent: Omit<DetectorImage, "greys">[] = []; // pulses that are in the worker
  private due = 0; // pulses
  private pause_s: number | null = null;
  private takes_new_mask = false;
  image: DetectorImage | null = null;
  settings = kOpen;
  motion_speed = 1; // of the body

  constructor(code: WebAssembly.Module, setup: Float64Array, private readonly listener: FluoroscopyListener) {
    this.worker = new Worker(URL.createObjectURL(new Blob([kFluoroscopeWorker], { type: "text/javascript" })));
    this.worker.addEventListener("message", ({ data }: MessageEvent<FromFluoroscope>) => this.take(data));
    this.worker.addEventListener("error", (event) => listener.failed(event.message || "its worker did not start"));
    const start: FluoroscopeStart = { code, setup };
    this.worker.postMessage(start);
  }

  /** The pedal goes down, after so long. */
  begin_run(pause_s: number): void {
    this.pause_s = pause_s;
  }

  /** So many pulses, of which one is drawn. */
  expose(pulses: number): void {
    this.due += pulses;
  }

  take_new_mask(): void {
    this.takes_new_mask = true;
  }

  /** Whether a picture's rays are asked for: the graphics device draws some while the worker makes a picture of others, and no more. */
  get is_due(): boolean {
    return this.due > 0 && !this.is_drawing && this.sent.length < 2;
  }

  /** The rays of a pulse, once the device has drawn them. */
  begin_pulse(rays: ComingReds, view: View, has_outline: boolean, phases: readonly number[]): void {
    const motion: BodyMotion = { phases, speed: this.motion_speed }, pulse: Pulse = { view, count: this.due, pause_s: this.pause_s, motion };
    this.due = 0;
    this.pause_s = null;
    this.is_drawing = true;
    this.await_rays(rays, pulse, has_outline);
  }

  private await_rays(rays: ComingReds, pulse: Pulse, has_outline: boolean): void {
    const depths = rays.take_all();
    if (!depths && !rays.is_lost) return void setTimeout(() => this.await_rays(rays, pulse, has_outline), kPoll_ms);
    this.is_drawing = false;
    if (!depths) return;
    const order: PulseOrder = { pulse, settings: this.settings, takes_new_mask: this.takes_new_mask, depths, stride: rays.stride };
    this.takes_new_mask = false;
    this.sent.push({ view: pulse.view, has_outline });
    this.worker.postMessage(order, [depths.buffer as ArrayBuffer]);
    this.listener.is_ready();
  }

  private take(message: FromFluoroscope): void {
    if ("failure" in message) {
      this.sent.shift();
      return this.listener.failed(message.failure);
    }
    this.image = { ...this.sent.shift()!, greys: message.greys };
    document.documentElement.dataset.pulses = String(Number(document.documentElement.dataset.pulses ?? 0) + 1);
    document.documentElement.dataset.pulse_ms = message.passed_ms.toFixed(1);
    this.listener.shows(this.image, message.exposed);
  }
}
