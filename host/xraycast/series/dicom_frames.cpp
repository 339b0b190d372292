#include "xraycast/series/dicom_frames.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/series/dicom_pixels.hpp"
#include "xraycast/series/dicom_tags.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

// ---- where a slice lies and what its values mean ----------------------------------------------------

/// What holds a slice's values: the data set, or functional groups.
struct ValueHolders {
  const DicomItem &position, &orientation, &measures, &transformation;
};

/// The item of a functional group: the frame's own, else the shared one, else the data set.
const DicomItem& holder(const DicomHeader& header, const DicomItem& frame, DicomTag group) {
  if (const auto& own = frame.items(group); !own.empty()) return own.front();
  if (const auto& shared = header.items(kSharedGroups); !shared.empty())
    if (const auto& items = shared.front().items(group); !items.empty()) return items.front();
  return header;
}

std::vector<double> numbers(const DicomItem& item, DicomTag tag, std::size_t count, const std::string& name,
                            const char* field, const char* consequence) {
  std::vector<double> result = item.numbers(tag);
  if (result.size() != count || !std::ranges::all_of(result, [](double x) { return std::isfinite(x); }))
    throw DamagedSlice("{}: {} ({:04x},{:04x}) is missing or damaged, so {}; export the series again with it",
                       name, field, tag >> 16, tag & 0xffff, consequence);
  return result;
}

double number_or(const DicomItem& item, DicomTag tag, double fallback) {
  const std::vector<double> result = item.numbers(tag);
  return result.empty() ? fallback : result.front();
}

/// What turns stored values into Hounsfield units. A CT slice must say it (Type 1 of CT Image Storage):
/// taken as 1 and 0, most would be off by 1024 HU.
double rescale_number(const DicomItem& item, DicomTag tag, const char* field, bool is_ct, double of_others,
                      const std::string& name) {
  const std::string text = item.text(tag);
  if (text.empty() && !is_ct) return of_others;
  const std::vector<double> number = item.numbers(tag);
  if (number.size() != 1 || !std::isfinite(number[0]) || (tag == kRescaleSlope && number[0] == 0))
    throw DamagedSlice(
        "{}: {} ({:04x},{:04x}) is {}, so its Hounsfield units are unknown; export the series again", name,
        field, tag >> 16, tag & 0xffff, text.empty() ? "missing" : "'" + excerpt(text) + "'");
  return number[0];
}

SlicePlane read_plane(const ValueHolders& holders, const std::string& name) {
  const auto position =
      numbers(holders.position, kImagePosition, 3, name, "ImagePositionPatient", "its position is unknown");
  const auto directions = numbers(holders.orientation, kImageOrientation, 6, name, "ImageOrientationPatient",
                                  "left and right are unknown");
  const auto spacing =
      numbers(holders.measures, kPixelSpacing, 2, name, "PixelSpacing", "its size is unknown");
  if (!(spacing[0] > 0 && spacing[1] > 0))
    throw DamagedSlice(
        "{}: PixelSpacing (0028,0030) is {} x {} mm; it must be above zero: export the series again", name,
        spacing[0], spacing[1]);
  const glm::dvec3 i(directions[0], directions[1], directions[2]),
      j(directions[3], directions[4], directions[5]);
  // Printed cosines are unit vectors up to their last digit.
  if (std::abs(glm::length(i) - 1) > 0.01 || std::abs(glm::length(j) - 1) > 0.01 ||
      std::abs(glm::dot(i, j)) > 0.01)
    throw DamagedSlice(
        "{}: ImageOrientationPatient (0020,0037) is not two perpendicular unit vectors; export the series "
        "again",
        name);
  // The first spacing is the distance between rows.
  return {{position[0], position[1], position[2]},
          glm::normalize(i) * spacing[1],
          glm::normalize(j) * spacing[0]};
}

void read_values(const ValueHolders& holders, bool is_ct, DicomSlice& slice) {
  const std::string name = slice.name();
  slice.plane = read_plane(holders, name);
  slice.thickness_mm = number_or(holders.measures, kSliceThickness, 0);
  slice.slope = rescale_number(holders.transformation, kRescaleSlope, "RescaleSlope", is_ct, 1, name);
  slice.intercept =
      rescale_number(holders.transformation, kRescaleIntercept, "RescaleIntercept", is_ct, 0, name);
}

