#include "xraycast/image_file/text_header.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"

#include <fstream>

namespace xraycast {
namespace {

constexpr std::int64_t kMaxHeader_B = 1 << 20;

std::string leading_text(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::string text(static_cast<std::size_t>(kMaxHeader_B), '\0');
  stream.read(text.data(), kMaxHeader_B);
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return text;
}

}  // namespace

const std::string& TextHeader::get(const std::string& name) const {
  static const std::string none;
  const auto field = fields.find(name);
  return field == fields.end() ? none : field->second;
}

TextHeader read_nrrd_header(const std::filesystem::path& path) {
  const std::string text = leading_text(path);
  TextHeader header;
  std::string_view left = text;
  while (!left.empty()) {
    const std::string_view line = trimmed(take_line(left));
    if (line.empty()) break;
    const auto colon = line.find(':');
    if (line[0] == '#' || colon == std::string_view::npos || line.substr(colon).starts_with(":=")) continue;
    header.fields[lower_case(trimmed(line.substr(0, colon)))] = trimmed(line.substr(colon + 1));
  }
  header.end_B = std::ssize(text) - std::ssize(left);
  if (header.end_B == kMaxHeader_B)
    throw InputError("{}: its header is truncated; export the file again", path.string());
  return header;
}

TextHeader read_meta_image_header(const std::filesystem::path& path) {
  const std::string text = leading_text(path);
  TextHeader header;
  std::string_view left = text;
  while (!left.empty()) {
    const std::string_view line = take_line(left);
    const auto equals = line.find('=');
    if (equals == std::string_view::npos) continue;
    const std::string name(trimmed(line.substr(0, equals)));
    header.fields[name] = trimmed(line.substr(equals + 1));
    if (name != "ElementDataFile") continue;
    header.end_B = std::ssize(text) - std::ssize(left);
    if (header.fields[name].starts_with("LIST"))
      while (!left.empty())
        if (const std::string_view file = trimmed(take_line(left)); !file.empty())
          header.rest.emplace_back(file);
    return header;
  }
  throw InputError("{}: ElementDataFile is missing; export the file again", path.string());
}

}  // namespace xraycast
