#include "xraycast/series/dicom_scan.hpp"

#include "xraycast/base/dicom_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/series/dicom_pixels.hpp"
#include "xraycast/series/dicom_series.hpp"
#include "xraycast/series/dicom_slice.hpp"
#include "xraycast/volume/slice_stack.hpp"

#include <glm/geometric.hpp>

#include <algorithm>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

class DicomStack final : public SliceStack {
 public:
  explicit DicomStack(std::vector<DicomSlice> slices) : slices_(std::move(slices)) {
    columns = slices_.front().columns;
    rows = slices_.front().rows;
    thickness_mm = slices_.front().thickness_mm;
    for (const DicomSlice& slice : slices_) planes.push_back(slice.plane);
  }

 private:
  void prepare() override { decoder_.prepare(slices_); }
  SliceSource::HuRange decode_slice(std::int64_t index, std::span<std::int16_t> hu) const override {
    return decoder_.decode(slices_[static_cast<std::size_t>(index)], hu);
  }

  std::vector<DicomSlice> slices_;
  DicomPixelDecoder decoder_;
};

// ---- a series' slices ------------------------------------------------------------------------------

/// Slices that GDCM must decode are decoded once, to find those that it cannot.
std::vector<DicomSlice> decodable(std::vector<DicomSlice> slices, ScanInfo& info, Progress& progress) {
  std::vector<std::string> faults(slices.size());
  parallel_for(std::ssize(slices), [&](std::int64_t i) {
    progress.check();
    const DicomSlice& slice = slices[static_cast<std::size_t>(i)];
    if (slice.pixels.is_plain()) return;
    std::vector<std::int16_t> hu(static_cast<std::size_t>(slice.columns * slice.rows));
    try {
      DicomPixelDecoder().decode(slice, hu);
    } catch (const DamagedSlice& error) {
      faults[static_cast<std::size_t>(i)] = error.what();
    }
  });
  std::vector<DicomSlice> good;
  for (std::size_t i = 0; i < slices.size(); ++i)
    if (faults[i].empty())
      good.push_back(std::move(slices[i]));
    else
      info.leave_out(faults[i]);
  return good;
}

/// A file, or those of its frames that cannot be used.
void leave_out(const DicomFileSummary& file, ScanInfo& info) {
  const std::string frames = file.slices.empty() ? "" : pluralize(file.faulty_slices, "frame") + " of ";
  info.leave_out(frames + file.fault, file.faulty_slices);
}

std::vector<DicomSlice> usable_slices(const DicomSeries& series, const fs::path& path, bool skip_damaged,
                                      ScanInfo& info, Progress& progress) {
  std::vector<DicomSlice> slices;
  for (const DicomFileSummary& file : series.files) {
    if (!file.fault.empty() && !file.is_damaged) throw InputError("{}", file.fault);
    if (!file.fault.empty() && !skip_damaged) throw DamagedSlice("{}", file.fault);
    if (!file.fault.empty()) leave_out(file, info);
    if (!file.note.empty()) info.warnings.push_back(file.note);
    slices.insert(slices.end(), file.slices.begin(), file.slices.end());
  }
  if (skip_damaged) slices = decodable(std::move(slices), info, progress);
  if (slices.empty())
    throw InputError("{}: all slices of the series are damaged; copy it again", path.string());
  return slices;
}

void require_equal_slices(const std::vector<DicomSlice>& series) {
  const DicomSlice& first = series.front();
  for (const DicomSlice& slice : series) {
    if (slice.columns != first.columns || slice.rows != first.rows)
      throw InputError(
          "{}: {} x {} pixels, but {} of the same series has {} x {} (Rows, Columns); remove one of them",
          slice.name(), slice.columns, slice.rows, first.name(), first.columns, first.rows);
    const auto turned = [](const glm::dvec3& a, const glm::dvec3& b) {
      return glm::distance(glm::normalize(a), glm::normalize(b)) > 1e-3;
    };
    if (turned(slice.plane.i_step_mm, first.plane.i_step_mm) ||
        turned(slice.plane.j_step_mm, first.plane.j_step_mm))
      throw InputError(
          "{}: ImageOrientationPatient (0020,0037) differs from that of {} in the same series; remove the "
          "localizer or the slices of the other orientation",
          slice.name(), first.name());
  }
}