// ---- pixels ------------------------------------------------------------------------------------------

std::shared_ptr<const DicomStudy> read_study(const DicomHeader& header) {
  auto study = std::make_shared<DicomStudy>();
  for (const auto& [tag, text] : kDicomStudyFields) (*study).*text = header.text(tag);
  return study;
}

/// What all slices of a file share.
DicomSlice common_of(const DicomHeader& header, const fs::path& file) {
  DicomSlice slice;
  slice.file = file;
  slice.columns = header.unsigned_short(kColumns).value_or(0);
  slice.rows = header.unsigned_short(kRows).value_or(0);
  slice.study = read_study(header);
  slice.sop_class_uid = header.text(kObjectClass);
  slice.sop_instance_uid = header.text(kObjectInstance);
  DicomPixels& pixels = slice.pixels;
  pixels.transfer_syntax = header.transfer_syntax();
  pixels.deflated_B = header.deflated_B();
  pixels.is_encapsulated = header.pixel_data()->encapsulated;
  pixels.is_byte_swapped = header.pixel_data()->byte_swapped;
  const std::uint16_t bits_allocated = header.unsigned_short(kBitsAllocated).value_or(16);
  const std::uint16_t bits_stored = header.unsigned_short(kBitsStored).value_or(bits_allocated);
  pixels.bits_allocated = bits_allocated;
  pixels.bits_stored = bits_stored;
  pixels.high_bit = header.unsigned_short(kHighBit).value_or(static_cast<std::uint16_t>(bits_stored - 1));
  pixels.is_signed = header.unsigned_short(kPixelRepresentation).value_or(0) == 1;
  return slice;
}

std::int64_t frame_B(const DicomSlice& slice) {
  return slice.columns * slice.rows * slice.pixels.bits_allocated / 8;
}

/// One fragment a frame, or as many as the offset table says.
std::vector<std::vector<ByteRange>> pieces_of_frames(const DicomHeader::PixelData& pixels, std::size_t frames,
                                                     const fs::path& file) {
  std::vector<std::vector<ByteRange>> pieces(frames);
  if (pixels.fragments.size() == frames) {
    for (std::size_t f = 0; f < frames; ++f) pieces[f] = {pixels.fragments[f]};
    return pieces;
  }
  constexpr std::int64_t kItemHead_B = 8;
  std::size_t next = 0;
  for (const ByteRange& fragment : pixels.fragments) {
    if (next < pixels.frames_B.size() && fragment.offset_B - kItemHead_B == pixels.frames_B[next]) ++next;
    if (next == 0 || next > frames) break;
    pieces[next - 1].push_back(fragment);
  }
  if (next != frames || pixels.frames_B.size() != frames)
    throw DamagedSlice("{}: {} of pixel data for {}, but no offset table; export it again", file.string(),
                       pluralize(std::ssize(pixels.fragments), "fragment"),
                       pluralize(static_cast<std::int64_t>(frames), "frame"));
  return pieces;
}

/// The one piece of plain pixels, or the fragments of packed ones, are long enough for a slice.
void check_pixels(const DicomSlice& slice) {
  const std::int64_t there_B = slice.pixels.size_B(), needed_B = frame_B(slice);
  if (!slice.pixels.is_encapsulated && there_B < needed_B)
    throw DamagedSlice("{}: truncated, {} of {} bytes of pixel data are there; copy the file again",
                       slice.name(), there_B, needed_B);
  // The best a codec does is an empty slice of 512 x 512 pixels in some 100 bytes.
  constexpr std::int64_t kMaxPacked = 20000;
  if (slice.pixels.is_encapsulated && needed_B / kMaxPacked > there_B)
    throw DamagedSlice(
        "{}: {} x {} pixels (Columns, Rows) cannot come from {} bytes of {} data; copy the file again",
        slice.name(), slice.columns, slice.rows, there_B, coding_of(slice.pixels));
}

// ---- one slice, or frames ----------------------------------------------------------------------------

