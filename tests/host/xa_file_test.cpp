#include "xraycast/projection/xa_file.hpp"

#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace xraycast::xa_file_test {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

const View kOnePixel{.width = 1, .height = 1, .pixel_mm = 1};
const XaOptions kSubtracted{.is_subtracted = true};

TEST(XaMask, IsAppliedToTheLastFrameThatDicomCounts) {
  const TemporaryFolder folder;
  constexpr int kMost = 65535;
  XaWriter writer(folder / "run.dcm", kOnePixel, kMost, kSubtracted);
  const float tau = 1;
  for (int frame = 0; frame < kMost; ++frame) writer.add(kOnePixel, {&tau, 1});
  writer.set_mask_frames(2);
  writer.finish();
  const std::string bytes = read_bytes(folder / "run.dcm");
  const auto words = [](const char* tag, std::uint16_t first, std::uint16_t last) {
    return std::string(tag, 4) + "US" + bytes_of(std::uint16_t{4}) + bytes_of(first) + bytes_of(last);
  };
  EXPECT_THAT(bytes, HasSubstr(words("\x28\x00\x02\x61", 3, kMost))) << "Applicable Frame Range";
  EXPECT_THAT(bytes, HasSubstr(words("\x28\x00\x10\x61", 1, 2))) << "Mask Frame Numbers";
}

TEST(XaMask, IsRefusedInARunBeyondThem) {
  const TemporaryFolder folder;
  EXPECT_THAT(
      [&] { XaWriter(folder / "run.dcm", kOnePixel, 65536, kSubtracted); },
      ThrowsMessage<InputError>((folder / "run.dcm").string() +
                                ": 65536 frames; DICOM counts those of a run with a mask up to 65535: "
                                "draw fewer frames"));
  EXPECT_NO_THROW(XaWriter(folder / "run.dcm", kOnePixel, 65536, {})) << "without a mask";
}

}  // namespace
}  // namespace xraycast::xa_file_test
