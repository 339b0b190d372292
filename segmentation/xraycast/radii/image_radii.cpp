#include "xraycast/radii/image_radii.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/evidence/axes_across.hpp"
#include "xraycast/evidence/robust_statistics.hpp"
#include "xraycast/geometry/segment_index.hpp"
#include "xraycast/radii/tube_fit.hpp"
#include "xraycast/radii/tube_samples.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace xraycast {
namespace {

// Lengths in voxels.
constexpr double kBeyond_vox = 4, kApart_vox = 1.5, kNode_vox = 1.25, kWindow_vox = 2.5, kLongWindow_vox = 4,
                 kWidest_vox = 20;
constexpr double kOff_vox = 0.35;  // by how much a line is off the middle, in one direction across
constexpr std::size_t kNodesOfPiece = 12;

/// A place of a branch where its radius is measured.
struct Node {
  double along_mm;
  glm::dvec3 tangent, u, v;  ///< an orthonormal frame
  double given_mm;           ///< the radius there
  bool is_alone = false;     ///< in no other branch, and not too wide
  bool is_steady = false;    ///< the given radius changes little about it
  std::size_t piece = 0;     ///< of those that are alone
  glm::dvec3 off_mm{0, 0, 0};
  double radius_mm = 0;  ///< what was found; none where it is zero

  bool is_found() const { return radius_mm > 0; }
};

/// The lumen's CT number that was found on a piece, its contrast, and how far off both may be. Unknown where
/// the deviation is zero.
struct FoundLumen {
  double hu = 0, contrast_hu = 0, deviation_hu = 0;
};

/// The CT number of most vessels' lumen, and its spread.
struct UsualLumen {
  double hu, spread_hu;
};

/// A stretch of a branch.
struct Piece {
  std::size_t branch;
  double first_mm, last_mm;
  double given_mm;           ///< the mean radius
  glm::dvec3 tangent, u, v;  ///< as of a node
  FoundLumen lumen = {};
};

struct Weighted {
  double value, weight;
};

double median(std::vector<Weighted> values) {
  std::ranges::sort(values, {}, &Weighted::value);
  double all = 0, sum = 0;
  for (const Weighted& w : values) all += w.weight;
  for (const Weighted& w : values)
    if ((sum += w.weight) >= 0.5 * all) return w.value;
  return values.back().value;
}

/// Of values with weights, the median and the spread about it, at least a share of the contrasts' median.
std::optional<UsualLumen> usual_lumen(const std::vector<FoundLumen>& lumens) {
  constexpr double kLeastSpread = 0.08, kOfMedian = 1.5;
  std::vector<Weighted> values, contrasts;
  for (const FoundLumen& found : lumens) {
    if (!(found.deviation_hu > 0) || !(found.contrast_hu > 0)) continue;
    const double weight = std::pow(found.contrast_hu / found.deviation_hu, 2);
    values.push_back({found.hu, weight});
    contrasts.push_back({found.contrast_hu, weight});
  }
  if (values.empty()) return std::nullopt;
  const double usual_hu = median(values);
  for (Weighted& value : values) value.value = std::abs(value.value - usual_hu);
  return UsualLumen{usual_hu, std::max(kOfMedian * median(values), kLeastSpread * median(contrasts))};
}

/// A line's direction and two across it, each of length one; any where a line turns back.
std::array<glm::dvec3, 3> frame_of(const glm::dvec3& along) {
  const double length = glm::length(along);
  const glm::dvec3 tangent = length > 0 ? along / length : glm::dvec3(0, 0, 1);
  const auto [u, v] = axes_across(tangent);
  return {tangent, u, v};
}

class ImageRadii {
 public:
  ImageRadii(const VesselTree& tree, const ScanOfVessels& scan)
      : branches_(tree.branches()), scan_(scan), nodes_(branches_.size()) {
    const glm::dvec3 s = scan.volume.geometry().spacing_mm;
    voxel_mm_ = std::cbrt(s.x * s.y * s.z);
    voxel_variance_mm2_ = s * s / 12.0;
    samples_ = tube_samples(tree, scan.volume,
                            {kBeyond_vox * voxel_mm_, kApart_vox * voxel_mm_, kWidest_vox * voxel_mm_});
    place_nodes();
    cut_pieces();
  }

