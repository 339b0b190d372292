#include "xraycast/given_vessels/labelled_mask.hpp"

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/given_vessels/structure_labels.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/segmentation/threshold.hpp"
#include "xraycast/series/seg_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <map>
#include <optional>
#include <set>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

/// Masks hold a few labels, scans of CT numbers hundreds of values.
void check_is_mask(const Volume& values, const fs::path& file) {
  constexpr std::size_t kMostLabels = 256;
  std::vector<bool> is_there(1 << 16);
  for (const std::int16_t value : values.hu()) is_there[static_cast<std::uint16_t>(value)] = true;
  if (static_cast<std::size_t>(std::ranges::count(is_there, true)) <= kMostLabels) return;
  const auto [least, most] = std::ranges::minmax(values.hu());
  throw InputError("{}: no mask but a scan, with values from {} to {}; find its vessels by `segment`",
                   file.string(), least, most);
}

std::vector<std::string> warnings_of(const Scan& scan, const fs::path& file) {
  std::vector<std::string> warnings;
  for (const std::string& warning : scan.info.warnings)
    warnings.push_back(fmt::format("{}: {}", file.string(), warning));
  return warnings;
}

/// The names, up to the first dot, of a folder's files that may be masks, at most twenty.
std::string masks_in(const fs::path& folder) {
  constexpr std::array<std::string_view, 6> kEndings{".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd"};
  std::set<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string file = entry.path().filename().string();
    if (entry.is_regular_file(error) &&
        std::ranges::any_of(kEndings, [&](std::string_view ending) { return file.ends_with(ending); }))
      names.insert(printable(file.substr(0, file.find('.'))));
  }
  constexpr std::size_t kMost = 20;
  while (names.size() > kMost) names.erase(std::prev(names.end()));
  return fmt::format("{}", fmt::join(names, ", "));
}

/// A mask's file, or the folder of its slices. A folder that has none, but masks, is told what it has.
Scan open_mask(const fs::path& path, const std::vector<std::string>& labels, Progress& progress) {
  try {
    return open_scan(path, {}, progress);
  } catch (const InputError&) {
    std::error_code error;
    const std::string masks = fs::is_directory(path, error) ? masks_in(path) : "";
    if (masks.empty()) throw;
    if (labels.empty())
      throw InputError("{}: a folder; give one of its masks, or by `labels` those that are vessels: {}",
                       path.string(), masks);
    throw InputError("{}: `labels` {}: the folder has no file of that name; it has {}", path.string(),
                     printable(labels.front()), masks);
  }
}

/// The values of a mask; adds notes on where it lies.
Volume read_values(const fs::path& file, Progress& progress, std::vector<std::string>& notes) {
  const Scan scan = open_mask(file, {}, progress);
  Volume values = collect(*scan.source, progress, file.string());
  check_is_mask(values, file);
  std::ranges::copy(warnings_of(scan, file), std::back_inserter(notes));
  return values;
}

/// The files of a folder whose names, up to the first dot, are the labels', in their order; nothing for a
/// folder that has none of them.
std::vector<fs::path> files_of(const fs::path& folder, const std::vector<std::string>& labels) {
  std::map<std::string, fs::path> file_of;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_regular_file(error)) continue;
    const auto [other, is_new] = file_of.emplace(name.substr(0, name.find('.')), entry.path());
    if (!is_new && std::ranges::find(labels, other->first) != labels.end())
      throw InputError("{}: `labels` {}: both {} and {} have this name; remove one", folder.string(),
                       printable(other->first), other->second.filename().string(), name);
  }
  std::vector<fs::path> files;
  for (const std::string& label : labels)
    if (const auto found = file_of.find(label); found != file_of.end()) files.push_back(found->second);
  if (!files.empty() && files.size() < labels.size())
    for (const std::string& label : labels)
      if (!file_of.contains(label))
        throw InputError("{}: `labels` {}: the folder has no file of that name", folder.string(),
                         printable(label));
  return files;
}

/// Adds a structure; where it overlaps others, these keep their voxels.
void add_structure(const Mask& structure, std::string name, LabelledMask& all) {
  all.names.push_back(std::move(name));
  const auto number = static_cast<std::uint8_t>(all.names.size());
  for (std::size_t i = 0; i < all.structures.size(); ++i)
    if (structure.voxels[i] != 0 && all.structures[i] == 0) all.structures[i] = number;
  unite(all.mask, structure);
}

