#include "xraycast/coaxial/coil_pack.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace xraycast {
namespace {

/// Turns are felt by points nearer than this, and not by the points that follow them within it.
constexpr double kReach_mm = 1;
constexpr std::size_t kOwn = 3;

/// What a direction costs. Chosen such that a coil in a sac as wide as its loops lies at the wall, and turns
/// lie evenly where the sac fills.
constexpr double kBendCost = 1, kCrowdCost = 0.5, kWallCost = 0.3;

/// By how much a loop's plane turns about the coil, over the loop's own turn.
constexpr double kTorsion = 0.25;

/// Off the wanted direction, in circles of kAround directions.
constexpr std::array kOff_rad{0.12, 0.25, 0.4, 0.6, 0.9, 1.3, 1.8, 2.4, std::numbers::pi};
constexpr int kAround = 12;

glm::dvec3 turned(const glm::dvec3& v, const glm::dvec3& axis, double angle_rad) {
  return std::cos(angle_rad) * v + std::sin(angle_rad) * glm::cross(axis, v) +
         (1 - std::cos(angle_rad)) * glm::dot(axis, v) * axis;
}

/// A unit vector across a unit one.
glm::dvec3 across(const glm::dvec3& v) {
  const glm::dvec3 least = std::abs(v.x) <= std::min(std::abs(v.y), std::abs(v.z)) ? glm::dvec3(1, 0, 0)
                           : std::abs(v.y) <= std::abs(v.z)                        ? glm::dvec3(0, 1, 0)
                                                                                   : glm::dvec3(0, 0, 1);
  return glm::normalize(glm::cross(v, least));
}

}  // namespace

CoilPack::CoilPack(const AneurysmSac& sac)
    : sac_(sac), cells_along_(static_cast<std::ptrdiff_t>(std::ceil(2 * sac.radius_mm / kReach_mm)) + 2) {
  cells_.resize(static_cast<std::size_t>(cells_along_ * cells_along_ * cells_along_));
}

void CoilPack::begin(LaidCoil coil, const glm::dvec3& place_mm, const glm::dvec3& direction) {
  coil.points_mm = {place_mm};
  coils_.push_back(std::move(coil));
  begins_along_ = direction;
  turns_ = {{across(direction)}};
}

void CoilPack::lay_to(double length_mm) {
  LaidCoil& coil = coils_.back();
  coil.laid_mm = length_mm;
  constexpr double kRounding = 1e-9;
  const auto steps = static_cast<std::size_t>(length_mm / LaidCoil::kStep_mm + kRounding);
  while (coil.points_mm.size() - 1 < steps) lay();
  while (coil.points_mm.size() - 1 > steps) take_back();
  if (length_mm <= 0) coils_.pop_back();
}

/// Its last turns are felt by the next coil too.
void CoilPack::detach(double time_s) {
  LaidCoil& coil = coils_.back();
  coil.to_s = time_s;
  coil.is_detached = true;
  const std::size_t count = coil.points_mm.size();
  for (std::size_t i = count > kOwn ? count - kOwn : 0; i < count; ++i)
    cell_at(coil.points_mm[i]).push_back(coil.points_mm[i]);
}

glm::dvec3 CoilPack::heading() const {
  const std::vector<glm::dvec3>& points_mm = coils_.back().points_mm;
  return points_mm.size() < 2 ? begins_along_
                              : glm::normalize(points_mm.back() - points_mm[points_mm.size() - 2]);
}

void CoilPack::lay() {
  LaidCoil& coil = coils_.back();
  const double turn_rad = 2 * LaidCoil::kStep_mm / coil.model.loop_mm;
  const glm::dvec3 ahead = heading(), normal = turned(turns_.back().normal, ahead, kTorsion * turn_rad);
  const glm::dvec3 direction = best_direction(turned(ahead, normal, turn_rad));
  coil.points_mm.push_back(coil.points_mm.back() + LaidCoil::kStep_mm * direction);
  constexpr double kAcross = 0.1;  // of the normal at least; else the plane is lost
  const glm::dvec3 still_across = normal - glm::dot(normal, direction) * direction;
  turns_.push_back({glm::length(still_across) > kAcross ? glm::normalize(still_across) : across(direction)});
  if (const std::size_t count = coil.points_mm.size(); count > kOwn) {
    const glm::dvec3& felt_mm = coil.points_mm[count - 1 - kOwn];
    cell_at(felt_mm).push_back(felt_mm);
  }
}

void CoilPack::take_back() {
  LaidCoil& coil = coils_.back();
  if (const std::size_t count = coil.points_mm.size(); count > kOwn)
    cell_at(coil.points_mm[count - 1 - kOwn]).pop_back();
  coil.points_mm.pop_back();
  turns_.pop_back();
}

