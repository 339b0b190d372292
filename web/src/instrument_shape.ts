// Instruments as surfaces: a tube about the curve of each part. Those of a run at a time.
import type { InstrumentHeader, Run, Surface } from "./data";
import { band, curve_points, tube } from "./mesh";
import { Vec3, length, minus } from "./vectors";

const kRingsPerPoint = 3, kSides = 8, kBandRingsPerPoint = 2, kBandSides = 16;

/** The picture of the run at a time. */
export const picture_at = (run: Run, time_s: number): number =>
  Math.min(run.pictures - 1, Math.max(0, Math.floor(time_s / run.step_s + 1e-6)));

/** When the picture that is shown at a time begins. */
export const shown_time_s = (run: Run, time_s: number): number => picture_at(run, time_s) * run.step_s;

export const length_s = (run: Run): number => Math.max(0, (run.pictures - 1) * run.step_s);

const length_mm = (points: readonly Vec3[]): number => points.slice(1).reduce((sum, point, i) => sum + length(minus(point, points[i]!)), 0);

/** When most of the instruments is in the body: at the start of a run there may be nothing to see. */
export function fullest_s(run: Run): number {
  let time_s = 0, most_mm = 0;
  for (let k = 0; k < run.pictures; ++k) {
    const all_mm = run.instruments.reduce((sum, { shapes }) => shapes.reduce((parts, part) => parts + length_mm(part[k]!), sum), 0);
    if (all_mm > most_mm) [time_s, most_mm] = [k * run.step_s, all_mm];
  }
  return time_s;
}

/** The parts of an instrument, with the control points of each; without those that are shorter than a curve takes. */
export function surfaces_of({ radius_mm, parts }: InstrumentHeader, controls_mm: readonly (readonly Vec3[])[]): Surface[] {
  return parts.flatMap(({ mu_per_mm, colour, inner_radius_mm }, p): Surface[] => {
    const controls = controls_mm[p] ?? [];
    if (controls.length < 4) return [];
    const mesh = p === 0 ? tube(curve_points(controls, kRingsPerPoint), radius_mm, kSides)
      : band(curve_points(controls, kBandRingsPerPoint), radius_mm, inner_radius_mm, kBandSides);
    return [{ mu_per_mm, colour, mesh, is_closed: true, tube_sides: p === 0 ? kSides : kBandSides }];
  });
}

export class InstrumentShapes {
  private picture = -1;
  private surfaces: Surface[] = [];
  constructor(private readonly run: Run) {}

  at(time_s: number): Surface[] {
    const picture = picture_at(this.run, time_s);
    if (picture === this.picture) return this.surfaces;
    this.picture = picture;
    this.surfaces = this.run.instruments.flatMap((instrument) => surfaces_of(instrument, instrument.shapes.map((shapes) => shapes[picture]!)));
    return this.surfaces;
  }
}
