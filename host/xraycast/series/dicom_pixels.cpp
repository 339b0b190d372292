#include "xraycast/series/dicom_pixels.hpp"

#include "xraycast/base/child_process.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/inflater.hpp"
#include "xraycast/volume/rescale.hpp"

#include <gdcmFragment.h>
#include <gdcmImage.h>
#include <gdcmSequenceOfFragments.h>
#include <gdcmTrace.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <new>

namespace xraycast {
namespace {

constexpr const char* kPlainSyntax = "1.2.840.10008.1.2.1";

/// Bits above the high bit may hold anything (old scanners put overlays there): shifts them out, and with the
/// way back extends the sign.
template <typename T>
void keep_stored_bits(const DicomPixels& pixels, std::span<T> words) {
  const int up = 15 - pixels.high_bit, down = 16 - pixels.bits_stored;
  for (T& word : words) word = static_cast<T>(static_cast<T>(word << up) >> down);
}

[[noreturn]] void fail_to_decode(const DicomSlice& slice) {
  throw DamagedSlice(
      "{}: its {} data could not be decoded; copy the file again, or decompress it if its compression is "
      "unknown",
      slice.name(), coding_of(slice.pixels));
}

SliceSource::HuRange rescale_decoded(const DicomSlice& slice, const gdcm::Image& image,
                                     std::span<std::int16_t> hu) {
  std::vector<char> buffer(image.GetBufferLength());
  if (!image.GetBuffer(buffer.data())) fail_to_decode(slice);
  const auto rescale_as = [&]<typename T>(T) {
    if (buffer.size() < hu.size() * sizeof(T))
      throw DamagedSlice("{}: truncated, {} of {} bytes of pixel data are there; copy the file again",
                         slice.name(), buffer.size(), hu.size() * sizeof(T));
    return rescale(std::span(reinterpret_cast<const T*>(buffer.data()), hu.size()), slice.slope,
                   slice.intercept, hu);
  };
  switch (image.GetPixelFormat().GetScalarType()) {
    case gdcm::PixelFormat::UINT8:
      return rescale_as(std::uint8_t{});
    case gdcm::PixelFormat::INT8:
      return rescale_as(std::int8_t{});
    case gdcm::PixelFormat::UINT12:
    case gdcm::PixelFormat::UINT16:
      return rescale_as(std::uint16_t{});
    case gdcm::PixelFormat::INT12:
    case gdcm::PixelFormat::INT16:
      return rescale_as(std::int16_t{});
    case gdcm::PixelFormat::UINT32:
      return rescale_as(std::uint32_t{});
    case gdcm::PixelFormat::INT32:
      return rescale_as(std::int32_t{});
    default:
      throw InputError("{}: pixels of type {} are not supported; convert it to 16 bits", slice.name(),
                       image.GetPixelFormat().GetScalarTypeAsString());
  }
}

/// An image of one frame, of the pieces as the file holds them.
gdcm::Image image_of(const DicomSlice& slice, const std::vector<std::string>& pieces) {
  const DicomPixels& pixels = slice.pixels;
  gdcm::Image image;
  image.SetNumberOfDimensions(2);
  image.SetDimension(0, static_cast<unsigned>(slice.columns));
  image.SetDimension(1, static_cast<unsigned>(slice.rows));
  image.SetPixelFormat(gdcm::PixelFormat(1, static_cast<unsigned short>(pixels.bits_allocated),
                                         static_cast<unsigned short>(pixels.bits_stored),
                                         static_cast<unsigned short>(pixels.high_bit), pixels.is_signed));
  image.SetPhotometricInterpretation(gdcm::PhotometricInterpretation::MONOCHROME2);
  const char* const syntax = pixels.is_encapsulated ? pixels.transfer_syntax.c_str() : kPlainSyntax;
  image.SetTransferSyntax(gdcm::TransferSyntax::GetTSType(syntax));

  const auto length_of = [](const std::string& piece) {
    return gdcm::VL(static_cast<unsigned>(piece.size()));
  };
  gdcm::DataElement data(gdcm::Tag(0x7fe0, 0x0010));
  if (!pixels.is_encapsulated) {
    data.SetByteValue(pieces.front().data(), length_of(pieces.front()));
  } else {
    const auto fragments = gdcm::SequenceOfFragments::New();
    for (const std::string& piece : pieces) {
      gdcm::Fragment fragment;
      fragment.SetByteValue(piece.data(), length_of(piece));
      fragments->AddFragment(fragment);
    }
    data.SetValue(*fragments);
  }
  image.SetDataElement(data);
  return image;
}

/// The result of the process that decodes a slice, followed by its HU.
struct DecodedSlice {
  SliceSource::HuRange range;
  std::array<char, 1000> error;  ///< error message, zero-terminated
};

void swap_words(std::span<char> bytes) {
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) std::swap(bytes[i], bytes[i + 1]);
}

std::vector<char> inflate_range(const DicomSlice& slice, std::int64_t begin_B, std::int64_t size_B) {
  const std::int64_t packed_B =
      static_cast<std::int64_t>(std::filesystem::file_size(slice.file)) - *slice.pixels.deflated_B;
  if (size_B / kDeflateLimit > packed_B)
    throw DamagedSlice("{}: truncated, {} deflated bytes cannot hold {} bytes of pixels; copy the file again",
                       slice.name(), packed_B, size_B);
  std::vector<char> bytes(static_cast<std::size_t>(size_B));
  std::int64_t got_B = 0;
  try {
    Inflater inflater(slice.file, *slice.pixels.deflated_B, Inflater::Format::raw);
    inflater.skip(begin_B);
    got_B = inflater.read(bytes);
  } catch (const InputError& error) {
    throw DamagedSlice("{}", error.what());
  }
  if (got_B < size_B) throw DamagedSlice("{}: could not be read completely; copy it again", slice.name());
  return bytes;
}

}  // namespace

