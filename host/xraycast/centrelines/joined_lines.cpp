#include "xraycast/centrelines/joined_lines.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/union_find.hpp"
#include "xraycast/geometry/segment_index.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

namespace xraycast {
namespace {

constexpr double kSamePoint_mm = 1e-3;  // as a branch's start and its parent's end may be apart
/// Lines that stay that close, as a share of the radius, are one: well below the radius, so that two vessels
/// that touch are not, and above what smoothing and resampling move a line.
constexpr double kTogether = 0.25;
/// A line leaves another at an angle of 5 degrees or more within this many radii; lines that stay together
/// longer than that after their last common point were smoothed apart.
constexpr double kLeaving = 3;
/// What a chord between two common points may bulge, as a share of its length, to run together with a line.
constexpr double kBulge = 0.15;

/// A place on one of the segments so far.
struct Place {
  int segment;
  double fraction, radius_mm, distance_mm;
  glm::dvec3 centre_mm;
};

Place place_of(const SegmentIndex::Nearest& nearest) {
  const auto& [segment, fraction, distance_mm] = nearest;
  return {segment.branch, fraction, nearest.radius_mm(), distance_mm,
          segment.start_mm + fraction * (segment.end_mm - segment.start_mm)};
}

/// Indices over ever more segments, in groups at least twice as large as the next, so that each segment is
/// indexed again a logarithmic number of times only (Bentley and Saxe, Decomposable searching problems I,
/// 1980).
class GrowingIndex {
 public:
  void add(std::vector<SegmentIndex::Segment> segments) {
    if (segments.empty()) return;
    while (!groups_.empty() && groups_.back().size() <= 2 * segments.size()) {
      segments.insert(segments.end(), groups_.back().begin(), groups_.back().end());
      groups_.pop_back();
      indices_.pop_back();
    }
    indices_.emplace_back(segments);
    groups_.push_back(std::move(segments));
  }

  std::optional<Place> nearest(const glm::dvec3& point_mm) const {
    std::optional<Place> best;
    for (const SegmentIndex& index : indices_)
      if (const auto found = index.nearest(point_mm); !best || found.distance_mm < best->distance_mm)
        best = place_of(found);
    return best;
  }

 private:
  std::vector<std::vector<SegmentIndex::Segment>> groups_;
  std::vector<SegmentIndex> indices_;
};

/// Points of one line from `first` to `last`.
struct Run {
  std::size_t first, last;
};

class LineJoiner {
 public:
  explicit LineJoiner(std::string name) : name_(std::move(name)) {}

  void add_by_place(const std::vector<CentrelineLine>& lines) {
    for (const CentrelineLine& line : lines) add_apart(cleaned(line));
    join_ends();
  }

  void add_by_parents(const std::vector<CentrelineLine>& lines) {
    std::vector<std::array<int, 2>> ends;
    std::map<std::tuple<double, double, double>, int> roots;
    for (const CentrelineLine& line : lines) {
      const std::vector<VesselPoint> points = cleaned(line);
      if (points.empty()) throw InputError("{}: line {} has no points", name_, ends.size());
      const int first = add_piece(points);
      ends.push_back({first, static_cast<int>(joined_.points.size()) - 1});
      if (points.size() > 1) joined_.starts.push_back(first);
      if (line.parent >= 0) continue;
      joined_.roots.push_back(first);
      const glm::dvec3& at = points.front().position_mm;
      if (const auto [root, added] = roots.try_emplace({at.x, at.y, at.z}, first); !added)
        unite(root->second, first);
    }
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (lines[i].parent < 0) continue;
      if (lines[i].parent >= static_cast<int>(lines.size()))
        throw InputError("{}: line {}: its parent {} does not exist", name_, i, lines[i].parent);
      join(ends[static_cast<std::size_t>(lines[i].parent)][1], ends[i][0]);
    }
  }

