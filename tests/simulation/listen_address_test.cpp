#include "xraycast/network/listen_address.hpp"

#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace xraycast::listen_address_test {
namespace {

TEST(ListenAddress, IsOpenIGTLinksPortOfThisMachineByDefault) {
  EXPECT_EQ(to_string(ListenAddress{}), "127.0.0.1:18944");
}

TEST(ListenAddress, ComesBackFromItsText) {
  for (const char* text : {"127.0.0.1:18944", "0.0.0.0:0", "localhost:65535", "[::1]:18944", "[fe80::1]:1"})
    EXPECT_EQ(to_string(parse_listen_address(text)), text);
}

TEST(ListenAddress, RefusesAnythingElse) {
  for (const char* text :
       {"", "18944", ":18944", "127.0.0.1", "127.0.0.1:", "127.0.0.1:-1", "127.0.0.1:65536",
        "127.0.0.1:18944x", "127.0.0.1: 18944", "::1:18944", "[::1]", "[]:18944", "[::1:18944"}) {
    try {
      parse_listen_address(text);
      ADD_FAILURE() << text << " was read";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::StartsWith(std::string(text) + ": give ADDRESS:PORT"));
    }
  }
}

}  // namespace
}  // namespace xraycast::listen_address_test
