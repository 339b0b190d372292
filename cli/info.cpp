#include "options/command.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>

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
      app, invocation, "info", "Describe a scan: series, size, spacing, orientation, tilt, gaps, HU range",
      "  xraycast info scans/chest/\n"
      "  xraycast info head.nii.gz --json",
      [options, &invocation] {
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
                   "single-slice file")
      ->required();
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
