#include "xraycast/casting/body_map.hpp"

#include "support/pictures.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/whole_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartInputFile.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfStringAttribute.h>
#include <fstream>
#include <random>
#include <sys/resource.h>
#include <sys/stat.h>

namespace xraycast::body_map_test {
namespace {

BodyMap make_map(int layers) {
  const VolumeGeometry volume{{64, 64, 20}, {1.1, 1.1, 2.5}, {-33.3, -30, 7}};
  BodyMap map;
  map.geometry =
      cylinder_map(volume, 90, shell_radii_mm(RadiiRule::equal_area, layers, 31.7), {0.1, 1.0 / 3});
  map.attenuation = Opacity::bilinear();
  map.source = "a test";
  std::mt19937 random(7);
  std::uniform_real_distribution<float> tau(0, 9);
  for (std::size_t i = 0; i < map.layer_size() * layers; ++i) map.tau.push_back(tau(random));
  return map;
}

TEST(BodyMapFile, ReadingBackGivesTheSame) {
  const TemporaryFolder folder;
  for (const int layers : {1, 5}) {
    BodyMap written = make_map(layers);
    if (layers > 1) written.frame_of_reference_uid = "1.2.3";
    write_body_map(written, folder / "map.exr");
    const BodyMap read = read_body_map(folder / "map.exr");
    EXPECT_EQ(read.geometry, written.geometry);
    EXPECT_EQ(read.attenuation, written.attenuation);
    EXPECT_EQ(read.source, written.source);
    EXPECT_EQ(read.frame_of_reference_uid, written.frame_of_reference_uid);
    EXPECT_EQ(read.tau, written.tau);
  }
}

BodyMap make_spectrum_map(int layers) {
  BodyMap map = make_map(layers);
  map.attenuation = Spectrum("two lines", {{33.3, 1.0 / 3}, {60, 2}});
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
    EXPECT_EQ(read.attenuation, written.attenuation);
    EXPECT_EQ(read.source, written.source);
    EXPECT_EQ(read.depths, written.depths);
    EXPECT_TRUE(read.tau.empty());
  }
}

/// An outline for every texel or, of `rows` 1, for every column.
std::vector<float> outline(const MapGeometry& geometry, int rows) {
  std::vector<float> radii_mm;
  for (int i = 0; i < rows * geometry.width; ++i)
    radii_mm.push_back(static_cast<float>(31 - 7 * std::sin(0.1 * i)));
  return radii_mm;
}

TEST(BodyMapFile, WithAnOutlineReadsBackTheSame) {
  const TemporaryFolder folder;
  for (BodyMap written : {make_map(3), make_spectrum_map(3)})
    for (const int rows : {1, written.geometry.height}) {
      written.geometry = with_outline(written.geometry, outline(written.geometry, rows));
      write_body_map(written, folder / "map.exr");
      const BodyMap read = read_body_map(folder / "map.exr");
      EXPECT_EQ(read.geometry, written.geometry);
      EXPECT_EQ(read.tau, written.tau);
      EXPECT_EQ(read.depths, written.depths);
    }
}

/// A file's headers, by OpenEXR's C++ library.
std::vector<Imf::Header> headers_of(const std::filesystem::path& path) {
  const Imf::MultiPartInputFile file(path.c_str());
  std::vector<Imf::Header> headers;
  for (int k = 0; k < file.parts(); ++k) headers.push_back(file.header(k));
  return headers;
}

template <typename T>
T attribute(const Imf::Header& header, const std::string& name) {
  return header.typedAttribute<Imf::TypedAttribute<T>>("xraycast:" + name).value();
}

std::vector<std::string> channels_of(const Imf::Header& header, Imf::PixelType type = Imf::FLOAT) {
  std::vector<std::string> names;
  for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
    EXPECT_EQ(channel.channel().type, type);
    names.emplace_back(channel.name());
  }
  return names;
}

