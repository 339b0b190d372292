// Draws a session in passes, as `xraycast render` does (viewer/xraycast/drawing/renderer.hpp): the body's optical depth; the
// surfaces, opaque or absorbing; the body in front of opaque ones; and the display, which makes greys of these.
import { Absorbed, absorbed_by } from "./absorption";
import type { MapGeometry, Surface } from "./data";
import { Program, Table, Target, Texture, Triangles } from "./gl";
import type { GreyWindow } from "./grey_window";
import { drawn_texels } from "./layers";
import { normals_of } from "./mesh";
import { Rectified, rectified_view } from "./rectified";
import { Sampler } from "./samples";
import columns_glsl from "./shaders/columns.glsl";
import columns_frag from "./shaders/columns.frag";
import display_frag from "./shaders/display.frag";
import near_columns_frag from "./shaders/near_columns.frag";
import screen_vert from "./shaders/screen.vert";
import surface_frag from "./shaders/surface.frag";
import surface_vert from "./shaders/surface.vert";
import { View, source_mm, to_clip, towards_detector } from "./view";

export type Look = "fluoro" | "surface";

export interface Style {
  look: Look;
  window: GreyWindow;
  full_contrast: boolean; // surfaces keep the contrast that the window takes from the body
  pixels_per_column: number; // 2: the body is drawn at every other column
}

const kSampled = { map_texels: 0, column_table: 1, sample_table: 2 }; // texture units

/** The body in a view: kept until map, view or style change. */
class BodyPicture {
  private readonly target: Target;
  private readonly columns: Table;
  private readonly samples: Table;
  private key = "";
  rectified: Rectified | null = null;

  constructor(private readonly gl: WebGL2RenderingContext, private readonly map: MapGeometry, private readonly sampler: Sampler) {
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
      last_column: r.columns - 1,
    };
  }

  bind_tables(): void {
    this.columns.bind(kSampled.column_table);
    this.samples.bind(kSampled.sample_table);
  }

  bind(unit: number): void {
    this.target.textures[0]!.bind(unit);
  }

  draw(view: View, pixels_per_column: number, program: Program, texels: Texture): void {
    const key = JSON.stringify([view, pixels_per_column]);
    if (key === this.key) return;
    this.key = key;
    const r = (this.rectified = rectified_view(view, this.map, pixels_per_column)), { columns, samples } = this.sampler.samples_of(r);
    this.columns.fill(columns);
    this.samples.fill(samples);
    this.target.use(Math.max(1, r.columns), Math.max(1, Math.ceil(r.rows / 4)));
    program.use({ ...this.uniforms(), first_quad: Math.round((this.map.top_mm - r.top_mm) / this.map.row_mm / 4), has_map_rows: this.is_upright });
    texels.bind(kSampled.map_texels);
    this.bind_tables();
    if (r.columns > 0 && r.rows > 0) this.gl.drawArrays(this.gl.TRIANGLES, 0, 3);
  }

  /** How the display finds the body. */
  display_uniforms(pixels_per_column: number): Record<string, number | boolean | number[]> {
    const r = this.rectified!, is_seen = r.columns > 0 && r.rows > 0, first = (this.map.top_mm - r.top_mm) / this.map.row_mm;
    const limits = !is_seen ? [1e9, 1e9] : this.is_upright ? [-0.5 - first, this.map.height - 0.5 - first] : [-1e9, 1e9];
    return {
      from_pixel: r.from_pixel, body_size: [r.columns, Math.max(1, r.rows)], last_quad: Math.ceil(r.rows / 4) - 1,
      row_limits: limits, is_resampled: !this.is_upright || pixels_per_column > 1,
    };
  }
}

export class Renderer {
  private readonly programs: { columns: Program; near_columns: Program; display: Program; surface: Program };
  private readonly texels: Texture;
  private readonly body: BodyPicture;
  private readonly coarse_body: BodyPicture; // for automatic windows
  private readonly absorbed: Texture;
  private readonly opaque: Target;
  private readonly near: Target;
  private readonly tau_target: Target;
  private readonly no_vertices: WebGLVertexArrayObject;
  private readonly triangles = new Map<Surface["mesh"], Triangles>();
  private last_absorbed: { key: string; surfaces: readonly Surface[]; absorbed: Absorbed | null } | null = null;
  private last_covered: { key: string; absorbed: Absorbed | null } | null = null;

  /** Throws where the context cannot draw into textures of floats. */
  constructor(private readonly gl: WebGL2RenderingContext, private readonly map: MapGeometry, private readonly tau_of_map: Float32Array) {
    if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("this device cannot draw into textures of floats");
    this.programs = {
      columns: new Program(gl, screen_vert, columns_glsl + columns_frag),
      near_columns: new Program(gl, screen_vert, columns_glsl + near_columns_frag),
      display: new Program(gl, screen_vert, display_frag),
      surface: new Program(gl, surface_vert, surface_frag),
    };
    const sampler = new Sampler(map);
    this.texels = new Texture(gl, gl.RGBA16F, gl.TEXTURE_2D_ARRAY);
    this.body = new BodyPicture(gl, map, sampler);
    this.coarse_body = new BodyPicture(gl, map, sampler);
    this.absorbed = new Texture(gl, gl.R32F);
    this.opaque = new Target(gl, [gl.RGBA8, gl.R32F], true);
    this.near = new Target(gl, [gl.R32F]);
    this.tau_target = new Target(gl, [gl.R32F]);
    this.no_vertices = gl.createVertexArray()!;
  }

  /** One weight per layer, 0 hides it; none: 1 everywhere. */
  set_weights(weights: readonly number[]): void {
    const { layers, columns, quads, values } = drawn_texels(this.map, this.tau_of_map, weights);
    this.texels.fill_layers(values, quads, columns, layers);
    this.body.forget();
    this.coarse_body.forget();
  }

