#include "xraycast/scan/dicom_header.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>

// DICOM PS3.5, section 7 and annex A.
namespace xraycast {
namespace {

constexpr DicomTag kTransferSyntax = 0x00020010, kPixelData = 0x7fe00010, kItem = 0xfffee000,
                   kItemEnd = 0xfffee00d, kSequenceEnd = 0xfffee0dd;
constexpr const char* kDeflated = "1.2.840.10008.1.2.1.99";
constexpr std::uint32_t kUndefined = 0xffffffff;
constexpr std::int64_t kPreamble_B = 128;

struct Syntax {
  bool explicit_vr, big_endian;
};

struct CutOff {};

}  // namespace

/// A file's bytes in order. Throws CutOff rather than read or skip beyond the end.
class DicomBytes {
 public:
  explicit DicomBytes(const std::filesystem::path& path) : stream_(path, std::ios::binary) {
    if (!stream_) throw InputError("{}: cannot be read; check its permissions", path.string());
    stream_.seekg(0, std::ios::end);
    size_B_ = stream_.tellg();
    stream_.seekg(0);
  }

  std::int64_t position_B() const { return position_B_; }
  std::int64_t left_B() const { return size_B_ - position_B_; }

  std::string take(std::int64_t count) {
    advance(count);
    std::string bytes(static_cast<std::size_t>(count), '\0');
    stream_.read(bytes.data(), count);
    return bytes;
  }
  void skip(std::int64_t count) {
    advance(count);
    stream_.seekg(count, std::ios::cur);
  }
  void seek(std::int64_t position_B) {
    position_B_ = position_B;
    stream_.seekg(position_B);
  }
  std::string peek(std::int64_t count) {
    const std::int64_t start = position_B_;
    std::string bytes = take(std::min(count, left_B()));
    seek(start);
    return bytes;
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

 private:
  void advance(std::int64_t count) {
    if (count > left_B()) throw CutOff{};
    position_B_ += count;
  }

  std::ifstream stream_;
  std::int64_t position_B_ = 0, size_B_ = 0;
};

namespace {

struct ElementHead {
  DicomTag tag;
  std::uint32_t length;
  bool unknown_vr;
};

DicomTag take_tag(DicomBytes& bytes, bool big_endian) {
  const auto group = bytes.number<std::uint16_t>(big_endian);
  return static_cast<DicomTag>(group) << 16 | bytes.number<std::uint16_t>(big_endian);
}

ElementHead take_head(DicomBytes& bytes, const Syntax& syntax) {
  const DicomTag tag = take_tag(bytes, syntax.big_endian);
  // Items have no value representation in any syntax.
  if (!syntax.explicit_vr || tag >> 16 == 0xfffe)
    return {tag, bytes.number<std::uint32_t>(syntax.big_endian), false};
  const std::string vr = bytes.take(2);
  constexpr std::array kLong{"OB", "OD", "OF", "OL", "OV", "OW", "SQ", "SV", "UC", "UN", "UR", "UT", "UV"};
  if (std::ranges::find(kLong, vr) == kLong.end())
    return {tag, bytes.number<std::uint16_t>(syntax.big_endian), false};
  bytes.skip(2);
  return {tag, bytes.number<std::uint32_t>(syntax.big_endian), vr == "UN"};
}

/// Skips a value of undefined length: items up to the delimiter, each of which may hold such values again.
void skip_items(DicomBytes& bytes, const Syntax& syntax, int depth) {
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
        skip_items(bytes, element.unknown_vr ? Syntax{false, false} : syntax, depth + 1);
    }
  }
}

}  // namespace

DicomHeader::DicomHeader(const std::filesystem::path& path) {
  DicomBytes bytes(path);
  try {
    read(bytes);
  } catch (const CutOff&) {
    is_cut_off_ = true;
  }
}

void DicomHeader::read(DicomBytes& bytes) {
  const std::string start = bytes.peek(kPreamble_B + 4);
  if (start.size() == kPreamble_B + 4 && start.ends_with("DICM")) bytes.seek(kPreamble_B + 4);

  // The meta group is explicit whatever follows it.
  while (bytes.peek(2) == std::string{2, 0}) {
    const ElementHead head = take_head(bytes, {true, false});
    values_[head.tag] = bytes.take(head.length);
  }
  if (values_.contains(kTransferSyntax)) transfer_syntax_ = text(kTransferSyntax);
  if (transfer_syntax_ == kDeflated) return;
  big_endian_ = transfer_syntax_ == "1.2.840.10008.1.2.2";
  Syntax syntax{transfer_syntax_ != "1.2.840.10008.1.2", big_endian_};
  // A file without meta group does not say; the letters of a value representation do.
  if (values_.empty()) {
    const auto is_letter = [](char c) { return c >= 'A' && c <= 'Z'; };
    if (start.size() > 6 && is_letter(start[4]) && is_letter(start[5])) {
      syntax.explicit_vr = true;
      transfer_syntax_ = "1.2.840.10008.1.2.1";
    }
  }

  while (bytes.left_B() > 0) {
    const ElementHead head = take_head(bytes, syntax);
    if (head.tag == kPixelData) {
      const std::int64_t start_B = bytes.position_B();
      const bool encapsulated = head.length == kUndefined;
      if (encapsulated) skip_items(bytes, syntax, 0);
      // Plain pixels that were cut off are for the caller to notice, who knows how many there have to be.
      const std::int64_t length_B =
          encapsulated ? bytes.position_B() - start_B : std::min<std::int64_t>(head.length, bytes.left_B());
      pixel_data_ = {start_B, length_B, encapsulated};
      return;
    }
    // What a CT slice needs is short.
    constexpr std::uint32_t kShort_B = 1024;
    if (head.length == kUndefined)
      skip_items(bytes, head.unknown_vr ? Syntax{false, false} : syntax, 0);
    else if (head.length > kShort_B)
      bytes.skip(head.length);
    else
      values_[head.tag] = bytes.take(head.length);
  }
}

std::string DicomHeader::text(DicomTag tag) const {
  const auto found = values_.find(tag);
  if (found == values_.end()) return {};
  // Values are padded to an even length, with a space or a zero.
  const std::string value = found->second.substr(0, found->second.find('\0'));
  const auto first = value.find_first_not_of(' ');
  return first == std::string::npos ? "" : value.substr(first, value.find_last_not_of(' ') - first + 1);
}

std::vector<double> DicomHeader::numbers(DicomTag tag) const {
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

std::optional<std::uint16_t> DicomHeader::unsigned_short(DicomTag tag) const {
  const auto found = values_.find(tag);
  if (found == values_.end() || found->second.size() < 2) return std::nullopt;
  const auto first = static_cast<unsigned char>(found->second[0]),
             second = static_cast<unsigned char>(found->second[1]);
  return static_cast<std::uint16_t>(big_endian_ ? first << 8 | second : second << 8 | first);
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
