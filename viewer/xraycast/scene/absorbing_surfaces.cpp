#include "xraycast/scene/absorbing_surfaces.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace xraycast {
namespace {

constexpr double kMinDepth_mm = 1;     // from a cone's source
constexpr int kBand = 32;              // rows of the picture that are rasterised together
constexpr std::int64_t kBlock = 4096;  // points or triangles that are made ready together

/// Calls `part` with the numbers of each block's first element and of that behind its last one, on all cores.
template <typename Part>
void in_blocks(std::size_t elements, const Part& part) {
  const auto count = static_cast<std::int64_t>(elements);
  parallel_for((count + kBlock - 1) / kBlock, [&](std::int64_t block) {
    part(static_cast<std::size_t>(kBlock * block),
         static_cast<std::size_t>(std::min(count, kBlock * (block + 1))));
  });
}

/// A projected point: pixels from the lower left corner, and the depth along the beam's axis in mm, from the
/// view's centre or a cone's source.
struct Projected {
  glm::dvec2 pixel;
  double depth_mm;
};

std::vector<Projected> project_points(const std::vector<glm::vec3>& points_mm, const View& view) {
  const glm::dmat4 matrix = to_clip(view);
  const glm::dvec3 origin_mm = view.cone ? view.source_mm() : view.centre_mm, along = view.towards_detector();
  std::vector<Projected> projected(points_mm.size());
  in_blocks(points_mm.size(), [&](std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i) {
      const glm::dvec3 p(points_mm[i]);
      const glm::dvec4 clip = matrix * glm::dvec4(p, 1);
      projected[i] = {0.5 * (glm::dvec2(clip) / clip.w + 1.0) * glm::dvec2(view.width, view.height),
                      glm::dot(p - origin_mm, along)};
    }
  });
  return projected;
}

/// A triangle in a view, as it is rasterised.
struct Facet {
  std::array<glm::dvec2, 3> corners;  ///< anticlockwise
  ScreenBox box;                      ///< of the pixels whose centres may lie within
  /// The depth, or under a cone its reciprocal, is linear: its value at the first corner, slopes and limits.
  double at_corner, per_column, per_row;
  double lowest, highest;
  float mu_per_mm;
  float share;          ///< of the place that its matter takes up
  std::int8_t winding;  ///< 1 where rays enter, -1 where they leave
  std::uint8_t pulse_steps;
};

/// The pixels of a range along one axis whose centres lie between two positions.
std::pair<int, int> centres_between(double low, double high, int first, int count) {
  const double from = std::max<double>(first, low - 0.5),
               to = std::min<double>(first + count - 1, high - 0.5);
  if (!(from <= to)) return {first, first - 1};
  const int below = static_cast<int>(from);  // of what is not negative
  return {below < from ? below + 1 : below, static_cast<int>(to)};
}

/// None where no pixel's centre can lie in the triangle.
std::optional<Facet> facet_of(const std::array<Projected, 3>& corners, const ScreenBox& part, bool is_cone) {
  auto [a, b, c] = corners;
  // Of a fine mesh most triangles lie between centres.
  const glm::dvec2 low = glm::min(a.pixel, glm::min(b.pixel, c.pixel)),
                   high = glm::max(a.pixel, glm::max(b.pixel, c.pixel));
  const auto [left, right] = centres_between(low.x, high.x, part.x, part.width);
  const auto [bottom, top] = centres_between(low.y, high.y, part.y, part.height);
  if (left > right || bottom > top) return {};
  double area =
      (b.pixel.x - a.pixel.x) * (c.pixel.y - a.pixel.y) - (b.pixel.y - a.pixel.y) * (c.pixel.x - a.pixel.x);
  if (area == 0 || (is_cone && std::min({a.depth_mm, b.depth_mm, c.depth_mm}) < kMinDepth_mm)) return {};
  Facet facet;
  facet.winding = area < 0 ? 1 : -1;  // rays leave through faces towards the detector
  if (area < 0) {
    std::swap(b, c);
    area = -area;
  }
  facet.corners = {a.pixel, b.pixel, c.pixel};
  facet.box = {left, bottom, right - left + 1, top - bottom + 1};
  const auto linear = [is_cone](const Projected& s) { return is_cone ? 1 / s.depth_mm : s.depth_mm; };
  const double at_a = linear(a), to_b = linear(b) - at_a, to_c = linear(c) - at_a;
  facet.at_corner = at_a;
  facet.per_column = (to_b * (c.pixel.y - a.pixel.y) - to_c * (b.pixel.y - a.pixel.y)) / area;
  facet.per_row = (to_c * (b.pixel.x - a.pixel.x) - to_b * (c.pixel.x - a.pixel.x)) / area;
  facet.lowest = at_a + std::min({0.0, to_b, to_c});
  facet.highest = at_a + std::max({0.0, to_b, to_c});
  return facet;
}