  std::vector<VesselBranch> branches(Progress& progress) {
    progress.advance();
    for_each_node([&](std::size_t b, Node& node) { centre(b, node); });
    const bool is_known = measure_blur() && measure_lumens();
    progress.advance();
    if (is_known) for_each_node([&](std::size_t b, Node& node) { measure(b, node); });
    progress.advance();
    std::vector<VesselBranch> result = branches_;
    for (std::size_t b = 0; b < result.size(); ++b) set_radii(nodes_[b], result[b]);
    return result;
  }

 private:
  template <typename Work>
  void for_each_node(const Work& work) {
    std::vector<std::pair<std::size_t, Node*>> all;
    for (std::size_t b = 0; b < nodes_.size(); ++b)
      for (Node& node : nodes_[b])
        if (node.is_alone) all.emplace_back(b, &node);
    parallel_for(std::ssize(all), [&](std::int64_t i) {
      const auto [branch, node] = all[static_cast<std::size_t>(i)];
      work(branch, *node);
    });
  }

  // ---- places -------------------------------------------------------------------------------------------

  SegmentIndex all_segments() const {
    std::vector<SegmentIndex::Segment> segments;
    for (std::size_t b = 0; b < branches_.size(); ++b)
      for (std::size_t i = 0; i + 1 < branches_[b].points.size(); ++i) {
        const VesselPoint &from = branches_[b].points[i], &to = branches_[b].points[i + 1];
        segments.push_back({from.position_mm, to.position_mm, from.radius_mm, to.radius_mm,
                            static_cast<int>(b), static_cast<int>(i)});
      }
    return SegmentIndex(std::move(segments));
  }

  void place_nodes() {
    const SegmentIndex segments = all_segments();
    double widest_mm = 0;
    for (const VesselBranch& branch : branches_)
      for (const VesselPoint& p : branch.points) widest_mm = std::max(widest_mm, p.radius_mm);
    parallel_for(std::ssize(branches_), [&](std::int64_t i) {
      const auto b = static_cast<std::size_t>(i);
      const double all_mm = branches_[b].arc_length_mm.back();
      const auto count = static_cast<std::int64_t>(all_mm / (kNode_vox * voxel_mm_)) + 1;
      for (std::int64_t k = 0; k < count; ++k) {
        Node node =
            node_at(branches_[b], (static_cast<double>(k) + 0.5) * all_mm / static_cast<double>(count));
        const glm::dvec3 at_mm = point_at(branches_[b], node.along_mm).position_mm;
        const auto is_in_another = [&](const SegmentIndex::Nearest& place) {
          return place.segment.branch != static_cast<int>(b) && place.out_mm() < 0;
        };
        node.is_alone =
            node.given_mm < kWidest_vox * voxel_mm_ && !segments.nearest(at_mm, widest_mm, is_in_another);
        nodes_[b].push_back(node);
      }
    });
  }

  Node node_at(const VesselBranch& branch, double along_mm) const {
    const double half_mm = kWindow_vox * voxel_mm_;
    const glm::dvec3 before = point_at(branch, along_mm - half_mm).position_mm,
                     after = point_at(branch, along_mm + half_mm).position_mm;
    const auto [tangent, u, v] = frame_of(after - before);
    Node node{along_mm, tangent, u, v, point_at(branch, along_mm).radius_mm};
    node.is_steady = is_steady(branch, node);
    return node;
  }

