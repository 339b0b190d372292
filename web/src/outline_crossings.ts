// How a straight line, seen along the axis, crosses shells that follow an outline
// (host/xraycast/casting/outline_crossings.hpp).
import { clamp, lerp } from "./vectors";

const kTurn = 2 * Math.PI;
const kStep_rad = (kTurn * 3 / 360); // an outline bends so little in it that a line crosses a shell once, if at all

/** A line that is nearest to the axis at (x, y), given from there, and runs along a unit vector. */
export class OutlinedLine {
  private readonly offset_mm: number;
  private readonly foot_column: number;
  private readonly columns_per_rad: number;

  /** `scales`: of every column of the map, and the first again. */
  constructor(private readonly scales: Float64Array, x: number, y: number, dx: number, dy: number) {
    const width = scales.length - 1, per_rad = width / kTurn;
    this.offset_mm = Math.hypot(x, y);
    const is_left = dx * y - dy * x > 0;
    const nx = is_left ? -dy : dy, ny = is_left ? dx : -dx;
    this.foot_column = Math.atan2(nx, -ny) * per_rad - 0.5;
    this.columns_per_rad = dx * -ny + dy * nx > 0 ? per_rad : -per_rad;
  }

  /** The radius, as the map's shells have it, of a place on the line. */
  shell_radius_mm(along_mm: number): number {
    const width = this.scales.length - 1;
    const column = this.foot_column + this.columns_per_rad * Math.atan2(along_mm, this.offset_mm);
    const turned = column - width * Math.floor(column / width), left = Math.min(Math.floor(turned), width - 1);
    const scale = lerp(this.scales[left]!, this.scales[left + 1]!, turned - left);
    return Math.sqrt(along_mm * along_mm + this.offset_mm * this.offset_mm) / scale;
  }

  /** The places, in order, at which the line crosses shells of these ascending radii. */
  crossings_mm(radii_mm: readonly number[]): number[] {
    const found: number[] = [], offset = this.offset_mm, outermost = radii_mm[radii_mm.length - 1]!;
    if (outermost <= offset) return found;
    const end = outermost * (1 + 1e-7); // or rounding might leave out the last crossing
    const half_mm = Math.sqrt((end - offset) * (end + offset));
    const steps = Math.ceil(Math.atan2(half_mm, offset) / kStep_rad);
    const node_mm = (i: number) => (Math.abs(i) === steps ? Math.sign(i) * half_mm : offset * Math.tan(i * kStep_rad));
    let from = node_mm(-steps), at_from = this.shell_radius_mm(from);
    for (let i = 1 - steps; i <= steps; ++i) {
      const to = node_mm(i), at_to = this.shell_radius_mm(to);
      const first = first_above(radii_mm, Math.min(at_from, at_to)), last = first_above(radii_mm, Math.max(at_from, at_to));
      for (let n = first; n < last; ++n) {
        const radius = radii_mm[at_to > at_from ? n : first + last - 1 - n]!;
        found.push(this.place_mm(radius, from, at_from, to, at_to, outermost));
      }
      from = to;
      at_from = at_to;
    }
    return found;
  }

  /** The place between two others whose radius is wanted, which is nearly linear there. */
  private place_mm(radius: number, a: number, at_a: number, b: number, at_b: number, outermost: number): number {
    for (let i = 0; i < 3; ++i) {
      const middle = lerp(a, b, clamp((radius - at_a) / (at_b - at_a), 0, 1)), at_middle = this.shell_radius_mm(middle);
      if (Math.abs(at_middle - radius) < 1e-7 * outermost) return middle;
      if (at_middle < radius === at_a < radius) (a = middle), (at_a = at_middle);
      else (b = middle), (at_b = at_middle);
    }
    return lerp(a, b, clamp((radius - at_a) / (at_b - at_a), 0, 1));
  }
}

function first_above(sorted: readonly number[], value: number): number {
  let low = 0, high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle]! > value) high = middle;
    else low = middle + 1;
  }
  return low;
}