/// The edge from a corner to the next, watertight: two triangles that share it evaluate it alike, so that a
/// pixel's centre, even on the edge, lies within exactly one of them.
class Edge {
 public:
  Edge(const glm::dvec2& from, const glm::dvec2& to)
      : is_reversed_(std::pair(to.x, to.y) < std::pair(from.x, from.y)),
        start_(is_reversed_ ? to : from),
        along_((is_reversed_ ? from : to) - start_) {}

  bool has_on_its_left(double x, double y) const {
    const bool is_left = along_.x * (y - start_.y) >= along_.y * (x - start_.x);
    return is_left != is_reversed_;
  }

 private:
  bool is_reversed_;
  glm::dvec2 start_, along_;
};

/// Where rays enter or leave a surface.
struct Crossing {
  float depth_mm, mu_per_mm, share;
  std::int8_t winding;
  std::uint8_t pulse_steps;
  int next;  ///< of the same pixel; -1: the last
};

/// Rows of the picture with the crossings of all their rays.
class Rows {
 public:
  Rows(const ScreenBox& part, bool is_cone)
      : part_(part), is_cone_(is_cone), first_(static_cast<std::size_t>(part.width) * part.height, -1) {}

  void add(const Facet& facet) {
    const auto& [a, b, c] = facet.corners;
    const Edge edges[] = {{a, b}, {b, c}, {c, a}};
    const int bottom = std::max(facet.box.y, part_.y),
              top = std::min(facet.box.y + facet.box.height, part_.y + part_.height);
    for (int row = bottom; row < top; ++row) {
      bool was_within = false;
      for (int column = facet.box.x; column < facet.box.x + facet.box.width; ++column) {
        const double x = column + 0.5, y = row + 0.5;
        if (!edges[0].has_on_its_left(x, y) || !edges[1].has_on_its_left(x, y) ||
            !edges[2].has_on_its_left(x, y)) {
          if (was_within) break;
          continue;
        }
        was_within = true;
        const double linear =
            std::clamp(facet.at_corner + facet.per_column * (x - a.x) + facet.per_row * (y - a.y),
                       facet.lowest, facet.highest);
        int& first = first_[at(column, row)];
        crossings_.push_back({static_cast<float>(is_cone_ ? 1 / linear : linear), facet.mu_per_mm,
                              facet.share, facet.winding, facet.pulse_steps, first});
        first = static_cast<int>(crossings_.size()) - 1;
      }
    }
  }

  /// Whether no surface lies in a pixel's ray.
  bool is_free(int column, int row) const { return first_[at(column, row)] < 0; }

  /// The optical depth of a pixel's ray, which is so many times as long as its part along the depth axis.
  double tau(int column, int row, double longer) {
    ray_.clear();
    std::uint8_t always = kWholePulse;
    for (int i = first_[at(column, row)]; i >= 0; i = crossings_[static_cast<std::size_t>(i)].next) {
      ray_.push_back(crossings_[static_cast<std::size_t>(i)]);
      always &= ray_.back().pulse_steps;
    }
    std::ranges::sort(ray_, {}, &Crossing::depth_mm);
    if (always == kWholePulse) return longer * tau_during(kWholePulse);
    double transmission = 0;
    for (int step = 0; step < kPulseSteps; ++step)
      transmission += std::exp(-longer * tau_during(static_cast<std::uint8_t>(1 << step))) / kPulseSteps;
    return -std::log(std::max(transmission, std::numeric_limits<double>::min()));
  }

