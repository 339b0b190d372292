#include "xraycast/base/json_text.hpp"

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace xraycast {
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

TEST(JsonText, OfGreatDepthIsRefusedByItsReaders) {
  const std::string deep = R"({"name": )" + std::string(1'000'000, '[');
  EXPECT_THROW(Opacity::from_json(deep, "file"), InputError);
  EXPECT_THROW(Spectrum::from_json(deep, "file"), InputError);
}

}  // namespace
}  // namespace xraycast
