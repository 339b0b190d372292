#include "xraycast/reports/contact_sheet.hpp"

#include "xraycast/scene/canvas.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace xraycast {
namespace {

constexpr int kColumnWidth = 400, kMostHeight = 520, kMargin = 12, kCaptionHeight = 26, kFont = 17;

double aspect_of(const RgbPicture& picture) { return double(picture.width) / picture.height; }

/// Pictures `first` to `end` side by side, all of one height.
struct Row {
  std::size_t first, end;
  int height;
};

/// Rows as long as each other, or longer by one picture, each as high as the sheet's width allows.
std::vector<Row> rows_of(const std::vector<RgbPicture>& pictures, int columns) {
  const std::size_t rows = (pictures.size() + columns - 1) / columns;
  std::vector<Row> all;
  for (std::size_t r = 0, first = 0; r < rows; ++r) {
    const std::size_t count = pictures.size() / rows + (r < pictures.size() % rows ? 1 : 0);
    double aspects = 0;
    for (std::size_t i = first; i < first + count; ++i) aspects += aspect_of(pictures[i]);
    const double room = columns * kColumnWidth + (columns - double(count)) * kMargin;
    all.push_back({first, first + count, std::min(kMostHeight, static_cast<int>(room / aspects))});
    first += count;
  }
  return all;
}

}  // namespace

RgbPicture contact_sheet(const std::vector<CaptionedPicture>& captioned, int columns) {
  std::vector<RgbPicture> pictures;
  for (const CaptionedPicture& picture : captioned) pictures.push_back(read_picture(picture.file));
  const std::vector<Row> rows = rows_of(pictures, columns);
  const int width = columns * (kColumnWidth + kMargin) + kMargin;
  const int height = std::accumulate(rows.begin(), rows.end(), kMargin, [](int sum, const Row& row) {
    return sum + row.height + kCaptionHeight + kMargin;
  });
  Canvas sheet(width, height, {0.10, 0.11, 0.13});
  int y = kMargin;
  for (const Row& row : rows) {
    const auto width_of = [&](std::size_t i) { return std::floor(row.height * aspect_of(pictures[i])); };
    const double count = double(row.end - row.first);
    double left = width - kMargin * (count + 1);  // is spread around the pictures
    for (std::size_t i = row.first; i < row.end; ++i) left -= width_of(i);
    double x = kMargin;
    for (std::size_t i = row.first; i < row.end; ++i) {
      const RgbPicture& picture = pictures[i];
      const double room = width_of(i) + left / count;
      sheet.picture(picture.rgb, picture.width, picture.height,
                    {x + std::floor(0.5 * (room - width_of(i))), double(y), width_of(i), double(row.height)});
      const std::string& caption = captioned[i].caption;
      const double words = sheet.text_width(caption, kFont),
                   share = std::min(1.0, room / std::max(1.0, words));
      sheet.text({x + 0.5 * (room - share * words), double(y + row.height + kFont + 2)}, caption,
                 share * kFont, {0.9, 0.9, 0.9});
      x += room + kMargin;
    }
    y += row.height + kCaptionHeight + kMargin;
  }
  return {sheet.width(), sheet.height(), sheet.rgb()};
}

}  // namespace xraycast
