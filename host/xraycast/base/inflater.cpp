#include "xraycast/base/inflater.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <array>
#include <new>
#include <string_view>

namespace xraycast {

Inflater::Inflater(const std::filesystem::path& file, std::int64_t start_B, Format format)
    : name_(file.string()), format_(format), stream_(file, std::ios::binary), packed_(1 << 18) {
  stream_.seekg(start_B);
  if (!stream_) throw InputError("{}: cannot be read; check its permissions", name_);
  constexpr int kEitherFormat = MAX_WBITS + 32;
  if (inflateInit2(&zlib_, format == Format::raw ? -MAX_WBITS : kEitherFormat) != Z_OK)
    throw std::bad_alloc();
}

Inflater::~Inflater() { inflateEnd(&zlib_); }

std::int64_t Inflater::read(std::span<char> bytes) {
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

std::int64_t Inflater::skip(std::optional<std::int64_t> count) {
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

void Inflater::step() {
  refill();
  const int status = inflate(&zlib_, Z_NO_FLUSH);
  if (status == Z_STREAM_END) return end_stream();
  if (status == Z_OK) return;
  if (status == Z_BUF_ERROR)
    throw InputError("{}: truncated: its compressed data end too early; copy it again", name_);
  if (status == Z_MEM_ERROR) throw std::bad_alloc();
  const std::string_view why = zlib_.msg ? zlib_.msg : "";
  if (why == "incorrect data check" || why == "incorrect length check")
    throw InputError("{}: damaged: its checksum does not match; copy it again", name_);
  throw InputError("{}: damaged: its data cannot be decompressed; copy it again", name_);
}

void Inflater::refill() {
  if (zlib_.avail_in > 0) return;
  stream_.read(reinterpret_cast<char*>(packed_.data()), std::ssize(packed_));
  zlib_.next_in = packed_.data();
  zlib_.avail_in = static_cast<uInt>(stream_.gcount());
}

/// Some programs write several gzip members; other trailing bytes, such as padding, are ignored.
void Inflater::end_stream() {
  refill();
  ended_ = format_ == Format::raw || zlib_.avail_in == 0 || *zlib_.next_in != 0x1f;
  if (!ended_) inflateReset(&zlib_);
}

}  // namespace xraycast
