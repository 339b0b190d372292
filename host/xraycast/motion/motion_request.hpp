#pragma once

#include "xraycast/motion/motion.hpp"
#include "xraycast/volume/scan_info.hpp"

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// At which instant of its motion a scan is taken, as every front end asks for it. Messages name the fields
/// in backquotes, for with_names().
struct MotionRequest {
  std::filesystem::path motion{};         ///< motion.json; empty: the scan as it is
  std::map<std::string, double> phase{};  ///< of modes by name, 0 to 1; 0 of those that are not named
  std::optional<double> time_s{};         ///< instead: the phases of all modes at a time

  /// All instants at once, where that is possible.
  bool is_of_all_instants() const { return !motion.empty() && phase.empty() && !time_s; }
  bool is_given() const { return !motion.empty() || !phase.empty() || time_s; }
};

/// Throws InputError for a phase or time without a motion or both of them, and for a motion without either.
/// Reads no file.
void check(const MotionRequest& request);

/// The phase of each mode of a motion, in order: at the request's time, or as it names them. Throws
/// InputError as Motion::phases_of.
std::vector<double> phases_of(const Motion& motion, const MotionRequest& request);

/// A body's motion, held at what was asked for.
struct MotionOfRequest {
  HeldMotion held;
  std::string name{};                                    ///< of the motion's file
  std::vector<std::pair<std::string, double>> phases{};  ///< of each mode, in order
  std::vector<std::string> warnings{};                   ///< of the motion

  /// `, breath 1, heart 0.4`, behind the name of what is moved; empty without a motion.
  std::string suffix() const;
};

/// Reads the motion; nothing where none is given. Throws InputError as check() and read_motion.
MotionOfRequest held_motion(const MotionRequest& request);

/// The scan at that instant: see `moved` of moved_scan.hpp. Warnings of the motion are among the scan's.
Scan moved(Scan scan, const MotionOfRequest& motion, Progress& progress);

/// `breath=0.3`, as a mode's name and its phase. Throws InputError with the field `phase` in front.
std::pair<std::string, double> parse_phase(const std::string& text);

}  // namespace xraycast
