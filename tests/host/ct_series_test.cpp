#include "xraycast/series/ct_series.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace xraycast::ct_series_test {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(CtSeries, RefusesSlicesThatNoDicomFileHolds) {
  const TemporaryFolder folder;
  const auto check = [&](std::int64_t columns, std::int64_t rows) {
    check_ct_series({{columns, rows, 1}, {1, 1, 1}, {0, 0, 0}}, folder / "series", {});
  };
  EXPECT_THAT([&] { check(65536, 1); },
              ThrowsMessage<InputError>(HasSubstr("DICOM allows at most 65535 per side")));
  // The length of Pixel Data is an even 32-bit number, and 0xffffffff is none.
  EXPECT_THAT([&] { check(65535, 32769); },
              ThrowsMessage<InputError>(HasSubstr("exceed the 4 GiB of a DICOM file")));
  EXPECT_NO_THROW(check(65535, 32768));
}

}  // namespace
}  // namespace xraycast::ct_series_test
