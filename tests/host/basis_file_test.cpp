#include "xraycast/casting/basis_file.hpp"

#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <random>
#include <zlib.h>

namespace xraycast::basis_file_test {
namespace {

using testing::HasSubstr;

/// Large enough for several chunks of rows.
Basis make_basis(int layers = 4) {
  Basis basis;
  basis.geometry = cylinder_map({{64, 64, 100}, {1.1, 1.1, 2.5}, {-33.3, -30, 7}}, 360,
                                shell_radii_mm(RadiiRule::equal_area, layers, 31.7), {0.1, 1.0 / 3});
  basis.knots_hu = {-1000, -0.1, 12.0 / 7, 40, 32767};
  for (int i = 0; i < 59; ++i) basis.knots_hu.insert(basis.knots_hu.end() - 1, 100 + i);
  basis.source = "a test of \"quotes\" and \xc3\xa4";
  basis.hu_histogram.assign(256, 123456789012);
  std::mt19937_64 random(1);
  std::size_t rows = 0;
  for (std::int64_t i = 0; i < tile_count(basis.geometry); ++i) {
    basis.touched.push_back(random());
    rows += static_cast<std::size_t>(std::popcount(basis.touched.back()));
  }
  for (std::size_t i = 0; i < 16 * rows; ++i) basis.weights.push_back(static_cast<std::uint16_t>(random()));
  return basis;
}

/// The same for shells that follow a body.
Basis make_outlined_basis() {
  Basis basis = make_basis();
  std::vector<float> outline_mm;
  for (int i = 0; i < basis.geometry.width; ++i) outline_mm.push_back(static_cast<float>(20 + i % 7));
  basis.geometry = with_outline(basis.geometry, std::move(outline_mm));
  return basis;
}

/// A chunk as write_basis documents it.
std::string chunk(const std::string& tag, const std::string& content) {
  const std::string bytes = tag + bytes_of(std::uint64_t{content.size()}) + content;
  const auto crc =
      crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<unsigned>(bytes.size()));
  return bytes + bytes_of(static_cast<std::uint32_t>(crc));
}

const std::string kStart = std::string(kBasisMagic, 8) + bytes_of(std::uint32_t{1});

constexpr char kHeader[] =
    R"({"projection": "cylinder", "width": 2, "height": 1, "radii_mm": [0, 10], "centre_mm": [[0, 0]], "top_mm": 0,)"
    R"( "row_spacing_mm": 1, "step_mm": 1, "knots_hu": [0, 100], "source": "", "hu_histogram": [)";

/// A header for two tiles with one text in it replaced by another.
std::string header(const std::string& from = "", const std::string& to = "") {
  std::string text = kHeader;
  for (int i = 0; i < 255; ++i) text += "0,";
  text += "0]}";
  return from.empty() ? text : text.replace(text.find(from), from.size(), to);
}

std::string tiles(std::uint64_t first, std::uint64_t second) { return bytes_of(first) + bytes_of(second); }

std::string rows(int count) { return std::string(32 * static_cast<std::size_t>(count), '\1'); }

void expect_refused(const std::filesystem::path& path, const std::string& message) {
  try {
    read_basis(path);
    ADD_FAILURE() << "accepted; expected: " << message;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::StartsWith(path.string()));
    EXPECT_THAT(error.what(), HasSubstr(message));
    EXPECT_THAT(error.what(), testing::Not(HasSubstr("\n")));
  }
}

TEST(BasisFile, WithAnOutlineReadsBackTheSame) {
  const TemporaryFolder folder;
  const Basis basis = make_outlined_basis();
  write_basis(basis, folder / "a.basis");
  const Basis read = read_basis(folder / "a.basis");
  EXPECT_EQ(read.geometry, basis.geometry);
  EXPECT_EQ(read.touched, basis.touched);
  EXPECT_EQ(read.weights, basis.weights);
}

TEST(BasisFile, WithADamagedOutlineIsRefused) {
  const TemporaryFolder folder;
  const std::string start = std::string(kBasisMagic, 8) + bytes_of(std::uint32_t{2});
  const auto refused = [&](const std::string& count, const std::string& radii, const std::string& message) {
    write_bytes(folder / "a.basis", start + chunk("HEAD", header("\"source\"", count + "\"source\"")) +
                                        chunk("OUTL", radii) + chunk("TILE", tiles(0, 0)));
    expect_refused(folder / "a.basis", message);
  };
  refused("", bytes_of(10.0f) + bytes_of(10.0f), "header field outline_radii");
  refused("\"outline_radii\": 3,", bytes_of(10.0f) + bytes_of(10.0f) + bytes_of(10.0f),
          "an outline of 3 radii");
  refused("\"outline_radii\": 2,", bytes_of(10.0f) + bytes_of(-10.0f), "a radius of -10 mm");
  refused("\"outline_radii\": 2,", bytes_of(9.0f) + bytes_of(9.0f), "its outline reaches 9 mm");
  refused("\"outline_radii\": 2000000000,", bytes_of(10.0f), "truncated");
}

