#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <ostream>
#include <span>
#include <string>

namespace xraycast {

/// One kind of file that xraycast reads, which may be damaged in any way: it is read, or refused by an
/// InputError that starts with its path and says what to do.
struct Reader {
  /// What was read, to compare; empty where there is nothing to compare with.
  using Content = std::string;

  const char* name;  ///< of its tests, of its folder in tests/fuzz/corpus, and for ./dev fuzz
  const char* file;
  void (*write)(const std::filesystem::path& path);  ///< a whole one, and what lies beside it
  Content (*read)(const std::filesystem::path& path);
  /// Where what its checksum covers starts, which is all that is damaged then.
  std::optional<std::size_t> checked_from_B = {};
  /// Sets the checksums right, as far as a file can be followed: chance alone makes none.
  void (*set_checksums)(std::span<char> bytes) = nullptr;
};

inline void PrintTo(const Reader& reader, std::ostream* out) { *out << reader.name; }

/// All of them. A new format needs one line there.
std::span<const Reader> readers();

/// A file of this kind in a folder of its own, which is replaced again and again.
class FileToRead {
 public:
  /// Writes a whole one.
  FileToRead(const Reader& reader, const std::filesystem::path& folder);

  /// The whole one's bytes.
  const std::string& whole() const { return whole_; }

  /// Replaces the file and reads it. Nothing where it is refused; throws std::logic_error for any other
  /// exception than an InputError of one line of at most 500 bytes that starts with the file's path and says
  /// what to do.
  std::optional<Reader::Content> read(const std::string& bytes) const;

 private:
  const Reader& reader_;
  std::filesystem::path path_;
  std::string whole_;
};

}  // namespace xraycast
