#include "xraycast/drawing/gif_file.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/drawing/palette.hpp"

#include <array>
#include <cerrno>
#include <cmath>
#include <gif_lib.h>
#include <memory>

namespace xraycast {
namespace {

int write_bytes(GifFileType* gif, const GifByteType* bytes, int count) {
  auto& out = *static_cast<std::ofstream*>(gif->UserData);
  return out.write(reinterpret_cast<const char*>(bytes), count) ? count : 0;
}

}  // namespace

GifFile::GifFile(const std::filesystem::path& path, int width, int height, double frame_s)
    : file_(path),
      out_(file_.temporary(), std::ios::binary),
      width_(width),
      height_(height),
      frame_s_(frame_s) {
  int ignored = 0;
  gif_ = EGifOpen(&out_, write_bytes, &ignored);
  check(gif_ != nullptr);
  EGifSetGifVersion(gif_, true);
  check(EGifPutScreenDesc(gif_, width_, height_, 8, 0, nullptr) == GIF_OK);
  // Netscape's extension: repeat (1) without end (0).
  constexpr std::array<GifByteType, 3> kForEver{1, 0, 0};
  check(EGifPutExtensionLeader(gif_, APPLICATION_EXT_FUNC_CODE) == GIF_OK &&
        EGifPutExtensionBlock(gif_, 11, "NETSCAPE2.0") == GIF_OK &&
        EGifPutExtensionBlock(gif_, kForEver.size(), kForEver.data()) == GIF_OK &&
        EGifPutExtensionTrailer(gif_) == GIF_OK);
}

GifFile::~GifFile() {
  int ignored = 0;
  if (gif_) EGifCloseFile(gif_, &ignored);
}

void GifFile::add(std::span<const std::uint8_t> rgb) {
  IndexedPicture picture = with_palette(rgb);
  const std::unique_ptr<ColorMapObject, decltype(&GifFreeMapObject)> colours(GifMakeMapObject(256, nullptr),
                                                                             &GifFreeMapObject);
  check(colours != nullptr);
  for (std::size_t i = 0; i < picture.palette.size(); ++i) {
    const auto& [r, g, b] = picture.palette[i];
    colours->Colors[i] = {r, g, b};
  }
  GraphicsControlBlock control{DISPOSE_DO_NOT, false, next_delay(), NO_TRANSPARENT_COLOR};
  std::array<GifByteType, 4> packed{};
  EGifGCBToExtension(&control, packed.data());
  check(EGifPutExtension(gif_, GRAPHICS_EXT_FUNC_CODE, packed.size(), packed.data()) == GIF_OK &&
        EGifPutImageDesc(gif_, 0, 0, width_, height_, false, colours.get()) == GIF_OK);
  for (int y = 0; y < height_; ++y)
    check(EGifPutLine(gif_, picture.indices.data() + std::ptrdiff_t{y} * width_, width_) == GIF_OK);
}

/// In hundredths of a second, so that rounding does not add up.
int GifFile::next_delay() {
  constexpr double kHundredths = 100;
  const auto shown_until = [this](int frames) { return std::lround(kHundredths * frame_s_ * frames); };
  ++count_;
  return static_cast<int>(shown_until(count_) - shown_until(count_ - 1));
}

void GifFile::finish() {
  int ignored = 0;
  const bool is_closed = EGifCloseFile(gif_, &ignored) == GIF_OK;
  gif_ = nullptr;
  out_.close();
  check(is_closed && out_);
  file_.commit();
}

void GifFile::check(bool ok) const {
  if (!ok) throw file_.failure(errno);
}

}  // namespace xraycast
