#pragma once

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/mesh.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ostream>
#include <string>
#include <vector>

namespace xraycast {

/// A file that is no surface, or none of those that are read.
struct BadSurfaceFile {
  const char* name;  ///< of the test
  const char* file;
  std::string content;
  std::vector<const char*> message;  ///< parts of it
};

inline void PrintTo(const BadSurfaceFile& file, std::ostream* out) { *out << file.name; }

inline void expect_refused_with_its_reason(const BadSurfaceFile& bad) {
  const TemporaryFolder folder;
  write_whole_file(folder / bad.file, bad.content);
  try {
    read_mesh(folder / bad.file);
    FAIL() << "was accepted";
  } catch (const InputError& error) {
    for (const char* part : bad.message) EXPECT_THAT(error.what(), testing::HasSubstr(part));
  }
}

}  // namespace xraycast
