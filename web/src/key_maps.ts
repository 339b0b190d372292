// The key maps of a body that moves, between which the map of any instant is blended (host/xraycast/casting/key_maps.hpp).
import type { ModeHeader } from "./motion_mode";

/** Where the rows of a key map are: its own here, all others in `base`, which comes before it. */
export interface KeyRows {
  base: number;
  first: number;
  count: number;
}

export interface Share {
  key: number;
  weight: number;
}

/** By how much keys count at an instant, one phase a mode: linear between the two nearest phases of each. */
export function shares_at(modes: readonly ModeHeader[], phases: readonly number[]): Share[] {
  let shares: Share[] = [{ key: 0, weight: 1 }];
  modes.forEach(({ phases: keys, wraps }, m) => {
    const given = phases[m] ?? 0, phase = wraps ? given - Math.floor(given) : Math.min(1, Math.max(0, given));
    let above = 0;
    while (above < keys.length && keys[above]! <= phase) ++above;
    const below = Math.max(0, above - 1), next = above < keys.length ? above : 0;
    let weight = 0; // of the next; none behind the last of a mode that does not wrap
    if (above < keys.length || wraps) {
      const start = keys[below]!, end = above < keys.length ? keys[above]! : 1 + keys[0]!;
      weight = (phase - start) / (end - start);
    }
    shares = shares.flatMap(({ key, weight: share }) => {
      const first = key * keys.length, finer: Share[] = [];
      if (weight < 1) finer.push({ key: first + below, weight: share * (1 - weight) });
      if (weight > 0) finer.push({ key: first + next, weight: share * weight });
      return finer;
    });
  });
  return shares;
}

/** In whole 256ths, which sum up to 256; those that count less are left out. */
export function rounded(shares: readonly Share[]): Share[] {
  const all: Share[] = [];
  let sum = 0, rounded_sum = 0;
  for (const { key, weight } of shares) {
    const next = Math.round(256 * (sum += weight));
    if (next > rounded_sum) all.push({ key, weight: next - rounded_sum });
    rounded_sum = next;
  }
  return all;
}

/** The key map that has a row of this one. */
export function owner_of(rows: readonly KeyRows[], key: number, row: number): number {
  for (let { base, first, count } = rows[key]!; base >= 0 && !(row >= first && row < first + count); { base, first, count } = rows[key]!) key = base;
  return key;
}

/** Rows [first, end) that are a sum of the same few own rows. */
export interface Band {
  first: number;
  end: number;
  shares: Share[]; // in 256ths
}

/** From the top to the bottom. */
export function bands_at(modes: readonly ModeHeader[], rows: readonly KeyRows[], height: number, phases: readonly number[]): Band[] {
  const shares = shares_at(modes, phases), edges = new Set([0, height]);
  for (const { key: nearest } of shares)
    for (let key = nearest; key > 0; key = rows[key]!.base) edges.add(rows[key]!.first).add(rows[key]!.first + rows[key]!.count);
  const sorted = [...edges].sort((a, b) => a - b);
  return sorted.slice(1).map((end, i) => {
    const first = sorted[i]!, known: Share[] = [];
    for (const { key: nearest, weight } of shares) {
      const key = owner_of(rows, nearest, first), same = known.find((share) => share.key === key);
      if (same) same.weight += weight;
      else known.push({ key, weight });
    }
    return { first, end, shares: rounded(known) };
  });
}

/** The key before: that of the phase before, of the last mode that is not at its first phase. Page and program predict by it. */
export function key_before(modes: readonly ModeHeader[], key: number): number {
  let stride = 1;
  for (let m = modes.length - 1; m >= 0; --m) {
    const size = modes[m]!.phases.length;
    if (Math.floor(key / stride) % size > 0) return key - stride;
    stride *= size;
  }
  return -1;
}