void check_header(const DicomHeader& header, const fs::path& file) {
  if (header.is_cut_off())
    throw DamagedSlice("{}: a damaged or truncated DICOM file; copy it again or remove it", file.string());
  if (!header.pixel_data())
    throw DamagedSlice("{}: truncated, it ends before its pixel data; copy the file again", file.string());
  if (header.unsigned_short(kSamplesPerPixel).value_or(1) != 1)
    throw InputError(
        "{}: a colour image (SamplesPerPixel (0028,0002) is not 1), such as a screen shot; give the folder "
        "of a CT series",
        file.string());
}

DicomSlice read_single(const DicomHeader& header, const fs::path& file, bool is_ct) {
  DicomSlice slice = common_of(header, file);
  const DicomHeader::PixelData& pixels = *header.pixel_data();
  slice.pixels.pieces =
      pixels.encapsulated ? pixels.fragments : std::vector{ByteRange{pixels.offset_B, pixels.length_B}};
  read_values({header, header, header, header}, is_ct, slice);
  check_pixels(slice);
  return slice;
}

struct Frame {
  DicomSlice slice;
  std::string stack;
  std::uint32_t time;
};

Frame read_frame(const DicomHeader& header, const DicomItem& groups, DicomSlice slice, bool is_ct) {
  read_values({holder(header, groups, kPlanePosition), holder(header, groups, kPlaneOrientation),
               holder(header, groups, kPixelMeasures), holder(header, groups, kPixelValueTransformation)},
              is_ct, slice);
  check_pixels(slice);
  const DicomItem& content = holder(header, groups, kFrameContent);
  return {std::move(slice), content.text(kStackId), content.unsigned_long(kTemporalIndex).value_or(0)};
}

/// A few bytes of a deflated file may describe a million frames.
void check_frames(std::size_t frames, const fs::path& file) {
  constexpr std::size_t kMostFrames = 65536;
  if (frames > kMostFrames)
    throw InputError("{}: {} frames (NumberOfFrames (0028,0008)) are more than {}; export it in parts",
                     file.string(), frames, kMostFrames);
}

/// The same file's slices, each with its own pieces of the pixels.
std::vector<DicomSlice> slices_of_frames(const DicomSlice& common, const DicomHeader::PixelData& pixels,
                                         std::size_t frames) {
  const std::string file = common.file.string();
  if (!pixels.encapsulated && common.pixels.bits_allocated % 8 != 0)
    throw InputError("{}: BitsAllocated (0028,0100) is {}; export frames of 8, 16 or 32 bits a pixel", file,
                     common.pixels.bits_allocated);
  const auto packed = pixels.encapsulated ? pieces_of_frames(pixels, frames, common.file)
                                          : std::vector<std::vector<ByteRange>>();
  std::vector<DicomSlice> slices(frames, common);
  for (std::size_t f = 0; f < frames; ++f) {
    slices[f].frame = static_cast<std::int64_t>(f) + 1;
    const std::int64_t begin_B = static_cast<std::int64_t>(f) * frame_B(common);
    slices[f].pixels.pieces =
        pixels.encapsulated
            ? packed[f]
            : std::vector{ByteRange{pixels.offset_B + begin_B,
                                    std::clamp<std::int64_t>(pixels.length_B - begin_B, 0, frame_B(common))}};
  }
  return slices;
}

/// How many frames of plain pixels the file holds as a whole.
std::size_t whole_frames(const DicomSlice& common, const DicomHeader::PixelData& pixels) {
  return static_cast<std::size_t>(pixels.length_B / std::max<std::int64_t>(1, frame_B(common)));
}

/// `first` is what is wrong with the first damaged frame, the file's name in front.
std::string fault_of_frames(const std::string& file, std::size_t frames, std::size_t damaged,
                            std::size_t whole, const std::string& first) {
  if (whole + damaged == frames)
    return fmt::format("{}: truncated, {} of {} frames are there; copy the file again", file, whole, frames);
  if (damaged == 1) return first;
  return fmt::format("{}: {} of {} frames are damaged; the first is {}", file, damaged, frames,
                     first.substr(file.size() + 2));
}

