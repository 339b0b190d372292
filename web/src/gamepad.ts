// A gamepad that steers, as in the viewer's window: the left stick pushes, pulls and turns, A is the pedal, B injects; X holds the
// next hub, Y locks or releases the valve.
import type { Held, SteeringAction } from "./steering";

const kDeadZone = 0.15, kPoll_ms = 16;

const beyond_dead_zone = (value: number): number => (Math.abs(value) <= kDeadZone ? 0 : (value - Math.sign(value) * kDeadZone) / (1 - kDeadZone));

/** What is held on it; its sticks grow downwards and to the right. */
export const held_on = ({ axes, buttons }: Pick<Gamepad, "axes" | "buttons">): Omit<Held, "slow"> => ({
  push: 0 - beyond_dead_zone(axes[1] ?? 0), turn: beyond_dead_zone(axes[0] ?? 0), pedal: buttons[0]?.pressed ?? false, inject: buttons[1]?.pressed ?? false,
});

const kNothing: Omit<Held, "slow"> = { push: 0, turn: 0, pedal: false, inject: false };
const kActions: readonly [button: number, SteeringAction][] = [[2, "next_hub"], [3, "valve"]];

export class PadHand {
  held = kNothing;
  private readonly pressed = new Set<number>();
  private timer: ReturnType<typeof setInterval> | undefined;

  constructor(private readonly changed: () => void, private readonly act: (action: SteeringAction) => void) {
    addEventListener("gamepadconnected", () => (this.timer ??= setInterval(() => this.poll(), kPoll_ms)));
  }

  let_go(): void {
    this.held = kNothing;
  }

  private poll(): void {
    const pad = navigator.getGamepads().find((pad) => pad?.connected && pad.mapping === "standard");
    const now = pad && !document.hidden ? held_on(pad) : kNothing, before = this.held;
    for (const [button, action] of kActions) {
      const is_down = pad?.buttons[button]?.pressed ?? false;
      if (is_down && !this.pressed.has(button)) this.act(action);
      if (is_down) this.pressed.add(button);
      else this.pressed.delete(button);
    }
    this.held = now;
    if ((Object.keys(now) as (keyof typeof now)[]).some((name) => now[name] !== before[name])) this.changed();
  }
}
