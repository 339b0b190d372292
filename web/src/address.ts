// The address says the view: #lao=30&cranial=10&zoom=1.5&table=20&look=fluoro&t=4.2&ui=0
import type { GreyWindow } from "./grey_window";
import type { State } from "./state";

/** The number of a field, if it is one. */
function number_in(fields: URLSearchParams, name: string): number | undefined {
  const text = fields.get(name), value = Number(text);
  return text === null || text.trim() === "" || !Number.isFinite(value) ? undefined : value;
}

function flag_in(fields: URLSearchParams, name: string): boolean | undefined {
  const value = number_in(fields, name);
  return value === undefined ? undefined : value !== 0;
}

/** `auto`, or scale, dark and light; `otherwise` where it is neither. */
function window_in(text: string | null, first: State, otherwise: GreyWindow | null): GreyWindow | null {
  if (text === "auto") return null;
  const [scale = NaN, dark = NaN, light = NaN, ...more] = text?.split(",").map(Number) ?? [];
  const is_window = Number.isFinite(scale) && scale > 0 && dark >= 0 && light > dark && light <= 1 && more.length === 0;
  return is_window ? { scale, dark, light, gamma: first.gamma, inverted: first.inverted } : otherwise;
}

/** `breath:0.3,heart:0.8`: those of the modes' phases that are named, 0 to 1; the others are 0. None where nothing is named. */
function phases_in(text: string | null, modes: readonly string[]): number[] | null {
  const named = new Map((text ?? "").split(",").map((word) => word.split(":")).map(([name, phase]) => [name ?? "", Number(phase)]));
  const phases = modes.map((name) => named.get(name) ?? 0);
  return modes.some((name) => named.has(name)) && phases.every((phase) => phase >= 0 && phase <= 1) ? phases : null;
}

/** `first`, but for what an address says. Fields that cannot be read are passed over. */
export function state_of(hash: string, first: State, modes: readonly string[] = []): State {
  const fields = new URLSearchParams(hash.replace(/^#/, "")), state = { ...first, pose: { ...first.pose } };
  state.pose.lao_deg = number_in(fields, "lao") ?? state.pose.lao_deg;
  state.pose.cranial_deg = number_in(fields, "cranial") ?? state.pose.cranial_deg;
  state.pose.zoom = number_in(fields, "zoom") ?? state.pose.zoom;
  state.pose.table_mm = number_in(fields, "table") ?? state.pose.table_mm;
  state.pose.left_mm = number_in(fields, "left") ?? state.pose.left_mm;
  state.pose.back_mm = number_in(fields, "back") ?? state.pose.back_mm;
  const look = fields.get("look");
  if (look === "fluoro" || look === "surface") state.look = look;
  state.time_s = number_in(fields, "t") ?? state.time_s;
  state.inverted = flag_in(fields, "inverted") ?? state.inverted;
  state.shows_vessels = flag_in(fields, "vessels") ?? state.shows_vessels;
  state.shows_road_map = flag_in(fields, "roadmap") ?? state.shows_road_map;
  state.is_bare = flag_in(fields, "ui") === false;
  const phases = phases_in(fields.get("phase"), modes);
  if (phases) Object.assign(state, { phases, is_paused: true });
  const hidden = fields.get("hide");
  if (hidden !== null) state.hidden_layers = hidden.split(",").map((k) => Number(k) - 1).filter((k) => Number.isInteger(k) && k >= 0);
  state.window = window_in(fields.get("window"), first, state.window);
  return state;
}

/** The number of an exercise, of so many; 0: none. The first where the address has none. */
export function exercise_of(hash: string, count: number): number {
  const number = number_in(new URLSearchParams(hash.replace(/^#/, "")), "exercise") ?? 1;
  return Number.isInteger(number) && number >= 0 && number <= count ? number : Math.min(1, count);
}

/** The address with another exercise. */
export function hash_with_exercise(hash: string, exercise: number): string {
  const fields = new URLSearchParams(hash.replace(/^#/, ""));
  fields.set("exercise", String(exercise));
  return `#${fields}`;
}

const short = (x: number, digits: number) => String(Number(x.toFixed(digits)));
const precise = (x: number) => String(Number(x.toPrecision(6)));

const window_text = (window: GreyWindow | null) => (window ? [window.scale, window.dark, window.light].map(precise).join() : "auto");

/** A time that is not before `time_s`, where a picture begins. */
const time_text = (time_s: number) => short(Math.ceil(1000 * time_s - 1e-6) / 1000, 3);

/** The address of a state, without what is as it was first. */
export function hash_of(state: State, first: State, modes: readonly string[] = []): string {
  const fields: string[] = [];
  const add = (name: string, text_of: (state: State) => string) => text_of(state) !== text_of(first) && fields.push(`${name}=${text_of(state)}`);
  fields.push(`lao=${short(state.pose.lao_deg, 2)}`);
  add("cranial", ({ pose }) => short(pose.cranial_deg, 2));
  add("zoom", ({ pose }) => short(pose.zoom, 3));
  add("table", ({ pose }) => short(pose.table_mm, 1));
  add("left", ({ pose }) => short(pose.left_mm, 1));
  add("back", ({ pose }) => short(pose.back_mm, 1));
  add("look", ({ look }) => look);
  add("t", ({ time_s }) => time_text(time_s));
  add("inverted", ({ inverted }) => (inverted ? "1" : "0"));
  add("vessels", ({ shows_vessels }) => (shows_vessels ? "1" : "0"));
  add("roadmap", ({ shows_road_map }) => (shows_road_map ? "1" : "0"));
  add("hide", ({ hidden_layers }) => hidden_layers.map((k) => k + 1).join());
  add("window", ({ window }) => window_text(window));
  if (state.is_paused) fields.push(`phase=${modes.map((name, m) => `${name}:${short(state.phases[m] ?? 0, 4)}`).join()}`);
  if (state.is_bare) fields.push("ui=0");
  return `#${fields.join("&")}`;
}
