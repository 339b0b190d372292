// The SWC format: https://swc-specification.readthedocs.io/en/latest/swc.html
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/centrelines/stored_centrelines.hpp"
#include "xraycast/geometry/text_lines.hpp"

#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

namespace xraycast {
namespace {

struct SwcSample {
  glm::dvec3 position;
  double radius;
  std::int64_t parent_id;
  std::vector<int> children = {};
};

class SwcReader {
 public:
  SwcReader(std::string_view text, std::string name) : lines_(text, name), name_(std::move(name)) {}

  std::vector<CentrelineLine> read() {
    while (const auto line = lines_.next())
      if (!line->empty() && !line->starts_with('#')) read_sample(*line);
    link();
    follow();
    return std::move(branches_);
  }

 private:
  void read_sample(std::string_view words) {
    SwcSample sample{};
    const std::int64_t id = whole(words);
    take_word(words);  // the type
    for (int axis = 0; axis < 3; ++axis) sample.position[axis] = real(words);
    sample.radius = real(words);
    sample.parent_id = whole(words);
    if (!index_.emplace(id, static_cast<int>(samples_.size())).second)
      lines_.fail("two samples have the id {}", id);
    samples_.push_back(std::move(sample));
  }

  std::int64_t whole(std::string_view& words) const {
    const std::string_view word = take_word(words);
    std::int64_t number = 0;
    if (!parse_whole(word, number)) lines_.fail("\"{}\" is not a whole number", excerpt(word));
    return number;
  }

  double real(std::string_view& words) const {
    const std::string_view word = take_word(words);
    const auto number = real_number(word);
    if (!number) lines_.fail("\"{}\" is not a number", excerpt(word));
    return *number;
  }

  /// A sample's parent may follow it.
  void link() {
    for (int i = 0; i < static_cast<int>(samples_.size()); ++i) {
      const std::int64_t id = samples_[static_cast<std::size_t>(i)].parent_id;
      if (const auto parent = index_.find(id); parent != index_.end())
        samples_[static_cast<std::size_t>(parent->second)].children.push_back(i);
      else if (id > 0)
        throw InputError("{}: the parent {} does not exist", name_, id);
      else
        roots_.push_back(i);
    }
  }

  /// From each root, and then from each fork, along the samples of one child.
  void follow() {
    struct Start {
      int from, to, line;
    };
    std::vector<Start> waiting;
    std::size_t reached = roots_.size();
    const auto branch_off = [&](int from, int line) {
      for (const int child : samples_[static_cast<std::size_t>(from)].children)
        waiting.push_back({from, child, line});
    };
    for (const int root : roots_) branch_off(root, -1);
    while (!waiting.empty()) {
      const auto [from, to, parent] = waiting.back();
      waiting.pop_back();
      CentrelineLine line;
      line.parent = parent;
      add(line, from);
      int at = to;
      for (++reached; add(line, at).size() == 1; ++reached)
        at = samples_[static_cast<std::size_t>(at)].children[0];
      branch_off(at, static_cast<int>(branches_.size()));
      branches_.push_back(std::move(line));
    }
    if (reached != samples_.size()) throw InputError("{}: the parents of samples form a cycle", name_);
  }

  /// Returns the sample's children.
  const std::vector<int>& add(CentrelineLine& line, int sample) const {
    const SwcSample& added = samples_[static_cast<std::size_t>(sample)];
    line.points_mm.push_back(added.position);
    line.radii_mm.push_back(added.radius);
    return added.children;
  }

  TextLines lines_;
  std::string name_;
  std::vector<SwcSample> samples_;
  std::unordered_map<std::int64_t, int> index_;
  std::vector<int> roots_;
  std::vector<CentrelineLine> branches_;
};

}  // namespace

StoredCentrelines read_swc(const std::filesystem::path& path) {
  const std::string text = read_whole_file(path);
  return {SwcReader(text, path.string()).read(), false};
}

}  // namespace xraycast
