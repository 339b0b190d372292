// Draws a session in passes, as `xraycast render` does (viewer/xraycast/drawing/renderer.hpp): the body's optical depth; the
// surfaces, opaque or absorbing; the body in front of opaque ones; and the display, which makes greys of these.
import { Absorbed, absorbed_by, covered_by } from "./absorption";
import type { KeyMapData, MapGeometry, Surface } from "./data";
import { DeviceMap, HalvedMap, MapDrawing, MovingMap } from "./device_map";
import { ComingReds, Program, Table, Target, Texture, Triangles } from "./gl";
import type { DetectorImage } from "./fluoroscopy";
import type { GreyWindow } from "./grey_window";
import { in_clusters, kCluster_mm, normals_of } from "./mesh";
import { Rectified, rectified_view } from "./rectified";
import { Sampler } from "./samples";
import row_steps_glsl from "../../viewer/shaders/row_steps.glsl";
import columns_glsl from "./shaders/columns.glsl";
import columns_frag from "./shaders/columns.frag";
import detector_frag from "./shaders/detector.frag";
import display_frag from "./shaders/display.frag";
import near_columns_frag from "./shaders/near_columns.frag";
import screen_vert from "./shaders/screen.vert";
import surface_frag from "./shaders/surface.frag";
import surface_vert from "./shaders/surface.vert";
import thickness_frag from "./shaders/thickness.frag";
import { tube_of, widening_of } from "./thin_tube";
import { View, magnification_of, source_mm, to_clip, towards_detector } from "./view";

export type Look = "fluoro" | "surface";

export interface Style {
  look: Look;
  window: GreyWindow;
  full_contrast: boolean; // surfaces keep the contrast that the window takes from the body
  detail: Detail;
  is_moving: boolean; // a picture of a motion, of the C-arm or the body: surfaces are added up on the device
  outlined: Surface | null; // in pictures of a motion
  outline_colour: readonly number[]; // 0 to 255
}

/** How finely the body is drawn. */
export interface Detail {
  pixels_per_column: number;
  texels_per_step: number; // of the map, between samples of a ray
}

/** As `xraycast render` draws, and for pictures of a motion. */
export const kFull: Detail = { pixels_per_column: 1, texels_per_step: 3 };
export const kQuick: Detail = { pixels_per_column: 2, texels_per_step: 12 };

const kSampled = { map_texels: 0, column_table: 1, sample_table: 2 }; // texture units

/** The first and the last row of each band, beyond the map's ends where there is no other. */
function rows_of_bands({ bands }: MapGeometry): number[] {
  const kBeyond = 1e9;
  return bands.flatMap((first, i) => [i === 0 ? -kBeyond : first, i + 1 < bands.length ? bands[i + 1]! - 1 : kBeyond]);
}

/** The body in a view: kept until map, view or style change. */
class BodyPicture {
  private readonly map: MapGeometry;
  private readonly target: Target;
  private readonly columns: Table;
  private readonly samples: Table;
  private key = "";
  rectified: Rectified | null = null;

  constructor(private readonly gl: WebGL2RenderingContext, private readonly source: DeviceMap, private readonly sampler: Sampler) {
    this.map = source.map;
    this.target = new Target(gl, [gl.RGBA32F]);
    this.columns = new Table(gl);
    this.samples = new Table(gl);
  }

  forget(): void {
    this.key = "";
  }

  get is_upright(): boolean {
    return this.rectified!.source_mm === 0 && this.rectified!.slope === 0;
  }

  /** The rows of the map in those of the picture. */
  uniforms(): Record<string, number | boolean | number[]> {
    const { map } = this, r = this.rectified!;
    return {
      ...kSampled, quads: Math.ceil(map.height / 4), map_rows: map.height, blends_layers: map.layers > 1,
      first_row: (map.top_mm - r.top_mm) / map.row_mm, row_step: r.row_mm / map.row_mm, slope: -r.slope / map.row_mm,
      source_row: (map.top_mm - r.source_z_mm) / map.row_mm, row_mm: map.row_mm, from_pixel: r.from_pixel,
      last_column: r.columns - 1, columns: r.columns, bands: map.bands.length, rows_of_bands: rows_of_bands(map),
    };
  }

