#include "xraycast/series/dicom_header.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/inflater.hpp"
#include "xraycast/series/dicom_tags.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <limits>
#include <memory>

// DICOM PS3.5, section 7 and annex A.
namespace xraycast {
namespace {

constexpr const char* kImplicit = "1.2.840.10008.1.2";
constexpr const char* kDeflated = "1.2.840.10008.1.2.1.99";
constexpr const char* kBigEndian = "1.2.840.10008.1.2.2";
constexpr std::uint32_t kUndefined = 0xffffffff;
constexpr std::int64_t kPreamble_B = 128;
/// What is kept of a file is short.
constexpr std::uint32_t kLongestKept_B = 1024;

/// The functional groups of multi-frame files and the segments of Segmentations, and what in them is used:
/// PS3.3, C.7.6.16 and C.8.20.
constexpr std::array kSequences{
    kSharedGroups,  kPerFrameGroups,           kFrameContent, kPlanePosition,        kPlaneOrientation,
    kPixelMeasures, kPixelValueTransformation, kSegments,     kSegmentIdentification};
constexpr std::array kItemElements{kSliceThickness,   kImagePosition, kImageOrientation,
                                   kStackId,          kTemporalIndex, kPixelSpacing,
                                   kRescaleIntercept, kRescaleSlope,  kSpacingBetweenSlices,
                                   kSegmentNumber,    kSegmentLabel,  kReferencedSegment};

struct Syntax {
  bool explicit_vr, big_endian;
};
constexpr Syntax kImplicitSyntax{false, false};

struct CutOff {};

}  // namespace

/// A file's bytes in order. Throws CutOff rather than read or skip beyond the end.
class DicomBytes {
 public:
  explicit DicomBytes(const std::filesystem::path& path) : path_(path), stream_(path, std::ios::binary) {
    if (!stream_) throw InputError("{}: cannot be read; check its permissions", path.string());
    stream_.seekg(0, std::ios::end);
    size_B_ = stream_.tellg();
  }

  std::int64_t position_B() const { return position_B_; }
  /// Of a deflated data set, the most that there can be.
  std::int64_t left_B() const { return size_B_ - position_B_; }
  bool at_end() { return peek(1).empty(); }

  std::string take(std::int64_t count) {
    std::string bytes = peek(count);
    if (std::ssize(bytes) < count) throw CutOff{};
    position_B_ += count;
    return bytes;
  }
  void skip(std::int64_t count) {
    if (count > left_B()) throw CutOff{};
    position_B_ += count;
  }
  /// As take(), of a run that may be long or cut off. Returns how many bytes there were.
  std::int64_t skip_at_most(std::int64_t count) {
    count = std::min(count, left_B());
    position_B_ += count;
    if (!inflater_) return count;
    fill(0);
    return count - std::max<std::int64_t>(0, position_B_ - window_end_B());
  }
  std::string peek(std::int64_t count) {
    count = std::min(count, left_B());
    fill(count);
    const auto start = static_cast<std::size_t>(std::min(position_B_ - window_B_, std::ssize(window_)));
    return window_.substr(start, static_cast<std::size_t>(count));
  }

  template <typename T>
  T number(bool big_endian) {
    const std::string bytes = take(sizeof(T));
    T value = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i)
      value =
          static_cast<T>(value << 8 | static_cast<unsigned char>(bytes[big_endian ? i : sizeof(T) - 1 - i]));
    return value;
  }

  /// What follows is deflated; positions start again, at 0.
  void inflate() {
    inflater_ = std::make_unique<Inflater>(path_, position_B_, Inflater::Format::raw);
    size_B_ = left_B() * kDeflateLimit;
    position_B_ = window_B_ = 0;
    window_.clear();
  }

 private:
  std::int64_t window_end_B() const { return window_B_ + std::ssize(window_); }

