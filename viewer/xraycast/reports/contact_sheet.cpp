#include "xraycast/reports/contact_sheet.hpp"

#include "xraycast/scene/canvas.hpp"

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
    const RgbPicture fitted = read_fitted(pictures[i].file, kCellWidth, kCellHeight);
    const int left = x + (kCellWidth - fitted.width) / 2, top = y + (kCellHeight - fitted.height) / 2;
    sheet.picture(fitted.rgb, fitted.width, fitted.height,
                  {double(left), double(top), double(fitted.width), double(fitted.height)});
    sheet.text({double(x), double(y + kCellHeight + kFont + 2)}, pictures[i].caption, kFont, {0.9, 0.9, 0.9});
  }
  return {sheet.width(), sheet.height(), sheet.rgb()};
}

}  // namespace xraycast
