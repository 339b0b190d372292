#include "xraycast/base/base64.hpp"

#include <gtest/gtest.h>

#include <utility>

namespace xraycast::base64_test {
namespace {

// The vectors of RFC 4648, section 10, and bytes above 127.
TEST(Base64, EncodesAndPads) {
  const std::pair<std::string_view, std::string_view> kVectors[] = {{"", ""},
                                                                    {"f", "Zg=="},
                                                                    {"fo", "Zm8="},
                                                                    {"foo", "Zm9v"},
                                                                    {"foob", "Zm9vYg=="},
                                                                    {"fooba", "Zm9vYmE="},
                                                                    {"foobar", "Zm9vYmFy"},
                                                                    {"\xff\xfe\xfd", "//79"},
                                                                    {"\xfb", "+w=="}};
  for (const auto& [bytes, text] : kVectors) EXPECT_EQ(to_base64(bytes), text);
}

}  // namespace
}  // namespace xraycast::base64_test
