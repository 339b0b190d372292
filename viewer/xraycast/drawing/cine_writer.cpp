#include "xraycast/drawing/cine_writer.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/image.hpp"
#include "xraycast/base/image_output.hpp"

#include <fmt/format.h>

#include <utility>

namespace xraycast {

bool is_animation(const std::filesystem::path& path) { return extension_of(path) == ".gif"; }

CineWriter::CineWriter(std::filesystem::path output, int width, int height)
    : output_(std::move(output)), width_(width), height_(height) {}

void CineWriter::add(std::vector<std::uint8_t> rgb) {
  if (is_animation(output_))
    frames_.push_back(std::move(rgb));
  else
    write_png(rgb, width_, height_, 3, frame(count_));
  ++count_;
}

std::filesystem::path CineWriter::frame(int number) const {
  return output_ / fmt::format("frame-{:03}.png", number);
}

void CineWriter::finish() const {
  if (!is_animation(output_)) {
    std::error_code error;
    for (int number = count_; std::filesystem::is_regular_file(frame(number), error); ++number)
      if (!std::filesystem::remove(frame(number), error))
        throw InputError("{}: a frame of an earlier cine cannot be removed: {}", frame(number).string(),
                         error.message());
    return;
  }
  std::vector<ImagePart> parts;
  for (const auto& frame : frames_) {
    parts.push_back({OIIO::ImageSpec(width_, height_, 3, OIIO::TypeDesc::UINT8), frame.data()});
    parts.back().spec.attribute("oiio:Movie", 1);
    parts.back().spec.attribute("FramesPerSecond", 20.0f);
  }
  write_image_file(parts, "gif", output_);
}

}  // namespace xraycast
