#include "xraycast/drawing/cine_writer.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/drawing/gif_file.hpp"

#include <fmt/format.h>

#include <utility>

namespace xraycast {

bool is_animation(const std::filesystem::path& path) { return extension_of(path) == ".gif"; }

CineWriter::CineWriter(std::filesystem::path output, int width, int height, double frame_s)
    : output_(std::move(output)), width_(width), height_(height), frame_s_(frame_s) {
  if (!is_animation(output_)) frames_ = std::make_unique<OutputSeries>();
}

CineWriter::CineWriter(CineWriter&&) noexcept = default;
CineWriter::~CineWriter() = default;

void CineWriter::add(std::span<const std::uint8_t> rgb) {
  if (is_animation(output_)) {
    if (!animation_) animation_ = std::make_unique<GifFile>(output_, width_, height_, frame_s_);
    animation_->add(rgb);
  } else {
    write_picture(rgb, width_, height_, 3, frame(count_));
  }
  ++count_;
}

std::filesystem::path CineWriter::frame(int number) const {
  return output_ / fmt::format("frame-{:03}.png", number);
}

void CineWriter::finish() {
  if (animation_) animation_->finish();
  frames_.reset();
  if (is_animation(output_)) return;
  std::error_code error;
  for (int number = count_; std::filesystem::is_regular_file(frame(number), error); ++number)
    if (!std::filesystem::remove(frame(number), error))
      throw InputError("{}: a frame of an earlier cine cannot be removed: {}", frame(number).string(),
                       error.message());
}

}  // namespace xraycast
