#include "xraycast/simulation/script.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/catheter/hub.hpp"
#include "xraycast/coaxial/coil_pusher.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <sstream>
#include <string_view>

namespace xraycast {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> all;
  std::istringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) all.emplace_back(trimmed(cell));
  if (line.ends_with(',')) all.emplace_back();
  return all;
}

/// `insertion_mm` of the first instrument, `insertion_2_mm` of the second.
std::string column_of(std::size_t instrument, const char* quantity, const char* unit) {
  return instrument == 0 ? fmt::format("{}_{}", quantity, unit)
                         : fmt::format("{}_{}_{}", quantity, instrument + 1, unit);
}

std::string column_of_count(std::size_t instrument, const char* quantity) {
  return instrument == 0 ? quantity : fmt::format("{}_{}", quantity, instrument + 1);
}

/// The time, then each instrument's insertion and rotation.
std::vector<std::string> column_names(std::size_t instruments) {
  std::vector<std::string> names{"time_s"};
  for (std::size_t d = 0; d < instruments; ++d) {
    names.push_back(insertion_column(d));
    names.push_back(rotation_column(d));
  }
  return names;
}

std::string wanted_columns(const std::vector<std::string>& wanted) {
  const std::size_t instruments = (wanted.size() - 1) / 2;
  return fmt::format("a script{} has {} and, of balloons, {}, of stents in sheaths, {}, of coils, {}",
                     instruments > 1 ? fmt::format(" of {} instruments", instruments) : "",
                     fmt::join(wanted, ","), inflation_column(0), release_column(0), detach_column(0));
}

/// The instruments that a script's columns are for.
std::size_t instruments_in(const std::vector<std::string>& names) {
  std::size_t instruments = 1;
  while (std::ranges::find(names, column_names(instruments + 1).back()) != names.end()) ++instruments;
  return instruments;
}

bool is_of_treatment(const std::string& name, std::size_t instruments) {
  for (std::size_t d = 0; d < instruments; ++d)
    if (name == inflation_column(d) || name == release_column(d) || name == detach_column(d)) return true;
  return false;
}

/// Throws InputError for columns besides those wanted and those of balloons, stents and coils.
void check_others(const std::vector<std::string>& names, const std::vector<std::string>& wanted,
                  const std::string& origin) {
  if (const std::size_t instruments = instruments_in(names); wanted.size() < column_names(instruments).size())
    throw InputError(
        "{}: line 1: a script of {} instruments; give `instruments` for each, the outermost first", origin,
        instruments);
  for (auto name = names.begin(); name != names.end(); ++name) {
    if (std::find(names.begin(), name, *name) != name)
      throw InputError("{}: line 1: column {} twice; {}", origin, excerpt(*name), wanted_columns(wanted));
    if (std::ranges::find(wanted, *name) == wanted.end() && !is_of_treatment(*name, wanted.size() / 2))
      throw InputError("{}: line 1: unknown column \"{}\"; {}", origin, excerpt(*name),
                       wanted_columns(wanted));
  }
}

/// The index of each of the columns wanted, and of those of balloons, stents and coils.
struct Columns {
  std::vector<std::size_t> wanted;
  std::vector<std::optional<std::size_t>> inflations, releases, detachments;  ///< one an instrument
  std::size_t count = 0;
};
Columns columns(const std::string& header, const std::vector<std::string>& wanted,
                const std::string& origin) {
  std::string text = header;
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);  // the byte order mark that spreadsheets write
  const std::vector<std::string> names = cells(text);
  if (names.size() == 1 && text.find(';') != std::string::npos)
    throw InputError(
        "{}: line 1: semicolons; separate columns by commas, and write decimals with a point, not a comma",
        origin);
  Columns at{.wanted = {}, .inflations = {}, .releases = {}, .detachments = {}, .count = names.size()};
  for (const std::string& name : wanted) {
    const auto found = std::ranges::find(names, name);
    if (found == names.end())
      throw InputError("{}: line 1: no column {}; {}", origin, name, wanted_columns(wanted));
    at.wanted.push_back(static_cast<std::size_t>(found - names.begin()));
  }
  check_others(names, wanted, origin);
  const auto find = [&](const std::string& name) -> std::optional<std::size_t> {
    const auto found = std::ranges::find(names, name);
    if (found == names.end()) return {};
    return static_cast<std::size_t>(found - names.begin());
  };
  for (std::size_t d = 0; d < wanted.size() / 2; ++d) {
    at.inflations.push_back(find(inflation_column(d)));
    at.releases.push_back(find(release_column(d)));
    at.detachments.push_back(find(detach_column(d)));
  }
  return at;
}

