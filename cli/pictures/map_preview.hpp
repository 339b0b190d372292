#pragma once

#include "xraycast/casting/body_map.hpp"

#include <filesystem>

namespace xraycast::cli {

/// Where a layer's greys lie in its picture: they keep their size, below a line that names the layer and to
/// the right of a scale of its rows.
inline constexpr int kPreviewLeft = 64, kPreviewTitle = 22;

/// Writes the layers of a map as one PNG, from the innermost down, each with its radii and with a scale of
/// its rows: z in mm, or the polar angle of a sphere. Errors as for write_body_map.
void write_map_preview(const BodyMap& map, PreviewWindow window, const std::filesystem::path& path);

}  // namespace xraycast::cli
