#pragma once

#include "xraycast/catheter/lumen_distance_field.hpp"

namespace xraycast {

/// What is so much of a vessel's width, or more, fills it: less than a ten thousandth of its conductance is
/// left.
inline constexpr double kFillsLumen = 0.98;

// The width of a vessel along its centreline, at arc lengths from its first point; linear between the
// stations of the field, and beyond its ends as there.

double radius_mm(const LumenDistanceField& field, int branch, double arc_length_mm);

/// The first of the narrowest places between two.
double narrowest_at_mm(const LumenDistanceField& field, int branch, double from_mm, double to_mm);

/// The radius there.
double least_radius_mm(const LumenDistanceField& field, int branch, double from_mm, double to_mm);

}  // namespace xraycast
