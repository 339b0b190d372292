#include "xraycast/motion/displacement.hpp"

#include <glm/matrix.hpp>

#include <algorithm>
#include <utility>

namespace xraycast {
namespace {

class Affine final : public Displacement {
 public:
  Affine(const glm::dmat3& matrix, const glm::dvec3& offset_mm)
      : excess_(matrix - glm::dmat3(1)), offset_mm_(offset_mm) {}
  glm::dvec3 at(const glm::dvec3& x_mm) const override { return excess_ * x_mm + offset_mm_; }
  bool covers(const glm::dvec3&) const override { return true; }

  Folds folds() const override {
    const double determinant = glm::determinant(excess_ + glm::dmat3(1));
    return {determinant > 0 ? 0 : 1, 1, determinant, {}};
  }

 private:
  glm::dmat3 excess_;
  glm::dvec3 offset_mm_;
};

class Composed final : public Displacement {
 public:
  explicit Composed(std::vector<std::shared_ptr<const Displacement>> parts) : parts_(std::move(parts)) {}

  glm::dvec3 at(const glm::dvec3& x_mm) const override {
    glm::dvec3 place_mm = x_mm;
    for (const auto& part : parts_) place_mm += part->at(place_mm);
    return place_mm - x_mm;
  }

  void add(std::span<const glm::dvec3> x_mm, double weight, std::span<glm::dvec3> sum_mm) const override {
    std::vector<glm::dvec3> place_mm(x_mm.begin(), x_mm.end()), next_mm = place_mm;
    for (const auto& part : parts_) {
      part->add(place_mm, 1, next_mm);
      place_mm = next_mm;
    }
    for (std::size_t i = 0; i < x_mm.size(); ++i) sum_mm[i] += weight * (place_mm[i] - x_mm[i]);
  }

  bool covers(const glm::dvec3& x_mm) const override {
    glm::dvec3 place_mm = x_mm;
    for (const auto& part : parts_) {
      if (!part->covers(place_mm)) return false;
      place_mm += part->at(place_mm);
    }
    return true;
  }

  Folds folds() const override {
    Folds all;
    for (const auto& part : parts_) {
      const Folds one = part->folds();
      all.include(one);
      all.of += one.of;
    }
    return all;
  }

 private:
  std::vector<std::shared_ptr<const Displacement>> parts_;
};

}  // namespace

void Displacement::add(std::span<const glm::dvec3> x_mm, double weight, std::span<glm::dvec3> sum_mm) const {
  for (std::size_t i = 0; i < x_mm.size(); ++i) sum_mm[i] += weight * at(x_mm[i]);
}

std::shared_ptr<const Displacement> affine_displacement(const glm::dmat3& matrix,
                                                        const glm::dvec3& offset_mm) {
  return std::make_shared<Affine>(matrix, offset_mm);
}

std::shared_ptr<const Displacement> composed(std::vector<std::shared_ptr<const Displacement>> parts) {
  if (parts.size() == 1) return parts.front();
  return std::make_shared<Composed>(std::move(parts));
}

}  // namespace xraycast
