#pragma once

#include <cstddef>
#include <vector>

namespace xraycast {

/// Disjoint sets of the numbers from 0 on (union-find with path halving: Tarjan and van Leeuwen, Worst-case
/// analysis of set union algorithms, 1984). The caller of unite chooses which representative stays, since
/// callers attach data to it.
class UnionFind {
 public:
  /// Sets of one element each.
  explicit UnionFind(std::size_t count = 0) {
    while (parents_.size() < count) add();
  }

  /// Adds an element as a set of its own. Returns its number.
  std::size_t add() {
    parents_.push_back(parents_.size());
    return parents_.size() - 1;
  }

  /// The representative of an element's set.
  std::size_t find(std::size_t element) {
    while (parents_[element] != element) element = parents_[element] = parents_[parents_[element]];
    return element;
  }

  /// Merges the set of `merged` into the set of `kept`, whose representative stays. Returns false where both
  /// are in one set already.
  bool unite(std::size_t kept, std::size_t merged) {
    const std::size_t root = find(kept), other = find(merged);
    parents_[other] = root;
    return root != other;
  }

 private:
  std::vector<std::size_t> parents_;
};

}  // namespace xraycast
