#include "support/reference.hpp"
#include "support/shared_device.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/casting/recast.hpp"
#include "xraycast/image_file/write_volume.hpp"
#include "xraycast/requests/cast_request.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace xraycast::test::cast_request_cl_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Edges = std::vector<double>;

/// A trunk of 90 x 60 mm over a table, with a vessel beside its middle, and an arm that reaches 150 mm in a
/// few slices.
Volume trunk(bool has_arm = false) {
  return make_volume({80, 60, 72}, {4, 4, 4}, [=](const glm::dvec3& p) {
    const bool is_arm = has_arm && std::abs(p.z) < 10 && std::abs(p.y) < 12 && p.x > 0 && p.x < 150;
    if (std::hypot(p.x - 20, p.y) < 9) return 400.0;
    if (is_arm || std::hypot(p.x / 90, p.y / 60) < 1) return 40 + 30 * std::sin(p.x / 9 + p.z / 7);
    return p.y > 90 && p.y < 98 && std::abs(p.x) < 100 ? 200.0 : -1000.0;
  });
}

/// Opens a volume, and counts how often.
struct Openings {
  const Volume& volume;
  int count = 0;
  ScanOpener opener() {
    return [this](Progress&) {
      ++count;
      return Scan{{}, std::make_unique<VolumeSource>(volume)};
    };
  }
};

Casting cast_slices(const Volume& volume, const CastRequest& request) {
  Progress progress;
  Openings openings{volume};
  return cast(request, openings.opener(), device(), progress);
}

TEST(CastRequest, OfAScanOnTheDeviceIsThatOfItsSlices) {
  const Volume volume = trunk();
  const SpectralScan scan{upload(device(), volume), {}};
  Progress progress;
  for (const CastRequest& request :
       {CastRequest{}, CastRequest{.layers = 3, .radii = RadiiRule::equal_thickness, .keep_table = true},
        CastRequest{.projection = RayLayout::sphere, .layers = 2, .angles = 60, .centre_mm = {1, 2, 3}},
        CastRequest{.projection = RayLayout::rectangle, .views = 3},
        CastRequest{.layers = 2, .outline = ShellOutline::circle, .opacity = Spectrum::named("80")}}) {
    OutlineFinder finder = outline_finder(request, volume.geometry());
    finder.add(volume.hu());
    const Casting resident = cast(request, scan, finder, {}, progress), read = cast_slices(volume, request);
    EXPECT_EQ(resident.map.geometry, read.map.geometry);
    EXPECT_EQ(resident.map.tau, read.map.tau);
    EXPECT_EQ(resident.map.depths, read.map.depths);
    EXPECT_EQ(read.map.geometry.has_outline(), request.has_body_outline());
  }
}

constexpr std::int64_t kLimit_B = 600'000;  // less than the trunk's 790 kB, and more than a slab's 470 kB

TEST(CastRequest, WithAMemoryLimitIsCastBySlabsToTheSameMap) {
  const Volume volume = trunk();
  const SpectralScan scan{upload(device(), volume), {}};
  Progress progress;
  const CastRequest unknown{.layers = 4},
      known{.layers = 4, .radius_mm = 70, .centre_mm = {1, -2}, .outline = ShellOutline::circle};
  // The body is looked for before the first slab.
  for (const auto& [request, openings_expected] : {std::pair(unknown, 2), std::pair(known, 1)}) {
    OutlineFinder finder = outline_finder(request, volume.geometry());
    finder.add(volume.hu());
    const Casting whole = cast(request, scan, finder, {}, progress);
    CastRequest limited = request;
    limited.memory_limit_B = kLimit_B;
    Openings openings{volume};
    EXPECT_EQ(cast(limited, openings.opener(), device(), progress).map.tau, whole.map.tau);
    EXPECT_EQ(openings.count, openings_expected);
    EXPECT_FALSE(takes_resident(limited, volume.geometry(), device()));
    EXPECT_TRUE(takes_resident(request, volume.geometry(), device()));
  }
}

TEST(CastRequest, WithAMemoryLimitHasNoBasisAndNoSpectrum) {
  const Volume volume = trunk();
  for (const CastRequest& request :
       {CastRequest{.memory_limit_B = kLimit_B, .knots_hu = Edges{}},
        CastRequest{.opacity = Spectrum::named("80"), .memory_limit_B = kLimit_B}})
    try {
      cast_slices(volume, request);
      FAIL() << "accepted";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("needs the whole scan in memory; raise `memory_limit_B`"));
    }
}