TEST(BodyMapFile, VersionSaysWhetherItIsOfASpectrum) {
  const TemporaryFolder folder;
  write_body_map(make_map(2), folder / "tau.exr");
  EXPECT_EQ(attribute<int>(headers_of(folder / "tau.exr")[0], "version"), 1);
  write_body_map(make_spectrum_map(2), folder / "spectrum.exr");
  const Imf::Header header = headers_of(folder / "spectrum.exr")[0];
  EXPECT_EQ(attribute<int>(header, "version"), 2);
  EXPECT_THAT(channels_of(header), testing::UnorderedElementsAre("water", "bone", "iodine"));
}

TEST(BodyMapFile, OutlineIsItsLastPart) {
  const TemporaryFolder folder;
  BodyMap map = make_map(3);
  map.geometry = with_outline(map.geometry, outline(map.geometry, 1));
  write_body_map(map, folder / "map.exr");
  const std::vector<Imf::Header> headers = headers_of(folder / "map.exr");
  ASSERT_EQ(headers.size(), 4u);
  EXPECT_EQ(attribute<int>(headers[0], "version"), 3);
  EXPECT_EQ(headers[3].name(), "outline");
  EXPECT_EQ(channels_of(headers[3]), std::vector<std::string>{"radius_mm"});
  EXPECT_EQ(headers[3].dataWindow(), headers[0].dataWindow());
}

TEST(BodyMapFile, IsAMultiPartExrThatOthersRead) {
  const TemporaryFolder folder;
  const BodyMap map = make_map(3);
  write_body_map(map, folder / "map.exr");
  const std::vector<Imf::Header> headers = headers_of(folder / "map.exr");
  ASSERT_EQ(headers.size(), 3u);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(headers[k].name(), fmt::format("layer {}", k));
    EXPECT_EQ(headers[k].compression(), Imf::ZIPS_COMPRESSION);
    EXPECT_EQ(channels_of(headers[k]), std::vector<std::string>{"tau"});
    EXPECT_EQ(attribute<int>(headers[k], "layer"), k);
    EXPECT_EQ(attribute<std::string>(headers[k], "projection"), "cylinder");
  }
  EXPECT_THAT(map.layer(0), testing::ElementsAreArray(read_exr(folder / "map.exr", "tau")));
}

