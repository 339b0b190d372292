#include "xraycast/parametric_motion/chest_landmarks.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/segmentation/body_mask.hpp"
#include "xraycast/segmentation/threshold.hpp"
#include "xraycast/volume/block_means.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kLook_mm = 4;
constexpr int kAngles = 72;

/// From base to apex: to the left, forwards and down.
const glm::dvec3 kUsualAxis = glm::normalize(glm::dvec3(0.66, -0.5, -0.56));

/// The mean of the voxels in cells of about 4 mm.
Volume coarsened(const Volume& volume) {
  return block_means(volume,
                     glm::max(Index3(glm::round(kLook_mm / volume.geometry().spacing_mm)), Index3(1)));
}

double percentile(std::vector<double> values, double share) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

/// Means over neighbours up to `reach` away; `is_ring` where the last is beside the first.
std::vector<double> smoothed(const std::vector<double>& values, int reach, bool is_ring) {
  const int count = static_cast<int>(values.size());
  std::vector<double> means;
  for (int i = 0; i < count; ++i) {
    double sum = 0, weights = 0;
    for (int k = -reach; k <= reach; ++k) {
      const int at = is_ring ? (i + k + count) % count : i + k;
      if (at < 0 || at >= count) continue;
      const double weight = 1 + std::cos(std::numbers::pi * k / (reach + 1));
      sum += weight * values[static_cast<std::size_t>(at)];
      weights += weight;
    }
    means.push_back(sum / weights);
  }
  return means;
}

int angle_of(const glm::dvec2& from_centre) {
  const double turns = std::atan2(from_centre.y, from_centre.x) / (2 * std::numbers::pi);
  return static_cast<int>(std::floor((turns - std::floor(turns)) * kAngles)) % kAngles;
}

}  // namespace

ChestLandmarks::ChestLandmarks(const Volume& volume, const std::string& name)
    : coarse_(coarsened(volume)), lungs_(coarse_.geometry()) {
  find_lungs(name);
  const Mask body = find_body_mask(coarse_);
  find_wall(body);
  find_spine(body);
}

void ChestLandmarks::find_lungs(const std::string& name) {
  constexpr double kLung_hu = -500, kLeast_mm3 = 3e5, kOtherLung = 0.2, kNarrow = 0.08;
  const VolumeGeometry& g = coarse_.geometry();
  const Components parts(between(coarse_, kPaddingHu, kLung_hu));
  // Air around the body reaches the scan's sides; that in the windpipe only its upper end.
  std::vector<bool> is_inside(static_cast<std::size_t>(parts.count()), true);
  for (const Components::Run& run : parts.runs()) {
    const Index3 first = voxel_at(g, run.first);
    if (first.x == 0 || first.x + run.length == g.size.x || first.y == 0 || first.y + 1 == g.size.y)
      is_inside[static_cast<std::size_t>(run.component)] = false;
  }
  std::int64_t largest = 0;
  for (int i = 0; i < parts.count(); ++i)
    if (is_inside[static_cast<std::size_t>(i)]) largest = std::max(largest, parts.voxels(i));
  if (static_cast<double>(largest) * voxel_mm3(g) < kLeast_mm3)
    throw InputError(
        "{}: no lungs were found, which a model of breath and heart goes by; take a chest, or the "
        "phases of a 4D CT",
        name);
  for (int i = 0; i < parts.count(); ++i)
    if (static_cast<double>(parts.voxels(i)) < kOtherLung * static_cast<double>(largest))
      is_inside[static_cast<std::size_t>(i)] = false;
  lungs_ = parts.select(is_inside);

  // The windpipe, which is narrow, is left out.
  std::vector<std::int64_t> areas;
  for (std::int64_t z = 0; z < g.size.z; ++z) {
    const auto slice = lungs_.voxels.begin() + z * g.slice_voxels();
    areas.push_back(std::count(slice, slice + g.slice_voxels(), std::uint8_t{1}));
  }
  const auto widest = static_cast<double>(std::ranges::max(areas));
  for (std::int64_t z = 0; z < g.size.z; ++z)
    if (static_cast<double>(areas[static_cast<std::size_t>(z)]) < kNarrow * widest) {
      const auto slice = lungs_.voxels.begin() + z * g.slice_voxels();
      std::fill(slice, slice + g.slice_voxels(), std::uint8_t{0});
    }

  const auto box = bounding_box(lungs_);
  const glm::dvec3 lower = g.to_world_mm(box.lower), upper = g.to_world_mm(box.upper - Index3(1));
  centre_mm_ = 0.5 * (glm::dvec2(lower) + glm::dvec2(upper));
  half_width_mm_ = 0.5 * (upper.x - lower.x);
  apices_mm_ = upper.z;

  // The right dome, beside the heart: how high the lung's lower surface reaches there.
  constexpr double kMedial = 0.3, kLateral = 0.75, kHighest = 0.95;
  std::vector<double> lowest_mm;
  std::int64_t cut = 0;
  for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) {
    const double aside = (centre_mm_.x - g.to_world_mm({x, 0, 0}).x) / half_width_mm_;
    if (aside < kMedial || aside > kLateral) continue;
    for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
      for (std::int64_t z = box.lower.z; z < box.upper.z; ++z) {
        if (lungs_[{x, y, z}] == 0) continue;
        lowest_mm.push_back(g.to_world_mm({x, y, z}).z);
        cut += z == 0;
        break;
      }
  }
  if (lowest_mm.empty() || 2 * cut > std::ssize(lowest_mm))
    throw InputError(
        "{}: the scan ends above the diaphragm, which a model of breath and heart goes by; take "
        "one that includes it",
        name);
  dome_mm_ = percentile(lowest_mm, kHighest);
  constexpr double kLeastHeight_mm = 60;
  if (apices_mm_ - dome_mm_ < kLeastHeight_mm)
    throw InputError("{}: the lungs reach only {:.0f} mm above the diaphragm; take a scan of the whole chest",
                     name, apices_mm_ - dome_mm_);
}

