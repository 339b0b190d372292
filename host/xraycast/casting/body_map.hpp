#pragma once

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/casting/map_precision.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace xraycast {

class KeyMaps;

/// The sums along the rays of a geometry: K x H x W floats, layer 0 innermost, row 0 superior, column 0
/// anterior. The sum over layers is that of the whole ray.
///
/// By an opacity a map holds optical depths. A spectrum map, by a spectrum, holds the masses of materials,
/// from which SpectrumModel gives the optical depth once they are summed along the view ray.
///
/// A map of a body that moves has `keys` too (key_maps.hpp), from which map_at() makes that of an instant;
/// its own values are those at phase 0 of all modes.
struct BodyMap {
  MapGeometry geometry;
  Attenuation attenuation = Opacity::paper();
  std::string source;                              ///< description of the scan
  std::vector<float> tau;                          ///< by an opacity
  MaterialDepths depths{};                         ///< by a spectrum
  std::string frame_of_reference_uid{};            ///< of the DICOM series that was cast; empty: unknown
  MapPrecision precision = MapPrecision::float32;  ///< of its file, and of its texture when it is drawn
  std::shared_ptr<const KeyMaps> keys{};  ///< of a body that moves; then the precision is that of bytes

  const Spectrum* spectrum() const { return std::get_if<Spectrum>(&attenuation); }  ///< null by an opacity
  /// The paper's by a spectrum.
  Opacity opacity() const { return spectrum() ? Opacity::paper() : std::get<Opacity>(attenuation); }
  std::size_t layer_size() const { return static_cast<std::size_t>(geometry.width) * geometry.height; }
  std::span<const float> layer(int k) const { return std::span(tau).subspan(k * layer_size(), layer_size()); }
};

/// Whether the map's precision can hold its values.
bool fits_precision(const BodyMap& map);

/// Writes a multi-part OpenEXR file: part k is layer k, with a channel `tau`, or with `water`, `bone` and
/// `iodine` (g/cm2). Every part carries the geometry, the opacity or spectrum, and the source in attributes
/// `xraycast:*`. A map with an outline has one part more, the last: `outline`, with a channel `radius_mm` for
/// every texel.
///
/// Channels are 32-bit floats, which read back as they were, or 16-bit floats by the map's precision. Bytes
/// are the whole numbers 0 to 255 in 16-bit floats, which OpenEXR packs to less than a byte;
/// `xraycast:byte_ranges` has the offset and the scale of each layer and channel. Such maps are files of
/// version 4, maps with an outline of version 3, spectrum maps of version 2, others of version 1, which every
/// version of the program reads.
///
/// A map of a body that moves is a file of version 5: the layers of the key maps one after the other, in
/// place of one map's, each as high as the rows that the key map has of its own. `xraycast:keys` has the
/// modes, their times and key phases (KeyPhases::to_json), `xraycast:key_rows` of each key map its base and
/// its first row and number of rows (KeyRows), and `xraycast:motion` the motion's file, relative to the map
/// where it lies near it.
///
/// Throws InputError when `path` cannot be written, or when values do not
/// fit the precision, and Error when the disk is full.
void write_body_map(const BodyMap& map, const std::filesystem::path& path);

/// Throws InputError unless the name ends in .exr. Before long work.
void check_map_name(const std::filesystem::path& path);

/// Reads what write_body_map wrote. Throws InputError, naming the file and the attribute.
BodyMap read_body_map(const std::filesystem::path& path);

/// The file of the motion that a map of a moving body names, without reading the map; empty for one that
/// stands still. Throws InputError as read_body_map.
std::filesystem::path motion_named_by(const std::filesystem::path& map);

/// How tau becomes grey in a preview.
enum class PreviewWindow {
  automatic,  ///< windowed_transmission of each layer
  paper,      ///< exp(-tau), unscaled
};

/// 8-bit greys of the layers, stacked from the innermost down: W x (K H). A spectrum is applied to each layer
/// separately, as if there were no other.
std::vector<std::uint8_t> preview_of(const BodyMap& map, PreviewWindow window);

}  // namespace xraycast
