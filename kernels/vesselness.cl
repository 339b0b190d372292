/* Filters of a block of a scan, x fastest: separable Gaussians, tubularity from the Hessian, and means along
 * lines. Beyond the block its border goes on. */

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

/* Eigenvalues of a symmetric 3 x 3 matrix by the trigonometric solution (Smith 1961), then in the order of
 * their magnitudes. */
static float3 eigenvalues(const float xx, const float yy, const float zz, const float xy, const float xz,
                          const float yz) {
  const float off = xy * xy + xz * xz + yz * yz, mean = (xx + yy + zz) / 3;
  const float dx = xx - mean, dy = yy - mean, dz = zz - mean;
  const float p = sqrt((dx * dx + dy * dy + dz * dz + 2 * off) / 6);
  if (p < 1e-6f) return (float3)(mean, mean, mean);
  const float det = dx * (dy * dz - yz * yz) - xy * (xy * dz - yz * xz) + xz * (xy * yz - dy * xz);
  const float angle = acos(clamp(det / (2 * p * p * p), -1.0f, 1.0f)) / 3;
  float a = mean + 2 * p * cos(angle), c = mean + 2 * p * cos(angle + 2.0943951f), b = 3 * mean - a - c, t;
  if (fabs(a) > fabs(b)) {
    t = a;
    a = b;
    b = t;
  }
  if (fabs(b) > fabs(c)) {
    t = b;
    b = c;
    c = t;
  }
  if (fabs(a) > fabs(b)) {
    t = a;
    a = b;
    b = t;
  }
  return (float3)(a, b, c);
}

/* Frangi 1998, equation 13, for bright tubes; alpha = beta = 0.5. `strength` is half the structureness of a
 * tube. */
static float frangi(const float3 l, const float strength) {
  if (l.y >= 0 || l.z >= 0) return 0;
  const float plate = l.y / l.z, blob2 = l.x * l.x / (l.y * l.z);
  const float norm2 = l.x * l.x + l.y * l.y + l.z * l.z;
  return (1 - exp(-2 * plate * plate)) * exp(-2 * blob2) * (1 - exp(-norm2 / (2 * strength * strength)));
}

/* Jerman 2016, equations 13 and 14, for bright tubes. `strength` is the least that counts as a tube. */
static float jerman(const float3 l, const float strength) {
  const float second = -l.y, third = max(-l.z, strength);
  if (second <= 0 || l.z >= 0) return 0;
  if (second >= 0.5f * third) return 1;
  const float ratio = 3 / (second + third);
  return second * second * (third - second) * ratio * ratio * ratio;
}

/* The larger of what there is and of the tubularity at one scale. `smoothed` is the block at that scale;
 * `per_mm2` is scale^2 over the squares and products of the spacings: xx, yy, zz, xy, xz, yz. */
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

/* The largest of the weighted means along straight lines through a voxel, one for each direction; a step is
 * one voxel. */
kernel void line_mean(global const float* source, global float* target, const int4 size,
                      constant float4* directions, const int count, constant float* weights,
                      const int reach) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1), z = (int)get_global_id(2);
  if (x >= size.x || y >= size.y || z >= size.z) return;
  const float3 here = (float3)(x, y, z);
  const float centre = weights[0] * source[(z * size.y + y) * size.x + x];
  float best = -FLT_MAX;
  for (int d = 0; d < count; ++d) {
    const float3 step = directions[d].xyz;
    float sum = centre;
    for (int k = 1; k <= reach; ++k)
      sum += weights[k] * (sample(source, size, here - k * step) + sample(source, size, here + k * step));
    best = max(best, sum);
  }
  target[(z * size.y + y) * size.x + x] = best;
}
