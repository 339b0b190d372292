#include "usage_hint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <string_view>
#include <vector>

namespace xraycast::cli {
namespace {

/// The Levenshtein distance of two words.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t above = row[j + 1];
      row[j + 1] = std::min({above + 1, row[j] + 1, diagonal + (a[i] == b[j] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row.back();
}

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

/// The valid word at a distance of at most a third of its length, or nothing.
std::string closest(const std::vector<std::string>& known, const std::string& word) {
  std::string best;
  std::size_t best_distance = word.size();
  for (const std::string& candidate : known)
    if (const std::size_t distance = edit_distance(word, candidate);
        distance < best_distance && 3 * distance <= candidate.size()) {
      best = candidate;
      best_distance = distance;
    }
  return best;
}

}  // namespace

std::string usage_hint(const CLI::App& app) {
  const auto parsed = app.get_subcommands();
  const CLI::App& command = parsed.empty() ? app : *parsed.front();
  const std::string help =
      parsed.empty() ? "`xraycast --help`" : fmt::format("`xraycast {} --help`", command.get_name());
  for (const std::string& word : app.remaining(true)) {
    const std::string name = word.substr(0, word.find('='));
    if (const std::string meant = closest(known_words(app, command, name), name); !meant.empty())
      return fmt::format("did you mean {}? See {}", meant, help);
  }
  return "see " + help;
}

}  // namespace xraycast::cli
