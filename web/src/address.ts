// The address says the view: #lao=30&cranial=10&zoom=1.5&table=20&look=fluoro&t=4.2&ui=0
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

/** `first`, but for what an address says. Fields that cannot be read are passed over. */
export function state_of(hash: string, first: State): State {
  const fields = new URLSearchParams(hash.replace(/^#/, "")), state = { ...first, camera: { ...first.camera } };
  state.camera.lao_deg = number_in(fields, "lao") ?? state.camera.lao_deg;
  state.camera.cranial_deg = number_in(fields, "cranial") ?? state.camera.cranial_deg;
  state.camera.zoom = number_in(fields, "zoom") ?? state.camera.zoom;
  state.camera.table_mm = number_in(fields, "table") ?? state.camera.table_mm;
  const look = fields.get("look");
  if (look === "fluoro" || look === "surface") state.look = look;
  state.time_s = number_in(fields, "t") ?? state.time_s;
  state.inverted = flag_in(fields, "inverted") ?? state.inverted;
  state.shows_vessels = flag_in(fields, "vessels") ?? state.shows_vessels;
  state.shows_road_map = flag_in(fields, "roadmap") ?? state.shows_road_map;
  state.is_bare = flag_in(fields, "ui") === false;
  const hidden = fields.get("hide");
  if (hidden !== null) state.hidden_layers = hidden.split(",").map((k) => Number(k) - 1).filter((k) => Number.isInteger(k) && k >= 0);
  const grey = fields.get("window")?.split(",").map(Number) ?? [];
  const [scale, dark, light] = grey;
  if (grey.length === 3 && scale! > 0 && dark! >= 0 && light! > dark! && light! <= 1)
    state.window = { scale: scale!, dark: dark!, light: light!, gamma: first.window?.gamma ?? 1, inverted: state.inverted };
  return state;
}

const short = (x: number, digits: number) => String(Number(x.toFixed(digits)));

/** The address of a state, without what is as it was first. */
export function hash_of(state: State, first: State): string {
  const { camera } = state, fields: string[] = [];
  const add = (name: string, value: string, is_new: boolean) => is_new && fields.push(`${name}=${value}`);
  fields.push(`lao=${short(camera.lao_deg, 2)}`);
  add("cranial", short(camera.cranial_deg, 2), camera.cranial_deg !== 0);
  add("zoom", short(camera.zoom, 3), camera.zoom !== 1);
  add("table", short(camera.table_mm, 1), camera.table_mm !== 0);
  add("look", state.look, state.look !== first.look);
  add("t", short(state.time_s, 2), state.time_s !== 0);
  add("inverted", state.inverted ? "1" : "0", state.inverted !== first.inverted);
  add("vessels", state.shows_vessels ? "1" : "0", state.shows_vessels !== first.shows_vessels);
  add("roadmap", state.shows_road_map ? "1" : "0", state.shows_road_map !== first.shows_road_map);
  add("hide", state.hidden_layers.map((k) => k + 1).join(","), state.hidden_layers.join() !== first.hidden_layers.join());
  if (state.window && state.window !== first.window)
    fields.push(`window=${short(state.window.scale, 4)},${short(state.window.dark, 4)},${short(state.window.light, 4)}`);
  if (state.is_bare) fields.push("ui=0");
  return `#${fields.join("&")}`;
}
