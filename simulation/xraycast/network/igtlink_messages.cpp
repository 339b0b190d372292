#include "xraycast/network/igtlink_messages.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cstring>
#include <igtl_header.h>
#include <igtl_image.h>
#include <igtl_point.h>
#include <igtl_sensor.h>
#include <igtl_transform.h>
#include <igtl_unit.h>
#include <igtl_util.h>
#include <vector>

namespace xraycast {
namespace {

/// Fields are padded with zeros, which end the name where there is room for one.
void set_text(std::span<char> field, std::string_view text) {
  std::copy_n(text.begin(), std::min(text.size(), field.size()), field.begin());
}

template <typename Value>
std::string_view bytes_of(std::span<const Value> values) {
  return {reinterpret_cast<const char*>(values.data()), values.size_bytes()};
}

void set_vector(float* three, const glm::dvec3& vector) {
  for (int i = 0; i < 3; ++i) three[i] = static_cast<float>(vector[i]);
}

/// Seconds, and their fraction in units of 2^-32 s.
igtl_uint64 timestamp() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const auto seconds = std::chrono::floor<std::chrono::seconds>(now);
  const auto fraction = std::chrono::duration_cast<std::chrono::nanoseconds>(now - seconds);
  return static_cast<igtl_uint64>(seconds.count()) << 32 |
         igtl_nanosec_to_frac(static_cast<igtl_uint32>(fraction.count()));
}

/// A SENSOR of three values, that along z, in the product of the given units (protocol, unit.md).
std::string pack_sensor(const std::string& name, double z, std::initializer_list<igtl_uint8> units) {
  igtl_unit_data product;
  igtl_unit_init(&product);
  for (int i = 0; const igtl_uint8 unit : units) {
    product.unit[i] = unit;
    product.exp[i++] = 1;
  }
  std::array<igtl_float64, 3> values{0, 0, z};
  igtl_sensor_header header{.larray = values.size(), .status = 0, .unit = igtl_unit_pack(&product)};
  igtl_sensor_convert_byte_order(&header, values.data());
  return pack_message("SENSOR", name,
                      std::string(reinterpret_cast<const char*>(&header), sizeof header)
                          .append(bytes_of(std::span<const double>(values))));
}

std::string pack_pixels(const View& view, igtl_uint8 scalar_type, std::string_view pixels) {
  igtl_image_header header{};
  header.version = IGTL_IMAGE_HEADER_VERSION;
  header.num_components = 1;
  header.scalar_type = scalar_type;
  header.endian =
      std::endian::native == std::endian::little ? IGTL_IMAGE_ENDIAN_LITTLE : IGTL_IMAGE_ENDIAN_BIG;
  header.coord = IGTL_IMAGE_COORD_LPS;
  const std::array size{static_cast<igtl_uint16>(view.width), static_cast<igtl_uint16>(view.height),
                        igtl_uint16{1}};
  std::memcpy(header.size, size.data(), sizeof header.size);
  std::memcpy(header.subvol_size, size.data(), sizeof header.subvol_size);
  std::array<float, 12> matrix;
  set_vector(&matrix[0], view.pixel_mm * view.right());
  set_vector(&matrix[3], -view.pixel_mm * view.up());
  set_vector(&matrix[6], -view.pixel_mm * view.towards_detector());
  // The protocol gives the centre, not the first pixel.
  set_vector(&matrix[9], view.pixel_on_detector_mm(0.5 * (view.width - 1), 0.5 * (view.height - 1)));
  std::memcpy(header.matrix, matrix.data(), sizeof header.matrix);
  igtl_image_convert_byte_order(&header);

  std::string body;
  body.reserve(sizeof(igtl_header) + sizeof header + pixels.size());
  body.append(reinterpret_cast<const char*>(&header), sizeof header).append(pixels);
  return pack_message("IMAGE", "Fluoroscope", std::move(body));
}

}  // namespace

std::string numbered(const std::string& name, std::size_t instrument) {
  return name + (instrument == 0 ? "" : std::to_string(instrument + 1));
}

