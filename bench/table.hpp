#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace xraycast::bench {

/// One line of the results: a measured time against its baseline from the same run.
struct Row {
  /// Of the ratio, or of the difference in milliseconds.
  enum class Bar { at_most, at_least, at_most_more_ms, reported };

  std::string name;
  std::string baseline;  ///< a benchmark's name; empty: none
  Bar bar = Bar::reported;
  double limit = 0;
};

/// Median times by benchmark, in milliseconds.
using Times = std::map<std::string, double>;

/// baseline / value for at_least, otherwise value / baseline; nothing without a baseline.
std::optional<double> ratio(const Row& row, const Times& times);

/// Prints the table to stdout, for the rows whose benchmarks ran.
void print_table(const std::vector<Row>& rows, const Times& times);

/// A list of {"name", "value_ms", "baseline", "baseline_ms", "ratio"}.
void write_json(const std::vector<Row>& rows, const Times& times, const std::string& path);

}  // namespace xraycast::bench
