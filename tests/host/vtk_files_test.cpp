// Our surface and tree files against VTK itself, both ways. Debian's python3-vtk9 brings it; the tests are
// skipped without.
#include "support/read_scan.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cstdlib>
#include <numbers>
#include <string>

namespace xraycast::vtk_files_test {
namespace {

/// Debian's own interpreter, which finds Debian's packages whatever stands first in PATH.
const std::string kPython = "/usr/bin/python3 ";

class VtkFiles : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system((kPython + "-c 'import vtk' 2>/dev/null").c_str()) != 0)
      GTEST_SKIP() << "needs VTK for Python: apt-get install --no-install-recommends python3-vtk9";
  }

  static void run_script(const std::string& arguments) {
    ASSERT_EQ(std::system((kPython +
                           XRAYCAST_SOURCE_DIR "/tests/host/vtk_files.py"
                                               " " +
                           arguments)
                              .c_str()),
              0)
        << arguments;
  }

  nlohmann::json describe(const std::string& file) const {
    run_script("describe " + (folder_ / file).string() + " > " + (folder_ / "out.json").string());
    return nlohmann::json::parse(read_whole_file(folder_ / "out.json"));
  }

  TemporaryFolder folder_;
  const VesselTree tree_{{{{{{0, 0, 0}, 3}, {{0, 0, 9}, 2}}, -1, {}, {}},
                          {{{{0, 0, 9}, 2}, {{5, 0, 15}, 1}}, 0, {}, {}},
                          {{{{0, 0, 9}, 2}, {{-5, 1, 15}, 1}, {{-8, 1, 20}, 0.5}}, 0, {}, {}}},
                         "tree"};
};

TEST_F(VtkFiles, VtkReadsOurSurfaces) {
  const Mesh mesh = tube_mesh(tree_);
  for (const char* file : {"mesh.stl", "mesh.vtp"}) {
    write_mesh(mesh, folder_ / file);
    const nlohmann::json seen = describe(file);
    EXPECT_EQ(seen["polys"], mesh.triangles.size());
    EXPECT_EQ(seen["open_edges"], 0);
    EXPECT_THAT(seen["space"].get<std::string>(), testing::HasSubstr("LPS"));
    // vtkMassProperties sums in another way, in double; STL and VTP both keep the floats.
    EXPECT_NEAR(seen["volume"].get<double>(), volume_mm3(mesh), 1e-4 * volume_mm3(mesh));
  }
}

TEST_F(VtkFiles, VtkReadsOurTree) {
  write_tree(tree_, folder_ / "tree.vtp");
  const nlohmann::json seen = describe("tree.vtp");
  EXPECT_EQ(seen["lines"], 3);
  EXPECT_EQ(seen["space"], "LPS");
  EXPECT_EQ(seen["points"][6], nlohmann::json({-8.0, 1.0, 20.0}));
  EXPECT_EQ(seen["point_arrays"]["MaximumInscribedSphereRadius"], nlohmann::json({3, 2, 2, 1, 2, 1, 0.5}));
  EXPECT_EQ(seen["cell_arrays"]["GroupIds"], nlohmann::json({0, 1, 2}));
  EXPECT_EQ(seen["cell_arrays"]["CenterlineIds"], nlohmann::json({0, 0, 1}));
  EXPECT_EQ(seen["cell_arrays"]["TractIds"], nlohmann::json({0, 1, 1}));
  EXPECT_EQ(seen["cell_arrays"]["Blanking"], nlohmann::json({0, 0, 0}));
  EXPECT_EQ(seen["cell_arrays"]["ParentIds"], nlohmann::json({-1, 0, 0}));
  EXPECT_EQ(seen["int_arrays"], true);
}

