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

namespace {

std::string verdict_of(const Row& row, const Times& times, double ratio) {
  const char* const words[] = {"missed", "met"};
  switch (row.bar) {
    case Row::Bar::at_most:
      return fmt::format("<= {:g}: {}", row.limit, words[ratio <= row.limit]);
    case Row::Bar::at_least:
      return fmt::format(">= {:g}: {}", row.limit, words[ratio >= row.limit]);
    case Row::Bar::at_most_more_ms: {
      const double more_ms = times.at(row.name) - times.at(row.baseline);
      return fmt::format("{:+.2f} ms, <= {:+g} ms: {}", more_ms, row.limit, words[more_ms <= row.limit]);
    }
    case Row::Bar::reported:
      break;
  }
  return "reported";
}

}  // namespace

void print_table(const std::vector<Row>& rows, const Times& times) {
  fmt::print("\n{:<24} {:>11}  {:<28} {:>11} {:>8}  {}\n", "name", "value", "baseline", "", "ratio", "limit");
  for (const Row& row : rows) {
    if (!times.contains(row.name)) continue;
    const std::optional<double> r = ratio(row, times);
    const std::string verdict = r ? verdict_of(row, times, *r) : "reported";
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
