#pragma once

#include "xraycast/blood_flow/tree_flow.hpp"
#include "xraycast/coaxial/instruments.hpp"

#include <cstddef>
#include <deque>
#include <string>
#include <vector>

namespace xraycast {

/// A pressure as a patient's monitor shows it.
struct PressureReading {
  double now_mmHg = 0;
  double systolic_mmHg = 0, diastolic_mmHg = 0,
         mean_mmHg = 0;  ///< over the last heartbeat, once it was all seen
};

/// `112/71 mmHg, mean 88`.
std::string in_words(const PressureReading& reading);

/// The pressures of the blood in the aorta and at instruments' tips over the last heartbeat, as through lines
/// in them.
class TipPressures {
 public:
  /// As they are now, at a time not before the last one.
  void add(double time_s, const TreeFlow& flow, const std::vector<InstrumentTip>& tips);

  bool are_read() const { return !tips_.empty(); }

  /// All 0 before the first one.
  PressureReading aorta() const { return aorta_.reading(); }
  PressureReading tip(std::size_t instrument) const {
    return instrument < tips_.size() ? tips_[instrument].reading() : PressureReading{};
  }
  /// Of each instrument's tip, the mean; none until a whole heartbeat was seen.
  std::vector<double> tip_means_mmHg() const;

 private:
  class Line {
   public:
    void add(double time_s, double mmHg, double kept_s);
    PressureReading reading() const;
    double mean_mmHg() const;  ///< over the last heartbeat, or what of it was seen

   private:
    struct Sample {
      double time_s, mmHg;
      double since_s, mean_mmHg;  ///< since the sample before, and the mean of both
    };
    std::deque<Sample> samples_;  ///< of the last heartbeat
    double sum_mmHg_s_ = 0, seconds_ = 0, kept_s_ = 0;
  };
  Line aorta_;
  double first_s_ = 0;
  bool has_beat_ = false;  ///< a whole one was seen
  std::vector<Line> tips_;
};

/// The place of an instrument's tip in the tree.
VesselTree::Location location_of(const InstrumentTip& tip);

/// Of each instrument.
std::vector<InstrumentTip> tips_of(const Instruments& instruments);

}  // namespace xraycast
