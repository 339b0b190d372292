#include "xraycast/reports/index_page.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/whole_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace xraycast::index_page_test {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string page_of(const std::string& title, const std::vector<CaptionedPicture>& pictures,
                    const std::vector<std::pair<std::string, std::string>>& facts) {
  const TemporaryFolder folder;
  std::vector<CaptionedPicture> inside = pictures;
  for (CaptionedPicture& picture : inside) {
    picture.file = folder / picture.file.string();
    if (!picture.cine.empty()) picture.cine = folder / picture.cine.string();
  }
  write_index_page(title, {folder / "run.html", "A run"}, inside, facts, folder / "index.html");
  return read_whole_file(folder / "index.html");
}

TEST(IndexPage, FitsATelephone) {
  EXPECT_THAT(page_of("Demo", {}, {}),
              HasSubstr("<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"));
}

TEST(IndexPage, PlaysCinesUnlessLessMotionIsAskedFor) {
  const std::string page = page_of("Demo", {{"map/a.png", "A map"}, {"run.png", "A run", "run.gif"}}, {});
  EXPECT_THAT(page, HasSubstr("<a href=\"map/a.png\"><picture><img src=\"map/a.png\" alt=\"A map\" "));
  EXPECT_THAT(page,
              HasSubstr("<a href=\"run.gif\"><picture><source srcset=\"run.png\" "
                        "media=\"(prefers-reduced-motion: reduce)\"><img src=\"run.gif\" alt=\"A run\" "));
}

TEST(IndexPage, MakesNoMarkupOfText) {
  const std::string attack = "\"'><script>alert(1)</script><img src=x onerror=alert(2)>&lt;";
  const std::string page = page_of(
      attack, {{"\" onload=alert(3) \"'.png", attack, "\" onload=alert(3) \"'.gif"}}, {{attack, attack}});
  EXPECT_THAT(page, Not(HasSubstr("<script")));
  EXPECT_THAT(page, Not(HasSubstr("<img src=x")));
  EXPECT_THAT(page, Not(HasSubstr("\" onload")));
  EXPECT_THAT(page, HasSubstr("<td>&quot;&#39;&gt;&lt;script&gt;alert(1)&lt;/script&gt;"));
  EXPECT_THAT(page, HasSubstr("&amp;lt;</td></tr>"));
}

}  // namespace
}  // namespace xraycast::index_page_test
