#include "options/command.hpp"
#include "options/map_output.hpp"
#include "options/motion_options.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <memory>

namespace xraycast::cli {
namespace {

struct InfoArguments {
  std::string input;
  ScanOptions scan;
};

/// What the stored size does not count; empty where that is nothing.
std::string left_out_of(const ScanInfo& info) {
  const ScanInfo::LeftOut& left_out = info.left_out;
  if (left_out.slices() == 0) return {};
  std::string text = fmt::format("; left out of {}: ", pluralize(info.size.z + left_out.slices(), "slice"));
  if (left_out.damaged > 0) text += fmt::format("{} damaged", left_out.damaged);
  if (left_out.same_place > 0)
    text +=
        fmt::format("{}{} at the position of another", left_out.damaged > 0 ? ", " : "", left_out.same_place);
  return text;
}

std::string text_of(const ScanInfo& info, const VolumeGeometry& geometry, const SliceSource::HuRange& hu) {
  std::string text;
  const auto row = [&](const char* name, const std::string& value) {
    text += fmt::format("{:<12}{}\n", name, value);
  };
  row("format", info.format + (info.modality.empty() ? "" : ", " + info.modality));
  if (!info.series.empty()) row("series", info.series);
  row("stored", fmt::format("{} x {} x {}, {:.4g} x {:.4g} x {:.4g} mm, axes towards {}{}", info.size.x,
                            info.size.y, info.size.z, info.spacing_mm.x, info.spacing_mm.y, info.spacing_mm.z,
                            info.orientation, left_out_of(info)));
  if (info.tilt_deg != 0) row("tilt", fmt::format("{:.2f} deg", info.tilt_deg));
  for (const auto& [after, mm] : info.gaps) row("gap", fmt::format("{:.2f} mm after slice {}", mm, after));
  row("HU", fmt::format("{:g} to {:g}", hu.lowest, hu.highest));
  row("loaded",
      fmt::format(
          "{} x {} x {}, {:.4g} x {:.4g} x {:.4g} mm, from ({:.1f}, {:.1f}, {:.1f}) mm, axes towards LPS",
          geometry.size.x, geometry.size.y, geometry.size.z, geometry.spacing_mm.x, geometry.spacing_mm.y,
          geometry.spacing_mm.z, geometry.origin_mm.x, geometry.origin_mm.y, geometry.origin_mm.z));
  for (const std::string& note : info.notes) row("note", note);
  for (const std::string& warning : info.warnings) row("warning", warning);
  return text;
}

Json json_of(const std::string& input, const ScanInfo& info, const VolumeGeometry& geometry,
             const SliceSource::HuRange& hu) {
  Json gaps = Json::array();
  for (const auto& [after, mm] : info.gaps) gaps.push_back({{"after_slice", after}, {"mm", mm}});
  Json all_series = Json::array();
  for (const ScanInfo::Series& series : info.all_series)
    all_series.push_back({{"number", series.number},
                          {"description", series.description},
                          {"uid", series.uid},
                          {"modality", series.modality},
                          {"study_date", series.study_date},
                          {"body_part", series.body_part},
                          {"slices", series.slices},
                          {"orientation", series.orientation},
                          {"thickness_mm", series.thickness_mm},
                          {"chosen", series.chosen}});
  return {{"input", input},
          {"format", info.format},
          {"modality", info.modality},
          {"series", info.series},
          {"other_series", info.other_series},
          {"all_series", all_series},
          {"studies", info.studies},
          {"patients", info.patients},
          {"size", {info.size.x, info.size.y, info.size.z}},
          {"left_out", {{"damaged", info.left_out.damaged}, {"same_place", info.left_out.same_place}}},
          {"spacing_mm", {info.spacing_mm.x, info.spacing_mm.y, info.spacing_mm.z}},
          {"orientation", info.orientation},
          {"tilt_deg", info.tilt_deg},
          {"gaps", gaps},
          {"hu_range", {hu.lowest, hu.highest}},
          {"volume", to_json(geometry)},
          {"notes", info.notes},
          {"warnings", info.warnings}};
}

/// Describes a body map.
void tell_of_map(const std::string& path, const Invocation& invocation) {
  const BodyMap map = read_body_map(path);
  const MapGeometry& geometry = map.geometry;
  const std::string attenuation = std::visit([](const auto& one) { return one.name(); }, map.attenuation);
  Json json{{"input", path}, {"source", map.source}, {"opacity", attenuation}, {"map", to_json(map)}};
  std::string text;
  const auto row = [&](const char* name, const std::string& value) {
    text += fmt::format("{:<12}{}\n", name, value);
  };
  row("format", fmt::format("body map, {}", to_string(geometry.ray_layout)));
  row("source", map.source);
  row("texels", fmt::format("{} of {} x {}, {}", pluralize(geometry.layers(), "layer"),
                            pluralize(geometry.width, "column"), pluralize(geometry.height, "row"),
                            to_string(map.precision)));
  row("shells", fmt::format("outline {}, radius {:.1f} mm about ({:.1f}, {:.1f}) mm",
                            geometry.has_outline() ? "body" : "circle", geometry.radius_mm(),
                            geometry.centre_mm[0].x, geometry.centre_mm[0].y));
  row("opacity", attenuation);
  if (map.keys) {
    const KeyPhases& phases = map.keys->phases();
    for (std::size_t m = 0; m < phases.phases().size(); ++m) {
      const MotionMode& mode = phases.rhythm().modes()[m];
      row("mode", fmt::format("{}, {}, key phases {:.3g}", mode.name,
                              mode.waveform.empty()
                                  ? fmt::format("{:g} s", mode.period_s)
                                  : fmt::format("a waveform of {:g} s",
                                                mode.waveform.back().time_s - mode.waveform.front().time_s),
                              fmt::join(phases.phases()[m], ", ")));
    }
    row("keys", fmt::format("{}, {:.1f} MB", pluralize(phases.count(), "map"),
                            static_cast<double>(map.keys->size_B()) / 1e6));
    row("motion", map.keys->motion.empty() ? "not named" : map.keys->motion.string());
    json["keys"] = {{"maps", phases.count()},
                    {"bytes", map.keys->size_B()},
                    {"modes", to_json(phases)},
                    {"motion", map.keys->motion.string()}};
  }
  invocation.answer(json, text);
}

bool is_map(const std::string& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(path, error) && extension_of(path) == ".exr";
}

/// Reads all slices for their HU range, without keeping them.
SliceSource::HuRange read_range(SliceSource& source, Progress& progress) {
  const std::int64_t run = std::min<std::int64_t>(64, source.geometry().size.z);
  const auto voxels = static_cast<std::size_t>(run * source.geometry().slice_voxels());
  const auto slices = std::make_unique_for_overwrite<std::int16_t[]>(voxels);
  progress.begin("reading", source.geometry().size.z, "slices");
  while (source.read({slices.get(), voxels}, progress) > 0) {
  }
  return source.hu_range();
}

}  // namespace

void add_info(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<InfoArguments>();
  CLI::App* command = add_command(
      app, invocation, "info",
      "Describe a scan: series, size, spacing, orientation, tilt, gaps, HU range; or a body map",
      "  xraycast info scans/chest/\n"
      "  xraycast info head.nii.gz --json\n"
      "  xraycast info moving.exr",
      [options, &invocation] {
        if (is_map(options->input)) return tell_of_map(options->input, invocation);
        Scan scan = open_scan(options->input, options->scan, invocation.progress);
        const auto hu = read_range(*scan.source, invocation.progress);
        for (const std::string& warning : hu.warnings())
          scan.info.warnings.push_back(invocation.spelled(warning));
        const VolumeGeometry& geometry = scan.source->geometry();
        invocation.answer(json_of(options->input, scan.info, geometry, hu), text_of(scan.info, geometry, hu));
      });
  command
      ->add_option("INPUT", options->input,
                   "DICOM or GE Genesis folder or .zip, or a NIfTI, NRRD, MetaImage, VTK, multi-frame or "
                   "single-slice file; or a body map")
      ->required();
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
