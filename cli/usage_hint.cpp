#include "usage_hint.hpp"

#include "xraycast/base/closest_word.hpp"

#include <fmt/format.h>

#include <vector>

namespace xraycast::cli {
namespace {

/// The options that `word` may have been meant for, or else the subcommands.
std::vector<std::string> known_words(const CLI::App& app, const CLI::App& command, const std::string& word) {
  std::vector<std::string> known;
  if (word.starts_with("--")) {
    for (const CLI::App* owner : {&app, &command})
      for (const CLI::Option* option : owner->get_options())
        for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  } else if (&command == &app) {
    for (const CLI::App* subcommand : app.get_subcommands({})) known.push_back(subcommand->get_name());
  }
  return known;
}

}  // namespace

std::string usage_hint(const CLI::App& app) {
  const auto parsed = app.get_subcommands();
  const CLI::App& command = parsed.empty() ? app : *parsed.front();
  const std::string help =
      parsed.empty() ? "`xraycast --help`" : fmt::format("`xraycast {} --help`", command.get_name());
  for (const std::string& word : app.remaining(true)) {
    const std::string name = word.substr(0, word.find('='));
    if (const std::string meant = closest_word(known_words(app, command, name), name); !meant.empty())
      return fmt::format("did you mean {}? See {}", meant, help);
  }
  return "see " + help;
}

}  // namespace xraycast::cli
