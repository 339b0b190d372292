#include "xraycast/kernels/params.h"

/* Every distance below is signed, in millimetres, negative inside, and exact only near the surface: that is
 * where the coverage of a voxel depends on it. host/xraycast/phantom_scene.cpp says the same in double
 * precision.
 *
 * A work-item paints a row of 16 voxels: processors have vectors for them, and tests that hold for the whole
 * row, such as that it misses a shape, are made once. */

#define FAR_MM 1e6f
#define TINY 1e-12f

typedef float16 row;
typedef struct {
  row x, y, z;
} row3;

static float3 load3(global const float* v) { return (float3)(v[0], v[1], v[2]); }

static row3 minus(const row3 p, const float3 q) { return (row3){p.x - q.x, p.y - q.y, p.z - q.z}; }
static row3 minus_scaled(const row3 p, const row t, const float3 v) {
  return (row3){p.x - t * v.x, p.y - t * v.y, p.z - t * v.z};
}
static row along(const row3 p, const float3 axis) { return p.x * axis.x + p.y * axis.y + p.z * axis.z; }
static row squared(const row3 p) { return p.x * p.x + p.y * p.y + p.z * p.z; }

/* x^n for x >= 0; pow() must also handle signs and integers, at several times the cost. */
static row power(const row x, const float n) { return exp2(n * log2(x)); }

/* The length of (u, v), both at least 0, in the n-norm. */
static row norm_n(const row u, const row v, const float n) {
  return n == 2.0f ? sqrt(u * u + v * v) : power(power(u, n) + power(v, n), 1.0f / n);
}

/* The derivative of the n-norm by a component that is `share` of it. */
static row norm_slope(const row share, const float n) { return n == 2.0f ? share : power(share, n - 1.0f); }

/* p in the axes of a solid or a box, folded into the first octant. */
static row3 octant(global const XrcPrimitive* s, const row3 p) {
  const float3 b = load3(s->b), c = load3(s->c);
  const row3 q = minus(p, load3(s->a));
  return (row3){fabs(along(q, b)), fabs(along(q, c)), fabs(along(q, cross(b, c)))};
}

/* f = ||(||(x/a, y/b)||, z/c)|| is 1 on the surface; (f - 1) / |grad f| is the distance to first order. */
static row solid_distance(global const XrcPrimitive* s, const row3 p) {
  const row3 o = octant(s, p), q = {o.x / s->size[0], o.y / s->size[1], o.z / s->size[2]};
  const float n = s->exponents[0], m = s->exponents[1];
  const row g = max(norm_n(q.x, q.y, n), TINY), f = max(norm_n(g, q.z, m), TINY),
            slope_g = norm_slope(g / f, m);
  const row3 slope = {slope_g * norm_slope(q.x / g, n) / s->size[0],
                      slope_g * norm_slope(q.y / g, n) / s->size[1], norm_slope(q.z / f, m) / s->size[2]};
  return (f - 1.0f) / max(sqrt(squared(slope)), TINY);
}

static row box_distance(global const XrcPrimitive* s, const row3 p) {
  const row3 q = minus(octant(s, p), load3(s->size));
  const row3 outside = {max(q.x, 0.0f), max(q.y, 0.0f), max(q.z, 0.0f)};
  return sqrt(squared(outside)) + min(max(q.x, max(q.y, q.z)), 0.0f);
}

static float3 stretch(const float3 v, const float3 axis, const float factor) {
  return v + (factor - 1.0f) * dot(v, axis) * axis;
}

static row3 stretch_row(const row3 p, const float3 axis, const float factor) {
  return minus_scaled(p, (1.0f - factor) * along(p, axis), axis);
}

/* A flattened capsule is a round one in a space stretched along the flat axis. */
static row capsule_distance(global const XrcPrimitive* s, const row3 p) {
  const float3 axis = load3(s->c), a = load3(s->a);
  const float3 ab = stretch(load3(s->b) - a, axis, s->size[2]);
  const row3 ap = stretch_row(minus(p, a), axis, s->size[2]);
  const row t = clamp(along(ap, ab) / max(dot(ab, ab), TINY), 0.0f, 1.0f);
  const row3 outwards = minus_scaled(ap, t, ab);
  const row from_axis = max(sqrt(squared(outwards)), TINY);
  /* The distance in that space, over its growth rate in the volume's space. */
  const row growth = sqrt(squared(stretch_row(outwards, axis, s->size[2]))) / from_axis;
  return (from_axis - (s->size[0] + t * (s->size[1] - s->size[0]))) / max(growth, TINY);
}

static row squared_to_edge(const float3 edge, const row3 v) {
  return squared(minus_scaled(v, clamp(along(v, edge) / max(dot(edge, edge), TINY), 0.0f, 1.0f), edge));
}

static row plate_distance(global const XrcPrimitive* s, const row3 p) {
  const float3 a = load3(s->a), b = load3(s->b), c = load3(s->c), normal = cross(b - a, a - c);
  const row3 ap = minus(p, a), bp = minus(p, b), cp = minus(p, c);
  const row side = min(along(ap, cross(b - a, normal)),
                       min(along(bp, cross(c - b, normal)), along(cp, cross(a - c, normal))));
  const row to_rim =
      min(squared_to_edge(b - a, ap), min(squared_to_edge(c - b, bp), squared_to_edge(a - c, cp)));
  const row height = along(ap, normal) / length(normal);
  return sqrt(side >= 0.0f ? height * height : to_rim) - s->size[0];
}

