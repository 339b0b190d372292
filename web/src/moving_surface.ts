// A surface of the body that moves, such as its vessels (viewer/xraycast/scene/moving_surface.hpp): its points move in place.
import type { Mesh, Surface } from "./data";
import { in_clusters } from "./mesh";
import type { Lattice } from "./moving_lattice";

class MovingMesh {
  readonly mesh: Mesh;
  private readonly places: ReturnType<Lattice["places_of"]>;

  constructor(private readonly rest: Mesh, private readonly lattice: Lattice) {
    this.mesh = { ...rest, points_mm: rest.points_mm.slice(), moves: 0 };
    this.places = lattice.places_of(rest.points_mm);
  }

  move(displacement_mm: Float32Array): void {
    this.lattice.move(this.rest.points_mm, this.places, displacement_mm, this.mesh.points_mm);
    ++this.mesh.moves!;
  }
}

export class MovingSurface {
  readonly surface: Surface;
  private readonly meshes: MovingMesh[];
  private phases = "";

  constructor(rest: Surface, private readonly lattice: Lattice) {
    const whole = new MovingMesh(rest.mesh, lattice), clusters = in_clusters(rest.mesh);
    const few = clusters === rest.mesh ? whole : new MovingMesh(clusters, lattice);
    this.meshes = [...new Set([whole, few])];
    this.surface = { ...rest, mesh: whole.mesh, clusters: { ...rest, mesh: few.mesh } };
  }

  /** To an instant, one phase a mode. */
  move(phases: readonly number[]): void {
    if (phases.join() === this.phases) return;
    this.phases = phases.join();
    const displacement_mm = this.lattice.displacement_mm(phases);
    for (const mesh of this.meshes) mesh.move(displacement_mm);
  }
}