  /// Whether the given radius changes little within the window about a node, in which one radius is measured:
  /// not in a short stenosis.
  bool is_steady(const VesselBranch& branch, const Node& node) const {
    constexpr double kMost_vox = 0.75, kOfRadius = 0.25;
    const double half_mm = window_mm(node.given_mm);
    double low_mm = node.given_mm, high_mm = node.given_mm;
    for (auto i = std::ranges::lower_bound(branch.arc_length_mm, node.along_mm - half_mm) -
                  branch.arc_length_mm.begin();
         i < std::ssize(branch.points); ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (branch.arc_length_mm[at] > node.along_mm + half_mm) break;
      low_mm = std::min(low_mm, branch.points[at].radius_mm);
      high_mm = std::max(high_mm, branch.points[at].radius_mm);
    }
    return high_mm - low_mm < kMost_vox * voxel_mm_ + kOfRadius * node.given_mm;
  }

  /// Nodes that follow each other, none of them in another branch, in pieces of about as many.
  void cut_pieces() {
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      std::vector<Node>& nodes = nodes_[b];
      for (std::size_t first = 0; first < nodes.size();) {
        std::size_t last = first;
        while (last < nodes.size() && nodes[last].is_alone) ++last;
        const std::size_t count = last - first, parts = (count + kNodesOfPiece - 1) / kNodesOfPiece;
        for (std::size_t k = 0; k < parts; ++k)
          add_piece(b, std::span(nodes).subspan(first + k * count / parts,
                                                (k + 1) * count / parts - k * count / parts));
        first = last + 1;
      }
    }
  }

  void add_piece(std::size_t branch, std::span<Node> nodes) {
    glm::dvec3 along(0);
    double given_mm = 0;
    for (Node& node : nodes) {
      node.piece = pieces_.size();
      along += node.tangent;
      given_mm += node.given_mm / static_cast<double>(nodes.size());
    }
    const auto [tangent, u, v] = frame_of(along);
    const double half_mm = 0.5 * kNode_vox * voxel_mm_;
    pieces_.push_back(
        {branch, nodes.front().along_mm - half_mm, nodes.back().along_mm + half_mm, given_mm, tangent, u, v});
  }

  /// Calls `visit` for samples of a stretch of a branch: of a wide one for as many as tell enough.
  template <typename Visit>
  void for_samples_between(std::size_t branch, double first_mm, double last_mm, const Visit& visit) const {
    constexpr std::ptrdiff_t kEnough = 2000;
    const std::vector<TubeSample>& all = samples_[branch];
    const auto first = std::ranges::lower_bound(all, first_mm, {}, &TubeSample::along_mm),
               last = std::ranges::upper_bound(all, last_mm, {}, &TubeSample::along_mm);
    const std::ptrdiff_t every = (last - first) / kEnough + 1;
    for (std::ptrdiff_t i = 0; i < last - first; i += every) visit(first[i]);
  }

  // ---- fits ---------------------------------------------------------------------------------------------

  /// The blur across a tangent, with the voxels' own width.
  double across_mm(double blur_mm, const glm::dvec3& tangent) const {
    const glm::dvec3 v = voxel_variance_mm2_;
    const double own_mm2 = 0.5 * (v.x + v.y + v.z - glm::dot(tangent, v * tangent));
    return std::sqrt(blur_mm * blur_mm + own_mm2);
  }

  /// Whether a blur with the voxels' own width is about the same in all directions across a node.
  bool is_round(double blur_mm, const Node& node) const {
    constexpr double kMostRatio = 2.2;
    const glm::dvec3 v = voxel_variance_mm2_;
    const double uu = blur_mm * blur_mm + glm::dot(node.u, v * node.u),
                 vv = blur_mm * blur_mm + glm::dot(node.v, v * node.v), uv = glm::dot(node.u, v * node.v),
                 middle = 0.5 * (uu + vv), half = std::hypot(0.5 * (uu - vv), uv);
    return middle + half < kMostRatio * kMostRatio * (middle - half);
  }

