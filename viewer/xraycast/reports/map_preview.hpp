#pragma once

#include "xraycast/base/picture_file.hpp"
#include "xraycast/casting/body_map.hpp"

#include <string>

namespace xraycast {

/// Where a layer's greys lie in its picture: they keep their size, below a line that names the layer and to
/// the right of a scale of its rows.
inline constexpr int kPreviewLeft = 64, kPreviewTitle = 22;

/// `auto` or `paper`. Throws InputError for another name.
PreviewWindow parse_preview_window(const std::string& name);

/// The layers of a map, from the innermost on from left to right and in rows, as a screen has room for them.
/// Each has its radii, and a scale of its rows: z in mm, or the polar angle of a sphere.
RgbPicture map_preview(const BodyMap& map, PreviewWindow window);

}  // namespace xraycast
