#include "xraycast/projection/projection_file.hpp"

#include "support/pictures.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfStringAttribute.h>
#include <memory>
#include <numbers>
#include <regex>
#include <tiffio.h>

namespace xraycast::projection_file_test {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

/// 5 x 4 pixels, seen obliquely; every pixel has its own depth.
ProjectionImage oblique_image(std::optional<Cone> cone) {
  ProjectionImage image;
  image.view = {.lao_rad = 30 * kRadians,
                .cranial_rad = -20 * kRadians,
                .cone = cone,
                .centre_mm = {10, -20, 30},
                .width = 5,
                .height = 4,
                .pixel_mm = 2.5};
  for (int i = 0; i < 20; ++i) image.tau.push_back(0.1f * static_cast<float>(i * i));
  return image;
}

class ProjectionFile : public testing::TestWithParam<std::optional<Cone>> {
 protected:
  /// The picture's pixels as a PNG has them.
  std::vector<std::uint8_t> grey_of(double gamma, bool inverted) {
    write_projection(image_, folder_ / "p.png", gamma, inverted);
    return read_png(folder_ / "p.png").values;
  }

  const ProjectionImage image_ = oblique_image(GetParam());
  TemporaryFolder folder_;
};
INSTANTIATE_TEST_SUITE_P(, ProjectionFile, testing::Values(std::nullopt, Cone{1000, 1500}),
                         [](const auto& cone) { return cone.param ? "Cone" : "Parallel"; });

/// The numbers of a header's line, in order.
std::vector<double> numbers_after(const std::string& field, const std::string& header) {
  const std::size_t start = header.find(field) + field.size();
  const std::string line = header.substr(start, header.find('\n', start) - start);
  const std::regex number("[-+0-9.e]+");
  std::vector<double> numbers;
  for (auto i = std::sregex_iterator(line.begin(), line.end(), number); i != std::sregex_iterator(); ++i)
    numbers.push_back(std::stod(i->str()));
  return numbers;
}

TEST_P(ProjectionFile, NrrdPlacesEveryPixelWhereTheViewDoes) {
  write_projection(image_, folder_ / "p.nrrd");
  const std::string bytes = read_bytes(folder_ / "p.nrrd"), header = bytes.substr(0, bytes.find("\n\n") + 1);
  EXPECT_THAT(header, testing::HasSubstr("space: left-posterior-superior\n"));
  EXPECT_THAT(header, testing::HasSubstr("sizes: 5 4 1\n"));
  const std::vector<double> axes = numbers_after("space directions:", header),
                            origin = numbers_after("space origin:", header);
  ASSERT_EQ(axes.size(), 9u);
  ASSERT_EQ(origin.size(), 3u);
  const glm::dvec3 right(axes[0], axes[1], axes[2]), down(axes[3], axes[4], axes[5]);
  const glm::dvec3 inwards(axes[6], axes[7], axes[8]), first(origin[0], origin[1], origin[2]);
  for (int j = 0; j < image_.view.height; ++j)
    for (int i = 0; i < image_.view.width; ++i)
      // Double precision, printed with all its digits.
      EXPECT_LT(
          glm::distance(first + double(i) * right + double(j) * down, image_.view.pixel_on_detector_mm(i, j)),
          1e-9);
  // The third axis makes the frame right-handed, which viewers expect.
  EXPECT_GT(glm::dot(glm::cross(right, down), inwards), 0);
  const std::string voxels = bytes_of(std::span<const float>(image_.tau));
  EXPECT_EQ(bytes.substr(bytes.size() - voxels.size()), voxels);
}

TEST_P(ProjectionFile, PngIsShownInvertedIfAsked) {
  const std::vector<std::uint8_t> dark = grey_of(1, false), light = grey_of(1, true);
  EXPECT_NE(dark, light);
  for (std::size_t i = 0; i < dark.size(); ++i) EXPECT_NEAR(dark[i] + light[i], 255, 1);  // both are rounded
}

TEST_P(ProjectionFile, GammaIsTheRootOfThePngsGrey) {
  // Under a gamma of 2 a pixel's square is what it is under 1, before it is turned round.
  const std::vector<std::uint8_t> linear = grey_of(1, false), bent = grey_of(2, false),
                                  turned = grey_of(2, true);
  for (std::size_t i = 0; i < linear.size(); ++i) {
    const double share = bent[i] / 255.0;
    // The linear one is rounded by half a grey; so is the bent one, which the square at most doubles.
    EXPECT_NEAR(255 * share * share, linear[i], 0.5 + 2 * 0.5 * share + 0.25 / 255) << i;
    EXPECT_NEAR(bent[i] + turned[i], 255, 1) << i;
  }
  EXPECT_THAT(linear, testing::Contains(testing::AllOf(testing::Gt(50), testing::Lt(200))));
}

void expect_view(const std::string& description, const View& expected) {
  EXPECT_THAT(description, testing::StartsWith("xraycast: optical depth tau; transmission is exp(-tau)"));
  const auto view = nlohmann::json::parse(description.substr(description.find('{')));
  EXPECT_EQ(view["label"], "LAO 30 / CAU 20");
  EXPECT_EQ(view["lao_rad"], expected.lao_rad);
  EXPECT_EQ(view["centre_mm"], nlohmann::json({10.0, -20.0, 30.0}));
  EXPECT_EQ(view["pixel_mm"], 2.5);
  EXPECT_EQ(view.contains("source_mm"), expected.cone.has_value());
}

TEST_P(ProjectionFile, ExrHoldsTheFloatsAndTheView) {
  write_projection(image_, folder_ / "p.exr");
  EXPECT_EQ(read_exr(folder_ / "p.exr", "tau"), image_.tau);
  const Imf::InputFile file((folder_ / "p.exr").c_str());
  const auto text = [&](const char* name) {
    return file.header().typedAttribute<Imf::StringAttribute>(name).value();
  };
  EXPECT_EQ(file.header().compression(), Imf::ZIP_COMPRESSION);
  expect_view(text("comments"), image_.view);
  EXPECT_THAT(text("comments"), testing::EndsWith(text("xraycast:view")));
}

TEST_P(ProjectionFile, TiffHoldsTheFloatsAndTheView) {
  write_projection(image_, folder_ / "p.tif");
  const std::unique_ptr<TIFF, decltype(&TIFFClose)> file(TIFFOpen((folder_ / "p.tif").c_str(), "r"),
                                                         &TIFFClose);
  ASSERT_TRUE(file);
  std::uint16_t format = 0, bits = 0;
  const char* description = nullptr;
  ASSERT_TRUE(TIFFGetField(file.get(), TIFFTAG_SAMPLEFORMAT, &format) &&
              TIFFGetField(file.get(), TIFFTAG_BITSPERSAMPLE, &bits) &&
              TIFFGetField(file.get(), TIFFTAG_IMAGEDESCRIPTION, &description));
  EXPECT_EQ(format, SAMPLEFORMAT_IEEEFP);
  EXPECT_EQ(bits, 32);
  expect_view(description, image_.view);
  std::vector<float> tau(image_.tau.size());
  ASSERT_EQ(TIFFScanlineSize(file.get()), 5 * sizeof(float));
  for (int y = 0; y < 4; ++y) ASSERT_EQ(TIFFReadScanline(file.get(), &tau[std::size_t{5} * y], y), 1);
  EXPECT_EQ(tau, image_.tau);
}

TEST(ProjectionFormat, KnowsItsFormatsByAnyCase) {
  for (const char* name : {"a.exr", "a.tif", "a.TIFF", "a.nrrd", "a.PNG", "a.jpg", "a.Hdr"})
    EXPECT_NO_THROW(check_projection_format(name)) << name;
  for (const char* name : {"a.xyz", "a", ".png", "a.png.txt"})
    EXPECT_THROW(check_projection_format(name), InputError) << name;
}

}  // namespace
}  // namespace xraycast::projection_file_test
