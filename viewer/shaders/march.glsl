// Ray marching through a map: spheres, and cylinders about a curved axis. Variants: SPHERE, WALL,
// OUTLINE, and BYTES where texels are bytes.
uniform samplerBuffer map_texels;      // four rows per texel (map_texels.hpp)
uniform samplerBuffer axis_table;      // x, y of the axis in every row; one entry for a sphere
uniform samplerBuffer layer_table;     // layer and weight of the next one, for evenly spaced radii
#ifdef BYTES
uniform samplerBuffer byte_ranges;     // offset and scale of a layer
#endif
#ifdef OUTLINE
uniform samplerBuffer outline_table;   // R of every column (and the first again) and row, as a share of the largest
#endif
uniform int quads, layer_stride, layer_places, layers;
uniform float map_rows, map_columns;
uniform vec3 body_centre_mm;           // of the cylinder or sphere that bounds the map
uniform float body_radius_mm, body_half_height_mm, radius_mm;
uniform float top_mm, row_mm;
uniform float step_mm;
uniform vec3 field_lower_mm, field_upper_mm;  // of the scan, beyond which there is nothing

// The view's rays: through a point of the detector, along the beam or from the source.
uniform vec3 corner_mm, right_mm, down_mm;  // the detector's corner and the edges of a pixel
uniform vec3 source_mm, beam;
uniform bool is_cone;

const float kTurn = 6.283185307179586;
const int kMaxSteps = 2048;

struct Ray {
  vec3 start_mm, direction;
};

// The ray of a pixel (i + 1/2, j + 1/2). Its parameter is 0 at the source, or on the detector's plane.
Ray ray_of(vec2 pixel) {
  vec3 on_detector = corner_mm + pixel.x * right_mm + pixel.y * down_mm;
  return is_cone ? Ray(source_mm, normalize(on_detector - source_mm)) : Ray(on_detector, beam);
}

// The interval of a ray within the bounds of the map and the scan; empty when it misses them.
vec2 within_bounds(Ray ray) {
  vec3 from_centre = ray.start_mm - body_centre_mm, along = ray.direction;
#ifdef SPHERE
  float a = 1.0, b = dot(from_centre, along), c = dot(from_centre, from_centre) - body_radius_mm * body_radius_mm;
#else
  float a = max(dot(along.xy, along.xy), 1e-12), b = dot(from_centre.xy, along.xy);
  float c = dot(from_centre.xy, from_centre.xy) - body_radius_mm * body_radius_mm;
#endif
  float discriminant = b * b - a * c;
  if (discriminant <= 0.0) return vec2(0.0);
  vec2 range = (vec2(-1.0, 1.0) * sqrt(discriminant) - b) / a;
#ifndef SPHERE
  if (abs(along.z) > 1e-6) {
    vec2 ends = (vec2(-body_half_height_mm, body_half_height_mm) - from_centre.z) / along.z;
    range = vec2(max(range.x, min(ends.x, ends.y)), min(range.y, max(ends.x, ends.y)));
  } else if (abs(from_centre.z) > body_half_height_mm) {
    return vec2(0.0);
  }
#endif
#ifndef WALL
  vec3 way = mix(along, vec3(1e-12), lessThan(abs(along), vec3(1e-12)));
  vec3 a_side = (field_lower_mm - ray.start_mm) / way, b_side = (field_upper_mm - ray.start_mm) / way;
  vec3 first = min(a_side, b_side), last = max(a_side, b_side);
  range = vec2(max(max(range.x, first.x), max(first.y, first.z)), min(min(range.y, last.x), min(last.y, last.z)));
#endif
  if (is_cone) range.x = max(range.x, 0.0);
  return range;
}

#ifdef OUTLINE
float scale_at(vec2 place) {
  float column = place.x < 0.0 ? place.x + map_columns : place.x;
  int left = int(column), upper = int(place.y), lower = min(upper + 1, int(map_rows) - 1);
  int stride = int(map_columns) + 1;
  vec2 weight = vec2(column - float(left), place.y - float(upper));
  return mix(mix(texelFetch(outline_table, upper * stride + left).x,
                 texelFetch(outline_table, upper * stride + left + 1).x, weight.x),
             mix(texelFetch(outline_table, lower * stride + left).x,
                 texelFetch(outline_table, lower * stride + left + 1).x, weight.x), weight.y);
}
#endif

