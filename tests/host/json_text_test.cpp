#include "xraycast/base/json_text.hpp"

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <limits>

namespace xraycast::json_text_test {
namespace {

using testing::HasSubstr;

std::string nested(int levels) {
  const auto count = static_cast<std::size_t>(levels);
  return std::string(count, '[') + std::string(count, ']');
}

TEST(JsonText, IsReadUpToItsDeepestLevel) {
  EXPECT_EQ(parse_json(R"({"a": [1, 2.5]})", "file")["a"][1], 2.5);
  EXPECT_TRUE(parse_json(nested(kDeepestJson), "file").is_array());
  EXPECT_THAT([] { parse_json(nested(kDeepestJson + 1), "file"); },
              testing::ThrowsMessage<InputError>(
                  HasSubstr("file: lists and objects are nested more than 32 levels")));
}

TEST(JsonText, IsDiscardedWhereItIsNone) {
  for (const char* text : {"", "[1", "{]", "words", "[1] 2", "\"\xff\""})
    EXPECT_TRUE(parse_json(text, "file").is_discarded()) << text;
}

TEST(JsonText, HoldsWholeNumbersOrNone) {
  const auto number = [](const char* text) { return whole_number(parse_json(text, "file")); };
  EXPECT_EQ(number("-7"), -7);
  EXPECT_EQ(number("9223372036854775807"), std::numeric_limits<std::int64_t>::max());
  for (const char* text :
       {"9223372036854775808", "88888888888888888888", "1e300", "1.0", "true", "\"1\"", "[1]"})
    EXPECT_EQ(number(text), std::nullopt) << text;
}

TEST(JsonText, OfGreatDepthIsRefusedByItsReaders) {
  const std::string deep = R"({"name": )" + std::string(1'000'000, '[');
  EXPECT_THROW(Opacity::from_json(deep, "file"), InputError);
  EXPECT_THROW(Spectrum::from_json(deep, "file"), InputError);
}

}  // namespace
}  // namespace xraycast::json_text_test
