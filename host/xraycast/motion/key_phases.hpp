#pragma once

#include "xraycast/motion/motion.hpp"

#include <map>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The instants at which a moving body is known, its keys: a grid of phases of the modes of its motion. Key
/// maps are of these, between which maps are blended.
///
/// Keys are numbered with the phase of the last mode varying fastest. Key 0 is at phase 0 of all modes.
class KeyPhases {
 public:
  /// `phases` of each mode ascend from 0: to below 1 where the mode wraps, else to 1. Of the motion only the
  /// modes' names and times are kept. Throws InputError, with the motion's name in front, for other phases,
  /// fewer than two or more than kMostOfMode of a mode, and more than kMost keys.
  KeyPhases(const Motion& motion, std::vector<std::vector<double>> phases);
  static constexpr int kMostOfMode = 64, kMost = 1024;

  /// The motion's modes, which move nothing: for clocks (phases_at) and for names (phases_of).
  const Motion& rhythm() const { return rhythm_; }

  const std::vector<std::vector<double>>& phases() const { return phases_; }  ///< of each mode
  int count() const;                                                          ///< of keys

  /// One phase a mode.
  std::vector<double> phases_of(int key) const;

  /// The key from which this one differs by one mode only, which is at phase 0 there: the last that is not at
  /// 0. Its number is lower; -1 for key 0.
  int base_of(int key) const;

  /// By how much keys count at an instant: linear between the two nearest phases of each mode, of one that
  /// wraps also from the last to the first. The shares are above 0 and sum up to 1.
  struct Share {
    int key;
    double weight;
  };
  std::vector<Share> shares_at(std::span<const double> phases) const;

  /// {"modes": [{"name", "period_s" or "waveform", "wraps", "phases"}]}
  std::string to_json() const;

  /// Throws InputError, with `name` in front.
  static KeyPhases from_json(const std::string& text, const std::string& name);

 private:
  Motion rhythm_;
  std::vector<std::vector<double>> phases_;
};

/// Evenly spaced phases of each mode: so many as `keys` has of its name, or kUsualOfCycle for one that wraps
/// and kUsualOfStretch for one that does not. Throws InputError, with the field `keys`, for a name that is no
/// mode, and as KeyPhases does.
KeyPhases key_phases(const Motion& motion, const std::map<std::string, int>& keys);
inline constexpr int kUsualOfCycle = 8, kUsualOfStretch = 4;

}  // namespace xraycast
