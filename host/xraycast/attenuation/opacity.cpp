#include "xraycast/attenuation/opacity.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/volume/volume.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>

namespace xraycast {
namespace {

constexpr double kPaperWater_per_mm = 0.02;

void validate(const std::string& name, const std::vector<Opacity::Knot>& knots) {
  if (knots.empty() || knots.size() > Opacity::kMaxKnots)
    throw InputError("{}: knots has {} entries, but must have 1 to {}", name, knots.size(),
                     Opacity::kMaxKnots);
  for (std::size_t i = 0; i < knots.size(); ++i) {
    const auto [hu, mu] = knots[i];
    if (!(hu >= kPaddingHu && hu <= kMaxHu))
      throw InputError("{}: knots[{}] is at {} HU, outside {} to {}", name, i, hu, kPaddingHu, kMaxHu);
    if (!std::isfinite(mu) || mu < 0)
      throw InputError("{}: knots[{}] has mu = {} /mm, which must be finite and not negative", name, i, mu);
    if (i > 0 && hu <= knots[i - 1].hu)
      throw InputError("{}: knots[{}] at {} HU is not above the one before it, {} HU; sort the knots", name,
                       i, hu, knots[i - 1].hu);
  }
}

}  // namespace

Opacity::Opacity(std::string name, std::vector<Knot> knots)
    : name_(std::move(name)), knots_(std::move(knots)) {
  validate("opacity " + name_, knots_);
}

Opacity Opacity::paper() {
  return {"paper", {{-1024, 0}, {kMaxHu, kPaperWater_per_mm * (kMaxHu / 1024.0 + 1)}}};
}

Opacity Opacity::subtracted() {
  return {"subtracted", {{0, 0}, {kMaxHu, kPaperWater_per_mm * kMaxHu / 1024}}};
}

Opacity Opacity::bilinear() {
  constexpr double kWater_per_mm = 0.0192, kBone_per_mm = 0.0573;
  const double above = kBone_per_mm + (kBone_per_mm - kWater_per_mm) / 1000 * (kMaxHu - 1000);
  return {"bilinear", {{-1000, 0}, {0, kWater_per_mm}, {1000, kBone_per_mm}, {kMaxHu, above}}};
}

Opacity Opacity::from_json(const std::string& text, const std::string& origin) {
  const auto json = parse_json(text, origin);
  if (!json.is_object())
    throw InputError("{}: not a JSON object; an opacity holds a name, a unit and knots", origin);
  if (const auto unit = json.find("unit"); unit != json.end() && *unit != "1/mm")
    throw InputError("{}: unit is {}, but must be \"1/mm\"", origin, excerpt(unit->dump()));
  const auto knots = json.find("knots");
  if (knots == json.end() || !knots->is_array())
    throw InputError("{}: knots is missing; it is a list of [HU, mu in 1/mm] pairs", origin);
  std::vector<Knot> parsed;
  for (const auto& knot : *knots) {
    if (!knot.is_array() || knot.size() != 2 || !knot[0].is_number() || !knot[1].is_number())
      throw InputError("{}: knots[{}] is not a pair [HU, mu in 1/mm]", origin, parsed.size());
    parsed.push_back({knot[0].get<double>(), knot[1].get<double>()});
  }
  validate(origin, parsed);
  return {json.value("name", nlohmann::json("custom")).is_string() ? json.value("name", "custom") : "custom",
          std::move(parsed)};
}

Opacity Opacity::named(const std::string& name_or_file) {
  if (name_or_file == "paper") return paper();
  if (name_or_file == "bilinear") return bilinear();
  if (name_or_file == "subtracted") return subtracted();
  std::error_code error;
  if (!std::filesystem::is_regular_file(name_or_file, error))
    throw InputError("{}: unknown opacity; give paper, bilinear, subtracted or a readable JSON file",
                     excerpt(name_or_file));
  return with_remedy(name_or_file, "correct the file",
                     [&] { return from_json(read_whole_file(name_or_file), name_or_file); });
}

std::string Opacity::to_json() const {
  nlohmann::ordered_json json{{"name", name_}, {"unit", "1/mm"}, {"knots", nlohmann::json::array()}};
  for (const Knot& knot : knots_) json["knots"].push_back({knot.hu, knot.mu_per_mm});
  return json.dump();
}

double Opacity::mu_per_mm(double hu) const {
  const auto above = std::ranges::upper_bound(knots_, hu, {}, &Knot::hu);
  if (above == knots_.begin()) return knots_.front().mu_per_mm;
  if (above == knots_.end()) return knots_.back().mu_per_mm;
  const Knot &a = *std::prev(above), &b = *above;
  return std::lerp(a.mu_per_mm, b.mu_per_mm, (hu - a.hu) / (b.hu - a.hu));
}

}  // namespace xraycast
