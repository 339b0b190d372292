#include "xraycast/reports/vessel_report.hpp"

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/reports/scan_projection.hpp"
#include "xraycast/scene/canvas.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>
#include <optional>

namespace xraycast {
namespace {

constexpr int kWidth = 1500, kHeight = 860, kMargin = 20, kTop = 50, kPanelWidth = 510, kPanelHeight = 760;
constexpr int kNamesWidth = 270;  ///< beside the table, where branches have names
constexpr int kFont = 15, kLine = 22, kTableLeft = kMargin + 2 * (kPanelWidth + kMargin);
constexpr std::size_t kRows = (kHeight - kTop) / kLine - 4;  ///< branches that the table lists
constexpr Colour kPaper{0.10, 0.11, 0.13}, kInk{0.9, 0.9, 0.9}, kFaint{0.6, 0.62, 0.65};

void text(Canvas& sheet, double x, double y, const std::string& words, const Colour& colour = kInk,
          Align align = Align::left) {
  sheet.text({x, y}, words, kFont, colour, align);
}

/// The indices of the branches that the table lists, the longest first.
std::vector<std::size_t> listed(const VesselTree& tree) {
  std::vector<std::size_t> order(tree.branches().size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, std::greater{},
                           [&](std::size_t i) { return tree.branches()[i].arc_length_mm.back(); });
  order.resize(std::min(order.size(), kRows));
  return order;
}

/// Writes branches' numbers at points of a picture, in order, except those that would cover another.
class Labels {
 public:
  explicit Labels(Canvas& sheet) : sheet_(sheet) {}

  void add(std::size_t branch, const glm::dvec2& at) {
    constexpr double kSmall = 13, kRim = 2, kDigit = 0.73 * kSmall;  // a digit's height
    const std::string words = fmt::format("{}", branch);
    const glm::dvec2 size = glm::dvec2(sheet_.text_width(words, kSmall), kDigit) + 2 * kRim;
    const PixelBox box{at.x - 0.5 * size.x, at.y - 0.5 * size.y, size.x, size.y};
    if (std::ranges::any_of(taken_, [&](const PixelBox& other) {
          return box.left < other.left + other.width && other.left < box.left + box.width &&
                 box.top < other.top + other.height && other.top < box.top + box.height;
        }))
      return;
    taken_.push_back(box);
    sheet_.rimmed_text({at.x, at.y + 0.5 * kDigit}, words, kSmall, kInk, kRim, Align::centre);
  }

