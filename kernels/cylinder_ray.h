/* The rays of a cylinder map: one sample grid for all kernels that follow them. */
#ifndef XRAYCAST_CYLINDER_RAY_H
#define XRAYCAST_CYLINDER_RAY_H

#include "displaced.h"
#include "rays.h"
#include "scan_access.h"

/* The rays differ only in the number of SLICES per work-item, which the program is built with: the 16 of a
 * brick for a processor's vectors, two for a GPU, or one where the centre or the outline differs from slice
 * to slice. */
#ifndef SLICES
#define SLICES XRC_BRICK_SLICES
#endif

#if SLICES == 1

#define mu_of_slices mu_of
typedef float Slices;

INLINE Slices slices_at(SCAN pixel) { return (float)*pixel; }

static void store(const Slices value, float* values) { *values = value; }

#elif SLICES == 2

#define mu_of_slices mu_of2
typedef float2 Slices;

INLINE Slices slices_at(SCAN pixel) { return convert_float2(*(global const short2*)pixel); }

static void store(const Slices value, float* values) { vstore2(value, 0, values); }

#else

#define mu_of_slices mu_of16
typedef float16 Slices;

INLINE Slices slices_at(SCAN pixel) { return convert_float16(vload16(0, pixel)); }

static void store(const Slices value, float* values) { vstore16(value, 0, values); }

#endif

/* Where run `run` of SLICES slices begins in the scan's first pixel of their brick. */
INLINE SCAN first_of_run(SCAN voxels, const XrcScan* scan, const int run) {
  const int slice = run * SLICES;
  return voxels + brick_pixel(scan, slice / XRC_BRICK_SLICES, 0, 0) * XRC_BRICK_SLICES +
         slice % XRC_BRICK_SLICES;
}

/* Between two pixels of a row and the two below them. */
INLINE Slices bilinear(SCAN upper, SCAN lower, const float fx, const float fy) {
  const Slices a = slices_at(upper), b = slices_at(upper + XRC_BRICK_SLICES);
  const Slices c = slices_at(lower), d = slices_at(lower + XRC_BRICK_SLICES);
  const Slices ab = fma((Slices)fx, b - a, a), cd = fma((Slices)fx, d - c, c);
  return fma((Slices)fy, cd - ab, ab);
}

/* Position (x, y), between voxels' centres of a run, interpolated bilinearly. */
INLINE Slices sample(SCAN voxels, const XrcScan* scan, const int run, const float x, const float y) {
  const int ix = (int)x, iy = (int)y;
  SCAN upper = first_of_run(voxels, scan, run) + (long)(iy * scan->pitch_x + ix) * XRC_BRICK_SLICES;
  return bilinear(upper, upper + (long)scan->pitch_x * XRC_BRICK_SLICES, x - (float)ix, y - (float)iy);
}

#if defined(MOVED) && SLICES == 16

/* How far from each slice of a brick lies what it shows of the moved scan, in voxels; z from the brick's
 * lowest slice on. */
typedef struct {
  float16 x, y, z;
  int is_moved;
} Offsets;

static Offsets offsets_at(const XrcField* field, global const float4* nodes, const int brick, const float x,
                          const float y) {
  const NodePlace nx = node_place(x * field->nodes_per_voxel[0], field->size_x),
                  ny = node_place(y * field->nodes_per_voxel[1], field->size_y);
  float4 levels[XRC_BRICK_SLICES / MOVED + 1];
  float4 longest = 0.0f;
  for (int i = 0; i <= XRC_BRICK_SLICES / MOVED; ++i) {
    levels[i] = displacement_in(field, nodes, nx, ny, brick * (XRC_BRICK_SLICES / MOVED) + i);
    longest = fmax(longest, fabs(levels[i]));
  }
  float offset_x[XRC_BRICK_SLICES], offset_y[XRC_BRICK_SLICES], offset_z[XRC_BRICK_SLICES];
  for (int s = 0; s < XRC_BRICK_SLICES; ++s) {
    const float4 offset = mix(levels[s / MOVED], levels[s / MOVED + 1], (float)(s % MOVED) * (1.0f / MOVED));
    offset_x[s] = offset.x;
    offset_y[s] = offset.y;
    offset_z[s] = offset.z + (float)s;
  }
  Offsets offsets;
  offsets.x = vload16(0, offset_x);
  offsets.y = vload16(0, offset_y);
  offsets.z = vload16(0, offset_z);
  offsets.is_moved = longest.x + longest.y + longest.z > 0.0f;
  return offsets;
}

/* Position (x, y), between voxels' centres of a brick, of the moved scan: each slice shows what lies at a
 * place of its own, a share of the way from one offset to the other. */