  /// A guess of lumen and surroundings, by the samples within a radius and beside it.
  struct Guess {
    double lumen_hu, around_hu;
    std::array<double, Tube::kDirections> each_around_hu{};
    double contrast_hu() const { return lumen_hu - around_hu; }
  };

  std::optional<Guess> guess(std::span<const SampleAcross> samples, double radius_mm) const {
    constexpr double kInside_vox = 2, kOutside_vox = 1.2;
    const double inside_mm = std::max(0.5 * radius_mm + 0.3 * voxel_mm_, radius_mm - kInside_vox * voxel_mm_);
    std::vector<double> inside, outside;
    std::array<std::vector<double>, Tube::kDirections> outside_each;
    for (const SampleAcross& s : samples) {
      const double mm = glm::length(s.at_mm);
      if (mm < inside_mm) inside.push_back(seen_hu(s.hu));
      if (mm <= radius_mm + kOutside_vox * voxel_mm_) continue;
      outside.push_back(seen_hu(s.hu));
      outside_each[nearest_direction(s.at_mm)].push_back(seen_hu(s.hu));
    }
    if (inside.empty() || outside.empty()) return std::nullopt;
    Guess found{quantile(inside, 0.6), scan_.response != nullptr ? 0 : quantile(outside, 0.4)};
    if (!(found.contrast_hu() > 0)) return std::nullopt;
    for (std::size_t k = 0; k < Tube::kDirections; ++k)
      found.each_around_hu[k] = outside_each[k].empty() || scan_.response != nullptr
                                    ? found.around_hu
                                    : quantile(outside_each[k], 0.5);
    return found;
  }

  double seen_hu(double hu) const { return scan_.response != nullptr ? scan_.response->contrast_hu(hu) : hu; }

  /// A question about a tube of a radius, of which only what every fit needs is set.
  TubeQuestion question(const Guess& guessed, double blur_mm, double radius_mm) const {
    constexpr double kUneven = 0.08;  // lumen and surroundings, of the contrast
    constexpr Known kZero{0, 0};
    const double contrast_hu = guessed.contrast_hu();
    TubeQuestion q{blur_mm,
                   std::max(std::hypot(scan_.noise_hu, kUneven * contrast_hu), 1.0),
                   scan_.response,
                   {radius_mm, 0, guessed.lumen_hu, {0, 0}, guessed.each_around_hu}};
    q.taper = q.off_x = q.off_y = kZero;
    if (scan_.response != nullptr) {
      q.is_even = true;
      q.around = {0, kUneven * contrast_hu};
    }
    return q;
  }

  /// The samples about a node, in its frame, weighted less the farther along the line they are.
  std::vector<SampleAcross> samples_about(std::size_t branch, const Node& node, double half_mm) const {
    std::vector<SampleAcross> result;
    const auto add = [&](const TubeSample& s) {
      const double along_mm = s.along_mm - node.along_mm;
      result.push_back({{glm::dot(s.from_axis_mm, node.u), glm::dot(s.from_axis_mm, node.v)},
                        along_mm,
                        1 - std::abs(along_mm) / half_mm,
                        s.hu});
    };
    for_samples_between(branch, node.along_mm - half_mm, node.along_mm + half_mm, add);
    return result;
  }

  /// Moves a node's axis to the middle of what the scan shows, whatever the radius.
  void centre(std::size_t branch, Node& node) const {
    constexpr double kBlur_vox = 0.5;
    const std::vector<SampleAcross> samples = samples_about(branch, node, kLongWindow_vox * voxel_mm_);
    const auto guessed = guess(samples, node.given_mm);
    if (!guessed) return;
    TubeQuestion q = question(*guessed, across_mm(kBlur_vox * voxel_mm_, node.tangent), node.given_mm);
    q.radius = {node.given_mm, 0};
    q.off_x = q.off_y = {0, kOff_vox * voxel_mm_};
    if (const auto found = fit_tube(samples, q))
      node.off_mm = found->tube.off_mm.x * node.u + found->tube.off_mm.y * node.v;
  }

