#include "xraycast/scene/contrast_surface.hpp"

#include "support/basilar_tip.hpp"
#include "xraycast/catheter/aneurysm_sac.hpp"
#include "xraycast/scene/scene.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace xraycast::contrast_surface_test {
namespace {

TEST(ContrastSurface, OfAnAneurysmIsItsBall) {
  const VesselTree tree = test::basilar_tip();
  constexpr std::size_t kSac = 3;
  std::vector<std::vector<double>> iodine_mg_ml;
  for (const VesselBranch& branch : tree.branches()) iodine_mg_ml.emplace_back(branch.points.size() - 1);
  iodine_mg_ml[kSac].assign(iodine_mg_ml[kSac].size(), 100);
  const Surface filled = ContrastSurface(tree).filled(iodine_mg_ml);
  check(filled);
  const double sac_mm3 = sac_of(tree, kSac)->volume_mm3();
  // Twelve sides have 0.955 of a circle, and chords of a fifth of the radius cut another twentieth.
  EXPECT_LT(volume_mm3(filled.mesh), sac_mm3);
  EXPECT_GT(volume_mm3(filled.mesh), 0.9 * sac_mm3);
  for (const glm::vec3& point_mm : filled.mesh.points_mm)
    EXPECT_GE(sac_of(tree, kSac)->depth_mm(point_mm), -1e-3) << "of a float's rounding";
}

}  // namespace
}  // namespace xraycast::contrast_surface_test
