#include "xraycast/reports/step_report.hpp"

#include "xraycast/reports/scan_projection.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace xraycast {
namespace {

constexpr Colour kKept{0.95, 0.18, 0.15};
// Apart from each other and from red, also for those who do not tell red from green.
constexpr std::array<Colour, 8> kTakenOff{{{0.55, 0.55, 0.60},
                                           {0.95, 0.90, 0.25},
                                           {0.30, 0.60, 1.00},
                                           {0.20, 0.85, 0.75},
                                           {0.90, 0.45, 0.95},
                                           {0.98, 0.60, 0.15},
                                           {0.45, 0.95, 0.35},
                                           {0.55, 0.35, 0.95}}};

}  // namespace

std::size_t StepReport::add(const std::string& step, const Mask& mask) {
  const glm::dvec3& s = mask.geometry.spacing_mm;
  const double voxel_ml = s.x * s.y * s.z / 1000;
  if (labels_.empty()) labels_.resize(mask.voxels.size());
  const auto number = static_cast<std::uint8_t>(steps_.size() + 1);
  std::int64_t taken_off = 0, added = 0;
  for (std::size_t i = 0; i < labels_.size(); ++i) {
    if (mask.voxels[i] != 0 && labels_[i] != 1) {
      labels_[i] = 1;
      ++added;
    } else if (mask.voxels[i] == 0 && labels_[i] == 1) {
      labels_[i] = static_cast<std::uint8_t>(1 + number);
      ++taken_off;
    }
  }
  steps_.push_back({step, static_cast<double>(taken_off) * voxel_ml, static_cast<double>(added) * voxel_ml});
  return number;
}

RgbPicture StepReport::picture(const Volume& volume) const {
  constexpr int kWidth = 1500, kHeight = 860, kMargin = 20, kTop = 50, kLine = 24;
  constexpr double kPanelWidth = 560, kPanelHeight = 760, kFont = 15;
  constexpr Colour kPaper{0.10, 0.11, 0.13}, kInk{0.9, 0.9, 0.9};
  std::vector<Colour> colours{kKept};
  for (std::size_t i = 0; i < steps_.size(); ++i) colours.push_back(kTakenOff[i % kTakenOff.size()]);
  Canvas sheet(kWidth, kHeight, kPaper);
  sheet.text({kMargin, 30}, "What each step removed, and the vessels that remain", kFont, kInk);
  double left = kMargin;
  for (const int axis : {1, 0}) {
    draw_projection(sheet, project_scan(volume, labels_, colours, axis),
                    {left, kTop, kPanelWidth, kPanelHeight});
    left += kPanelWidth + kMargin;
  }
  double y = kTop + kFont;
  const auto row = [&](const Colour& colour, const std::string& words) {
    sheet.fill({left, y - 12, 14, 14}, colour);
    sheet.text({left + 24, y}, words, kFont, kInk);
    y += kLine;
  };
  row(kKept, "vessels");
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    const Step& step = steps_[i];
    std::string words = step.name;
    const bool both = step.taken_off_ml > 0 && step.added_ml > 0;  // too long for the sheet in words
    if (both) words += fmt::format(": -{:.1f} ml, +{:.1f} ml", step.taken_off_ml, step.added_ml);
    if (!both && step.taken_off_ml > 0) words += fmt::format(": removed {:.1f} ml", step.taken_off_ml);
    if (!both && step.added_ml > 0) words += fmt::format(": added {:.1f} ml", step.added_ml);
    row(colours[i + 1], words);
  }
  return {kWidth, kHeight, sheet.rgb()};
}

}  // namespace xraycast
