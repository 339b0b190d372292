// Four rows that ascend and are no farther apart than the map's, of whose quads `upper` is number `quad` and `lower` the
// next. `within` are the same rows, limited to those of the map, `map_rows` in number.
vec4 rows_of_quads(vec4 upper, vec4 lower, int quad, vec4 row, vec4 within, float map_rows) {
  // Five consecutive rows of the map, from the one above the first.
  float above = floor(within.x - float(4 * quad));
  bool by_two = above >= 2.0, by_one = above == 1.0 || above == 3.0;
  vec4 here = by_two ? vec4(upper.zw, lower.xy) : upper;
  vec2 next = by_two ? lower.zw : lower.xy;
  vec4 five = by_one ? vec4(here.yzw, next.x) : here;
  float fifth = by_one ? next.y : next.x;

  // Piecewise linear interpolation as the sum of clamped steps.
  vec4 change = vec4(five.yzw, fifth) - five, from = within - float(4 * quad) - above;
  vec4 values = five.x + change.x * min(from, 1.0);
  values.yzw += change.y * clamp(from.yzw - 1.0, 0.0, 1.0);
  values.zw += change.z * clamp(from.zw - 2.0, 0.0, 1.0);
  values.w += change.w * clamp(from.w - 3.0, 0.0, 1.0);
  // The outermost rows reach half a row beyond their centres; beyond that there is nothing.
  return values * step(-0.5, row) * step(row, vec4(map_rows - 0.5));
}