double number(const std::string& cell, std::string_view column, const std::string& where) {
  if (cell.empty()) throw InputError("{}: {} is missing", where, column);
  double value = 0;
  if (!parse_whole(cell, value) || !std::isfinite(value))
    throw InputError("{}: {} is \"{}\", not a finite number", where, column, excerpt(cell));
  return value;
}

/// `line 3` of a file, or `row 2`.
std::string place_of(const std::vector<Script::Row>& rows, std::size_t row) {
  return rows[row].line > 0 ? fmt::format("line {}", rows[row].line) : fmt::format("row {}", row + 1);
}

/// Without an exponent where a reader would not expect one.
std::string plain(double value) {
  if (value < 1e5) return fmt::format("{:.6g}", value);
  return value < 1e9 ? fmt::format("{:.0f}", value) : fmt::format("{:.3g}", value);
}

/// Rounded up, so that what is given as the least suffices.
double rounded_up(double time_s) { return std::ceil(1e3 * time_s) / 1e3; }

/// `hub`: "the hub", or "hub 2".
void check_pace(const HubPose& from, const HubPose& to, double time_s, const std::string& where,
                const std::string& hub) {
  const double speed = std::abs(to.insertion_mm - from.insertion_mm) / time_s;
  const double turning = std::abs(to.rotation_rad - from.rotation_rad) / time_s;
  constexpr double kRounding = 1 + 1e-9;
  constexpr double kSaved = 1 + 1e-3;  // of live runs at that very pace, whose rows are rounded when saved
  const double inflating = std::abs(to.inflation_bar - from.inflation_bar) / time_s;
  const double releasing = (to.release_mm - from.release_mm) / time_s;
  const double least_s = rounded_up(
      time_s *
      std::max({speed / MovingHub::kMaxSpeed_mm_s, turning / MovingHub::kMaxSpeed_rad_s,
                inflating / MovingHub::kMaxInflation_bar_s, releasing / MovingHub::kMaxRelease_mm_s}) /
      kRounding);
  if (speed > MovingHub::kMaxSpeed_mm_s * kRounding)
    throw InputError("{}: {} would move at {} mm/s; the maximum is {} mm/s: give this motion at least {} s",
                     where, hub, plain(speed), MovingHub::kMaxSpeed_mm_s, plain(least_s));
  if (turning > MovingHub::kMaxSpeed_rad_s * kRounding)
    throw InputError(
        "{}: {} would turn at {} deg/s; the maximum is {:.0f} deg/s: give this motion at least {} s", where,
        hub, plain(turning / kRadians), MovingHub::kMaxSpeed_rad_s / kRadians, plain(least_s));
  if (inflating > MovingHub::kMaxInflation_bar_s * kSaved)
    throw InputError(
        "{}: the pressure at {} would change by {} bar/s; the maximum is {} bar/s: give this change at least "
        "{} s",
        where, hub, plain(inflating), MovingHub::kMaxInflation_bar_s, plain(least_s));
  if (releasing > MovingHub::kMaxRelease_mm_s * kSaved)
    throw InputError(
        "{}: the sheath at {} would be drawn back at {} mm/s; the maximum is {} mm/s: give this motion at "
        "least "
        "{} s",
        where, hub, plain(releasing), MovingHub::kMaxRelease_mm_s, plain(least_s));
  if (releasing < 0)
    throw InputError(
        "{}: the sheath at {} would go back over its stent, from {:g} to {:g} mm; leave it where it is",
        where, hub, from.release_mm, to.release_mm);
  if (to.detach < from.detach)
    throw InputError("{}: the coils detached at {} go back from {:g} to {:g}; the column counts all so far",
                     where, hub, from.detach, to.detach);
}

/// `names`: of the columns.
void check_row(const Script& script, std::size_t r, const std::vector<std::string>& names) {
  const Script::Row& row = script.rows()[r];
  const std::string where = script.where(r);
  if (row.time_s < 0) throw InputError("{}: time_s {} is below zero", where, row.time_s);
  if (row.time_s > Script::kMaxTime_s)
    throw InputError("{}: time_s {:g} is more than a day, {:g}; times are in seconds", where, row.time_s,
                     Script::kMaxTime_s);
  const std::size_t instruments = names.size() / 2;
  for (std::size_t d = 0; d < instruments; ++d)
    if (row.pose_of(d).insertion_mm < 0)
      throw InputError("{}: {} {} is below zero; at 0 the tip is at the vessel's end", where,
                       names[1 + 2 * d], row.pose_of(d).insertion_mm);
  for (std::size_t d = 0; d < instruments; ++d)
    if (row.pose_of(d).inflation_bar < 0)
      throw InputError("{}: {} {} is below zero; at 0 a balloon is folded", where, inflation_column(d),
                       row.pose_of(d).inflation_bar);
  for (std::size_t d = 0; d < instruments; ++d)
    if (row.pose_of(d).release_mm < 0)
      throw InputError("{}: {} {} is below zero; at 0 all of a stent is in its sheath", where,
                       release_column(d), row.pose_of(d).release_mm);
  for (std::size_t d = 0; d < instruments; ++d)
    if (const double count = row.pose_of(d).detach;
        !(count >= 0 && count <= CoilPusher::kMostDetached) || count != std::floor(count))
      throw InputError("{}: {} {:g} is no whole number of 0 to {:g}; it counts the coils detached so far",
                       where, detach_column(d), count, CoilPusher::kMostDetached);
  if (r == 0) return;
  const Script::Row& before = script.rows()[r - 1];
  if (!(row.time_s > before.time_s))
    throw InputError("{}: time_s {} is not later than {}, that of {}", where, row.time_s, before.time_s,
                     place_of(script.rows(), r - 1));
  for (std::size_t d = 0; d < instruments; ++d)
    check_pace(before.pose_of(d), row.pose_of(d), row.time_s - before.time_s, where,
               d == 0 ? "the hub" : fmt::format("hub {}", d + 1));
}

}  // namespace

