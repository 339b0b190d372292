#include "xraycast/haptics/igtlink_messages.hpp"

#include "xraycast/haptics/igtlink_frames.hpp"

#include <igtl_unit.h>
#include <initializer_list>

namespace xraycast {
namespace {

/// A sensor of three values, in the product of the given units (protocol, unit.md). The library's igtl::Unit
/// keeps only the last of several.
igtl::SensorMessage::Pointer vector_sensor(const std::string& name, std::initializer_list<igtl_uint8> units) {
  igtl_unit_data product;
  igtl_unit_init(&product);
  for (int i = 0; const igtl_uint8 unit : units) {
    product.unit[i] = unit;
    product.exp[i++] = 1;
  }
  auto message = igtl::SensorMessage::New();
  message->SetDeviceName(name.c_str());
  message->SetLength(3);
  message->SetUnit(igtl_unit_pack(&product));
  return message;
}

std::string packed(igtl::MessageBase& message) {
  const IgtlinkTime now = igtlink_time();
  message.SetTimeStamp(now.seconds, now.fraction);
  message.Pack();
  return {static_cast<const char*>(message.GetPackPointer()),
          static_cast<std::size_t>(message.GetPackSize())};
}

}  // namespace

IgtlinkMessages::IgtlinkMessages() : status_(igtl::StatusMessage::New()) {
  for (std::size_t hub = 0; hub < kMaxHubs; ++hub) {
    forces_[hub] = vector_sensor(hub_name(hub, "Force"), {IGTL_UNIT_SI_DERIVED_NEWTON});
    torques_[hub] =
        vector_sensor(hub_name(hub, "Torque"), {IGTL_UNIT_SI_DERIVED_NEWTON, IGTL_UNIT_SI_BASE_METER});
  }
  status_->SetDeviceName("xraycast");
  status_->SetErrorName("");  // which the library leaves uninitialised
}

std::string IgtlinkMessages::load(std::size_t hub, const HubLoad& load) {
  forces_[hub]->SetValue(2, -load.force_N);
  torques_[hub]->SetValue(2, -load.torque_Nm);
  return packed(*forces_[hub]) + packed(*torques_[hub]);
}

std::string IgtlinkMessages::status(int code, const std::string& text) {
  status_->SetCode(code);
  status_->SetStatusString(text.c_str());
  return packed(*status_);
}

}  // namespace xraycast
