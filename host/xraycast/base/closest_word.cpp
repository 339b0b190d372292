#include "xraycast/base/closest_word.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <string_view>

namespace xraycast {
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

}  // namespace

std::string closest_word(const std::vector<std::string>& known, const std::string& word) {
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

}  // namespace xraycast
