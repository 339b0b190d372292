#include "xraycast/geometry/branch_names.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/base/whole_file.hpp"

#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <optional>
#include <set>

namespace xraycast {
namespace {

constexpr std::size_t kLongestName = 80;

/// As names are compared.
std::string plain_name(std::string_view name) {
  std::string plain = lower_case(trimmed(name));
  std::replace(plain.begin(), plain.end(), '_', ' ');
  return plain;
}

/// "aorta, left renal artery", each once; at most twenty.
std::string names_in(const VesselTree& tree) {
  std::set<std::string> names;
  for (const VesselBranch& branch : tree.branches())
    if (!branch.name.empty()) names.insert(branch.name);
  if (names.empty()) return "its branches have no names; give a number";
  constexpr std::size_t kMost = 20;
  const std::vector<std::string> listed(
      names.begin(), std::next(names.begin(), static_cast<std::ptrdiff_t>(std::min(kMost, names.size()))));
  return fmt::format("it has {}{}", fmt::join(listed, ", "), names.size() > kMost ? ", and others" : "");
}

std::size_t branch_at(const VesselTree& tree, const nlohmann::json& at_mm, const std::string& field) {
  if (!at_mm.is_array() || at_mm.size() != 3 ||
      !std::all_of(at_mm.begin(), at_mm.end(),
                   [](const nlohmann::json& number) { return number.is_number(); }))
    throw InputError("{}: \"at_mm\" is [x, y, z], not {}", field, excerpt(at_mm.dump()));
  const VesselTree::Location place =
      tree.nearest({at_mm[0].get<double>(), at_mm[1].get<double>(), at_mm[2].get<double>()});
  constexpr double kTolerance_mm = 20;
  if (!(place.distance_mm <= kTolerance_mm))
    throw InputError("{}: \"at_mm\" lies {:.0f} mm from the nearest branch, more than {:g}", field,
                     place.distance_mm, kTolerance_mm);
  return static_cast<std::size_t>(place.branch);
}

std::size_t branch_numbered(const VesselTree& tree, const nlohmann::json& branch, const std::string& field) {
  const auto number = whole_number(branch);
  if (!number || *number < 0 || *number >= std::ssize(tree.branches()))
    throw InputError("{}: \"branch\" {} does not exist; the tree has branches 0 to {}", field,
                     excerpt(branch.dump()), tree.branches().size() - 1);
  return static_cast<std::size_t>(*number);
}

}  // namespace

std::filesystem::path names_beside(const std::filesystem::path& tree) {
  constexpr std::string_view kTree = "tree";
  const std::string stem = tree.stem().string();
  if (!stem.starts_with(kTree)) return {};
  return tree.parent_path() / ("names" + stem.substr(kTree.size()) + ".json");
}

void check_vessel_name(const std::string& name, const std::string& field) {
  if (name.size() > kLongestName)
    throw InputError("{}: the name \"{}\" has more than {} bytes; shorten it", field, excerpt(name),
                     kLongestName);
  if (name != printable_line(name))
    throw InputError("{}: the name \"{}\" has control characters; remove them", field, excerpt(name));
}

std::string vessel_name(const nlohmann::json& value, const std::string& field) {
  if (!value.is_string()) throw InputError("{}: \"name\" is not text", field);
  std::string name(trimmed(value.get_ref<const std::string&>()));
  check_vessel_name(name, field);
  return name;
}

std::string vessel_name_of(std::string_view text) {
  const std::string line = printable_line(text);
  std::string name(trimmed(line));
  const auto is_letter = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || static_cast<unsigned char>(c) >= 0x80;
  };
  if (std::none_of(name.begin(), name.end(), is_letter)) return {};
  std::size_t end = std::min(name.size(), kLongestName);
  while (end < name.size() && (name[end] & 0xC0) == 0x80) --end;  // within a letter of UTF-8
  return name.substr(0, end);
}

VesselTree read_names(const VesselTree& tree, const std::filesystem::path& path) {
  const std::string file = path.string();
  const nlohmann::json document = parse_edited_json(read_whole_file(path), file);
  if (!document.is_object() || !document.contains("names") || !document["names"].is_array())
    throw InputError("{}: \"names\" is not a list; correct or delete the file", file);
  std::vector<std::string> names;
  for (const VesselBranch& branch : tree.branches()) names.push_back(branch.name);
  for (const nlohmann::json& entry : document["names"]) {
    const std::string field = fmt::format("{}: {}", file, excerpt(entry.dump()));
    if (!entry.is_object() || !entry.contains("name") || entry.contains("branch") == entry.contains("at_mm"))
      throw InputError("{}: an entry has \"name\", and either \"branch\" or \"at_mm\"", field);
    const std::size_t branch = entry.contains("branch") ? branch_numbered(tree, entry["branch"], field)
                                                        : branch_at(tree, entry["at_mm"], field);
    names[branch] = vessel_name(entry["name"], field);
  }
  return with_branch_names(tree, names);
}

void write_names(const VesselTree& tree, const std::filesystem::path& path) {
  std::string text = "{\"names\": [";
  for (std::size_t i = 0; i < tree.branches().size(); ++i)
    text += fmt::format("{}\n  {{\"branch\": {}, \"name\": {}}}", i > 0 ? "," : "", i,
                        nlohmann::json(tree.branches()[i].name).dump());
  write_whole_file(path, text + "\n]}\n");
}

VesselTree with_branch_names(const VesselTree& tree, const std::vector<std::string>& names) {
  std::vector<VesselBranch> branches = tree.branches();
  for (std::size_t i = 0; i < branches.size(); ++i) branches[i].name = names.at(i);
  return VesselTree(std::move(branches), "the named tree");
}

std::vector<int> branches_named(const VesselTree& tree, std::string_view name, const std::string& field) {
  std::vector<int> found;
  for (std::size_t i = 0; i < tree.branches().size(); ++i)
    if (!tree.branches()[i].name.empty() && plain_name(tree.branches()[i].name) == plain_name(name))
      found.push_back(static_cast<int>(i));
  if (found.empty()) throw InputError("{}: no branch of the tree has this name; {}", field, names_in(tree));
  return found;
}

}  // namespace xraycast
