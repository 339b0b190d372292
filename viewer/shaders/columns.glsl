// The map along the rays of a rectified view's columns (column_samples.hpp). Variants: BLENDS_LAYERS where samples
// lie between two layers, PATH where they stand for a length, BYTES where texels are bytes.
uniform samplerBuffer map_texels;    // four rows per texel (map_texels.hpp)
uniform samplerBuffer column_table;  // ColumnSamples::Column
uniform samplerBuffer sample_table;  // ColumnSample, two texels each
#ifdef BYTES
uniform samplerBuffer byte_ranges;   // offset and scale of a layer and of the next one
#endif
uniform int quads, layer_stride;     // of the map, in texels
uniform float map_rows;

// The map row in which rays cross the rectified plane is first_row + row_step * row of the picture.
uniform float first_row, row_step;
uniform float slope;       // of a parallel beam: map rows per mm of s
uniform float source_row;  // of a cone
uniform float row_mm;

// What the bytes of a sample's layers stand for.
vec4 range_of(int sample_index) {
#ifdef BYTES
  return texelFetch(byte_ranges, int(texelFetch(sample_table, 2 * sample_index + 1).w));
#else
  return vec4(0.0);
#endif
}

// Four rows of the map, interpolated between the columns and layers of a sample.
vec4 quad_of(vec4 sample_, vec4 range, int quad) {
  int at = int(sample_.x) * quads + quad;
  vec4 values = mix(texelFetch(map_texels, at), texelFetch(map_texels, at + quads), sample_.z);
#ifdef BYTES
  values = range.x + range.y * values;
#endif
#ifdef BLENDS_LAYERS
  at += layer_stride;
  vec4 next = mix(texelFetch(map_texels, at), texelFetch(map_texels, at + quads), sample_.z);
#ifdef BYTES
  next = range.z + range.w * next;
#endif
  values = mix(values, next, sample_.w);
#endif
  return values;
}

// Map rows per mm of s of the rays that cross the rectified plane in these rows.
vec4 slope_of(vec4 row, float per_run_mm) { return slope + (row - source_row) * per_run_mm; }

// Length of the ray per mm of s: the secant of its elevation.
vec4 secant(vec4 rows_per_mm) {
#ifdef PATH
  vec4 rise = rows_per_mm * row_mm;
  return sqrt(1.0 + rise * rise);
#else
  return vec4(1.0);
#endif
}

#include "row_steps.glsl"

// The map of a sample in four rows, which ascend and are no farther apart than the map's.
vec4 rows_of(vec4 sample_, vec4 range, vec4 row) {
  vec4 within = clamp(row, 0.0, map_rows - 1.0);
  int quad = int(within.x) / 4;
  vec4 upper = quad_of(sample_, range, quad), lower = quad_of(sample_, range, min(quad + 1, quads - 1));
  return rows_of_quads(upper, lower, quad, row, within, map_rows);
}