  /// The middle of what the scan shows beside a line.
  glm::dvec3 off_mm(std::size_t branch, double along_mm) const {
    const std::vector<Node>& nodes = nodes_[branch];
    const auto after = std::ranges::lower_bound(nodes, along_mm, {}, &Node::along_mm);
    if (after == nodes.begin()) return nodes.front().off_mm;
    if (after == nodes.end()) return nodes.back().off_mm;
    const Node &a = *std::prev(after), &b = *after;
    return glm::mix(a.off_mm, b.off_mm, (along_mm - a.along_mm) / (b.along_mm - a.along_mm));
  }

  /// The samples of a piece by their distance from the middle.
  std::vector<SampleAcross> samples_of(const Piece& piece) const {
    std::vector<SampleAcross> result;
    const double middle_mm = std::midpoint(piece.first_mm, piece.last_mm);
    const auto add = [&](const TubeSample& s) {
      const glm::dvec3 from = s.from_axis_mm - off_mm(piece.branch, s.along_mm);
      const glm::dvec2 across(glm::dot(from, piece.u), glm::dot(from, piece.v));
      // In a bend, a piece's frame is not that of each place.
      const double scale = glm::length(from) / std::max(glm::length(across), 1e-6);
      result.push_back({scale * across, s.along_mm - middle_mm, 1, s.hu});
    };
    for_samples_between(piece.branch, piece.first_mm, piece.last_mm, add);
    return result;
  }

  std::optional<TubeAnswer> fit_piece(const Piece& piece, std::span<const SampleAcross> samples,
                                      const Guess& guessed, double blur_mm) const {
    constexpr double kMostTaper = 0.05;
    TubeQuestion q = question(guessed, across_mm(blur_mm, piece.tangent), piece.given_mm);
    q.taper = {0, kMostTaper};
    return fit_tube(samples, q);
  }

  // ---- the scan's blur, and the lumen's CT number -------------------------------------------------------

  /// By how much residuals exceed the noise.
  double misfit(const TubeAnswer& found) const {
    return std::max(1.0, found.rms_hu / std::max(scan_.noise_hu, 1.0));
  }

  FoundLumen lumen_of(const TubeAnswer& found, double blur_mm) const {
    // A line that is off the middle makes a vessel wider and darker, the more the thinner it is.
    constexpr double kUneven = 0.05, kWobble_vox2 = 0.06, kOfBlur = 0.4;
    const double blur_vox = blur_mm / voxel_mm_, radius_vox = found.tube.radius_mm / voxel_mm_,
                 wobble_vox2 = kWobble_vox2 + kOfBlur * blur_vox * blur_vox,
                 wobble = 4 * wobble_vox2 / (radius_vox * radius_vox + 4 * wobble_vox2),
                 contrast_hu = std::max(found.tube.contrast_hu(), 0.0);
    return {found.tube.lumen_hu, contrast_hu,
            std::hypot(found.lumen_deviation_hu * misfit(found), std::max(kUneven, wobble) * contrast_hu)};
  }

  /// What a blur makes of a piece.
  struct Explained {
    double cost = 0;  ///< the residuals' logarithm for each sample
    FoundLumen lumen;
  };

  static constexpr std::size_t kBlurs = 16;
  using OfBlurs = std::array<Explained, kBlurs>;

  /// Blurs from none to two voxels: a tenth of a voxel apart up to one, farther beyond.
  double blur_of_step_mm(double step) const {
    constexpr double kStep_vox = 0.1, kFine = 10, kGrowth = 1.15;
    return voxel_mm_ *
           (step <= kFine ? kStep_vox * step : kStep_vox * kFine * std::pow(kGrowth, step - kFine));
  }

