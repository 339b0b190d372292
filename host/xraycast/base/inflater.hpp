#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <vector>
#include <zlib.h>

namespace xraycast {

/// The most bytes that one byte of a deflated stream unpacks to (https://zlib.net/zlib_tech.html).
inline constexpr std::int64_t kDeflateLimit = 1032;

/// Unpacks a deflated stream within a file, in order, in a few hundred kilobytes of memory.
class Inflater {
 public:
  enum class Format {
    zlib_or_gzip,  ///< a stream of zlib, or one of gzip members, with their checksums
    raw            ///< without header and checksum
  };

  /// Throws InputError when the file cannot be read.
  Inflater(const std::filesystem::path& file, std::int64_t start_B, Format format);
  ~Inflater();
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  /// Returns how many bytes there were, fewer than asked for only at the stream's end, where its checksum
  /// fitted. Throws InputError when the stream is damaged or ends too early.
  std::int64_t read(std::span<char> bytes);

  /// Reads `count` bytes and drops them, or all without it. Returns how many there were. Throws as read().
  std::int64_t skip(std::optional<std::int64_t> count = std::nullopt);

 private:
  void step();
  void refill();
  void end_stream();

  std::string name_;
  Format format_;
  std::ifstream stream_;
  std::vector<Bytef> packed_;
  z_stream zlib_{};
  bool ended_ = false;
};

}  // namespace xraycast
