/* Filters of a block of a scan, x fastest: separable Gaussians, tubularity from the Hessian, and ridge
 * strength from oriented line integrals. Beyond the block its border is replicated. */

static int clamped(const int i, const int size) { return clamp(i, 0, size - 1); }

/* One axis of a Gaussian: `stride` is that axis's. Weights are of distances 0 to reach and add up, both sides
 * together, to 1. */
kernel void gaussian(global const float* source, global float* target, const int4 size, const int axis,
                     constant float* weights, const int reach) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1), z = (int)get_global_id(2);
  if (x >= size.x || y >= size.y || z >= size.z) return;
  const int stride = axis == 0 ? 1 : axis == 1 ? size.x : size.x * size.y;
  const int at = axis == 0 ? x : axis == 1 ? y : z, length = axis == 0 ? size.x : axis == 1 ? size.y : size.z;
  const int here = (z * size.y + y) * size.x + x, first = here - at * stride;
  float sum = weights[0] * source[here];
  if (at >= reach && at + reach < length) {
    for (int k = 1; k <= reach; ++k)
      sum += weights[k] * (source[here - k * stride] + source[here + k * stride]);
  } else {
    for (int k = 1; k <= reach; ++k)
      sum += weights[k] * (source[first + clamped(at - k, length) * stride] +
                           source[first + clamped(at + k, length) * stride]);
  }
  target[here] = sum;
}

/* acos by Hastings (Approximations for Digital Computers, 1955, sheet 37), to 7e-5. */
static float arc_cosine(const float x) {
  const float m = fabs(x),
              r = sqrt(1 - m) * (1.5707288f + m * (-0.2121144f + m * (0.0742610f - 0.0187293f * m)));
  return x < 0 ? 3.1415927f - r : r;
}

/* cos from 0 to pi/3, by its series, to 3e-6. */
static float cosine(const float x) {
  const float q = x * x;
  return 1 + q * (-0.5f + q * (4.1666668e-2f + q * (-1.3888889e-3f + q * 2.4801587e-5f)));
}

/* Eigenvalues of a symmetric 3 x 3 matrix by the trigonometric solution (Smith 1961), then in the order of
 * their magnitudes. No branches, here and below, so that many voxels are computed at once. */
static float3 eigenvalues(const float xx, const float yy, const float zz, const float xy, const float xz,
                          const float yz) {
  const float off = xy * xy + xz * xz + yz * yz, mean = (xx + yy + zz) / 3;
  const float dx = xx - mean, dy = yy - mean, dz = zz - mean;
  const float p = fmax(sqrt((dx * dx + dy * dy + dz * dz + 2 * off) / 6), 1e-6f);
  const float det = dx * (dy * dz - yz * yz) - xy * (xy * dz - yz * xz) + xz * (xy * yz - dy * xz);
  const float angle = arc_cosine(clamp(det / (2 * p * p * p), -1.0f, 1.0f)) / 3;
  /* The angle is 0 to pi/3: the largest, the smallest, and what is left of the sum. */
  const float c = cosine(angle), s = sqrt(fmax(1 - c * c, 0.0f));
  const float high = mean + 2 * p * c, low = mean - p * (c + 1.7320508f * s), middle = 3 * mean - high - low;
  const float a = fabs(high) < fabs(low) ? high : low, z = fabs(high) < fabs(low) ? low : high;
  const float x = fabs(a) < fabs(middle) ? a : middle, y = fabs(a) < fabs(middle) ? middle : a;
  return (float3)(x, fabs(y) < fabs(z) ? y : z, fabs(y) < fabs(z) ? z : y);
}

/* Frangi 1998, equation 13, for bright tubes; alpha = beta = 0.5. `strength` is half the structureness of a
 * tube. */
static float frangi(const float3 l, const float strength) {
  const float is_bright = l.y < 0 && l.z < 0 ? 1.0f : 0.0f, z = fmin(l.z, -1e-6f), y = fmin(l.y, -1e-6f);
  const float plate = y / z, blob2 = l.x * l.x / (y * z);
  const float norm2 = l.x * l.x + l.y * l.y + l.z * l.z;
  return is_bright * (1 - exp(-2 * plate * plate)) * exp(-2 * blob2) *
         (1 - exp(-norm2 / (2 * strength * strength)));
}

/* Jerman 2016, equations 13 and 14, for bright tubes. `strength` is the least that counts as a tube. */
static float jerman(const float3 l, const float strength) {
  const float second = fmax(-l.y, 0.0f), third = fmax(-l.z, strength), ratio = 3 / (second + third);
  const float partly = second * second * (third - second) * ratio * ratio * ratio;
  return l.z >= 0 ? 0.0f : second >= 0.5f * third ? 1.0f : partly;
}

