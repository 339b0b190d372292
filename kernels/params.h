/* Types and constants that host and kernels share. Included by C++ and by OpenCL C; every struct is made of
 * 4-byte members only, so that both sides agree on its layout, and each has its size asserted on the host. */
#ifndef XRAYCAST_PARAMS_H
#define XRAYCAST_PARAMS_H

#ifdef __OPENCL_C_VERSION__
#define XRC_INT int
#define XRC_FLOAT float
#else
#include <stdint.h>
#define XRC_INT int32_t
#define XRC_FLOAT float
#endif

/* CT numbers at and below which there is nothing: what rays meet outside the scan. */
#define XRC_AIR_HU (-1024)

/* Phantoms: shapes, painted in order. What the members mean for each kind:
 *   solid    a = centre, b and c = two unit axes (the third is b x c), size = half axes, exponents = in the
 *            plane of b and c, and along b x c; 2 and 2 make an ellipsoid
 *   box      a, b, c and size as for a solid
 *   capsule  a and b = end points, size = radius at a, at b, and flattening along the unit axis c (1: round)
 *   plate    a, b, c = corners of a triangle, size[0] = half the thickness
 *   loft     a = z of the first station, distance between stations, 0; stations first to first + count - 1;
 *            exponents[0] = of the super-elliptic sections
 */
#define XRC_SOLID 0
#define XRC_BOX 1
#define XRC_CAPSULE 2
#define XRC_PLATE 3
#define XRC_LOFT 4

typedef struct xrc_primitive {
  XRC_INT kind;
  XRC_INT layer; /* neighbours of the same layer are one body, painted at once */
  XRC_INT is_additive;
  XRC_FLOAT hu; /* painted over what is there, or added to it */
  XRC_FLOAT a[3], b[3], c[3], size[3];
  XRC_FLOAT exponents[2];
  XRC_INT first, count;
  XRC_FLOAT lower_mm[3], upper_mm[3]; /* encloses the shape, without its faded edge */
} xrc_primitive;

/* A loft's section: centre and half axes. */
typedef struct xrc_station {
  XRC_FLOAT x, y, a, b;
} xrc_station;

/* Edge in voxels of the bricks within which the list of shapes is the same. */
#define XRC_PHANTOM_BRICK 16

/* A run of slices of a phantom. */
typedef struct xrc_phantom_slab {
  XRC_INT size[3];
  XRC_INT bricks_x;
  XRC_INT first_slice;
  XRC_FLOAT origin_mm[3], spacing_mm[3]; /* of the whole volume */
  XRC_FLOAT edge_mm;                     /* over which a surface fades */
  XRC_FLOAT noise_hu;                    /* standard deviation */
  XRC_INT seed;
} xrc_phantom_slab;

#endif
