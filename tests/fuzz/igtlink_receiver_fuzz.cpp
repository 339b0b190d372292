// Fuzzes what a network may send to the haptic interface; see tests/fuzz/CMakeLists.txt.
#include "xraycast/haptics/igtlink_receiver.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <igtl_header.h>
#include <igtl_util.h>

using namespace xraycast;

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size_B, std::size_t largest_B);

/// Sets the checksums of the messages right, as far as they follow each other.
static void set_checksums(std::uint8_t* data, std::size_t size_B) {
  igtl_header header;
  while (size_B >= sizeof header) {
    std::memcpy(&header, data, sizeof header);
    igtl_header_convert_byte_order(&header);
    const std::uint64_t body_B = header.body_size;
    if (body_B > size_B - sizeof header) return;
    header.crc = crc64(data + sizeof header, body_B, 0);
    igtl_header_convert_byte_order(&header);
    std::memcpy(data, &header, sizeof header);
    data += sizeof header + body_B;
    size_B -= sizeof header + body_B;
  }
}

/// Chance alone makes no 64-bit checksum right: without this nothing behind it would be reached.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size_B, std::size_t largest_B,
                                               unsigned seed) {
  size_B = LLVMFuzzerMutate(data, size_B, largest_B);
  if (size_B > 1 && seed % 4 != 0) set_checksums(data + 1, size_B - 1);
  return size_B;
}

/// The first byte says in what portions the others arrive.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_B) {
  if (size_B == 0) return 0;
  const std::size_t portion_B = data[0] == 0 ? size_B : data[0];
  auto bytes = std::as_bytes(std::span(data, size_B)).subspan(1);
  IgtlinkReceiver receiver;
  double rotation_rad = 0;
  while (!bytes.empty()) {
    auto portion = bytes.first(std::min(portion_B, bytes.size()));
    bytes = bytes.subspan(portion.size());
    while (const auto event = receiver.next(portion)) {
      if (const auto* pose = std::get_if<HubPose>(&*event)) {
        if (!(std::abs(pose->insertion_mm) <= IgtlinkReceiver::kMaxInsertion_mm)) std::abort();
        if (!(std::abs(pose->rotation_rad - rotation_rad) <= 3.15)) std::abort();
        rotation_rad = pose->rotation_rad;
      } else if (const auto* complaint = std::get_if<Complaint>(&*event)) {
        for (const char c : complaint->text)
          if (c < ' ' || c > '~') std::abort();
      }
    }
    if (!portion.empty()) std::abort();
  }
  receiver.end();
  return 0;
}
