// TIFF revision 6.0 (Adobe 1992), with technical note 2's deflate. Debian's libtiff depends on eight
// libraries, one of them (JBIG-KIT) under the GPL; only one strip of floats is written here.

#include "xraycast/base/tiff_file.hpp"

#include "xraycast/base/deflated.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"

#include <array>
#include <bit>
#include <cstdint>
#include <limits>

namespace xraycast {
namespace {

static_assert(std::endian::native == std::endian::little, "the header says so");

enum class Type : std::uint16_t { ascii = 2, u16 = 3, u32 = 4 };

/// An entry of the directory of fields. Its value is a number, or the offset of an ASCII text.
struct Field {
  std::uint16_t tag;
  Type type;
  std::uint32_t count, value;
};

template <typename T>
void append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace

void write_tiff(std::span<const float> values, int width, int height, const std::string& description,
                const std::filesystem::path& path) {
  const auto bytes = std::as_bytes(values);
  constexpr int kLevel = 6;
  const std::string strip = deflated({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, kLevel);
  if (strip.size() + description.size() > std::numeric_limits<std::uint32_t>::max() - 1024)
    throw InputError("{}: a TIFF holds 4 GiB at most; choose .exr or .nrrd", path.string());
  constexpr std::uint32_t kDirectory = 8, kFields = 13, kField_B = 12;
  const std::uint32_t text_at = kDirectory + 2 + kFields * kField_B + 4;
  const auto text_B = static_cast<std::uint32_t>(description.size() + 1);
  const std::uint32_t strip_at = text_at + text_B + text_B % 2;  // on an even byte
  const auto w = static_cast<std::uint32_t>(width), h = static_cast<std::uint32_t>(height);
  const std::array<Field, kFields> fields{{
      {256, Type::u32, 1, w},
      {257, Type::u32, 1, h},
      {258, Type::u16, 1, 32},              // bits
      {259, Type::u16, 1, 8},               // deflate
      {262, Type::u16, 1, 1},               // the lowest value is black
      {270, Type::ascii, text_B, text_at},  // description
      {273, Type::u32, 1, strip_at},
      {274, Type::u16, 1, 1},  // row 0 on top, column 0 on the left
      {277, Type::u16, 1, 1},  // samples a pixel
      {278, Type::u32, 1, h},  // rows in the strip
      {279, Type::u32, 1, static_cast<std::uint32_t>(strip.size())},
      {284, Type::u16, 1, 1},  // samples of a pixel together
      {339, Type::u16, 1, 3},  // floats
  }};

  std::string file("II*\0", 4);
  append(file, kDirectory);
  append(file, static_cast<std::uint16_t>(kFields));
  for (const Field& field : fields) {
    append(file, field.tag);
    append(file, field.type);
    append(file, field.count);
    append(file, field.value);  // a 16-bit number lies in the first half
  }
  append(file, std::uint32_t{0});  // no further directory
  file += description;
  file.resize(strip_at);
  write_whole_file(path, file + strip);
}

}  // namespace xraycast