glm::dvec3 CoilPack::best_direction(const glm::dvec3& wanted) const {
  const LaidCoil& coil = coils_.back();
  const glm::dvec3& from_mm = coil.points_mm.back();
  const double off_wall_mm = 0.5 * coil.model.wire_mm;
  const glm::dvec3 side = across(wanted), other_side = glm::cross(wanted, side);
  // Towards the middle of the sac there is always room: it is convex.
  const glm::dvec3 inwards_mm = sac_.middle_mm() - from_mm;
  glm::dvec3 best = glm::length(inwards_mm) > 0 ? inwards_mm : wanted;
  double least = std::numeric_limits<double>::infinity();
  const auto weigh = [&](const glm::dvec3& direction, double off_rad) {
    const double bend = kBendCost * off_rad * off_rad;
    if (bend >= least) return;
    const glm::dvec3 to_mm = from_mm + LaidCoil::kStep_mm * direction;
    const double depth_mm = sac_.depth_mm(to_mm) - off_wall_mm;
    if (depth_mm < 0) return;
    const double cost = bend + kCrowdCost * crowding(to_mm) + kWallCost * depth_mm / sac_.radius_mm;
    if (cost >= least) return;
    least = cost;
    best = direction;
  };
  weigh(wanted, 0);
  for (const double off_rad : kOff_rad)
    for (int i = 0; i < kAround; ++i) {
      const double around_rad = 2 * std::numbers::pi * i / kAround;
      const glm::dvec3 aside = std::cos(around_rad) * side + std::sin(around_rad) * other_side;
      weigh(std::cos(off_rad) * wanted + std::sin(off_rad) * aside, off_rad);
    }
  return glm::normalize(best);
}

/// The squares of how much nearer than the reach points of turns are.
double CoilPack::crowding(const glm::dvec3& place_mm) const {
  std::array<std::ptrdiff_t, 3> middle{};
  for (int axis = 0; axis < 3; ++axis) middle[static_cast<std::size_t>(axis)] = cell_index(place_mm, axis);
  const auto last = cells_along_ - 1;
  double sum = 0;
  for (std::ptrdiff_t z = std::max<std::ptrdiff_t>(0, middle[2] - 1); z <= std::min(last, middle[2] + 1); ++z)
    for (std::ptrdiff_t y = std::max<std::ptrdiff_t>(0, middle[1] - 1); y <= std::min(last, middle[1] + 1);
         ++y)
      for (std::ptrdiff_t x = std::max<std::ptrdiff_t>(0, middle[0] - 1); x <= std::min(last, middle[0] + 1);
           ++x)
        for (const glm::dvec3& point_mm :
             cells_[static_cast<std::size_t>((z * cells_along_ + y) * cells_along_ + x)]) {
          const glm::dvec3 apart_mm = place_mm - point_mm;
          const double square = glm::dot(apart_mm, apart_mm);
          if (square >= kReach_mm * kReach_mm) continue;
          const double nearer = 1 - std::sqrt(square) / kReach_mm;
          sum += nearer * nearer;
        }
  return sum;
}

std::ptrdiff_t CoilPack::cell_index(const glm::dvec3& place_mm, int axis) const {
  const double from_low_mm = place_mm[axis] - sac_.centre_mm[axis] + sac_.radius_mm;
  return std::clamp<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(std::floor(from_low_mm / kReach_mm)) + 1, 0,
                                    cells_along_ - 1);
}

std::vector<glm::dvec3>& CoilPack::cell_at(const glm::dvec3& place_mm) {
  const std::ptrdiff_t x = cell_index(place_mm, 0), y = cell_index(place_mm, 1), z = cell_index(place_mm, 2);
  return cells_[static_cast<std::size_t>((z * cells_along_ + y) * cells_along_ + x)];
}

void CoilSum::add(const LaidCoil& coil) {
  laid_mm3 += coil.laid_mm3();
  laid_mm3_by_wire_mm += coil.laid_mm3() / coil.model.wire_mm;
}

CoilSum CoilPack::sum() const {
  CoilSum sum;
  for (const LaidCoil& coil : coils_) sum.add(coil);
  return sum;
}

double CoilPack::push_N() const {
  if (!has_attached()) return 0;
  const LaidCoil& coil = coils_.back();
  const double packed = std::min(packing(), 0.99 * kDensest), firm = packed / (kDensest - packed);
  return kFirm_N * firm * firm * std::min(1.0, coil.laid_mm / coil.model.loop_mm);
}

}  // namespace xraycast
