#pragma once

#include "xraycast/series/dicom_slice.hpp"
#include "xraycast/volume/slice_source.hpp"

#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// How pixels are coded, for messages: "JPEG-LS".
const char* coding_of(const DicomPixels& pixels);

/// The pixels of DICOM slices, in HU. Move-only.
class DicomPixelDecoder {
 public:
  /// Unpacks deflated files with several of the slices, so that each slice can be had. Throws DamagedSlice.
  void prepare(const std::vector<DicomSlice>& slices);

  /// Rescales and clamps a slice's values, and returns their range before clamping. Compressed ones are
  /// decoded in a process of their own. May be called by several threads at once. Throws DamagedSlice, and
  /// InputError for what is not supported.
  SliceSource::HuRange decode(const DicomSlice& slice, std::span<std::int16_t> hu) const;

 private:
  struct Inflated {
    std::int64_t begin_B = 0, end_B = 0;  ///< of what the file unpacks to
    std::vector<char> bytes;
  };
  void read_stored(const DicomSlice& slice, const ByteRange& piece, std::span<char> bytes) const;
  SliceSource::HuRange read_plain(const DicomSlice& slice, std::span<std::int16_t> hu) const;
  SliceSource::HuRange decode_apart(const DicomSlice& slice, std::span<std::int16_t> hu) const;

  std::map<std::filesystem::path, Inflated> inflated_;
};

}  // namespace xraycast
