#include "xraycast/base/field_names.hpp"

#include <gtest/gtest.h>

#include <string>
#include <string_view>

namespace xraycast::field_names_test {
namespace {

std::string as_option(std::string_view field) { return field == "layers" ? "--layers" : ""; }

TEST(FieldNames, AreSpelledByTheFrontEnd) {
  EXPECT_EQ(with_names("`layers` 300: must be 1 to 256; give fewer `layers`", as_option),
            "--layers 300: must be 1 to 256; give fewer --layers");
}

TEST(FieldNames, LeaveOtherWordsInBackquotesAsTheyAre) {
  for (const std::string text : {"see `xraycast info`", "`unknown`", "`", "``", "a file named `layers", ""})
    EXPECT_EQ(with_names(text, as_option), text);
  EXPECT_EQ(with_names("`open `layers`", as_option), "`open --layers");
}

}  // namespace
}  // namespace xraycast::field_names_test
