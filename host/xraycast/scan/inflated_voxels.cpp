#include "xraycast/scan/inflated_voxels.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>
#include <zlib.h>

namespace xraycast {
namespace {

/// Unpacks a stream of zlib, or one of gzip members, in order.
class Inflater {
 public:
  Inflater(const std::filesystem::path& file, std::int64_t start_B)
      : name_(file.string()), stream_(file, std::ios::binary), packed_(1 << 18) {
    stream_.seekg(start_B);
    if (!stream_) throw InputError("{}: cannot be read; check its permissions", name_);
    constexpr int kEitherFormat = MAX_WBITS + 32;
    if (inflateInit2(&zlib_, kEitherFormat) != Z_OK) throw std::bad_alloc();
  }
  ~Inflater() { inflateEnd(&zlib_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  /// Returns how many bytes there were, fewer than asked for only at the stream's end, where its checksum
  /// fitted.
  std::int64_t read(std::span<char> bytes) {
    std::int64_t done = 0;
    while (!ended_ && done < std::ssize(bytes)) {
      constexpr std::int64_t kPiece = 1 << 20;
      const std::int64_t wanted = std::min(kPiece, std::ssize(bytes) - done);
      zlib_.next_out = reinterpret_cast<Bytef*>(bytes.data() + done);
      zlib_.avail_out = static_cast<uInt>(wanted);
      step();
      done += wanted - zlib_.avail_out;
    }
    return done;
  }

  /// Reads `count` bytes and drops them, or all without it. Returns how many there were.
  std::int64_t skip(std::optional<std::int64_t> count = std::nullopt) {
    std::array<char, 1 << 16> dropped;
    std::int64_t done = 0;
    while (!count || done < *count) {
      const std::int64_t wanted = count ? std::min(std::ssize(dropped), *count - done) : std::ssize(dropped);
      const std::int64_t got = read(std::span(dropped).first(static_cast<std::size_t>(wanted)));
      done += got;
      if (got < wanted) break;
    }
    return done;
  }

 private:
  void step() {
    refill();
    const int status = inflate(&zlib_, Z_NO_FLUSH);
    if (status == Z_STREAM_END) return next_member();
    if (status == Z_OK) return;
    if (status == Z_BUF_ERROR)
      throw InputError("{}: truncated, its compressed voxels end too early; copy it again", name_);
    if (status == Z_MEM_ERROR) throw std::bad_alloc();
    const std::string_view why = zlib_.msg ? zlib_.msg : "";
    if (why == "incorrect data check" || why == "incorrect length check")
      throw InputError("{}: damaged: its checksum does not match; copy it again", name_);
    throw InputError("{}: damaged: its voxels cannot be decompressed; copy it again", name_);
  }

  void refill() {
    if (zlib_.avail_in > 0) return;
    stream_.read(reinterpret_cast<char*>(packed_.data()), std::ssize(packed_));
    zlib_.next_in = packed_.data();
    zlib_.avail_in = static_cast<uInt>(stream_.gcount());
  }

  /// Some programs write several gzip members; other trailing bytes, such as padding, are ignored.
  void next_member() {
    refill();
    ended_ = zlib_.avail_in == 0 || *zlib_.next_in != 0x1f;
    if (!ended_) inflateReset(&zlib_);
  }

  std::string name_;
  std::ifstream stream_;
  std::vector<Bytef> packed_;
  z_stream zlib_{};
  bool ended_ = false;
};

}  // namespace

void require_packed(const PackedVoxels& packed, std::int64_t needed_B) {
  // No byte unpacks to more (https://zlib.net/zlib_tech.html).
  constexpr std::int64_t kDeflateLimit = 1032;
  std::error_code error;
  const auto file_B = static_cast<std::int64_t>(std::filesystem::file_size(packed.file, error));
  if (error) throw InputError("{}: cannot be opened: {}", packed.file.string(), error.message());
  const std::int64_t size_B = file_B - packed.start_B;
  if ((packed.skipped_B + needed_B) / kDeflateLimit > size_B)
    throw InputError("{}: truncated, {} compressed bytes cannot hold {} bytes of voxels; copy the file again",
                     packed.file.string(), std::max<std::int64_t>(0, size_B), needed_B);
}

std::unique_ptr<char[]> inflate_voxels(const PackedVoxels& packed, std::int64_t needed_B) {
  require_packed(packed, needed_B);
  Inflater stream(packed.file, packed.start_B);
  stream.skip(packed.skipped_B);
  auto voxels = std::make_unique_for_overwrite<char[]>(static_cast<std::size_t>(needed_B));
  const std::int64_t got = stream.read({voxels.get(), static_cast<std::size_t>(needed_B)});
  if (got < needed_B)
    throw InputError("{}: truncated, {} of {} bytes of voxels are there; copy the file again",
                     packed.file.string(), got, needed_B);
  stream.skip();
  return voxels;
}

}  // namespace xraycast