/// The slices of all frames that can be used; `summary` tells of the others.
std::vector<Frame> read_frames(const DicomHeader& header, const fs::path& file, bool is_ct,
                               DicomFileSummary& summary) {
  const std::vector<DicomItem>& groups = header.items(kPerFrameGroups);
  if (number_or(header, kNumberOfFrames, 1) != static_cast<double>(groups.size()))
    throw DamagedSlice("{}: NumberOfFrames (0028,0008) is {}, but {} frames are described; export it again",
                       file.string(), header.text(kNumberOfFrames), groups.size());
  check_frames(groups.size(), file);
  const DicomSlice common = common_of(header, file);
  const DicomHeader::PixelData& pixels = *header.pixel_data();
  std::vector<DicomSlice> slices = slices_of_frames(common, pixels, groups.size());
  std::vector<Frame> frames;
  for (std::size_t f = 0; f < groups.size(); ++f) {
    try {
      frames.push_back(read_frame(header, groups[f], std::move(slices[f]), is_ct));
    } catch (const DamagedSlice& error) {
      if (++summary.faulty_slices == 1) summary.fault = error.what();
    }
  }
  const auto damaged = static_cast<std::size_t>(summary.faulty_slices);
  summary.is_damaged = damaged > 0;
  if (damaged > 0)
    summary.fault =
        fault_of_frames(file.string(), groups.size(), damaged,
                        pixels.encapsulated ? groups.size() : whole_frames(common, pixels), summary.fault);
  return frames;
}

/// The stack with most frames; `note` tells of the others.
std::vector<Frame> largest_stack(std::vector<Frame> frames, const fs::path& file, std::string& note) {
  std::map<std::string, std::int64_t> sizes;
  for (const Frame& frame : frames) ++sizes[frame.stack];
  if (sizes.size() < 2) return frames;
  const auto largest = std::ranges::max_element(sizes, {}, [](const auto& stack) { return stack.second; });
  const auto left_out =
      std::erase_if(frames, [&](const Frame& frame) { return frame.stack != largest->first; });
  note = fmt::format("{}: of {} stacks (StackID (0020,9056)) the one with most frames was taken, without {}",
                     file.filename().string(), sizes.size(),
                     pluralize(static_cast<std::int64_t>(left_out), "other frame"));
  return frames;
}

}  // namespace

void read_slices(const DicomHeader& header, const fs::path& file, DicomFileSummary& summary) {
  check_header(header, file);
  const bool is_ct = header.text(kModality) == "CT";
  if (header.items(kPerFrameGroups).empty()) {
    if (number_or(header, kNumberOfFrames, 1) > 1)
      throw InputError(
          "{}: several frames (NumberOfFrames (0028,0008)) without functional groups that give their "
          "positions; convert it to one file per slice or to NIfTI",
          file.string());
    summary.slices.push_back(read_single(header, file, is_ct));
    return;
  }
  std::vector<Frame> frames = largest_stack(read_frames(header, file, is_ct, summary), file, summary.note);
  // Of frames at one place the first is kept.
  std::ranges::stable_sort(frames, {}, &Frame::time);
  for (Frame& frame : frames) summary.slices.push_back(std::move(frame.slice));
}

std::vector<DicomSlice> read_pictures(const DicomHeader& header, const fs::path& file) {
  check_header(header, file);
  DicomSlice common = common_of(header, file);
  if (common.columns < 1 || common.rows < 1)
    throw InputError("{}: has no picture (Rows (0028,0010), Columns (0028,0011))", file.string());
  const DicomHeader::PixelData& pixels = *header.pixel_data();
  const double frames = number_or(header, kNumberOfFrames, 1);
  if (!(frames >= 1)) throw InputError("{}: NumberOfFrames (0028,0008) is {}", file.string(), frames);
  if (frames == 1) {
    common.pixels.pieces =
        pixels.encapsulated ? pixels.fragments : std::vector{ByteRange{pixels.offset_B, pixels.length_B}};
    check_pixels(common);
    return {common};
  }
  check_frames(static_cast<std::size_t>(std::min(frames, 1e9)), file);
  std::vector<DicomSlice> slices = slices_of_frames(common, pixels, static_cast<std::size_t>(frames));
  for (const DicomSlice& slice : slices) check_pixels(slice);
  return slices;
}

}  // namespace xraycast