  OfBlurs explained_by_each(const Piece& piece) const {
    constexpr double kEven = 0.02, kRounding_hu = 0.3;
    const std::vector<SampleAcross> samples = samples_of(piece);
    const auto guessed = guess(samples, piece.given_mm);
    if (!guessed) return {};
    const double floor_hu = std::max(kEven * guessed->contrast_hu(), kRounding_hu);
    OfBlurs result;
    for (std::size_t k = 0; k < kBlurs; ++k) {
      const double blur_mm = blur_of_step_mm(static_cast<double>(k));
      const auto found = fit_piece(piece, samples, *guessed, blur_mm);
      if (!found) return {};
      result[k] = {found->samples * std::log(std::hypot(found->rms_of_all_hu, floor_hu)),
                   lumen_of(*found, blur_mm)};
    }
    return result;
  }

  /// How badly a blur explains all pieces: the residuals, and lumens that differ. Of a thin vessel a smaller
  /// blur makes a wider and darker one, which its own samples hardly contradict.
  static double cost_of(std::size_t blur, const std::vector<OfBlurs>& pieces) {
    constexpr double kMostOdds = 4.5;  // for a vessel that is of another brightness
    std::vector<FoundLumen> lumens;
    double cost = 0;
    for (const OfBlurs& piece : pieces) {
      lumens.push_back(piece[blur].lumen);
      cost += piece[blur].cost;
    }
    const auto usual = usual_lumen(lumens);
    if (!usual) return cost;
    for (const FoundLumen& lumen : lumens)
      if (lumen.deviation_hu > 0)
        cost += std::min(
            0.5 * std::pow((lumen.hu - usual->hu) / std::hypot(lumen.deviation_hu, usual->spread_hu), 2),
            kMostOdds);
    return cost;
  }

  /// Pieces that tell the blur: the widest ones, which tell most, and of the others as many.
  std::vector<std::size_t> telling_pieces() const {
    constexpr std::size_t kWide = 40, kOthers = 40;
    std::vector<std::size_t> order(pieces_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, std::greater(), [&](std::size_t i) { return pieces_[i].given_mm; });
    std::vector<std::size_t> telling;
    const std::size_t every = order.size() > kWide ? (order.size() - kWide) / kOthers + 1 : 1;
    for (std::size_t i = 0; i < order.size(); i += i < kWide ? 1 : every) telling.push_back(order[i]);
    return telling;
  }

  /// The blur with which all pieces are explained best: of each the residuals' logarithm counts, so that one
  /// that is no round tube says little. False where it is more than can be told.
  bool measure_blur() {
    constexpr double kUsual = 4, kSpread = 4;  // steps
    const std::vector<std::size_t> telling = telling_pieces();
    std::vector<OfBlurs> pieces(telling.size());
    parallel_for(std::ssize(pieces), [&](std::int64_t i) {
      pieces[static_cast<std::size_t>(i)] = explained_by_each(pieces_[telling[static_cast<std::size_t>(i)]]);
    });
    std::array<double, kBlurs> costs{};
    for (std::size_t k = 0; k < kBlurs; ++k)
      costs[k] = cost_of(k, pieces) + 0.5 * std::pow((static_cast<double>(k) - kUsual) / kSpread, 2);
    const auto best = static_cast<std::size_t>(std::ranges::min_element(costs) - costs.begin());
    double step = static_cast<double>(best);
    if (best > 0 && best + 1 < kBlurs) {
      const double a = costs[best - 1], b = costs[best], c = costs[best + 1];
      if (a - 2 * b + c > 0) step += 0.5 * (a - c) / (a - 2 * b + c);
    }
    blur_mm_ = blur_of_step_mm(step);
    return best + 1 < kBlurs;
  }

