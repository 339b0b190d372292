#include "pictures/contact_sheet.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/scene/canvas.hpp"

#include <sstream>

namespace xraycast::cli {
namespace {

constexpr int kCellWidth = 400, kCellHeight = 520, kMargin = 12, kCaptionHeight = 26, kFont = 17;

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
  Canvas sheet(columns * pitch_x + kMargin, rows * pitch_y + kMargin, {0.10, 0.11, 0.13});
  for (int i = 0; i < count; ++i) {
    const int column = i % columns, row = i / columns;
    const int x = kMargin + column * pitch_x, y = kMargin + row * pitch_y;
    const RgbPicture fitted = read_fitted(pictures[i].file, kCellWidth, kCellHeight);
    sheet.picture(fitted.rgb, fitted.width, fitted.height,
                  {double(x + (kCellWidth - fitted.width) / 2), double(y + (kCellHeight - fitted.height) / 2),
                   double(fitted.width), double(fitted.height)});
    sheet.text({double(x), double(y + kCellHeight + kFont + 2)}, pictures[i].caption, kFont, {0.9, 0.9, 0.9});
  }
  write_picture(sheet.rgb(), sheet.width(), sheet.height(), 3, path);
}

void write_index_page(const std::string& title, const Picture& page, const std::vector<Picture>& pictures,
                      const std::vector<std::pair<std::string, std::string>>& facts,
                      const std::filesystem::path& path) {
  std::ostringstream out;
  out << "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>" << escaped(title)
      << "</title>\n"
      << "<style>body{background:#1a1c21;color:#e6e6e6;font:16px/1.5 sans-serif;margin:2em "
         "auto;max-width:1200px}"
         "figure{display:inline-block;vertical-align:top;margin:0 1em 1em "
         "0}img{max-width:560px;max-height:640px}"
         "a{color:#8cc8ff}iframe{width:100%;height:46em;border:0}td{padding:.1em 1.5em .1em 0}</style>\n<h1>"
      << escaped(title) << "</h1>\n";
  const std::string page_name = page.file.filename().string(), caption = escaped(page.caption);
  out << "<iframe src=\"" << page_name << "\" title=\"" << caption << "\"></iframe>\n<p><a href=\""
      << page_name << "\">" << caption << "</a></p>\n";
  const auto beside_page = [&](const std::filesystem::path& file) {
    return file.lexically_relative(path.parent_path()).string();
  };
  for (const Picture& picture : pictures) {
    const std::string file = beside_page(picture.file), words = escaped(picture.caption),
                      opened = picture.opened.empty() ? file : beside_page(picture.opened);
    out << "<figure><a href=\"" << opened << "\"><img src=\"" << file << "\" alt=\"" << words
        << "\"></a><figcaption>" << words << "</figcaption></figure>\n";
  }
  out << "<table>\n";
  for (const auto& [name, value] : facts)
    out << "<tr><td>" << escaped(name) << "</td><td>" << escaped(value) << "</td></tr>\n";
  out << "</table>\n<p>Not for clinical use.</p>\n</html>\n";
  write_whole_file(path, std::move(out).str());
}

}  // namespace xraycast::cli
