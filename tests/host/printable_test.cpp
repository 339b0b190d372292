#include "xraycast/base/printable.hpp"

#include "xraycast/base/error.hpp"

#include <gtest/gtest.h>

namespace xraycast::printable_test {
namespace {

TEST(Printable, KeepsLettersOfAllTonguesAndTheLayout) {
  const std::string text = "Größe \xE4\xBD\x93 \xF0\x9F\xA9\xBB\n\tone line\n";
  EXPECT_EQ(printable(text), text);
  EXPECT_EQ(printable_line("two\r\nlines"), "two  lines");
}

TEST(Printable, SpellsOutWhatATerminalWouldObey) {
  EXPECT_EQ(printable("\x1B[2J\a\x7F\r"), "\\x1b[2J\\x07\\x7f\\x0d");
  EXPECT_EQ(printable("\xC2\x9B[2J"), "\\xc2\\x9b[2J");  // U+009B, which starts a command too
  EXPECT_EQ(printable(std::string_view("\0", 1)), "\\x00");
}

TEST(Printable, SpellsOutWhatIsNoUtf8) {
  EXPECT_EQ(printable("Sch\xE4"
                      "del"),
            "Sch\\xe4del");
  EXPECT_EQ(printable("\xC3"), "\\xc3");
  EXPECT_EQ(printable("\xC0\xAF"), "\\xc0\\xaf");                    // / in two bytes
  EXPECT_EQ(printable("\xE0\x80\xAF"), "\\xe0\\x80\\xaf");           // and in three
  EXPECT_EQ(printable("\xED\xA0\x80"), "\\xed\\xa0\\x80");           // half of a pair of UTF-16
  EXPECT_EQ(printable("\xF4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");  // beyond U+10FFFF
}

TEST(Excerpt, IsOneShortLine) {
  EXPECT_EQ(excerpt("as it is"), "as it is");
  EXPECT_EQ(excerpt(std::string(80, 'a')), std::string(80, 'a'));
  EXPECT_EQ(excerpt(std::string(3'000'000, 'a')), std::string(80, 'a') + "…");
  EXPECT_EQ(excerpt("a\nb\x1b"), "a b\\x1b");
  // No character is cut, of whatever it takes to show it.
  EXPECT_EQ(excerpt(std::string(79, 'a') + "ö"), std::string(79, 'a') + "…");
  EXPECT_EQ(excerpt(std::string(78, 'a') + "\x1b"), std::string(78, 'a') + "…");
}

TEST(Error, IsOneLineWhateverAFileGave) {
  EXPECT_STREQ(InputError("{}: its title is {}", "scan", std::string("a\0b\r\nc\x1B[2J", 10)).what(),
               "scan: its title is a\\x00b  c\\x1b[2J");
}

}  // namespace
}  // namespace xraycast::printable_test
