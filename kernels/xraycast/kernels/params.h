/* Types and constants that host and kernels share. Included by C++ and by OpenCL C; every struct is made of
 * 4-byte members only, so that both sides agree on its layout, and each has its size asserted on the host. */
#ifndef XRAYCAST_PARAMS_H
#define XRAYCAST_PARAMS_H

#ifdef __OPENCL_C_VERSION__
#define XRC_INT int
#define XRC_LONG long
#define XRC_FLOAT float
#else
#include <stdint.h>
#define XRC_INT int32_t
#define XRC_LONG int64_t
#define XRC_FLOAT float
#endif

/* CT numbers at and below which there is nothing: what rays meet outside the scan. */
#define XRC_PADDING_HU (-1024)

/* A scan on the device: bricks of 16 slices, interleaved voxel by voxel, so that one load takes the same
 * pixel of 16 slices. HU of voxel (x, y, z) is at ((z / 16 * pitch_y + y) * pitch_x + x) * 16 + z % 16.
 * Slices have one more column and row than the scan, and the last brick more slices, all of them air, so that
 * the neighbour behind every voxel can be read.
 *
 * The scan ends at the faces of its border voxels, half a voxel beyond their centres. Between centre and face
 * it holds their CT numbers; beyond is nothing. */
#define XRC_BRICK_SLICES 16
typedef struct {
  XRC_INT size_x, size_y, size_z; /* voxels */
  XRC_INT pitch_x, pitch_y;       /* pixels of a stored slice */
  XRC_INT bricks;
} XrcScan;

/* Blocks of a scan: as many columns and rows, and the slices of a brick; those above each other are
 * neighbours in memory, rows of blocks follow each other. */
#define XRC_BLOCK 8

/* A block under an opacity: mu, where that is the same everywhere in it, and the last of the blocks above it
 * up to which it is. Where mu varies, `last` is -1. */
typedef struct {
  XRC_FLOAT mu;
  XRC_INT last;
} XrcBlock;

/* One shell of a ray whose samples are step_mm long: the rest of the sample that the inner edge cuts, the
 * whole samples [first, last), and the part of sample `last` inside the outer edge. */
typedef struct {
  XRC_INT first, last;
  XRC_FLOAT head_mm, tail_mm;
} XrcShell;

/* A map of rays that run outwards through shells. */
typedef struct {
  XRC_INT width, height, layers; /* texels */
  XRC_INT samples;               /* of a whole ray */
  XRC_FLOAT step_mm;
  XRC_INT scale_stride; /* from a row's scales of rays to the next one's; 0 where all rows have the same */
} XrcMap;

typedef struct {
  XrcMap map;
  XRC_FLOAT step_x, step_y; /* voxels along x and y for step_mm */
} XrcCylinder;

typedef struct {
  XrcMap map;
  XRC_FLOAT centre[3]; /* voxels */
  XRC_FLOAT step[3];   /* voxels along x, y and z for step_mm */
} XrcSphere;

/* Displacements of a scan at the nodes of a grid, trilinear between them: node (i, j, k), x fastest, is at
 * voxel (i / nodes_per_voxel[0], j / nodes_per_voxel[1], k * slices from node to node), which divide a
 * brick's and are the value of -DMOVED. A node is x, y and z in voxels, and 0: a place of the moved scan
 * shows what lies that far from it in the scan. The nodes enclose all voxels, and those of the last brick. */
typedef struct {
  XRC_INT size_x, size_y, size_z;
  XRC_FLOAT nodes_per_voxel[2];
} XrcField;

/* The basis of recasting: how many millimetres of a ray count for each knot of an opacity. A tile is
 * 16 slices (those of a brick) of one map column in one layer; tile (brick * layers + layer) * width +
 * column. For every knot that any of its texels touches it has a row of 16 weights, in units of its shell's
 * thickness / XRC_WEIGHT_SUM, so that the weights of a texel add up to exactly XRC_WEIGHT_SUM. */
#define XRC_MAX_KNOTS 64
#define XRC_WEIGHT_SUM 65535

/* Bins of a scan's histogram, from XRC_PADDING_HU on; the last one holds all above. */
#define XRC_HISTOGRAM_BINS 256
#define XRC_HISTOGRAM_BIN_HU 16

/* mu(hu) = mu0 + sum of slope * max(0, hu - from) over the ramps. */
#define XRC_MAX_RAMPS 4
typedef struct {
  XRC_FLOAT mu0;
  XRC_FLOAT from[XRC_MAX_RAMPS], slope[XRC_MAX_RAMPS];
  /* Otherwise a table from first_hu on: entry i holds mu and its change to the next whole HU. */
  XRC_FLOAT first_hu;
  XRC_INT entries;
} XrcOpacity;

/* Ranges of CT numbers, from the lowest on, within which an opacity has one mu. */
#define XRC_MAX_PLATEAUS 34
typedef struct {
  XRC_INT count;
  XRC_FLOAT from_hu[XRC_MAX_PLATEAUS], to_hu[XRC_MAX_PLATEAUS];
} XrcPlateaus;

/* A flat detector in voxel coordinates. Pixel (i, j) is hit at corner + i right + j down. Under a cone all
 * rays start at `source`; without one they run along `beam`, from one side of the scan to the other. */
typedef struct {
  XRC_INT width, height, is_cone;
  XRC_FLOAT corner[3], right[3], down[3], source[3], beam[3];
  XRC_FLOAT spacing_mm[3];
  XRC_FLOAT axis[2], radius_mm; /* rays count within a cylinder about this axis along z */
} XrcDetector;

/* Rows of a column that a work-item takes when it does not take one pixel: those of a vector, or of several,
 * and several columns, when the view is not tilted. */
#define XRC_DETECTOR_ROWS 16
#define XRC_UNTILTED_ROWS 128
#define XRC_UNTILTED_COLUMNS 8

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

typedef struct XrcPrimitive {
  XRC_INT kind;
  XRC_INT layer; /* neighbours of the same layer are one body, painted at once */
  XRC_INT is_additive;
  XRC_FLOAT hu; /* painted over what is there, or added to it */
  XRC_FLOAT a[3], b[3], c[3], size[3];
  XRC_FLOAT exponents[2];
  XRC_INT first, count;
  XRC_FLOAT lower_mm[3], upper_mm[3]; /* encloses the shape, without its faded edge */
} XrcPrimitive;

/* A loft's section: centre and half axes. */
typedef struct XrcStation {
  XRC_FLOAT x, y, a, b;
} XrcStation;

/* Edge in voxels of the bricks within which the list of shapes is the same. */
#define XRC_PHANTOM_BRICK 16

/* A run of slices of a phantom. */
typedef struct XrcPhantomSlab {
  XRC_INT size[3];
  XRC_INT bricks_x;
  XRC_INT first_slice;
  XRC_FLOAT origin_mm[3], spacing_mm[3]; /* of the whole volume */
  XRC_FLOAT edge_mm;                     /* over which a surface fades */
  XRC_FLOAT noise_hu;                    /* standard deviation */
  XRC_INT seed;
} XrcPhantomSlab;

#endif