  bind_samples(): void {
    this.source.texels.bind(kSampled.map_texels);
    this.columns.bind(kSampled.column_table);
    this.samples.bind(kSampled.sample_table);
  }

  bind(unit: number): void {
    this.target.textures[0]!.bind(unit);
  }

  draw(view: View, detail: Detail, program: Program): void {
    const key = JSON.stringify([view, detail]);
    if (key === this.key) return;
    this.key = key;
    const r = (this.rectified = rectified_view(view, this.map, detail.pixels_per_column));
    const { columns, samples } = this.sampler.samples_of(r, detail.texels_per_step);
    this.columns.fill(columns);
    this.samples.fill(samples);
    this.target.use(Math.max(1, r.columns), Math.max(1, Math.ceil(r.rows / 4)));
    program.use({ ...this.uniforms(), first_quad: Math.round((this.map.top_mm - r.top_mm) / this.map.row_mm / 4), has_map_rows: this.is_upright });
    this.bind_samples();
    if (r.columns > 0 && r.rows > 0) this.gl.drawArrays(this.gl.TRIANGLES, 0, 3);
  }

  /** How the display finds the body. */
  display_uniforms({ pixels_per_column }: Detail): Record<string, number | boolean | number[]> {
    const r = this.rectified!, is_seen = r.columns > 0 && r.rows > 0, first = (this.map.top_mm - r.top_mm) / this.map.row_mm;
    const limits = !is_seen ? [1e9, 1e9] : this.is_upright ? [-0.5 - first, this.map.height - 0.5 - first] : [-1e9, 1e9];
    return {
      from_pixel: r.from_pixel, body_size: [r.columns, Math.max(1, r.rows)], last_quad: Math.ceil(r.rows / 4) - 1,
      row_limits: limits, is_resampled: !this.is_upright || pixels_per_column > 1,
    };
  }
}

const kSpareMeshes = 12; // on the device, besides those that are drawn: of the pictures before

export class Renderer {
  private readonly programs: { columns: Program; near_columns: Program; display: Program; detector: Program; surface: Program; thickness: Program };
  private readonly whole: DeviceMap;
  private readonly moving: MovingMap | null; // the same, of a body that moves
  private readonly halved: HalvedMap; // of half the rows, for pictures of a motion
  private is_halved = false; // as the whole map is now
  private readonly body: BodyPicture;
  private readonly quick_body: BodyPicture;
  private readonly coarse_body: BodyPicture; // for automatic windows
  private readonly quick_coarse_body: BodyPicture;
  private readonly sampler: Sampler;
  private readonly absorbed: Texture;
  private readonly thickness: Target; // of closed surfaces, in pictures of a motion
  private readonly adds_floats: boolean;
  private readonly opaque: Target;
  private readonly near: Target;
  private readonly tau_target: Target;
  private readonly rays: Target; // of a fluoroscope's pulse
  private readonly greys: Texture; // of the fluoroscope's picture
  private shown_image: DetectorImage | null = null; // in these greys
  private readonly no_vertices: WebGLVertexArrayObject;
  private readonly clusters = new WeakMap<Surface, Surface>();
  private readonly triangles = new Map<Surface["mesh"], Triangles>();
  private most_meshes = kSpareMeshes;
  private last_absorbed: { key: string; surfaces: readonly Surface[]; absorbed: Absorbed | null } | null = null;
  private last_covered: { key: string; absorbed: Absorbed | null } | null = null;

