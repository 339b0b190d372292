#pragma once

#include "xraycast/motion/motion.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <memory>
#include <utility>
#include <vector>

namespace xraycast {

/// A phantom's motion in closed form, without the files that `phantom --motion` writes of it.
inline std::shared_ptr<const Motion> motion_of(const Phantom& phantom) {
  class Share final : public Displacement {
   public:
    Share(PhantomMode mode, double share) : mode_(std::move(mode)), share_(share) {}
    glm::dvec3 at(const glm::dvec3& x_mm) const override {
      for (int axis = 0; axis < 3; ++axis)
        if (x_mm[axis] < mode_.lower_mm[axis] || x_mm[axis] > mode_.upper_mm[axis]) return glm::dvec3(0);
      return share_ * mode_.displacement_mm(x_mm);
    }
    bool covers(const glm::dvec3&) const override { return true; }

   private:
    PhantomMode mode_;
    double share_;
  };
  std::vector<MotionMode> modes;
  for (const PhantomMode& of : phantom.modes()) {
    MotionMode mode{
        .name = of.name, .period_s = of.waveform.empty() ? of.period_s : 0, .waveform = {}, .keys = {}};
    for (const auto& [time_s, phase] : of.waveform) mode.waveform.push_back({time_s, phase});
    for (const double key : of.keys) {
      const double share = of.share(key);
      mode.keys.push_back({key, share == 0 ? nullptr : std::make_shared<Share>(of, share)});
    }
    modes.push_back(std::move(mode));
  }
  return std::make_shared<const Motion>(std::move(modes), phantom.name());
}

}  // namespace xraycast
