/* Shared by maps whose rays run outwards from a centre. */
#ifndef XRAYCAST_RAYS_H
#define XRAYCAST_RAYS_H

/* Compilers do not inline functions as long as those of a ray; the calls would double their time. */
#define INLINE static inline __attribute__((always_inline))

/* How many samples of a ray, at centre + (i + 1/2) * step, lie between the faces of `size` voxels along one
 * axis. The centre does. */
static inline int samples_within(const float centre, const float step, const int size, const int samples) {
  const float room = step > 0.0f ? (float)size - 0.5f - centre : centre + 0.5f;
  const float count = fabs(step) > 0.0f ? floor(room / fabs(step) + 0.5f) : (float)samples;
  return clamp((int)fmin(count, (float)samples), 0, samples);
}

#endif
