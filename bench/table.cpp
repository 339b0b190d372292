#include "table.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <fstream>

namespace xraycast::bench {

std::optional<double> ratio(const Row& row, const Times& times) {
  if (!times.contains(row.baseline)) return std::nullopt;
  const double value = times.at(row.name), baseline = times.at(row.baseline);
  return row.bar == Row::Bar::at_least ? baseline / value : value / baseline;
}

void print_table(const std::vector<Row>& rows, const Times& times) {
  fmt::print("\n{:<24} {:>11}  {:<28} {:>11} {:>8}  {}\n", "name", "value", "baseline", "", "ratio", "limit");
  for (const Row& row : rows) {
    if (!times.contains(row.name)) continue;
    const std::optional<double> r = ratio(row, times);
    std::string verdict = "reported";
    if (row.bar != Row::Bar::reported && r) {
      const bool met = row.bar == Row::Bar::at_most ? *r <= row.limit : *r >= row.limit;
      verdict = fmt::format("{} {:g}: {}", row.bar == Row::Bar::at_most ? "<=" : ">=", row.limit,
                            met ? "met" : "missed");
    }
    fmt::print("{:<24} {:>8.2f} ms  {:<28} {:>8} {:>11}  {}\n", row.name, times.at(row.name), row.baseline,
               r ? fmt::format("{:.2f} ms", times.at(row.baseline)) : "", r ? fmt::format("{:.3f}", *r) : "",
               verdict);
  }
}

void write_json(const std::vector<Row>& rows, const Times& times, const std::string& path) {
  nlohmann::ordered_json list = nlohmann::json::array();
  for (const Row& row : rows) {
    if (!times.contains(row.name)) continue;
    const std::optional<double> r = ratio(row, times);
    list.push_back({{"name", row.name},
                    {"value_ms", times.at(row.name)},
                    {"baseline", row.baseline},
                    {"baseline_ms", r ? nlohmann::json(times.at(row.baseline)) : nlohmann::json()},
                    {"ratio", r ? nlohmann::json(*r) : nlohmann::json()}});
  }
  std::ofstream(path) << list.dump(2) << '\n';
}

}  // namespace xraycast::bench
