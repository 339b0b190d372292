#include "xraycast/centrelines/tree_of_lines.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/union_find.hpp"
#include "xraycast/centrelines/joined_lines.hpp"
#include "xraycast/centrelines/line_names.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <utility>

namespace xraycast {
namespace {

/// The graph's points between two forks or ends, both of which it includes.
struct Chain {
  std::vector<int> points;
  double length_mm = 0;
  double mean_radius_mm = 0;  ///< along its length
};

/// From a graph to a tree's branches.
class TreeGrowth {
 public:
  TreeGrowth(JoinedLines lines, std::string name) : lines_(std::move(lines)), name_(std::move(name)) {
    neighbours_.resize(lines_.points.size());
    for (const auto& [a, b] : lines_.edges) {
      neighbours_[index(a)].push_back(b);
      neighbours_[index(b)].push_back(a);
    }
  }

  TreeOfLines grow(const TreeOfLinesOptions& options) && {
    notes_of_lines();
    choose_component(options);
    find_chains();
    cut_loops();
    if (lines_.roots.empty()) leave_spurs_out();
    const int root = find_root(options);
    VesselTree tree(branches_from(root), name_);
    return {std::move(tree),       std::move(loops_),    loops_cut_,
            lines_.doubled_points, components_left_out_, std::move(notes_)};
  }

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  const VesselPoint& point(int i) const { return lines_.points[index(i)]; }
  double distance(int a, int b) const { return glm::distance(point(a).position_mm, point(b).position_mm); }

  void notes_of_lines() {
    if (lines_.doubled_points > 0)
      notes_.push_back(fmt::format("{}: {} left out that coincided with the one before", name_,
                                   pluralize(lines_.doubled_points, "point")));
    if (lines_.short_lines > 0)
      notes_.push_back(fmt::format("{}: {} left out of fewer than two points", name_,
                                   pluralize(lines_.short_lines, "line")));
  }

  // ---- components ---------------------------------------------------------------------------------------

  /// Marks the points of the one that is kept.
  void choose_component(const TreeOfLinesOptions& options) {
    UnionFind sets(lines_.points.size());
    for (const auto& [a, b] : lines_.edges) sets.unite(index(a), index(b));
    std::vector<double> length_mm(lines_.points.size(), 0);
    for (const auto& [a, b] : lines_.edges) length_mm[sets.find(index(a))] += distance(a, b);
    const auto components = std::ranges::count_if(length_mm, [](double length) { return length > 0; });
    if (components == 0)
      throw InputError("{}: no line has a length; give lines of two points or more", name_);

    std::size_t kept = index(std::ranges::max_element(length_mm) - length_mm.begin());
    if (const auto near_mm = options.component_mm ? options.component_mm : options.root_mm)
      kept = sets.find(nearest_point(*near_mm));
    is_kept_.resize(lines_.points.size());
    double others_mm = 0;
    for (std::size_t i = 0; i < is_kept_.size(); ++i) {
      is_kept_[i] = sets.find(i) == kept;
      if (i != kept) others_mm += length_mm[i];
    }
    components_left_out_ = static_cast<int>(components) - 1;
    if (components_left_out_ > 0)
      notes_.push_back(fmt::format("{}: {} left out that {} not connected with the tree, {:.0f} mm long",
                                   name_, pluralize(components_left_out_, "piece"),
                                   components_left_out_ == 1 ? "is" : "are", others_mm));
  }

  static std::size_t index(std::ptrdiff_t i) { return static_cast<std::size_t>(i); }

  /// Of those on an edge.
  std::size_t nearest_point(const glm::dvec3& near_mm) const {
    std::size_t best = 0;
    double best_mm = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < lines_.points.size(); ++i) {
      const double away_mm = glm::distance(lines_.points[i].position_mm, near_mm);
      if (neighbours_[i].empty() || away_mm >= best_mm) continue;
      best = i;
      best_mm = away_mm;
    }
    return best;
  }

  // ---- chains and loops ---------------------------------------------------------------------------------

  bool is_node(int i) const { return neighbours_[index(i)].size() != 2; }