TEST_F(VtkFiles, VtkReadsWhatSegmentWrites) {
  const auto xraycast = [&](const std::string& arguments) {
    ASSERT_EQ(std::system((XRAYCAST_PROGRAM " " + arguments + " -q > /dev/null").c_str()), 0) << arguments;
  };
  const std::string scan = (folder_ / "thorax.nrrd").string(), vessels = (folder_ / "vessels").string();
  xraycast("phantom thorax --spacing 2 -o " + scan);
  xraycast("segment " + scan + " -o " + vessels + " --triangles 5000");

  const VesselTree tree = read_tree(folder_ / "vessels" / "tree.vtp");
  std::size_t points = 0;
  for (const VesselBranch& branch : tree.branches()) points += branch.points.size();
  const nlohmann::json lines = describe("vessels/tree.vtp");
  EXPECT_EQ(lines["lines"], tree.branches().size());
  EXPECT_EQ(lines["points"].size(), points);
  EXPECT_EQ(lines["space"], "LPS");
  EXPECT_EQ(lines["int_arrays"], true);
  EXPECT_EQ(lines["point_arrays"]["MaximumInscribedSphereRadius"].size(), points);
  for (const char* array : {"GroupIds", "CenterlineIds", "TractIds", "Blanking", "ParentIds"})
    EXPECT_EQ(lines["cell_arrays"][array].size(), tree.branches().size()) << array;

  const Mesh mesh = read_mesh(folder_ / "vessels" / "surface.vtp");
  for (const char* file : {"vessels/surface.vtp", "vessels/surface.stl"}) {
    const nlohmann::json surface = describe(file);
    EXPECT_EQ(surface["polys"], mesh.triangles.size()) << file;
    EXPECT_EQ(surface["open_edges"], 0) << file;
    EXPECT_THAT(surface["space"].get<std::string>(), testing::HasSubstr("LPS")) << file;
    // vtkMassProperties sums in another way, in double; STL and VTP both keep the floats.
    EXPECT_NEAR(surface["volume"].get<double>(), volume_mm3(mesh), 1e-4 * volume_mm3(mesh)) << file;
  }
}

TEST_F(VtkFiles, WeReadAllOfVtksEncodings) {
  for (const char* encoding : {"ascii none 32 little", "binary none 32 little", "binary none 64 little",
                               "binary zlib 32 little", "binary zlib 64 big", "appended none 64 little",
                               "appended zlib 32 little", "raw none 32 big", "raw zlib 64 little"}) {
    SCOPED_TRACE(encoding);
    run_script("write " + (folder_ / "sphere.vtp").string() + " " + encoding + " none");
    const Mesh mesh = read_mesh(folder_ / "sphere.vtp");
    EXPECT_TRUE(is_watertight(mesh));
    // 80 by 40 facets lie inside the ball of 10 mm; they miss (2 pi / 80)^2 / 6 + (pi / 40)^2 / 4 = 0.3 % of
    // it.
    const double ball_mm3 = 4.0 / 3 * std::numbers::pi * 1000;
    EXPECT_NEAR(volume_mm3(mesh), ball_mm3, 4e-3 * ball_mm3);
  }
}

TEST_F(VtkFiles, WeReadVtksOtherSurfaceFiles) {
  for (const char* file_and_mode : {"a.vtk ascii 42", "a.vtk binary 42", "a.vtk ascii 51", "a.vtk binary 51",
                                    "a.ply ascii", "a.ply binary", "a.obj ascii"}) {
    SCOPED_TRACE(file_and_mode);
    run_script("write_legacy " + (folder_ / file_and_mode).string());
    const Mesh mesh = read_mesh(folder_ / std::string(file_and_mode).substr(0, 5));
    EXPECT_TRUE(is_watertight(mesh));
    // As above.
    const double ball_mm3 = 4.0 / 3 * std::numbers::pi * 1000;
    EXPECT_NEAR(volume_mm3(mesh), ball_mm3, 4e-3 * ball_mm3);
  }
}

TEST_F(VtkFiles, WeReadVtksImages) {
  for (const char* encoding :
       {"ascii none 32 little short", "ascii none 64 big float", "binary none 32 little short",
        "binary none 64 big short", "binary zlib 32 big unsigned_short", "binary zlib 64 little float",
        "appended none 64 little int", "appended zlib 32 big double", "raw none 32 little short",
        "raw none 64 big int", "raw zlib 64 little unsigned_char", "raw zlib 32 big short"}) {
    SCOPED_TRACE(encoding);
    run_script("write " + (folder_ / "image.vti").string() + " " + encoding);
    const auto [info, volume, hu_range] = read_scan(folder_ / "image.vti");
    // VTK's axes (1, 0, 0), (0, 0, -1) and (0, 1, 0): x, -z and y of the patient.
    ASSERT_EQ(volume.geometry(), (VolumeGeometry{{11, 13, 12}, {0.5, 2, 0.75}, {-6, 8, 9.75 - 11 * 0.75}}));
    EXPECT_EQ(info.format, "VTK");
    EXPECT_EQ(info.orientation, "LIP");
    EXPECT_THAT(info.warnings,
                testing::ElementsAre(testing::HasSubstr("does not state the patient's orientation")));
    const bool is_byte = std::string_view(encoding).ends_with("char");
    for (std::int64_t z = 0; z < 12; ++z)
      for (std::int64_t y = 0; y < 13; ++y)
        for (std::int64_t x = 0; x < 11; ++x) {
          const std::int64_t value = x + 10 * (11 - z) + 100 * y;
          ASSERT_EQ(volume.at(x, y, z), is_byte ? value % 256 : value) << x << " " << y << " " << z;
        }
  }
}

}  // namespace
}  // namespace xraycast::vtk_files_test
