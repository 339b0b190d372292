#include "xraycast/simulation/script.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/mechanics/catheter.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <sstream>
#include <string_view>

namespace xraycast {
namespace {

constexpr std::array<std::string_view, 3> kColumns{"time_s", "insertion_mm", "rotation_deg"};
constexpr double kRadians = std::numbers::pi / 180;

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> all;
  std::istringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) all.emplace_back(trimmed(cell));
  if (line.ends_with(',')) all.emplace_back();
  return all;
}

/// The index of each of kColumns.
std::array<std::size_t, 3> columns(const std::string& header, const std::string& origin) {
  std::string text = header;
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);  // the byte order mark that spreadsheets write
  const std::vector<std::string> names = cells(text);
  std::array<std::size_t, 3> at{};
  for (std::size_t c = 0; c < kColumns.size(); ++c) {
    const auto found = std::ranges::find(names, kColumns[c]);
    if (found == names.end())
      throw InputError("{}: line 1: no column {}; a script has time_s,insertion_mm,rotation_deg", origin,
                       kColumns[c]);
    at[c] = static_cast<std::size_t>(found - names.begin());
  }
  if (names.size() != kColumns.size())
    throw InputError("{}: line 1: {}; a script has time_s,insertion_mm,rotation_deg", origin,
                     pluralize(names.size(), "column"));
  return at;
}

double number(const std::string& cell, std::string_view column, const std::string& where) {
  if (cell.empty()) throw InputError("{}: {} is missing", where, column);
  double value = 0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc() || end != cell.data() + cell.size() || !std::isfinite(value))
    throw InputError("{}: {} is \"{}\", not a finite number", where, column, cell);
  return value;
}

void check_pace(const Script::Row& from, const Script::Row& to, const std::string& where) {
  const double time_s = to.time_s - from.time_s;
  if (!(time_s > 0))
    throw InputError("{}: time_s {} is not later than {}, that of line {}", where, to.time_s, from.time_s,
                     from.line);
  const double speed = std::abs(to.pose.insertion_mm - from.pose.insertion_mm) / time_s;
  const double turning = std::abs(to.pose.rotation_rad - from.pose.rotation_rad) / time_s;
  constexpr double kRounding = 1 + 1e-9;
  if (speed > Catheter::kMaxSpeed_mm_s * kRounding)
    throw InputError("{}: the hub would move at {:.4g} mm/s; the maximum is {} mm/s", where, speed,
                     Catheter::kMaxSpeed_mm_s);
  if (turning > Catheter::kMaxSpeed_rad_s * kRounding)
    throw InputError("{}: the hub would turn at {:.4g} deg/s; the maximum is {:.4g} deg/s", where,
                     turning / kRadians, Catheter::kMaxSpeed_rad_s / kRadians);
}

}  // namespace

Script Script::parse(const std::string& text, const std::string& origin) {
  std::istringstream lines(text);
  std::string line;
  if (!std::getline(lines, line))
    throw InputError("{}: empty; a script starts with time_s,insertion_mm,rotation_deg", origin);
  const std::array<std::size_t, 3> at = columns(line, origin);

  std::vector<Row> rows;
  int number_of_line = 1, blank_line = 0;
  while (std::getline(lines, line)) {
    ++number_of_line;
    const std::string where = fmt::format("{}: line {}", origin, number_of_line);
    if (trimmed(line).empty()) {
      if (blank_line == 0) blank_line = number_of_line;
      continue;
    }
    if (blank_line > 0)
      throw InputError("{}: line {}: a blank line between rows; remove it", origin, blank_line);
    const std::vector<std::string> values = cells(line);
    if (values.size() != kColumns.size())
      throw InputError("{}: {}, but there are {} columns", where, pluralize(values.size(), "value"),
                       kColumns.size());
    Row row;
    row.line = number_of_line;
    row.time_s = number(values[at[0]], kColumns[0], where);
    row.pose.insertion_mm = number(values[at[1]], kColumns[1], where);
    row.pose.rotation_rad = kRadians * number(values[at[2]], kColumns[2], where);
    if (row.time_s < 0) throw InputError("{}: time_s {} is below zero", where, row.time_s);
    if (row.time_s > kMaxTime_s)
      throw InputError("{}: time_s {:g} is more than a day, {:g}; times are in seconds", where, row.time_s,
                       kMaxTime_s);
    if (row.pose.insertion_mm < 0)
      throw InputError("{}: insertion_mm {} is below zero; at 0 the tip is at the vessel's end", where,
                       row.pose.insertion_mm);
    if (!rows.empty()) check_pace(rows.back(), row, where);
    rows.push_back(row);
  }
  if (rows.empty()) throw InputError("{}: no rows after the first line", origin);
  return Script(std::move(rows));
}

Script Script::read(const std::filesystem::path& path) {
  return with_remedy(path, "correct the script", [&] { return parse(read_whole_file(path), path.string()); });
}

HubPose Script::pose_at(double time_s) const {
  const auto after = std::ranges::upper_bound(rows_, time_s, {}, &Row::time_s);
  if (after == rows_.begin()) return rows_.front().pose;
  if (after == rows_.end()) return rows_.back().pose;
  const Row &from = *std::prev(after), &to = *after;
  const double fraction = (time_s - from.time_s) / (to.time_s - from.time_s);
  return {std::lerp(from.pose.insertion_mm, to.pose.insertion_mm, fraction),
          std::lerp(from.pose.rotation_rad, to.pose.rotation_rad, fraction)};
}

}  // namespace xraycast
