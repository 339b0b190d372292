#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/projection/view.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace xraycast {

// OpenIGTLink messages, header version 1, stamped with the present time, in LPS and mm, ready to be sent to
// any number of clients. Thread-safe, other than the library's message objects.

/// The name of an instrument's message by its number: Tip, Tip2, Tip3, from the outermost instrument on.
std::string numbered(const std::string& name, std::size_t instrument);

/// IMAGE `Fluoroscope`, a picture of width x height pixels, row 0 on top. Its axes are the picture's right,
/// down, and from the detector to the source; its centre is that of the detector, or for a parallel beam the
/// view's.
std::string pack_image(const View& view, std::span<const std::uint8_t> greys);
std::string pack_image(const View& view, std::span<const std::uint16_t> codes);

/// POINT `Device`, `Device2` and so on: the control points of a cubic curve from the introducer to the tip,
/// each with the instrument's radius.
std::string pack_points(std::size_t instrument, std::span<const glm::dvec3> controls_mm, double radius_mm);

/// TRANSFORM `Tip`, `Tip2` and so on: the tip's place, with z forwards along the instrument. A rod's own
/// rotation is not in it: x is the axis that a shortest turn from the patient's z to the tip's direction
/// makes of the patient's x.
std::string pack_tip(std::size_t instrument, const InstrumentTip& tip);

/// Two SENSOR messages, since each has one unit for all its values: `HubForce`, three values in N, and
/// `HubTorque`, three values in N m, upon the hand, along the axes of the TRANSFORM it sends. What resists
/// pushing and right-handed rotation is thus negative along z. Those of the second instrument are `HubForce2`
/// and `HubTorque2`, and so on.
std::string pack_load(std::size_t hub, const HubLoad& load);

/// STATUS `xraycast`, with the protocol's codes.
enum class IgtlinkStatus : std::uint16_t { ok = 1, busy = 6 };
std::string pack_status(IgtlinkStatus status, std::string_view text);

/// STRING, in UTF-8; empty where the text has more than kMostText_B bytes, as many as the protocol can count.
inline constexpr std::size_t kMostText_B = 65535;
std::string pack_text(std::string_view name, std::string_view text);

/// Any message of this type and name.
std::string pack_message(std::string_view type, std::string_view name, std::string body);

}  // namespace xraycast
