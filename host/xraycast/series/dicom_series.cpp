#include "xraycast/series/dicom_series.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/pluralize.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <limits>
#include <map>
#include <set>
#include <tuple>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

/// Of the first slice that can be read.
const DicomSlice* first_slice(const DicomSeries& series) {
  const auto readable =
      std::ranges::find_if(series.files, [](const auto& file) { return !file.slices.empty(); });
  return readable == series.files.end() ? nullptr : &readable->slices.front();
}

/// Also of those that cannot be used; frames count as slices.
std::int64_t slice_count(const DicomSeries& series) {
  std::int64_t count = 0;
  for (const DicomFileSummary& file : series.files) count += std::ssize(file.slices) + file.faulty_slices;
  return count;
}

std::string plane_of(const DicomSeries& series) {
  const DicomSlice* slice = first_slice(series);
  if (!slice) return "";
  switch (side(upward(glm::cross(slice->plane.i_step_mm, slice->plane.j_step_mm)))) {
    case 'S':
      return "axial";
    case 'P':
      return "coronal";
    default:
      return "sagittal";
  }
}

double thickness_mm(const DicomSeries& series) {
  const DicomSlice* slice = first_slice(series);
  return slice ? slice->thickness_mm : 0;
}

/// As in "7: chest, 3 slices, axial, 1.25 mm, CHEST, study of 2026-01-31".
std::string name_of(const DicomSeries& series) {
  const DicomFileSummary& file = series.files.front();
  std::string name = file.series_number.empty() ? "" : file.series_number + ": ";
  if (!file.series_description.empty()) name += file.series_description + ", ";
  name += pluralize(slice_count(series), series.is_ct ? "slice" : "image");
  if (const std::string plane = plane_of(series); !plane.empty()) name += ", " + plane;
  if (const double mm = thickness_mm(series); mm > 0) name += fmt::format(", {:.3g} mm", mm);
  if (!file.body_part.empty()) name += ", " + excerpt(file.body_part);
  if (!file.study_date.empty()) name += ", study of " + file.study_date;
  return name;
}

std::string describe(const DicomSeries& series) {
  const std::string& uid = series.files.front().series_uid;
  return fmt::format("{}, UID {}", name_of(series), uid.empty() ? "unknown" : excerpt(uid));
}

std::string list_of(const std::vector<DicomSeries>& all) {
  std::string list;
  for (const DicomSeries& series : all) list += (list.empty() ? "" : "; ") + describe(series);
  return list;
}

/// CT first, then most slices, axial, thinner; the remaining keys make the order deterministic.
bool is_better(const DicomSeries& a, const DicomSeries& b) {
  const auto rank = [](const DicomSeries& series) {
    const double mm = thickness_mm(series);
    return std::tuple(!series.is_ct, -slice_count(series), plane_of(series) != "axial",
                      mm > 0 ? mm : std::numeric_limits<double>::infinity(),
                      series.files.front().series_number, series.files.front().series_uid);
  };
  return rank(a) < rank(b);
}

/// "2 scouts, 1 screen shot", of the files that `counts` accepts.
template <typename Counts>
std::string count_kinds(const std::vector<DicomFileSummary>& files, Counts counts) {
  std::map<std::string, std::int64_t> kinds;
  for (const DicomFileSummary& file : files)
    if (counts(file)) ++kinds[file.noun];
  std::string text;
  for (const auto& [noun, count] : kinds) text += (text.empty() ? "" : ", ") + pluralize(count, noun);
  return text;
}

std::vector<DicomSeries> group_by_uid(const std::vector<DicomFileSummary>& files) {
  std::map<std::pair<std::string, bool>, DicomSeries> by_uid;
  for (const DicomFileSummary& file : files) {
    if (!file.is_image) continue;
    DicomSeries& series = by_uid[{file.series_uid, file.is_ct_slice}];
    series.is_ct = file.is_ct_slice;
    series.files.push_back(file);
  }
  std::vector<DicomSeries> all;
  for (auto& [uid, series] : by_uid) all.push_back(std::move(series));
  return all;
}

/// Files truncated before the UID of their series may belong to any series. They are removed from `files`,
/// unless there are no others.
std::vector<DicomFileSummary> take_strays(std::vector<DicomFileSummary>& files) {
  const auto belongs = [](const DicomFileSummary& file) {
    return !(file.is_ct_slice && file.is_cut_off && file.series_uid.empty());
  };
  const auto first_stray = std::stable_partition(files.begin(), files.end(), belongs);
  if (std::none_of(files.begin(), first_stray, [](const auto& file) { return file.is_image; })) return {};
  std::vector<DicomFileSummary> strays(first_stray, files.end());
  files.erase(first_stray, files.end());
  return strays;
}

/// Digits alone are a number, which lies within many UIDs by chance.
bool matches(const DicomFileSummary& file, const std::string& wanted) {
  const bool is_part_of_uid = wanted.find('.') != std::string::npos;
  return (is_part_of_uid && file.series_uid.find(wanted) != std::string::npos) ||
         lower_case(file.series_description).find(lower_case(wanted)) != std::string::npos;
}

/// A complete series number takes precedence over the same digits within a description, and CT over other
/// modalities.
std::size_t index_of(const std::string& wanted, const std::vector<DicomSeries>& all, const fs::path& path) {
  for (const bool by_number : {true, false})
    for (const bool is_ct : {true, false}) {
      const auto fits = [&](const DicomSeries& series) {
        const DicomFileSummary& file = series.files.front();
        return series.is_ct == is_ct && (by_number ? file.series_number == wanted : matches(file, wanted));
      };
      const auto found = std::ranges::find_if(all, fits);
      if (found == all.end()) continue;
      if (std::ranges::count_if(all, fits) > 1)
        throw InputError("{}: several series match '{}'; give a UID of these: {}", path.string(), wanted,
                         list_of(all));
      return static_cast<std::size_t>(found - all.begin());
    }
  throw InputError("{}: no series matches '{}'; give one of these: {}", path.string(), wanted, list_of(all));
}