void sort_by_position(std::vector<DicomSlice>& series, ScanInfo& info) {
  const glm::dvec3 normal = upward(glm::cross(glm::normalize(series.front().plane.i_step_mm),
                                              glm::normalize(series.front().plane.j_step_mm)));
  const auto height_mm = [&](const DicomSlice& slice) { return glm::dot(slice.plane.origin_mm, normal); };
  std::ranges::stable_sort(series, {}, height_mm);

  // Positions are printed to a thousandth of a millimetre or finer.
  const auto same = [&](const DicomSlice& a, const DicomSlice& b) {
    return height_mm(b) - height_mm(a) < 1e-3;
  };
  const std::size_t before = series.size();
  series.erase(std::unique(series.begin(), series.end(), same), series.end());
  info.left_out.same_place = static_cast<std::int64_t>(before - series.size());
  if (series.size() < before)
    info.warnings.push_back(
        fmt::format("{} left out, at the same position as another slice; the series may "
                    "hold several phases or reconstructions",
                    pluralize(before - series.size(), "slice")));
}

// ---- where they come from ----------------------------------------------------------------------------

std::string uid_or_nothing(const std::string& text) { return is_dicom_uid(text) ? text : ""; }

/// A UID that all slices have to share.
std::string common_uid(const std::vector<DicomSlice>& slices, std::string DicomStudy::*uid) {
  const std::string& first = (*slices.front().study).*uid;
  const bool is_shared =
      std::ranges::all_of(slices, [&](const DicomSlice& slice) { return (*slice.study).*uid == first; });
  return is_shared ? uid_or_nothing(first) : "";
}

DicomOrigin origin_of(const std::vector<DicomSlice>& slices, const std::string& series_uid) {
  DicomOrigin origin;
  origin.study = *slices.front().study;
  origin.study.uid = common_uid(slices, &DicomStudy::uid);
  origin.study.frame_of_reference_uid = common_uid(slices, &DicomStudy::frame_of_reference_uid);
  origin.series_uid = uid_or_nothing(series_uid);
  const SlicePlane& plane = slices.front().plane;
  const double i_mm = glm::length(plane.i_step_mm), j_mm = glm::length(plane.j_step_mm);
  const glm::dvec3 row = plane.i_step_mm / i_mm, column = plane.j_step_mm / j_mm;
  origin.directions = {row.x, row.y, row.z, column.x, column.y, column.z};
  origin.pixel_spacing_mm = {j_mm, i_mm};
  for (const DicomSlice& slice : slices) {
    const glm::dvec3& at_mm = slice.plane.origin_mm;
    origin.slices.push_back({uid_or_nothing(slice.sop_class_uid),
                             uid_or_nothing(slice.sop_instance_uid),
                             slice.frame,
                             {at_mm.x, at_mm.y, at_mm.z}});
  }
  return origin;
}

}  // namespace

Scan open_dicom(const fs::path& path, const std::vector<fs::path>& files, const ScanOptions& options,
                Progress& progress) {
  progress.begin("opening", std::ssize(files), "files");
  std::vector<DicomFileSummary> summaries(files.size());
  parallel_for(std::ssize(files), [&](std::int64_t i) {
    summaries[static_cast<std::size_t>(i)] = summarise_dicom(files[static_cast<std::size_t>(i)]);
    progress.advance();
  });

  ScanInfo info;
  info.format = "DICOM";
  const DicomSeries series = choose_series(std::move(summaries), options.series, path, info);
  info.modality = series.files.front().modality;
  if (info.modality != "CT")
    info.warnings.push_back(fmt::format("modality {} is not CT, so its values are not Hounsfield units",
                                        info.modality.empty() ? "unknown" : info.modality));
  std::vector<DicomSlice> slices = usable_slices(series, path, options.skip_damaged, info, progress);
  require_equal_slices(slices);
  sort_by_position(slices, info);

  info.dicom = origin_of(slices, series.files.front().series_uid);

  const SlicePlane& plane = slices.front().plane;
  info.orientation = {side(plane.i_step_mm), side(plane.j_step_mm),
                      side(upward(glm::cross(plane.i_step_mm, plane.j_step_mm)))};
  const DicomSlice& first = slices.front();
  if (first.pixels.bits_stored <= 8 && first.slope == 1) info.notes.emplace_back(kEightBitNote);
  for (DicomSlice& slice : slices) slice.intercept += options.offset_hu;
  auto stack = std::make_unique<DicomStack>(std::move(slices));
  stack->name = path.string();
  return deliver(std::move(stack), std::move(info), options);
}

bool is_dicom_directory(const fs::path& file) { return summarise_dicom(file).is_directory; }

}  // namespace xraycast