static Slices displaced_sample(SCAN voxels, const XrcScan* scan, const int brick, const float x,
                               const float y, const Offsets* from, const Offsets* to, const float share) {
  if (!from->is_moved && !to->is_moved) return sample(voxels, scan, brick, x, y);
  const float last_x = (float)(scan->size_x - 1), last_y = (float)(scan->size_y - 1),
              last_z = (float)(scan->size_z - 1);
  const float16 at_x = x + mix(from->x, to->x, share), at_y = y + mix(from->y, to->y, share),
                at_z = (float)(brick * XRC_BRICK_SLICES) + mix(from->z, to->z, share);
  const int16 is_within = at_x >= -0.5f && at_x <= last_x + 0.5f && at_y >= -0.5f && at_y <= last_y + 0.5f &&
                          at_z >= -0.5f && at_z <= last_z + 0.5f;
  const float16 held_x = clamp(at_x, 0.0f, last_x), held_y = clamp(at_y, 0.0f, last_y),
                held_z = clamp(at_z, 0.0f, last_z);
  const int16 first_x = convert_int16(held_x), first_y = convert_int16(held_y),
              first_z = convert_int16(held_z);

  int px[XRC_BRICK_SLICES], py[XRC_BRICK_SLICES], pz[XRC_BRICK_SLICES];
  vstore16(first_x, 0, px);
  vstore16(first_y, 0, py);
  vstore16(first_z, 0, pz);
  /* The eight voxels around each place: right, below and above it. */
  short at[8][XRC_BRICK_SLICES];
  const long below = (long)scan->pitch_x * XRC_BRICK_SLICES,
             next_brick = (long)scan->pitch_y * below - (XRC_BRICK_SLICES - 1);
  for (int s = 0; s < XRC_BRICK_SLICES; ++s) {
    SCAN lower = voxels + brick_pixel(scan, pz[s] / XRC_BRICK_SLICES, px[s], py[s]) * XRC_BRICK_SLICES +
                 pz[s] % XRC_BRICK_SLICES;
    SCAN upper = lower + (pz[s] + 1 >= scan->size_z                          ? 0
                          : pz[s] % XRC_BRICK_SLICES == XRC_BRICK_SLICES - 1 ? next_brick
                                                                             : 1);
    at[0][s] = lower[0];
    at[1][s] = lower[XRC_BRICK_SLICES];
    at[2][s] = lower[below];
    at[3][s] = lower[below + XRC_BRICK_SLICES];
    at[4][s] = upper[0];
    at[5][s] = upper[XRC_BRICK_SLICES];
    at[6][s] = upper[below];
    at[7][s] = upper[below + XRC_BRICK_SLICES];
  }
#define HU(i) convert_float16(vload16(0, at[i]))
  const float16 fx = held_x - convert_float16(first_x), fy = held_y - convert_float16(first_y),
                fz = held_z - convert_float16(first_z);
  const float16 lower = mix(mix(HU(0), HU(1), fx), mix(HU(2), HU(3), fx), fy),
                upper = mix(mix(HU(4), HU(5), fx), mix(HU(6), HU(7), fx), fy);
#undef HU
  return select((float16)XRC_PADDING_HU, mix(lower, upper, fz), is_within);
}

#endif

/* In voxels, through run `run` of SLICES slices. The first `inside` samples lie within the slice; those
 * beyond are air. */
typedef struct {
  float2 centre;
  float dx, dy;
  int inside, run;
#ifdef MOVED
  const XrcField* field;
  global const float4* nodes;
#endif
} Ray;

/* The ray from `centre` at the angle whose sine and cosine are `direction`. */
static Ray ray_along(const float2 centre, const float2 direction, const int run, const XrcCylinder* cylinder,
                     const XrcScan* scan MOVED_POINTERS) {
  const int samples = cylinder->map.samples;
  Ray ray;
  ray.centre = centre;
  ray.dx = direction.x * cylinder->step_x;
  ray.dy = -direction.y * cylinder->step_y;
  ray.inside = min(samples_within(centre.x, ray.dx, scan->size_x, samples),
                   samples_within(centre.y, ray.dy, scan->size_y, samples));
  ray.run = run;
#ifdef MOVED
  ray.field = field;
  ray.nodes = nodes;
#endif
  return ray;
}

/* Where sample i lies, held at the border voxels' centres. */
static float2 place_along(const XrcScan* scan, const Ray* ray, const int i) {
  const float at = (float)i + 0.5f;
  return clamp(fma((float2)(at), (float2)(ray->dx, ray->dy), ray->centre), 0.0f,
               (float2)((float)(scan->size_x - 1), (float)(scan->size_y - 1)));
}

#if defined(MOVED) && SLICES == 16

/* Displacements are looked up at every eighth sample, and linear between. */
#define OFFSETS_STEP 8

static Offsets offsets_along(const XrcScan* scan, const Ray* ray, const int i) {
  const float2 at = place_along(scan, ray, i);
  return offsets_at(ray->field, ray->nodes, ray->run, at.x, at.y);
}

/* HU of sample i < inside, between the offsets of the samples before and behind it. */
static Slices hu_between(SCAN voxels, const XrcScan* scan, const Ray* ray, const int i, const Offsets* from,
                         const Offsets* to) {
  const float2 at = place_along(scan, ray, i);
  return displaced_sample(voxels, scan, ray->run, at.x, at.y, from, to,
                          (float)(i % OFFSETS_STEP) * (1.0f / OFFSETS_STEP));
}

#endif

/* HU of sample i < inside. */
static Slices hu_along(SCAN voxels, const XrcScan* scan, const Ray* ray, const int i) {
#if defined(MOVED) && SLICES == 16
  const Offsets from = offsets_along(scan, ray, i - i % OFFSETS_STEP),
                to = offsets_along(scan, ray, i - i % OFFSETS_STEP + OFFSETS_STEP);
  return hu_between(voxels, scan, ray, i, &from, &to);
#elif defined(MOVED)
  const float2 at = place_along(scan, ray, i);
  float hu[SLICES];
  for (int s = 0; s < SLICES; ++s)
    hu[s] = displaced_hu(voxels, scan, ray->field, ray->nodes,
                         (float3)(at.x, at.y, (float)min(ray->run * SLICES + s, scan->size_z - 1)));
  return *(const Slices*)hu;
#else
  const float2 at = place_along(scan, ray, i);
  return sample(voxels, scan, ray->run, at.x, at.y);
#endif
}

#endif
