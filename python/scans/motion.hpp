#pragma once

#include "calls/job.hpp"
#include "calls/values.hpp"
#include "scans/scan.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/motion/body_request.hpp"
#include "xraycast/motion/motion_request.hpp"

#include <map>
#include <memory>
#include <nanobind/nanobind.h>
#include <string>
#include <vector>

namespace xraycast::python {

namespace nb = nanobind;

/// As `motion`, `phase` and `time` were given; each may be None. Throws InputError as check(), unless
/// `takes_all`: a motion alone then means all its instants.
MotionRequest motion_request_of(const nb::object& motion, const nb::object& phase, const nb::object& time,
                                bool takes_all = false);

/// As `keys` were given, or None.
std::map<std::string, int> keys_of(const nb::object& keys);

/// The phases of a map that moves, as `phase` and `time` were given; each may be None, both mean phase 0.
/// Throws InputError where the map stands still and an instant is given.
std::vector<double> phases_at_instant(const BodyMap& map, const nb::object& phase, const nb::object& time);

/// How the body moves in a run, by `motion` and `phase` as they were given; each may be None. Throws
/// InputError as read_motion.
BodyRequest body_request_of(const nb::object& motion, const nb::object& phase);

/// The scan at that instant, with its own and the motion's warnings.
HeldScan moved_scan(const HeldScan& scan, const MotionRequest& request, Progress& progress);

/// Calls `make` with the scan at that instant, or with the scan itself where no motion is given.
template <typename Make>
auto with_motion(HeldScan& scan, const MotionRequest& request, const nb::object& progress, const Make& make) {
  if (!request.is_given()) return make(scan);
  HeldScan moved =
      result_of(progress, [&](Progress& reported) { return moved_scan(scan, request, reported); });
  warn(moved.info().warnings);
  return make(moved);
}

/// Motion, and Scan's moved.
void add_motion(nb::module_& module, nb::class_<HeldScan>& scan);

}  // namespace xraycast::python
