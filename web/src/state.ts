// What the page shows, and who is told when that changes.
import { CArmPose, limited } from "./c_arm_pose";
import type { Look } from "./compositing";
import type { ExerciseHeader, SessionData } from "./data";
import { fullest_s, length_s, shown_time_s } from "./instrument_shape";
import type { GreyWindow } from "./grey_window";
import { Rhythm } from "./rhythm";
import { clamp } from "./vectors";
import type { Bounds } from "./view";

export interface State {
  pose: CArmPose;
  look: Look;
  window: GreyWindow | null; // none: automatic
  gamma: number;
  inverted: boolean;
  hidden_layers: readonly number[]; // from 0, the innermost
  shows_vessels: boolean;
  shows_road_map: boolean;
  time_s: number; // of the run
  phases: readonly number[]; // of the body's modes; none where it stands still
  is_paused: boolean; // the body, at these phases
  is_bare: boolean; // the picture alone
}

/** The way from the entry to all targets is seen, with room about it, where a wire is still seen in so large a field in a picture of `pixels` at its shorter side; or the way's beginning. */
function opening_pose(pose: CArmPose, { centre_mm, radius_mm, half_height_mm }: Bounds, { entry_mm, targets }: ExerciseHeader, pixels: number): CArmPose {
  const kRoom = 1.4, kSeen_mm = 0.6, places_mm = [entry_mm, ...targets.map(({ at_mm }) => at_mm)], heights_mm = places_mm.map(([, , z]) => z);
  const lowest_mm = Math.min(...heights_mm), highest_mm = Math.max(...heights_mm), aside_mm = Math.max(...places_mm.map(([x, y]) => Math.hypot(x - centre_mm[0], y - centre_mm[1])));
  const seen_mm = kRoom * Math.max(highest_mm - lowest_mm, 2 * aside_mm), whole_mm = 2 * Math.max(half_height_mm, radius_mm), zoom = whole_mm / seen_mm, least = whole_mm / Math.min(kSeen_mm * pixels, whole_mm / (0.8 * pose.zoom)), is_seen = zoom * kRoom > 1.1 * least;
  const entry_height_mm = entry_mm[2] - centre_mm[2], ahead_mm = (0.35 * whole_mm) / least;
  if (!is_seen) return { ...pose, zoom: least, table_mm: entry_height_mm - Math.sign(entry_height_mm) * ahead_mm };
  return { ...pose, zoom: Math.max(least, zoom), table_mm: 0.5 * (lowest_mm + highest_mm) - centre_mm[2] };
}

/** As the session was exported; an exercise opens where it takes place, in a picture of so many pixels at its shorter side. */
export function first_state({ header, map, run, motion, trainer }: SessionData, pixels: number): State {
  return {
    pose: trainer?.exercise ? opening_pose(header.pose, map.bounds, trainer.exercise, pixels) : header.pose,
    look: header.look,
    window: header.window && { ...header.window, ...header.greys },
    ...header.greys,
    hidden_layers: header.layer_weights.flatMap((weight, k) => (weight === 0 ? [k] : [])),
    shows_vessels: header.shows_vessels,
    shows_road_map: header.shows_road_map,
    time_s: run ? fullest_s(run) : 0,
    phases: motion ? new Rhythm(motion).phases_at(0) : [],
    is_paused: false,
    is_bare: false,
  };
}

/** Whether there is something that can be shaded. */
export const has_surfaces = ({ vessels, catheters, run, live }: SessionData): boolean => vessels !== null || catheters.length > 0 || run !== null || live !== null;

/** Within what the session has and the limits of the C-arm. */
export function allowed(state: State, data: SessionData): State {
  const time_s = data.run ? clamp(state.time_s, 0, length_s(data.run)) : 0;
  return {
    ...state,
    pose: limited(state.pose, data.map.bounds, data.header.viewer),
    look: has_surfaces(data) ? state.look : "fluoro",
    hidden_layers: [...new Set(state.hidden_layers)].filter((k) => k < data.map.layers).sort((a, b) => a - b),
    shows_vessels: data.vessels !== null && state.shows_vessels,
    shows_road_map: data.vessels !== null && state.shows_road_map,
    time_s, phases: data.run?.moves && data.motion ? new Rhythm(data.motion).phases_at(shown_time_s(data.run, time_s)) : state.phases,
  };
}

type Listener = (state: State, before: State) => void;

export class Store {
  private readonly listeners: Listener[] = [];
  private current: State;
  constructor(current: State, readonly first: State, private readonly data: SessionData) {
    this.current = allowed(current, data);
  }

  get state(): State {
    return this.current;
  }

  on_change(listener: Listener): void {
    this.listeners.push(listener);
  }

  update(change: Partial<State>): void {
    const before = this.current;
    this.current = allowed({ ...before, ...change }, this.data);
    for (const listener of this.listeners) listener(this.current, before);
  }
}