  /** Throws where the context cannot draw into textures of floats. */
  constructor(private readonly gl: WebGL2RenderingContext, map: MapGeometry, source: Float32Array | KeyMapData) {
    if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("this device cannot draw into textures of floats");
    this.programs = {
      columns: new Program(gl, screen_vert, row_steps_glsl + columns_glsl + columns_frag),
      near_columns: new Program(gl, screen_vert, row_steps_glsl + columns_glsl + near_columns_frag),
      display: new Program(gl, screen_vert, display_frag),
      detector: new Program(gl, screen_vert, detector_frag),
      surface: new Program(gl, surface_vert, surface_frag),
      thickness: new Program(gl, surface_vert, thickness_frag),
    };
    this.adds_floats = gl.getExtension("EXT_float_blend") !== null;
    const sampler = (this.sampler = new Sampler(map)), drawing = new MapDrawing(gl);
    this.moving = source instanceof Float32Array ? null : new MovingMap(drawing, map, source);
    this.whole = this.moving ?? new DeviceMap(gl, map);
    if (source instanceof Float32Array) this.whole.fill(source);
    this.halved = new HalvedMap(drawing, this.whole);
    this.body = new BodyPicture(gl, this.whole, sampler);
    this.quick_body = new BodyPicture(gl, this.halved, sampler);
    this.coarse_body = new BodyPicture(gl, this.whole, sampler);
    this.quick_coarse_body = new BodyPicture(gl, this.halved, sampler);
    this.absorbed = new Texture(gl, gl.R32F);
    this.thickness = new Target(gl, [gl.RG32F]);
    this.opaque = new Target(gl, [gl.RGBA8, gl.R32F], true);
    this.near = new Target(gl, [gl.R32F]);
    this.tau_target = new Target(gl, [gl.R32F]);
    this.rays = new Target(gl, [gl.R32F]);
    this.greys = new Texture(gl, gl.R8);
    this.no_vertices = gl.createVertexArray()!;
  }

  /** One weight per layer, 0 hides it; none: 1 everywhere. */
  set_weights(weights: readonly number[]): void {
    this.sampler.set_weights(weights);
    this.forget_bodies();
  }

  private forget_bodies(): void {
    for (const body of [this.body, this.quick_body, this.coarse_body, this.quick_coarse_body]) body.forget();
  }

  /** Key maps that are still to be loaded; 0 where the body does not move. */
  get keys_left(): number {
    return this.moving?.keys_left ?? 0;
  }

  /** Loads another of them, which takes a while. Until they are all here, the body stands still. */
  add_key(): void {
    this.moving?.add_key();
  }

  /** The instant of a body that moves: one phase a mode. */
  set_phases(phases: readonly number[]): void {
    if (!this.moving?.blend(phases)) return;
    this.is_halved = false;
    this.forget_bodies();
  }