// A point's coordinates in the map: column, row, and radius in mm as the shells have it.
vec3 map_coordinates(vec3 point) {
#ifdef SPHERE
  vec3 p = point - body_centre_mm;
  float radius = length(p);
  float row = acos(clamp(p.z / max(radius, 1e-6), -1.0, 1.0)) / (0.5 * kTurn) * map_rows - 0.5;
#else
  float row = clamp((top_mm - point.z) / row_mm, 0.0, map_rows - 1.0);
  int above = int(row), below = min(above + 1, int(map_rows) - 1);
  vec2 axis = mix(texelFetch(axis_table, above).xy, texelFetch(axis_table, below).xy, row - float(above));
  vec2 p = point.xy - axis;
  float radius = length(p);
#endif
  float turn = atan(p.x, -p.y) / kTurn;
  vec2 place = vec2((turn < 0.0 ? turn + 1.0 : turn) * map_columns - 0.5, clamp(row, 0.0, map_rows - 1.0));
#ifdef OUTLINE
  radius /= scale_at(place);
#endif
  return vec3(place, radius);
}

float texel(int layer, int column, int row) {
  int at = layer * layer_stride + column * quads + row / 4;
  return texelFetch(map_texels, at)[row % 4];
}

// One layer, bilinear.
float layer_at(int layer, vec2 place) {
  float column = place.x < 0.0 ? place.x + map_columns : place.x;
  int left = int(column), upper = int(place.y), lower = min(upper + 1, int(map_rows) - 1);
  vec2 weight = vec2(column - float(left), place.y - float(upper));
  float value = mix(mix(texel(layer, left, upper), texel(layer, left + 1, upper), weight.x),
                    mix(texel(layer, left, lower), texel(layer, left + 1, lower), weight.x), weight.y);
#ifdef BYTES
  vec2 range = texelFetch(byte_ranges, layer).xy;
  value = range.x + range.y * value;
#endif
  return value;
}

vec2 layer_of(float radius) {
  return texelFetch(layer_table, clamp(int(radius / radius_mm * float(layer_places)), 0, layer_places - 1)).xy;
}

// Optical depth of a ray from parameter `behind` on.
float march(Ray ray, float behind) {
  vec2 range = within_bounds(ray);
  range.x = max(range.x, behind);
  int steps = min(int(ceil((range.y - range.x) / step_mm)), kMaxSteps);
  if (steps < 1) return 0.0;
  float step_ = (range.y - range.x) / float(steps), sum = 0.0;
#ifdef WALL
  // A wall is crossed where the layer changes; outside the outermost one the layer counts as `layers`.
  vec3 before = map_coordinates(ray.start_mm + range.x * ray.direction);
  int layer_before = before.z < radius_mm * 0.999 ? int(layer_of(before.z).x) : layers;
  for (int i = 1; i <= steps; ++i) {
    vec3 place = map_coordinates(ray.start_mm + (range.x + float(i) * step_) * ray.direction);
    int layer = place.z < radius_mm * 0.999 ? int(layer_of(place.z).x) : layers;
    for (int k = min(layer, layer_before); k < max(layer, layer_before); ++k) sum += layer_at(k, place.xy);
    layer_before = layer;
  }
#else
  for (int i = 0; i < steps; ++i) {
    vec3 place = map_coordinates(ray.start_mm + (range.x + (float(i) + 0.5) * step_) * ray.direction);
    if (place.z >= radius_mm) continue;
    vec2 layer = layer_of(place.z);
    float here = layer_at(int(layer.x), place.xy);
    float next = layer_at(min(int(layer.x) + 1, layers - 1), place.xy);
    sum += mix(here, next, layer.y) * step_;
  }
#endif
  return sum;
}
