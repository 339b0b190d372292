#include "xraycast/given_vessels/structure_labels.hpp"

#include "xraycast/geometry/branch_names.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

namespace xraycast {
namespace {

struct Label {
  int number;
  std::string_view name;
};

// wasserth/TotalSegmentator, class map of the task `total`, version 2.
constexpr std::array kVessels{Label{52, "aorta"},
                              Label{53, "pulmonary_vein"},
                              Label{54, "brachiocephalic_trunk"},
                              Label{55, "subclavian_artery_right"},
                              Label{56, "subclavian_artery_left"},
                              Label{57, "common_carotid_artery_right"},
                              Label{58, "common_carotid_artery_left"},
                              Label{59, "brachiocephalic_vein_left"},
                              Label{60, "brachiocephalic_vein_right"},
                              Label{62, "superior_vena_cava"},
                              Label{63, "inferior_vena_cava"},
                              Label{64, "portal_vein_and_splenic_vein"},
                              Label{65, "iliac_artery_left"},
                              Label{66, "iliac_artery_right"},
                              Label{67, "iliac_vena_left"},
                              Label{68, "iliac_vena_right"}};

}  // namespace

std::optional<int> vessel_label(std::string_view name) {
  const auto found = std::ranges::find(kVessels, name, &Label::name);
  if (found == kVessels.end()) return std::nullopt;
  return found->number;
}

std::string_view vessel_name(int label) {
  const auto found = std::ranges::find(kVessels, label, &Label::number);
  return found == kVessels.end() ? std::string_view() : found->name;
}

std::string name_of_structure(std::string_view name) {
  constexpr std::string_view kOfFiles = "mask_";  // as in mask_aorta.nii.gz
  if (name.starts_with(kOfFiles)) name.remove_prefix(kOfFiles.size());
  std::string words(name);
  std::ranges::replace(words, '_', ' ');
  for (const std::string_view side : {" left", " right"})
    if (words.ends_with(side))
      words = std::string(side.substr(1)) + " " + words.substr(0, words.size() - side.size());
  if (const auto vena = words.find("iliac vena"); vena != std::string::npos)
    words.replace(vena, 10, "iliac vein");
  return vessel_name_of(words);
}

std::string vessel_label_names() {
  std::vector<std::string_view> names;
  for (const Label& label : kVessels) names.push_back(label.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace xraycast
