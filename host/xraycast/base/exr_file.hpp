#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace xraycast {

enum class ExrCompression {
  zip,   ///< 16 rows at a time
  zips,  ///< row by row
};

/// How a channel's values are stored.
enum class ExrPixel {
  float32,
  float16,  ///< values are rounded to 16-bit floats
};

/// A channel of floats: W x H, row 0 on top.
struct ExrChannel {
  std::string name;
  std::span<const float> values;
  ExrPixel pixel = ExrPixel::float32;
};

/// One picture of an OpenEXR file.
struct ExrPart {
  std::string name{};  ///< different in each part; may be empty in a file of one part
  int width = 0, height = 0;
  ExrCompression compression = ExrCompression::zip;
  std::vector<ExrChannel> channels{};
  std::map<std::string, std::variant<int, std::string>> attributes{};
};

/// Writes scan-line parts, compressed losslessly, through an AtomicFile. The same parts make the same bytes.
/// Throws InputError when `path` cannot be written, Error when the disk is full.
void write_exr(std::span<const ExrPart> parts, const std::filesystem::path& path);

/// Whether a file begins as OpenEXR files do. Throws InputError when it cannot be opened.
bool is_exr(const std::filesystem::path& path);

/// Where `ExrReader::read` puts a channel: W x H floats.
struct ExrTarget {
  std::string channel;
  std::span<float> values;
  ExrPixel pixel = ExrPixel::float32;  ///< as the channel must be stored
};

/// An OpenEXR file of scan-line parts, open for reading. Several threads may read from one.
class ExrReader {
 public:
  /// Reads the headers. Throws InputError when the file cannot be opened, is damaged, or claims more pixels
  /// than it can hold; so memory may be allocated for its sizes.
  explicit ExrReader(const std::filesystem::path& path);
  ~ExrReader();
  ExrReader(const ExrReader&) = delete;
  ExrReader& operator=(const ExrReader&) = delete;

  int parts() const;
  int width(int part) const;
  int height(int part) const;

  /// An attribute of the first part; none when there is none of that type.
  std::optional<std::string> text(const std::string& attribute) const;
  std::optional<int> number(const std::string& attribute) const;

  /// Reads a part whose channels are those of `targets`, in any order. Throws InputError when it has others,
  /// when they are stored as other numbers, or when the file is damaged.
  void read(int part, std::span<const ExrTarget> targets) const;

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace xraycast
