#include "xraycast/casting/body_map.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <random>

namespace xraycast {
namespace {

BodyMap make_map(int layers) {
  const VolumeGeometry volume{{64, 64, 20}, {1.1, 1.1, 2.5}, {-33.3, -30, 7}};
  BodyMap map;
  map.geometry =
      cylinder_map(volume, 90, shell_radii_mm(RadiiRule::equal_area, layers, 31.7), {0.1, 1.0 / 3});
  map.opacity = Opacity::bilinear();
  map.source = "a test";
  std::mt19937 random(7);
  std::uniform_real_distribution<float> tau(0, 9);
  for (std::size_t i = 0; i < map.layer_size() * layers; ++i) map.tau.push_back(tau(random));
  return map;
}

TEST(BodyMapFile, ReadingBackGivesTheSame) {
  const TemporaryFolder folder;
  for (const int layers : {1, 5}) {
    const BodyMap written = make_map(layers);
    write_body_map(written, folder / "map.exr");
    const BodyMap read = read_body_map(folder / "map.exr");
    EXPECT_EQ(read.geometry, written.geometry);
    EXPECT_EQ(read.opacity, written.opacity);
    EXPECT_EQ(read.source, written.source);
    EXPECT_EQ(read.tau, written.tau);
  }
}

BodyMap make_spectrum_map(int layers) {
  BodyMap map = make_map(layers);
  map.opacity = Opacity::paper();
  map.spectrum = Spectrum("two lines", {{33.3, 1.0 / 3}, {60, 2}});
  map.depths = {map.tau, std::vector<float>(map.tau.rbegin(), map.tau.rend()),
                std::vector<float>(map.tau.size())};
  map.tau.clear();
  return map;
}

TEST(BodyMapFile, OfASpectrumReadsBackTheSame) {
  const TemporaryFolder folder;
  for (const int layers : {1, 5}) {
    const BodyMap written = make_spectrum_map(layers);
    write_body_map(written, folder / "map.exr");
    const BodyMap read = read_body_map(folder / "map.exr");
    EXPECT_EQ(read.geometry, written.geometry);
    EXPECT_EQ(read.spectrum, written.spectrum);
    EXPECT_EQ(read.source, written.source);
    EXPECT_EQ(read.depths, written.depths);
    EXPECT_TRUE(read.tau.empty());
  }
}

TEST(BodyMapFile, VersionSaysWhetherItIsOfASpectrum) {
  const TemporaryFolder folder;
  const auto spec_of = [&](const BodyMap& map) {
    write_body_map(map, folder / "map.exr");
    return OIIO::ImageInput::open((folder / "map.exr").string())->spec();
  };
  EXPECT_EQ(spec_of(make_map(2)).get_int_attribute("xraycast:version"), 1);
  const OIIO::ImageSpec spec = spec_of(make_spectrum_map(2));
  EXPECT_EQ(spec.get_int_attribute("xraycast:version"), 2);
  EXPECT_THAT(spec.channelnames, testing::UnorderedElementsAre("water", "bone", "iodine"));
}

TEST(BodyMapFile, IsAMultiPartExrThatOthersRead) {
  const TemporaryFolder folder;
  write_body_map(make_map(3), folder / "map.exr");
  const auto in = OIIO::ImageInput::open((folder / "map.exr").string());
  ASSERT_TRUE(in);
  EXPECT_STREQ(in->format_name(), "openexr");
  EXPECT_EQ(in->spec().get_int_attribute("oiio:subimages"), 3);
  EXPECT_EQ(in->spec().channelnames, std::vector<std::string>{"tau"});
  EXPECT_EQ(in->spec().get_string_attribute("xraycast:projection"), "cylinder");
}

TEST(BodyMapFile, DamageIsFound) {
  const TemporaryFolder folder;
  write_body_map(make_map(3), folder / "map.exr");
  std::ifstream file(folder / "map.exr", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  for (const double share : {0.0, 0.01, 0.3, 0.9}) {
    std::ofstream(folder / "cut.exr", std::ios::binary)
        << bytes.substr(0, static_cast<std::size_t>(share * static_cast<double>(bytes.size())));
    EXPECT_THROW(read_body_map(folder / "cut.exr"), InputError) << share;
  }
}

TEST(BodyMapFile, ForeignImagesAreToldApart) {
  const TemporaryFolder folder;
  const auto out = OIIO::ImageOutput::create("exr");
  const OIIO::ImageSpec spec(4, 4, 1, OIIO::TypeDesc::FLOAT);
  const std::vector<float> pixels(16);
  ASSERT_TRUE(out->open((folder / "foreign.exr").string(), spec) &&
              out->write_image(OIIO::TypeDesc::FLOAT, pixels.data()) && out->close());
  try {
    read_body_map(folder / "foreign.exr");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("not a body map"));
  }
}

TEST(Preview, StacksLayersFromTheInnermostDown) {
  const TemporaryFolder folder;
  BodyMap map = make_map(2);
  std::ranges::fill(map.tau, 0.0f);
  std::fill(map.tau.begin() + static_cast<std::ptrdiff_t>(map.layer_size()), map.tau.end(), 20.0f);
  write_preview(map, PreviewWindow::paper, folder / "map.png");
  const auto in = OIIO::ImageInput::open((folder / "map.png").string());
  ASSERT_TRUE(in);
  ASSERT_EQ(in->spec().width, 90);
  ASSERT_EQ(in->spec().height, 40);
  ASSERT_EQ(in->spec().nchannels, 3);
  std::vector<std::uint8_t> pixels(90 * 40 * 3);
  ASSERT_TRUE(in->read_image(0, 0, 0, 3, OIIO::TypeDesc::UINT8, pixels.data()));
  EXPECT_EQ(pixels.front(), 255);  // exp(-0)
  EXPECT_EQ(pixels.back(), 0);     // exp(-20), below half a grey level
}

TEST(Preview, AppliesTheSpectrumToEachLayer) {
  const TemporaryFolder folder;
  BodyMap map = make_spectrum_map(2);
  map.spectrum = Spectrum("a line", {{60, 1}});
  // A transmission of a half in the inner layer, of a quarter in the outer one.
  const auto half_g_cm2 = static_cast<float>(std::log(2) / mass_attenuation_cm2_g("Water, Liquid", 60));
  for (auto& depth : map.depths) std::ranges::fill(depth, 0.0f);
  std::ranges::fill(map.depths[0], half_g_cm2);
  std::fill(map.depths[0].begin() + static_cast<std::ptrdiff_t>(map.layer_size()), map.depths[0].end(),
            2 * half_g_cm2);
  write_preview(map, PreviewWindow::paper, folder / "map.png");
  const auto in = OIIO::ImageInput::open((folder / "map.png").string());
  ASSERT_TRUE(in);
  std::vector<std::uint8_t> pixels(90 * 40 * 3);
  ASSERT_TRUE(in->read_image(0, 0, 0, 3, OIIO::TypeDesc::UINT8, pixels.data()));
  EXPECT_NEAR(pixels.front(), 127.5, 1);  // a grey level
  EXPECT_NEAR(pixels.back(), 63.75, 1);
}

TEST(Preview, WindowUsesMostOfTheRangeOfGrey) {
  const TemporaryFolder folder;
  write_preview(make_map(1), PreviewWindow::automatic, folder / "map.png");
  const auto in = OIIO::ImageInput::open((folder / "map.png").string());
  ASSERT_TRUE(in);
  std::vector<std::uint8_t> pixels(90 * 20 * 3);
  ASSERT_TRUE(in->read_image(0, 0, 0, 3, OIIO::TypeDesc::UINT8, pixels.data()));
  EXPECT_LT(*std::ranges::min_element(pixels), 40);
  EXPECT_EQ(*std::ranges::max_element(pixels), 255);
}

TEST(OutputFile, FailuresLeaveTheTargetAsItWas) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "folder.exr");
  EXPECT_THROW(write_body_map(make_map(1), folder / "folder.exr"), InputError);
  EXPECT_THROW(write_body_map(make_map(1), folder / "missing" / "map.exr"), InputError);
  EXPECT_THROW(write_body_map(make_map(1), "/dev/null"), InputError);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder / ""), {}), 1);
}

}  // namespace
}  // namespace xraycast
