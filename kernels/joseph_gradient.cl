#include "classify.h"
#include "joseph_ray.h"
#include "joseph_rows.h"
#include "scan_access.h"
#include "xraycast/kernels/params.h"

/* How the sum of `joseph` changes when source and detector move like a rigid body: its derivative by their
 * translation in mm and by their rotation in rad about a point, both along the axes of the world.
 *
 * A point of the ray that belongs to a plane of voxels moves with the velocity V of the body there, and along
 * the ray back into its plane. Whatever changes by `slope * V` changes by `slope` per mm of translation, and
 * by cross(point - centre, slope) per rad. */

#define RAY_ENDS -1 /* what cuts a ray off, if not the scan's faces across an axis */

static inline float mu_slope_of(const float hu, constant const XrcOpacity* opacity,
                                global const float2* table) {
#if RAMPS > 0
  (void)table;
  float slope = 0.0f;
  for (int i = 0; i < RAMPS; ++i) slope += hu > opacity->from[i] ? opacity->slope[i] : 0.0f;
  return slope;
#else
  const float at = hu - opacity->first_hu;
  return at > 0.0f && at < (float)(opacity->entries - 1) ? table[(int)at].y : 0.0f;
#endif
}

/* A vector of that component along `axis` and of the other two, in ascending order of axis. */
static inline float3 along_axes(const int axis, const float across, const float u, const float v) {
  return axis == 0 ? (float3)(across, u, v) : axis == 1 ? (float3)(u, across, v) : (float3)(u, v, across);
}

/* CT number at (u, v) in plane k across `axis`, and its changes along the other two axes per voxel: HU, by u,
 * by v. Beyond the voxels' centres it does not change. */
static inline float3 sample_slopes(SCAN voxels, const XrcScan* scan, const int axis, const int k,
                                   const float u, const float v) {
  const PlaneCell cell = plane_cell(voxels, scan, axis, k, u, v);
  const int last_u = (axis == 0 ? scan->size_y : scan->size_x) - 1;
  const int last_v = (axis == 2 ? scan->size_y : scan->size_z) - 1;
  const float below = mix(cell.hu[0], cell.hu[1], cell.along_u),
              above = mix(cell.hu[2], cell.hu[3], cell.along_u);
  const float by_u = u >= 0.0f && u <= (float)last_u
                         ? mix(cell.hu[1] - cell.hu[0], cell.hu[3] - cell.hu[2], cell.along_v)
                         : 0.0f;
  const float by_v = v >= 0.0f && v <= (float)last_v ? above - below : 0.0f;
  return (float3)(interpolated_hu(&cell), by_u, by_v);
}

/* A ray over the number of the plane across its dominant axis, and where it is cut off, by what. */
typedef struct {
  int axis;
  float3 at_0, per_plane; /* voxels */
  float low, high;
  int low_by, high_by;
} Line;

/* To the faces of `size` voxels across an axis. */
static inline void clip_line(Line* line, const int by, const int size) {
  const float low = line->low, high = line->high;
  const int is_own = line->axis == by;
  clip(&line->low, &line->high, is_own ? 0.0f : component(line->at_0, by),
       is_own ? 1.0f : component(line->per_plane, by), -0.5f, size - 0.5f);
  if (line->low != low) line->low_by = by;
  if (line->high != high) line->high_by = by;
}

/* 0 for a ray that misses the scan. */
static inline int prepare_line(Line* line, const XrcScan* scan, const float3 start, const float3 end) {
  const float3 along = end - start;
  line->axis = dominant_axis(along);
  const float planes = component(along, line->axis), origin = component(start, line->axis);
  if (!(fabs(planes) > 0.0f)) return 0;
  line->per_plane = along / planes;
  line->at_0 = start - origin * line->per_plane;
  line->low = fmin(origin, origin + planes);
  line->high = fmax(origin, origin + planes);
  line->low_by = line->high_by = RAY_ENDS;
  clip_line(line, 0, scan->size_x);
  clip_line(line, 1, scan->size_y);
  clip_line(line, 2, scan->size_z);
  return line->low < line->high;
}

/* Derivatives by translation and rotation. */
typedef struct {
  float3 by_mm, by_rad;
} Motion;

static inline void add(Motion* sum, const float weight, const float3 slope, const float3 from_centre_mm) {
  sum->by_mm += weight * slope;
  sum->by_rad += weight * cross(from_centre_mm, slope);
}

