#include "xraycast/scan/scan.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/image_file/image_file_scan.hpp"
#include "xraycast/image_file/image_file_stack.hpp"
#include "xraycast/scan/unpacked_zip.hpp"
#include "xraycast/series/dicom_header.hpp"
#include "xraycast/series/dicom_scan.hpp"
#include "xraycast/series/genesis_scan.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <span>
#include <zlib.h>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

enum class Format { unknown, dicom, genesis, nifti, nrrd, meta_image, vti, zip };

/// The first bytes of a file, those of its content where it is gzipped.
std::string leading_bytes(const fs::path& path) {
  constexpr unsigned kEnough = 512;
  const std::unique_ptr<gzFile_s, decltype(&gzclose)> file(gzopen(path.c_str(), "rb"), &gzclose);
  if (!file) throw InputError("{}: cannot be read; check its permissions", path.string());
  std::string bytes(kEnough, '\0');
  const int count = gzread(file.get(), bytes.data(), kEnough);
  bytes.resize(static_cast<std::size_t>(std::max(0, count)));
  return bytes;
}

Format format_of(const fs::path& path) {
  const std::string bytes = leading_bytes(path);
  const auto has = [&](std::size_t offset, std::string_view magic) {
    return bytes.size() >= offset + magic.size() && bytes.compare(offset, magic.size(), magic) == 0;
  };
  using namespace std::string_view_literals;
  if (has(0, "IMGF")) return Format::genesis;
  if (has(344, "n+1\0"sv) || has(344, "ni1\0"sv)) return Format::nifti;
  if (has(4, "n+2\0"sv) || has(4, "ni2\0"sv)) return Format::nifti;
  if (has(0, "NRRD000")) return Format::nrrd;
  if (is_dicom(bytes)) return Format::dicom;
  if (is_meta_image(bytes)) return Format::meta_image;
  if (is_vti(bytes)) return Format::vti;
  if (is_zip(bytes)) return Format::zip;
  return Format::unknown;
}

/// Only DICOM files state the series that they are of.
void check_no_series(const fs::path& path, const ScanOptions& options) {
  if (!options.series.empty())
    throw InputError("{}: not DICOM, so there are no series to choose from; leave out `series` {}",
                     path.string(), excerpt(options.series));
}

/// All files of a folder and of the folders in it. Sorted, because the order in which a folder lists its
/// files is arbitrary; which of two duplicates stays must not be.
std::vector<fs::path> files_within(const fs::path& folder, Progress& progress) {
  std::vector<fs::path> files;
  for (const auto& entry :
       fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied)) {
    progress.check();
    // A link in a loop is an error.
    std::error_code error;
    if (entry.is_regular_file(error)) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

/// Genesis slices do not state their series; the folder does.
std::vector<fs::path> of_one_folder(std::vector<fs::path> genesis, const fs::path& path) {
  const auto directly = [&](const fs::path& file) { return fs::equivalent(file.parent_path(), path); };
  if (std::ranges::any_of(genesis, directly))
    std::erase_if(genesis, [&](const fs::path& file) { return !directly(file); });
  for (const fs::path& file : genesis)
    if (file.parent_path() != genesis.front().parent_path())
      throw InputError("{}: several of its folders hold GE Genesis slices; give one of them, such as {}",
                       path.string(), genesis.front().parent_path().string());
  return genesis;
}

/// A scan is larger than the masks beside it.
fs::path largest(const std::vector<fs::path>& files) {
  const auto size_B = [](const fs::path& file) {
    std::error_code error;
    const std::uintmax_t size = fs::file_size(file, error);
    return error ? 0 : size;
  };
  return *std::ranges::max_element(files, {}, size_B);
}

/// Warns of files beside slices that are named like them and too short for a DICOM file: most likely what an
/// interrupted copy left of slices.
void warn_of_stumps(const std::vector<fs::path>& unknown, const std::vector<fs::path>& slices,
                    ScanInfo& info) {
  constexpr std::uintmax_t kPreamble_B = 132;
  std::set<std::pair<fs::path, std::string>> places;
  for (const fs::path& slice : slices) places.emplace(slice.parent_path(), extension_of(slice));
  std::int64_t stumps = 0;
  fs::path example;
  for (const fs::path& file : unknown) {
    std::error_code error;
    if (fs::file_size(file, error) >= kPreamble_B || error) continue;
    if (!places.contains({file.parent_path(), extension_of(file)})) continue;
    if (stumps++ == 0) example = file;
  }
  if (stumps > 0)
    info.warnings.push_back(
        fmt::format("skipped {} among the slices, empty or too short to be DICOM, such as {}: if slices are "
                    "missing, copy the folder again",
                    pluralize(stumps, "file"), example.string()));
}

Scan open_folder(const fs::path& path, const ScanOptions& options, Progress& progress) {
  const std::vector<fs::path> files = files_within(path, progress);
  if (files.empty())
    throw InputError("{}: the folder is empty; give the one that holds the slices", path.string());
  std::vector<Format> formats(files.size());
  parallel_for(std::ssize(files), [&](std::int64_t i) {
    progress.check();
    formats[static_cast<std::size_t>(i)] = format_of(files[static_cast<std::size_t>(i)]);
  });

  std::vector<fs::path> dicom, genesis, unknown, others;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (formats[i] == Format::dicom)
      dicom.push_back(files[i]);
    else if (formats[i] == Format::genesis)
      genesis.push_back(files[i]);
    else
      (formats[i] == Format::unknown ? unknown : others).push_back(files[i]);
  }
  if (!dicom.empty()) {
    Scan scan = open_dicom(path, dicom, options, progress);
    warn_of_stumps(unknown, dicom, scan.info);
    return scan;
  }
  if (!genesis.empty()) {
    check_no_series(path, options);
    return open_genesis(path, of_one_folder(genesis, path), options, progress);
  }
  if (!others.empty())
    throw InputError("{}: the folder holds no DICOM or GE Genesis slices; give the file itself, such as {}",
                     path.string(), largest(others).lexically_relative(path).string());
  throw InputError("{}: the folder holds no images; give the one that holds the slices", path.string());
}