  /** The picture, on the canvas. */
  draw(view: View, surfaces: readonly Surface[], style: Style): void {
    const body = this.body_for(view, style);
    this.draw_passes(body, view, surfaces, style);
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, null);
    this.gl.viewport(0, 0, view.width, view.height);
    this.display(body, view, surfaces, style, false);
  }

  /** The optical depths of a small picture of the same, in any order. */
  coarse_tau(view: View, surfaces: readonly Surface[], style: Style): Float32Array {
    this.draw_coarse(this.coarse_body, view, surfaces, { ...style, detail: kFull, is_moving: false, outlined: null });
    return this.tau_target.red();
  }

  /** Nearly the same, once the device has drawn it; none before. */
  coarse_tau_later(view: View, surfaces: readonly Surface[], style: Style): ComingReds {
    this.draw_coarse(this.quick_coarse_body, view, surfaces, { ...style, detail: kQuick, is_moving: true, outlined: null });
    return this.tau_target.red_later();
  }

  private body_for(view: View, { detail }: Style): BodyPicture {
    const { row_mm } = this.whole.map, at_axis_mm = view.pixel_mm / magnification_of(view);
    return detail === kQuick && at_axis_mm > row_mm ? this.quick_body : this.body;
  }

  /** The optical depths of all rays, once the device has drawn them. */
  rays_later(view: View, surfaces: readonly Surface[], style: Style): ComingReds {
    const body = this.body_for(view, style);
    this.draw_passes(body, view, surfaces, style);
    this.rays.use(view.width, view.height);
    this.display(body, view, surfaces, style, true);
    return this.rays.red_later();
  }

  /** A fluoroscope's picture, as large as what it shows is in the view. */
  draw_image(image: DetectorImage, has_outline: boolean, view: View, { window, outline_colour }: Style): void {
    const { gl } = this, { width, height, pixel_mm } = image.view, contrast = 1 / (window.light - window.dark);
    if (this.shown_image !== image) {
      this.greys.resize(width, height);
      this.greys.fill(image.greys, 0, 0, width, height);
      this.shown_image = image;
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, view.width, view.height);
    this.programs.detector.use({
      greys: 0, covered: 1, canvas_size: [view.width, view.height], image_size: [width, height], image_pixels: view.pixel_mm / pixel_mm,
      has_outline, outline_colour: outline_colour.map((c) => c / 255), contrast, black: window.dark * contrast, gamma: window.gamma, inverted: window.inverted,
    });
    this.greys.bind(0);
    this.thickness.textures[0]!.bind(1);
    this.fullscreen();
  }

  private draw_coarse(body: BodyPicture, view: View, surfaces: readonly Surface[], style: Style): void {
    const kEnough = 160; // pixels a side
    const every = Math.max(1, Math.floor(Math.max(view.width, view.height) / kEnough));
    const coarse = {
      ...view, width: Math.max(1, Math.floor(view.width / every)), height: Math.max(1, Math.floor(view.height / every)),
      pixel_mm: view.pixel_mm * every,
    };
    this.draw_passes(body, coarse, surfaces, style);
    this.tau_target.use(coarse.width, coarse.height);
    this.display(body, coarse, surfaces, style, true);
  }

  /** What one surface alone absorbs in a view; kept until that changes. */
  covered_by(view: View, surface: Surface): Absorbed | null {
    const key = JSON.stringify([view, surface.mesh.moves]);
    if (this.last_covered?.key !== key) this.last_covered = { key, absorbed: covered_by(surface, view) };
    return this.last_covered.absorbed;
  }

  /** What surfaces absorb in a view; kept until one of them changes. */
  private absorbed_in(view: View, surfaces: readonly Surface[]): Absorbed | null {
    const key = JSON.stringify([view, surfaces.map(({ mesh }) => mesh.moves)]), last = this.last_absorbed;
    if (last && last.key === key && last.surfaces.length === surfaces.length && surfaces.every((s, i) => s === last.surfaces[i]))
      return last.absorbed;
    const absorbed = absorbed_by(surfaces, view);
    this.last_absorbed = { key, surfaces: [...surfaces], absorbed };
    return absorbed;
  }

  private fullscreen(): void {
    const { gl } = this;
    gl.bindVertexArray(this.no_vertices);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  private draw_passes(body: BodyPicture, view: View, surfaces: readonly Surface[], style: Style): void {
    this.gl.bindVertexArray(this.no_vertices);
    this.most_meshes = kSpareMeshes + surfaces.length;
    if ((body === this.quick_body || body === this.quick_coarse_body) && !this.is_halved) {
      this.halved.draw();
      this.is_halved = true;
    }
    body.draw(view, style.detail, this.programs.columns);
    if (this.adds_up(surfaces, style)) this.draw_thickness(view, surfaces, style);
    if (surfaces.length === 0) return;
    if (style.look === "surface") this.draw_opaque(body, view, surfaces);
    else if (!this.adds_up(surfaces, style)) this.draw_absorption(view, surfaces);
  }

  /** Whether pictures of a motion add up the surfaces' thickness on the device: nearly what they absorb, and soon. */
  adds_up(surfaces: readonly Surface[], { is_moving, outlined }: Style): boolean {
    return is_moving && this.adds_floats && [...surfaces, ...(outlined ? [outlined] : [])].every((surface) => surface.is_closed);
  }

  private draw_thickness(view: View, surfaces: readonly Surface[], { look, outlined }: Style): void {
    const { gl } = this, absorbing = look === "fluoro" ? surfaces : [], at_axis_mm = view.pixel_mm / magnification_of(view);
    this.thickness.use(view.width, view.height);
    this.thickness.clear();
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE);
    for (const surface of new Set(outlined ? [...absorbing, outlined] : absorbing)) {
      const { factor, share } = widening_of(surface, view);
      this.programs.thickness.use({
        to_clip: to_clip(view), widening: factor - 1, towards_detector: towards_detector(view), is_cone: view.cone !== null,
        origin_mm: view.cone ? source_mm(view, view.cone) : view.centre_mm,
        mu_per_mm: absorbing.includes(surface) ? share * surface.mu_per_mm : 0, outlined: surface === outlined ? 1 : 0,
      });
      this.triangles_of(at_axis_mm > 0.5 * kCluster_mm ? this.clusters_of(surface) : surface).draw();
    }
    gl.disable(gl.BLEND);
    gl.bindVertexArray(this.no_vertices);
  }

  private draw_absorption(view: View, surfaces: readonly Surface[]): void {
    this.absorbed.resize(view.width, view.height);
    this.absorbed.fill(new Float32Array(view.width * view.height), 0, 0, view.width, view.height);
    const absorbed = this.absorbed_in(view, surfaces);
    if (absorbed) this.absorbed.fill(absorbed.tau, absorbed.x, absorbed.y, absorbed.width, absorbed.height);
  }

  private clusters_of(surface: Surface): Surface {
    if (surface.clusters) return surface.clusters; // that move with it
    if (surface.weights || surface.tube_sides) return surface;
    let clusters = this.clusters.get(surface);
    if (!clusters) {
      const mesh = in_clusters(surface.mesh);
      this.clusters.set(surface, (clusters = mesh === surface.mesh ? surface : { ...surface, mesh }));
    }
    return clusters;
  }

  private triangles_of(surface: Surface): Triangles {
    let triangles = this.triangles.get(surface.mesh);
    if (triangles) {
      this.triangles.delete(surface.mesh); // and last again: the first was not drawn for the longest time
      this.triangles.set(surface.mesh, triangles);
    } else {
      const oldest = this.triangles.keys().next().value;
      if (this.triangles.size >= this.most_meshes && oldest) this.forget_mesh(oldest);
      triangles = new Triangles(this.gl);
      const { mesh, weights } = surface;
      triangles.fill(mesh.points_mm, normals_of(mesh), mesh.triangles, weights, tube_of(surface)?.from_axis_mm);
      triangles.moves = mesh.moves;
      this.triangles.set(surface.mesh, triangles);
    }
    if (triangles.moves !== surface.mesh.moves) {
      triangles.move(surface.mesh.points_mm, normals_of(surface.mesh));
      triangles.moves = surface.mesh.moves;
    }
    return triangles;
  }

  private draw_opaque(body: BodyPicture, view: View, surfaces: readonly Surface[]): void {
    const { gl } = this;
    this.opaque.use(view.width, view.height);
    this.opaque.clear();
    gl.enable(gl.DEPTH_TEST);
    for (const surface of surfaces) {
      if (surface.is_closed) gl.enable(gl.CULL_FACE);
      else gl.disable(gl.CULL_FACE);
      const { factor, thinness } = widening_of(surface, view);
      this.programs.surface.use({
        to_clip: to_clip(view), widening: factor - 1, thinness, colour: surface.colour,
        towards_detector: towards_detector(view), is_cone: view.cone !== null,
        origin_mm: view.cone ? source_mm(view, view.cone) : view.centre_mm,
        along: [Math.sin(view.lao_rad), -Math.cos(view.lao_rad), 0],
      });
      this.triangles_of(surface).draw();
    }
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    this.near.use(view.width, view.height);
    this.near.clear();
    this.programs.near_columns.use({ ...body.uniforms(), shade: 3, surface_depth: 4, view_height: view.height });
    body.bind_samples();
    this.opaque.textures[0]!.bind(3);
    this.opaque.textures[1]!.bind(4);
    if (body.rectified!.columns > 0) this.fullscreen();
  }

  private forget_mesh(mesh: Surface["mesh"]): void {
    this.triangles.get(mesh)!.remove();
    this.triangles.delete(mesh);
  }

  private display(body: BodyPicture, view: View, surfaces: readonly Surface[], style: Style, gives_tau: boolean): void {
    const { window } = style, has_surfaces = surfaces.length > 0, adds_up = this.adds_up(surfaces, style), contrast = 1 / (window.light - window.dark);
    this.programs.display.use({
      ...body.display_uniforms(style.detail), view_height: view.height, gives_tau,
      body: 0, absorbed: 1, shade: 2, near_tau: 3,
      has_outline: adds_up && style.outlined !== null && !gives_tau, outline_colour: style.outline_colour.map((c) => c / 255),
      has_absorbed: has_surfaces && style.look === "fluoro", has_shade: has_surfaces && style.look === "surface",
      weight: !gives_tau && style.full_contrast ? Math.max(1, window.scale) : 1,
      scale: window.scale, contrast, black: window.dark * contrast, gamma: window.gamma, inverted: window.inverted,
    });
    body.bind(0);
    (adds_up ? this.thickness.textures[0]! : this.absorbed).bind(1);
    this.opaque.textures[0]!.bind(2);
    this.near.textures[0]!.bind(3);
    this.fullscreen();
  }
}
