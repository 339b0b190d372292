#pragma once

#include "xraycast/casting/view.hpp"
#include "xraycast/coaxial/instruments.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace xraycast {

// OpenIGTLink messages of a session's frame, header version 1, in LPS and mm, ready to be sent to any number
// of clients. Thread-safe, other than the library's message objects.

/// IMAGE `Fluoroscope`, a picture of width x height pixels, row 0 on top. Its axes are the picture's right,
/// down, and from the detector to the source; its centre is that of the detector, or for a parallel beam the
/// view's.
std::string pack_image(const View& view, std::span<const std::uint8_t> greys);
std::string pack_image(const View& view, std::span<const std::uint16_t> codes);

/// POINT `Device`, `Device2` and so on: the control points of a cubic curve from the introducer to the tip,
/// each with the device's radius.
std::string pack_points(std::size_t device, std::span<const glm::dvec3> controls_mm, double radius_mm);

/// TRANSFORM `Tip`, `Tip2` and so on: the tip's place, with z forwards along the device. A rod's own rotation
/// is not in it: x is the axis that a shortest turn from the patient's z to the tip's direction makes of the
/// patient's x.
std::string pack_tip(std::size_t device, const InstrumentTip& tip);

/// The present time as messages are stamped with it, and its fraction of a second in units of 2^-32 s.
struct IgtlinkTime {
  std::uint32_t seconds = 0, fraction = 0;
};
IgtlinkTime igtlink_time();

/// Any message of this type and name, stamped with the present time.
std::string pack_message(std::string_view type, std::string_view name, std::string body);

}  // namespace xraycast
