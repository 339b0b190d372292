#pragma once

#include "xraycast/base/picture_file.hpp"

#include <glm/vec2.hpp>

#include <map>
#include <memory>
#include <openexr.h>
#include <variant>

namespace xraycast {

// What is written and read without OpenImageIO: PNG (see picture_file.hpp), and OpenEXR for maps and optical
// depths. Loading OpenImageIO takes four times as long as drawing a frame of a map, and it needs 260
// libraries of Debian, some under the GPL, which a Python wheel cannot carry.

/// A PNG's pixels, on black where they are transparent. Throws Error without the file's name when it cannot
/// be read or does not fit into memory.
RgbPicture read_png_file(const std::filesystem::path& path);

/// The same of a PNG's numbers, of 8 or 16 bits, as read_grey_picture. Throws InputError without the file's
/// name.
FloatPicture read_grey_png(const std::filesystem::path& path);

/// One picture of an OpenEXR file.
struct ExrPart {
  std::string name{};  ///< different in each part; may be empty in a file of one part
  int width = 0, height = 0;
  int first_row = 0, all_rows = 0;  ///< of a picture of which only these rows are stored; 0: all
  bool is_half = false;             ///< stored as 16-bit floats, to which values are rounded
  bool is_packed_by_row = false;    ///< else 16 rows at a time
  std::map<std::string, std::span<const float>> channels{};  ///< each W x H, row 0 on top
  std::map<std::string, std::variant<int, std::string>> attributes{};
};

/// Writes scan-line parts, compressed losslessly, through an AtomicFile. The same parts make the same bytes.
/// Throws InputError when `path` cannot be written, Error when the disk is full.
void write_exr(std::span<const ExrPart> parts, const std::filesystem::path& path);

/// Whether a file begins as OpenEXR files do. Throws InputError when it cannot be opened.
bool is_exr(const std::filesystem::path& path);

/// An OpenEXR file of scan-line parts, open for reading. Several threads may read from one.
class ExrReader {
 public:
  /// Reads the headers. Throws InputError when the file cannot be opened, is damaged, or claims more pixels
  /// than it can hold; so memory may be allocated for its sizes.
  explicit ExrReader(const std::filesystem::path& path);

  int parts() const;
  glm::ivec2 size(int part) const;  ///< width and height

  /// An attribute of the first part; empty or 0 when there is none of that type.
  std::string text(const std::string& attribute) const;
  int number(const std::string& attribute) const;

  /// Reads a part whose channels are those of `targets`, of W x H values each, stored as 16-bit or 32-bit
  /// floats. Throws InputError when it has others or the file is damaged.
  void read(int part, bool is_half, const std::map<std::string, std::span<float>>& targets) const;

 private:
  struct Finish {
    void operator()(exr_context_t context) const { exr_finish(&context); }
  };
  void check(exr_result_t result) const;
  exr_attr_box2i_t window(int part) const;
  std::span<const exr_attr_chlist_entry_t> channels(int part) const;
  const exr_attribute_t* attribute(const std::string& name, exr_attribute_type_t type) const;

  std::string name_;
  std::unique_ptr<std::remove_pointer_t<exr_context_t>, Finish> context_;
};

}  // namespace xraycast
