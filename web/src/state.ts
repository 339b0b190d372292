// What the page shows, and who is told when that changes.
import type { Camera } from "./camera";
import type { Look } from "./compositing";
import type { SessionData } from "./data";
import type { GreyWindow } from "./grey_window";

export interface State {
  camera: Camera;
  look: Look;
  window: GreyWindow | null; // none: automatic
  inverted: boolean;
  hidden_layers: readonly number[]; // from 0, the innermost
  shows_vessels: boolean;
  shows_road_map: boolean;
  time_s: number; // of the run
  is_bare: boolean; // the picture alone
}

/** As the session was exported. */
export function first_state({ header, vessels, run }: SessionData): State {
  return {
    camera: header.camera,
    look: header.look,
    window: header.window,
    inverted: header.window?.inverted ?? false,
    hidden_layers: header.layer_weights.flatMap((weight, k) => (weight === 0 ? [k] : [])),
    // Over a run the vessels are outlined, as in the operating room; otherwise they hold contrast agent.
    shows_vessels: vessels !== null && run === null,
    shows_road_map: vessels !== null && run !== null,
    time_s: 0,
    is_bare: false,
  };
}

type Listener = (state: State, before: State) => void;

export class Store {
  private readonly listeners: Listener[] = [];
  constructor(private current: State, readonly first: State = current) {}

  get state(): State {
    return this.current;
  }

  on_change(listener: Listener): void {
    this.listeners.push(listener);
  }

  update(change: Partial<State>): void {
    const before = this.current;
    this.current = { ...before, ...change };
    for (const listener of this.listeners) listener(this.current, before);
  }
}
