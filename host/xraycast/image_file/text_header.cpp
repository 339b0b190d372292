#include "xraycast/image_file/text_header.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <sstream>

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

/// All fields of NRRD.
constexpr std::array kNrrdFields{"axis maxs",
                                 "axis mins",
                                 "block size",
                                 "byte skip",
                                 "centerings",
                                 "centers",
                                 "content",
                                 "data file",
                                 "dimension",
                                 "encoding",
                                 "endian",
                                 "kinds",
                                 "labels",
                                 "line skip",
                                 "max",
                                 "measurement frame",
                                 "min",
                                 "number",
                                 "old max",
                                 "old min",
                                 "sample units",
                                 "sizes",
                                 "space",
                                 "space dimension",
                                 "space directions",
                                 "space origin",
                                 "space units",
                                 "spacings",
                                 "thicknesses",
                                 "type",
                                 "units"};

/// A field's name as kNrrdFields has it, whose blanks may be left out; null for any other name.
const char* nrrd_field(std::string_view name) {
  const std::string lower = lower_case(name);
  const auto is_it = [&](std::string known) {
    if (known == lower) return true;
    std::erase(known, ' ');
    return known == lower;
  };
  const auto* const found = std::ranges::find_if(kNrrdFields, is_it);
  return found == kNrrdFields.end() ? nullptr : *found;
}

}  // namespace

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

std::string_view number_in(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  if (word.ends_with(',')) word.remove_suffix(1);
  return word;
}

const std::string& TextHeader::get(const std::string& field) const {
  static const std::string none;
  const auto found = fields.find(field);
  return found == fields.end() ? none : found->second;
}

std::vector<double> TextHeader::finite(const char* field, std::size_t count,
                                       std::vector<double> otherwise) const {
  std::vector<double> values = numbers(field, count, std::move(otherwise));
  for (const double value : values)
    if (!std::isfinite(value))
      throw InputError("{}: {} holds {}; export the file again", path.string(), field, value);
  return values;
}

TextHeader read_nrrd_header(const std::filesystem::path& path) {
  const std::string text = leading_text(path);
  std::string_view left = text;
  TextHeader header;
  header.path = path;
  const auto fail = [&](std::string_view line, const char* fault) {
    throw InputError("{}: the line '{}' {}, so the header is damaged; export the file again", path.string(),
                     excerpt(line), fault);
  };
  const std::string_view magic = trimmed(take_line(left));
  if (magic.size() != 8 || magic < "NRRD0001" || magic > "NRRD0005")
    fail(magic, "is none of NRRD0001 to NRRD0005");
  while (!left.empty()) {
    std::string_view line = take_line(left);
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty()) break;
    if (line[0] == '#') continue;
    const auto colon = line.find(": ");
    const char* const field = colon == std::string_view::npos ? nullptr : nrrd_field(line.substr(0, colon));
    if (field == nullptr && line.find(":=") == std::string_view::npos) fail(line, "is no field");
    if (field == nullptr) continue;
    if (!header.fields.emplace(field, trimmed(line.substr(colon + 2))).second) fail(line, "repeats a field");
  }
  header.end_B = std::ssize(text) - std::ssize(left);
  if (header.end_B == kMaxHeader_B)
    throw InputError("{}: its header is longer than a mebibyte or truncated; export the file again",
                     path.string());
  return header;
}

TextHeader read_meta_image_header(const std::filesystem::path& path) {
  const std::string text = leading_text(path);
  TextHeader header;
  header.path = path;
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
