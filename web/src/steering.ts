// Steering the instruments of a live session: keys as in the viewer's window, buttons for fingers, and a gamepad.
import { PadHand } from "./gamepad";
import { clamp } from "./vectors";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

/** What is held down. */
export interface Held {
  push: number; // -1 to 1
  turn: number;
  slow: boolean;
  pedal: boolean;
  inject: boolean;
}

/** What is done once. */
export type SteeringAction = "next_hub" | "valve";

type Control = "push" | "pull" | "left" | "right" | "slow" | "pedal" | "inject";

const kKeys: Record<string, Control> = {
  ArrowUp: "push", ArrowDown: "pull", ArrowLeft: "left", ArrowRight: "right", Shift: "slow", x: "pedal", i: "inject",
};
const kHubs: readonly Control[] = ["push", "pull", "left", "right", "slow"];
const kButtons: Record<string, Control> = { push: "push", pull: "pull", "turn-left": "left", "turn-right": "right", inject: "inject" };
const kSwitches: Record<string, Control> = { slow: "slow", pedal: "pedal" }; // so that one finger is enough

export const held_of = (holds: ReadonlySet<Control>): Held => ({
  push: Number(holds.has("push")) - Number(holds.has("pull")), turn: Number(holds.has("right")) - Number(holds.has("left")),
  slow: holds.has("slow"), pedal: holds.has("pedal"), inject: holds.has("inject"),
});

export class Steering {
  /** Whether this page steers; otherwise keys are what they are without it. */
  steers = false;
  private readonly keys = new Set<Control>();
  private readonly fingers = new Set<Control>();
  private readonly switches = new Set<Control>();
  private readonly pad: PadHand;

  constructor(private readonly stage: HTMLElement, private readonly has_hub: boolean, private readonly has_valve: boolean,
    private readonly changed: () => void, private readonly act: (action: SteeringAction) => void) {
    this.pad = new PadHand(() => this.steers && this.changed(), (action) => this.steers && this.has_valve && this.act(action));
    document.addEventListener("keydown", (event) => this.press(event), { capture: true });
    document.addEventListener("keyup", (event) => this.release(event), { capture: true });
    addEventListener("blur", () => this.let_go());
    document.addEventListener("visibilitychange", () => document.hidden && this.let_go());
    for (const [id, hold] of Object.entries(kButtons)) this.hold_by_finger(element(id), hold);
    for (const [id, hold] of Object.entries(kSwitches)) this.switch_by_finger(element(id), hold);
    element("next-hub").addEventListener("click", () => this.act("next_hub"));
    element("valve").addEventListener("click", () => this.act("valve"));
    element("hub-buttons").hidden = !has_hub;
    for (const id of ["next-hub", "valve"]) element(id).hidden = !has_valve;
  }

  get held(): Held {
    const hand = held_of(new Set([...this.keys, ...this.fingers, ...this.switches])), { pad } = this;
    return {
      ...hand, push: clamp(hand.push + pad.held.push, -1, 1), turn: clamp(hand.turn + pad.held.turn, -1, 1),
      pedal: hand.pedal || pad.held.pedal, inject: hand.inject || pad.held.inject,
    };
  }

  let_go(): void {
    for (const holds of [this.keys, this.fingers, this.switches]) holds.clear();
    this.pad.let_go();
    for (const id of Object.keys(kSwitches)) element(id).setAttribute("aria-pressed", "false");
    this.changed();
  }

  private press(event: KeyboardEvent): void {
    if (!this.takes(event)) return;
    const action = this.action_of(event), hold = kKeys[event.key] ?? kKeys[event.key.toLowerCase()];
    if (action) {
      if (!event.repeat) this.act(action);
    } else if (hold && (this.has_hub || !kHubs.includes(hold))) {
      if (!event.repeat) {
        this.keys.add(hold);
        this.changed();
      }
      if (hold === "slow") return; // Shift belongs to others too
    } else {
      return;
    }
    event.preventDefault();
    event.stopImmediatePropagation();
  }

  private release(event: KeyboardEvent): void {
    const hold = kKeys[event.key] ?? kKeys[event.key.toLowerCase()];
    if (hold && this.keys.delete(hold)) this.changed();
  }

  private takes(event: KeyboardEvent): boolean {
    const target = event.target as HTMLElement, page = document.documentElement;
    if (!this.steers || event.ctrlKey || event.metaKey || event.altKey || target.matches("input, select")) return false;
    const is_on_picture = this.stage.contains(target) || target === document.body;
    return is_on_picture || !(event.key.startsWith("Arrow") && page.scrollHeight > page.clientHeight);
  }

  /** Tab goes on through the page, unless the picture has the focus. */
  private action_of(event: KeyboardEvent): SteeringAction | null {
    if (!this.has_valve) return null;
    if (event.key === "Tab") return document.activeElement === this.stage && !event.shiftKey ? "next_hub" : null;
    return event.key.toLowerCase() === "v" ? "valve" : null;
  }

  private hold_by_finger(button: HTMLElement, hold: Control): void {
    const change = (is_down: boolean) => {
      if (is_down === this.fingers.has(hold)) return;
      if (is_down) this.fingers.add(hold);
      else this.fingers.delete(hold);
      this.changed();
    };
    button.addEventListener("pointerdown", (event) => {
      button.setPointerCapture(event.pointerId);
      change(true);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) button.addEventListener(end, () => change(false));
    // Buttons are pressed by keys too.
    const is_click = ({ key }: KeyboardEvent) => key === "Enter" || key === " ";
    button.addEventListener("keydown", (event) => is_click(event) && change(true));
    button.addEventListener("keyup", (event) => is_click(event) && change(false));
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  /** By a finger that is lifted, as others that are down make no click of it. */
  private switch_by_finger(button: HTMLElement, hold: Control): void {
    const change = () => {
      if (!this.switches.delete(hold)) this.switches.add(hold);
      button.setAttribute("aria-pressed", String(this.switches.has(hold)));
      this.changed();
    };
    button.addEventListener("pointerup", (event) => {
      if (event.button === 0 && button.contains(document.elementFromPoint(event.clientX, event.clientY))) change();
    });
    button.addEventListener("click", (event) => event.detail === 0 && change()); // by a key
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }
}