 private:
  Canvas& sheet_;
  std::vector<PixelBox> taken_;
};

/// What fits a projection into a panel.
double largest_scale(const ScanProjection& picture) {
  return std::min(kPanelWidth / picture.width_mm, kPanelHeight / picture.height_mm);
}

/// A bar of a round length, and the length.
void draw_scale(Canvas& sheet, double right, double pixels_per_mm) {
  constexpr double kLongest = 120;  // pixels
  double bar_mm = 0.1;
  for (const double mm : {0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0})
    if (mm * pixels_per_mm <= kLongest) bar_mm = mm;
  constexpr double kBelow = 19, kTextBelow = 24, kGap = 10;
  const double left = right - bar_mm * pixels_per_mm, bottom = kTop + kPanelHeight;
  sheet.line(std::vector{glm::dvec2(left, bottom + kBelow), glm::dvec2(right, bottom + kBelow)}, kFaint);
  text(sheet, left - kGap, bottom + kTextBelow, fmt::format("{:g} mm", bar_mm), kFaint, Align::right);
}

/// Draws a projection, the tree's centrelines over it and the listed branches' numbers into a panel whose
/// left edge is at `left`.
void draw(Canvas& sheet, int left, const ScanProjection& picture, double pixels_per_mm,
          const VolumeGeometry& g, const VesselTree& tree) {
  const double width = picture.width_mm * pixels_per_mm, height = picture.height_mm * pixels_per_mm;
  const PixelBox box = draw_projection(
      sheet, picture,
      {left + 0.5 * (kPanelWidth - width), kTop + 0.5 * (kPanelHeight - height), width, height});
  const int across = picture.axis == 0 ? 1 : 0;
  const auto pixel = [&](const glm::dvec3& p) {
    const glm::dvec3 mm = (g.to_index(p) + 0.5) * g.spacing_mm;
    return glm::dvec2(box.left + mm[across] * pixels_per_mm,
                      box.top + (picture.height_mm - mm.z) * pixels_per_mm);
  };
  for (const VesselBranch& branch : tree.branches()) {
    std::vector<glm::dvec2> line;
    for (const VesselPoint& point : branch.points) line.push_back(pixel(point.position_mm));
    sheet.line(line, {1, 0.85, 0.25});
  }
  Labels labels(sheet);
  for (const std::size_t i : listed(tree)) {
    const VesselBranch& branch = tree.branches()[i];
    labels.add(i, pixel(point_at(branch, 0.5 * branch.arc_length_mm.back()).position_mm));
  }
  text(sheet, left, kTop + kPanelHeight + 24,
       picture.axis == 0 ? "from the left: anterior is on the left"
                         : "from the front: the patient's left is on the right",
       kFaint);
}

/// Measurements of a branch.
struct BranchFacts {
  double length_mm, mean_radius_mm;
  std::optional<double> mean_hu;  ///< of the scan along the centreline
};

double mean_hu(const VesselBranch& branch, const Volume& volume) {
  const VolumeGeometry& g = volume.geometry();
  double hu = 0;
  for (const VesselPoint& point : branch.points) {
    const Index3 voxel =
        glm::clamp(Index3(glm::round(g.to_index(point.position_mm))), Index3(0), g.size - Index3(1));
    hu += volume.at(voxel.x, voxel.y, voxel.z);
  }
  return hu / static_cast<double>(branch.points.size());
}

std::vector<BranchFacts> branch_facts(const VesselTree& tree, const Volume* volume) {
  std::vector<BranchFacts> facts;
  for (const VesselBranch& branch : tree.branches()) {
    double radius_mm = 0;
    for (const VesselPoint& point : branch.points) radius_mm += point.radius_mm;
    facts.push_back({branch.arc_length_mm.back(), radius_mm / static_cast<double>(branch.points.size()), {}});
    if (volume != nullptr) facts.back().mean_hu = mean_hu(branch, *volume);
  }
  return facts;
}

bool has_names(const VesselTree& tree) {
  return std::ranges::any_of(tree.branches(), [](const VesselBranch& b) { return !b.name.empty(); });
}

/// Cut to the width that the table has for it.
std::string name_in_table(Canvas& sheet, const std::string& name) {
  std::string cut = name;
  while (!cut.empty() && sheet.text_width(cut == name ? cut : cut + "…", kFont) > kNamesWidth - kMargin) {
    while ((cut.back() & 0xC0) == 0x80) cut.pop_back();  // the rest of a letter of UTF-8
    cut.pop_back();
  }
  return cut == name ? cut : cut + "…";
}

void draw_table(Canvas& sheet, const VesselTree& tree, const std::vector<BranchFacts>& facts) {
  const auto row = [&](int line, const std::array<std::string, 5>& cells, const std::string& name,
                       const Colour& colour) {
    constexpr std::array kRight{60, 130, 230, 335, 400};
    for (std::size_t i = 0; i < cells.size(); ++i)
      text(sheet, kTableLeft + kRight[i], kTop + kFont + line * kLine, cells[i], colour, Align::right);
    text(sheet, kTableLeft + kRight.back() + kMargin, kTop + kFont + line * kLine, name_in_table(sheet, name),
         colour);
  };
  const bool has_hu = !facts.empty() && facts.front().mean_hu;
  row(0, {"branch", "parent", "length mm", "radius mm", has_hu ? "HU" : ""}, has_names(tree) ? "name" : "",
      kFaint);
  int line = 1;
  for (const std::size_t i : listed(tree)) {
    const BranchFacts& f = facts[i];
    const int parent = tree.branches()[i].parent;
    row(line++,
        {fmt::format("{}", i), parent < 0 ? "root" : fmt::format("{}", parent),
         fmt::format("{:.1f}", f.length_mm), fmt::format("{:.2f}", f.mean_radius_mm),
         f.mean_hu ? fmt::format("{:.0f}", *f.mean_hu) : ""},
        tree.branches()[i].name, kInk);
  }
  if (facts.size() > kRows)
    text(sheet, kTableLeft, kTop + kFont + line * kLine,
         fmt::format("and {}, see tree.json", pluralize(facts.size() - kRows, "shorter one")), kFaint);
}

/// What a segmentation took for granted, and how sure it is, in a line.
std::string assumptions(const SegmentLog& log, const SegmentRequest& request, double weak_fraction) {
  if (const auto* mask = std::get_if<std::filesystem::path>(&request.from_mask))
    return "the mask " + mask->string();
  if (std::holds_alternative<std::shared_ptr<const Mask>>(request.from_mask)) return "a mask that was given";
  const std::size_t seeds = request.markers.vessels_mm.size();
  const char* const source = request.window_hu        ? "as given"
                             : log.is_window_of_seeds ? "around the seeds"
                                                      : "from the histogram";
  std::string window = "no window";
  if (log.window)
    window = fmt::format("window {:.0f} to {:.0f} HU {}", log.window->low_hu, log.window->high_hu, source);
  if (log.scale)
    window = fmt::format("by evidence: lumen of {:.0f} HU above the background, blur {:.1f} voxels",
                         log.scale->lumen_hu, log.scale->blur_vox);
  return fmt::format("{}; noise {:.0f} HU; {}; weak evidence along {:.0f} % of the tree", window,
                     log.noise_hu,
                     log.own_seed ? "begun in the " + log.own_seed->name
                     : seeds == 0 ? "no seeds"
                                  : pluralize(seeds, "seed"),
                     100 * weak_fraction);
}

}  // namespace

std::string counts_of(const Centrelines& centrelines) {
  return pluralize(centrelines.tree.branches().size(), "branch") + ", " +
         pluralize(centrelines.loops.size(), "loop");
}

RgbPicture vessel_report(const std::string& name, const Vessels& vessels, const SegmentRequest& request,
                         const Volume& volume) {
  return given_vessel_report(name, vessels, assumptions(vessels.log, request, vessels.weak_fraction),
                             &volume);
}

RgbPicture given_vessel_report(const std::string& name, const Vessels& vessels, const std::string& origin,
                               const Volume* scan) {
  const VolumeGeometry& grid = vessels.mask.geometry;
  if (scan != nullptr) check_mask_grid(grid, scan->geometry(), "vessels' mask");
  constexpr std::array kRed{Colour{0.95, 0.18, 0.15}};
  const VesselTree& tree = vessels.centrelines.tree;
  const std::vector<std::uint8_t>& mask = vessels.mask.voxels;
  const int width = kWidth + (has_names(tree) ? kNamesWidth : 0);
  Canvas sheet(width, kHeight, kPaper);
  text(sheet, kMargin, 22, fmt::format("{}: {}", name, counts_of(vessels.centrelines)));
  text(sheet, kMargin, 42, origin, kFaint);
  const ScanProjection front = project_scan(grid, scan, mask, kRed, 1),
                       side = project_scan(grid, scan, mask, kRed, 0);
  const double pixels_per_mm = std::min(largest_scale(front), largest_scale(side));  // the same in both
  draw(sheet, kMargin, front, pixels_per_mm, grid, tree);
  draw(sheet, kMargin + kPanelWidth + kMargin, side, pixels_per_mm, grid, tree);
  draw_scale(sheet, 2 * (kMargin + kPanelWidth), pixels_per_mm);
  draw_table(sheet, tree, branch_facts(tree, scan));
  return {width, kHeight, sheet.rgb()};
}

}  // namespace xraycast
