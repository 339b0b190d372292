#include "xraycast/motion/motion_writer.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/image_file/vector_image.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <utility>

namespace xraycast {
namespace {

FieldGrid field_grid_of(const VolumeGeometry& geometry) {
  const glm::dvec3& step_mm = geometry.spacing_mm;
  return {geometry.size, geometry.origin_mm, {step_mm.x, 0, 0, 0, step_mm.y, 0, 0, 0, step_mm.z}};
}

using OrderedJson = nlohmann::ordered_json;

/// The files of a motion, which appear together.
class MotionFiles {
 public:
  MotionFiles(const std::filesystem::path& folder, std::int64_t keys, Progress& progress)
      : folder_(folder), progress_(progress) {
    progress.begin("writing the motion", keys, "fields");
  }

  /// A key's entry; null: a phase without a field.
  OrderedJson key(const std::string& mode, double phase, const VectorImage* field) {
    progress_.advance();
    if (!field) return {{"phase", phase}};
    const std::string file = fmt::format("{}_{}.nrrd", mode, phase);
    write_vector_image(*field, folder_ / file);
    return {{"phase", phase}, {"field", file}};
  }

  void add(const std::string& name, double period_s, const std::vector<std::pair<double, double>>& waveform,
           const OrderedJson& phases) {
    OrderedJson one{{"name", name}};
    if (waveform.empty())
      one["period_s"] = period_s;
    else
      one["waveform"] = waveform;
    one["phases"] = phases;
    modes_.push_back(one);
  }

  void finish() {
    write_whole_file(folder_ / "motion.json", OrderedJson{{"version", 1}, {"modes", modes_}}.dump(1) + "\n");
    outputs_.commit();
  }

 private:
  OutputSet outputs_;
  std::filesystem::path folder_;
  Progress& progress_;
  OrderedJson modes_ = OrderedJson::array();
};

}  // namespace

void write_motion(const std::vector<ScaledMode>& modes, const std::filesystem::path& folder,
                  Progress& progress) {
  std::int64_t keys = 0;
  for (const ScaledMode& mode : modes) keys += std::ssize(mode.keys);
  MotionFiles files(folder, keys, progress);
  for (const ScaledMode& mode : modes) {
    OrderedJson phases = OrderedJson::array();
    for (const auto& [phase, share] : mode.keys) {
      VectorImage field{field_grid_of(mode.nodes), share == 0 ? std::vector<glm::vec3>{} : mode.field_mm};
      for (glm::vec3& d : field.vectors) d *= static_cast<float>(share);
      phases.push_back(files.key(mode.name, phase, share == 0 ? nullptr : &field));
    }
    files.add(mode.name, mode.period_s, mode.waveform, phases);
  }
  files.finish();
}

void write_motion(const FieldMode& mode, const std::filesystem::path& folder, Progress& progress) {
  MotionFiles files(folder, std::ssize(mode.keys), progress);
  OrderedJson phases = OrderedJson::array();
  for (const auto& [phase, field] : mode.keys) phases.push_back(files.key(mode.name, phase, field));
  files.add(mode.name, mode.period_s, mode.waveform, phases);
  files.finish();
}

}  // namespace xraycast
