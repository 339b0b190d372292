/* From Hounsfield units to attenuation. The program is built with -DRAMPS=1..4, or with -DRAMPS=0 for a
 * table. */
#ifndef XRAYCAST_CLASSIFY_H
#define XRAYCAST_CLASSIFY_H

#include "params.h"

#if RAMPS > 0

static inline float16 mu_of16(const float16 hu, constant const XrcOpacity* opacity,
                              global const float2* table) {
  (void)table;
  float16 mu = opacity->mu0;
  for (int i = 0; i < RAMPS; ++i) mu = fma((float16)opacity->slope[i], fmax(hu - opacity->from[i], 0.0f), mu);
  return mu;
}

static inline float mu_of(const float hu, constant const XrcOpacity* opacity, global const float2* table) {
  (void)table;
  float mu = opacity->mu0;
  for (int i = 0; i < RAMPS; ++i) mu = fma(opacity->slope[i], fmax(hu - opacity->from[i], 0.0f), mu);
  return mu;
}

#else

static inline float mu_of(const float hu, constant const XrcOpacity* opacity, global const float2* table) {
  const float at = clamp(hu - opacity->first_hu, 0.0f, (float)(opacity->entries - 1));
  const int i = (int)at;
  const float2 entry = table[i];
  return fma(at - (float)i, entry.y, entry.x);
}

static inline float16 mu_of16(const float16 hu, constant const XrcOpacity* opacity,
                              global const float2* table) {
  float in[16], out[16];
  vstore16(hu, 0, in);
  for (int i = 0; i < 16; ++i) out[i] = mu_of(in[i], opacity, table);
  return vload16(0, out);
}

#endif
#endif
