#include "vessel_report.hpp"

#include "xraycast/base/image.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <fmt/format.h>
#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>

namespace xraycast::cli {
namespace {

namespace Algo = OIIO::ImageBufAlgo;
using Colour = std::array<float, 3>;
constexpr int kWidth = 1500, kHeight = 860, kMargin = 20, kTop = 50, kPanelWidth = 510, kPanelHeight = 760;
constexpr int kFont = 15, kLine = 22, kTableLeft = kMargin + 2 * (kPanelWidth + kMargin);
constexpr std::size_t kRows = (kHeight - kTop) / kLine - 4;  ///< branches that the table lists
constexpr Colour kPaper{0.10F, 0.11F, 0.13F}, kInk{0.9F, 0.9F, 0.9F}, kFaint{0.6F, 0.62F, 0.65F};

/// The scan along one axis as grey, with the mask over it in red: row 0 is the most superior slice.
struct Projection {
  int axis;           ///< along which it looks: 0 from the left, 1 from the front
  int width, height;  ///< voxels
  double width_mm, height_mm;
  std::vector<float> rgb;
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
        // What is denser than bone does not count for more, lest metal darken all else.
        sum += std::clamp<double>(volume.at(voxel.x, voxel.y, voxel.z) - darkest_hu, 0, 2500);
        inside += mask[voxel];
      }
      const auto at = static_cast<std::size_t>((g.size.z - 1 - z) * width + u);
      mean[at] = static_cast<float>(sum / static_cast<double>(depth));
      vessel[at] = static_cast<float>(static_cast<double>(inside) * g.spacing_mm[axis]);
    }
  });
  const float lightest = std::max(1.0F, *std::ranges::max_element(mean));
  constexpr float kSolid_mm = 6;  // so much lumen is drawn as dense as any more
  for (std::size_t i = 0; i < mean.size(); ++i) {
    const float grey = 0.85F * mean[i] / lightest,
                share = vessel[i] > 0 ? 0.35F + 0.4F * std::min(1.0F, vessel[i] / kSolid_mm) : 0;
    for (const float red : {0.95F, 0.18F, 0.15F}) picture.rgb.push_back(grey + share * (red - grey));
  }
  return picture;
}

void text(OIIO::ImageBuf& sheet, int x, int y, const std::string& words, const Colour& colour = kInk,
          Algo::TextAlignX align = Algo::TextAlignX::Left) {
  Algo::render_text(sheet, x, y, words, kFont, "DejaVuSans", colour, align);
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

/// Writes branches' numbers around places in a picture, in that order, but for those that would cover
/// another.
class Labels {
 public:
  explicit Labels(OIIO::ImageBuf& sheet) : sheet_(sheet) {}

  void add(std::size_t branch, int x, int y) {
    constexpr int kSmall = 13, kOutline = 2;
    const std::string words = fmt::format("{}", branch);
    const OIIO::ROI size = Algo::text_size(words, kSmall, "DejaVuSans");
    const int right = size.width() / 2 + kOutline, down = size.height() / 2 + kOutline;
    const OIIO::ROI box(x - right, x + right, y - down, y + down);
    if (std::ranges::any_of(taken_, [&](const OIIO::ROI& other) {
          return box.xbegin < other.xend && other.xbegin < box.xend && box.ybegin < other.yend &&
                 other.ybegin < box.yend;
        }))
      return;
    taken_.push_back(box);
    Algo::render_text(sheet_, x, y, words, kSmall, "DejaVuSans", kInk, Algo::TextAlignX::Center,
                      Algo::TextAlignY::Center, kOutline);
  }

 private:
  OIIO::ImageBuf& sheet_;
  std::vector<OIIO::ROI> taken_;
};

/// Draws a projection, the tree's centrelines over it and the listed branches' numbers into a panel whose
/// left edge is at `left`.
void draw(OIIO::ImageBuf& sheet, int left, const Projection& picture, const VolumeGeometry& g,
          const VesselTree& tree) {
  const double pixels_per_mm = std::min(kPanelWidth / picture.width_mm, kPanelHeight / picture.height_mm);
  const OIIO::ROI roi(0, std::max(1, static_cast<int>(picture.width_mm * pixels_per_mm)), 0,
                      std::max(1, static_cast<int>(picture.height_mm * pixels_per_mm)), 0, 1, 0, 3);
  const OIIO::ImageBuf source(OIIO::ImageSpec(picture.width, picture.height, 3, OIIO::TypeDesc::FLOAT),
                              const_cast<float*>(picture.rgb.data()));
  const int x0 = left + (kPanelWidth - roi.width()) / 2, y0 = kTop + (kPanelHeight - roi.height()) / 2;
  Algo::paste(sheet, x0, y0, 0, 0, Algo::resize(source, "", 0.0F, roi));
  const int across = picture.axis == 0 ? 1 : 0;
  const auto pixel = [&](const glm::dvec3& p) {
    const glm::dvec3 mm = (g.to_index(p) + 0.5) * g.spacing_mm;
    return std::pair(x0 + static_cast<int>(mm[across] * pixels_per_mm),
                     y0 + static_cast<int>((picture.height_mm - mm.z) * pixels_per_mm));
  };
  for (const VesselBranch& branch : tree.branches())
    for (std::size_t i = 1; i < branch.points.size(); ++i) {
      const auto [ax, ay] = pixel(branch.points[i - 1].position_mm);
      const auto [bx, by] = pixel(branch.points[i].position_mm);
      Algo::render_line(sheet, ax, ay, bx, by, Colour{1.0F, 0.85F, 0.25F}, true);
    }
  Labels labels(sheet);
  for (const std::size_t i : listed(tree)) {
    const VesselBranch& branch = tree.branches()[i];
    const auto middle = std::ranges::lower_bound(branch.arc_length_mm, 0.5 * branch.arc_length_mm.back()) -
                        branch.arc_length_mm.begin();
    const auto [x, y] = pixel(branch.points[static_cast<std::size_t>(middle)].position_mm);
    labels.add(i, x, y);
  }
  text(sheet, left, kTop + kPanelHeight + 24,
       picture.axis == 0 ? "from the left: anterior is on the left"
                         : "from the front: the patient's left is on the right",
       kFaint);
}

void draw_table(OIIO::ImageBuf& sheet, const VesselTree& tree, const std::vector<BranchFacts>& facts) {
  const auto row = [&](int line, const std::array<std::string, 5>& cells, const Colour& colour) {
    constexpr std::array kRight{60, 130, 230, 335, 400};
    for (std::size_t i = 0; i < cells.size(); ++i)
      text(sheet, kTableLeft + kRight[i], kTop + kFont + line * kLine, cells[i], colour,
           Algo::TextAlignX::Right);
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
  OIIO::ImageBuf sheet(OIIO::ImageSpec(kWidth, kHeight, 3, OIIO::TypeDesc::FLOAT));
  Algo::fill(sheet, kPaper);
  text(sheet, kMargin, 30, title);
  draw(sheet, kMargin, project(volume, mask, 1), volume.geometry(), tree);
  draw(sheet, kMargin + kPanelWidth + kMargin, project(volume, mask, 0), volume.geometry(), tree);
  draw_table(sheet, tree, branch_facts(tree, volume));
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(3) * kWidth * kHeight);
  sheet.get_pixels(sheet.roi(), OIIO::TypeDesc::UINT8, pixels.data());
  write_png(pixels, kWidth, kHeight, 3, path);
}

}  // namespace xraycast::cli
