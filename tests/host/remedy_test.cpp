#include "xraycast/base/remedy.hpp"

#include <gtest/gtest.h>

#include <string>

namespace xraycast::remedy_test {
namespace {

std::string told(const std::string& file, const std::string& message) {
  try {
    with_remedy(file, "correct the file", [&] { throw InputError("{}", message); });
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Remedy, FollowsAMessageThatHasNone) {
  EXPECT_EQ(told("a.csv", "a.csv: line 2 is empty"), "a.csv: line 2 is empty; correct the file");
  EXPECT_EQ(told("a.csv", "a.csv: no such file; check its name"), "a.csv: no such file; check its name");
}

TEST(Remedy, IsNotFoundInTheNameOfTheFile) {
  EXPECT_EQ(told("c; d.csv", "c; d.csv: line 2 is empty"), "c; d.csv: line 2 is empty; correct the file");
  EXPECT_EQ(told("c; d.csv", "c; d.csv: no such file; check its name"),
            "c; d.csv: no such file; check its name");
}

}  // namespace
}  // namespace xraycast::remedy_test