 private:
  /// Of the ray's crossings with what is there during some of a pulse's steps.
  double tau_during(std::uint8_t pulse_steps) {
    within_.clear();
    double sum = 0, strongest_per_mm = 0, before_mm = 0;
    for (const Crossing& crossing : ray_) {
      if ((crossing.pulse_steps & pulse_steps) == 0) continue;
      sum += strongest_per_mm * (crossing.depth_mm - before_mm);
      before_mm = crossing.depth_mm;
      strongest_per_mm = cross(crossing);
    }
    return sum;
  }

  std::size_t at(int column, int row) const {
    return static_cast<std::size_t>(row - part_.y) * static_cast<std::size_t>(part_.width) +
           static_cast<std::size_t>(column - part_.x);
  }

  /// The mu beyond a crossing: the largest, where the matter takes up its place whole.
  float cross(const Crossing& crossing) {
    const auto is_it = [&](const Matter& m) {
      return m.mu_per_mm == crossing.mu_per_mm && m.share == crossing.share;
    };
    auto matter = std::ranges::find_if(within_, is_it);
    if (matter == within_.end()) {
      const auto is_less = [&](const Matter& m) { return m.mu_per_mm < crossing.mu_per_mm; };
      matter =
          within_.insert(std::ranges::find_if_not(within_, is_less), {crossing.mu_per_mm, crossing.share, 0});
    }
    matter->winding += crossing.winding;
    if (matter->winding == 0) within_.erase(matter);
    float sum_per_mm = 0;
    for (const auto& [mu_per_mm, share, winding] : within_)
      if (winding > 0) sum_per_mm = std::lerp(sum_per_mm, mu_per_mm, share);  // a share of 1: exactly mu
    return sum_per_mm;
  }

  struct Matter {
    float mu_per_mm, share;
    int winding;  ///< entries minus exits
  };

  ScreenBox part_;
  bool is_cone_;
  std::vector<int> first_;  ///< of every pixel, -1: none
  std::vector<Crossing> crossings_, ray_;
  std::vector<Matter> within_;  ///< from the weakest on
};

}  // namespace

void AbsorbingSurfaces::set(std::span<const Surface> surfaces) {
  parts_.clear();
  for (const Surface& surface : surfaces) replace(parts_.size(), surface);
}

void AbsorbingSurfaces::replace(std::size_t index, const Surface& surface) {
  if (index == parts_.size()) parts_.emplace_back();
  Part& part = parts_.at(index);
  part.surface = surface;
  part.is_inside_out = volume_mm3(surface.mesh) < 0;
  measure(part);
}

void AbsorbingSurfaces::move(std::size_t index, std::span<const glm::vec3> points_mm) {
  Part& part = parts_.at(index);
  if (points_mm.size() != part.surface.mesh.points_mm.size())
    throw InputError("`points_mm` holds {}, but the surface has {}", pluralize(points_mm.size(), "point"),
                     part.surface.mesh.points_mm.size());
  part.surface.mesh.points_mm.assign(points_mm.begin(), points_mm.end());
  measure(part);
}

/// What follows from a surface's points.
void AbsorbingSurfaces::measure(Part& part) {
  glm::vec3 lower(0), upper(0);
  const std::vector<glm::vec3>& points_mm = part.surface.mesh.points_mm;
  if (!points_mm.empty()) lower = upper = points_mm[0];
  for (const glm::vec3& point : points_mm) {
    lower = glm::min(lower, point);
    upper = glm::max(upper, point);
  }
  part.lower_mm = lower;
  part.upper_mm = upper;
  part.tube = tube_of(part.surface);
}

bool AbsorbingSurfaces::empty() const {
  return std::ranges::all_of(parts_, [](const Part& part) { return part.surface.mesh.triangles.empty(); });
}

ScreenBox AbsorbingSurfaces::box(const View& view) const {
  ScreenBox box;
  for (const Part& part : parts_)
    if (!part.surface.mesh.triangles.empty())
      box = united(box, drawn_box(part.tube, part.lower_mm, part.upper_mm, view));
  return box;
}