/* As for a solid, in the section at the height of p; the slope along z is that of the section's centre and
 * axes. Flat at both ends. */
static row loft_distance(global const XrcPrimitive* s, global const XrcStation* stations, const row3 p) {
  const float last = (float)(s->count - 1), n = s->exponents[0], up = (p.z.s0 - s->a[0]) / s->a[1];
  const float beyond_end_mm = max(-up, up - last) * s->a[1], height = clamp(up, 0.0f, last);
  const int i = min((int)height, s->count - 2);
  const float t = height - (float)i;
  const XrcStation low = stations[s->first + i], high = stations[s->first + i + 1];
  const float a = mix(low.a, high.a, t), b = mix(low.b, high.b, t);
  const row x = p.x - mix(low.x, high.x, t), y = p.y - mix(low.y, high.y, t), u = fabs(x) / a,
            v = fabs(y) / b;
  const row f = max(norm_n(u, v, n), TINY);
  const row slope_x = norm_slope(u / f, n) / a, slope_y = norm_slope(v / f, n) / b;
  const row slope_z = (slope_x * (sign(x) * (high.x - low.x) + u * (high.a - low.a)) +
                       slope_y * (sign(y) * (high.y - low.y) + v * (high.b - low.b))) /
                      s->a[1];
  return max((f - 1.0f) / max(sqrt(squared((row3){slope_x, slope_y, slope_z})), TINY), beyond_end_mm);
}

/* The same for a row whose points lie at different heights: each has a section of its own. */
static row bent_loft_distance(global const XrcPrimitive* s, global const XrcStation* stations, const row3 p) {
  const float last = (float)(s->count - 1), n = s->exponents[0];
  const row up = (p.z - s->a[0]) / s->a[1], height = clamp(up, 0.0f, last);
  const row beyond_end_mm = max(-up, up - last) * s->a[1];
  const int16 station = min(convert_int16(height), s->count - 2);
  const row t = height - convert_float16(station);
  int at[16];
  float low[4][16], high[4][16];
  vstore16(s->first + station, 0, at);
  for (int i = 0; i < 16; ++i) {
    const XrcStation lower = stations[at[i]], upper = stations[at[i] + 1];
    low[0][i] = lower.x, low[1][i] = lower.y, low[2][i] = lower.a, low[3][i] = lower.b;
    high[0][i] = upper.x, high[1][i] = upper.y, high[2][i] = upper.a, high[3][i] = upper.b;
  }
  const row low_x = vload16(0, low[0]), low_y = vload16(0, low[1]), low_a = vload16(0, low[2]),
            low_b = vload16(0, low[3]);
  const row rise_x = vload16(0, high[0]) - low_x, rise_y = vload16(0, high[1]) - low_y,
            rise_a = vload16(0, high[2]) - low_a, rise_b = vload16(0, high[3]) - low_b;
  const row a = low_a + t * rise_a, b = low_b + t * rise_b;
  const row x = p.x - (low_x + t * rise_x), y = p.y - (low_y + t * rise_y), u = fabs(x) / a, v = fabs(y) / b;
  const row f = max(norm_n(u, v, n), TINY);
  const row slope_x = norm_slope(u / f, n) / a, slope_y = norm_slope(v / f, n) / b;
  const row slope_z =
      (slope_x * (sign(x) * rise_x + u * rise_a) + slope_y * (sign(y) * rise_y + v * rise_b)) / s->a[1];
  return max((f - 1.0f) / max(sqrt(squared((row3){slope_x, slope_y, slope_z})), TINY), beyond_end_mm);
}

/* `is_straight`: the points lie on a row of voxels, and not where a motion has put these. */
static row distance_to(global const XrcPrimitive* s, global const XrcStation* stations, const row3 p,
                       const bool is_straight) {
  switch (s->kind) {
    case XRC_SOLID:
      return solid_distance(s, p);
    case XRC_BOX:
      return box_distance(s, p);
    case XRC_CAPSULE:
      return capsule_distance(s, p);
    case XRC_PLATE:
      return plate_distance(s, p);
    default:
      return is_straight ? loft_distance(s, stations, p) : bent_loft_distance(s, stations, p);
  }
}

static float lowest(const row v) {
  const float8 a = min(v.lo, v.hi);
  const float4 b = min(a.lo, a.hi);
  const float2 c = min(b.lo, b.hi);
  return min(c.x, c.y);
}
static float highest(const row v) { return -lowest(-v); }

/* What lies between the corners passes the shape's box at more than `margin_mm`. */
static bool misses(global const XrcPrimitive* s, const float3 lower, const float3 upper,
                   const float margin_mm) {
  return any(upper < load3(s->lower_mm) - margin_mm) || any(lower > load3(s->upper_mm) + margin_mm);
}

