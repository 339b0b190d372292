// Opens the page: reads the session, and connects the picture with what moves it.
import { hash_of, state_of } from "./address";
import { limited } from "./camera";
import { Header, SessionData, session_of } from "./data";
import { length_s } from "./device_shape";
import { Film } from "./film";
import { Actions, Hands } from "./input";
import { draw_overlay } from "./overlay";
import { Picture } from "./picture";
import { State, Store, first_state } from "./state";
import { Tools } from "./tools";
import { clamp } from "./vectors";
import { label_of } from "./view";

const kRest_ms = 150; // without a move, after which the picture is drawn fully
const kMostPixels = 2_000_000; // of the picture; more are shown enlarged

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const stage = element("stage"), canvas = element<HTMLCanvasElement>("picture"), overlay = element<HTMLCanvasElement>("overlay");

function note(words: string): void {
  element("note").textContent = words;
  element("note").hidden = words === "";
}

/** The state that the address asks for, within its limits. */
function asked_state(data: SessionData): State {
  const state = state_of(location.hash, first_state(data));
  if (state.look === "surface" && !data.vessels && !data.catheter && !data.run) state.look = "fluoro";
  return {
    ...state, camera: limited(state.camera, data.map.bounds), time_s: data.run ? clamp(state.time_s, 0, length_s(data.run)) : 0,
  };
}

/** Draws when something has changed, at most once a frame of the display. */
class Page {
  private readonly film: Film | null;
  private readonly tools: Tools;
  private is_due = false;
  private is_lost = false;
  private moved_ms = -Infinity;
  private pictures = 0;

  constructor(private readonly data: SessionData, private readonly store: Store, private readonly picture: Picture) {
    const actions: Actions = {
      toggle_layer: (k) => this.toggle_layer(k),
      reset: () => store.update({ camera: { ...store.first.camera }, window: store.first.window }),
      copy_link: () => void this.copy_link(),
      save_picture: () => this.save_picture(),
      play: () => this.film?.toggle(),
      step: (pictures) => this.film?.step(pictures),
      help: () => element<HTMLDetailsElement>("help").toggleAttribute("open"),
    };
    const hands = new Hands(stage, store, picture, data.map.bounds, actions);
    this.film = data.run && new Film(data.run, store);
    this.tools = new Tools(data, store, hands, actions);
    document.body.classList.toggle("bare", store.state.is_bare);
    store.on_change((state, before) => this.changed(state, before));
    addEventListener("hashchange", () => store.update(asked_state(data)));
    new ResizeObserver(() => this.draw()).observe(stage); // before the resized page is painted
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.film?.draw());
    canvas.addEventListener("webglcontextlost", (event) => this.lose(event));
    canvas.addEventListener("webglcontextrestored", () => this.restore());
    for (const shown of [canvas, overlay]) shown.hidden = false;
    this.draw();
    element("still").hidden = true;
    note("");
  }

  private changed(state: State, before: State): void {
    if (state.camera !== before.camera || state.window !== before.window) this.moved_ms = performance.now();
    if (state.is_bare !== before.is_bare) document.body.classList.toggle("bare", state.is_bare);
    this.tools.show(state);
    if (state.time_s !== before.time_s) this.film?.draw();
    this.request();
  }

  private request(): void {
    if (this.is_due) return;
    this.is_due = true;
    requestAnimationFrame(() => {
      this.is_due = false;
      this.draw();
    });
  }

  private resize(): number {
    const { clientWidth: width, clientHeight: height } = stage;
    const scale = Math.min(devicePixelRatio, Math.sqrt(kMostPixels / Math.max(1, width * height)));
    const size = { width: Math.max(1, Math.round(width * scale)), height: Math.max(1, Math.round(height * scale)) };
    if (canvas.width !== size.width || canvas.height !== size.height) Object.assign(canvas, size);
    return scale;
  }

  private draw(): void {
    if (this.is_lost) return;
    const scale = this.resize(), { state } = this.store, rest_ms = performance.now() - this.moved_ms;
    const is_moving = rest_ms < kRest_ms && !state.is_bare;
    this.picture.draw(state, is_moving);
    const view = this.picture.view(state);
    if (!state.is_bare) draw_overlay(overlay, view, state.shows_road_map ? this.picture.vessels_in(view) : null, scale);
    this.describe(state);
    document.documentElement.dataset.pictures = String(++this.pictures);
    if (is_moving) setTimeout(() => this.request(), kRest_ms - rest_ms + 1);
  }

  private describe(state: State): void {
    const { camera } = state, radians = Math.PI / 180, sign = camera.table_mm < 0 ? "−" : "+";
    const angles = label_of(camera.lao_deg * radians, camera.cranial_deg * radians);
    element("readout").textContent = `${angles}   table ${sign}${Math.abs(Math.round(camera.table_mm))} mm   ×${Number(camera.zoom.toPrecision(2))}`;
    canvas.setAttribute("aria-label", `${state.look === "fluoro" ? "Fluoroscopy" : "Shaded vessels in the body"} from ${angles}`);
  }

  private toggle_layer(k: number): void {
    if (k >= this.data.map.layers) return;
    const { hidden_layers } = this.store.state;
    const shown = hidden_layers.filter((other) => other !== k);
    this.store.update({ hidden_layers: shown.length < hidden_layers.length ? shown : [...hidden_layers, k].sort((a, b) => a - b) });
  }

  private async copy_link(): Promise<void> {
    const hash = hash_of(this.store.state, this.store.first), link = location.href.replace(/#.*$/, "") + hash;
    history.replaceState(null, "", hash);
    try {
      await navigator.clipboard.writeText(link);
      this.tell("The link to this view is copied.");
    } catch {
      this.tell("The link to this view is in the address bar.");
    }
  }

  private tell(words: string): void {
    note(words);
    setTimeout(() => note(""), 2500);
  }

  /** The picture as it is shown, with letters and bar unless it is bare. */
  private save_picture(): void {
    this.picture.draw(this.store.state, false);
    const whole = document.createElement("canvas"), context = whole.getContext("2d")!;
    Object.assign(whole, { width: canvas.width, height: canvas.height });
    context.drawImage(canvas, 0, 0);
    if (!this.store.state.is_bare) context.drawImage(overlay, 0, 0);
    whole.toBlob((blob) => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(blob!);
      link.download = `${element("readout").textContent!.split(/\s{2}/)[0]!.replace(/[^A-Za-z0-9.]+/g, "-").toLowerCase()}.png`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    }, "image/png");
  }

  private lose(event: Event): void {
    event.preventDefault();
    this.is_lost = true;
    note("The graphics device is lost; the picture comes back with it.");
  }

  private restore(): void {
    this.picture.restore();
    this.is_lost = false;
    note("");
    this.draw();
  }
}

async function open(): Promise<void> {
  const header = JSON.parse(element("session").textContent!) as Header;
  const data = await session_of(header, element("data").textContent!.trim());
  const store = new Store(asked_state(data), first_state(data));
  const picture = Picture.on(canvas, data);
  if (!picture) return note("This browser has no WebGL 2, so this is a still picture.");
  new Page(data, store, picture);
}

open().catch((error: Error) => note(`This is a still picture: ${error.message}.`));