LabelledMask empty_mask(const VolumeGeometry& grid) {
  Mask mask(grid);
  std::vector<std::uint8_t> structures(mask.voxels.size(), 0);
  return {std::move(mask), std::move(structures), {}};
}

LabelledMask united_files(const std::vector<fs::path>& files, Progress& progress) {
  std::optional<LabelledMask> all;
  for (const fs::path& file : files) {
    std::vector<std::string> notes;
    const Mask mask = between(read_values(file, progress, notes), 1, kMaxHu);
    if (!all) all = empty_mask(mask.geometry);
    check_mask_grid(mask.geometry, all->mask.geometry, file.string());
    const std::string name = file.filename().string();
    add_structure(mask, name_of_structure(name.substr(0, name.find('.'))), *all);
    all->notes.insert(all->notes.end(), notes.begin(), notes.end());
  }
  return *std::move(all);
}

/// The number that a label means.
int number_of(const std::string& label, const fs::path& file) {
  int number = 0;
  const auto [end, error] = std::from_chars(label.data(), label.data() + label.size(), number);
  if (error == std::errc() && end == label.data() + label.size() && number > 0) return number;
  if (const auto known = vessel_label(label)) return *known;
  throw InputError("{}: `labels` {}: must be a number above zero, or one of {}", file.string(),
                   printable(label), vessel_label_names());
}

/// The labels of a file as "52 (aorta), 63 (...)", at most twenty.
std::string present(const Volume& values) {
  std::set<std::int16_t> numbers;
  for (const std::int16_t value : values.hu())
    if (value > 0 && (numbers.empty() || *numbers.rbegin() != value)) numbers.insert(value);
  std::vector<std::string> words;
  for (const std::int16_t number : numbers) {
    const std::string_view name = vessel_name(number);
    words.push_back(name.empty() ? fmt::format("{}", number) : fmt::format("{} ({})", number, name));
    if (words.size() == 20) break;
  }
  return words.empty() ? "none" : fmt::format("{}", fmt::join(words, ", "));
}

LabelledMask labelled(const fs::path& file, const std::vector<std::string>& labels, Progress& progress) {
  const Scan scan = open_mask(file, labels, progress);
  if (std::ranges::any_of(scan.info.notes,
                          [](const std::string& note) { return note.starts_with("resampled"); }))
    throw InputError(
        "{}: `labels`: the file's voxels lie oblique to the patient's axes, so that labels would "
        "be mixed; give a file of one structure",
        file.string());
  const Volume values = collect(*scan.source, progress, file.string());
  LabelledMask all = empty_mask(values.geometry());
  all.notes = warnings_of(scan, file);
  for (const std::string& label : labels) {
    const int number = number_of(label, file);
    const Mask of_label = between(values, number, number);
    if (of_label.count() == 0)
      throw InputError("{}: `labels` {}: no voxel has this label; the file has {}", file.string(),
                       printable(label), present(values));
    add_structure(of_label, name_of_structure(vessel_name(number)), all);
  }
  return all;
}

LabelledMask of_seg(const fs::path& path, const std::vector<std::string>& labels) {
  SegContent content = read_seg(path, labels);
  LabelledMask all{Mask(content.geometry), std::move(content.segments), {}};
  std::ranges::transform(all.structures, all.mask.voxels.begin(),
                         [](std::uint8_t segment) { return static_cast<std::uint8_t>(segment != 0); });
  // The label of a file's only segment says no more than that it is vessels.
  const bool has_names = !labels.empty() || content.labels.size() > 1;
  for (const std::string& label : content.labels)
    all.names.push_back(has_names ? name_of_structure(label) : "");
  return all;
}

}  // namespace

LabelledMask read_labelled_mask(const fs::path& path, const std::vector<std::string>& labels,
                                Progress& progress) {
  if (is_seg_file(path)) return of_seg(path, labels);
  if (labels.empty()) {
    LabelledMask all{Mask(VolumeGeometry{}), {}, {}};
    all.mask = between(read_values(path, progress, all.notes), 1, kMaxHu);
    return all;
  }
  if (labels.size() > 255) throw InputError("`labels`: {} were given, but at most 255 can be", labels.size());
  if (fs::is_directory(path))
    if (const std::vector<fs::path> files = files_of(path, labels); !files.empty())
      return united_files(files, progress);
  return labelled(path, labels, progress);
}

}  // namespace xraycast
