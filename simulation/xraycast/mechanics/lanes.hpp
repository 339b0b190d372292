#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>

namespace xraycast {

// Arithmetic on four numbers at once. What is done for many edges or points is written once, for one of them
// (`Real` is double) or for four (`Real` is Lanes), with the same operations in the same order. Both give the
// same numbers, but for sines, angles and rounding to whole numbers (see rod_frames.hpp), and for compilers
// that fuse products and sums. All functions are inlined, into functions that are compiled for several
// processors.

/// Four numbers, as one vector of the processor.
using Lanes __attribute__((vector_size(4 * sizeof(double)))) = double;
using LaneMask = decltype(Lanes{} < Lanes{});

template <typename Real>
inline constexpr std::size_t kLanesOf = sizeof(Real) / sizeof(double);
inline constexpr std::size_t kLanes = kLanesOf<Lanes>;

template <typename Real>
[[gnu::always_inline]] inline Real all(double value) {
  return Real{} + value;
}

[[gnu::always_inline]] inline double lane(double value, std::size_t) { return value; }
[[gnu::always_inline]] inline double lane(const Lanes& values, std::size_t k) { return values[k]; }

[[gnu::always_inline]] inline double choose(bool is_first, double first, double second) {
  return is_first ? first : second;
}
[[gnu::always_inline]] inline Lanes choose(LaneMask is_first, Lanes first, Lanes second) {
  return is_first ? first : second;
}

[[gnu::always_inline]] inline bool any(bool value) { return value; }
[[gnu::always_inline]] inline bool any(LaneMask mask) { return (mask[0] | mask[1] | mask[2] | mask[3]) != 0; }

[[gnu::always_inline]] inline double square_root(double value) { return std::sqrt(value); }
[[gnu::always_inline]] inline Lanes square_root(Lanes value) {
  return Lanes{std::sqrt(value[0]), std::sqrt(value[1]), std::sqrt(value[2]), std::sqrt(value[3])};
}

template <typename Real>
[[gnu::always_inline]] inline Real magnitude(Real value) {
  return choose(value < 0.0, -value, value);
}

[[gnu::always_inline]] inline Lanes load(const double* from) {
  Lanes values;
  std::memcpy(&values, from, sizeof values);
  return values;
}
[[gnu::always_inline]] inline void store(double* to, Lanes values) {
  std::memcpy(to, &values, sizeof values);
}
[[gnu::always_inline]] inline double sum(Lanes values) {
  return (values[0] + values[1]) + (values[2] + values[3]);
}
[[gnu::always_inline]] inline void add_to(double* to, Lanes values) { store(to, load(to) + values); }

/// Rows as columns.
[[gnu::always_inline]] inline std::array<Lanes, kLanes> transposed(Lanes a, Lanes b, Lanes c, Lanes d) {
  const Lanes ab_even = __builtin_shufflevector(a, b, 0, 4, 2, 6),
              ab_odd = __builtin_shufflevector(a, b, 1, 5, 3, 7),
              cd_even = __builtin_shufflevector(c, d, 0, 4, 2, 6),
              cd_odd = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  return {__builtin_shufflevector(ab_even, cd_even, 0, 1, 4, 5),
          __builtin_shufflevector(ab_odd, cd_odd, 0, 1, 4, 5),
          __builtin_shufflevector(ab_even, cd_even, 2, 3, 6, 7),
          __builtin_shufflevector(ab_odd, cd_odd, 2, 3, 6, 7)};
}

/// A vector of space.
template <typename Real>
struct Triple {
  Real x, y, z;

  [[gnu::always_inline]] friend Triple operator+(const Triple& a, const Triple& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  [[gnu::always_inline]] friend Triple operator-(const Triple& a, const Triple& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  [[gnu::always_inline]] friend Triple operator-(const Triple& a) { return {-a.x, -a.y, -a.z}; }
  [[gnu::always_inline]] friend Triple operator*(const Real& s, const Triple& a) {
    return {s * a.x, s * a.y, s * a.z};
  }
  [[gnu::always_inline]] friend Triple operator/(const Triple& a, const Real& s) {
    const Real by = 1.0 / s;
    return {by * a.x, by * a.y, by * a.z};
  }
  [[gnu::always_inline]] Triple& operator+=(const Triple& a) { return *this = *this + a; }
  [[gnu::always_inline]] friend Real dot(const Triple& a, const Triple& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
  }
  [[gnu::always_inline]] friend Triple cross(const Triple& a, const Triple& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  }
};

/// The objects that the lanes are taken from.
template <typename Real, typename Object>
using LaneSources = std::array<const Object*, kLanesOf<Real>>;

/// Four items from `first` on; the last of `count` fills up the lanes.
using LaneIndices = std::array<std::size_t, kLanes>;
[[gnu::always_inline]] inline LaneIndices lane_indices(std::size_t first, std::size_t count) {
  LaneIndices at;
  for (std::size_t k = 0; k < kLanes; ++k) at[k] = first + k < count ? first + k : count - 1;
  return at;
}
/// Those items, or those `after` places after them.
template <typename Items>
[[gnu::always_inline]] inline auto lane_sources(const Items& items, const LaneIndices& at,
                                                std::size_t after = 0) {
  return LaneSources<Lanes, typename Items::value_type>{&items[at[0] + after], &items[at[1] + after],
                                                        &items[at[2] + after], &items[at[3] + after]};
}

/// A number of each object: `of` takes an object.
template <typename Real, typename Object, typename Of>
[[gnu::always_inline]] inline Real gathered(const LaneSources<Real, Object>& from, Of of) {
  if constexpr (kLanesOf<Real> == 1)
    return of(*from[0]);
  else
    return Real{of(*from[0]), of(*from[1]), of(*from[2]), of(*from[3])};
}

/// A vector of each object: `of` takes an object and returns a reference to three numbers.
template <typename Real, typename Object, typename Of>
[[gnu::always_inline]] inline Triple<Real> gathered_triple(const LaneSources<Real, Object>& from, Of of) {
  return {gathered<Real, Object>(from, [&](const Object& o) { return of(o)[0]; }),
          gathered<Real, Object>(from, [&](const Object& o) { return of(o)[1]; }),
          gathered<Real, Object>(from, [&](const Object& o) { return of(o)[2]; })};
}

/// A lane's vector, as `Vector` (three numbers).
template <typename Vector, typename Real>
[[gnu::always_inline]] inline Vector lane_vector(const Triple<Real>& vector, std::size_t k) {
  return Vector(lane(vector.x, k), lane(vector.y, k), lane(vector.z, k));
}

/// Of each lane, a number and a vector.
[[gnu::always_inline]] inline std::array<Lanes, kLanes> by_lane(const Lanes& first,
                                                                const Triple<Lanes>& rest) {
  return transposed(first, rest.x, rest.y, rest.z);
}

}  // namespace xraycast