std::vector<float> AbsorbingSurfaces::tau(const View& view, const ScreenBox& part) const {
  std::vector<float> tau(static_cast<std::size_t>(part.width) * static_cast<std::size_t>(part.height));
  if (tau.empty()) return tau;

  // Binned by bands of the picture, which are then rasterised in parallel.
  using Bands = std::vector<std::vector<Facet>>;  // of each
  const Bands none(static_cast<std::size_t>((part.height - 1) / kBand + 1));
  std::vector<Bands> binned;  // of blocks of triangles, in their order
  for (const Part& drawn : parts_) {
    const Surface& surface = drawn.surface;
    const Widening widening = widening_of(drawn.tube, drawn.lower_mm, drawn.upper_mm, view);
    const std::vector<glm::vec3>& points_mm = surface.mesh.points_mm;
    const std::vector<Projected> projected =
        widening.factor > 1 ? project_points(widened(points_mm, drawn.tube, widening), view)
                            : project_points(points_mm, view);
    const auto& triangles = surface.mesh.triangles;
    const std::size_t before = binned.size();
    binned.resize(before + (triangles.size() + kBlock - 1) / kBlock, none);
    in_blocks(triangles.size(), [&](std::size_t first, std::size_t end) {
      Bands& bands = binned[before + first / kBlock];
      for (std::size_t i = first; i < end; ++i) {
        const auto& [a, b, c] = triangles[i];
        const float weight = surface.mu_weights.empty() ? 1 : surface.mu_weights[a];
        const auto mu_per_mm = static_cast<float>(surface.mu_per_mm) * weight;
        if (mu_per_mm <= 0) continue;
        auto facet = facet_of({projected[a], projected[b], projected[c]}, part, view.cone.has_value());
        if (!facet) continue;
        facet->mu_per_mm = mu_per_mm;
        facet->share = static_cast<float>(widening.share);
        facet->pulse_steps = surface.pulse_steps;
        if (drawn.is_inside_out) facet->winding = static_cast<std::int8_t>(-facet->winding);
        const int last = (facet->box.y + facet->box.height - 1 - part.y) / kBand;
        for (int band = (facet->box.y - part.y) / kBand; band <= last; ++band)
          bands[static_cast<std::size_t>(band)].push_back(*facet);
      }
    });
  }

  parallel_for(static_cast<std::int64_t>(none.size()), [&](std::int64_t band) {
    const int bottom = part.y + kBand * static_cast<int>(band);
    const int height = std::min(kBand, part.y + part.height - bottom);
    Rows rows({part.x, bottom, part.width, height}, view.cone.has_value());
    for (const Bands& of_block : binned)
      for (const Facet& facet : of_block[static_cast<std::size_t>(band)]) rows.add(facet);
    auto value = tau.begin() + static_cast<std::ptrdiff_t>(bottom - part.y) * part.width;
    for (int row = bottom; row < bottom + height; ++row)
      for (int column = part.x; column < part.x + part.width; ++column, ++value) {
        if (rows.is_free(column, row)) continue;
        double longer = 1;  // than the ray's part along the beam's axis
        if (view.cone) {
          const glm::dvec3 on_detector = view.pixel_on_detector_mm(column, view.height - 1 - row);
          longer = glm::distance(on_detector, view.source_mm()) / view.cone->source_detector_mm;
        }
        *value = static_cast<float>(rows.tau(column, row, longer));
      }
  });
  return tau;
}

void AbsorbingSurfaces::add_to(std::span<float> tau, const View& view) const {
  const ScreenBox part = box(view);
  const std::vector<float> added = this->tau(view, part);
  auto value = added.begin();
  for (int row = 0; row < part.height; ++row) {
    const auto above = static_cast<std::size_t>(view.height - 1 - part.y - row);
    float* to = tau.data() + above * static_cast<std::size_t>(view.width) + part.x;
    for (int column = 0; column < part.width; ++column) *to++ += *value++;
  }
}

}  // namespace xraycast
