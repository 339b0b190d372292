#pragma once

#include <span>
#include <vector>

namespace xraycast {

/// Pictures of a mask at some phases, of which an exposure takes the one that is nearest: at most kMost, each
/// the mean of those in its share of the phases from 0 to 1.
class PhaseMasks {
 public:
  static constexpr int kMost = 32;  ///< less than a heart beats on between two pulses

  /// All pictures are of one size.
  void add(double phase, std::span<const float> picture);
  void clear() { *this = {}; }
  int count() const { return count_; }  ///< of pictures that were added
  int kept() const { return static_cast<int>(masks_.size()); }

  /// There must be one.
  std::span<const float> nearest(double phase, bool wraps) const;

 private:
  struct Mask {
    int place, count;  ///< of the share of phases, and of its pictures
    double phase;      ///< their mean, and that of the pictures
    std::vector<float> picture;
  };
  std::vector<Mask> masks_;
  int count_ = 0;
};

}  // namespace xraycast