/// What reading a file is refused with; empty when it is read.
std::string refusal_of(const std::filesystem::path& path) {
  try {
    read_body_map(path);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

/// A file with these headers and values of 0.
void write_layers(const std::filesystem::path& path, std::vector<Imf::Header> headers) {
  for (Imf::Header& header : headers) {
    header.setType(Imf::SCANLINEIMAGE);
    header.erase("chunkCount");
  }
  Imf::MultiPartOutputFile file(path.c_str(), headers.data(), static_cast<int>(headers.size()));
  for (int k = 0; k < file.parts(); ++k) {
    Imf::OutputPart part(file, k);
    part.setFrameBuffer({});  // fills with zeros
    part.writePixels(headers[k].dataWindow().size().y + 1);
  }
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
  Imf::Header header(4, 4);
  header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
  write_layers(folder / "foreign.exr", {header});
  write_picture(std::vector<std::uint8_t>(16), 4, 4, 1, folder / "picture.png");
  write_whole_file(folder / "empty.exr", "");
  for (const char* name : {"foreign.exr", "picture.png", "empty.exr"})
    EXPECT_EQ(refusal_of(folder / name),
              (folder / name).string() + ": not a body map; make one with `xraycast cast`");
  EXPECT_THAT(refusal_of(folder / "none.exr"), testing::EndsWith(": no such file; check its name"));
  // A name that no file can have.
  EXPECT_THAT(refusal_of(std::string(300, 'a') + ".exr"),
              testing::EndsWith(": no such file; check its name"));
  header.insert("xraycast:version", Imf::IntAttribute(9));
  write_layers(folder / "later.exr", {header});
  EXPECT_THAT(refusal_of(folder / "later.exr"), testing::EndsWith("versions 1 to 5; use a newer xraycast"));
}

TEST(BodyMapFile, AFrameOfReferenceThatIsNoUidIsRefused) {
  const TemporaryFolder folder;
  BodyMap map = make_map(1);
  map.frame_of_reference_uid = "table 2";
  write_body_map(map, folder / "map.exr");
  EXPECT_THAT(refusal_of(folder / "map.exr"),
              testing::HasSubstr("frame_of_reference_uid is not a DICOM UID"));
}

TEST(BodyMapFile, LayersThatDoNotFitAreRefused) {
  const TemporaryFolder folder;
  write_body_map(make_map(3), folder / "map.exr");
  const std::vector<Imf::Header> good = headers_of(folder / "map.exr");
  const auto refusal_with = [&](const std::vector<Imf::Header>& headers) {
    write_layers(folder / "odd.exr", headers);
    return refusal_of(folder / "odd.exr");
  };
  EXPECT_EQ(refusal_with(good), "");
  EXPECT_THAT(refusal_with({good[0], good[1]}),
              testing::EndsWith(": layer 2 of 3 is missing; cast the map again"));

  std::vector<Imf::Header> headers = good;
  headers[1].dataWindow().max.x -= 1;
  EXPECT_THAT(refusal_with(headers),
              testing::EndsWith(": layer 1 differs in size from layer 0; cast the map again"));

  headers = good;
  headers[2].channels() = {};
  headers[2].channels().insert("Y", Imf::Channel(Imf::FLOAT));
  EXPECT_THAT(refusal_with(headers), testing::HasSubstr("layer 2 has an unexpected channel Y"));
  headers[2].channels() = {};
  headers[2].channels().insert("tau", Imf::Channel(Imf::HALF));
  EXPECT_THAT(refusal_with(headers), testing::HasSubstr("layer 2 has an unexpected channel tau"));
}

TEST(BodyMapFile, HalvesAndBytesReadBackWithinHalfAStep) {
  const TemporaryFolder folder;
  for (const MapPrecision precision : {MapPrecision::float16, MapPrecision::byte})
    for (BodyMap written : {make_map(3), make_spectrum_map(3)}) {
      written.precision = precision;
      written.geometry = with_outline(written.geometry, outline(written.geometry, 1));
      write_body_map(written, folder / "map.exr");
      const BodyMap read = read_body_map(folder / "map.exr");
      EXPECT_EQ(read.precision, precision);
      EXPECT_EQ(read.geometry, written.geometry);
      EXPECT_EQ(read.attenuation, written.attenuation);
      // Values are 0 to 9. Halves above 8 are 1/128 apart; bytes of a layer 9/255. And 32-bit rounding.
      const float half_a_step = 1e-5f + 0.5f * (precision == MapPrecision::byte ? 9.0f / 255 : 1.0f / 128);
      EXPECT_THAT(read.tau, testing::Pointwise(testing::FloatNear(half_a_step), written.tau));
      for (std::size_t m = 0; m < kMaterials.size(); ++m)
        EXPECT_THAT(read.depths[m], testing::Pointwise(testing::FloatNear(half_a_step), written.depths[m]));
    }
}

TEST(BodyMapFile, OfBytesTakesLessThanAByteOfATexel) {
  const TemporaryFolder folder;
  BodyMap map = make_map(4);
  // Smooth, as bodies are.
  for (std::size_t i = 0; i < map.tau.size(); ++i) map.tau[i] = std::sin(1e-2f * static_cast<float>(i)) + 1;
  std::uintmax_t before_B = std::numeric_limits<std::uintmax_t>::max();
  for (const MapPrecision precision : {MapPrecision::float32, MapPrecision::float16, MapPrecision::byte}) {
    map.precision = precision;
    write_body_map(map, folder / "map.exr");
    const std::uintmax_t size_B = std::filesystem::file_size(folder / "map.exr");
    EXPECT_LT(size_B, before_B) << to_string(precision);
    before_B = size_B;
  }
  constexpr std::uintmax_t kHeaders_B = 4 * 4000;
  EXPECT_LT(before_B, map.tau.size() + kHeaders_B);
}

TEST(BodyMapFile, BytesOfALayerReachFromItsLeastToItsLargestValue) {
  const TemporaryFolder folder;
  BodyMap map = make_map(2);
  map.precision = MapPrecision::byte;
  std::fill_n(map.tau.begin(), map.layer_size(), 3.5f);  // all alike
  map.tau[map.layer_size()] = 2;
  map.tau[map.layer_size() + 1] = 20;
  write_body_map(map, folder / "map.exr");
  const std::vector<Imf::Header> headers = headers_of(folder / "map.exr");
  EXPECT_EQ(attribute<int>(headers[0], "version"), 4);
  EXPECT_EQ(channels_of(headers[0], Imf::HALF), std::vector<std::string>{"tau"});
  const BodyMap read = read_body_map(folder / "map.exr");
  EXPECT_THAT(read.layer(0), testing::Each(3.5f));
  EXPECT_FLOAT_EQ(std::ranges::max(read.layer(1)), 20);
}

TEST(BodyMapFile, DamagedByteRangesAreRefused) {
  const TemporaryFolder folder;
  BodyMap map = make_map(2);
  map.precision = MapPrecision::byte;
  write_body_map(map, folder / "map.exr");
  std::vector<Imf::Header> headers = headers_of(folder / "map.exr");
  const auto refusal_with = [&](const char* name, const std::string& text) {
    std::vector<Imf::Header> changed = headers;
    for (Imf::Header& header : changed) header.insert(name, Imf::StringAttribute(text));
    write_layers(folder / "odd.exr", changed);
    return refusal_of(folder / "odd.exr");
  };
  EXPECT_EQ(refusal_with("xraycast:byte_ranges", R"({"tau": [[0, 0.1], [1, 0]]})"), "");
  for (const char* ranges :
       {R"({"tau": [[0, 0.1]]})", R"({"tau": [[0, 0.1], [1, -1]]})", R"({"tau": [[0, 0.1], [-1, 1]]})",
        R"({"tau": [[0, 0.1], [0, 1e99]]})", R"({"tau": [[0, 0.1], [0]]})", R"({"tau": [[0, 0.1], "no"]})",
        R"({"bone": [[0, 0.1], [0, 1]]})", "[]"})
    EXPECT_THAT(refusal_with("xraycast:byte_ranges", ranges),
                testing::HasSubstr("attribute xraycast:byte_ranges must hold an offset and a scale"))
        << ranges;
  EXPECT_THAT(refusal_with("xraycast:byte_ranges", "{"),
              testing::HasSubstr("attribute xraycast:byte_ranges is missing or damaged"));
  EXPECT_THAT(refusal_with("xraycast:precision", "nibble"),
              testing::HasSubstr("attribute xraycast:precision: unknown precision 'nibble'"));
}

TEST(BodyMapFile, ValuesBeyondHalvesAreRefused) {
  const TemporaryFolder folder;
  BodyMap map = make_map(2);
  map.tau[5] = 1e6f;
  for (const MapPrecision precision : {MapPrecision::float32, MapPrecision::byte}) {
    map.precision = precision;
    EXPECT_TRUE(fits_precision(map)) << to_string(precision);
  }
  map.precision = MapPrecision::float16;
  EXPECT_FALSE(fits_precision(map));
  try {
    write_body_map(map, folder / "map.exr");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("map.exr: the map's values exceed 16-bit floats"));
    EXPECT_THAT(error.what(), testing::Not(testing::HasSubstr("--")));
  }
  map.tau[5] = kLargestHalf;
  write_body_map(map, folder / "map.exr");
  EXPECT_EQ(read_body_map(folder / "map.exr").tau[5], kLargestHalf);
}

TEST(BodyMapFile, ClaimsBeyondTheFilesSizeAreRefusedBeforeMemoryIsTaken) {
  const TemporaryFolder folder;
  write_body_map(make_map(1), folder / "map.exr");
  const std::string bytes = read_whole_file(folder / "map.exr");
  const auto refusal_with = [&](const std::string& before, std::size_t offset, std::uint32_t claim) {
    std::string changed = bytes;
    const std::size_t at = changed.find(before) + before.size() + offset;
    changed.replace(at, sizeof claim, reinterpret_cast<const char*>(&claim), sizeof claim);
    write_whole_file(folder / "claim.exr", changed);
#ifdef __SANITIZE_ADDRESS__
    return refusal_of(folder / "claim.exr");  // its shadow memory is beyond any limit
#endif
    // Reading a claim of gigabytes would fail here, and not with an InputError.
    rlimit before_limit{};
    getrlimit(RLIMIT_AS, &before_limit);
    const rlimit limit{std::size_t{1} << 30, before_limit.rlim_max};
    setrlimit(RLIMIT_AS, &limit);
    const std::string said = refusal_of(folder / "claim.exr");
    setrlimit(RLIMIT_AS, &before_limit);
    return said;
  };
  const std::string window("dataWindow\0box2i\0", 17);
  const std::string source("xraycast:source\0string\0", 23);
  // The attribute's length, then xMin, yMin, xMax and yMax.
  EXPECT_THAT(refusal_with(window, 16, 60000), testing::HasSubstr("damaged: a file of"));
  EXPECT_THAT(refusal_with(window, 12, 1'000'000'000), testing::HasSubstr("damaged"));
  EXPECT_THAT(refusal_with(window, 16, 1'000'000'000), testing::HasSubstr("damaged"));
  EXPECT_THAT(refusal_with(source, 0, 2'000'000'000), testing::HasSubstr("damaged"));
}

TEST(BodyMapFile, AnyChangedByteIsRefusedOrHarmless) {
  const TemporaryFolder folder;
  write_body_map(make_map(2), folder / "map.exr");
  const std::string bytes = read_whole_file(folder / "map.exr");
  std::mt19937 random(3);
  for (int i = 0; i < 500; ++i) {
    std::string changed = bytes;
    // Half of them in the headers.
    const std::size_t end = i % 2 == 0 ? 3000 : bytes.size();
    changed[random() % end] = static_cast<char>(random());
    write_whole_file(folder / "changed.exr", changed);
    EXPECT_NO_THROW(refusal_of(folder / "changed.exr"));
  }
}

TEST(Preview, StacksLayersFromTheInnermostDown) {
  BodyMap map = make_map(2);
  std::ranges::fill(map.tau, 0.0f);
  std::fill(map.tau.begin() + static_cast<std::ptrdiff_t>(map.layer_size()), map.tau.end(), 20.0f);
  const std::vector<std::uint8_t> greys = preview_of(map, PreviewWindow::paper);
  EXPECT_EQ(greys.size(), 90U * 40);
  EXPECT_EQ(greys.front(), 255);  // exp(-0)
  EXPECT_EQ(greys.back(), 0);     // exp(-20), below half a grey level
}

TEST(Preview, AppliesTheSpectrumToEachLayer) {
  BodyMap map = make_spectrum_map(2);
  map.attenuation = Spectrum("a line", {{60, 1}});
  // A transmission of a half in the inner layer, of a quarter in the outer one.
  const auto half_g_cm2 = static_cast<float>(std::log(2) / mass_attenuation_cm2_g("Water, Liquid", 60));
  for (auto& depth : map.depths) std::ranges::fill(depth, 0.0f);
  std::ranges::fill(map.depths[0], half_g_cm2);
  std::fill(map.depths[0].begin() + static_cast<std::ptrdiff_t>(map.layer_size()), map.depths[0].end(),
            2 * half_g_cm2);
  const std::vector<std::uint8_t> pixels = preview_of(map, PreviewWindow::paper);
  EXPECT_NEAR(pixels.front(), 127.5, 1);  // a grey level
  EXPECT_NEAR(pixels.back(), 63.75, 1);
}

TEST(Preview, WindowUsesMostOfTheRangeOfGrey) {
  const std::vector<std::uint8_t> pixels = preview_of(make_map(1), PreviewWindow::automatic);
  EXPECT_LT(*std::ranges::min_element(pixels), 40);
  EXPECT_EQ(*std::ranges::max_element(pixels), 255);
}

TEST(BodyMapFile, IsNoPipe) {
  const TemporaryFolder folder;
  ASSERT_EQ(mkfifo((folder / "map.exr").c_str(), 0600), 0);
  EXPECT_THROW(read_body_map(folder / "map.exr"), InputError);  // and does not wait for a writer
}

TEST(OutputFile, FailuresLeaveTheTargetAsItWas) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "folder.exr");
  EXPECT_THROW(write_body_map(make_map(1), folder / "folder.exr"), InputError);
  EXPECT_THROW(write_body_map(make_map(1), folder / "missing" / "map.exr"), InputError);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder / ""), {}), 1);
}

}  // namespace
}  // namespace xraycast::body_map_test
