#pragma once

#include "xraycast/catheter/hub.hpp"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// The columns of a script for an instrument, from 0 on: `insertion_mm`, `insertion_2_mm` and so on. The last
/// three, of its balloon, its stent's sheath and its coils, may be left out.
std::string insertion_column(std::size_t instrument);
std::string rotation_column(std::size_t instrument);
std::string inflation_column(std::size_t instrument);
std::string release_column(std::size_t instrument);
std::string detach_column(std::size_t instrument);

/// A recorded motion of the hubs of coaxial instruments: poses at times, with linear interpolation.
class Script {
 public:
  struct Row {
    double time_s = 0;
    HubPose pose;                      ///< of the outermost instrument
    int line = 0;                      ///< of the file, from 1; 0: of none
    std::vector<HubPose> inner_poses;  ///< of the instruments in it, from outside on

    const HubPose& pose_of(std::size_t instrument) const {
      return instrument == 0 ? pose : inner_poses[instrument - 1];
    }
  };

  static constexpr double kMaxTime_s = 86400;

  /// CSV with the columns time_s,insertion_mm,rotation_deg and, with several `devices`, also
  /// insertion_2_mm,rotation_2_deg and so on, in any order, named in its first line; of balloons there may be
  /// inflation_bar,inflation_2_bar and so on, without which they stay folded, and of stents that open
  /// themselves release_mm,release_2_mm and so on, how far their sheaths are drawn back, and of wires that
  /// push coils detach,detach_2 and so on, how many coils were to be detached so far; blank lines only at its
  /// end. Throws InputError, naming `origin` and the line, for a missing column or value, a wrong number of
  /// values, a value that is not a finite number, a time below zero, beyond kMaxTime_s or not after the
  /// previous one, an insertion or pressure below zero, a hub motion faster than MovingHub::kMaxSpeed_mm_s,
  /// rotation faster than MovingHub::kMaxSpeed_rad_s, inflation faster than MovingHub::kMaxInflation_bar_s, a
  /// sheath faster than MovingHub::kMaxRelease_mm_s or that goes back, detachments that are no whole number
  /// or go back, and a file without rows.
  static Script parse(const std::string& text, const std::string& origin, std::size_t instruments = 1);

  /// Of `devices` poses a row. Throws InputError as parse() does for values, naming the row.
  static Script of(std::vector<Row> rows, const std::string& origin, std::size_t instruments = 1);

  /// Throws InputError.
  static Script read(const std::filesystem::path& path, std::size_t instruments = 1);

  const std::vector<Row>& rows() const { return rows_; }
  const std::string& origin() const { return origin_; }

  /// In front of messages about a row: the origin, and its line or number.
  std::string where(std::size_t row) const;

  /// The first row's pose before its time, the last row's after it.
  HubPose pose_at(double time_s, std::size_t instrument = 0) const;

 private:
  Script(std::vector<Row> rows, std::string origin) : rows_(std::move(rows)), origin_(std::move(origin)) {}
  std::vector<Row> rows_;
  std::string origin_;
};

}  // namespace xraycast
