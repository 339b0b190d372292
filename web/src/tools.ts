// The buttons under the picture.
import type { SessionData } from "./data";
import type { Actions, PictureControls } from "./picture_controls";
import { State, Store, has_surfaces } from "./state";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

/** Buttons that are pressed or not, by a field of the state. */
const kToggles: readonly { id: string; is_pressed(state: State): boolean; change(state: State): Partial<State> }[] = [
  { id: "surface", is_pressed: (s) => s.look === "surface", change: (s) => ({ look: s.look === "fluoro" ? "surface" : "fluoro" }) },
  { id: "inverted", is_pressed: (s) => s.inverted, change: (s) => ({ inverted: !s.inverted }) },
  { id: "vessels", is_pressed: (s) => s.shows_vessels, change: (s) => ({ shows_vessels: !s.shows_vessels }) },
  { id: "road-map", is_pressed: (s) => s.shows_road_map, change: (s) => ({ shows_road_map: !s.shows_road_map }) },
  { id: "auto-window", is_pressed: (s) => s.window === null, change: () => ({ window: null }) },
];

export class Tools {
  private readonly layers: HTMLInputElement[] = [];

  constructor(private readonly data: SessionData, store: Store, controls: PictureControls, actions: Actions) {
    element("tools").hidden = false;
    for (const { name, lao_deg } of data.header.viewer.presets)
      this.add_preset(name, () => store.update({ pose: { ...store.state.pose, lao_deg, cranial_deg: 0 } }));
    const page_mm = 0.1 * data.map.bounds.half_height_mm;
    const clicks: Record<string, () => void> = {
      "zoom-in": () => controls.zoom(1.2), "zoom-out": () => controls.zoom(1 / 1.2), "table-up": () => controls.travel(page_mm),
      "table-down": () => controls.travel(-page_mm), reset: actions.reset, copy: actions.copy_link, save: actions.save_picture,
    };
    for (const [id, click] of Object.entries(clicks)) element(id).addEventListener("click", click);
    for (const { id, change } of kToggles) element(id).addEventListener("click", () => store.update(change(store.state)));
    for (const id of ["vessels", "road-map"]) element(id).hidden = !data.vessels;
    element("surface").hidden = !has_surfaces(data);
    for (let k = 0; k < data.map.layers; ++k) this.add_layer(k, actions);
    this.show(store.state);
  }

  show(state: State): void {
    for (const { id, is_pressed } of kToggles) element(id).setAttribute("aria-pressed", String(is_pressed(state)));
    this.layers.forEach((layer, k) => (layer.checked = !state.hidden_layers.includes(k)));
  }

  private add_preset(name: string, click: () => void): void {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = name;
    button.addEventListener("click", click);
    element("presets").append(button);
  }

  private add_layer(k: number, actions: Actions): void {
    const label = document.createElement("label"), layer = document.createElement("input");
    const share = (radius_mm: number) => Math.round((100 * radius_mm) / this.data.map.radii_mm[this.data.map.layers]!);
    layer.type = "checkbox";
    layer.addEventListener("change", () => actions.toggle_layer(k));
    label.title = `${share(this.data.map.radii_mm[k]!)} to ${share(this.data.map.radii_mm[k + 1]!)} % of the way to the skin`;
    label.append(layer, String(k + 1));
    element("layers").append(label);
    this.layers.push(layer);
  }
}