/* Paints the listed shapes over `hu`, each layer by the share of the voxel that it fills. */
static row paint(row hu, global const XrcPrimitive* primitives, global const XrcStation* stations,
                 global const int* list, const int count, const row3 p, const float edge_mm,
                 const bool is_straight) {
  const float3 lower =
      is_straight ? (float3)(p.x.s0, p.y.s0, p.z.s0) : (float3)(lowest(p.x), lowest(p.y), lowest(p.z));
  const float3 upper =
      is_straight ? (float3)(p.x.sf, p.y.s0, p.z.s0) : (float3)(highest(p.x), highest(p.y), highest(p.z));
  row nearest = FAR_MM;
  for (int i = 0; i < count; ++i) {
    global const XrcPrimitive* s = primitives + list[i];
    if (!misses(s, lower, upper, edge_mm)) nearest = min(nearest, distance_to(s, stations, p, is_straight));
    if (i + 1 < count && primitives[list[i + 1]].layer == s->layer) continue;
    const row coverage = clamp(0.5f - nearest / edge_mm, 0.0f, 1.0f);
    hu += coverage * (s->is_additive ? s->hu : s->hu - hu);
    nearest = FAR_MM;
  }
  return hu;
}

/* Chris Wellons' lowbias32. */
static uint16 hash(uint16 h) {
  h = (h ^ (h >> 16)) * 0x7feb352du;
  h = (h ^ (h >> 15)) * 0x846ca68bu;
  return h ^ (h >> 16);
}

/* Nearly Gaussian with unit deviation: the sum of four random bytes. Integers up to the last step, so that
 * every device draws the same number for a voxel. */
static row noise(const uint16 x, const uint y, const uint z, const uint seed) {
  const uint16 h = hash(x + hash(y + hash(z + hash(seed))));
  const uint16 sum = (h & 255u) + (h >> 8 & 255u) + (h >> 16 & 255u) + (h >> 24);
  return (convert_float16(sum) - 510.0f) * (1.0f / 147.8f);
}

static void store(const short16 voxels, const int count, global short* out) {
  if (count >= 16) {
    vstore16(voxels, 0, out);
    return;
  }
  short cut[16];
  vstore16(voxels, 0, cut);
  for (int i = 0; i < count; ++i) out[i] = cut[i];
}

static void store_noisy(const row hu, const XrcPhantomSlab slab, const int x, const int y, const int z,
                        global short* out) {
  const int16 xs = x + (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const row noisy =
      hu + slab.noise_hu * noise(convert_uint16(xs), (uint)y, (uint)(slab.first_slice + z), (uint)slab.seed);
  store(convert_short16_sat_rte(clamp(noisy, -1024.0f, 32767.0f)), slab.size[0] - x,
        out + ((size_t)z * slab.size[1] + y) * slab.size[0] + x);
}

/* Brick i of the slab starts from base_hu[i] and paints list[first[i]] to list[first[i + 1] - 1] over it. */
kernel void phantom_slab(const XrcPhantomSlab slab, global const XrcPrimitive* primitives,
                         global const XrcStation* stations, global const float* base_hu,
                         global const int* first, global const int* list, global short* out) {
  const int column = (int)get_global_id(0), y = (int)get_global_id(1), z = (int)get_global_id(2);
  if (column >= slab.bricks_x || y >= slab.size[1] || z >= slab.size[2]) return;
  const int brick = y / XRC_PHANTOM_BRICK * slab.bricks_x + column, x = column * XRC_PHANTOM_BRICK;
  const int16 xs = x + (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const row3 p = {slab.origin_mm[0] + slab.spacing_mm[0] * convert_float16(xs),
                  slab.origin_mm[1] + slab.spacing_mm[1] * (float)y,
                  slab.origin_mm[2] + slab.spacing_mm[2] * (float)(slab.first_slice + z)};
  const row hu = paint(base_hu[brick], primitives, stations, list + first[brick],
                       first[brick + 1] - first[brick], p, slab.edge_mm, true);
  store_noisy(hu, slab, x, y, z, out);
}

/* The same for voxels that show other places: those of each row of a brick are 16 x, 16 y and 16 z. */
kernel void phantom_slab_moved(const XrcPhantomSlab slab, global const XrcPrimitive* primitives,
                               global const XrcStation* stations, global const float* base_hu,
                               global const int* first, global const int* list, global const float* places_mm,
                               global short* out) {
  const int column = (int)get_global_id(0), y = (int)get_global_id(1), z = (int)get_global_id(2);
  if (column >= slab.bricks_x || y >= slab.size[1] || z >= slab.size[2]) return;
  const int brick = y / XRC_PHANTOM_BRICK * slab.bricks_x + column;
  global const float* at = places_mm + (((size_t)z * slab.size[1] + y) * slab.bricks_x + column) * 48;
  const row3 p = {vload16(0, at), vload16(1, at), vload16(2, at)};
  const row hu = paint(base_hu[brick], primitives, stations, list + first[brick],
                       first[brick + 1] - first[brick], p, slab.edge_mm, false);
  store_noisy(hu, slab, column * XRC_PHANTOM_BRICK, y, z, out);
}