void ChestLandmarks::find_wall(const Mask& body) {
  const VolumeGeometry& g = coarse_.geometry();
  const auto slices = static_cast<std::size_t>(g.size.z);
  std::vector<double> skin_mm(slices * kAngles), lung_mm(slices * kAngles);
  front_mm_.assign(slices, centre_mm_.y);
  parallel_for(g.size.z, [&](std::int64_t z) {
    const auto row = static_cast<std::size_t>(z) * kAngles;
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x) {
        const glm::dvec2 from_centre = glm::dvec2(g.to_world_mm({x, y, z})) - centre_mm_;
        double& lung = lung_mm[row + static_cast<std::size_t>(angle_of(from_centre))];
        if (lungs_[{x, y, z}]) lung = std::max(lung, glm::length(from_centre));
      }
    // Outwards to where the body ends first: arms beside it are left out.
    for (int angle = 0; angle < kAngles; ++angle) {
      const double turn = 2 * std::numbers::pi * (angle + 0.5) / kAngles;
      const glm::dvec2 direction(std::cos(turn), std::sin(turn));
      double& skin = skin_mm[row + static_cast<std::size_t>(angle)];
      const auto is_body = [&](double r) {
        const glm::dvec2 p = centre_mm_ + r * direction;
        Index3 at(glm::round(g.to_index({p, 0})));
        at.z = z;
        return body.at(at);
      };
      while (is_body(skin + kLook_mm / 2)) skin += kLook_mm / 2;
    }
    const auto front = row + static_cast<std::size_t>(kAngles * 3 / 4);
    front_mm_[static_cast<std::size_t>(z)] = centre_mm_.y - skin_mm[front];
  });

  // The wall's thickness in each direction, where lung lies beneath it; else that of the nearest direction.
  std::vector<double> wall_mm(kAngles, -1);
  for (int angle = 0; angle < kAngles; ++angle) {
    std::vector<double> here;
    for (std::size_t z = 0; z < slices; ++z) {
      const std::size_t i = z * kAngles + static_cast<std::size_t>(angle);
      constexpr double kOutermost = 0.6;
      if (lung_mm[i] > kOutermost * skin_mm[i]) here.push_back(skin_mm[i] - lung_mm[i]);
    }
    constexpr double kThin = 0.3;
    if (here.size() > 5) wall_mm[static_cast<std::size_t>(angle)] = percentile(here, kThin);
  }
  const std::vector<double> known = wall_mm;
  for (int angle = 0; angle < kAngles; ++angle)
    for (int away = 0; away < kAngles && wall_mm[static_cast<std::size_t>(angle)] < 0; ++away)
      for (const int other : {angle + away, angle - away})
        if (const double wall = known[static_cast<std::size_t>((other + kAngles) % kAngles)]; wall >= 0)
          wall_mm[static_cast<std::size_t>(angle)] = wall;
  wall_mm = smoothed(wall_mm, 4, true);

  cavity_mm_.resize(slices * kAngles);
  constexpr double kLeast_mm = 20;
  for (int angle = 0; angle < kAngles; ++angle) {
    std::vector<double> column;
    for (std::size_t z = 0; z < slices; ++z)
      column.push_back(std::max(
          skin_mm[z * kAngles + static_cast<std::size_t>(angle)] - wall_mm[static_cast<std::size_t>(angle)],
          kLeast_mm));
    column = smoothed(column, 6, false);
    for (std::size_t z = 0; z < slices; ++z)
      cavity_mm_[z * kAngles + static_cast<std::size_t>(angle)] = column[z];
  }
  for (std::size_t z = 0; z < slices; ++z) {
    const auto row = cavity_mm_.begin() + static_cast<std::ptrdiff_t>(z * kAngles);
    std::ranges::copy(smoothed(std::vector<double>(row, row + kAngles), 3, true), row);
  }
  front_mm_ = smoothed(front_mm_, 6, false);
}

