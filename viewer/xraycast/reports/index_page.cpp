#include "xraycast/reports/index_page.hpp"

#include "xraycast/base/html_text.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/reports/html_page.hpp"

#include <fmt/format.h>

namespace xraycast {
namespace {

constexpr const char* kIndexStyle =
    R"(body { background: #1a1c21; color: #e6e6e6; font: 16px/1.5 sans-serif; margin: 2em auto; max-width: 1240px; padding: 0 1em; }
main { display: flex; flex-wrap: wrap; gap: 1em; margin-bottom: 1em; }
figure { margin: 0; max-width: 100%; }
figcaption { font-size: 14px; }
img { display: block; height: 360px; max-width: 100%; object-fit: contain; object-position: left; }
@media (max-width: 600px) { img { height: auto; width: 100%; } }
a { color: #8cc8ff; }
iframe { border: 0; height: 46em; max-height: 90vh; width: 100%; }
td { overflow-wrap: anywhere; padding: .1em 1.5em .1em 0; }
)";

/// Shows a cine, or its still where less motion is asked for.
std::string figure(const std::string& still, const std::string& cine, const std::string& caption) {
  const std::string shown = in_html(cine.empty() ? still : cine), words = in_html(caption);
  std::string source;
  if (!cine.empty())
    source = fmt::format("<source srcset=\"{}\" media=\"(prefers-reduced-motion: reduce)\">", in_html(still));
  return fmt::format(
      "<figure><a href=\"{0}\"><picture>{1}<img src=\"{0}\" alt=\"{2}\" loading=\"lazy\"></picture></a>"
      "<figcaption>{2}</figcaption></figure>\n",
      shown, source, words);
}

}  // namespace

void write_index_page(const std::string& title, const CaptionedPicture& page,
                      const std::vector<CaptionedPicture>& pictures,
                      const std::vector<std::pair<std::string, std::string>>& facts,
                      const std::filesystem::path& path) {
  const auto beside_page = [&](const std::filesystem::path& file) {
    return file.empty() ? std::string() : file.lexically_relative(path.parent_path()).string();
  };
  std::string html =
      fmt::format("<iframe src=\"{0}\" title=\"{1}\"></iframe>\n<p><a href=\"{0}\">{1}</a></p>\n",
                  in_html(beside_page(page.file)), in_html(page.caption));
  html += "<main>\n";
  for (const CaptionedPicture& picture : pictures)
    html += figure(beside_page(picture.file), beside_page(picture.cine), picture.caption);
  html += "</main>\n<table>\n";
  for (const auto& [name, value] : facts)
    html += fmt::format("<tr><td>{}</td><td>{}</td></tr>\n", in_html(name), in_html(value));
  html += "</table>\n<p>Not for clinical use.</p>\n";
  write_whole_file(path, html_page(title, "", kIndexStyle, html));
}

}  // namespace xraycast