[[noreturn]] void refuse(const std::vector<DicomFileSummary>& files, const fs::path& path) {
  if (files.size() == 1 && !files.front().fault.empty()) throw InputError("{}", files.front().fault);
  const std::string kinds = count_kinds(files, [](const auto& file) { return !file.is_directory; });
  throw InputError("{}: the DICOM files hold no image slices{}; give the folder of a CT series",
                   path.string(), kinds.empty() ? "" : ": " + kinds);
}

/// Notes the files that are not slices of any series.
void note_passed_over(const std::vector<DicomFileSummary>& files, bool only_ct, ScanInfo& info) {
  const auto is_passed_over = [&](const DicomFileSummary& file) {
    return !file.is_directory && !(only_ct ? file.is_ct_slice : file.is_image);
  };
  const auto count = std::ranges::count_if(files, is_passed_over);
  if (count == 0) return;
  info.notes.push_back(fmt::format("skipped {} that {} {}slice{}: {}", pluralize(count, "file"),
                                   count == 1 ? "is not a" : "are not", only_ct ? "CT " : "",
                                   count == 1 ? "" : "s", count_kinds(files, is_passed_over)));
}

ScanInfo::Series summary_of(const DicomSeries& series, bool chosen) {
  const DicomFileSummary& file = series.files.front();
  return {.number = file.series_number,
          .description = file.series_description,
          .uid = file.series_uid,
          .modality = file.modality,
          .study_date = file.study_date,
          .body_part = file.body_part,
          .slices = slice_count(series),
          .orientation = plane_of(series),
          .thickness_mm = thickness_mm(series),
          .chosen = chosen};
}

/// At least one, though no file may name it.
std::int64_t count_studies(const std::vector<const DicomFileSummary*>& files) {
  std::set<std::string> different;
  for (const DicomFileSummary* file : files)
    if (!file->study_uid.empty()) different.insert(file->study_uid);
  return std::max<std::int64_t>(1, std::ssize(different));
}

/// At least one, by their IDs. A file without an ID is compared by the patient's name.
std::int64_t count_patients(const std::vector<const DicomFileSummary*>& files) {
  std::set<std::string> ids, named_with_id, named_without;
  for (const DicomFileSummary* file : files) {
    if (!file->patient_id.empty()) ids.insert(file->patient_id);
    (file->patient_id.empty() ? named_without : named_with_id).insert(file->patient_name);
  }
  named_with_id.insert("");
  const auto others =
      std::ranges::count_if(named_without, [&](const auto& name) { return !named_with_id.contains(name); });
  return std::max<std::int64_t>(1, std::ssize(ids) + others);
}

/// Of a choice that the user did not make.
std::string warning_of_choice(const DicomSeries& chosen, const ScanInfo& info) {
  const std::string of = info.studies * info.patients < 2
                             ? ""
                             : fmt::format(" of {} of {}", pluralize(info.studies, "study"),
                                           pluralize(info.patients, "patient"));
  return fmt::format(
      "{} series{} in the folder, the one with the most slices was chosen ({}); choose another series by its "
      "number, description or UID",
      info.other_series.size() + 1, of, name_of(chosen));
}

std::vector<const DicomFileSummary*> pointers_to(const std::vector<DicomFileSummary>& files) {
  std::vector<const DicomFileSummary*> pointers;
  for (const DicomFileSummary& file : files) pointers.push_back(&file);
  return pointers;
}

}  // namespace

DicomSeries choose_series(std::vector<DicomFileSummary> files, const std::string& wanted,
                          const fs::path& path, ScanInfo& info) {
  const std::vector<DicomFileSummary> strays = take_strays(files);
  std::vector<DicomSeries> all = group_by_uid(files);
  if (all.empty()) refuse(files, path);
  std::ranges::sort(all, is_better);
  const std::size_t chosen = wanted.empty() ? 0 : index_of(wanted, all, path);
  all[chosen].files.insert(all[chosen].files.end(), strays.begin(), strays.end());

  const bool only_ct = all[chosen].is_ct;
  std::vector<const DicomFileSummary*> to_choose_from;
  for (std::size_t i = 0; i < all.size(); ++i) {
    info.all_series.push_back(summary_of(all[i], i == chosen));
    if (only_ct && !all[i].is_ct) continue;
    for (const DicomFileSummary* file : pointers_to(all[i].files)) to_choose_from.push_back(file);
    if (i == chosen) continue;
    info.other_series.push_back(describe(all[i]));
    if (wanted.empty()) info.notes.push_back("other series " + name_of(all[i]));
  }
  info.studies = count_studies(to_choose_from);
  info.patients = count_patients(to_choose_from);
  if (wanted.empty() && !info.other_series.empty())
    info.warnings.push_back(warning_of_choice(all[chosen], info));
  if (const std::int64_t patients = count_patients(pointers_to(all[chosen].files)); patients > 1)
    info.warnings.push_back(
        fmt::format("the series has slices of {} patients; check that all belong to one scan", patients));
  note_passed_over(files, only_ct, info);

  info.series = describe(all[chosen]);
  return std::move(all[chosen]);
}

}  // namespace xraycast