  /// Makes the window hold `count` bytes from the position on, or as many as there are.
  void fill(std::int64_t count) {
    if (position_B_ >= window_B_ && position_B_ + count <= window_end_B()) return;
    constexpr std::int64_t kWindow_B = 1 << 14;
    const std::int64_t wanted = std::min(std::max(count, kWindow_B), left_B());
    if (!inflater_) {
      window_.resize(static_cast<std::size_t>(wanted));
      stream_.clear();
      stream_.seekg(position_B_);
      stream_.read(window_.data(), wanted);
      window_.resize(static_cast<std::size_t>(stream_.gcount()));
      window_B_ = position_B_;
      return;
    }
    if (const std::int64_t ahead = position_B_ - window_end_B(); ahead > 0) {
      window_B_ = window_end_B() + inflater_->skip(ahead);
      window_.clear();
      if (window_B_ < position_B_) return;
    }
    window_.erase(0, static_cast<std::size_t>(position_B_ - window_B_));
    window_B_ = position_B_;
    const std::size_t had = window_.size();
    window_.resize(static_cast<std::size_t>(wanted));
    window_.resize(had + static_cast<std::size_t>(inflater_->read(std::span(window_).subspan(had))));
  }

  std::filesystem::path path_;
  std::ifstream stream_;
  std::unique_ptr<Inflater> inflater_;
  std::string window_;
  std::int64_t window_B_ = 0, position_B_ = 0, size_B_ = 0;
};

namespace {

struct ElementHead {
  DicomTag tag;
  std::uint32_t length;
  bool unknown_vr = false;  ///< UN
  bool of_bytes = false;    ///< OB
};

DicomTag take_tag(DicomBytes& bytes, bool big_endian) {
  const auto group = bytes.number<std::uint16_t>(big_endian);
  return static_cast<DicomTag>(group) << 16 | bytes.number<std::uint16_t>(big_endian);
}

ElementHead take_head(DicomBytes& bytes, const Syntax& syntax) {
  const DicomTag tag = take_tag(bytes, syntax.big_endian);
  // Items have no value representation in any syntax.
  if (!syntax.explicit_vr || tag >> 16 == 0xfffe)
    return {tag, bytes.number<std::uint32_t>(syntax.big_endian)};
  const std::string vr = bytes.take(2);
  constexpr std::array kLong{"OB", "OD", "OF", "OL", "OV", "OW", "SQ", "SV", "UC", "UN", "UR", "UT", "UV"};
  if (std::ranges::find(kLong, vr) == kLong.end())
    return {tag, bytes.number<std::uint16_t>(syntax.big_endian)};
  bytes.skip(2);
  return {tag, bytes.number<std::uint32_t>(syntax.big_endian), vr == "UN", vr == "OB"};
}

/// Skips a value of undefined length: items up to the delimiter, each of which may hold such values again.
void skip_items(DicomBytes& bytes, const Syntax& syntax, int depth = 0) {
  constexpr int kDeepest = 32;
  if (depth > kDeepest) throw CutOff{};
  for (;;) {
    const ElementHead item = take_head(bytes, syntax);
    if (item.tag == kSequenceEnd) return;
    if (item.tag != kItem) throw CutOff{};
    if (item.length != kUndefined) {
      bytes.skip(item.length);
      continue;
    }
    for (ElementHead element = take_head(bytes, syntax); element.tag != kItemEnd;
         element = take_head(bytes, syntax)) {
      if (element.length != kUndefined)
        bytes.skip(element.length);
      else
        skip_items(bytes, element.unknown_vr ? kImplicitSyntax : syntax, depth + 1);
    }
  }
}

}  // namespace

/// Reads a file into a header. What a file may make it keep is bounded.
class DicomReader {
 public:
  explicit DicomReader(DicomBytes& bytes) : bytes_(bytes) {}

  void read(DicomHeader& header) {
    const std::string start = bytes_.peek(kPreamble_B + 4);
    if (start.size() == kPreamble_B + 4 && start.ends_with("DICM")) bytes_.skip(kPreamble_B + 4);

    // The meta group is explicit whatever follows it.
    while (bytes_.peek(2) == std::string{2, 0}) {
      const ElementHead head = take_head(bytes_, {true, false});
      if (head.length > kLongestKept_B)
        bytes_.skip(head.length);
      else
        header.values_[head.tag] = bytes_.take(head.length);
    }
    std::string& transfer_syntax = header.transfer_syntax_;
    if (header.contains(kTransferSyntax)) transfer_syntax = header.text(kTransferSyntax);
    if (transfer_syntax == kDeflated) {
      header.deflated_B_ = bytes_.position_B();
      bytes_.inflate();
    }
    Syntax syntax{transfer_syntax != kImplicit, transfer_syntax == kBigEndian};
    // Without a meta group, the letters of a value representation show it.
    if (header.values_.empty()) {
      const auto is_letter = [](char c) { return c >= 'A' && c <= 'Z'; };
      if (start.size() > 6 && is_letter(start[4]) && is_letter(start[5])) {
        syntax.explicit_vr = true;
        transfer_syntax = "1.2.840.10008.1.2.1";
      }
    }
    header.big_endian_ = syntax.big_endian;

    while (!bytes_.at_end()) {
      const ElementHead head = take_head(bytes_, syntax);
      if (head.tag == kPixelData) return read_pixel_data(head, syntax, header);
      read_element(head, syntax, header, 0);
    }
  }

