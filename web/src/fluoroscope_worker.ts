// The worker of the page's fluoroscope: makes pictures of the rays that the graphics device has drawn, whatever the simulation does.
import { ConsoleSettings, Exposed, Fluoroscope, Pulse } from "./fluoroscope";

/** The first message. */
export interface FluoroscopeStart {
  code: WebAssembly.Module;
  setup: Float64Array;
}

export interface PulseOrder {
  pulse: Pulse;
  settings: ConsoleSettings;
  takes_new_mask: boolean;
  depths: Float32Array;
  stride: number;
}

/** A picture, or why there is none. */
export type FromFluoroscope = { greys: Uint8Array; exposed: Exposed; passed_ms: number } | { failure: string };

const scope = self as unknown as { postMessage(message: FromFluoroscope, transfer?: Transferable[]): void };
let fluoroscope: Promise<Fluoroscope> | null = null;

async function expose({ pulse, settings, takes_new_mask, depths, stride }: PulseOrder): Promise<void> {
  const open = await fluoroscope!, from_ms = performance.now();
  open.set(settings);
  if (takes_new_mask) open.take_new_mask();
  const exposed = open.expose(pulse, depths, stride), greys = open.image(pulse.view);
  scope.postMessage({ greys, exposed, passed_ms: performance.now() - from_ms }, [greys.buffer as ArrayBuffer]);
}

addEventListener("message", ({ data }: MessageEvent<FluoroscopeStart | PulseOrder>) => {
  if ("code" in data) fluoroscope = Fluoroscope.of(data.code, data.setup);
  const done = "pulse" in data ? expose(data) : fluoroscope!;
  done.catch((error: Error) => scope.postMessage({ failure: error.message }));
});