  void find_chains() {
    is_passed_.resize(lines_.points.size());
    bool has_node = false;
    int widest = -1;
    for (int i = 0; i < static_cast<int>(is_kept_.size()); ++i) {
      if (!is_kept_[index(i)]) continue;
      has_node = has_node || is_node(i);
      if (widest < 0 || point(i).radius_mm > point(widest).radius_mm) widest = i;
    }
    ring_node_ = has_node ? -1 : widest;  // a ring is cut there
    for (int i = 0; i < static_cast<int>(is_kept_.size()); ++i)
      if (is_kept_[index(i)] && (is_node(i) || i == ring_node_))
        for (const int next : neighbours_[index(i)]) follow(i, next);
  }

  /// Each chain is met at both of its ends, and kept once.
  void follow(int from, int next) {
    Chain chain{{from}};
    double area = 0;
    for (int at = from;; next = onwards(next, std::exchange(at, next))) {
      const double step_mm = distance(at, next);
      chain.length_mm += step_mm;
      area += step_mm * 0.5 * (point(at).radius_mm + point(next).radius_mm);
      chain.points.push_back(next);
      if (is_node(next) || next == ring_node_) break;
      if (is_passed_[index(next)]) return;
      is_passed_[index(next)] = true;
    }
    if (chain.points.size() == 2 && chain.points[1] < from) return;
    chain.mean_radius_mm = area / chain.length_mm;
    chains_.push_back(std::move(chain));
  }

  /// The other neighbour of a point with two.
  int onwards(int at, int from) const {
    const auto& both = neighbours_[index(at)];
    return both[0] == from ? both[1] : both[0];
  }

  /// The thinnest piece of each loop ends in a point of its own, inside the lumen that it went on in.
  void cut_loops() {
    std::ranges::stable_sort(chains_, std::greater(), &Chain::mean_radius_mm);
    UnionFind sets(lines_.points.size());
    for (Chain& chain : chains_) {
      if (sets.unite(index(chain.points.front()), index(chain.points.back()))) continue;
      if (point(chain.points.front()).radius_mm > point(chain.points.back()).radius_mm)
        std::ranges::reverse(chain.points);
      lines_.points.push_back(point(chain.points.back()));
      chain.points.back() = static_cast<int>(lines_.points.size()) - 1;
      ++loops_cut_;
    }
    at_node_.resize(lines_.points.size());
    for (int i = 0; i < static_cast<int>(chains_.size()); ++i)
      for (const int end : {chains_[index(i)].points.front(), chains_[index(i)].points.back()})
        at_node_[index(end)].push_back(i);
    if (loops_cut_ > 0)
      notes_.push_back(fmt::format("{}: {} cut where the thinnest piece meets the wider vessel", name_,
                                   pluralize(loops_cut_, "loop")));
  }

  /// Where lines were joined beside their ends, these stick out into the lumen, which they do not leave.
  void leave_spurs_out() {
    std::vector<int> shortest_first(chains_.size());
    std::iota(shortest_first.begin(), shortest_first.end(), 0);
    std::ranges::stable_sort(shortest_first, {}, [&](int i) { return chains_[index(i)].length_mm; });
    int left_out = 0;
    for (const int i : shortest_first) {
      int end = chains_[index(i)].points.front(), node = chains_[index(i)].points.back();
      if (at_node_[index(end)].size() > 1) std::swap(end, node);
      if (at_node_[index(end)].size() > 1 || at_node_[index(node)].size() < 3) continue;
      if (std::ranges::any_of(chains_[index(i)].points,
                              [&](int at) { return distance(at, node) > point(node).radius_mm; }))
        continue;
      at_node_[index(end)].clear();
      std::erase(at_node_[index(node)], i);
      ++left_out;
    }
    if (left_out > 0)
      notes_.push_back(fmt::format("{}: {} left out that {} the lumen of another branch", name_,
                                   pluralize(left_out, "spur"),
                                   left_out == 1 ? "does not leave" : "do not leave"));
  }

  // ---- the root -----------------------------------------------------------------------------------------