void ChestLandmarks::find_spine(const Mask& body) {
  constexpr double kBone_hu = 150, kHalfWidth = 0.3, kBodiesBefore_mm = 12;
  const VolumeGeometry& g = coarse_.geometry();
  std::vector<double> xs, ys;
  glm::dvec2 last(centre_mm_.x, centre_mm_.y + 0.5 * half_width_mm_);
  for (std::int64_t z = 0; z < g.size.z; ++z) {
    glm::dvec2 sum(0);
    int count = 0;
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x) {
        const glm::dvec2 p(g.to_world_mm({x, y, z}));
        if (p.y < centre_mm_.y || std::abs(p.x - centre_mm_.x) > kHalfWidth * half_width_mm_ ||
            coarse_.at(x, y, z) < kBone_hu || body[{x, y, z}] == 0)
          continue;
        sum += p;
        ++count;
      }
    if (count > 0) last = sum / static_cast<double>(count) - glm::dvec2(0, kBodiesBefore_mm);
    xs.push_back(last.x);
    ys.push_back(last.y);
  }
  xs = smoothed(xs, 10, false);
  ys = smoothed(ys, 10, false);
  for (std::size_t z = 0; z < xs.size(); ++z) spine_mm_.emplace_back(xs[z], ys[z]);
}

double ChestLandmarks::slice_of(double z_mm) const {
  return std::clamp(coarse_.geometry().to_index({0, 0, z_mm}).z, 0.0,
                    static_cast<double>(coarse_.geometry().size.z - 1));
}

glm::dvec2 ChestLandmarks::spine_mm(double z_mm) const {
  const double slice = slice_of(z_mm);
  const auto low = static_cast<std::size_t>(slice), high = std::min(low + 1, spine_mm_.size() - 1);
  return glm::mix(spine_mm_[low], spine_mm_[high], slice - std::floor(slice));
}

double ChestLandmarks::front_mm(double z_mm) const {
  const double slice = slice_of(z_mm);
  const auto low = static_cast<std::size_t>(slice), high = std::min(low + 1, front_mm_.size() - 1);
  return glm::mix(front_mm_[low], front_mm_[high], slice - std::floor(slice));
}

double ChestLandmarks::freedom(const glm::dvec3& x_mm) const {
  // Shares of the way to the ribs, and distances from the spine in a man whose lungs are 140 mm to each side.
  constexpr double kFree = 0.72, kFixed = 0.95, kSpine_mm = 40, kBeside_mm = 72, kForwards = 1.25,
                   kMan_mm = 140;
  const glm::dvec2 from_centre = glm::dvec2(x_mm) - centre_mm_;
  const double slice = slice_of(x_mm.z),
               turns = std::atan2(from_centre.y, from_centre.x) / (2 * std::numbers::pi);
  const double angle = (turns - std::floor(turns)) * kAngles - 0.5;
  const auto cavity_mm = [&](std::int64_t z, std::int64_t a) {
    z = std::min<std::int64_t>(z, coarse_.geometry().size.z - 1);
    return cavity_mm_[static_cast<std::size_t>(z * kAngles + (a + kAngles) % kAngles)];
  };
  const auto z = static_cast<std::int64_t>(slice), a = static_cast<std::int64_t>(std::floor(angle));
  const double up = slice - static_cast<double>(z), on = angle - static_cast<double>(a);
  const double wall_mm = glm::mix(glm::mix(cavity_mm(z, a), cavity_mm(z, a + 1), on),
                                  glm::mix(cavity_mm(z + 1, a), cavity_mm(z + 1, a + 1), on), up);
  const glm::dvec2 spine = spine_mm(x_mm.z);
  const double size = half_width_mm_ / kMan_mm;
  return (1 - glm::smoothstep(kFree, kFixed, glm::length(from_centre) / wall_mm)) *
         glm::smoothstep(kSpine_mm * size, kBeside_mm * size,
                         std::hypot(x_mm.x - spine.x, kForwards * std::max(spine.y - x_mm.y, 0.0)));
}