  /** The picture, on the canvas. */
  draw(view: View, surfaces: readonly Surface[], style: Style): void {
    this.draw_passes(this.body, view, surfaces, style);
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, null);
    this.gl.viewport(0, 0, view.width, view.height);
    this.display(this.body, view, surfaces, style, false);
  }

  /** The optical depths of a small picture of the same, in any order. */
  coarse_tau(view: View, surfaces: readonly Surface[], style: Style): Float32Array {
    this.draw_coarse(view, surfaces, style);
    return this.tau_target.red();
  }

  /** The same once the device has drawn it; none before. */
  coarse_tau_later(view: View, surfaces: readonly Surface[], style: Style): () => Float32Array | null {
    this.draw_coarse(view, surfaces, style);
    return this.tau_target.red_later();
  }

  private draw_coarse(view: View, surfaces: readonly Surface[], style: Style): void {
    const kEnough = 160; // pixels a side
    const every = Math.max(1, Math.floor(Math.max(view.width, view.height) / kEnough));
    const coarse = {
      ...view, width: Math.max(1, Math.floor(view.width / every)), height: Math.max(1, Math.floor(view.height / every)),
      pixel_mm: view.pixel_mm * every,
    };
    const full = { ...style, pixels_per_column: 1 };
    this.draw_passes(this.coarse_body, coarse, surfaces, full);
    this.tau_target.use(coarse.width, coarse.height);
    this.display(this.coarse_body, coarse, surfaces, full, true);
  }

  /** What one surface alone absorbs in a view; kept until that changes. */
  covered_by(view: View, surface: Surface): Absorbed | null {
    const key = JSON.stringify(view);
    if (this.last_covered?.key !== key) this.last_covered = { key, absorbed: absorbed_by([surface], view) };
    return this.last_covered.absorbed;
  }

  /** What surfaces absorb in a view; kept until one of them changes. */
  private absorbed_in(view: View, surfaces: readonly Surface[]): Absorbed | null {
    const key = JSON.stringify(view), last = this.last_absorbed;
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
    body.draw(view, style.pixels_per_column, this.programs.columns, this.texels);
    if (surfaces.length === 0) return;
    if (style.look === "surface") this.draw_opaque(body, view, surfaces);
    else this.draw_absorption(view, surfaces);
  }

  private draw_absorption(view: View, surfaces: readonly Surface[]): void {
    this.absorbed.resize(view.width, view.height);
    this.absorbed.fill(new Float32Array(view.width * view.height), 0, 0, view.width, view.height);
    const absorbed = this.absorbed_in(view, surfaces);
    if (absorbed) this.absorbed.fill(absorbed.tau, absorbed.x, absorbed.y, absorbed.width, absorbed.height);
  }

  private triangles_of(surface: Surface): Triangles {
    let triangles = this.triangles.get(surface.mesh);
    if (!triangles) {
      triangles = new Triangles(this.gl);
      triangles.fill(surface.mesh.points_mm, normals_of(surface.mesh), surface.mesh.triangles);
      this.triangles.set(surface.mesh, triangles);
    }
    return triangles;
  }

  private draw_opaque(body: BodyPicture, view: View, surfaces: readonly Surface[]): void {
    const { gl } = this;
    for (const mesh of this.triangles.keys())
      if (this.triangles.size > 4 && !surfaces.some((surface) => surface.mesh === mesh)) this.forget_mesh(mesh);
    this.opaque.use(view.width, view.height);
    this.opaque.clear();
    gl.enable(gl.DEPTH_TEST);
    for (const surface of surfaces) {
      if (surface.is_closed) gl.enable(gl.CULL_FACE);
      else gl.disable(gl.CULL_FACE);
      this.programs.surface.use({
        to_clip: to_clip(view), colour: surface.colour, towards_detector: towards_detector(view), is_cone: view.cone !== null,
        origin_mm: view.cone ? source_mm(view, view.cone) : view.centre_mm,
        along: [Math.sin(view.angle_rad), -Math.cos(view.angle_rad), 0],
      });
      this.triangles_of(surface).draw();
    }
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    this.near.use(view.width, view.height);
    this.near.clear();
    this.programs.near_columns.use({ ...body.uniforms(), shade: 3, surface_depth: 4, view_height: view.height });
    this.texels.bind(kSampled.map_texels);
    body.bind_tables();
    this.opaque.textures[0]!.bind(3);
    this.opaque.textures[1]!.bind(4);
    if (body.rectified!.columns > 0) this.fullscreen();
  }

  private forget_mesh(mesh: Surface["mesh"]): void {
    this.triangles.get(mesh)!.remove();
    this.triangles.delete(mesh);
  }

  private display(body: BodyPicture, view: View, surfaces: readonly Surface[], style: Style, gives_tau: boolean): void {
    const { window } = style, has_surfaces = surfaces.length > 0, contrast = 1 / (window.light - window.dark);
    this.programs.display.use({
      ...body.display_uniforms(style.pixels_per_column), view_height: view.height, gives_tau,
      body: 0, absorbed: 1, shade: 2, near_tau: 3,
      has_absorbed: has_surfaces && style.look === "fluoro", has_shade: has_surfaces && style.look === "surface",
      weight: !gives_tau && style.full_contrast ? Math.max(1, window.scale) : 1,
      scale: window.scale, contrast, black: window.dark * contrast, gamma: window.gamma, inverted: window.inverted,
    });
    body.bind(0);
    this.absorbed.bind(1);
    this.opaque.textures[0]!.bind(2);
    this.near.textures[0]!.bind(3);
    this.fullscreen();
  }
}
