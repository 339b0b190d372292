#pragma once

#include "xraycast/acquisition/compare_request.hpp"
#include "xraycast/base/picture_file.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace xraycast {

/// `8 layers`, or `36 pictures` of a rectangle.
std::string contents_of(const BodyMap& map);

/// 8-bit greys, row 0 on top.
struct GreyPlate {
  int width, height;
  std::vector<std::uint8_t> greys;
};

/// A frame, the DRR in the same grey window, and their difference side by side, each with its caption, below
/// the map's name and how similar they are. The difference is that of the greys, amplified four times about
/// middle grey: bright where the frame is too bright.
GreyPlate comparison_picture(const CompareRequest& request, const ComparedFrame& frame);

/// A measure over the C-arm angle, a curve for each map: `psnr`, `ssim`, or the error `rmse`. Throws
/// InputError for another measure.
RgbPicture comparison_plot(const std::string& scan, const std::string& measure, const CompareRequest& request,
                           const std::vector<MapComparison>& comparisons);

}  // namespace xraycast