  /// False where no piece shows a lumen.
  bool measure_lumens() {
    parallel_for(std::ssize(pieces_), [&](std::int64_t i) {
      Piece& piece = pieces_[static_cast<std::size_t>(i)];
      const std::vector<SampleAcross> samples = samples_of(piece);
      const auto guessed = guess(samples, piece.given_mm);
      if (!guessed) return;
      if (const auto found = fit_piece(piece, samples, *guessed, blur_mm_))
        piece.lumen = lumen_of(*found, blur_mm_);
    });
    std::vector<FoundLumen> lumens;
    for (const Piece& piece : pieces_) lumens.push_back(piece.lumen);
    const auto usual = usual_lumen(lumens);
    if (usual) usual_ = *usual;
    return usual.has_value();
  }

  /// What is known of the lumen on a piece: its own CT number and that of all, each as far as it is known, or
  /// its own alone where it is another one.
  Known known_lumen(const Piece& piece) const {
    constexpr double kOther = 3;  // deviations
    const double usual = 1 / (usual_.spread_hu * usual_.spread_hu);
    const auto [hu, contrast_hu, deviation_hu] = piece.lumen;
    if (!(deviation_hu > 0)) return {usual_.hu, usual_.spread_hu};
    if (std::abs(hu - usual_.hu) > kOther * std::hypot(deviation_hu, usual_.spread_hu))
      return {hu, deviation_hu};
    const double own = 1 / (deviation_hu * deviation_hu);
    return {(usual * usual_.hu + own * hu) / (usual + own), 1 / std::sqrt(usual + own)};
  }

  // ---- radii --------------------------------------------------------------------------------------------

  /// The half length about a node that tells its radius: the more of a thinner vessel, of which each voxel
  /// says less.
  double window_mm(double radius_mm) const {
    return std::clamp(5 * voxel_mm_ - 2 * radius_mm, kWindow_vox * voxel_mm_, kLongWindow_vox * voxel_mm_);
  }

  void measure(std::size_t branch, Node& node) const {
    if (!node.is_steady || !is_round(blur_mm_, node)) return;
    const std::vector<SampleAcross> samples = samples_about(branch, node, window_mm(node.given_mm));
    const auto guessed = guess(samples, node.given_mm);
    if (!guessed) return;
    TubeQuestion q = question(*guessed, across_mm(blur_mm_, node.tangent), node.given_mm);
    q.lumen = known_lumen(pieces_[node.piece]);
    q.start.lumen_hu = q.lumen.mean;
    q.start.off_mm = {glm::dot(node.off_mm, node.u), glm::dot(node.off_mm, node.v)};
    q.off_x = {q.start.off_mm.x, kOff_vox * voxel_mm_};
    q.off_y = {q.start.off_mm.y, kOff_vox * voxel_mm_};
    const auto found = fit_tube(samples, q);
    if (found && is_plausible(node, *found)) node.radius_mm = found->tube.radius_mm;
  }

  bool is_plausible(const Node& node, const TubeAnswer& found) const {
    constexpr double kMost_vox = 0.5, kOfRadius = 1.0 / 3, kShareIn = 0.7, kUneven = 0.12, kTimesNoise = 1.5,
                     kSure_vox = 0.3, kSure = 0.1;
    const double contrast_hu = found.tube.contrast_hu(), given_mm = node.given_mm;
    return contrast_hu > 0 &&
           std::abs(found.tube.radius_mm - given_mm) < kMost_vox * voxel_mm_ + kOfRadius * given_mm &&
           found.radius_deviation_mm * misfit(found) < kSure_vox * voxel_mm_ + kSure * given_mm &&
           found.share_in > kShareIn &&
           found.rms_hu < kTimesNoise * std::hypot(scan_.noise_hu, kUneven * contrast_hu);
  }