std::string insertion_column(std::size_t instrument) { return column_of(instrument, "insertion", "mm"); }
std::string rotation_column(std::size_t instrument) { return column_of(instrument, "rotation", "deg"); }
std::string inflation_column(std::size_t instrument) { return column_of(instrument, "inflation", "bar"); }
std::string release_column(std::size_t instrument) { return column_of(instrument, "release", "mm"); }

std::string detach_column(std::size_t instrument) { return column_of_count(instrument, "detach"); }

Script Script::parse(const std::string& text, const std::string& origin, std::size_t instruments) {
  const std::vector<std::string> names = column_names(instruments);
  std::istringstream lines(text);
  std::string line;
  if (!std::getline(lines, line))
    throw InputError("{}: empty; a script starts with {}", origin, fmt::join(names, ","));
  const Columns at = columns(line, names, origin);

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
    if (values.size() != at.count)
      throw InputError("{}: {}, but the first line names {} columns", where,
                       pluralize(values.size(), "value"), at.count);
    Row row;
    row.line = number_of_line;
    row.time_s = number(values[at.wanted[0]], names[0], where);
    row.inner_poses.resize(instruments - 1);
    for (std::size_t d = 0; d < instruments; ++d) {
      HubPose& pose = d == 0 ? row.pose : row.inner_poses[d - 1];
      const std::size_t insertion = 1 + 2 * d, rotation = 2 + 2 * d;
      pose.insertion_mm = number(values[at.wanted[insertion]], names[insertion], where);
      pose.rotation_rad = kRadians * number(values[at.wanted[rotation]], names[rotation], where);
      if (const auto& column = at.inflations[d])
        pose.inflation_bar = number(values[*column], inflation_column(d), where);
      if (const auto& column = at.releases[d])
        pose.release_mm = number(values[*column], release_column(d), where);
      if (const auto& column = at.detachments[d])
        pose.detach = number(values[*column], detach_column(d), where);
    }
    rows.push_back(row);
  }
  if (rows.empty()) throw InputError("{}: no rows after the first line", origin);
  return of(std::move(rows), origin, instruments);
}

Script Script::of(std::vector<Row> rows, const std::string& origin, std::size_t instruments) {
  Script script(std::move(rows), origin);
  if (script.rows_.empty()) throw InputError("{}: no rows; give one at least", origin);
  const std::vector<std::string> names = column_names(instruments);
  for (std::size_t r = 0; r < script.rows_.size(); ++r) check_row(script, r, names);
  return script;
}

std::string Script::where(std::size_t row) const {
  return fmt::format("{}: {}", origin_, place_of(rows_, row));
}

Script Script::read(const std::filesystem::path& path, std::size_t instruments) {
  return with_remedy(path, "correct the script",
                     [&] { return parse(read_whole_file(path), path.string(), instruments); });
}

HubPose Script::pose_at(double time_s, std::size_t instrument) const {
  const auto after = std::ranges::upper_bound(rows_, time_s, {}, &Row::time_s);
  if (after == rows_.begin()) return rows_.front().pose_of(instrument);
  if (after == rows_.end()) return rows_.back().pose_of(instrument);
  const Row &from = *std::prev(after), &to = *after;
  const double fraction = (time_s - from.time_s) / (to.time_s - from.time_s);
  const HubPose &start = from.pose_of(instrument), &end = to.pose_of(instrument);
  return {std::lerp(start.insertion_mm, end.insertion_mm, fraction),
          std::lerp(start.rotation_rad, end.rotation_rad, fraction),
          std::lerp(start.inflation_bar, end.inflation_bar, fraction),
          std::lerp(start.release_mm, end.release_mm, fraction), start.detach};
}

}  // namespace xraycast