/* How far an end of the counted planes moves per mm, in planes, where `by` cuts the ray off. */
static inline float3 end_slope(const Line* line, const int by, const float3 spacing_mm) {
  const float3 own = along_axes(line->axis, 1.0f, 0.0f, 0.0f) / spacing_mm;
  if (by == RAY_ENDS) return own;
  if (by == line->axis) return (float3)(0.0f);
  const float3 face = (float3)(by == 0, by == 1, by == 2) / spacing_mm;
  return own - face / component(line->per_plane, by);
}

/* The sum over the planes, in planes, and its derivatives. */
static inline float sum_and_motion(SCAN voxels, const XrcScan* scan, const Line* line,
                                   const float3 spacing_mm, const float3 centre,
                                   constant const XrcOpacity* opacity, global const float2* table,
                                   Motion* motion) {
  const int axis = line->axis;
  const int size = axis == 0 ? scan->size_x : axis == 1 ? scan->size_y : scan->size_z;
  const int first = clamp((int)floor(line->low + 0.5f), 0, size - 1),
            last = clamp((int)floor(line->high + 0.5f), 0, size - 1);
  const float du = axis == 0 ? line->per_plane.y : line->per_plane.x,
              dv = axis == 2 ? line->per_plane.y : line->per_plane.z;
  float sum = 0.0f, first_mu = 0.0f, last_mu = 0.0f;
  for (int k = first; k <= last; ++k) {
    const float share = fmax(fmin((float)k + 0.5f, line->high) - fmax((float)k - 0.5f, line->low), 0.0f);
    const float3 at = line->at_0 + (float)k * line->per_plane;
    const float3 sample =
        sample_slopes(voxels, scan, axis, k, axis == 0 ? at.y : at.x, axis == 2 ? at.y : at.z);
    last_mu = mu_of(sample.x, opacity, table);
    if (k == first) first_mu = last_mu;
    sum = fma(share, last_mu, sum);
    const float3 hu_slope = along_axes(axis, -(sample.y * du + sample.z * dv), sample.y, sample.z);
    add(motion, share * mu_slope_of(sample.x, opacity, table), hu_slope / spacing_mm,
        (at - centre) * spacing_mm);
  }
  const float3 low = line->at_0 + line->low * line->per_plane,
               high = line->at_0 + line->high * line->per_plane;
  add(motion, -first_mu, end_slope(line, line->low_by, spacing_mm), (low - centre) * spacing_mm);
  add(motion, last_mu, end_slope(line, line->high_by, spacing_mm), (high - centre) * spacing_mm);
  return sum;
}

/* Optical depth of a pixel's ray, and its six derivatives, at places of their own. */
static inline void store_pixel(const long pixel, const float sum, const Line* line, Motion motion,
                               const float3 spacing_mm, global float* tau, global float* gradient) {
  /* A ray that turns crosses planes at another angle. */
  const float3 way_mm = line->per_plane * spacing_mm;
  const float plane_mm = length(way_mm);
  motion.by_rad -=
      sum / component(way_mm, line->axis) * cross(way_mm, along_axes(line->axis, 1.0f, 0.0f, 0.0f));
  tau[pixel] = sum * plane_mm;
  vstore3(plane_mm * motion.by_mm, 2 * pixel, gradient);
  vstore3(plane_mm * motion.by_rad, 2 * pixel + 1, gradient);
}

static inline void store_nothing(const long pixel, global float* tau, global float* gradient) {
  tau[pixel] = 0.0f;
  vstore3((float3)(0.0f), 2 * pixel, gradient);
  vstore3((float3)(0.0f), 2 * pixel + 1, gradient);
}

static inline void gradient_pixel(SCAN voxels, const XrcScan* scan, const XrcDetector* detector, const int i,
                                  const int j, const float3 centre, constant const XrcOpacity* opacity,
                                  global const float2* table, const long pixel, global float* tau,
                                  global float* gradient) {
  float3 start, end;
  pixel_ray(detector, i, j, &start, &end);
  const float3 spacing_mm = float3_of(detector->spacing_mm);
  Line line;
  if (!prepare_line(&line, scan, start, end)) {
    store_nothing(pixel, tau, gradient);
    return;
  }
  Motion motion = {(float3)(0.0f), (float3)(0.0f)};
  const float sum = sum_and_motion(voxels, scan, &line, spacing_mm, centre, opacity, table, &motion);
  store_pixel(pixel, sum, &line, motion, spacing_mm, tau, gradient);
}

