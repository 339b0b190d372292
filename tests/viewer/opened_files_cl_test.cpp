#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/window/opened_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace xraycast::opened_files_cl_test {
namespace {

TEST(OpenedFiles, HaveTheWarningsOfTheScanThatWasOpened) {
  const TemporaryFolder folder;
  NiftiFile file;
  file.dim = {3, 20, 20, 10, 1, 1, 1, 1};
  file.voxels.assign(sizeof(std::int16_t) * 20 * 20 * 10, 0);
  file.sform_code = 0;
  write_bytes(folder / "scan.nii", file.bytes());
  Progress unheard;
  ViewSession session;
  session.scan = folder / "scan.nii";
  const OpenedFiles opened = open_files(session, {}, "", unheard);
  EXPECT_THAT(opened.warnings, testing::ElementsAre(testing::HasSubstr("neither qform nor sform")));
  // A warning is told once.
  EXPECT_THAT(open_files(session, opened, "", unheard).warnings, testing::IsEmpty());
}

}  // namespace
}  // namespace xraycast::opened_files_cl_test
