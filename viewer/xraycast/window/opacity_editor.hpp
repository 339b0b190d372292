#pragma once

#include "xraycast/scene/session_file.hpp"
#include "xraycast/window/opened_files.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace xraycast {

/// Edits a session's opacity, by recasting the map from a basis, and the weights of the map's layers, with
/// undo and redo.
class OpacityEditor {
 public:
  /// `session` must outlive the editor.
  explicit OpacityEditor(ViewSession& session) : session_(session) {}

  /// Takes over the opened files, and recasts the map if the session has an opacity. `recast` may be null:
  /// the opacity is then that of the map. The history is cleared when either has changed.
  void open(std::shared_ptr<const BodyMap> map, std::shared_ptr<OpenedFiles::RecastOnDevice> recast);

  /// As opened, or with the opacity of the session; null before a map was opened.
  const std::shared_ptr<const BodyMap>& map() const { return map_; }

  bool can_recast() const { return recast_ != nullptr; }

  /// The basis' knots, mu at them, and the scan's histogram; empty where the map cannot be recast.
  std::span<const double> knots_hu() const;
  std::span<const double> mu_per_mm() const { return mu_per_mm_; }
  std::span<const std::int64_t> hu_histogram() const;

  /// Saves the present state for undo. To be called before an edit, or before the first of a drag.
  void begin_edit();

  /// Recasts the map with these values at the knots. Throws DeviceError.
  void set_opacity(std::span<const double> mu_per_mm);
  void set_knot(std::size_t knot, double mu_per_mm);

  /// Hides a layer, or shows it with weight 1; as an edit of its own.
  void toggle_layer(std::size_t layer);

  void undo() { step(undo_, redo_); }
  void redo() { step(redo_, undo_); }

 private:
  struct State {
    std::optional<Opacity> opacity;  ///< none: the map's own
    std::vector<float> layer_weights;
  };

  State state() const { return {session_.opacity, session_.style.layer_weights}; }
  std::vector<double> at_knots(const Opacity& opacity) const;
  void step(std::vector<State>& from, std::vector<State>& to);

  ViewSession& session_;
  std::shared_ptr<const BodyMap> opened_, map_;
  std::shared_ptr<OpenedFiles::RecastOnDevice> recast_;
  std::vector<double> mu_per_mm_;
  std::vector<State> undo_, redo_;
};

}  // namespace xraycast
