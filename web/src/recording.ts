// The hubs' way since the page was opened or an instrument was exchanged, as a script that `xraycast simulate` takes.
import type { LiveMessage } from "./live_message";

const kMostRows = 100_000; // of about an hour in motion; the first ones go

interface Row {
  time_s: number;
  poses: readonly number[]; // insertion in mm and rotation in degrees of each hub
}

const is_same = (a: Row, b: Row): boolean => a.poses.every((value, i) => value === b.poses[i]);

export class Recording {
  private rows: Row[] = [];

  add({ time_s, instruments }: Pick<LiveMessage, "time_s" | "instruments">): void {
    const row = { time_s, poses: instruments.flatMap(({ insertion_mm, rotation_deg }) => [insertion_mm, rotation_deg]) };
    const { rows } = this, last = rows.length - 1;
    if (last >= 0 && !(time_s > rows[last]!.time_s)) return;
    // Of a rest the beginning and the end are enough.
    if (last >= 1 && is_same(rows[last]!, row) && is_same(rows[last - 1]!, row)) rows.pop();
    rows.push(row);
    if (rows.length > kMostRows) rows.shift();
  }

  clear(): void {
    this.rows = [];
  }

  csv(): string {
    const hubs = (this.rows[0]?.poses.length ?? 2) / 2, from_s = this.rows[0]?.time_s ?? 0;
    const columns = Array.from({ length: hubs }, (_, d) => (d === 0 ? "insertion_mm,rotation_deg" : `insertion_${d + 1}_mm,rotation_${d + 1}_deg`));
    const lines = this.rows.map(({ time_s, poses }) => [time_s - from_s, ...poses].map((value) => value.toFixed(4)).join());
    return `${["time_s", ...columns].join()}\n${lines.map((line) => `${line}\n`).join("")}`;
  }
}
