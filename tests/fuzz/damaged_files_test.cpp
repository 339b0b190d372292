#include "fuzz/readers.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string_view>

namespace xraycast::damaged_files_test {
namespace {

namespace fs = std::filesystem;

// Files of every kind that is read, each damaged in many ways that a seed repeats, and those that the fuzzer
// found to take ways of their own through the readers. Where the format has a checksum, what is read is what
// was written.

constexpr int kDamagesPerReader = 200;

/// Flips, writes, cuts, repeats or inserts bytes behind `first_B`, also thousands of one kind.
void damage(std::string& bytes, std::size_t first_B, std::mt19937& random) {
  const auto below = [&](std::size_t limit) {
    return static_cast<std::size_t>(random() % std::max<std::size_t>(1, limit));
  };
  const auto somewhere = [&] { return first_B + below(bytes.size() - first_B); };
  // What changes the numbers and words of a text.
  constexpr std::string_view kText = "0123456789-+.eE%naif\\\"{}[]:=,() \n\t";
  for (std::size_t times = 1 + below(3); times > 0 && bytes.size() > first_B; --times) switch (below(7)) {
      case 0:
        bytes[somewhere()] ^= static_cast<char>(1 << below(8));
        break;
      case 1:
        bytes[somewhere()] = static_cast<char>(random());
        break;
      case 2:
        bytes[somewhere()] = kText[below(kText.size())];
        break;
      case 3:
        bytes.erase(somewhere(), 1 + below(below(2) == 0 ? 4 : bytes.size()));
        break;
      case 4:
        bytes.insert(somewhere(), bytes.substr(somewhere(), 1 + below(20)));
        break;
      case 5:
        bytes.insert(somewhere(), 1, kText[below(kText.size())]);
        break;
      default:
        bytes.insert(somewhere(), 300 + below(5000), kText[below(kText.size())]);
    }
}

class DamagedFile : public testing::TestWithParam<Reader> {
 protected:
  TemporaryFolder folder_;
};

TEST_P(DamagedFile, IsReadOrRefused) {
  const Reader& reader = GetParam();
  const FileToRead file(reader, folder_ / "");
  const auto whole = file.read(file.whole());
  ASSERT_TRUE(whole) << "a whole file is refused";
  int refused = 0;
  for (unsigned seed = 0; seed < kDamagesPerReader; ++seed) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    std::mt19937 random(seed);
    std::string damaged = file.whole();
    damage(damaged, reader.checked_from_B.value_or(0), random);
    std::optional<Reader::Content> read;
    EXPECT_NO_THROW(read = file.read(damaged));
    refused += !read;
    if (read && reader.checked_from_B) {
      EXPECT_EQ(*read, *whole) << "read as something else";
    }
  }
  EXPECT_GT(refused, 0);
}

TEST_P(DamagedFile, OfTheFuzzersCorpusIsReadOrRefused) {
  const FileToRead file(GetParam(), folder_ / "");
  const fs::path corpus = fs::path(XRAYCAST_SOURCE_DIR) / "tests/fuzz/corpus" / GetParam().name;
  if (!fs::exists(corpus)) return;  // the bytes of another reader's are the same
  for (const auto& entry : fs::directory_iterator(corpus)) {
    SCOPED_TRACE(entry.path().string());
    EXPECT_NO_THROW(file.read(read_bytes(entry.path())));
  }
}

INSTANTIATE_TEST_SUITE_P(, DamagedFile, testing::ValuesIn(readers().begin(), readers().end()),
                         [](const auto& reader) { return std::string(reader.param.name); });

}  // namespace
}  // namespace xraycast::damaged_files_test
