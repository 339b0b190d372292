// Opens the page: reads the session, and connects the picture with what moves it.
import { exercise_of, hash_of, hash_with_exercise, state_of } from "./address";
import type { CArmPose } from "./c_arm_pose";
import { Header, SessionData, Trainer, session_of } from "./data";
import { shown_time_s } from "./instrument_shape";
import { MotionPlayer, RunTraces } from "./motion_player";
import { RunPlayer } from "./run_player";
import { save_file } from "./saved_file";
import { Actions, PictureControls } from "./picture_controls";
import { LiveView } from "./live";
import { Outline, draw_overlay } from "./overlay";
import { Picture } from "./picture";
import { Notes } from "./notes";
import { State, Store, first_state } from "./state";
import { Tools } from "./tools";
import { TrainerWorker, can_simulate } from "./trainer";
import { View, label_of } from "./view";

const kRest_ms = 150; // without a move, after which the picture is drawn fully
const kMostPixels = 2_000_000; // of the picture; more are shown enlarged

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const stage = element("stage"), canvas = element<HTMLCanvasElement>("picture"), overlay = element<HTMLCanvasElement>("overlay");

const angles_of = ({ lao_deg, cranial_deg }: CArmPose) => label_of((lao_deg * Math.PI) / 180, (cranial_deg * Math.PI) / 180);

const notes = new Notes((words) => {
  element("note").textContent = words;
  element("note").hidden = words === "";
});

/** Whether pictures of a body that moves come too slowly to be drawn fully. */
class Pace {
  private last_ms = 0;
  private pictures = 0;
  private sum_ms = 0;
  private slow = false;

  is_slow(now_ms: number): boolean {
    const kSlow_ms = 60, kPictures = 6, step_ms = now_ms - this.last_ms;
    this.last_ms = now_ms;
    if (step_ms > 1000) return this.slow; // the first, or after a rest
    this.sum_ms += step_ms;
    if (++this.pictures < kPictures) return this.slow;
    this.slow ||= this.sum_ms > kSlow_ms * this.pictures;
    this.pictures = this.sum_ms = 0;
    return this.slow;
  }

  /** The next motion is tried fully again. */
  rest(): void {
    this.pictures = this.sum_ms = this.last_ms = 0;
    this.slow = false;
  }
}

/** The canvas is as large as the stage; the display's pixels of one of its own. */
function resize(): number {
  const { clientWidth: width, clientHeight: height } = stage;
  const scale = Math.min(devicePixelRatio, Math.sqrt(kMostPixels / Math.max(1, width * height)));
  const size = { width: Math.max(1, Math.round(width * scale)), height: Math.max(1, Math.round(height * scale)) };
  if (canvas.width !== size.width || canvas.height !== size.height) Object.assign(canvas, size);
  return scale;
}

/** Draws when something has changed, at most once a frame of the display. */
class Page {
  private readonly player: RunPlayer | null;
  private readonly motion: MotionPlayer | null;
  private readonly traces: RunTraces | null;
  private readonly tools: Tools;
  private readonly pace = new Pace();
  private is_due = false;
  private is_lost = false;
  private moved_ms = -Infinity;
  private has_moved = false; // since the last picture, which may be long ago on a slow device
  private pictures = 0;
  private overlay_key = "";
  private outlined: Outline["covered"] | undefined;
  private rest_timer = 0;

