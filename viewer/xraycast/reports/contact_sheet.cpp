#include "xraycast/reports/contact_sheet.hpp"

#include "xraycast/scene/canvas.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr int kCellWidth = 400, kCellHeight = 520, kMargin = 12, kCaptionHeight = 26, kFont = 17;

}  // namespace

RgbPicture contact_sheet(const std::vector<CaptionedPicture>& pictures, int columns) {
  const int count = static_cast<int>(pictures.size()), rows = (count + columns - 1) / columns;
  const int pitch_x = kCellWidth + kMargin, pitch_y = kCellHeight + kCaptionHeight + kMargin;
  Canvas sheet(columns * pitch_x + kMargin, rows * pitch_y + kMargin, {0.10, 0.11, 0.13});
  for (int i = 0; i < count; ++i) {
    const int column = i % columns, row = i / columns;
    const int x = kMargin + column * pitch_x, y = kMargin + row * pitch_y;
    const RgbPicture picture = read_picture(pictures[i].file);
    const double scale = std::min(double(kCellWidth) / picture.width, double(kCellHeight) / picture.height);
    const double width = std::round(scale * picture.width), height = std::round(scale * picture.height);
    sheet.picture(picture.rgb, picture.width, picture.height,
                  {x + std::floor((kCellWidth - width) / 2), y + std::floor((kCellHeight - height) / 2),
                   width, height});
    sheet.text({double(x), double(y + kCellHeight + kFont + 2)}, pictures[i].caption, kFont, {0.9, 0.9, 0.9});
  }
  return {sheet.width(), sheet.height(), sheet.rgb()};
}

}  // namespace xraycast