 private:
  /// Every item and every element kept takes one of these.
  void spend() {
    if (--left_ < 0) throw CutOff{};
  }

  void read_element(const ElementHead& head, const Syntax& syntax, DicomItem& item, int depth) {
    const Syntax& inner = head.unknown_vr ? kImplicitSyntax : syntax;
    const bool wanted = depth == 0 || std::ranges::find(kItemElements, head.tag) != kItemElements.end();
    if (std::ranges::find(kSequences, head.tag) != kSequences.end()) {
      item.sequences_[head.tag] = read_items(head.length, inner, depth + 1);
    } else if (head.length == kUndefined) {
      skip_items(bytes_, inner);
    } else if (head.length > kLongestKept_B || !wanted) {
      bytes_.skip(head.length);
    } else {
      spend();
      item.values_[head.tag] = bytes_.take(head.length);
    }
  }

  /// Where a run of that length ends; far away for one that a delimiter ends.
  std::int64_t end_of(std::uint32_t length) {
    if (length == kUndefined) return std::numeric_limits<std::int64_t>::max();
    if (length > bytes_.left_B()) throw CutOff{};
    return bytes_.position_B() + length;
  }

  std::vector<DicomItem> read_items(std::uint32_t length, const Syntax& syntax, int depth) {
    constexpr int kDeepest = 8;
    if (depth > kDeepest) throw CutOff{};
    const std::int64_t end_B = end_of(length);
    std::vector<DicomItem> items;
    while (bytes_.position_B() < end_B) {
      const ElementHead head = take_head(bytes_, syntax);
      if (head.tag == kSequenceEnd && length == kUndefined) return items;
      if (head.tag != kItem) throw CutOff{};
      spend();
      items.push_back(read_item(head.length, syntax, depth));
    }
    if (bytes_.position_B() > end_B) throw CutOff{};
    return items;
  }

  DicomItem read_item(std::uint32_t length, const Syntax& syntax, int depth) {
    const std::int64_t end_B = end_of(length);
    DicomItem item;
    item.big_endian_ = syntax.big_endian;
    while (bytes_.position_B() < end_B) {
      const ElementHead head = take_head(bytes_, syntax);
      if (head.tag == kItemEnd && length == kUndefined) return item;
      read_element(head, syntax, item, depth);
    }
    if (bytes_.position_B() > end_B) throw CutOff{};
    return item;
  }

  void read_pixel_data(const ElementHead& head, const Syntax& syntax, DicomHeader& header) {
    DicomHeader::PixelData pixels;
    pixels.offset_B = bytes_.position_B();
    pixels.encapsulated = head.length == kUndefined;
    pixels.byte_swapped = syntax.big_endian && !head.of_bytes;
    if (pixels.encapsulated) {
      read_fragments(syntax, pixels);
      pixels.length_B = bytes_.position_B() - pixels.offset_B;
    } else {
      // Pixels that were cut off are for the caller to notice, who knows how many there must be.
      pixels.length_B = bytes_.skip_at_most(head.length);
    }
    header.pixel_data_ = std::move(pixels);
  }