/* One work-item a pixel. */
kernel void project_gradient(SCAN voxels, const XrcScan scan, global const XrcDetector* detectors,
                             const float4 centre, constant const XrcOpacity* opacity,
                             global const float2* table, global float* tau, global float* gradient) {
  const XrcDetector detector = detectors[get_global_id(2)];
  const int i = (int)get_global_id(0), j = (int)get_global_id(1);
  if (i >= detector.width || j >= detector.height) return;
  gradient_pixel(voxels, &scan, &detector, i, j, centre.xyz, opacity, table,
                 ((long)get_global_id(2) * detector.height + j) * detector.width + i, tau, gradient);
}

#ifndef SCAN_IMAGE

static inline float16 mu_slope_of16(const float16 hu, constant const XrcOpacity* opacity,
                                    global const float2* table) {
#if RAMPS > 0
  (void)table;
  float16 slope = 0.0f;
  for (int i = 0; i < RAMPS; ++i)
    slope += select((float16)0.0f, (float16)opacity->slope[i], hu > opacity->from[i]);
  return slope;
#else
  float each[ROWS], slopes[ROWS];
  vstore16(hu, 0, each);
  for (int r = 0; r < ROWS; ++r) slopes[r] = mu_slope_of(each[r], opacity, table);
  return vload16(0, slopes);
#endif
}

/* Sums over the planes of 16 rays, in voxels: mu, its changes along u and v, and these times the number of
 * the plane, counted from `middle`, of which all derivatives consist; and mu in each ray's first and last
 * plane. */
typedef struct {
  float16 sum, by_u, by_v, k_by_u, k_by_v, first_mu, last_mu;
  float middle;
} SlopeSums;

static inline void add_plane(SlopeSums* sums, const Rays* rays, const int k, const Cells* cells,
                             const float unit, const float16 share, const int16 is_own_first,
                             const int16 is_own_last, constant const XrcOpacity* opacity,
                             global const float2* table) {
  const float16 across_below = cells->beside_below - cells->here_below,
                across_above = cells->beside_above - cells->here_above;
  const float16 below = fma(cells->along_u, across_below, cells->here_below),
                above = fma(cells->along_u, across_above, cells->here_above);
  const float16 hu = fma(cells->along_v, above - below, below) * unit;
  const float16 u = fma((float16)(float)k, rays->du, rays->u0),
                v = fma((float16)(float)k, rays->dv, rays->v0);
  const float16 by_u = select((float16)0.0f, fma(cells->along_v, across_above - across_below, across_below),
                              u >= 0.0f && u <= (float)rays->last_u),
                by_v = select((float16)0.0f, above - below, v >= 0.0f && v <= (float)rays->last_z);
  const float16 mu = mu_of16(hu, opacity, table), weight = share * mu_slope_of16(hu, opacity, table) * unit,
                step = (float)k - sums->middle;
  const float16 mu_by_u = weight * by_u, mu_by_v = weight * by_v;
  sums->sum = fma(share, mu, sums->sum);
  sums->by_u += mu_by_u;
  sums->by_v += mu_by_v;
  sums->k_by_u = fma(step, mu_by_u, sums->k_by_u);
  sums->k_by_v = fma(step, mu_by_v, sums->k_by_v);
  sums->first_mu = select(sums->first_mu, mu, is_own_first);
  sums->last_mu = select(sums->last_mu, mu, is_own_last);
}

static inline SlopeSums slopes_of_planes(SCAN voxels, const Rays* rays, constant const XrcOpacity* opacity,
                                         global const float2* table) {
  SlopeSums sums = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, (float)((rays->first + rays->last) / 2)};
  const int16 own_first = convert_int16(clamp(floor(rays->low + 0.5f), 0.0f, (float)rays->last_k)),
              own_last = convert_int16(clamp(floor(rays->high + 0.5f), 0.0f, (float)rays->last_k));
  for (int k = rays->first; k <= rays->last; ++k) {
    const int16 is_own_first = own_first == k, is_own_last = own_last == k;
#ifdef HAS_PERMUTE
    if (k >= rays->first_core && k <= rays->last_core) {
      const Cells cells = cells_in_core(voxels, rays, k, (float)k);
      add_plane(&sums, rays, k, &cells, 1.0f / 65536, 1.0f, is_own_first, is_own_last, opacity, table);
      continue;
    }
#endif
    const Cells cells = cells_anywhere(voxels, rays, k);
    add_plane(&sums, rays, k, &cells, 1.0f, share_of(rays, k), is_own_first, is_own_last, opacity, table);
  }
  return sums;
}