TEST(BasisFile, ReadingBackGivesTheSame) {
  const TemporaryFolder folder;
  for (const int layers : {1, 4}) {
    Basis written = make_basis(layers);
    if (layers > 1) written.frame_of_reference_uid = "1.2.3";
    write_basis(written, folder / "a.basis");
    const Basis read = read_basis(folder / "a.basis");
    EXPECT_EQ(read.frame_of_reference_uid, written.frame_of_reference_uid);
    EXPECT_EQ(read.geometry, written.geometry);
    EXPECT_EQ(read.knots_hu, written.knots_hu);
    EXPECT_EQ(read.source, written.source);
    EXPECT_EQ(read.hu_histogram, written.hu_histogram);
    EXPECT_EQ(read.touched, written.touched);
    EXPECT_EQ(read.weights, written.weights);
  }
}

TEST(BasisFile, IsAsDocumented) {
  const TemporaryFolder folder;
  write_bytes(folder / "a.basis",
              kStart + chunk("HEAD", header()) + chunk("TILE", tiles(3, 2)) + chunk("ROWS", rows(3)));
  const Basis basis = read_basis(folder / "a.basis");
  EXPECT_EQ(basis.geometry.width, 2);
  EXPECT_EQ(basis.touched, (std::vector<std::uint64_t>{3, 2}));
  EXPECT_EQ(basis.weights, std::vector<std::uint16_t>(48, 0x0101));
}

struct Chunk {
  std::size_t begin, end;
};

std::vector<Chunk> chunks_of(const std::string& bytes) {
  std::vector<Chunk> chunks;
  for (std::size_t at = 12; at < bytes.size(); at = chunks.back().end) {
    std::uint64_t size = 0;
    std::memcpy(&size, bytes.data() + at + 4, 8);
    chunks.push_back({at, at + 4 + 8 + size + 4});
  }
  return chunks;
}

TEST(BasisFile, DamageIsFoundInEveryChunk) {
  const TemporaryFolder folder;
  write_basis(make_basis(), folder / "a.basis");
  std::string bytes = read_bytes(folder / "a.basis");
  const auto chunks = chunks_of(bytes);
  ASSERT_GE(chunks.size(), 4);  // at least two of rows
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    const auto [begin, end] = chunks[i];
    // Tag, length, both ends of the content, checksum.
    for (const std::size_t at :
         {begin, begin + 3, begin + 4, begin + 11, begin + 12, (begin + end) / 2, end - 5, end - 1}) {
      bytes[at] ^= 0x10;
      write_bytes(folder / "b.basis", bytes);
      bytes[at] ^= 0x10;
      SCOPED_TRACE("byte " + std::to_string(at - begin) + " of chunk " + std::to_string(i + 1));
      expect_refused(folder / "b.basis", "chunk " + std::to_string(i + 1));
    }
  }
}

TEST(BasisFile, TruncationIsFoundEverywhere) {
  const TemporaryFolder folder;
  write_basis(make_basis(1), folder / "a.basis");
  const std::string bytes = read_bytes(folder / "a.basis");
  for (const auto& [begin, end] : chunks_of(bytes)) {
    for (const std::size_t size : {begin, begin + 1, begin + 12, (begin + end) / 2, end - 4, end - 1}) {
      SCOPED_TRACE(size);
      write_bytes(folder / "b.basis", bytes.substr(0, size));
      expect_refused(folder / "b.basis", size <= 12 ? "" : "truncated");
    }
  }
  for (const std::size_t size : {0, 1, 8, 11}) {
    write_bytes(folder / "b.basis", bytes.substr(0, size));
    expect_refused(folder / "b.basis", "not a basis");
  }
}

struct BadBasis {
  const char* name;
  std::string bytes;
  const char* message;
};
void PrintTo(const BadBasis& bad, std::ostream* out) { *out << bad.name; }

std::string basis_with(const std::string& from, const std::string& to) {
  return kStart + chunk("HEAD", header(from, to)) + chunk("TILE", tiles(3, 2)) + chunk("ROWS", rows(3));
}

