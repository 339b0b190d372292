#include "xraycast/simulation/run_monitor.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <numbers>
#include <utility>

namespace xraycast {
namespace {

using ReportJson = nlohmann::ordered_json;

constexpr double kReportDegrees = 180 / std::numbers::pi, kMilli = 1000;

template <typename Value>
void put(ReportJson& json, const char* name, const std::optional<Value>& value) {
  if (value) json[name] = *value;
}

ReportJson json_of(const std::optional<double>& value) { return value ? ReportJson(*value) : ReportJson(); }

ReportJson json_of(const InstrumentFigures& f, const std::string& name) {
  return {{"name", name},
          {"tip_path_mm", f.path_mm},
          {"idle_s", f.idle_s},
          {"turned_deg", f.turned_rad * kReportDegrees},
          {"turn_backs", f.turn_backs},
          {"reversals", f.reversals},
          {"largest_force_N", f.largest_N},
          {"mean_force_N", f.mean_N},
          {"largest_torque_mNm", kMilli * f.largest_Nm},
          {"mean_torque_mNm", kMilli * f.mean_Nm},
          {"largest_wall_force_N", f.largest_wall_N},
          {"wall_impulse_Ns", f.wall_impulse_Ns},
          {"slips", f.slips},
          {"whips", f.whips},
          {"exchanges", f.exchanges}};
}

ReportJson json_of(const TreatmentFigures& f) {
  constexpr double kPercent = 100;
  const Treatment& t = f.treatment;
  ReportJson json{{"instrument", t.instrument + 1},
                  {"device", t.device},
                  {"vessel", f.vessel},
                  {"branch", t.branch},
                  {"from_mm", t.from_mm},
                  {"to_mm", t.to_mm},
                  {"from_s", f.began_s},
                  {"to_s", json_of(f.ended_s)},
                  {"opened_mm", t.opened_mm},
                  {"least_before_mm", t.least_before_mm},
                  {"least_after_mm", t.least_after_mm},
                  {"reference_mm", t.reference_mm},
                  {"stenosis_before_percent", kPercent * t.stenosis_before()},
                  {"residual_stenosis_percent", kPercent * t.residual_stenosis()},
                  {"off_narrowest_mm", t.off_narrowest_mm}};
  if (t.is_release()) {
    json["oversizing"] = t.oversizing();
    json["outward_N_mm"] = t.outward_N_mm;
    json["sheathed_rings"] = t.sheathed_rings;
  } else {
    json["largest_bar"] = t.largest_bar;
    json["occluded_s"] = t.occluded_s;
    json["balloon_to_vessel"] = t.balloon_to_vessel();
  }
  if (!t.stent) return json;
  json["stent_mm"] = t.stent_mm;
  json["stent_length_mm"] = t.stent_length_mm;
  json["malapposition_mm"] = t.malapposition.largest_mm;
  json["malapposed_percent"] = kPercent * t.malapposition.share;
  return json;
}

ReportJson json_of(const Coiling& c, const std::string& vessel) {
  constexpr double kPercent = 100;
  return {{"instrument", c.instrument + 1},
          {"device", c.device},
          {"vessel", vessel},
          {"branch", c.branch},
          {"from_s", c.from_s},
          {"to_s", c.is_detached ? ReportJson(c.to_s) : ReportJson()},
          {"coil_loop_mm", c.coil.loop_mm},
          {"coil_mm", c.laid_mm},
          {"sac_mm3", c.sac_mm3},
          {"packing_percent", kPercent * c.packing},
          {"inflow_percent", kPercent * c.inflow_share}};
}

ReportJson json_of(const Embolised& e) {
  constexpr double kPercent = 100;
  ReportJson json{{"device", "particles"}, {"vessel", e.vessel}, {"particles", e.particles}};
  if (e.branch == Embolised::kElsewhere) return json;
  json["branch"] = e.branch;
  json["periphery_percent"] = kPercent * e.open_share;
  return json;
}

/// Those that a report has room for, by the branches' numbers, as long as there are few.
std::vector<Embolised> listed(const std::vector<Embolised>& embolised) {
  constexpr std::size_t kMost = 30;
  return embolised.size() <= kMost ? embolised : most_first(embolised, kMost);
}

ReportJson json_of(const ExerciseProgress& progress) {
  const ExerciseState& state = progress.state();
  ReportJson json{{"title", progress.exercise().title}, {"is_complete", state.is_complete()},
                  {"is_passed", state.is_passed()},     {"targets", ReportJson::array()},
                  {"forbidden", ReportJson::array()},   {"forbidden_entries", ReportJson::array()},
                  {"limits", ReportJson::array()}};
  for (const ForbiddenVessel& vessel : progress.exercise().forbidden)
    json["forbidden"].push_back(vessel.name);
  for (const ExerciseState::Target& target : state.targets)
    json["targets"].push_back({{"name", target.name}, {"reached_s", json_of(target.reached_s)}});
  for (const ExerciseState::Entry& entry : state.forbidden_entries)
    json["forbidden_entries"].push_back(
        {{"name", entry.name}, {"instrument", entry.instrument + 1}, {"time_s", entry.time_s}});
  for (const ExerciseState::Limit& limit : state.limits)
    json["limits"].push_back({{"name", limit.name},
                              {"limit", limit.limit},
                              {"largest", json_of(limit.value)},
                              {"passed_s", json_of(limit.passed_s)}});
  return json;
}

ReportJson json_of(const RunSeries& series) {
  ReportJson json{{"time_s", series.time_s}, {"instruments", ReportJson::array()}};
  for (const RunSeries::Values& values : series.instruments) {
    std::vector<double> torque_mNm = values.torque_Nm;
    for (double& torque : torque_mNm) torque *= kMilli;
    ReportJson instrument({{"insertion_mm", values.insertion_mm},
                           {"tip_path_mm", values.path_mm},
                           {"force_N", values.force_N},
                           {"torque_mNm", std::move(torque_mNm)},
                           {"wall_force_N", values.wall_N}});
    if (values.mmHg.size() == series.time_s.size()) instrument["pressure_mmHg"] = values.mmHg;
    json["instruments"].push_back(std::move(instrument));
  }
  return json;
}

}  // namespace

RunMonitor::RunMonitor(const Instruments& instruments, std::vector<std::string> names,
                       std::optional<ExerciseProgress> progress)
    : names_(std::move(names)), report_(instruments), progress_(std::move(progress)) {
  names_.resize(instruments.count());
}

void RunMonitor::add(const Instruments& instruments, const RunUse& use) {
  report_.add(instruments, use);
  if (progress_) progress_->add(instruments, report_);
}

void RunMonitor::exchanged(std::size_t instrument, const Instruments& instruments, const std::string& name) {
  report_.exchanged(instrument, instruments);
  names_[instrument] = name;
}

std::string RunMonitor::json(bool has_series) const {
  const RunFigures& figures = report_.figures();
  ReportJson json{{"version", 1}, {"time_s", figures.time_s}, {"idle_s", figures.idle_s}};
  put(json, "fluoroscopy_s", figures.use.fluoroscopy_s);
  put(json, "exposures", figures.use.exposures);
  put(json, "air_kerma_mGy", figures.use.air_kerma_mGy);
  put(json, "dap_Gycm2", figures.use.dap_Gycm2);
  put(json, "injected_ml", figures.use.contrast_ml);
  put(json, "cine_runs", figures.use.cine_runs);
  json["instruments"] = ReportJson::array();
  for (std::size_t d = 0; d < names_.size(); ++d)
    json["instruments"].push_back(json_of(figures.instruments[d], names_[d]));
  for (const TreatmentFigures& treatment : figures.treatments)
    json["treatments"].push_back(json_of(treatment));
  for (const Coiling& coiling : figures.coilings)
    json["treatments"].push_back(json_of(coiling, coiling.vessel));
  for (const Embolised& embolised : listed(figures.use.embolised))
    json["treatments"].push_back(json_of(embolised));
  if (progress_) json["exercise"] = json_of(*progress_);
  if (!has_series) return json.dump();
  json["series"] = json_of(report_.series());
  if (report_.is_series_cut()) {
    constexpr double kHour_s = 3600;
    const double hours = RunReport::kSeries_s * static_cast<double>(RunReport::kMostSeries) / kHour_s;
    json["notes"] = ReportJson::array(
        {fmt::format("the values over time end after {:g} h; the figures are of all of the run", hours)});
  }
  return json.dump();
}

std::string in_words(const ExerciseProgress& progress) {
  const ExerciseState& state = progress.state();
  std::string text = progress.exercise().title + (state.is_passed()     ? ": passed"
                                                  : state.is_complete() ? ": complete, but not passed"
                                                                        : ": not complete");
  for (const ExerciseState::Target& target : state.targets)
    text += target.reached_s ? fmt::format("; {} after {:.1f} s", target.name, *target.reached_s)
                             : fmt::format("; {} not reached", target.name);
  for (const ExerciseState::Entry& entry : state.forbidden_entries)
    text += fmt::format("; forbidden {} entered after {:.1f} s", entry.name, entry.time_s);
  for (const ExerciseState::Limit& limit : state.limits)
    if (limit.passed_s)
      text += fmt::format("; {} above {:g} after {:.1f} s", limit.name, limit.limit, *limit.passed_s);
    else if (!limit.value)
      text += fmt::format("; {} not counted", limit.name);
  return text;
}

}  // namespace xraycast