/* From the sums of one of the rays to its derivatives. */
static inline Motion motion_of(const Line* line, const float by_u, const float by_v, const float k_by_u,
                               const float k_by_v, const float middle, const float first_mu,
                               const float last_mu, const float3 spacing_mm, const float3 centre) {
  const int axis = line->axis;
  const float3 way = line->per_plane;
  const float du = axis == 0 ? way.y : way.x, dv = way.z;
  const float3 slope = along_axes(axis, -(by_u * du + by_v * dv), by_u, by_v) / spacing_mm,
               k_slope = along_axes(axis, -(k_by_u * du + k_by_v * dv), k_by_u, k_by_v) / spacing_mm;
  const float3 from_centre = line->at_0 - centre;
  Motion motion = {
      slope, cross((from_centre + middle * way) * spacing_mm, slope) + cross(way * spacing_mm, k_slope)};
  add(&motion, -first_mu, end_slope(line, line->low_by, spacing_mm),
      (from_centre + line->low * way) * spacing_mm);
  add(&motion, last_mu, end_slope(line, line->high_by, spacing_mm),
      (from_centre + line->high * way) * spacing_mm);
  return motion;
}

/* 16 rows of column i, whose rays cross planes of the same axis. */
static inline void gradient_16(SCAN voxels, const XrcScan* scan, const XrcDetector* detector,
                               const Rays* rays, const int i, const int first_row, const float3 centre,
                               constant const XrcOpacity* opacity, global const float2* table,
                               const long picture, global float* tau, global float* gradient) {
  const SlopeSums sums = slopes_of_planes(voxels, rays, opacity, table);
  float each[7][ROWS];
  vstore16(sums.sum, 0, each[0]);
  vstore16(sums.by_u, 0, each[1]);
  vstore16(sums.by_v, 0, each[2]);
  vstore16(sums.k_by_u, 0, each[3]);
  vstore16(sums.k_by_v, 0, each[4]);
  vstore16(sums.first_mu, 0, each[5]);
  vstore16(sums.last_mu, 0, each[6]);
  const float3 spacing_mm = float3_of(detector->spacing_mm);
  for (int r = 0; r < min(ROWS, detector->height - first_row); ++r) {
    const long pixel = (picture * detector->height + first_row + r) * detector->width + i;
    float3 start, end;
    pixel_ray(detector, i, first_row + r, &start, &end);
    Line line;
    if (!prepare_line(&line, scan, start, end)) {
      store_nothing(pixel, tau, gradient);
      continue;
    }
    const Motion motion = motion_of(&line, each[1][r], each[2][r], each[3][r], each[4][r], sums.middle,
                                    each[5][r], each[6][r], spacing_mm, centre);
    store_pixel(pixel, each[0][r], &line, motion, spacing_mm, tau, gradient);
  }
}

/* From bricks: one work-item takes 16 rows of a column; see project_rows. */
kernel void project_rows_gradient(SCAN voxels, const XrcScan scan, global const XrcDetector* detectors,
                                  const float4 centre, constant const XrcOpacity* opacity,
                                  global const float2* table, global float* tau, global float* gradient) {
  const PictureColumn at = picture_column(detectors);
  const XrcDetector detector = detectors[at.picture];
  const int first_row = ROWS * (int)get_global_id(1);
  if (at.column >= detector.width || first_row >= detector.height) return;
  Rays rays;
  if (prepare_rows(&rays, &scan, &detector, at.column, first_row)) {
    gradient_16(voxels, &scan, &detector, &rays, at.column, first_row, centre.xyz, opacity, table, at.picture,
                tau, gradient);
    return;
  }
  for (int j = first_row; j < min(first_row + ROWS, detector.height); ++j)
    gradient_pixel(voxels, &scan, &detector, at.column, j, centre.xyz, opacity, table,
                   ((long)at.picture * detector.height + j) * detector.width + at.column, tau, gradient);
}

#endif
