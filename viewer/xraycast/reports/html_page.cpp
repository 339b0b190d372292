#include "xraycast/reports/html_page.hpp"

#include "xraycast/base/html_text.hpp"

#include <fmt/format.h>

namespace xraycast {

std::string html_page(std::string_view title, std::string_view head, std::string_view style,
                      std::string_view body) {
  constexpr const char* kPage = R"(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
{1}<meta name="generator" content="xraycast">
<title>{0}</title>
<style>
{2}</style>
</head>
<body>
<h1>{0}</h1>
{3}</body>
</html>
)";
  return fmt::format(kPage, in_html(title), head, style, body);
}

}  // namespace xraycast
