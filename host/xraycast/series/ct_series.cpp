#include "xraycast/series/ct_series.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/dicom_file.hpp"
#include "xraycast/base/error.hpp"

#include <algorithm>
#include <array>

// DICOM PS3.3, A.3 and C.8.2.
namespace xraycast {
namespace {

/// The elements common to all slices.
DicomElements series_elements(const VolumeGeometry& geometry, const DicomPatient& patient,
                              const CtSeriesSource& source) {
  DicomElements series = dicom_elements("1.2.840.10008.5.1.4.1.1.2", patient);
  series.text(0x00080008, "DERIVED\\SECONDARY\\AXIAL");  // Image Type
  series.text(0x00080060, "CT");
  series.text(0x0008103e, "Converted by xraycast");  // Series Description
  // Short Text holds 1024 characters, and a path any.
  constexpr std::size_t kMostOfName = 200;
  const std::size_t left_out = source.name.size() - std::min(source.name.size(), kMostOfName);
  series.text(0x00082111, "Converted by xraycast from " + source.name.substr(left_out) +
                              ", on a grid aligned with the patient; not for clinical use.");
  series.number(0x00180050, geometry.spacing_mm.z);  // Slice Thickness
  series.text(0x00180060, "");                       // KVP
  series.text(0x00185100, "");                       // Patient Position
  series.text(0x00200012, "");                       // Acquisition Number
  const std::string& frame = source.frame_of_reference_uid;
  series.text(0x00200052, frame.empty() ? new_dicom_uid() : frame);
  series.text(0x00201040, "");      // Position Reference Indicator
  series.text(0x00200060, "");      // Laterality
  series.text(0x00200020, "L\\P");  // Patient Orientation
  series.numbers(0x00200037, std::array{1.0, 0.0, 0.0, 0.0, 1.0, 0.0});
  series.word(0x00280002, 1);              // Samples per Pixel
  series.text(0x00280004, "MONOCHROME2");  // Photometric Interpretation
  series.word(0x00280010, static_cast<std::uint16_t>(geometry.size.y));
  series.word(0x00280011, static_cast<std::uint16_t>(geometry.size.x));
  series.numbers(0x00280030, std::array{geometry.spacing_mm.y, geometry.spacing_mm.x});
  series.word(0x00280100, 16);     // Bits Allocated
  series.word(0x00280101, 16);     // Bits Stored
  series.word(0x00280102, 15);     // High Bit
  series.word(0x00280103, 1);      // Pixel Representation: signed
  series.number(0x00281050, 40);   // Window Center
  series.number(0x00281051, 400);  // Window Width: of soft tissue
  series.number(0x00281052, 0);    // Rescale Intercept
  series.number(0x00281053, 1);    // Rescale Slope
  series.text(0x00281054, "HU");   // Rescale Type
  return series;
}

std::int64_t slice_bytes(const VolumeGeometry& geometry) {
  return geometry.slice_voxels() * static_cast<std::int64_t>(sizeof(std::int16_t));
}

}  // namespace

bool is_ct_series(const std::filesystem::path& path) {
  std::error_code error;
  return !path.has_extension() || std::filesystem::is_directory(path, error);
}

void check_ct_series(const VolumeGeometry& geometry, const std::filesystem::path& folder,
                     const DicomPatient& patient) {
  constexpr std::int64_t kMostPixels = 65535;
  if (std::max(geometry.size.x, geometry.size.y) > kMostPixels)
    throw InputError("{}: slices of {} x {} pixels; DICOM allows at most {} per side", folder.string(),
                     geometry.size.x, geometry.size.y, kMostPixels);
  if (slice_bytes(geometry) > kMostDicomPixels_B)
    throw InputError("{}: slices of {} x {} pixels exceed the 4 GiB of a DICOM file; write .nrrd instead",
                     folder.string(), geometry.size.x, geometry.size.y);
  check(patient);
  const AtomicFolder probe(folder);
}

void write_ct_series(const Volume& volume, const std::filesystem::path& folder, const DicomPatient& patient,
                     const CtSeriesSource& source, Progress& progress) {
  const VolumeGeometry& geometry = volume.geometry();
  check_ct_series(geometry, folder, patient);
  AtomicFolder target(folder);
  DicomElements slice = series_elements(geometry, patient, source);
  const std::int64_t slice_B = slice_bytes(geometry);
  progress.begin("writing", geometry.size.z, "slices");
  for (std::int64_t z = 0; z < geometry.size.z; ++z) {
    const glm::dvec3 first_mm = geometry.to_world_mm({0, 0, z});
    slice.text(0x00080018, new_dicom_uid());               // SOP Instance UID
    slice.number(0x00200013, static_cast<double>(z + 1));  // Instance Number
    slice.numbers(0x00200032, std::array{first_mm.x, first_mm.y, first_mm.z});
    slice.number(0x00201041, first_mm.z);  // Slice Location
    const auto voxels = std::as_bytes(volume.slices(z, 1));
    const std::string header = dicom_header(slice, slice_B);
    target.write(fmt::format("slice-{:04}.dcm", z + 1),
                 {header, {reinterpret_cast<const char*>(voxels.data()), voxels.size()}},
                 (std::ssize(header) + slice_B) * geometry.size.z);
    progress.advance();
  }
  target.commit();
}

}  // namespace xraycast
