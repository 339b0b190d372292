#include "fuzz/readers.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <iterator>
#include <random>
#include <string_view>
#include <sys/resource.h>
#include <vector>

namespace xraycast::damaged_files_test {
namespace {

namespace fs = std::filesystem;

// Files of every kind that is read, each damaged in many ways that a seed repeats, and those that the fuzzer
// found to take ways of their own through the readers. Where the format has a checksum, what is read is what
// was written.

/// Of each reader: 200, or what XRAYCAST_DAMAGES says.
unsigned damages_per_reader() {
  const char* wanted = std::getenv("XRAYCAST_DAMAGES");
  return wanted ? static_cast<unsigned>(std::atoi(wanted)) : 200;
}

/// The first bytes of every kind of file.
const std::vector<std::string>& heads() {
  static const std::vector<std::string> all = [] {
    constexpr std::size_t kHead_B = 512;
    std::vector<std::string> made;
    for (const Reader& reader : readers()) {
      const TemporaryFolder folder;
      made.push_back(FileToRead(reader, folder / "").whole().substr(0, kHead_B));
    }
    return made;
  }();
  return all;
}

/// One of a text's numbers becomes one at which sizes, counts or offsets overflow, one nearby, or none.
void change_number(std::string& bytes, std::size_t first_B, std::mt19937& random) {
  constexpr std::string_view kDigits = "0123456789";
  constexpr const char* kExtremes[] = {
      "0",     "-1",     "65536", "2147483647", "2147483648", "4294967295", "4294967296",          "1e9",
      "1e308", "-1e308", "1e999", "nan",        "-inf",       "1e-300",     "9223372036854775807", "",
      "7",     "0.5"};
  std::vector<std::size_t> starts;
  for (std::size_t at = first_B; at < bytes.size();) {
    if ((at = bytes.find_first_of(kDigits, at)) == std::string::npos) break;
    starts.push_back(at);
    at = std::min(bytes.size(), bytes.find_first_not_of(kDigits, at));
  }
  if (starts.empty()) return;
  const std::size_t at = starts[random() % starts.size()];
  const std::size_t end = std::min(bytes.size(), bytes.find_first_not_of(kDigits, at));
  bytes.replace(at, end - at, kExtremes[random() % std::size(kExtremes)]);
}

/// Some bytes become a number at which sizes, counts or offsets overflow.
void change_field(std::string& bytes, std::size_t at, std::mt19937& random) {
  constexpr std::uint64_t kExtremes[] = {0,
                                         1,
                                         ~0ull,
                                         0x7fff,
                                         0x8000,
                                         0x7fffffff,
                                         0x80000000,
                                         0xffffffff,
                                         0x7f800000 /* infinity */,
                                         0x7fc00000 /* nan */,
                                         1ull << 40};
  const std::string field = bytes_of(kExtremes[random() % std::size(kExtremes)]);
  constexpr std::size_t kSizes_B[] = {2, 4, 8};
  const std::size_t size_B = std::min(kSizes_B[random() % std::size(kSizes_B)], bytes.size() - at);
  bytes.replace(at, size_B, field, 0, size_B);
}

/// Flips, writes, cuts, repeats or inserts bytes, also thousands of one kind, or puts extreme numbers or the
/// head of another kind of file there, where no checksum tells them all.
void damage(std::string& bytes, const Reader& reader, std::mt19937& random) {
  const std::size_t first_B = reader.checked_from_B.value_or(0), kinds = reader.checked_from_B ? 7 : 11;
  const auto below = [&](std::size_t limit) {
    return static_cast<std::size_t>(random() % std::max<std::size_t>(1, limit));
  };
  const auto somewhere = [&] { return first_B + below(bytes.size() - first_B); };
  // What changes the numbers and words of a text.
  constexpr std::string_view kText = "0123456789-+.eE%naif\\\"{}[]:=,() \n\t";
  for (std::size_t times = 1 + below(3); times > 0 && bytes.size() > first_B; --times) switch (below(kinds)) {
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
      case 6:
        bytes.insert(somewhere(), 300 + below(5000), kText[below(kText.size())]);
        break;
      case 7:
        bytes.replace(first_B, 1 + below(512), heads()[below(heads().size())]);
        break;
      case 8:
        change_field(bytes, somewhere(), random);
        break;
      default:
        change_number(bytes, first_B, random);
    }
}

double processor_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// The most memory that this process has had.
[[maybe_unused]] double peak_MB() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1e-3 * static_cast<double>(usage.ru_maxrss);
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
  unsigned refused = 0;
  double slowest_s = 0;
  for (unsigned seed = 0; seed < damages_per_reader(); ++seed) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    std::mt19937 random(seed);
    std::string damaged = file.whole();
    damage(damaged, reader, random);
    std::optional<Reader::Content> read;
    const double before_s = processor_s();
    EXPECT_NO_THROW(read = file.read(damaged));
    slowest_s = std::max(slowest_s, processor_s() - before_s);
    refused += !read;
    if (read && reader.checked_from_B) {
      EXPECT_EQ(*read, *whole) << "read as something else";
    }
  }
  EXPECT_GT(refused, 0);
  if (!reader.checked_from_B) {
    EXPECT_LT(refused, damages_per_reader()) << "nothing got beyond the first check";
  }
  // What a file of some kB may take, with room for the sanitizers.
  EXPECT_LT(slowest_s, 20);
#ifndef __SANITIZE_ADDRESS__  // which keeps what is freed
  EXPECT_LT(peak_MB(), 1000);
#endif
  std::printf("%s: %u of %u refused, at most %.2f s\n", reader.name, refused, damages_per_reader(),
              slowest_s);
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