  int find_root(const TreeOfLinesOptions& options) {
    std::vector<int> ends;
    for (std::size_t i = 0; i < neighbours_.size(); ++i)  // where a loop was cut, no tree begins
      if (at_node_[i].size() == 1) ends.push_back(static_cast<int>(i));
    if (ends.empty()) ends.push_back(static_cast<int>(neighbours_.size()));  // but a ring does
    if (options.root_mm) {
      const auto away_mm = [&](int end) { return glm::distance(point(end).position_mm, *options.root_mm); };
      const int root = *std::ranges::min_element(ends, {}, away_mm);
      check_near_end(point(root).position_mm, *options.root_mm, name_ + ": `root_mm`");
      return root;
    }
    for (const int root : lines_.roots)
      if (std::ranges::binary_search(ends, root)) return root;
    const int root = likely_root(ends);
    const glm::dvec3& at = point(root).position_mm;
    notes_.push_back(
        fmt::format("{}: the tree begins at {:.0f},{:.0f},{:.0f}; give `root_mm` for another end", name_,
                    at.x, at.y, at.z));
    return root;
  }

  /// At which most lines start, if that tells it; else the widest.
  int likely_root(const std::vector<int>& ends) const {
    std::vector<int> starting(lines_.points.size(), 0);
    for (const int start : lines_.starts) ++starting[index(start)];
    const auto starts = [&](int end) { return starting[index(end)]; };
    const int most = *std::ranges::max_element(ends, {}, starts);
    const auto rivals = std::ranges::count_if(ends, [&](int end) { return starts(end) == starts(most); });
    if (starts(most) > 0 && rivals == 1) return most;
    return *std::ranges::max_element(ends, {}, [&](int end) { return point(end).radius_mm; });
  }

  // ---- branches -----------------------------------------------------------------------------------------

  std::vector<VesselBranch> branches_from(int root) {
    struct Start {
      int node, chain, parent;
    };
    std::vector<VesselBranch> branches;
    std::vector<Start> waiting{{root, at_node_[index(root)].front(), -1}};
    while (!waiting.empty()) {
      auto [node, chain, parent] = waiting.back();
      waiting.pop_back();
      VesselBranch branch;
      branch.parent = parent;
      branch.points.push_back(point(node));
      for (;;) {  // a node that a loop left is none any more
        node = append(branch, chains_[index(chain)], node);
        const std::vector<int>& here = at_node_[index(node)];
        if (here.size() != 2) break;
        chain = here[0] == chain ? here[1] : here[0];
      }
      if (is_cut(node)) loops_.push_back(static_cast<int>(branches.size()));
      for (const int next : at_node_[index(node)])
        if (next != chain) waiting.push_back({node, next, static_cast<int>(branches.size())});
      branches.push_back(std::move(branch));
    }
    return branches;
  }

  /// Where loops were cut, points were added.
  bool is_cut(int node) const { return index(node) >= neighbours_.size(); }

  /// Returns the node at the chain's other end.
  int append(VesselBranch& branch, const Chain& chain, int from) const {
    const bool is_forwards = chain.points.front() == from;
    for (std::size_t k = 1; k < chain.points.size(); ++k)
      branch.points.push_back(point(chain.points[is_forwards ? k : chain.points.size() - 1 - k]));
    return is_forwards ? chain.points.back() : chain.points.front();
  }

  JoinedLines lines_;
  std::string name_;
  std::vector<std::vector<int>> neighbours_;
  std::vector<bool> is_kept_, is_passed_;
  std::vector<Chain> chains_;
  std::vector<std::vector<int>> at_node_;  ///< the chains at each point that ends some
  int ring_node_ = -1, loops_cut_ = 0, components_left_out_ = 0;
  std::vector<int> loops_;  ///< branches that end where a loop was cut
  std::vector<std::string> notes_;
};

}  // namespace

TreeOfLines tree_of_lines(const std::vector<CentrelineLine>& lines, const std::string& name,
                          const TreeOfLinesOptions& options) {
  return with_remedy(name, "correct the centrelines", [&] {
    TreeOfLines found = TreeGrowth(joined_lines(lines, name), name).grow(options);
    found.tree = with_names_of_lines(found.tree, lines);
    return found;
  });
}

}  // namespace xraycast