  /// Points that are one become one.
  JoinedLines finish() {
    split_segments();
    for (const auto& [a, b] : joined_.edges)
      if (distance(a, b) <= 1e-3 * kSamePoint_mm) unite(a, b);
    std::vector<int> number(joined_.points.size(), -1);
    std::vector<VesselPoint> kept;
    for (std::size_t i = 0; i < joined_.points.size(); ++i)
      if (same_.find(i) == i) {
        number[i] = static_cast<int>(kept.size());
        kept.push_back(joined_.points[i]);
      }
    const auto renumber = [&](int& point) { point = number[same_.find(static_cast<std::size_t>(point))]; };
    for (int& start : joined_.starts) renumber(start);
    for (int& root : joined_.roots) renumber(root);
    for (auto& edge : joined_.edges) {
      for (int& point : edge) renumber(point);
      std::ranges::sort(edge);
    }
    std::erase_if(joined_.edges, [](const auto& edge) { return edge[0] == edge[1]; });
    std::ranges::sort(joined_.edges);
    joined_.edges.erase(std::unique(joined_.edges.begin(), joined_.edges.end()), joined_.edges.end());
    joined_.points = std::move(kept);
    return std::move(joined_);
  }

 private:
  // ---- points and edges ---------------------------------------------------------------------------------

  const VesselPoint& point(int i) const { return joined_.points[static_cast<std::size_t>(i)]; }
  double distance(int a, int b) const { return glm::distance(point(a).position_mm, point(b).position_mm); }

  int add_point(const VesselPoint& point) {
    joined_.points.push_back(point);
    same_.add();
    connected_.add();
    return static_cast<int>(joined_.points.size()) - 1;
  }

  void unite(int kept, int merged) {
    same_.unite(static_cast<std::size_t>(kept), static_cast<std::size_t>(merged));
    connect(kept, merged);
  }

  void connect(int a, int b) { connected_.unite(static_cast<std::size_t>(a), static_cast<std::size_t>(b)); }

  void add_edge(int a, int b) {
    joined_.edges.push_back({a, b});
    connect(a, b);
  }

  /// By an edge, where the points are apart.
  void join(int a, int b) {
    if (distance(a, b) <= kSamePoint_mm)
      unite(a, b);
    else
      add_edge(a, b);
  }

  /// A point of the graph there.
  int add_place(const Place& place) {
    const int at = add_point({place.centre_mm, place.radius_mm});
    const auto& [a, b] = segments_[static_cast<std::size_t>(place.segment)];
    inserted_[static_cast<std::size_t>(place.segment)].emplace_back(place.fraction, at);
    connect(a, at);
    return at;
  }

  /// A segment that others may be joined to later.
  void add_segment(int a, int b, std::vector<SegmentIndex::Segment>& added) {
    if (distance(a, b) <= 1e-3 * kSamePoint_mm) return unite(a, b);
    added.push_back({point(a).position_mm, point(b).position_mm, point(a).radius_mm, point(b).radius_mm,
                     static_cast<int>(segments_.size()), 0});
    segments_.push_back({a, b});
    piece_of_.push_back(static_cast<int>(piece_ends_.size()));
    inserted_.emplace_back();
    connect(a, b);
  }

  /// Returns the first of its points, which have consecutive numbers.
  int add_piece(const std::vector<VesselPoint>& points) {
    const int first = static_cast<int>(joined_.points.size());
    for (const VesselPoint& point : points) {
      const int at = add_point(point);
      if (at > first) add_edge(at - 1, at);
    }
    return first;
  }

  std::vector<VesselPoint> cleaned(const CentrelineLine& line) {
    if (line.radii_mm.size() != line.points_mm.size())
      throw InputError("{}: a line of {} points has {} radii", name_, line.points_mm.size(),
                       line.radii_mm.size());
    std::vector<VesselPoint> points;
    for (std::size_t k = 0; k < line.points_mm.size(); ++k) {
      const glm::dvec3& at = line.points_mm[k];
      if (!std::isfinite(at.x + at.y + at.z) || !(line.radii_mm[k] > 0) || !std::isfinite(line.radii_mm[k]))
        throw InputError("{}: point {} of a line is not finite, or its radius is not above zero", name_, k);
      if (!points.empty() && glm::distance(points.back().position_mm, at) <= kSamePoint_mm)
        ++joined_.doubled_points;
      else
        points.push_back({at, line.radii_mm[k]});
    }
    joined_.short_lines += points.size() < 2;
    return points;
  }

