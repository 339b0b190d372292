#pragma once

#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/contrast_agent/injection.hpp"

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// The instrument at whose tip contrast agent leaves that is injected through the outermost free lumen; none
/// where no lumen is free. An instrument whose tip lies in another one's lumen fills that, and the agent
/// leaves at the other one's tip.
std::optional<std::size_t> agent_outlet(const Instruments& instruments);

/// The diameter of that lumen; 0 where none is free.
double agent_lumen_mm(const Instruments& instruments);

/// How much agent of an injection has gone in, and how much no free lumen let in.
class InjectedVolume {
 public:
  /// Goes on to a time, from 0 s on.
  void advance(const Instruments& instruments, double time_s, const Injection& injection);

  double injected_ml() const { return injected_ml_; }
  double withheld_ml() const { return withheld_ml_; }
  /// What of the former went in without its particles, which are wider than the lumen.
  double strained_ml() const { return strained_ml_; }

 private:
  double time_s_ = 0, injected_ml_ = 0, withheld_ml_ = 0, strained_ml_ = 0;
};

/// Why no agent can be injected where agent_outlet is none, and what to do, for the end of a sentence.
std::string reason_for_no_outlet(const std::vector<InstrumentModel>& models);

}  // namespace xraycast
