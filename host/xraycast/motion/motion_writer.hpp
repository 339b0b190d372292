#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/image_file/vector_image.hpp"
#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace xraycast {

/// A mode of motion whose displacements are one field, scaled.
struct ScaledMode {
  std::string name;
  double period_s = 0;
  std::vector<std::pair<double, double>> waveform{};  ///< seconds and phase over a period; else time / period
  std::vector<std::pair<double, double>> keys{};      ///< phases from 0 to 1, and the field's shares there
  VolumeGeometry nodes{};
  std::vector<glm::vec3> field_mm{};  ///< pull-backs at the nodes, x fastest
};

/// A mode of motion with a displacement field, or none, at each of some phases.
struct FieldMode {
  std::string name;
  double period_s = 0;
  std::vector<std::pair<double, double>> waveform{};          ///< as above
  std::vector<std::pair<double, const VectorImage*>> keys{};  ///< phases from 0 to 1; null: the scan itself
};

/// Writes modes, which are composed in their order, as `motion.json` of an existing folder, with a field for
/// each key whose share is not 0, such as `breath_1.nrrd`. A stage of `progress`. Throws InputError when they
/// cannot be written and Error when the disk is full.
void write_motion(const std::vector<ScaledMode>& modes, const std::filesystem::path& folder,
                  Progress& progress);

/// The same of one mode.
void write_motion(const FieldMode& mode, const std::filesystem::path& folder, Progress& progress);

}  // namespace xraycast