  /// The first item is the table of the frames' offsets, which may be empty: PS3.5, A.4.
  void read_fragments(const Syntax& syntax, DicomHeader::PixelData& pixels) {
    const ElementHead table = take_head(bytes_, syntax);
    if (table.tag != kItem) throw CutOff{};
    constexpr std::uint32_t kLongestTable_B = 1 << 20;
    if (table.length <= kLongestTable_B) {
      const std::int64_t first_B = bytes_.position_B() + table.length;
      while (bytes_.position_B() + 4 <= first_B)
        pixels.frames_B.push_back(first_B + bytes_.number<std::uint32_t>(syntax.big_endian));
      bytes_.skip(first_B - bytes_.position_B());
    } else {
      bytes_.skip(table.length);
    }
    for (ElementHead item = take_head(bytes_, syntax); item.tag != kSequenceEnd;
         item = take_head(bytes_, syntax)) {
      if (item.tag != kItem) throw CutOff{};
      spend();
      pixels.fragments.push_back({bytes_.position_B(), item.length});
      bytes_.skip(item.length);
    }
  }

  DicomBytes& bytes_;
  std::int64_t left_ = 1'000'000;
};

DicomHeader::DicomHeader(const std::filesystem::path& path) {
  DicomBytes bytes(path);
  try {
    DicomReader(bytes).read(*this);
  } catch (const CutOff&) {
    is_cut_off_ = true;
  } catch (const InputError&) {
    // What is deflated does not unpack.
    is_cut_off_ = true;
  }
}

std::string DicomItem::text(DicomTag tag) const {
  const auto found = values_.find(tag);
  if (found == values_.end()) return {};
  // Values are padded to an even length, with a space or a zero.
  const std::string value = found->second.substr(0, found->second.find('\0'));
  const auto first = value.find_first_not_of(' ');
  return first == std::string::npos ? "" : value.substr(first, value.find_last_not_of(' ') - first + 1);
}

std::vector<double> DicomItem::numbers(DicomTag tag) const {
  const std::string value = text(tag);
  const char* const last = value.data() + value.size();
  std::vector<double> result;
  for (const char* at = value.data(); at < last;) {
    const char* const end = std::find(at, last, '\\');
    at = std::find_if(at, end, [](char c) { return c != ' ' && c != '+'; });
    const auto [rest, error] = std::from_chars(at, end, result.emplace_back());
    if (error != std::errc{} || std::find_if(rest, end, [](char c) { return c != ' '; }) != end) return {};
    at = end + 1;
  }
  return result;
}

std::optional<std::uint64_t> DicomItem::binary(DicomTag tag, std::size_t size_B) const {
  const auto found = values_.find(tag);
  if (found == values_.end() || found->second.size() < size_B) return std::nullopt;
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size_B; ++i)
    value = value << 8 | static_cast<unsigned char>(found->second[big_endian_ ? i : size_B - 1 - i]);
  return value;
}

std::optional<std::uint16_t> DicomItem::unsigned_short(DicomTag tag) const {
  const auto value = binary(tag, sizeof(std::uint16_t));
  return value ? std::optional(static_cast<std::uint16_t>(*value)) : std::nullopt;
}

std::optional<std::uint32_t> DicomItem::unsigned_long(DicomTag tag) const {
  const auto value = binary(tag, sizeof(std::uint32_t));
  return value ? std::optional(static_cast<std::uint32_t>(*value)) : std::nullopt;
}

const std::vector<DicomItem>& DicomItem::items(DicomTag tag) const {
  static const std::vector<DicomItem> none;
  const auto found = sequences_.find(tag);
  return found == sequences_.end() ? none : found->second;
}

bool is_dicom(const std::string& leading_bytes) {
  if (leading_bytes.size() >= kPreamble_B + 4 && leading_bytes.compare(kPreamble_B, 4, "DICM") == 0)
    return true;
  // (0002,0000), (0002,0010), (0008,0000), (0008,0001), (0008,0005), (0008,0008), (0008,0016) or (0008,0018).
  constexpr std::array<std::array<char, 4>, 8> kFirst{{{2, 0, 0, 0},
                                                       {2, 0, 16, 0},
                                                       {8, 0, 0, 0},
                                                       {8, 0, 1, 0},
                                                       {8, 0, 5, 0},
                                                       {8, 0, 8, 0},
                                                       {8, 0, 22, 0},
                                                       {8, 0, 24, 0}}};
  return std::ranges::any_of(kFirst, [&](const auto& tag) {
    return leading_bytes.size() > 8 && std::equal(tag.begin(), tag.end(), leading_bytes.begin());
  });
}

}  // namespace xraycast
