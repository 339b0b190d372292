// The picture on its canvas: drawn coarsely while the C-arm moves, and fully once it rests.
import { CArmPose, view_of } from "./c_arm_pose";
import { Renderer, Style, kFull, kQuick } from "./compositing";
import type { DetectorImage, Fluoroscopy } from "./fluoroscopy";
import type { ComingReds } from "./gl";
import type { SessionData, Surface, TargetMark } from "./data";
import { InstrumentShapes } from "./instrument_shape";
import { GreyWindow, automatic_window } from "./grey_window";
import { MovingSurface } from "./moving_surface";
import type { Outline } from "./overlay";
import type { State } from "./state";
import { Bounds, View, magnification_of } from "./view";

const kPicturesPerWindow = 3; // of a motion
const kMostDetectorPixels = 420_000; // that a fluoroscope makes 15 pictures a second of
const kMostDetectorSide = 4 / 3; // of its shorter one: beside a body in a wider one there is air, and the exposure control would follow that
const kDetectorWindow = { scale: 1, dark: 0, light: 1 }; // as the fluoroscope shows it

export class Picture {
  private renderer: Renderer;
  private readonly run: InstrumentShapes | null;
  private readonly moving_vessels: MovingSurface | null;
  private readonly vessels: Surface | null;
  private weights_key = "";
  private window_key = "";
  private since_coarse = 0; // pictures of a motion
  private shown_image: { image: DetectorImage; key: string } | null = null; // that the canvas shows
  private coming_tau: ComingReds | null = null; // for the window of a motion
  private coming_key = ""; // of the picture that it is of
  private automatic: GreyWindow = { scale: 1, dark: 0, light: 1, gamma: 1, inverted: false };
  /** Instruments and contrast agent of a live session, as they are now. */
  live: readonly Surface[] = [];
  /** Where the C-arm stood when the picture was taken that is held; null: the picture follows the C-arm. */
  held_pose: CArmPose | null = null;
  /** Of a page that has one. */
  fluoroscopy: Fluoroscopy | null = null;
  /** What is to be reached next, where that is shown. */
  target: TargetMark | null = null;
  /** The grey window that was drawn last. */
  window: GreyWindow = this.automatic;

  private constructor(private readonly gl: WebGL2RenderingContext, private readonly data: SessionData) {
    this.renderer = this.new_renderer();
    this.run = data.run && new InstrumentShapes(data.run);
    const lattice = data.motion?.lattice;
    this.moving_vessels = data.vessels && lattice ? new MovingSurface(data.vessels, lattice) : null;
    this.vessels = this.moving_vessels?.surface ?? data.vessels;
  }

  private new_renderer(): Renderer {
    return new Renderer(this.gl, this.data.map, this.data.motion?.keys ?? this.data.tau);
  }