/* Maximum projection over scales: the larger of `best` and of the tubularity at one scale. `smoothed` is the
 * block at that scale; `per_mm2` is scale^2 over the squares and products of the spacings: xx, yy, zz, xy,
 * xz, yz. */
kernel void tubularity(global const float* smoothed, global float* best, const int4 size,
                       constant float* per_mm2, const float strength, const int is_frangi) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1), z = (int)get_global_id(2);
  if (x >= size.x || y >= size.y || z >= size.z) return;
  const int west = x > 0 ? -1 : 0, east = x + 1 < size.x ? 1 : 0;
  const int north = y > 0 ? -size.x : 0, south = y + 1 < size.y ? size.x : 0;
  const int slice = size.x * size.y, below = z > 0 ? -slice : 0, above = z + 1 < size.z ? slice : 0;
  const int here = z * slice + y * size.x + x;
  global const float* v = smoothed + here;
  const float xx = (v[west] + v[east] - 2 * v[0]) * per_mm2[0],
              yy = (v[north] + v[south] - 2 * v[0]) * per_mm2[1],
              zz = (v[below] + v[above] - 2 * v[0]) * per_mm2[2];
  const float xy =
      0.25f * (v[west + north] + v[east + south] - v[west + south] - v[east + north]) * per_mm2[3];
  const float xz =
      0.25f * (v[west + below] + v[east + above] - v[west + above] - v[east + below]) * per_mm2[4];
  const float yz =
      0.25f * (v[north + below] + v[south + above] - v[north + above] - v[south + below]) * per_mm2[5];
  const float3 l = eigenvalues(xx, yy, zz, xy, xz, yz);
  best[here] = max(best[here], is_frangi ? frangi(l, strength) : jerman(l, strength));
}

static float sample(global const float* v, const int4 size, const float3 p) {
  const float3 q = clamp(p, (float3)(0, 0, 0), (float3)(size.x - 1, size.y - 1, size.z - 1));
  const int x = min((int)q.x, max(size.x - 2, 0)), y = min((int)q.y, max(size.y - 2, 0)),
            z = min((int)q.z, max(size.z - 2, 0));
  const float fx = q.x - x, fy = q.y - y, fz = q.z - z;
  const int dx = size.x > 1, dy = size.y > 1 ? size.x : 0, dz = size.z > 1 ? size.x * size.y : 0;
  global const float* a = v + (z * size.y + y) * size.x + x;
  const float low = mix(mix(a[0], a[dx], fx), mix(a[dy], a[dy + dx], fx), fy);
  const float high = mix(mix(a[dz], a[dz + dx], fx), mix(a[dz + dy], a[dz + dy + dx], fx), fy);
  return mix(low, high, fz);
}

/* Ridge strength: the largest line integral through each voxel. Of each direction the weaker of its two arms'
 * weighted means counts, so that a bright structure on one side only is no ridge; a step is one voxel.
 * Weights are of distances 0 to reach; both arms together add up to 1. Where a voxel and its neighbours are
 * below `least`, no line is tried, and the strength is 0. */
kernel void ridge_strength(global const float* source, global float* target, const int4 size,
                           constant float4* directions, const int count, constant float* weights,
                           const int reach, const float least) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1), z = (int)get_global_id(2);
  if (x >= size.x || y >= size.y || z >= size.z) return;
  float around = -FLT_MAX;
  for (int k = 0; k < 27; ++k) {
    const int i = clamped(x + k % 3 - 1, size.x), j = clamped(y + k / 3 % 3 - 1, size.y),
              l = clamped(z + k / 9 - 1, size.z);
    around = max(around, source[(l * size.y + j) * size.x + i]);
  }
  if (around < least) {
    target[(z * size.y + y) * size.x + x] = 0;
    return;
  }
  const float3 here = (float3)(x, y, z);
  const float centre = weights[0] * source[(z * size.y + y) * size.x + x];
  float best = -FLT_MAX;
  for (int d = 0; d < count; ++d) {
    const float3 step = directions[d].xyz;
    float forwards = 0, backwards = 0;
    for (int k = 1; k <= reach; ++k) {
      forwards += weights[k] * sample(source, size, here + k * step);
      backwards += weights[k] * sample(source, size, here - k * step);
    }
    best = max(best, centre + 2 * min(forwards, backwards));
  }
  target[(z * size.y + y) * size.x + x] = best;
}