heartbeat_model::Heart ChestLandmarks::found_heart() const {
  // Above the dome and in front of the spine.
  constexpr double kTissue_hu = -200, kLow = 0.02, kHigh = 0.25, kBeforeSpine_mm = 25, kCavity = 0.85;
  const VolumeGeometry& g = coarse_.geometry();
  const double lung_mm = apices_mm_ - dome_mm_;
  glm::dvec3 sum(0);
  std::int64_t count = 0, slices = 0;
  for (std::int64_t z = 0; z < g.size.z; ++z) {
    const double height = (g.to_world_mm({0, 0, z}).z - dome_mm_) / lung_mm;
    if (height < kLow || height > kHigh) continue;
    ++slices;
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x) {
        const glm::dvec3 p = g.to_world_mm({x, y, z});
        const glm::dvec2 from_centre = glm::dvec2(p) - centre_mm_;
        const std::size_t ray =
            static_cast<std::size_t>(z) * kAngles + static_cast<std::size_t>(angle_of(from_centre));
        if (coarse_.at(x, y, z) < kTissue_hu || p.y > spine_mm(p.z).y - kBeforeSpine_mm ||
            glm::length(from_centre) > kCavity * cavity_mm_[ray])
          continue;
        sum += p;
        ++count;
      }
  }
  const double area_mm2 = static_cast<double>(count) /
                          static_cast<double>(std::max<std::int64_t>(slices, 1)) * g.spacing_mm.x *
                          g.spacing_mm.y;
  constexpr double kSmallest_mm = 30, kLargest_mm = 70;
  heartbeat_model::Heart heart;
  heart.axis = kUsualAxis;
  heart.radius_mm = std::clamp(std::sqrt(area_mm2 / std::numbers::pi), kSmallest_mm, kLargest_mm);
  const double size = heart.radius_mm / heartbeat_model::Heart::kRadius_mm;
  heart.length_mm = size * heartbeat_model::Heart::kLength_mm;
  // Its middle lies a little above the dome.
  constexpr double kMiddle = 0.13;
  glm::dvec3 middle(centre_mm_, dome_mm_ + kMiddle * lung_mm);
  if (count > 0) middle = {glm::dvec2(sum) / static_cast<double>(count), middle.z};
  heart.apex_mm = middle + 0.5 * heart.length_mm * heart.axis;
  return heart;
}

heartbeat_model::Heart heart_of(const Mask& mask) {
  const Components parts(mask);
  std::vector<glm::dvec3> places;
  glm::dvec3 sum(0);
  for (const Components::Run& run : parts.runs()) {
    if (run.component != parts.largest()) continue;
    for (std::int32_t i = 0; i < run.length; ++i) {
      places.push_back(mask.geometry.to_world_mm(voxel_at(mask.geometry, run.first + i)));
      sum += places.back();
    }
  }
  if (places.empty()) throw InputError("`heart_mask`: is empty; give one of the heart");
  heartbeat_model::Heart heart;
  heart.axis = kUsualAxis;
  const glm::dvec3 middle = sum / static_cast<double>(places.size());
  std::vector<double> heights, radii;
  for (const glm::dvec3& place : places) {
    heights.push_back(glm::dot(place - middle, heart.axis));
    radii.push_back(glm::length(place - middle - heights.back() * heart.axis));
  }
  // A few voxels are no measure of a heart's ends.
  constexpr double kFewest = 0.005, kWithin = 0.97;
  const double lowest = percentile(heights, 1 - kFewest);
  heart.length_mm = lowest - percentile(heights, kFewest);
  heart.radius_mm = percentile(radii, kWithin);
  heart.apex_mm = middle + lowest * heart.axis;
  constexpr double kSmallest_mm = 15, kLargest_mm = 150;
  if (!(heart.radius_mm > kSmallest_mm && heart.radius_mm < kLargest_mm))
    throw InputError("`heart_mask`: is {:.0f} mm wide, which no heart is; give one of the heart",
                     2 * heart.radius_mm);
  return heart;
}

}  // namespace xraycast