const char* coding_of(const DicomPixels& pixels) {
  // DICOM PS3.6, annex A: the numbers behind 1.2.840.10008.1.2, of which the last ones choose a profile.
  struct Coding {
    const char *prefix, *name;
  };
  constexpr Coding kCodings[] = {{"1.2.840.10008.1.2.4.5", "JPEG"},
                                 {"1.2.840.10008.1.2.4.7", "JPEG"},
                                 {"1.2.840.10008.1.2.4.8", "JPEG-LS"},
                                 {"1.2.840.10008.1.2.4.9", "JPEG 2000"},
                                 {"1.2.840.10008.1.2.5", "RLE"}};
  for (const auto& [prefix, name] : kCodings)
    if (pixels.transfer_syntax.starts_with(prefix)) return name;
  return "pixel";
}

void DicomPixelDecoder::prepare(const std::vector<DicomSlice>& slices) {
  if (!inflated_.empty()) return;
  for (const DicomSlice& slice : slices) {
    if (!slice.pixels.deflated_B || slice.frame == 0) continue;
    const ByteRange& piece = slice.pixels.pieces.front();
    const auto [place, is_new] = inflated_.try_emplace(slice.file, Inflated{piece.offset_B, 0, {}});
    Inflated& range = place->second;
    range.begin_B = std::min(range.begin_B, piece.offset_B);
    range.end_B = std::max(range.end_B, piece.offset_B + piece.length_B);
  }
  for (const DicomSlice& slice : slices)
    if (const auto found = inflated_.find(slice.file);
        found != inflated_.end() && found->second.bytes.empty())
      found->second.bytes =
          inflate_range(slice, found->second.begin_B, found->second.end_B - found->second.begin_B);
}

void DicomPixelDecoder::read_stored(const DicomSlice& slice, const ByteRange& piece,
                                    std::span<char> bytes) const {
  if (const auto found = inflated_.find(slice.file); found != inflated_.end()) {
    std::copy_n(found->second.bytes.begin() + (piece.offset_B - found->second.begin_B), bytes.size(),
                bytes.begin());
  } else if (slice.pixels.deflated_B) {
    std::ranges::copy(inflate_range(slice, piece.offset_B, std::ssize(bytes)), bytes.begin());
  } else {
    std::ifstream stream(slice.file, std::ios::binary);
    stream.seekg(piece.offset_B);
    stream.read(bytes.data(), std::ssize(bytes));
    if (!stream) throw DamagedSlice("{}: could not be read completely; copy it again", slice.name());
  }
  if (slice.pixels.is_byte_swapped) swap_words(bytes);
}

/// Reads directly into the slice's memory and rescales it there.
SliceSource::HuRange DicomPixelDecoder::read_plain(const DicomSlice& slice,
                                                   std::span<std::int16_t> hu) const {
  read_stored(slice, slice.pixels.pieces.front(), {reinterpret_cast<char*>(hu.data()), hu.size_bytes()});
  const auto rescale_as = [&]<typename T>(T) {
    const std::span<T> words(reinterpret_cast<T*>(hu.data()), hu.size());
    keep_stored_bits(slice.pixels, words);
    return rescale(std::span<const T>(words), slice.slope, slice.intercept, hu);
  };
  return slice.pixels.is_signed ? rescale_as(std::int16_t{}) : rescale_as(std::uint16_t{});
}

/// GDCM and the codecs under it write past their memory for some damaged files, or abort.
SliceSource::HuRange DicomPixelDecoder::decode_apart(const DicomSlice& slice,
                                                     std::span<std::int16_t> hu) const {
  std::vector<std::string> pieces;
  for (const ByteRange& piece : slice.pixels.pieces)
    read_stored(slice, piece, pieces.emplace_back(static_cast<std::size_t>(piece.length_B), '\0'));

  const SharedMemory shared(sizeof(DecodedSlice) + hu.size_bytes());
  auto* const decoded = new (shared.bytes().data()) DecodedSlice{};
  auto* const shared_hu = reinterpret_cast<std::int16_t*>(shared.bytes().data() + sizeof(DecodedSlice));
  // A codec holds a slice several times, in wider words.
  constexpr std::int64_t kCopies = 32, kLibraries_B = std::int64_t{256} << 20;
  const ChildLimits limits{.memory_B = kCopies * static_cast<std::int64_t>(hu.size_bytes()) + kLibraries_B};
  const bool ended_well = run_in_child(
      [&] {
        gdcm::Trace::DebugOff();
        gdcm::Trace::WarningOff();
        gdcm::Trace::ErrorOff();
        try {
          decoded->range = rescale_decoded(slice, image_of(slice, pieces), {shared_hu, hu.size()});
        } catch (const InputError& error) {
          std::string(error.what()).copy(decoded->error.data(), decoded->error.size() - 1);
        }
      },
      limits);
  if (decoded->error[0] != 0) throw DamagedSlice("{}", decoded->error.data());
  if (!ended_well)
    throw DamagedSlice("{}: its {} data are damaged; copy it again or remove it", slice.name(),
                       coding_of(slice.pixels));
  std::copy_n(shared_hu, hu.size(), hu.begin());
  return decoded->range;
}

SliceSource::HuRange DicomPixelDecoder::decode(const DicomSlice& slice, std::span<std::int16_t> hu) const {
  return slice.pixels.is_plain() ? read_plain(slice, hu) : decode_apart(slice, hu);
}

}  // namespace xraycast
