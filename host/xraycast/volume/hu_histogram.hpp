#pragma once

#include <cstdint>
#include <vector>

namespace xraycast {

/// How often each HU from -1024 on occurs; those from 3071 on are one.
class HuHistogram {
 public:
  void add(std::int16_t hu);

  /// Whether these are the values of a CT scan's body stored as HU + 1024, without a negative one but
  /// padding: most of what is not air is soft tissue, in a narrow peak of many values about 1024, and little
  /// lies between it and lung. Values of subtracted angiograms, masks, phantoms of few values and MR are not.
  bool is_shifted() const;

 private:
  /// Of values from `first_hu` to `last_hu` - 1.
  std::int64_t count(int first_hu, int last_hu) const;

  static constexpr int kFirst_hu = -1024, kLast_hu = 3072;
  std::vector<std::int64_t> counts_ = std::vector<std::int64_t>(kLast_hu - kFirst_hu);
};

}  // namespace xraycast