static_assert(sizeof(igtl_image_header) == IGTL_IMAGE_HEADER_SIZE &&
              sizeof(igtl_point_element) == IGTL_POINT_ELEMENT_SIZE &&
              sizeof(igtl_sensor_header) == IGTL_SENSOR_HEADER_SIZE);

std::string pack_message(std::string_view type, std::string_view name, std::string body) {
  igtl_header header{};
  header.version = IGTL_HEADER_VERSION;
  set_text(header.name, type);
  set_text(header.device_name, name);
  header.timestamp = timestamp();
  header.body_size = body.size();
  header.crc = crc64(reinterpret_cast<unsigned char*>(body.data()), body.size(), 0);
  igtl_header_convert_byte_order(&header);
  body.insert(0, reinterpret_cast<const char*>(&header), sizeof header);
  return body;
}

std::string pack_image(const View& view, std::span<const std::uint8_t> greys) {
  return pack_pixels(view, IGTL_IMAGE_STYPE_TYPE_UINT8, bytes_of(greys));
}

std::string pack_image(const View& view, std::span<const std::uint16_t> codes) {
  return pack_pixels(view, IGTL_IMAGE_STYPE_TYPE_UINT16, bytes_of(codes));
}

std::string pack_points(std::size_t instrument, std::span<const glm::dvec3> controls_mm, double radius_mm) {
  std::vector<igtl_point_element> points(controls_mm.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    igtl_point_element& point = points[i];
    set_text(point.name, std::to_string(i));
    set_text(point.group_name, "Control");
    std::ranges::fill(point.rgba, igtl_uint8{255});
    std::array<float, 3> position;
    set_vector(position.data(), controls_mm[i]);
    std::memcpy(point.position, position.data(), sizeof point.position);
    point.radius = static_cast<float>(radius_mm);
  }
  igtl_point_convert_byte_order(points.data(), static_cast<int>(points.size()));
  return pack_message("POINT", numbered("Device", instrument),
                      std::string(bytes_of(std::span<const igtl_point_element>(points))));
}

std::string pack_tip(std::size_t instrument, const InstrumentTip& tip) {
  const glm::dvec3 z = tip.direction;
  // Rodrigues' formula for the patient's x, with the rotation's axis (-z.y, z.x, 0) and cosine z.z.
  constexpr double kOpposite = -1 + 1e-9;
  const double share = z.z > kOpposite ? 1 / (1 + z.z) : 0;
  const glm::dvec3 x = z.z > kOpposite
                           ? glm::normalize(glm::dvec3(1 - z.x * z.x * share, -z.x * z.y * share, -z.x))
                           : glm::dvec3(1, 0, 0);
  std::array<float, 12> matrix;
  set_vector(&matrix[0], x);
  set_vector(&matrix[3], glm::cross(z, x));
  set_vector(&matrix[6], z);
  set_vector(&matrix[9], tip.position_mm);
  igtl_transform_convert_byte_order(matrix.data());
  return pack_message("TRANSFORM", numbered("Tip", instrument),
                      std::string(bytes_of(std::span<const float>(matrix))));
}

std::string pack_load(std::size_t hub, const HubLoad& load) {
  return pack_sensor(numbered("HubForce", hub), -load.force_N, {IGTL_UNIT_SI_DERIVED_NEWTON}) +
         pack_sensor(numbered("HubTorque", hub), -load.torque_Nm,
                     {IGTL_UNIT_SI_DERIVED_NEWTON, IGTL_UNIT_SI_BASE_METER});
}

std::string pack_text(std::string_view name, std::string_view text) {
  constexpr char kUtf8 = 106;  // of IANA's character sets
  constexpr unsigned kByte = 256;
  if (text.size() > kMostText_B) return {};
  std::string body{'\0', kUtf8, static_cast<char>(text.size() / kByte),
                   static_cast<char>(text.size() % kByte)};
  return pack_message("STRING", name, body.append(text));
}

std::string pack_status(IgtlinkStatus status, std::string_view text) {
  constexpr std::size_t kSubcode_B = 8, kErrorName_B = 20;
  std::string body{'\0', static_cast<char>(status)};
  body.append(kSubcode_B + kErrorName_B, '\0').append(text).push_back('\0');
  return pack_message("STATUS", "xraycast", std::move(body));
}

}  // namespace xraycast
