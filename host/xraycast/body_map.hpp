#pragma once

#include "xraycast/map_geometry.hpp"
#include "xraycast/opacity.hpp"

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// Optical depth collected along the rays of a geometry: K x H x W floats, layer 0 innermost, row 0 superior,
/// column 0 anterior. The sum over layers is the depth of the whole ray.
struct BodyMap {
  MapGeometry geometry;
  Opacity opacity = Opacity::paper();
  std::string source;  ///< what was cast, in words
  std::vector<float> tau;

  std::size_t layer_size() const { return static_cast<std::size_t>(geometry.width) * geometry.height; }
  std::span<const float> layer(int k) const { return std::span(tau).subspan(k * layer_size(), layer_size()); }
};

/// Writes a multi-part OpenEXR file: part k is layer k, one 32-bit float channel `tau`, and every part
/// carries the geometry, opacity and source in attributes `xraycast:*`. Lossless: reading back gives the same
/// floats. Throws InputError when `path` cannot be written, Error when the disk is full.
void write_body_map(const BodyMap& map, const std::filesystem::path& path);

/// Reads what write_body_map wrote. Throws InputError, naming the file and the attribute.
BodyMap read_body_map(const std::filesystem::path& path);

/// How tau becomes grey in a preview.
enum class PreviewWindow {
  automatic,  ///< windowed_transmission of each layer
  paper,      ///< exp(-tau), unscaled
};

/// 8-bit RGB PNG of the layers, stacked from the innermost down; W x (K H) pixels. Errors as for
/// write_body_map.
void write_preview(const BodyMap& map, PreviewWindow window, const std::filesystem::path& path);

}  // namespace xraycast
