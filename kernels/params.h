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

#endif
