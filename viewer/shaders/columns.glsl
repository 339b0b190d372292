// The map along the rays of an upright view's columns (column_samples.hpp). Variants: BLENDS_LAYERS where samples
// lie between two layers, PATH where they stand for a length.
uniform samplerBuffer map_texels;    // four rows a texel (map_texels.hpp)
uniform samplerBuffer column_table;  // ColumnSamples::Column
uniform samplerBuffer sample_table;  // ColumnSample, two texels each
uniform int quads, layer_stride;     // of the map, in texels
uniform float map_rows;

// The map row in which rays cross the upright plane is first_row + row_step * row of the picture.
uniform float first_row, row_step;
uniform float fall;        // of a parallel beam: map rows per mm towards the detector
uniform float source_row;  // of a cone
uniform float row_mm;

// Four rows of the map, between its columns and layers as a sample asks.
vec4 quad_of(vec4 sample_, int quad) {
  int at = int(sample_.x) * quads + quad;
  vec4 values = mix(texelFetch(map_texels, at), texelFetch(map_texels, at + quads), sample_.z);
#ifdef BLENDS_LAYERS
  at += layer_stride;
  vec4 next = mix(texelFetch(map_texels, at), texelFetch(map_texels, at + quads), sample_.z);
  values = mix(values, next, sample_.w);
#endif
  return values;
}

// Map rows that a ray falls per mm of s, from the row in which it crosses the plane.
vec4 fall_of(vec4 row, float per_run_mm) { return fall + (row - source_row) * per_run_mm; }

// A mm of the ray's shadow in mm of the ray.
vec4 lengthening(vec4 fall_per_mm) {
#ifdef PATH
  vec4 slope = fall_per_mm * row_mm;
  return sqrt(1.0 + slope * slope);
#else
  return vec4(1.0);
#endif
}

vec4 hats(float distance_to_first) {
  return max(vec4(0.0), 1.0 - abs(vec4(distance_to_first) - vec4(0.0, 1.0, 2.0, 3.0)));
}

// The map at four places of a sample, in up to eight neighbouring rows, of which the first is in `quad`.
vec4 rows_of(vec4 sample_, vec4 row) {
  vec4 within = clamp(row, 0.0, map_rows - 1.0);
  int quad = int(min(min(within.x, within.y), min(within.z, within.w))) / 4;
  vec4 upper = quad_of(sample_, quad), lower = quad_of(sample_, min(quad + 1, quads - 1));
  vec4 from_quad = within - float(4 * quad);
  vec4 values = vec4(dot(upper, hats(from_quad.x)) + dot(lower, hats(from_quad.x - 4.0)),
                     dot(upper, hats(from_quad.y)) + dot(lower, hats(from_quad.y - 4.0)),
                     dot(upper, hats(from_quad.z)) + dot(lower, hats(from_quad.z - 4.0)),
                     dot(upper, hats(from_quad.w)) + dot(lower, hats(from_quad.w - 4.0)));
  // A row reaches half its height beyond its middle.
  return values * step(-0.5, row) * step(row, vec4(map_rows - 0.5));
}