  // ---- what lines have in common ------------------------------------------------------------------------

  /// Adds those parts of a line that run apart from all before it.
  void add_apart(const std::vector<VesselPoint>& line) {
    if (line.size() < 2) return;
    std::vector<SegmentIndex::Segment> added;
    std::vector<std::optional<Place>> places;
    for (const VesselPoint& point : line) places.push_back(place_together(point));
    const std::vector<Run> runs = runs_together(line, places);

    int at = -1;           // the graph's point that the next one is joined to
    std::size_t next = 0;  // the line's point that is to be added
    int first = -1;
    const auto go_to = [&](int to) {
      if (at >= 0) add_segment(at, to, added);
      if (first < 0) first = to;
      at = to;
    };
    const auto add_until = [&](std::size_t end) {
      for (; next < end; ++next) go_to(add_point(line[next]));
    };
    for (const Run& run : runs) {
      add_until(run.first);
      go_to(add_place(*places[run.first]));
      if (run.last > run.first) at = add_place(*places[run.last]);
      next = run.last + 1;
    }
    add_until(line.size());
    std::vector<int>& ends = piece_ends_.emplace_back();
    if (runs.empty() || runs.front().first > 0) ends.push_back(first);
    if (runs.empty() || runs.back().last + 1 < line.size()) ends.push_back(at);
    if (runs.empty() && line.size() > 3 && distance(first, at) <= kSamePoint_mm)
      unite(first, at);  // a closed curve
    joined_.starts.push_back(first);
    index_.add(std::move(added));
  }

  /// Where a point lies on lines before it.
  std::optional<Place> place_together(const VesselPoint& point) const {
    const auto place = index_.nearest(point.position_mm);
    if (!place) return {};
    const double within_mm = std::max(kSamePoint_mm, kTogether * std::min(point.radius_mm, place->radius_mm));
    return place->distance_mm <= within_mm ? place : std::nullopt;
  }

  static bool coincides(const std::optional<Place>& place) {
    return place && place->distance_mm <= kSamePoint_mm;
  }

  /// Whether the segment between two points that lie on lines lies on them too.
  bool stays(const VesselPoint& a, const VesselPoint& b, bool both_coincide) const {
    const VesselPoint middle{0.5 * (a.position_mm + b.position_mm), 0.5 * (a.radius_mm + b.radius_mm)};
    const auto place = place_together(middle);
    if (!place) return false;
    const double bulge_mm = kBulge * glm::distance(a.position_mm, b.position_mm);
    return !both_coincide || place->distance_mm <= std::max(kSamePoint_mm, bulge_mm);
  }

  std::vector<Run> runs_together(const std::vector<VesselPoint>& line,
                                 const std::vector<std::optional<Place>>& places) const {
    std::vector<Run> runs;
    for (std::size_t k = 0; k < line.size(); ++k) {
      if (!places[k]) continue;
      Run run{k, k};
      while (run.last + 1 < line.size() && places[run.last + 1] &&
             stays(line[run.last], line[run.last + 1],
                   coincides(places[run.last]) && coincides(places[run.last + 1])))
        ++run.last;
      k = run.last;
      if (trim(run, line, places)) runs.push_back(run);
    }
    return runs;
  }

  /// Ends a run at its last points that coincide, if the lines part soon after; false for a run that is but
  /// a line passing close by.
  bool trim(Run& run, const std::vector<VesselPoint>& line,
            const std::vector<std::optional<Place>>& places) const {
    const auto length = [&](std::size_t from, std::size_t to) {
      double sum = 0;
      for (; from < to; ++from) sum += glm::distance(line[from].position_mm, line[from + 1].position_mm);
      return sum;
    };
    std::size_t first = run.first, last = run.last;
    while (first < run.last && !coincides(places[first])) ++first;
    while (last > run.first && !coincides(places[last])) --last;
    const bool begins = run.first == 0, ends = run.last + 1 == line.size();
    if (!coincides(places[first]))
      return begins || ends || length(run.first, run.last) > kLeaving * line[run.first].radius_mm;
    if (!begins && length(run.first, first) <= kLeaving * line[first].radius_mm) run.first = first;
    if (!ends && length(last, run.last) <= kLeaving * line[last].radius_mm) run.last = last;
    return true;
  }

