#include "xraycast/window/opacity_editor.hpp"

#include <utility>

namespace xraycast {

void OpacityEditor::open(std::shared_ptr<const BodyMap> map,
                         std::shared_ptr<OpenedFiles::RecastOnDevice> recast) {
  if (map != opened_ || recast != recast_) {
    undo_.clear();
    redo_.clear();
    opened_ = std::move(map);
    recast_ = std::move(recast);
  }
  map_ = opened_;
  if (!opened_) return;
  const auto layers = static_cast<std::size_t>(opened_->geometry.layers());
  std::vector<float>& weights = session_.style.layer_weights;
  if (weights.size() != layers) weights.assign(layers, 1.0f);
  mu_per_mm_ = at_knots(session_.opacity.value_or(opened_->opacity()));
  if (session_.opacity) set_opacity(mu_per_mm_);
}

std::span<const double> OpacityEditor::knots_hu() const {
  if (!recast_) return {};
  return recast_->basis.knots_hu;
}

std::span<const std::int64_t> OpacityEditor::hu_histogram() const {
  if (!recast_) return {};
  return recast_->basis.hu_histogram;
}

std::vector<double> OpacityEditor::at_knots(const Opacity& opacity) const {
  std::vector<double> mu_per_mm;
  for (const double hu : knots_hu()) mu_per_mm.push_back(opacity.mu_per_mm(hu));
  return mu_per_mm;
}

void OpacityEditor::begin_edit() {
  undo_.push_back(state());
  redo_.clear();
}

void OpacityEditor::set_opacity(std::span<const double> mu_per_mm) {
  if (!recast_) return;
  std::vector<Opacity::Knot> knots;
  for (std::size_t i = 0; i < mu_per_mm.size(); ++i) knots.push_back({knots_hu()[i], mu_per_mm[i]});
  const Opacity opacity("edited", std::move(knots));
  auto edited = std::make_shared<BodyMap>(recast_->session.recast(opacity));
  if (!edited->keys) edited->precision = opened_->precision;
  map_ = std::move(edited);
  session_.opacity = opacity;
  mu_per_mm_ = std::vector(mu_per_mm.begin(), mu_per_mm.end());
}

void OpacityEditor::set_knot(std::size_t knot, double mu_per_mm) {
  std::vector<double> edited = mu_per_mm_;
  edited.at(knot) = mu_per_mm;
  set_opacity(edited);
}

void OpacityEditor::toggle_layer(std::size_t layer) {
  std::vector<float>& weights = session_.style.layer_weights;
  if (layer >= weights.size()) return;
  begin_edit();
  weights[layer] = weights[layer] > 0 ? 0.0f : 1.0f;
}

void OpacityEditor::step(std::vector<State>& from, std::vector<State>& to) {
  if (from.empty()) return;
  State wanted = std::move(from.back());
  from.pop_back();
  to.push_back(state());
  session_.style.layer_weights = std::move(wanted.layer_weights);
  if (!recast_ || wanted.opacity == session_.opacity) return;
  if (wanted.opacity) return set_opacity(at_knots(*wanted.opacity));
  mu_per_mm_ = at_knots(opened_->opacity());
  session_.opacity.reset();
  map_ = opened_;
}

}  // namespace xraycast
