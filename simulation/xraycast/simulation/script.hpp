#pragma once

#include "xraycast/mechanics/hub.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// What a hand does at the hub, written down: poses at times, linear in between.
class Script {
 public:
  struct Row {
    double time_s = 0;
    HubPose pose;
    int line = 0;  ///< of the file, from 1
  };

  static constexpr double kLongest_s = 24 * 3600;

  /// CSV with the columns time_s,insertion_mm,rotation_deg in any order, in its first line; blank lines at
  /// its end. Throws InputError, naming `origin` and the line, for a missing column or value, another number
  /// of values than columns, what is not a finite number, a time below zero, beyond kLongest_s or not after
  /// the one before it, an insertion below zero, a hub that would have to move faster than
  /// Catheter::kFastest_mm_s or turn faster than Catheter::kFastest_rad_s, and for a file without rows.
  static Script parse(const std::string& text, const std::string& origin);

  /// Of a file. Throws InputError.
  static Script read(const std::filesystem::path& path);

  const std::vector<Row>& rows() const { return rows_; }
  double end_s() const { return rows_.back().time_s; }

  /// Before the first row its pose, after the last one that one's.
  HubPose pose_at(double time_s) const;

 private:
  explicit Script(std::vector<Row> rows) : rows_(std::move(rows)) {}
  std::vector<Row> rows_;
};

}  // namespace xraycast