  // ---- ends that lie within other lines -----------------------------------------------------------------

  struct EndJoin {
    int end;
    Place place;
  };

  /// The nearest ends first, and only what is not connected yet.
  void join_ends() {
    if (segments_.empty()) return;
    std::vector<SegmentIndex::Segment> all;
    double widest_mm = 0;
    for (std::size_t i = 0; i < segments_.size(); ++i) {
      const auto& [a, b] = segments_[i];
      all.push_back({point(a).position_mm, point(b).position_mm, point(a).radius_mm, point(b).radius_mm,
                     static_cast<int>(i), 0});
      widest_mm = std::max({widest_mm, point(a).radius_mm, point(b).radius_mm});
    }
    const SegmentIndex index(std::move(all));
    for (bool has_joined = true; has_joined;) {
      std::vector<EndJoin> found;
      for (const std::vector<int>& ends : piece_ends_)
        for (const int end : ends)
          if (const auto place = place_elsewhere(end, index, widest_mm)) found.push_back({end, *place});
      std::ranges::stable_sort(found, {}, [](const EndJoin& join) { return join.place.distance_mm; });
      has_joined = false;
      for (const auto& [end, place] : found) {
        if (is_connected(end, segments_[static_cast<std::size_t>(place.segment)][0])) continue;
        const std::optional<int> other = free_end_near(place);
        join(other ? *other : add_place(place), end);
        has_joined = true;
      }
    }
  }

  /// The end of the line that the place is on, if it lies in the lumen there: so that no stub is left over.
  std::optional<int> free_end_near(const Place& place) const {
    for (const int end :
         piece_ends_[static_cast<std::size_t>(piece_of_[static_cast<std::size_t>(place.segment)])])
      if (glm::distance(point(end).position_mm, place.centre_mm) <=
          std::max(point(end).radius_mm, place.radius_mm))
        return end;
    return {};
  }

  bool is_connected(int a, int b) {
    return connected_.find(static_cast<std::size_t>(a)) == connected_.find(static_cast<std::size_t>(b));
  }

  /// On a line that is not connected with the end, whose lumen it lies in.
  std::optional<Place> place_elsewhere(int end, const SegmentIndex& index, double widest_mm) {
    const auto found =
        index.nearest(point(end).position_mm, widest_mm, [&](const SegmentIndex::Nearest& nearest) {
          const Place place = place_of(nearest);
          return place.distance_mm <= place.radius_mm &&
                 !is_connected(end, segments_[static_cast<std::size_t>(place.segment)][0]);
        });
    if (!found) return {};
    return place_of(*found);
  }

  // ---- the graph ----------------------------------------------------------------------------------------

  /// Segments become edges between the points that were inserted into them.
  void split_segments() {
    for (std::size_t i = 0; i < segments_.size(); ++i) {
      auto& inserted = inserted_[i];
      std::ranges::sort(inserted);
      int at = segments_[i][0];
      const int end = segments_[i][1];
      for (const auto& [fraction, next] : inserted) {
        if (distance(end, next) <= kSamePoint_mm) {
          unite(end, next);
        } else if (distance(at, next) <= kSamePoint_mm) {
          unite(at, next);
        } else {
          add_edge(at, next);
          at = next;
        }
      }
      add_edge(at, end);
    }
  }

  std::string name_;
  JoinedLines joined_;
  UnionFind same_, connected_;
  std::vector<std::array<int, 2>> segments_;
  std::vector<std::vector<std::pair<double, int>>> inserted_;  ///< fraction and point, for each segment
  std::vector<int> piece_of_;                                  ///< for each segment, the line
  std::vector<std::vector<int>> piece_ends_;  ///< of each line, those that lie on none before it
  GrowingIndex index_;
};

}  // namespace

JoinedLines joined_lines(const std::vector<CentrelineLine>& lines, const std::string& name) {
  LineJoiner joiner(name);
  if (std::ranges::any_of(lines, [](const CentrelineLine& line) { return line.parent >= 0; }))
    joiner.add_by_parents(lines);
  else
    joiner.add_by_place(lines);
  return joiner.finish();
}

}  // namespace xraycast
