// The hubs' way since the page was opened or an instrument was exchanged, as a script that `xraycast simulate` takes.
import type { LiveMessage } from "./live_message";

const kMostRows = 600_000; // of ten minutes in motion at a step a millisecond; the first ones go
const kDegrees = 180 / Math.PI;

const kColumns = ["insertion_mm", "rotation_deg", "inflation_bar", "release_mm", "detach"] as const, kRotation = 1, kDetach = 4;
const column_of = (column: number, hub: number): string => kColumns[column]!.replace(/_|$/, hub === 0 ? "$&" : `_${hub + 1}$&`);

/** Rows of a time in s and, of each hub, an insertion in mm, a rotation in degrees, a balloon's pressure, how far a sheath is drawn back, and the coils that were to be detached. */
export class Recording {
  private numbers: number[] = [];

  constructor(private readonly hubs: number) {}

  private get width(): number {
    return 1 + kColumns.length * this.hubs;
  }

  /** Of a session whose server tells of some steps alone. */
  add({ time_s, instruments }: Pick<LiveMessage, "time_s" | "instruments">): void {
    const { numbers, width } = this, before = numbers.length - width;
    const is_other = (d: number) => before >= 0 && instruments[d]!.detach < numbers[before + 1 + kColumns.length * d + kDetach]!;
    if (instruments.some((_, d) => d < this.hubs && is_other(d))) this.clear(); // an instrument was exchanged
    this.add_row([time_s, ...instruments.flatMap(({ insertion_mm, rotation_deg, inflation_bar, release_mm, detach }) => [insertion_mm, rotation_deg, inflation_bar, release_mm, detach])]);
  }

  /** Of each step, with rotations in rad. */
  add_steps(steps: Float64Array): void {
    const { width } = this;
    for (let at = 0; at + width <= steps.length; at += width) this.add_row(Array.from(steps.subarray(at, at + width), (value, i) => (i > 0 && (i - 1) % kColumns.length === kRotation ? value * kDegrees : value)));
  }

  clear(): void {
    this.numbers = [];
  }

  /** Columns of balloons, sheaths and coils only where they were used; coils count from the first row on. */
  csv(): string {
    const { numbers, width } = this, from_s = numbers[0] ?? 0, rows: number[][] = [];
    const is_detach = (i: number) => i > 0 && (i - 1) % kColumns.length === kDetach;
    for (let at = 0; at < numbers.length; at += width) rows.push(numbers.slice(at, at + width).map((value, i) => (is_detach(i) ? value - numbers[i]! : value)));
    const columns = Array.from({ length: width - 1 }, (_, i) => i + 1).filter((i) => (i - 1) % kColumns.length <= kRotation || rows.some((row) => row[i] !== 0));
    const names = columns.map((i) => column_of((i - 1) % kColumns.length, Math.floor((i - 1) / kColumns.length)));
    const lines = rows.map((row) => `${(row[0]! - from_s).toFixed(4)},${columns.map((i) => row[i]).join()}\n`);
    return `${["time_s", ...names].join()}\n${lines.join("")}`;
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