Scan open_dicom_file(const fs::path& path, const ScanOptions& options, Progress& progress) {
  Scan scan = open_dicom(path, {path}, options, progress);
  if (scan.info.size.z == 1)
    scan.info.warnings.emplace_back("a single slice; give its folder for the whole series");
  return scan;
}

/// What `work` returns; errors name what lies in the archive.
template <typename Work>
auto with_names_of(const UnpackedZip& zip, Work work) {
  try {
    return work();
  } catch (const DamagedSlice& error) {
    throw DamagedSlice("{}", zip.renamed(error.what()));
  } catch (const InputError& error) {
    throw InputError("{}", zip.renamed(error.what()));
  }
}

/// Keeps the unpacked files for as long as slices are read from them.
class ZipSource final : public SliceSource {
 public:
  ZipSource(std::unique_ptr<UnpackedZip> zip, std::unique_ptr<SliceSource> source)
      : zip_(std::move(zip)), source_(std::move(source)) {}
  const VolumeGeometry& geometry() const override { return source_->geometry(); }
  HuRange hu_range() const override { return source_->hu_range(); }
  std::int64_t read(std::span<std::int16_t> hu, Progress& progress) override {
    return with_names_of(*zip_, [&] { return source_->read(hu, progress); });
  }

 private:
  std::unique_ptr<UnpackedZip> zip_;
  std::unique_ptr<SliceSource> source_;
};

Scan open_zip(const fs::path& path, const ScanOptions& options, Progress& progress) {
  auto zip = std::make_unique<UnpackedZip>(path, progress);
  Scan scan = with_names_of(*zip, [&] { return open_folder(zip->folder(), options, progress); });
  for (std::string& note : scan.info.notes) note = zip->renamed(note);
  for (std::string& warning : scan.info.warnings) warning = zip->renamed(warning);
  scan.source = std::make_unique<ZipSource>(std::move(zip), std::move(scan.source));
  return scan;
}

}  // namespace

Scan open_scan(const fs::path& path, const ScanOptions& options, Progress& progress) {
  constexpr double kMostOffset_hu = 65536;
  if (!(std::abs(options.offset_hu) <= kMostOffset_hu))
    throw InputError("{}: the offset of {:g} HU must be within {:g} of 0", path.string(), options.offset_hu,
                     kMostOffset_hu);
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw InputError("{}: no such file or folder; check its name", path.string());
  if (fs::is_directory(status)) return open_folder(path, options, progress);
  if (!fs::is_regular_file(status))
    throw InputError("{}: neither a file nor a folder; give the file itself, not a pipe or device",
                     path.string());

  const Format format = format_of(path);
  if (format != Format::unknown && format != Format::dicom && format != Format::zip)
    check_no_series(path, options);
  switch (format) {
    case Format::dicom:
      // The files that a DICOMDIR lists are in its folder.
      if (is_dicom_directory(path)) return open_folder(fs::absolute(path).parent_path(), options, progress);
      return open_dicom_file(path, options, progress);
    case Format::genesis:
      return open_genesis(path, {path}, options, progress);
    case Format::nifti:
      return open_nifti(path, options, progress);
    case Format::nrrd:
      return open_nrrd(path, options, progress);
    case Format::meta_image:
      return open_meta_image(path, options, progress);
    case Format::vti:
      return open_vti(path, options, progress);
    case Format::zip:
      return open_zip(path, options, progress);
    case Format::unknown:
      break;
  }
  throw InputError(
      "{}: not a scan; DICOM, GE Genesis, zip archives of them, NIfTI, NRRD, MetaImage and VTK (.vti) are "
      "read",
      path.string());
}

Scan open_array(std::span<const std::int16_t> hu, const Index3& size,
                const std::array<glm::dvec3, 3>& step_mm, const glm::dvec3& origin_mm,
                const std::string& name) {
  ImageHeader header;
  header.path = name;
  header.size = {size.x, size.y, size.z};
  header.step_mm = step_mm;
  header.origin_mm = origin_mm;
  const auto bytes = std::as_bytes(hu);
  return deliver_image(
      {std::move(header), LoadedVoxels{{reinterpret_cast<const char*>(bytes.data()), bytes.size()}}, {}},
      "array", {});
}

}  // namespace xraycast
