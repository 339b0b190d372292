#include "xraycast/scene/same_scan.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"

#include <gtest/gtest.h>

namespace xraycast::same_scan_test {
namespace {

const VolumeGeometry kChest{{512, 512, 275}, {0.78, 0.78, 1.0}, {-200, -180, 40}};

MapGeometry chest_map(int layers) {
  return cylinder_map(kChest, 360, shell_radii_mm(RadiiRule::equal_area, layers, 150), {0, 0});
}

void check_with(const MapGeometry& map, const VolumeGeometry& scan) {
  check_same_scan(map, "map", scan, "scan");
}
void check_with(const MapGeometry& map, const MapGeometry& basis) {
  check_same_scan(map, "map", basis, "basis");
}

TEST(SameScan, TakesEveryMapOfAScan) {
  EXPECT_NO_THROW(check_with(chest_map(4), kChest));
  EXPECT_NO_THROW(check_with(sphere_map(kChest, 90, {0, 100}, {0, 0, 150}), kChest));
  EXPECT_NO_THROW(check_with(rectangle_map(kChest, 8, 150, {0, 0}), kChest));
}

TEST(SameScan, RefusesAMapOfAnotherScan) {
  VolumeGeometry elsewhere = kChest, shorter = kChest, wider = kChest;
  elsewhere.origin_mm.z += 1000;
  shorter.size.z = 200;
  wider.spacing_mm.x = 0.9;
  for (const VolumeGeometry& other : {elsewhere, shorter, wider}) {
    EXPECT_THROW(check_with(chest_map(4), other), InputError);
    EXPECT_THROW(check_with(chest_map(4), cylinder_map(other, 360, {0, 150}, {0, 0})), InputError);
  }
  EXPECT_THROW(check_with(sphere_map(kChest, 90, {0, 100}, {0, 0, 150}), wider), InputError);
}

TEST(SameScan, RefusesABasisOfTheSameExtentInOtherSlices) {
  const VolumeGeometry thick{{512, 512, 55}, {0.78, 0.78, 5.0}, {-200, -180, 42}};
  ASSERT_EQ(field_of(thick).corners_mm(), field_of(kChest).corners_mm());
  EXPECT_THROW(check_with(chest_map(4), cylinder_map(thick, 360, {0, 150}, {0, 0})), InputError);
}

TEST(SameScan, TakesABasisOfOtherLayersOfOneScan) {
  EXPECT_NO_THROW(check_with(chest_map(4), chest_map(4)));
  EXPECT_NO_THROW(check_with(chest_map(4), chest_map(8)));
}

TEST(SameScan, TellsItsFileFromOthersOfThatName) {
  const auto may_be = [](const std::string& source, const std::string& scan) {
    return may_be_source(source, scan, "GE Genesis");
  };
  for (const char* same : {"GE Genesis chest", "chest", "GE Genesis a/chest", "GE Genesis ../a/chest",
                           "GE Genesis ./a/../a/chest/", "GE Genesis /data/a/chest",
                           "GE Genesis a/chest, breath 0.5", "GE Genesis a/chest/, breath 0.5"})
    EXPECT_TRUE(may_be(same, "/data/a/chest/")) << same;
  for (const char* other : {"", "GE Genesis b/chest", "GE Genesis ../b/chest", "GE Genesis /data/chest",
                            "GE Genesis /data/b/chest, breath 0.5", "GE Genesis my a/chest",
                            "GE Genesis a/chest 2", "GE Genesis a/my chest", "NRRD a/chest"})
    EXPECT_FALSE(may_be(other, "/data/a/chest")) << other;
}

TEST(SameScan, TellsAFileThatIsThereFromOthersOfThatName) {
  const TemporaryFolder folder;
  for (const char* name : {"a", "b"}) {
    std::filesystem::create_directory(folder / name);
    write_whole_file(folder / name / "ct.nrrd", name);
  }
  std::filesystem::create_directory_symlink("a", folder / "link");
  const std::string source = "NRRD " + (folder / "a" / "ct.nrrd").string();
  for (const char* same : {"a", "link", "b/../a"})
    EXPECT_TRUE(may_be_source(source, folder / same / "ct.nrrd", "NRRD")) << same;
  EXPECT_FALSE(may_be_source(source, folder / "b" / "ct.nrrd", "NRRD"));
}

TEST(SameScan, ReadsTheInstantBehindASource) {
  using Phases = std::map<std::string, double>;
  EXPECT_EQ(instant_of("NRRD a, b 1/scan.nrrd, breath 0.25, heart 0"), (Phases{{"breath", 0.25}}));
  EXPECT_EQ(instant_of("NRRD scan.nrrd"), Phases());
  EXPECT_EQ(instant_of("NRRD scan, 2.nrrd, breath 3"), Phases());
  EXPECT_EQ(instant_of(", breath 1"), (Phases{{"breath", 1}}));
}

TEST(SameScan, RefusesAStillMapOfAnotherInstant) {
  BodyMap map{chest_map(4), Opacity::paper(), "scan.nrrd, breath 0.5, heart 0", {}};
  EXPECT_NO_THROW(check_same_instant(map, "map", "scan.nrrd, breath 0.5"));
  EXPECT_THROW(check_same_instant(map, "map", "scan.nrrd"), InputError);
  EXPECT_THROW(check_same_instant(map, "map", "scan.nrrd, breath 0.7"), InputError);
  map.source = "scan.nrrd";
  EXPECT_NO_THROW(check_same_instant(map, "map", "vessels, breath 0"));
  EXPECT_THROW(check_same_instant(map, "map", "scan.nrrd, breath 0.7"), InputError);
}

TEST(SameScan, TakesOneGeometryWhereAFileDoesNotTellTheField) {
  MapGeometry earlier = chest_map(4);
  earlier.field.reset();
  EXPECT_NO_THROW(check_with(earlier, chest_map(4)));
  EXPECT_NO_THROW(check_with(earlier, kChest));
  EXPECT_THROW(check_with(earlier, chest_map(8)), InputError);
}

}  // namespace
}  // namespace xraycast::same_scan_test
