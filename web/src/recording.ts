// The hubs' way since the page was opened or an instrument was exchanged, as a script that `xraycast simulate` takes.
import type { LiveMessage } from "./live_message";

const kMostRows = 600_000; // of ten minutes in motion at a step a millisecond; the first ones go
const kDegrees = 180 / Math.PI;

/** Rows of a time in s and, of each hub, an insertion in mm and a rotation in degrees. */
export class Recording {
  private numbers: number[] = [];

  constructor(private readonly hubs: number) {}

  private get width(): number {
    return 1 + 2 * this.hubs;
  }

  /** Of a session whose server tells of some steps alone. */
  add({ time_s, instruments }: Pick<LiveMessage, "time_s" | "instruments">): void {
    this.add_row([time_s, ...instruments.flatMap(({ insertion_mm, rotation_deg }) => [insertion_mm, rotation_deg])]);
  }

  /** Of each step, with rotations in rad. */
  add_steps(steps: Float64Array): void {
    const { width } = this;
    for (let at = 0; at + width <= steps.length; at += width) this.add_row(Array.from(steps.subarray(at, at + width), (value, i) => (i > 0 && i % 2 === 0 ? value * kDegrees : value)));
  }

  clear(): void {
    this.numbers = [];
  }

  csv(): string {
    const { numbers, width } = this, from_s = numbers[0] ?? 0, lines: string[] = [];
    const columns = Array.from({ length: this.hubs }, (_, d) => (d === 0 ? "insertion_mm,rotation_deg" : `insertion_${d + 1}_mm,rotation_${d + 1}_deg`));
    for (let at = 0; at < numbers.length; at += width) lines.push(`${(numbers[at]! - from_s).toFixed(4)},${numbers.slice(at + 1, at + width).join()}\n`);
    return `${["time_s", ...columns].join()}\n${lines.join("")}`;
  }

  private add_row(row: number[]): void {
    const { numbers, width } = this, last = numbers.length - width;
    if (last >= 0 && !(row[0]! > numbers[last]!)) return;
    // Of a rest the beginning and the end are enough.
    const is_as = (at: number) => at >= 0 && row.every((value, i) => i === 0 || value === numbers[at + i]);
    if (is_as(last) && is_as(last - width)) numbers.length = last;
    numbers.push(...row);
    if (numbers.length > kMostRows * width) this.numbers = numbers.slice(numbers.length / 10 - ((numbers.length / 10) % width));
  }
}