  constructor(private readonly data: SessionData, private readonly store: Store, private readonly picture: Picture, worker: TrainerWorker | null) {
    const actions: Actions = {
      toggle_layer: (k) => this.toggle_layer(k),
      reset: () => store.update({ pose: { ...store.first.pose }, window: store.first.window }),
      copy_link: () => void this.copy_link(),
      save_picture: () => this.save_picture(),
      play: () => (this.player ?? this.motion)?.toggle(),
      hold: (mode) => this.motion?.toggle_hold(mode),
      gate: () => this.motion?.toggle_gate(),
      step: (pictures) => this.player?.step(pictures),
      help: () => element<HTMLDetailsElement>("help").toggleAttribute("open"),
    };
    const controls = new PictureControls(stage, store, picture, data.map.bounds, actions);
    this.player = data.run && data.run.pictures > 1 ? new RunPlayer(data.run, store) : null;
    this.motion = data.motion && !data.run?.moves && !data.live && !store.state.is_bare ? new MotionPlayer(data.motion, store) : null;
    this.traces = data.motion && data.run?.moves ? new RunTraces(data.motion, store) : null;
    for (const line of document.querySelectorAll<HTMLElement>('[data-keys="motion"]')) line.hidden = !this.motion;
    this.tools = new Tools(data, store, controls, actions);
    document.body.classList.toggle("bare", store.state.is_bare);
    store.on_change((state, before) => this.changed(state, before));
    addEventListener("hashchange", () => this.follow_address());
    new ResizeObserver(() => this.draw()).observe(stage); // before the resized page is painted
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.player?.draw();
      this.motion?.draw();
      this.traces?.draw();
    });
    canvas.addEventListener("webglcontextlost", (event) => this.lose(event));
    canvas.addEventListener("webglcontextrestored", () => this.restore());
    this.show_picture(true);
    notes.state("");
    this.load_keys();
    if (data.live) new LiveView(data.live, data.trainer, worker, data.motion, store, picture, notes, stage, () => this.request());
    this.draw(); // once all that takes room beside the picture is there
  }

  /** The picture, or else the still one. */
  private show_picture(is_drawn: boolean): void {
    for (const shown of [canvas, overlay]) shown.hidden = !is_drawn;
    element("still").hidden = is_drawn;
  }

  /** The key maps of the body's motion, one after the other, while the page can be used; then it moves. */
  private load_keys(): void {
    const left = this.picture.keys_left;
    if (left === 0) return this.begin_motion();
    notes.state(`Preparing the body's motion … ${Math.round(100 * (1 - left / this.data.motion!.keys.rows.length))} %`);
    setTimeout(() => {
      if (!this.is_lost && this.picture.keys_left > 0) this.picture.add_key();
      this.load_keys();
    }, this.is_lost ? 200 : 0);
  }

  private begin_motion(): void {
    if (!this.data.motion) return;
    notes.state("");
    document.documentElement.dataset.motion = "loaded";
    const wants_rest = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (this.motion && !wants_rest && !this.store.state.is_paused) this.motion.start();
    this.request();
  }

  private get modes(): string[] {
    return this.data.motion?.modes.map(({ name }) => name) ?? [];
  }

  private get exercise(): number {
    const { trainer } = this.data;
    return trainer?.exercise ? trainer.exercises.indexOf(trainer.exercise) + 1 : 0;
  }

  private follow_address(): void {
    if (exercise_of(location.hash, this.data.trainer?.exercises.length ?? 0) !== this.exercise) return location.reload();
    const { phases, is_paused } = this.store.state, state = state_of(location.hash, this.store.first, this.modes);
    this.store.update(state.is_paused ? state : { ...state, phases, is_paused });
  }

  private changed(state: State, before: State): void {
    this.motion?.changed(state, before);
    if (state.pose !== before.pose || state.window !== before.window) {
      this.moved_ms = performance.now();
      this.has_moved = true;
    }
    if (state.is_bare !== before.is_bare) document.body.classList.toggle("bare", state.is_bare);
    this.tools.show(state);
    if (state.time_s !== before.time_s) {
      this.player?.draw();
      this.traces?.draw();
    }
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

  private draw(): void {
    if (this.is_lost) return;
    const scale = resize(), { state } = this.store, rest_ms = performance.now() - this.moved_ms;
    const is_moving = (this.has_moved || rest_ms < kRest_ms) && !state.is_bare && !this.picture.held_pose;
    this.has_moved = false;
    const body_moves = this.body_moves;
    const has_road_map = this.picture.draw(state, is_moving || body_moves, is_moving || (body_moves && this.pace.is_slow(performance.now()))), view = this.picture.view(state);
    const outlined = state.shows_road_map && !has_road_map ? this.picture.road_map(view) : null;
    this.draw_overlay(view, outlined, scale);
    this.describe(state);
    document.documentElement.dataset.pictures = String(++this.pictures);
    clearTimeout(this.rest_timer);
    if (!body_moves) this.pace.rest();
    if (is_moving) this.rest_timer = setTimeout(() => this.request(), Math.max(0, kRest_ms - rest_ms) + 1);
  }

  /** Unless it is there already. */
  private draw_overlay(view: View, outlined: Outline | null, scale: number): void {
    const { is_bare } = this.store.state, target = is_bare ? null : this.picture.target, blades_mm = this.picture.fluoroscopy?.settings.blades_mm ?? null;
    const key = JSON.stringify([view, scale, is_bare, target, blades_mm]);
    if (this.overlay_key === key && this.outlined === outlined?.covered) return;
    this.overlay_key = key;
    this.outlined = outlined?.covered;
    draw_overlay(overlay, view, outlined, scale, !is_bare, target, blades_mm);
  }

  private get body_moves(): boolean {
    if (!this.data.motion) return false;
    if (this.data.live) return !this.picture.held_pose;
    return this.motion?.is_playing || (this.player?.is_playing && this.traces !== null) || false;
  }

  private get shown_angles(): string {
    return angles_of(this.picture.held_pose ?? this.store.state.pose);
  }

  private describe(state: State): void {
    const { pose } = state, sign = pose.table_mm < 0 ? "−" : "+", is_held = this.shown_angles !== angles_of(pose);
    element("readout").textContent = `${angles_of(pose)}   table ${sign}${Math.abs(Math.round(pose.table_mm))} mm   ×${Number(pose.zoom.toPrecision(2))}${is_held ? `   picture ${this.shown_angles}` : ""}`;
    canvas.setAttribute("aria-label", `${state.look === "fluoro" ? "Fluoroscopy" : "Shaded vessels in the body"} from ${this.shown_angles}`);
  }

  private toggle_layer(k: number): void {
    if (k >= this.data.map.layers) return;
    const { hidden_layers } = this.store.state;
    const shown = hidden_layers.filter((other) => other !== k);
    this.store.update({ hidden_layers: shown.length < hidden_layers.length ? shown : [...hidden_layers, k].sort((a, b) => a - b) });
  }

  private async copy_link(): Promise<void> {
    const { run } = this.data, { state } = this.store;
    const view = hash_of({ ...state, time_s: run ? shown_time_s(run, state.time_s) : 0 }, this.store.first, this.modes);
    const hash = this.data.trainer?.exercises.length ? hash_with_exercise(view, this.exercise) : view, link = location.href.replace(/#.*$/, "") + hash;
    history.replaceState(null, "", hash);
    try {
      await navigator.clipboard.writeText(link);
      notes.tell("The link to this view is copied.");
    } catch {
      notes.tell("The link to this view is in the address bar.");
    }
  }

  /** The picture as it is shown, with letters and bar unless it is bare. */
  private save_picture(): void {
    if (this.is_lost) return notes.tell("There is no picture to save until the graphics device is back.");
    this.picture.draw(this.store.state, false);
    const whole = document.createElement("canvas"), context = whole.getContext("2d")!;
    Object.assign(whole, { width: canvas.width, height: canvas.height });
    context.drawImage(canvas, 0, 0);
    context.drawImage(overlay, 0, 0);
    whole.toBlob((blob) => save_file(blob!, `${this.shown_angles.replace(/[^A-Za-z0-9.]+/g, "-").toLowerCase()}.png`), "image/png");
  }

  private lose(event: Event): void {
    event.preventDefault();
    this.is_lost = true;
    notes.state("The graphics device is lost; the picture comes back with it.");
  }

  private restore(): void {
    try {
      this.picture.restore();
      this.is_lost = false;
      this.draw();
      this.show_picture(true);
      notes.state("");
      this.load_keys();
    } catch (error) {
      this.is_lost = true;
      this.show_picture(false);
      notes.state(`This is a still picture: ${(error as Error).message}.`);
    }
  }
}

async function open(): Promise<void> {
  notes.state("Opening the session …");
  const header = JSON.parse(element("session").textContent!) as Header, packed = element("data").textContent!.trim();
  element("data").remove(); // as long as the file: its memory is needed
  const worker = header.trainer && can_simulate() ? new TrainerWorker(element("simulation").textContent!.trim()) : null;
  element("simulation").remove();
  const begin = (trainer: Trainer) => worker!.begin(trainer, header.live?.modes ?? [], header.motion);
  const data = await session_of(header, packed, worker !== null, exercise_of(location.hash, header.trainer?.exercises?.length ?? 0), begin), first = first_state(data, Math.min(stage.clientWidth, stage.clientHeight));
  const modes = data.motion?.modes.map(({ name }) => name) ?? [], store = new Store(state_of(location.hash, first, modes), first, data);
  resize(); // later it would wait for the graphics device, which takes the map first
  const picture = Picture.on(canvas, data);
  if (!picture) return notes.state("This browser has no WebGL 2, so this is a still picture.");
  new Page(data, store, picture, worker);
  if (header.trainer && !data.trainer) notes.state(`This browser has no WebAssembly with vectors and exceptions, so nothing can be steered${data.run ? "; the run can be played" : ""}.`);
}

open().catch((error: Error) => notes.state(`This is a still picture: ${error.message}.`));
