/* From Hounsfield units to attenuation. The program is built with -DRAMPS=1..4, or with -DRAMPS=0 for a
 * table. */
#ifndef XRAYCAST_CLASSIFY_H
#define XRAYCAST_CLASSIFY_H

#include "xraycast/kernels/params.h"

#if RAMPS > 0

static inline float16 mu_of16(const float16 hu, constant const XrcOpacity* opacity,
                              global const float2* table) {
  (void)table;
  float16 mu = opacity->mu0;
  for (int i = 0; i < RAMPS; ++i) mu = fma((float16)opacity->slope[i], max(hu - opacity->from[i], 0.0f), mu);
  return mu;
}

static inline float2 mu_of2(const float2 hu, constant const XrcOpacity* opacity, global const float2* table) {
  (void)table;
  float2 mu = opacity->mu0;
  for (int i = 0; i < RAMPS; ++i) mu = fma((float2)opacity->slope[i], max(hu - opacity->from[i], 0.0f), mu);
  return mu;
}

static inline float8 mu_of8(const float8 hu, constant const XrcOpacity* opacity, global const float2* table) {
  (void)table;
  float8 mu = opacity->mu0;
  for (int i = 0; i < RAMPS; ++i) mu = fma((float8)opacity->slope[i], max(hu - opacity->from[i], 0.0f), mu);
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

static inline float2 mu_of2(const float2 hu, constant const XrcOpacity* opacity, global const float2* table) {
  return (float2)(mu_of(hu.x, opacity, table), mu_of(hu.y, opacity, table));
}

static inline float16 mu_of16(const float16 hu, constant const XrcOpacity* opacity,
                              global const float2* table) {
  const float16 at = clamp(hu - opacity->first_hu, 0.0f, (float)(opacity->entries - 1));
  const int16 i = convert_int16(at);
  /* Entries as whole words: compilers make vector gathers of this loop where there are any. */
  global const long* entries = (global const long*)table;
  int index[16];
  long entry[16];
  vstore16(i, 0, index);
  for (int n = 0; n < 16; ++n) entry[n] = entries[index[n]];
  const float16 lower = as_float16(vload8(0, entry)), upper = as_float16(vload8(1, entry));
  return fma(at - convert_float16(i), (float16)(lower.odd, upper.odd), (float16)(lower.even, upper.even));
}

static inline float8 mu_of8(const float8 hu, constant const XrcOpacity* opacity, global const float2* table) {
  const float8 at = clamp(hu - opacity->first_hu, 0.0f, (float)(opacity->entries - 1));
  const int8 i = convert_int8(at);
  global const long* entries = (global const long*)table;
  int index[8];
  long entry[8];
  vstore8(i, 0, index);
  for (int n = 0; n < 8; ++n) entry[n] = entries[index[n]];
  const float16 pairs = as_float16(vload8(0, entry));
  return fma(at - convert_float8(i), pairs.odd, pairs.even);
}

#endif
#endif
