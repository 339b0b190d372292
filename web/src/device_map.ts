// Maps on the graphics device, in the layout of the shaders: one that stands still, one with half its rows for pictures of a
// motion, and one of a body that moves, which is blended from key maps (viewer/xraycast/sampling/key_texels.hpp).
import type { KeyMapData, MapGeometry } from "./data";
import { Program, Texture } from "./gl";
import { bands_at } from "./key_maps";
import { drawn_bands, texel_sizes } from "./layers";
import blend_keys_frag from "./shaders/blend_keys.frag";
import halve_rows_frag from "./shaders/halve_rows.frag";
import screen_vert from "./shaders/screen.vert";

/** What draws into the layers of a map. */
export class MapDrawing {
  readonly blend: Program;
  readonly halve: Program;
  private readonly framebuffer: WebGLFramebuffer;

  constructor(readonly gl: WebGL2RenderingContext) {
    this.blend = new Program(gl, screen_vert, blend_keys_frag);
    this.halve = new Program(gl, screen_vert, halve_rows_frag);
    this.framebuffer = gl.createFramebuffer()!;
  }

  begin(): void {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.framebuffer);
  }
}

export class DeviceMap {
  readonly texels: Texture;

  /** Empty. Throws where there is not enough memory for it. */
  constructor(protected readonly gl: WebGL2RenderingContext, readonly map: MapGeometry) {
    this.texels = new Texture(gl, gl.RGBA16F, gl.TEXTURE_2D_ARRAY);
    const { layers, columns, quads } = texel_sizes(map);
    this.texels.resize_layers(quads, columns, layers);
  }

  /** `tau` is K x H x W. */
  fill(tau: Float32Array): void {
    const { layers, columns } = texel_sizes(this.map);
    for (const band of drawn_bands(this.map, tau)) this.texels.fill_layers(band.values, band.first_quad, band.quads, columns, layers);
  }
}

/** The same map with half the rows, each the mean of two, for pictures that are too coarse to show them. */
export class HalvedMap extends DeviceMap {
  constructor(private readonly drawing: MapDrawing, private readonly whole: DeviceMap) {
    const { map } = whole;
    const bands = map.bands.map((first) => Math.round(first / 2)); // a row of two bands shows one of them
    super(drawing.gl, { ...map, bands, height: Math.ceil(map.height / 2), row_mm: 2 * map.row_mm, top_mm: map.top_mm - 0.5 * map.row_mm });
  }

  /** After the whole map has changed. */
  draw(): void {
    const { gl, drawing, whole } = this, { layers, columns, quads } = texel_sizes(this.map);
    drawing.begin();
    whole.texels.bind(0);
    for (let layer = 0; layer < layers; ++layer) {
      drawing.halve.use({ map_texels: 0, layer, last_quad: texel_sizes(whole.map).quads - 1 });
      this.texels.draw_into(layer, 0, quads, columns);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
  }
}

/** A map that moves: its key maps' texels in bytes, of which those of an instant are blended. */
export class MovingMap extends DeviceMap {
  private readonly keys: Texture[] = [];
  private drawn = new Set<string>(); // bands of rows, as they are now
  private phases = "";

  constructor(private readonly drawing: MapDrawing, map: MapGeometry, private readonly data: KeyMapData) {
    super(drawing.gl, map);
    this.add_key();
    this.blend(data.modes.map(() => 0));
  }

  /** Key maps that are not here yet; until there are none the body stands still. */
  get keys_left(): number {
    return this.data.rows.length - this.keys.length;
  }

  /** Takes the next key map, which takes a while. */
  add_key(): void {
    const k = this.keys.length, { first, count } = this.data.rows[k]!, bytes = this.data.bytes[k]!;
    const bands = this.map.bands.map((row) => row - first); // as the key map counts its rows
    const part = { ...this.map, bands, height: count }, { layers, columns, quads } = texel_sizes(part), area = this.map.width * count;
    const texture = new Texture(this.gl, this.gl.RGBA8, this.gl.TEXTURE_2D_ARRAY);
    this.keys.push(texture);
    if (count === 0) return;
    texture.resize_layers(quads, columns, layers);
    const tau = new Float32Array(bytes.length);
    this.map.ranges.forEach(([offset, scale], layer) => {
      for (let i = layer * area; i < (layer + 1) * area; ++i) tau[i] = offset + scale * bytes[i]!;
    });
    for (const { values, first_quad, quads: in_band } of drawn_bands(part, tau)) {
      const of_layer = values.length / layers, packed = new Uint8Array(values.length);
      this.data.drawn_ranges.forEach(([offset, scale], layer) => {
        for (let i = layer * of_layer; i < (layer + 1) * of_layer; ++i)
          packed[i] = scale > 0 ? Math.min(255, Math.max(0, Math.round((values[i]! - offset) / scale))) : 0;
      });
      texture.fill_layers(packed, first_quad, in_band, columns, layers);
    }
  }

  /** The texels of an instant, one phase a mode. Whether they have changed. */
  blend(phases: readonly number[]): boolean {
    if (this.keys_left > 0) phases = phases.map(() => 0);
    if (phases.join() === this.phases) return false;
    this.phases = phases.join();
    const { gl, drawing, data } = this, { layers, columns } = texel_sizes(this.map), drawn = new Set<string>();
    gl.disable(gl.BLEND);
    drawing.begin();
    for (const band of bands_at(data.modes, data.rows, this.map.height, phases)) {
      const key = JSON.stringify(band), first_quad = band.first / 4, quads = Math.ceil(band.end / 4) - first_quad;
      drawn.add(key);
      if (this.drawn.has(key)) continue; // which does not move
      const four = (of: (i: number) => number) => [0, 1, 2, 3].map((i) => (i < band.shares.length ? of(i) : 0));
      band.shares.forEach(({ key }, i) => this.keys[key]!.bind(i));
      drawing.blend.use({
        key_0: 0, key_1: 1, key_2: 2, key_3: 3, sources: band.shares.length, shares: four((i) => band.shares[i]!.weight),
        first_quads: four((i) => data.rows[band.shares[i]!.key]!.first / 4),
      });
      for (let layer = 0; layer < layers; ++layer) {
        const [offset, scale] = data.drawn_ranges[layer]!;
        drawing.blend.use({ layer, offset, scale });
        this.texels.draw_into(layer, first_quad, quads, columns);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
      }
    }
    this.drawn = drawn;
    return true;
  }
}
