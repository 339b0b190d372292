#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/centrelines/stored_centrelines.hpp"
#include "xraycast/geometry/text_lines.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <unordered_map>
#include <vector>

namespace xraycast {
namespace {

/// What a column may hold.
enum class CsvColumn { x, y, z, right, anterior, left, posterior, superior, radius, diameter, branch, other };

constexpr std::array<std::pair<std::string_view, CsvColumn>, 23> kCsvColumns = {
    {{"x", CsvColumn::x},
     {"y", CsvColumn::y},
     {"z", CsvColumn::z},
     {"points:0", CsvColumn::x},  // ParaView's
     {"points:1", CsvColumn::y},
     {"points:2", CsvColumn::z},
     {"points_0", CsvColumn::x},
     {"points_1", CsvColumn::y},
     {"points_2", CsvColumn::z},
     {"r", CsvColumn::right},  // 3D Slicer's
     {"a", CsvColumn::anterior},
     {"l", CsvColumn::left},
     {"p", CsvColumn::posterior},
     {"s", CsvColumn::superior},
     {"radius", CsvColumn::radius},
     {"maximuminscribedsphereradius", CsvColumn::radius},
     {"diameter", CsvColumn::diameter},
     {"branch", CsvColumn::branch},
     {"branch_id", CsvColumn::branch},
     {"line", CsvColumn::branch},
     {"line_id", CsvColumn::branch},
     {"vessel", CsvColumn::branch},
     {"vessel_id", CsvColumn::branch}}};

class CentrelineCsv {
 public:
  CentrelineCsv(std::string_view text, std::string name) : lines_(text, std::move(name)) {}

  StoredCentrelines read() {
    for (auto line = lines_.next(); line; line = lines_.next()) {
      if (line->empty() || line->starts_with('#')) continue;
      if (columns_.empty())
        read_header(*line);
      else
        read_row(*line);
    }
    if (columns_.empty()) lines_.fail("the file has no header");
    return std::move(stored_);
  }

 private:
  void read_header(std::string_view line) {
    if (line.starts_with("\xef\xbb\xbf")) line.remove_prefix(3);  // how a text in UTF-8 may begin
    for (const char separator : {',', ';', '\t', ' '})
      if (line.find(separator_ = separator) != std::string_view::npos) break;
    for (const std::string_view cell : cells(line)) columns_.push_back(column_named(cell));
    set_axes();
  }

  /// Without a unit: x_mm, X (mm) and X [mm] are x.
  CsvColumn column_named(std::string_view cell) const {
    std::string name = lower_case(cell);
    for (const char* const unit : {"_mm", "(mm)", "[mm]", " mm"})
      if (name.ends_with(unit)) name.resize(name.size() - std::string_view(unit).size());
    name = trimmed(name);
    for (const char* const unit : {"_cm", "(cm)", "[cm]", "_um", "(um)", "[um]", "_m", "(m)", "[m]"})
      if (name.ends_with(unit)) {
        const std::string_view base =
            trimmed(std::string_view(name).substr(0, name.size() - std::string_view(unit).size()));
        if (known(base) == CsvColumn::other) return CsvColumn::other;
        lines_.fail("the column \"{}\" is not in mm; leave its unit out and give `unit`", excerpt(cell));
      }
    return known(name);
  }

  static CsvColumn known(std::string_view name) {
    const auto* const found =
        std::ranges::find(kCsvColumns, name, &std::pair<std::string_view, CsvColumn>::first);
    return found == kCsvColumns.end() ? CsvColumn::other : found->second;
  }

  void set_axes() {
    const auto has = [&](CsvColumn column) { return std::ranges::count(columns_, column) == 1; };
    const auto all = [&](const std::array<CsvColumn, 3>& axes) { return std::ranges::all_of(axes, has); };
    using enum CsvColumn;
    if (all({x, y, z})) {
      axes_ = {x, y, z};
      if (has(right) && !has(radius)) std::ranges::replace(columns_, right, radius);
    } else if (all({left, posterior, superior})) {
      axes_ = {left, posterior, superior};
      stored_.is_lps = true;
    } else if (all({right, anterior, superior})) {
      axes_ = {right, anterior, superior};
      stored_.is_lps = true;
      sign_ = -1;
    } else {
      lines_.fail("the header needs each of x, y and z once");
    }
  }

  void read_row(std::string_view line) {
    const std::vector<std::string_view> row = cells(line);
    if (row.size() < columns_.size()) lines_.fail("has {} cells instead of {}", row.size(), columns_.size());
    std::string branch;
    glm::dvec3 position{};
    double radius = std::numeric_limits<double>::quiet_NaN();
    bool has_radius = false;
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      for (int axis = 0; axis < 3; ++axis)
        if (columns_[k] == axes_[static_cast<std::size_t>(axis)]) position[axis] = number(row[k]);
      if (columns_[k] == CsvColumn::branch) branch = row[k];
      if (columns_[k] != CsvColumn::radius && columns_[k] != CsvColumn::diameter) continue;
      has_radius = true;
      if (!row[k].empty()) radius = number(row[k]) / (columns_[k] == CsvColumn::diameter ? 2 : 1);
    }
    const auto [entry, added] = branches_.try_emplace(branch, stored_.lines.size());
    if (added) stored_.lines.emplace_back().name = branch;
    CentrelineLine& to = stored_.lines[entry->second];
    to.points_mm.emplace_back(sign_ * position.x, sign_ * position.y, position.z);
    if (has_radius) to.radii_mm.push_back(radius);
  }

  double number(std::string_view cell) const {
    const auto number = real_number(cell);
    if (!number) lines_.fail("\"{}\" is not a number", excerpt(cell));
    return *number;
  }

  /// Without the quotes around them, between which a separator is none.
  std::vector<std::string_view> cells(std::string_view line) const {
    std::vector<std::string_view> found;
    for (bool is_last = false; !is_last;) {
      line.remove_prefix(std::min(line.find_first_not_of(separator_ == '\t' ? " " : " \t"), line.size()));
      const bool is_quoted = line.starts_with('"');
      const std::size_t close = is_quoted ? line.find('"', 1) : 0;
      const std::size_t end = close == std::string_view::npos ? close : line.find(separator_, close);
      is_last = end == std::string_view::npos;
      const std::string_view cell = trimmed(line.substr(0, end));
      found.push_back(is_quoted && cell.size() > 1 && cell.ends_with('"') ? cell.substr(1, cell.size() - 2)
                                                                          : cell);
      line.remove_prefix(is_last ? line.size() : end + 1);
    }
    return found;
  }

  TextLines lines_;
  char separator_ = ',';
  std::vector<CsvColumn> columns_;
  std::array<CsvColumn, 3> axes_{};
  double sign_ = 1;
  StoredCentrelines stored_;
  std::unordered_map<std::string, std::size_t> branches_;
};

}  // namespace

StoredCentrelines read_centreline_csv(const std::filesystem::path& path) {
  const std::string text = read_whole_file(path);
  return CentrelineCsv(text, path.string()).read();
}

}  // namespace xraycast
