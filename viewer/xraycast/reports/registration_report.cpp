#include "xraycast/reports/registration_report.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/scene/canvas.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace xraycast {
namespace {

constexpr int kMargin = 20, kGap = 10, kTop = 60, kPanelHeight = 300, kWordsHeight = 50, kFont = 15;
constexpr double kMost_hu = 400, kWidest = 420;
constexpr Colour kPaper{0.10, 0.11, 0.13}, kInk{0.9, 0.9, 0.9}, kFaint{0.6, 0.62, 0.65};

/// The width of a slice's panel in the report.
double panel_width(const DifferenceSlice& slice) {
  const double aspect = static_cast<double>(slice.width) * slice.pixel_mm.x /
                        (static_cast<double>(slice.height) * slice.pixel_mm.y);
  return std::min(kWidest, kPanelHeight * aspect);
}

std::vector<std::uint8_t> greys_of(const std::vector<float>& difference_hu) {
  std::vector<std::uint8_t> rgb;
  for (const float hu : difference_hu) {
    const double share = std::clamp(0.5 + 0.5 * hu / kMost_hu, 0.0, 1.0);
    rgb.insert(rgb.end(), 3, static_cast<std::uint8_t>(std::lround(255 * share)));
  }
  return rgb;
}

std::string numbers_of(const PhaseRegistration& phase) {
  std::string words = fmt::format("phase {:.3g}: {}: {}; difference {:.0f} HU before, {:.0f} after (rms)",
                                  phase.phase, phase.name,
                                  phase.field ? fmt::format("moves by up to {:.1f} mm", phase.longest_mm)
                                              : std::string("the reference itself"),
                                  phase.before_hu, phase.after_hu);
  if (phase.landmarks)
    words += fmt::format("; {} landmarks {:.1f} mm apart before, {:.1f} after (mean)", phase.landmarks->count,
                         phase.landmarks->before_mm, phase.landmarks->after_mm);
  return words;
}

/// Draws a slice before and after from `left` on, and returns where the next begins.
double draw(Canvas& sheet, const DifferenceSlice& slice, double left, double top) {
  const double width = panel_width(slice), height = kPanelHeight;
  for (const auto& [difference_hu, words] :
       {std::pair{&slice.before_hu, "before"}, std::pair{&slice.after_hu, "after"}}) {
    sheet.picture(greys_of(*difference_hu), static_cast<int>(slice.width), static_cast<int>(slice.height),
                  {left, top, width, height});
    sheet.rimmed_text({left + 6, top + 18}, words, kFont, kInk, 2);
    left += width + kGap;
  }
  return left + kGap;
}

}  // namespace

RgbPicture registration_report(const std::string& name, const RegisteredMotion& motion) {
  double widest = 900;
  for (const PhaseRegistration& phase : motion.phases)
    widest = std::max(widest, 2 * (panel_width(phase.coronal) + panel_width(phase.sagittal)) + 3 * kMargin);
  const int width = static_cast<int>(widest) + 2 * kMargin,
            height = kTop + static_cast<int>(motion.phases.size()) * (kPanelHeight + kWordsHeight) + kMargin;
  Canvas sheet(width, height, kPaper);
  sheet.text({kMargin, 24}, fmt::format("{} of {}, registered", motion.mode, name), kFont, kInk);
  sheet.text({kMargin, 44}, "phase less reference, coronal and sagittal: black -400 HU, white 400 HU", kFont,
             kFaint);
  double top = kTop;
  for (const PhaseRegistration& phase : motion.phases) {
    sheet.text({kMargin, top + 18}, numbers_of(phase), kFont, kInk);
    const double left = draw(sheet, phase.coronal, kMargin, top + 30);
    draw(sheet, phase.sagittal, left, top + 30);
    top += kPanelHeight + kWordsHeight;
  }
  return {width, height, sheet.rgb()};
}

void write_registration(const RegisteredMotion& motion, const std::string& name,
                        const std::filesystem::path& folder, Progress& progress) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError("{}: cannot be created: {}", folder.string(), error.message());
  OutputSet outputs;
  write_motion(motion, folder, progress);
  write_picture(registration_report(name, motion), folder / "report.png");
  outputs.commit();
}

}  // namespace xraycast