  /// The change of the radius at each node, of what was found there or near it: it fades within 15 voxels,
  /// but not within another branch, where the given radius is that outside.
  std::vector<double> changes_mm(const std::vector<Node>& nodes) const {
    std::vector<Carried> from_before = carried(nodes.begin(), nodes.end()),
                         from_after = carried(nodes.rbegin(), nodes.rend());
    std::ranges::reverse(from_after);
    std::vector<double> changes(nodes.size());
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const auto [before_mm, before] = from_before[i];
      const auto [after_mm, after] = from_after[i];
      const double both = before + after;
      changes[i] = both > 0 ? std::lerp(before_mm, after_mm, before / both) : before_mm;
    }
    return changes;
  }

  /// A change, and from how many nodes away it was carried.
  struct Carried {
    double change_mm, nodes;
  };

  template <typename Iterator>
  static std::vector<Carried> carried(Iterator first, Iterator last) {
    constexpr double kFull = 6, kGone = 12;  // nodes
    std::vector<Carried> result;
    double change_mm = 0, away = kGone, faded = kGone;
    for (; first != last; ++first) {
      if (first->is_found()) {
        change_mm = first->radius_mm - first->given_mm;
        away = faded = 0;
      } else {
        ++away;
        if (first->is_alone) ++faded;
      }
      result.push_back({change_mm * std::clamp((kGone - faded) / (kGone - kFull), 0.0, 1.0), away});
    }
    return result;
  }

  /// The radius runs straight from node to node.
  void set_radii(const std::vector<Node>& nodes, VesselBranch& branch) const {
    constexpr double kLeast = 0.5;  // of the given one, where it was not found
    if (std::ranges::none_of(nodes, &Node::is_found)) return;
    const std::vector<double> changes = changes_mm(nodes);
    for (std::size_t i = 0; i < branch.points.size(); ++i) {
      const double along_mm = branch.arc_length_mm[i];
      double& radius_mm = branch.points[i].radius_mm;
      const auto after = std::clamp<std::ptrdiff_t>(
          std::ranges::lower_bound(nodes, along_mm, {}, &Node::along_mm) - nodes.begin(), 1,
          std::max<std::ptrdiff_t>(std::ssize(nodes) - 1, 1));
      const auto b = static_cast<std::size_t>(std::min(after, std::ssize(nodes) - 1)),
                 a = static_cast<std::size_t>(after - 1);
      const double apart_mm = nodes[b].along_mm - nodes[a].along_mm,
                   t = apart_mm > 0 ? std::clamp((along_mm - nodes[a].along_mm) / apart_mm, 0.0, 1.0) : 0;
      const bool is_between = t > 0 && t < 1 && nodes[a].is_found() && nodes[b].is_found();
      radius_mm = is_between ? std::lerp(nodes[a].radius_mm, nodes[b].radius_mm, t)
                             : std::max(radius_mm + std::lerp(changes[a], changes[b], t), kLeast * radius_mm);
    }
  }

  const std::vector<VesselBranch>& branches_;
  const ScanOfVessels& scan_;
  double voxel_mm_ = 0;
  glm::dvec3 voxel_variance_mm2_{0, 0, 0};
  std::vector<std::vector<TubeSample>> samples_;  ///< of each branch
  std::vector<std::vector<Node>> nodes_;          ///< of each branch
  std::vector<Piece> pieces_;
  double blur_mm_ = 0;
  UsualLumen usual_{0, 0};
};

}  // namespace

VesselTree with_image_radii(const VesselTree& tree, const ScanOfVessels& scan, const std::string& name,
                            Progress& progress) {
  progress.begin("measuring radii", 3, "passes");
  return {ImageRadii(tree, scan).branches(progress), name};
}

VesselTree with_image_radii(const VesselTree& tree, const Volume& volume, double noise_hu,
                            bool shows_vessels_alone, const std::string& name, Progress& progress) {
  if (shows_vessels_alone)
    if (const ScanResponse response(volume, noise_hu); response.is_cut_off())
      return with_image_radii(tree, {volume, noise_hu, &response}, name, progress);
  return with_image_radii(tree, {volume, noise_hu}, name, progress);
}

}  // namespace xraycast
