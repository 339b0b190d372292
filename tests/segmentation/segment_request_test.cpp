// What a request to segment may ask for.
#include "xraycast/base/error.hpp"
#include "xraycast/segmentation/vessels.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace xraycast::segment_request_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

SegmentRequest from_a_mask() {
  SegmentRequest request;
  request.from_mask = std::filesystem::path("mask.nrrd");
  return request;
}

struct BadRequest {
  const char* message;
  SegmentRequest request = {};
  void (*spoil)(SegmentRequest&);
};

const BadRequest kBadRequests[] = {
    {"`max_radius_mm` 0: must be above zero", {}, [](auto& r) { r.markers.max_radius_mm = 0; }},
    {"`max_radius_mm` -3: must be above zero", {}, [](auto& r) { r.markers.max_radius_mm = -3; }},
    {"`max_radius_mm` nan", {}, [](auto& r) { r.markers.max_radius_mm = std::nan(""); }},
    {"`max_radius_mm` inf",
     {},
     [](auto& r) { r.markers.max_radius_mm = std::numeric_limits<double>::infinity(); }},
    {"`triangles` 99: must be 100 or more", {}, [](auto& r) { r.triangles = 99; }},
    {"`window_hu` 300,200: must be two CT numbers in HU, the lower one first",
     {},
     [](auto& r) {
       r.window_hu = {300, 200};
     }},
    {"`window_hu` 200,200",
     {},
     [](auto& r) {
       r.window_hu = {200, 200};
     }},
    {"`not_vessels` does not apply to `from_mask`", from_a_mask(),
     [](auto& r) {
       r.markers.not_vessels_mm = {{1, 2, 3}};
     }},
    {"`window_hu` does not apply to `from_mask`", from_a_mask(),
     [](auto& r) {
       r.window_hu = {1, 2};
     }},
    {"`max_radius_mm` does not apply to `from_mask`", from_a_mask(),
     [](auto& r) { r.markers.max_radius_mm = 9; }},
    {"`explain` does not apply to `from_mask`", from_a_mask(),
     [](auto& r) { r.explain = [](const auto&, const auto&) {}; }},
};

TEST(SegmentRequest, ThatNoScanCanFulfilIsRejected) {
  for (BadRequest bad : kBadRequests) {
    EXPECT_NO_THROW(check(bad.request));
    bad.spoil(bad.request);
    EXPECT_THAT([&] { check(bad.request); }, ThrowsMessage<InputError>(HasSubstr(bad.message)));
  }
}

TEST(SegmentRequest, KnowsItsSurfacesByName) {
  EXPECT_EQ(surface_kind("isosurface"), SurfaceKind::isosurface);
  EXPECT_EQ(surface_kind("level-set"), SurfaceKind::isosurface);  // its former name
  EXPECT_EQ(surface_kind("tubes"), SurfaceKind::tubes);
  EXPECT_THAT([] { surface_kind("cubes"); },
              ThrowsMessage<InputError>(HasSubstr("`surface` cubes: must be isosurface or tubes")));
}

TEST(SegmentRequest, IsAutomaticUnlessAPersonHasPointedAtVessels) {
  EXPECT_TRUE(SegmentRequest{}.is_automatic());
  EXPECT_FALSE(from_a_mask().is_automatic());
  SegmentRequest request;
  request.markers.vessels_mm = {{1, 2, 3}};
  EXPECT_FALSE(request.is_automatic());
}

}  // namespace
}  // namespace xraycast::segment_request_test
