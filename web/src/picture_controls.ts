// Mouse, touch, wheel and keys on the picture move the C-arm, the table and the grey window.
import { dragged } from "./grey_window";
import type { Picture } from "./picture";
import type { Store } from "./state";
import { Bounds, right_of } from "./view";

const kDegreesPerPixel = 0.4;

export interface Actions {
  toggle_layer(k: number): void;
  reset(): void;
  copy_link(): void;
  save_picture(): void;
  play(): void;
  step(pictures: number): void;
  hold(mode: string): void;
  gate(): void;
  help(): void;
}

export class PictureControls {
  private readonly fingers = new Map<number, PointerEvent>();

  constructor(
    private readonly stage: HTMLElement, private readonly store: Store, private readonly picture: Picture,
    private readonly bounds: Bounds, private readonly actions: Actions,
  ) {
    stage.addEventListener("pointerdown", (event) => this.press(event));
    stage.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"] as const) stage.addEventListener(end, (event) => this.fingers.delete(event.pointerId));
    stage.addEventListener("contextmenu", (event) => event.preventDefault());
    stage.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    document.addEventListener("keydown", (event) => this.key(event));
  }

  turn(lao_deg: number, cranial_deg: number): void {
    const { pose } = this.store.state;
    this.move_pose({ lao_deg: pose.lao_deg + lao_deg, cranial_deg: pose.cranial_deg + cranial_deg });
  }

  zoom(times: number): void {
    this.move_pose({ zoom: this.store.state.pose.zoom * times });
  }

  travel(mm: number): void {
    this.move_pose({ table_mm: this.store.state.pose.table_mm + mm });
  }

  private move_pose(change: Partial<Store["state"]["pose"]>): void {
    this.store.update({ pose: { ...this.store.state.pose, ...change } });
  }

  private press(event: PointerEvent): void {
    this.stage.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, event);
    this.stage.focus({ preventScroll: true });
    event.preventDefault();
  }

  private move(event: PointerEvent): void {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const others = [...this.fingers.values()].filter((finger) => finger.pointerId !== event.pointerId);
    this.fingers.set(event.pointerId, event);
    const across = event.clientX - before.clientX, down = event.clientY - before.clientY;
    if (others.length >= 2) this.pan(across / (others.length + 1), down / (others.length + 1));
    else if (others.length === 1) this.pinch(before, event, others[0]!, across, down);
    else if (event.buttons & 2) this.change_window(across, down);
    else if (event.buttons & 4 || event.shiftKey) this.pan(across, down);
    else this.turn(-kDegreesPerPixel * across, kDegreesPerPixel * down);
  }

  /** The table goes with the pointer, in the picture's plane. */
  private pan(across: number, down: number): void {
    const view = this.picture.view(this.store.state), { pose } = this.store.state, [right_x, right_y] = right_of(view);
    const mm = (view.height * view.pixel_mm) / Math.max(1, this.stage.clientHeight);
    this.move_pose({ table_mm: pose.table_mm + mm * down, left_mm: pose.left_mm - mm * across * right_x, back_mm: pose.back_mm - mm * across * right_y });
  }

  /** Two fingers zoom by their distance and change the window by their middle. */
  private pinch(before: PointerEvent, now: PointerEvent, other: PointerEvent, across: number, down: number): void {
    const distance = (finger: PointerEvent) => Math.hypot(finger.clientX - other.clientX, finger.clientY - other.clientY);
    const change = distance(now) / Math.max(1, distance(before));
    const along = Math.abs(distance(now) - distance(before)), moved = Math.hypot(across, down);
    if (along > 0.5 * moved) this.zoom(change);
    else this.change_window(0.5 * across, 0.5 * down);
  }

  private change_window(across: number, down: number): void {
    this.store.update({ window: dragged(this.store.state.window ?? this.picture.window, across, down) });
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const notches = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY / 100 : event.deltaY / 3;
    this.zoom(1.1 ** -notches);
  }

  private key(event: KeyboardEvent): void {
    const target = event.target as HTMLElement;
    if (event.ctrlKey || event.metaKey || event.altKey || target.matches("input, select")) return;
    if (event.key === " " && target.matches("button, summary")) return;
    const is_on_picture = this.stage.contains(target) || target === document.body, page = document.documentElement;
    const scrolls = page.scrollHeight > page.clientHeight && /^(Arrow|Page)/.test(event.key);
    if (scrolls && !is_on_picture) return;
    const { state } = this.store, degrees = event.shiftKey ? 1 : 5, page_mm = 0.1 * this.bounds.half_height_mm;
    const keys: Record<string, () => void> = {
      ArrowLeft: () => this.turn(degrees, 0), ArrowRight: () => this.turn(-degrees, 0),
      ArrowUp: () => this.turn(0, degrees), ArrowDown: () => this.turn(0, -degrees),
      PageUp: () => this.travel(page_mm), PageDown: () => this.travel(-page_mm),
      "+": () => this.zoom(1.1), "=": () => this.zoom(1.1), "-": () => this.zoom(1 / 1.1),
      f: () => this.store.update({ look: state.look === "fluoro" ? "surface" : "fluoro" }),
      i: () => this.store.update({ inverted: !state.inverted }),
      v: () => this.store.update({ shows_vessels: !state.shows_vessels }),
      m: () => this.store.update({ shows_road_map: !state.shows_road_map }),
      w: () => this.store.update({ window: null }),
      r: () => this.actions.reset(), l: () => this.actions.copy_link(), p: () => this.actions.save_picture(),
      " ": () => this.actions.play(), ",": () => this.actions.step(-1), ".": () => this.actions.step(1),
      b: () => this.actions.hold("breath"), k: () => this.actions.hold("heart"), g: () => this.actions.gate(),
      h: () => this.actions.help(), "?": () => this.actions.help(),
    };
    const digit = "123456789".indexOf(event.key);
    const action = event.key.length > 0 && digit >= 0 ? () => this.actions.toggle_layer(digit) : keys[event.key] ?? keys[event.key.toLowerCase()];
    if (!action) return;
    event.preventDefault();
    action();
  }
}