  /** None where the browser has no WebGL 2. Throws where it cannot draw into textures of floats. */
  static on(canvas: HTMLCanvasElement, data: SessionData): Picture | null {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, preserveDrawingBuffer: true });
    return gl && new Picture(gl, data);
  }

  /** After a lost context has come back. */
  restore(): void {
    this.renderer = this.new_renderer();
    this.weights_key = this.window_key = "";
    this.coming_tau = this.shown_image = null;
  }

  /** Key maps of the body's motion that are still to be loaded; until then it stands still. */
  get keys_left(): number {
    return this.renderer.keys_left;
  }

  add_key(): void {
    this.renderer.add_key();
  }

  view(state: State): View {
    const { drawingBufferWidth: width, drawingBufferHeight: height } = this.gl;
    const fit = state.is_bare && !this.data.header.is_of_session ? "tilted" : "untilted";
    return view_of(this.held_pose ?? state.pose, this.data.header.cone, this.data.map.bounds, width, height, fit);
  }

  get bounds(): Bounds {
    return this.data.map.bounds;
  }

  /** Width and height at the isocentre. */
  field_mm(state: State): readonly [number, number] {
    const view = this.view(state), at_axis_mm = view.pixel_mm / magnification_of(view);
    return [Math.min(view.width, kMostDetectorSide * view.height) * at_axis_mm, Math.min(view.height, kMostDetectorSide * view.width) * at_axis_mm];
  }

  /** Whether the road map is in the picture already. In pictures of a motion the body may be drawn coarsely. */
  draw(state: State, is_moving: boolean, is_coarse = is_moving): boolean {
    this.set_weights(state);
    this.set_phases(state);
    const view = this.view(state), still = this.still_surfaces(state);
    const style: Style = {
      look: state.look, window: this.automatic, full_contrast: this.data.header.full_contrast,
      detail: is_coarse ? kQuick : kFull, is_moving, outline_colour: this.data.header.viewer.road_map_colour,
      outlined: is_moving && state.shows_road_map ? this.vessels : null,
    };
    if (this.fluoroscopy?.is_due) this.begin_pulse(this.fluoroscopy, view, [...still, ...this.live], { ...style, look: "fluoro" }, state.phases);
    const image = state.look === "fluoro" ? this.fluoroscopy?.image : null;
    if (image) return this.draw_image(image, view, style, state);
    this.shown_image = null;
    this.window = style.window = { ...(state.window ?? this.automatic_window(view, still, style, state, is_moving)), gamma: state.gamma, inverted: state.inverted };
    const surfaces = [...still, ...(this.run ? this.run.at(state.time_s) : this.live)].filter((surface) => state.look === "fluoro" || !surface.weights);
    this.renderer.draw(view, surfaces, style);
    return style.outlined !== null && this.renderer.adds_up(surfaces, style);
  }

  /** The rays of a pulse, of the picture's view in no more pixels than the detector has. */
  private begin_pulse(fluoroscopy: Fluoroscopy, view: View, surfaces: readonly Surface[], style: Style, phases: readonly number[]): void {
    const seen = { width: Math.min(view.width, kMostDetectorSide * view.height), height: Math.min(view.height, kMostDetectorSide * view.width) };
    const scale = Math.min(1, Math.sqrt(kMostDetectorPixels / (seen.width * seen.height))), size = (pixels: number) => Math.max(1, Math.round(scale * pixels));
    const on_detector = { ...view, width: size(seen.width), height: size(seen.height), pixel_mm: view.pixel_mm / scale };
    fluoroscopy.begin_pulse(this.renderer.rays_later(on_detector, surfaces, style), on_detector, style.outlined !== null && this.renderer.adds_up(surfaces, style), phases);
  }

  private draw_image(image: DetectorImage, view: View, style: Style, state: State): boolean {
    this.window = style.window = { ...(state.window ?? kDetectorWindow), gamma: state.gamma, inverted: state.inverted };
    const has_outline = image.has_outline && state.shows_road_map && style.is_moving, key = JSON.stringify([view, this.window, has_outline]);
    if (this.shown_image?.image !== image || this.shown_image.key !== key) this.renderer.draw_image(image, has_outline, view, style);
    this.shown_image = { image, key };
    return style.is_moving;
  }

  /** Where the vessels alone are, for the road map. */
  road_map(view: View): Outline | null {
    const covered = this.vessels && this.renderer.covered_by(view, this.vessels);
    return covered && { covered, colour: this.data.header.viewer.road_map_colour };
  }

  private set_phases({ phases }: State): void {
    const shown = this.keys_left > 0 ? phases.map(() => 0) : phases;
    this.renderer.set_phases(shown);
    this.moving_vessels?.move(shown);
  }

  private set_weights(state: State): void {
    const { header, map } = this.data, key = `hidden: ${state.hidden_layers.join()}`;
    if (key === this.weights_key) return;
    this.weights_key = key;
    const weights = Array.from({ length: map.layers }, (_, k) => (state.hidden_layers.includes(k) ? 0 : header.layer_weights[k] || 1));
    this.renderer.set_weights(weights);
    this.window_key = "";
  }

  /** Vessels, and catheters that do not move. */
  private still_surfaces(state: State): Surface[] {
    const surfaces: Surface[] = [];
    if (this.vessels && state.shows_vessels) surfaces.push(this.vessels);
    return [...surfaces, ...this.data.catheters];
  }

  /** Of what a page that steers shows before there are X-rays the air beside the body takes no greys. */
  private window_of(tau: Float32Array): GreyWindow {
    return automatic_window(tau, this.data.trainer !== null);
  }

  private automatic_window(view: View, surfaces: readonly Surface[], style: Style, state: State, is_moving: boolean): GreyWindow {
    // Of a body that moves it stays, as an exposure that is held; a picture of one instant alone has its own.
    const key = JSON.stringify([view, style.look, state.shows_vessels, state.is_bare ? [state.phases, this.keys_left > 0] : []]);
    if (key === this.window_key) return this.automatic;
    if (!is_moving) {
      this.window_key = key;
      this.coming_tau?.drop();
      this.coming_tau = null;
      return (this.automatic = this.window_of(this.renderer.coarse_tau(view, surfaces, style)));
    }
    // In motion the window follows some pictures behind, so that none waits for the graphics device.
    const tau = this.coming_tau?.take();
    if (tau) {
      this.automatic = this.window_of(tau);
      this.coming_tau = null;
      if (key === this.coming_key) this.window_key = key; // the body alone moves
    }
    if (++this.since_coarse >= kPicturesPerWindow && !this.coming_tau) {
      this.coming_tau = this.renderer.coarse_tau_later(view, surfaces, style);
      this.coming_key = key;
      this.since_coarse = 0;
    }
    return this.automatic;
  }
}
