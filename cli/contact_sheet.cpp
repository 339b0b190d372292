#include "contact_sheet.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/image.hpp"
#include "xraycast/base/whole_file.hpp"

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>

#include <algorithm>
#include <sstream>

namespace xraycast::cli {
namespace {

constexpr int kCellWidth = 400, kCellHeight = 520, kMargin = 12, kCaptionHeight = 26, kFontHeight = 17;

/// The picture as RGB, scaled to fit a cell and not enlarged beyond it.
OIIO::ImageBuf fitted_to_cell(const std::filesystem::path& file) {
  OIIO::ImageBuf image(file.string());
  if (!image.read(0, 0, true, OIIO::TypeDesc::UINT8)) throw Error("{}: {}", file.string(), image.geterror());
  if (image.nchannels() < 3) image = OIIO::ImageBufAlgo::channels(image, 3, {0, 0, 0});
  const auto& spec = image.spec();
  const double scale = std::min(double{kCellWidth} / spec.width, double{kCellHeight} / spec.height);
  const OIIO::ROI roi(0, std::max(1, static_cast<int>(spec.width * scale)), 0,
                      std::max(1, static_cast<int>(spec.height * scale)), 0, 1, 0, 3);
  return OIIO::ImageBufAlgo::resize(image, "", 0.0f, roi);
}

std::string escaped(const std::string& text) {
  std::string html;
  for (const char c : text)
    html += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : std::string(1, c);
  return html;
}

}  // namespace

void write_contact_sheet(const std::vector<Picture>& pictures, int columns,
                         const std::filesystem::path& path) {
  const int count = static_cast<int>(pictures.size()), rows = (count + columns - 1) / columns;
  const int pitch_x = kCellWidth + kMargin, pitch_y = kCellHeight + kCaptionHeight + kMargin;
  OIIO::ImageBuf sheet(
      OIIO::ImageSpec(columns * pitch_x + kMargin, rows * pitch_y + kMargin, 3, OIIO::TypeDesc::UINT8));
  OIIO::ImageBufAlgo::fill(sheet, {0.10f, 0.11f, 0.13f});
  for (int i = 0; i < count; ++i) {
    const OIIO::ImageBuf image = fitted_to_cell(pictures[i].file);
    const int x = kMargin + i % columns * pitch_x, y = kMargin + i / columns * pitch_y;
    OIIO::ImageBufAlgo::paste(sheet, x + (kCellWidth - image.spec().width) / 2,
                              y + (kCellHeight - image.spec().height) / 2, 0, 0, image);
    OIIO::ImageBufAlgo::render_text(sheet, x, y + kCellHeight + kFontHeight + 2, pictures[i].caption,
                                    kFontHeight, "DejaVuSans", {0.9f, 0.9f, 0.9f});
  }
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(sheet.spec().image_pixels()) * 3);
  if (!sheet.get_pixels(sheet.roi(), OIIO::TypeDesc::UINT8, pixels.data()))
    throw Error("{}: {}", path.string(), sheet.geterror());
  write_png(pixels, sheet.spec().width, sheet.spec().height, 3, path);
}

void write_index_page(const std::string& title, const std::vector<Picture>& pictures,
                      const std::vector<std::pair<std::string, std::string>>& facts,
                      const std::filesystem::path& path) {
  std::ostringstream out;
  out << "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>" << escaped(title)
      << "</title>\n"
      << "<style>body{background:#1a1c21;color:#e6e6e6;font:16px/1.5 sans-serif;margin:2em "
         "auto;max-width:1200px}"
         "figure{display:inline-block;vertical-align:top;margin:0 1em 1em "
         "0}img{max-width:560px;max-height:640px}"
         "td{padding:.1em 1.5em .1em 0}</style>\n<h1>"
      << escaped(title) << "</h1>\n";
  for (const Picture& picture : pictures)
    out << "<figure><a href=\"" << picture.file.filename().string() << "\"><img src=\""
        << picture.file.filename().string() << "\" alt=\"" << escaped(picture.caption)
        << "\"></a><figcaption>" << escaped(picture.caption) << "</figcaption></figure>\n";
  out << "<table>\n";
  for (const auto& [name, value] : facts)
    out << "<tr><td>" << escaped(name) << "</td><td>" << escaped(value) << "</td></tr>\n";
  out << "</table>\n<p>Not for clinical use.</p>\n</html>\n";
  write_whole_file(path, std::move(out).str());
}

}  // namespace xraycast::cli
