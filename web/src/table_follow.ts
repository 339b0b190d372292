// The table follows the tip that is steered, so that it stays within the middle of live pictures.
import type { LiveMessage } from "./live_message";
import type { View } from "./view";

const kStill_mm = 0.5, kAbove = 0.25, kBelow = 0.12; // of the picture's height; most ways go up from an entry at its lower end

/** Height above the centre of the picture's middle, in mm: where it is, or as far beyond as the tip asks for. */
export function followed_mm(table_mm: number, centre_mm: number, { height, pixel_mm }: View, tip_mm: number): number {
  const seen_mm = height * pixel_mm, away_mm = tip_mm - centre_mm - table_mm;
  return table_mm + Math.max(0, away_mm - (0.5 - kAbove) * seen_mm) + Math.min(0, away_mm + (0.5 - kBelow) * seen_mm);
}

export class TableFollow {
  private last_mm = NaN;

  /** The height of the tip of the instrument in the hand where it has moved; else none. */
  moved_tip_mm({ instruments, held_hub }: Pick<LiveMessage, "instruments" | "held_hub">): number | null {
    const tip_mm = instruments[held_hub]?.parts_mm.at(-1)?.at(-1)?.[2];
    if (tip_mm === undefined || Math.abs(tip_mm - this.last_mm) < kStill_mm) return null;
    return (this.last_mm = tip_mm);
  }
}
