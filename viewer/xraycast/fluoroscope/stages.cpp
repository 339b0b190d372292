#include "xraycast/fluoroscope/stages.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <array>
#include <sstream>

namespace xraycast {

FluoroscopyStages FluoroscopyStages::from_list(const std::string& list) {
  struct Stage {
    const char* name;
    bool FluoroscopyStages::*flag;
  };
  using S = FluoroscopyStages;
  constexpr std::array<Stage, 6> kStages{{{"quanta", &S::quanta},
                                          {"blur", &S::blur},
                                          {"lag", &S::lag},
                                          {"electronics", &S::electronics},
                                          {"scatter", &S::scatter},
                                          {"display", &S::display}}};
  FluoroscopyStages stages{false, false, false, false, false, false};
  if (list == "none") return stages;
  std::istringstream names(list + ',');  // or the last name, if empty, is not seen
  for (std::string name; std::getline(names, name, ',');) {
    const auto* stage =
        std::ranges::find(kStages, name, [](const Stage& one) { return std::string(one.name); });
    if (stage == kStages.end())
      throw InputError(
          "stages {}: unknown stage \"{}\"; choose from quanta, blur, lag, electronics, scatter and display, "
          "or "
          "give none",
          list, name);
    stages.*stage->flag = true;
  }
  return stages;
}

}  // namespace xraycast
