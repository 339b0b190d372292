#include "pictures/vessel_report.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/png_file.hpp"
#include "xraycast/scene/canvas.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>

namespace xraycast::cli {
namespace {

constexpr int kWidth = 1500, kHeight = 860, kMargin = 20, kTop = 50, kPanelWidth = 510, kPanelHeight = 760;
constexpr int kFont = 15, kLine = 22, kTableLeft = kMargin + 2 * (kPanelWidth + kMargin);
constexpr std::size_t kRows = (kHeight - kTop) / kLine - 4;  ///< branches that the table lists
constexpr Colour kPaper{0.10, 0.11, 0.13}, kInk{0.9, 0.9, 0.9}, kFaint{0.6, 0.62, 0.65};

/// The scan along one axis as grey, with the mask over it in red: row 0 is the most superior slice.
struct Projection {
  int axis;           ///< viewing direction: 0 from the left, 1 from the front
  int width, height;  ///< voxels
  double width_mm, height_mm;
  std::vector<std::uint8_t> rgb;
};

Projection project(const Volume& volume, const Mask& mask, int axis) {
  const VolumeGeometry& g = volume.geometry();
  const int across = axis == 0 ? 1 : 0;
  const auto width = g.size[across], depth = g.size[axis];
  Projection picture{axis,
                     static_cast<int>(width),
                     static_cast<int>(g.size.z),
                     static_cast<double>(width) * g.spacing_mm[across],
                     static_cast<double>(g.size.z) * g.spacing_mm.z,
                     {}};
  std::vector<float> mean(static_cast<std::size_t>(width * g.size.z)), vessel(mean.size());
  const double darkest_hu = std::max<double>(-1000, *std::ranges::min_element(volume.hu()));
  parallel_for(g.size.z, [&](std::int64_t z) {
    for (std::int64_t u = 0; u < width; ++u) {
      double sum = 0;
      std::int64_t inside = 0;
      for (std::int64_t v = 0; v < depth; ++v) {
        const Index3 voxel = axis == 0 ? Index3(v, u, z) : Index3(u, v, z);
        // Values above bone are clipped, so that metal does not darken everything else.
        sum += std::clamp<double>(volume.at(voxel.x, voxel.y, voxel.z) - darkest_hu, 0, 2500);
        inside += mask[voxel];
      }
      const auto at = static_cast<std::size_t>((g.size.z - 1 - z) * width + u);
      mean[at] = static_cast<float>(sum / static_cast<double>(depth));
      vessel[at] = static_cast<float>(static_cast<double>(inside) * g.spacing_mm[axis]);
    }
  });
  const float lightest = std::max(1.0F, *std::ranges::max_element(mean));
  constexpr float kSolid_mm = 6;  // lumen of this thickness or more has full colour
  for (std::size_t i = 0; i < mean.size(); ++i) {
    const float grey = 0.85F * mean[i] / lightest,
                share = vessel[i] > 0 ? 0.35F + 0.4F * std::min(1.0F, vessel[i] / kSolid_mm) : 0;
    for (const float red : {0.95F, 0.18F, 0.15F})
      picture.rgb.push_back(static_cast<std::uint8_t>(std::lround(255 * (grey + share * (red - grey)))));
  }
  return picture;
}

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

/// Draws a projection, the tree's centrelines over it and the listed branches' numbers into a panel whose
/// left edge is at `left`.
void draw(Canvas& sheet, int left, const Projection& picture, const VolumeGeometry& g,
          const VesselTree& tree) {
  const double pixels_per_mm = std::min(kPanelWidth / picture.width_mm, kPanelHeight / picture.height_mm);
  const double width = std::max(1.0, std::floor(picture.width_mm * pixels_per_mm)),
               height = std::max(1.0, std::floor(picture.height_mm * pixels_per_mm));
  const double x0 = left + std::floor(0.5 * (kPanelWidth - width)),
               y0 = kTop + std::floor(0.5 * (kPanelHeight - height));
  sheet.picture(picture.rgb, picture.width, picture.height, {x0, y0, width, height});
  const int across = picture.axis == 0 ? 1 : 0;
  const auto pixel = [&](const glm::dvec3& p) {
    const glm::dvec3 mm = (g.to_index(p) + 0.5) * g.spacing_mm;
    return glm::dvec2(x0 + mm[across] * pixels_per_mm, y0 + (picture.height_mm - mm.z) * pixels_per_mm);
  };
  for (const VesselBranch& branch : tree.branches()) {
    std::vector<glm::dvec2> line;
    for (const VesselPoint& point : branch.points) line.push_back(pixel(point.position_mm));
    sheet.line(line, {1, 0.85, 0.25});
  }
  Labels labels(sheet);
  for (const std::size_t i : listed(tree)) {
    const VesselBranch& branch = tree.branches()[i];
    const auto middle = std::ranges::lower_bound(branch.arc_length_mm, 0.5 * branch.arc_length_mm.back()) -
                        branch.arc_length_mm.begin();
    labels.add(i, pixel(branch.points[static_cast<std::size_t>(middle)].position_mm));
  }
  text(sheet, left, kTop + kPanelHeight + 24,
       picture.axis == 0 ? "from the left: anterior is on the left"
                         : "from the front: the patient's left is on the right",
       kFaint);
}

void draw_table(Canvas& sheet, const VesselTree& tree, const std::vector<BranchFacts>& facts) {
  const auto row = [&](int line, const std::array<std::string, 5>& cells, const Colour& colour) {
    constexpr std::array kRight{60, 130, 230, 335, 400};
    for (std::size_t i = 0; i < cells.size(); ++i)
      text(sheet, kTableLeft + kRight[i], kTop + kFont + line * kLine, cells[i], colour, Align::right);
  };
  row(0, {"branch", "parent", "length mm", "radius mm", "HU"}, kFaint);
  int line = 1;
  for (const std::size_t i : listed(tree)) {
    const BranchFacts& f = facts[i];
    const int parent = tree.branches()[i].parent;
    row(line++,
        {fmt::format("{}", i), parent < 0 ? "root" : fmt::format("{}", parent),
         fmt::format("{:.1f}", f.length_mm), fmt::format("{:.2f}", f.mean_radius_mm),
         fmt::format("{:.0f}", f.mean_hu)},
        kInk);
  }
  if (facts.size() > kRows)
    text(sheet, kTableLeft, kTop + kFont + line * kLine,
         fmt::format("and {}, see tree.json", pluralize(facts.size() - kRows, "shorter one")), kFaint);
}

}  // namespace

std::vector<BranchFacts> branch_facts(const VesselTree& tree, const Volume& volume) {
  const VolumeGeometry& g = volume.geometry();
  std::vector<BranchFacts> facts;
  for (const VesselBranch& branch : tree.branches()) {
    double radius_mm = 0, hu = 0;
    for (const VesselPoint& point : branch.points) {
      const Index3 voxel =
          glm::clamp(Index3(glm::round(g.to_index(point.position_mm))), Index3(0), g.size - Index3(1));
      radius_mm += point.radius_mm;
      hu += volume.at(voxel.x, voxel.y, voxel.z);
    }
    const auto count = static_cast<double>(branch.points.size());
    facts.push_back({branch.arc_length_mm.back(), radius_mm / count, hu / count});
  }
  return facts;
}

void write_vessel_report(const std::string& title, const Volume& volume, const Mask& mask,
                         const VesselTree& tree, const std::filesystem::path& path) {
  Canvas sheet(kWidth, kHeight, kPaper);
  text(sheet, kMargin, 30, title);
  draw(sheet, kMargin, project(volume, mask, 1), volume.geometry(), tree);
  draw(sheet, kMargin + kPanelWidth + kMargin, project(volume, mask, 0), volume.geometry(), tree);
  draw_table(sheet, tree, branch_facts(tree, volume));
  write_png(sheet.rgb(), kWidth, kHeight, 3, path);
}

}  // namespace xraycast::cli
