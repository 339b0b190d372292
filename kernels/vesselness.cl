/* Filters of a block of a scan, x fastest: separable Gaussians, tubularity from the Hessian, and ridge
 * strength from oriented line integrals. Beyond the block its border is replicated. */

static int clamped(const int i, const int size) { return clamp(i, 0, size - 1); }

/* One axis of a Gaussian at one voxel: `at` is its place along that axis, which is `length` voxels long. */
static float gaussian_at(global const float* source, const int here, const int at, const int length,
                         const int stride, constant float* weights, const int reach) {
  const int first = here - at * stride;
  float sum = weights[0] * source[here];
  for (int k = 1; k <= reach; ++k)
    sum += weights[k] * (source[first + clamped(at - k, length) * stride] +
                         source[first + clamped(at + k, length) * stride]);
  return sum;
}

/* One axis of a Gaussian, for eight voxels along x. Weights are of distances 0 to reach and add up, both
 * sides together, to 1. */
kernel void gaussian(global const float* source, global float* target, const int4 size, const int axis,
                     constant float* weights, const int reach) {
  const int x = 8 * (int)get_global_id(0), y = (int)get_global_id(1), z = (int)get_global_id(2);
  if (x >= size.x || y >= size.y || z >= size.z) return;
  const int stride = axis == 0 ? 1 : axis == 1 ? size.x : size.x * size.y;
  const int at = axis == 0 ? x : axis == 1 ? y : z, length = axis == 0 ? size.x : axis == 1 ? size.y : size.z;
  const int here = (z * size.y + y) * size.x + x, count = min(size.x - x, 8);
  if (count < 8 || (axis == 0 && (x < reach || x + 8 + reach > length))) {
    for (int i = 0; i < count; ++i)
      target[here + i] =
          gaussian_at(source, here + i, axis == 0 ? at + i : at, length, stride, weights, reach);
    return;
  }
  float8 sum = weights[0] * vload8(0, source + here);
  for (int k = 1; k <= reach; ++k) {
    const int below = axis == 0 ? k : (at - clamped(at - k, length)) * stride,
              above = axis == 0 ? k : (clamped(at + k, length) - at) * stride;
    sum += weights[k] * (vload8(0, source + here - below) + vload8(0, source + here + above));
  }
  vstore8(sum, 0, target + here);
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

/* A block with a margin of `margin` voxels before it and as many or more behind, in which its border is
 * replicated; `size` is that of the block, `padded` that of the target. */
kernel void with_margin(global const float* source, global float* target, const int4 size, const int4 padded,
                        const int margin) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1), z = (int)get_global_id(2);
  if (x >= padded.x || y >= padded.y || z >= padded.z) return;
  const int from_x = clamped(x - margin, size.x), from_y = clamped(y - margin, size.y),
            from_z = clamped(z - margin, size.z);
  target[(z * padded.y + y) * padded.x + x] = source[(from_z * size.y + from_y) * size.x + from_x];
}

/* The largest of each of eight voxels and its neighbours. */
static float8 largest_around(global const float* v, const int row, const int slice) {
  float8 largest = vload8(0, v);
  for (int k = 0; k < 27; ++k)
    largest = fmax(largest, vload8(0, v + (k / 9 - 1) * slice + (k / 3 % 3 - 1) * row + k % 3 - 1));
  return largest;
}

/* Trilinear samples at the same place between voxels beside each of eight; `v` is the corner before it. */
static float8 sample(global const float* v, const int row, const int slice, const float4 fraction) {
  const float8 a = vload8(0, v), b = vload8(0, v + row), c = vload8(0, v + slice),
               d = vload8(0, v + slice + row);
  const float8 low = a + fraction.x * (vload8(0, v + 1) - a),
               next = b + fraction.x * (vload8(0, v + row + 1) - b),
               high = c + fraction.x * (vload8(0, v + slice + 1) - c),
               last = d + fraction.x * (vload8(0, v + slice + row + 1) - d);
  const float8 below = low + fraction.y * (next - low), above = high + fraction.y * (last - high);
  return below + fraction.z * (above - below);
}

/* Ridge strength of eight voxels along x: the largest line integral through each. Of each direction the
 * weaker of its two arms' weighted means counts, so that a bright structure on one side only is no ridge.
 * Steps are one voxel long: those of each direction's one arm, then those of its other one, with the corner
 * before each in voxels and the place between corners. Weights are of distances 0 to reach; both arms
 * together add up to 1. `source` has a margin of `reach` + 1 voxels, and of 8 more behind x; `padded` is its
 * size. Where a voxel and its neighbours are below `least`, the strength is 0. */
kernel void ridge_strength(global const float* source, global float* target, const int4 size,
                           const int4 padded, constant int4* corners, constant float4* fractions,
                           const int directions, constant float* weights, const int reach,
                           const float least) {
  const int x = 8 * (int)get_global_id(0), y = (int)get_global_id(1), z = (int)get_global_id(2);
  if (x >= size.x || y >= size.y || z >= size.z) return;
  const int margin = reach + 1, row = padded.x, slice = padded.x * padded.y;
  global const float* here = source + (z + margin) * slice + (y + margin) * row + x + margin;
  const float8 around = largest_around(here, row, slice);
  float8 best = -FLT_MAX;
  if (any(around >= least)) {
    for (int d = 0; d < directions; ++d) {
      float8 forwards = 0, backwards = 0;
      for (int k = 1; k <= reach; ++k) {
        const int i = 2 * d * reach + k - 1, j = i + reach;
        forwards += weights[k] * sample(here + corners[i].z * slice + corners[i].y * row + corners[i].x, row,
                                        slice, fractions[i]);
        backwards += weights[k] * sample(here + corners[j].z * slice + corners[j].y * row + corners[j].x, row,
                                         slice, fractions[j]);
      }
      best = fmax(best, fmin(forwards, backwards));
    }
  }
  const float8 strength = select((float8)(0), weights[0] * vload8(0, here) + 2 * best, around >= least);
  const int at = (z * size.y + y) * size.x + x;
  if (x + 8 <= size.x) {
    vstore8(strength, 0, target + at);
  } else {
    float values[8];
    vstore8(strength, 0, values);
    for (int i = 0; i < size.x - x; ++i) target[at + i] = values[i];
  }
}
