#include "pictures/contact_sheet.hpp"

#include "xraycast/base/png_file.hpp"
#include "xraycast/scene/canvas.hpp"

namespace xraycast::cli {
namespace {

constexpr int kCellWidth = 400, kCellHeight = 520, kMargin = 12, kCaptionHeight = 26, kFont = 17;

}  // namespace

void write_contact_sheet(const std::vector<Picture>& pictures, int columns,
                         const std::filesystem::path& path) {
  const int count = static_cast<int>(pictures.size()), rows = (count + columns - 1) / columns;
  const int pitch_x = kCellWidth + kMargin, pitch_y = kCellHeight + kCaptionHeight + kMargin;
  Canvas sheet(columns * pitch_x + kMargin, rows * pitch_y + kMargin, {0.10, 0.11, 0.13});
  for (int i = 0; i < count; ++i) {
    const int column = i % columns, row = i / columns;
    const double x = kMargin + column * pitch_x, y = kMargin + row * pitch_y;
    sheet.png(pictures[i].file, {x, y, kCellWidth, kCellHeight});
    sheet.text({x, y + kCellHeight + kFont + 2}, pictures[i].caption, kFont, {0.9, 0.9, 0.9});
  }
  write_png(sheet.rgb(), sheet.width(), sheet.height(), 3, path);
}

}  // namespace xraycast::cli