TEST(CastRequest, MakesABasisBesideTheMapOrAlone) {
  const Volume volume = trunk();
  CastRequest request{.layers = 2, .knots_hu = Edges{-1000, 0, 1000}};
  const Casting both = cast_slices(volume, request);
  request.makes_map = false;
  request.knots_hu = Edges{};
  const Casting alone = cast_slices(volume, request);
  EXPECT_THAT(both.basis->knots_hu, ElementsAre(-1000, 0, 1000));
  EXPECT_EQ(alone.basis->knots_hu, useful_knots_hu(Opacity::paper()));
  EXPECT_TRUE(alone.map.tau.empty());
  EXPECT_EQ(both.map.geometry, alone.basis->geometry);
  RecastSession session(device(), *alone.basis);
  const std::vector<float>& recast = session.recast(Opacity::paper()).tau;
  // Rounded weights (see Basis) make 90 mm / 131070 of 0.08 / mm, what mu varies by over the knots: 5e-5.
  for (std::size_t i = 0; i < recast.size(); i += 97) ASSERT_NEAR(recast[i], both.map.tau[i], 1e-4);
}

TEST(CastRequest, IsDescribedInMapAndBasis) {
  Casting casting = cast_slices(trunk(), {.knots_hu = Edges{-1000, 1000}});
  casting.describe("a trunk", "1.2");
  EXPECT_EQ(casting.map.source, "a trunk");
  EXPECT_EQ(casting.basis->frame_of_reference_uid, "1.2");
}

TEST(CastRequest, SaysWhatItsOutlineLeavesOut) {
  const Volume volume = trunk();
  const Casting plain = cast_slices(volume, {});
  EXPECT_FALSE(plain.outside_share);
  EXPECT_THAT(plain.left_out, HasSubstr("outside the outline; `keep_table` includes the table"));
  const Casting measured = cast_slices(volume, {.measures_outside = true});
  // The table of 8 x 200 mm weighs 1.2 times water, the trunk of 17,000 mm2 as much as water. Voxels of 4 mm
  // make the table thicker or thinner by a third.
  EXPECT_NEAR(*measured.outside_share, 0.1, 0.04);
  EXPECT_THAT(measured.left_out, HasSubstr("% of the scan's attenuation"));
  EXPECT_EQ(cast_slices(volume, {.outline = ShellOutline::circle}).left_out, "");
}

TEST(CastRequest, NotesWhatWouldBeBetter) {
  CastRequest request{.layers = 8, .outline = ShellOutline::circle};
  EXPECT_THAT(cast_slices(trunk(true), request).notes, ElementsAre(HasSubstr(": `radius_mm` ")));
  EXPECT_THAT(cast_slices(trunk(), request).notes, IsEmpty());
  const Volume subtracted = make_volume(
      {40, 40, 20}, {2, 2, 2}, [](const glm::dvec3& p) { return std::hypot(p.x, p.y) < 9 ? 300 : 0; });
  EXPECT_THAT(cast_slices(subtracted, {}).notes, ElementsAre(HasSubstr("use `opacity` subtracted")));
  EXPECT_THAT(cast_slices(subtracted, {.opacity = Opacity::bilinear()}).notes, IsEmpty());
}

TEST(CastRequest, MakesCirclesWhereNoBodyIsFoundUnlessTheOutlineIsAskedFor) {
  const Volume air = make_volume({20, 20, 20}, {1, 1, 1}, [](const glm::dvec3&) { return -1000; });
  CastRequest request{.radius_mm = 3, .centre_mm = {3, 3}};
  const Casting circles = cast_slices(air, request);
  EXPECT_FALSE(circles.map.geometry.has_outline());
  EXPECT_THAT(circles.notes, ElementsAre(HasSubstr("the shells are circles: nothing in the scan")));
  request.outline = ShellOutline::body;
  EXPECT_THROW(cast_slices(air, request), InputError);
}

TEST(CastRequest, WithoutVesselsIsCastOfBlood) {
  const Volume volume = trunk();
  const VolumeGeometry& grid = volume.geometry();
  std::vector<std::uint8_t> mask(volume.hu().size());
  for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = volume.hu()[i] == 400;
  const TemporaryFolder folder;
  write_mask(grid, mask, folder / "mask.nrrd");
  const Casting with = cast_slices(volume, {}),
                without = cast_slices(volume, {.without_vessels = folder.path()});
  EXPECT_EQ(with.map.geometry, without.map.geometry);
  float more = 0;
  for (std::size_t i = 0; i < with.map.tau.size(); ++i)
    more = std::max(more, with.map.tau[i] - without.map.tau[i]);
  // 18 mm of 400 HU in place of 45 HU of blood: 0.02 / mm * 355 / 1024 * 18, to a voxel of 4 mm.
  EXPECT_NEAR(more, 0.125, 0.03);
  write_mask({{1, 1, 1}, {1, 1, 1}, {0, 0, 0}}, std::vector<std::uint8_t>{1}, folder / "mask.nrrd");
  EXPECT_THROW(cast_slices(volume, {.without_vessels = folder.path()}), InputError);
}

}  // namespace
}  // namespace xraycast::test::cast_request_cl_test