const BadBasis kBadBases[] = {
    {"Foreign", "\x76\x2f\x31\x01 an OpenEXR file, perhaps", "not a basis; make one with `xraycast cast"},
    {"TextModeTransfer", "\x89XRB\n\x1a\n" + basis_with("", "").substr(8), "not a basis"},
    {"LaterVersion", std::string(kBasisMagic, 8) + bytes_of(std::uint32_t{4}),
     "version 4, but this program reads versions 1 to 3; use a newer xraycast"},
    {"EarlierVersion", std::string(kBasisMagic, 8) + bytes_of(std::uint32_t{0}),
     "version 0, but this program reads versions 1 to 3; cast the scan again with --keep-basis"},
    {"HugeChunk", kStart + "HEAD" + bytes_of(~std::uint64_t{0}) + header(),
     "chunk 1 (HEAD) is damaged: it claims"},
    {"NotJson", kStart + chunk("HEAD", "{]"), "not a JSON object"},
    {"AnArray", kStart + chunk("HEAD", "[1]"), "not a JSON object"},
    {"NoHeader", kStart + chunk("TILE", tiles(3, 2)), "chunk 1 is damaged: it is not HEAD"},
    {"Sphere", basis_with("cylinder", "spiral"), "projection is 'spiral'"},
    {"FrameThatIsNoUid",
     basis_with("\"source\": \"\"", "\"source\": \"\", \"frame_of_reference_uid\": \"a\""),
     "frame_of_reference_uid is not a DICOM UID"},
    {"NoWidth", basis_with("\"width\"", "\"wide\""), "header field width"},
    {"NegativeWidth", basis_with("\"width\": 2", "\"width\": -2"), "header field width"},
    {"FractionalWidth", basis_with("\"width\": 2", "\"width\": 2.5"), "header field width"},
    {"HugeWidth", basis_with("\"width\": 2", "\"width\": 99999999999999"), "header field width"},
    {"TooWide", basis_with("\"width\": 2", "\"width\": 16385"), "16385 angles"},
    {"MoreTilesThanBytes", basis_with("\"width\": 2", "\"width\": 16384"), "truncated"},
    {"ManySlices", basis_with("\"height\": 1", "\"height\": 65536"), "truncated"},
    {"RadiiText", basis_with("[0, 10]", "\"all\""), "header field radii_mm"},
    {"RadiiDescend", basis_with("[0, 10]", "[10, 0]"), "radii[1]"},
    {"CentreOfThree", basis_with("[[0, 0]]", "[[0]]"), "header field centre_mm"},
    {"StepOfNull", basis_with("\"step_mm\": 1", "\"step_mm\": null"), "header field step_mm"},
    {"NoKnots", basis_with("[0, 100]", "[]"), "0 knots"},
    {"KnotsDescend", basis_with("[0, 100]", "[100, 0]"), "knot 1 at 0 HU"},
    {"ShortHistogram", basis_with("0,0,", "0,"), "hu_histogram must hold 256"},
    {"NegativeCount", basis_with("0,0,", "0,-1,"), "hu_histogram must hold 256"},
    {"UnknownKnot", kStart + chunk("HEAD", header()) + chunk("TILE", tiles(3, 4)) + chunk("ROWS", rows(3)),
     "TILE names knot 2, but there are 2"},
    {"TooFewTiles",
     kStart + chunk("HEAD", header()) + chunk("TILE", bytes_of(std::uint64_t{3})) + chunk("ROWS", rows(2)),
     "chunk 2 (TILE) is damaged: it claims 8 bytes instead of 16"},
    {"TooFewRows", kStart + chunk("HEAD", header()) + chunk("TILE", tiles(3, 2)) + chunk("ROWS", rows(2)),
     "truncated"},
    {"TooManyRows", kStart + chunk("HEAD", header()) + chunk("TILE", tiles(3, 2)) + chunk("ROWS", rows(4)),
     "chunk 3 (ROWS) is damaged: it claims 128 bytes instead of 96"},
    {"MoreAfterTheEnd", basis_with("", "") + "x", "1 bytes follow the last chunk"},
};

class BadBasisTest : public testing::TestWithParam<BadBasis> {};

TEST_P(BadBasisTest, IsRefusedWithItsReason) {
  const TemporaryFolder folder;
  write_bytes(folder / "bad.basis", GetParam().bytes);
  expect_refused(folder / "bad.basis", GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(BasisFile, BadBasisTest, testing::ValuesIn(kBadBases),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(BasisFile, ThatIsNotThereOrAFolderIsRefused) {
  const TemporaryFolder folder;
  expect_refused(folder / "missing.basis", "no such file");
  expect_refused(folder / "", "a folder, but a file is needed here");
}

}  // namespace
}  // namespace xraycast::basis_file_test
