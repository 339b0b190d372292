// The catheter at a time of its run, as a surface.
import type { Run, Surface } from "./data";
import { curve_points, tube } from "./mesh";

const kRingsPerPoint = 3, kSides = 8;

/** The picture of the run at a time. */
export const picture_at = (run: Run, time_s: number): number =>
  Math.min(run.pictures - 1, Math.max(0, Math.floor(time_s / run.step_s + 1e-6)));

/** When the picture that is shown at a time begins. */
export const shown_time_s = (run: Run, time_s: number): number => picture_at(run, time_s) * run.step_s;

export const length_s = (run: Run): number => Math.max(0, (run.pictures - 1) * run.step_s);

export class DeviceShape {
  private picture = -1;
  private surface: Surface | null = null;
  constructor(private readonly run: Run) {}

  /** None while less of it is in the body than a curve takes. */
  at(time_s: number): Surface | null {
    const picture = picture_at(this.run, time_s);
    if (picture === this.picture) return this.surface;
    this.picture = picture;
    const controls = this.run.shapes[picture]!;
    this.surface = controls.length < 4 ? null : {
      mesh: tube(curve_points(controls, kRingsPerPoint), this.run.radius_mm, kSides), is_closed: true,
      mu_per_mm: this.run.mu_per_mm, colour: this.run.colour,
    };
    return this.surface;
  }
}
