#include "xraycast/fluoroscope/fluoroscope.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/fluoroscope/beam.hpp"
#include "xraycast/fluoroscope/blur.hpp"
#include "xraycast/fluoroscope/display_chain.hpp"
#include "xraycast/fluoroscope/exposure_control.hpp"
#include "xraycast/fluoroscope/pixel_loops.hpp"
#include "xraycast/fluoroscope/scatter.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <numeric>
#include <utility>

namespace xraycast {
namespace {

constexpr int kBand = 16;  // rows of one task, and pixels of a side of scatter's cells
constexpr double kSecondsPerMinute = 60;
constexpr double kHalfWidthsPerSpread = 2.3548;  // full width at half maximum of a Gaussian of spread 1

using Plane = std::vector<float>;

/// Of a picture: rows with a margin are what filters read.
struct PictureSize {
  int width = 0, height = 0;
  std::size_t pixels() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
  std::size_t row(int j) const { return static_cast<std::size_t>(j) * static_cast<std::size_t>(width); }
  int bands() const { return (height + kBand - 1) / kBand; }
};

/// Calls work(row) for the rows of each band, on all cores.
template <typename Work>
void for_rows(const PictureSize& size, const Work& work) {
  parallel_for(size.bands(), [&](std::int64_t band) {
    const int first = static_cast<int>(band) * kBand;
    work(first, std::min(first + kBand, size.height));
  });
}

/// A row with its first and last pixel repeated beyond it.
void pad_row(const float* row, int count, int margin, Plane& padded) {
  padded.resize(static_cast<std::size_t>(count) + 2 * static_cast<std::size_t>(margin));
  std::fill_n(padded.begin(), margin, row[0]);
  std::copy_n(row, count, padded.begin() + margin);
  std::fill_n(padded.end() - margin, margin, row[count - 1]);
}

/// The rows that a vertical filter reads for row j; beyond the picture its edge.
void rows_around(const Plane& plane, const PictureSize& size, int j, int neighbours,
                 std::vector<const float*>& rows) {
  rows.clear();
  for (int k = -neighbours; k <= neighbours; ++k)
    rows.push_back(plane.data() + size.row(std::clamp(j + k, 0, size.height - 1)));
}

void check_exposure(std::optional<double> value, double most, const char* unit) {
  if (value && !(*value > 0 && *value <= most))
    throw InputError("an exposure of {:g} {}: must be above 0 and at most {:g}", *value, unit, most);
}

}  // namespace

void check(const FluoroscopyOptions& options) {
  constexpr double kMostMas = 2000, kMostPhotons = 1e7, kLowestRate = 3, kHighestRate = 30;
  check_exposure(options.mas, kMostMas, "mAs");
  check_exposure(options.photons, kMostPhotons, "photons a pixel");
  if (options.photons && options.mas)
    throw InputError("photons and mAs are both given, but each sets the exposure; give one of them");
  const XrayTube& tube = options.c_arm.tube;
  if (options.kvp && !(*options.kvp >= tube.lowest_kvp && *options.kvp <= tube.highest_kvp))
    throw InputError("{} kVp: {} works from {:g} to {:g} kVp; choose a voltage between them", *options.kvp,
                     options.c_arm.name, tube.lowest_kvp, tube.highest_kvp);
  if (options.mas) {
    const int kvp = options.kvp.value_or(static_cast<int>(tube.lowest_kvp));
    if (const double most = highest_mas(tube, kvp); *options.mas > most)
      throw InputError("{:g} mAs: {} gives at most {:.3g} mAs a pulse at {} kVp; choose fewer", *options.mas,
                       options.c_arm.name, most, kvp);
  }
  if (options.spectrum && !options.photons)
    throw InputError("{}: a spectrum from a file has no tube output; give the photons a pixel too",
                     options.spectrum->name());
  if (!(options.pulses_per_s >= kLowestRate && options.pulses_per_s <= kHighestRate))
    throw InputError("{:g} pulses/s: must be {:g} to {:g}", options.pulses_per_s, kLowestRate, kHighestRate);
  const auto& blades = options.collimation;
  if (blades && !(blades->width_mm > 0 && blades->height_mm > 0 && std::isfinite(blades->turn_rad)))
    throw InputError("the collimator is shut ({:g} x {:g} mm); open its blades", blades->width_mm,
                     blades->height_mm);
}

namespace {

void check_distances(const Cone& distances) {
  constexpr double kLeast_mm = 200;  // as for C-arms
  if (!(distances.source_axis_mm >= kLeast_mm))
    throw InputError(
        "the source is {:g} mm from the isocentre: a fluoroscope's is at least {:g} mm away; increase the "
        "first distance",
        distances.source_axis_mm, kLeast_mm);
}

/// The pixels whose mean signal the exposure control follows, in every n-th row: those of the middle half of
/// both sides that are in the open field, or where there is none all, by their share of the field.
struct MeasuringField {
  int first_row = 0, end_row = 0, first_column = 0, end_column = 0, every = 1;
  bool is_weighted = false;
  bool has_row(int j) const { return j >= first_row && j < end_row && (j - first_row) % every == 0; }
  float weight(float field) const { return is_weighted ? field : field > 0.5f ? 1.0f : 0.0f; }
};

double pixels_in(const MeasuringField& measured, const Plane& field, const PictureSize& size) {
  double pixels = 0;
  for (int j = measured.first_row; j < measured.end_row; j += measured.every)
    for (int i = measured.first_column; i < measured.end_column; ++i)
      pixels += measured.weight(field[size.row(j) + static_cast<std::size_t>(i)]);
  return pixels;
}

MeasuringField measuring_field(const Plane& field, const PictureSize& size) {
  constexpr int kEvery = 4;
  const MeasuringField middle{(size.height + 3) / 4, (3 * size.height + 3) / 4, size.width / 4,
                              3 * size.width / 4, kEvery};
  if (pixels_in(middle, field, size) > 0) return middle;
  const MeasuringField whole{0, size.height, 0, size.width, 1, true};
  constexpr double kLeastPixels = 0.01;
  if (pixels_in(whole, field, size) < kLeastPixels)
    throw InputError("the collimator leaves none of the picture's {} x {} pixels open; open its blades",
                     size.width, size.height);
  return whole;
}

}  // namespace

struct Fluoroscope::State {
  State(FluoroscopyOptions given, const View& first_view, WaterPath given_path)
      : options(std::move(given)), path(std::move(given_path)) {
    check(options);
    keys = {noise_key(options.seed, NoiseUse::quanta), noise_key(options.seed, NoiseUse::electronics)};
    absorbed_kev = absorbed_kev_per_uGy(options.c_arm.detector);
    set_view(first_view);
    technique = first_technique();
  }

  void set_view(const View& next);
  void find_field();
  void find_taps();

  const FluoroscopyBeam& beam(int kvp);
  const QuantaTable& table(int kvp);
  void set_dose(DoseLevel level);
  ExposureControl control();
  double target_kev() const;
  bool is_automatic() const { return !options.photons && !(options.kvp && options.mas); }
  Technique first_technique();
  double open_quanta();
  double full_scale_kev();
  float electronic_rms_kev() const;
  Digitiser digitiser();

  // The passes of a frame.
  template <typename LookUp>
  void expose(const LookUp& look_up, bool leaves_traces);
  template <typename LookUp>
  void find_primary(const LookUp& look_up);
  void find_scatter();
  void absorb_quanta(double open);
  void read_out(bool leaves_traces);
  void count_dose();
  template <typename LookUp>
  void settle(const LookUp& look_up);
  auto looking_up(std::span<const float> tau);
  auto looking_up(const MaterialDepths& g_cm2);

  FluoroscopyOptions options;
  WaterPath path;
  View view;
  PictureSize size;
  std::map<int, FluoroscopyBeam> beams;
  std::map<int, QuantaTable> tables;
  struct {
    std::uint32_t quanta, electronics;
  } keys{};
  double absorbed_kev = 0;
  Technique technique;
  DoseRecord dose;
  std::uint32_t frame_number = 0;
  bool is_held = false;

  Plane field;
  MeasuringField measured;
  double open_area_cm2 = 0;
  SymmetricTaps primary_taps{1}, narrow_taps{1}, wide_taps{1};
  float wide_share = 0;
  std::optional<Scatter> scatter;
  int cell_columns = 0;
  Plane cell_share, cell_primary, cell_water;
  std::span<const float> cell_scatter;

  // Between the passes.
  Plane share, mean_kev, spread_kev, narrow, wide;
  std::vector<Plane> kept;  ///< of each lag trap
  std::vector<double> band_sums, band_pixels;
  DisplayChain display;
  FluoroscopyFrame frame;
};

// ---- what depends on the view -----------------------------------------------------------------------

void Fluoroscope::State::set_view(const View& next) {
  const bool is_moved = next.cone && *next.cone != options.c_arm.distances;
  const bool is_other =
      next.width != view.width || next.height != view.height || next.pixel_mm != view.pixel_mm || is_moved;
  if (next.cone) check_distances(*next.cone);
  view = next;
  if (!is_other) return;
  if (is_moved) {
    options.c_arm.distances = *next.cone;
    beams.clear();
    tables.clear();
  }
  frame.mean_kev = 0;
  size = {view.width, view.height};
  for (Plane* plane : {&share, &mean_kev, &spread_kev, &narrow, &wide, &frame.signal_kev, &frame.logarithm})
    plane->assign(size.pixels(), 0);
  frame.codes.assign(size.pixels(), 0);
  frame.shown.assign(size.pixels(), 0);
  kept.assign(options.c_arm.detector.lag.size(), Plane(size.pixels(), 0.0f));
  band_sums.assign(static_cast<std::size_t>(size.bands()), 0);
  band_pixels = band_sums;
  display.restart(view.width, view.height);
  cell_columns = (view.width + kBand - 1) / kBand;
  const std::size_t cells = static_cast<std::size_t>(cell_columns) * static_cast<std::size_t>(size.bands());
  for (Plane* plane : {&cell_share, &cell_primary, &cell_water}) plane->assign(cells, 0);
  scatter.emplace(cell_columns, size.bands(), kBand * view.pixel_mm);
  find_taps();
  find_field();
}

/// The focal spot's spread on the detector, by the magnification of what lies at the isocentre.
double focal_spread_mm(const CArm& c_arm) {
  const Cone& distances = c_arm.distances;
  return c_arm.tube.focal_spot_mm / kHalfWidthsPerSpread *
         (distances.source_detector_mm / distances.source_axis_mm - 1);
}

void Fluoroscope::State::find_taps() {
  primary_taps = narrow_taps = wide_taps = {1};
  wide_share = 0;
  if (!options.stages.blur) return;
  const auto gaussian = [](double cycles, double spread) {
    return std::exp(-2 * std::pow(std::numbers::pi * spread * cycles, 2));
  };
  const double focal = focal_spread_mm(options.c_arm) / view.pixel_mm;
  primary_taps = taps_for([&](double cycles) {
    const double turn = std::numbers::pi * cycles;
    return std::sin(turn) / turn * gaussian(cycles, focal);
  });
  const ScintillatorBlur& blur = options.c_arm.detector.blur;
  narrow_taps = taps_for([&](double cycles) { return gaussian(cycles, blur.narrow_mm / view.pixel_mm); });
  wide_taps = taps_for([&](double cycles) { return gaussian(cycles, blur.wide_mm / view.pixel_mm); });
  wide_share = static_cast<float>(blur.wide_share);
}

void Fluoroscope::State::find_field() {
  const FluoroscopyDetector& detector = options.c_arm.detector;
  constexpr double kUnlimited_mm = 1e6, kCm2_per_mm2 = 0.01;
  const double spread_mm = options.stages.blur ? focal_spread_mm(options.c_arm) : 0;
  const bool has_field = options.field_mm > 0;
  const double round_mm = has_field && detector.is_round ? options.field_mm : 0;
  const Collimation limit = has_field ? Collimation{std::min(options.field_mm, detector.width_mm),
                                                    std::min(options.field_mm, detector.height_mm)}
                                      : Collimation{kUnlimited_mm, kUnlimited_mm};
  field = open_field(view, limit, round_mm, spread_mm);
  if (options.collimation) {
    const Plane between = open_field(view, *options.collimation, 0, spread_mm);
    std::ranges::transform(field, between, field.begin(), std::multiplies{});
  }
  measured = measuring_field(field, size);
  // The beam fills the zoom field, whatever part of it the picture shows.
  const double width_mm = has_field ? limit.width_mm : view.width * view.pixel_mm;
  const double height_mm = has_field ? limit.height_mm : view.height * view.pixel_mm;
  open_area_cm2 =
      kCm2_per_mm2 * open_area_mm2(options.collimation.value_or(limit), width_mm, height_mm, round_mm);
}

// ---- the exposure ---------------------------------------------------------------------------------------

const FluoroscopyBeam& Fluoroscope::State::beam(int kvp) {
  if (const auto known = beams.find(kvp); known != beams.end()) return known->second;
  const CArm& c_arm = options.c_arm;
  return beams
      .emplace(kvp,
               options.spectrum ? FluoroscopyBeam(c_arm, *options.spectrum) : FluoroscopyBeam(c_arm, kvp))
      .first->second;
}

/// Only of voltages that are used: the exposure control compares many.
const QuantaTable& Fluoroscope::State::table(int kvp) {
  if (const auto known = tables.find(kvp); known != tables.end()) return known->second;
  return tables.emplace(kvp, beam(kvp).table(path)).first->second;
}

/// The next pulse has the technique that goes with the new gain.
void Fluoroscope::State::set_dose(DoseLevel level) {
  options.dose = level;
  if (!is_automatic()) return;
  technique = frame.mean_kev > 0 ? control().next(frame.technique, frame.mean_kev) : first_technique();
}

double Fluoroscope::State::target_kev() const {
  const CArm& c_arm = options.c_arm;
  const double kerma_uGy = options.dose == DoseLevel::low      ? c_arm.dose.low_uGy
                           : options.dose == DoseLevel::normal ? c_arm.dose.normal_uGy
                                                               : c_arm.dose.cine_uGy;
  // A smaller field is shown larger, and its mottle with it.
  const double zoom = options.field_mm > 0 ? c_arm.fields_mm.front() / options.field_mm : 1;
  constexpr double kCm2_per_mm2 = 0.01;
  return kerma_uGy * zoom * absorbed_kev * kCm2_per_mm2 * view.pixel_mm * view.pixel_mm;
}

ExposureControl Fluoroscope::State::control() {
  constexpr double kCm2_per_mm2 = 0.01;
  constexpr double kLimit_uGy_min = 88e3;  // 21 CFR 1020.32 (d), but for recording
  const double pixel_cm2 = kCm2_per_mm2 * view.pixel_mm * view.pixel_mm;
  const auto signal = [this, pixel_cm2](int kvp, double g_cm2) {
    return pixel_cm2 * beam(kvp).spectrum.behind_water(g_cm2).m1;
  };
  const auto permitted = [this](int kvp) {
    if (options.dose == DoseLevel::cine) return 1e9;
    return kLimit_uGy_min / kSecondsPerMinute / options.pulses_per_s / beam(kvp).limited_uGy_per_mas;
  };
  return {options.c_arm.tube, target_kev(), options.kvp, options.mas, signal, permitted};
}

Technique Fluoroscope::State::first_technique() {
  constexpr int kUsual_kvp = 80;
  if (is_automatic()) return control().start();
  const int kvp = options.kvp.value_or(kUsual_kvp);
  if (options.mas) return {kvp, *options.mas};
  constexpr double kCm2_per_mm2 = 0.01;
  const double quanta_per_mas = beam(kvp).open.m0 * kCm2_per_mm2 * view.pixel_mm * view.pixel_mm;
  return {kvp, options.spectrum ? 0 : *options.photons / quanta_per_mas};
}

double Fluoroscope::State::open_quanta() {
  if (options.photons) return *options.photons;
  constexpr double kCm2_per_mm2 = 0.01;
  return technique.mas * beam(technique.kvp).open.m0 * kCm2_per_mm2 * view.pixel_mm * view.pixel_mm;
}

/// Gain follows the dose level, so that the control's target has a tenth of all codes; with an exposure by
/// hand the open field just fits.
double Fluoroscope::State::full_scale_kev() {
  constexpr double kHeadroom = 10, kSpreads = 8, kOpenHeadroom = 1.25;
  if (is_automatic()) return kHeadroom * target_kev();
  const double quanta = open_quanta();
  return beam(technique.kvp).open.mean_kev() * (kOpenHeadroom * quanta + kSpreads * std::sqrt(quanta) + 1);
}

void Fluoroscope::State::count_dose() {
  const double kerma_uGy = technique.mas * beam(technique.kvp).reference_uGy_per_mas;
  const double closer = reference_distance_mm(options.c_arm) / options.c_arm.distances.source_detector_mm;
  constexpr double kMilli = 1e-3, kMicro = 1e-6;
  dose.air_kerma_mGy += kMilli * kerma_uGy;
  dose.dap_Gycm2 += kMicro * kerma_uGy * open_area_cm2 * closer * closer;
  ++dose.pulses;
  if (options.dose == DoseLevel::cine)
    ++dose.images;
  else
    dose.fluoroscopy_s += 1 / options.pulses_per_s;
}

// ---- the passes -----------------------------------------------------------------------------------------

/// What an optical depth lets through.
auto Fluoroscope::State::looking_up(std::span<const float> tau) {
  return [this, tau](int j) {
    const std::size_t at = size.row(j);
    look_up_row(tables.at(technique.kvp), tau.data() + at, size.width, share.data() + at,
                mean_kev.data() + at, spread_kev.data() + at);
  };
}

/// What masses let through; for files, since it sums the spectrum in every pixel.
auto Fluoroscope::State::looking_up(const MaterialDepths& g_cm2) {
  return [this, &g_cm2](int j) {
    const FluoroscopyBeam& now = beams.at(technique.kvp);
    for (std::size_t pixel = size.row(j); pixel < size.row(j + 1); ++pixel) {
      std::array<double, kMaterials.size()> depths{};
      for (std::size_t m = 0; m < depths.size(); ++m)
        depths[m] = std::max(0.0f, g_cm2[m][pixel]);  // 0 for NaN
      const EnergyMoments behind = now.spectrum.behind(depths);
      share[pixel] = static_cast<float>(behind.m0 / now.open.m0);
      mean_kev[pixel] = static_cast<float>(behind.mean_kev());
      spread_kev[pixel] = static_cast<float>(behind.spread_kev());
    }
  };
}

/// Shares of the open field, blurred along the rows, and the sums of scatter's cells.
template <typename LookUp>
void Fluoroscope::State::find_primary(const LookUp& look_up) {
  table(technique.kvp);  // made, with its beam, before threads look it up
  const int margin = static_cast<int>(primary_taps.size()) - 1;
  for_rows(size, [&](int first, int end) {
    Plane padded;
    for (int j = first; j < end; ++j) {
      look_up(j);
      float* const row = share.data() + size.row(j);
      if (options.stages.scatter) {
        const std::size_t cells =
            static_cast<std::size_t>(first / kBand) * static_cast<std::size_t>(cell_columns);
        if (j == first)
          for (Plane* plane : {&cell_share, &cell_primary}) std::fill_n(&(*plane)[cells], cell_columns, 0.0f);
        // Every fourth row will do for what scatter blurs over centimetres.
        constexpr int kEvery = 4;
        if ((j - first) % kEvery == 0)
          for (int i = 0; i < size.width; ++i) {
            cell_share[cells + static_cast<std::size_t>(i / kBand)] += row[i];
            cell_primary[cells + static_cast<std::size_t>(i / kBand)] += row[i] * field[size.row(j) + i];
          }
      }
      pad_row(row, size.width, margin, padded);
      filter_row(padded.data(), primary_taps, size.width, narrow.data() + size.row(j));
    }
  });
}

/// The optical depth at which the table, which falls, has a share; between steps on a line.
double tau_of(float share, const QuantaTable& table) {
  const auto after = std::ranges::lower_bound(table.share, share, std::greater{});
  if (after == table.share.begin()) return 0;
  const auto step = static_cast<double>(after - table.share.begin());
  if (after == table.share.end()) return (step - 1) / table.steps_per_tau;
  const float above = *(after - 1), below = *after;
  return (step - (share - below) / (above - below)) / table.steps_per_tau;
}

void Fluoroscope::State::find_scatter() {
  if (!options.stages.scatter) return;
  constexpr int kEvery = 4;
  const QuantaTable& now = table(technique.kvp);
  for (std::size_t cell = 0; cell < cell_share.size(); ++cell) {
    const int row = static_cast<int>(cell) / cell_columns, column = static_cast<int>(cell) % cell_columns;
    const int rows = (std::min(kBand, size.height - row * kBand) + kEvery - 1) / kEvery;
    const auto pixels = static_cast<float>(rows * std::min(kBand, size.width - column * kBand));
    cell_water[cell] = static_cast<float>(path.g_cm2(tau_of(cell_share[cell] / pixels, now)));
    cell_primary[cell] /= pixels;
  }
  cell_scatter = scatter->from(cell_primary, cell_water);
}

/// Scatter at the pixels of a row, between the cells' middles.
void scatter_row(std::span<const float> cells, int columns, int rows, int j, float weight, int width,
                 Plane& row) {
  const float y =
      std::clamp((static_cast<float>(j) + 0.5f) / kBand - 0.5f, 0.0f, static_cast<float>(rows - 1));
  const int above = std::min(static_cast<int>(y), std::max(0, rows - 2)),
            below = std::min(above + 1, rows - 1);
  const float part = y - static_cast<float>(above);
  const auto at = [&](int column) {
    const int inside = std::clamp(column, 0, columns - 1);
    return weight * std::lerp(cells[above * columns + inside], cells[below * columns + inside], part);
  };
  // Between two middles the row is a ramp.
  for (int column = -1; column < columns; ++column) {
    const float from = at(column), slope = (at(column + 1) - from) / kBand;
    const int start = column * kBand + kBand / 2;
    for (int i = std::max(0, start); i < std::min(width, start + kBand); ++i)
      row[static_cast<std::size_t>(i)] = from + slope * (static_cast<float>(i - start) + 0.5f);
  }
}

/// Quanta in every pixel, blurred along the rows by both parts of the scintillator.
void Fluoroscope::State::absorb_quanta(double open) {
  const auto open_count = static_cast<float>(open);
  const auto& grid = options.c_arm.grid;
  const float scatter_weight = grid ? static_cast<float>(grid->scatter / grid->primary) : 1;
  const int primary_margin = static_cast<int>(primary_taps.size()) - 1;
  for_rows(size, [&](int first, int end) {
    const auto width = static_cast<std::size_t>(size.width);
    Plane blurred(width), scattered(width, 0.0f), counts(width), energy(width), normals(2 * width), padded;
    std::vector<const float*> rows;
    for (int j = first; j < end; ++j) {
      const std::size_t at = size.row(j);
      rows_around(narrow, size, j, primary_margin, rows);
      std::ranges::fill(blurred, 0.0f);
      add_filtered_column(rows.data(), primary_taps, 1, size.width, blurred.data());
      if (options.stages.scatter)
        scatter_row(cell_scatter, cell_columns, size.bands(), j, scatter_weight, size.width, scattered);
      quanta_counts_row(blurred.data(), field.data() + at, scattered.data(), open_count, size.width,
                        counts.data());
      if (options.stages.quanta)
        quantum_noise_row(counts.data(), mean_kev.data() + at, spread_kev.data() + at,
                          static_cast<std::uint32_t>(at), {keys.quanta, frame_number}, size.width,
                          energy.data(), normals.data());
      else
        expected_energy_row(counts.data(), mean_kev.data() + at, size.width, energy.data());
      // Both planes were read for the last time: the means here, the shares in the pass before.
      pad_row(energy.data(), size.width, static_cast<int>(narrow_taps.size()) - 1, padded);
      filter_row(padded.data(), narrow_taps, size.width, share.data() + at);
      if (wide_share == 0) continue;
      pad_row(energy.data(), size.width, static_cast<int>(wide_taps.size()) - 1, padded);
      filter_row(padded.data(), wide_taps, size.width, wide.data() + at);
    }
  });
}

/// Of a picture's pixel, which has the noise of all the detector's pixels in it.
float Fluoroscope::State::electronic_rms_kev() const {
  const FluoroscopyDetector& detector = options.c_arm.detector;
  if (!options.stages.electronics) return 0;
  return static_cast<float>(detector.electronic_noise_kev * view.pixel_mm / detector.pixel_mm);
}

/// The dark level leaves room for the electronics' noise.
Digitiser Fluoroscope::State::digitiser() {
  constexpr double kDarkShare = 1.0 / 256, kDarkSpreads = 5;
  const double most = (1 << options.c_arm.detector.bits) - 1, full_kev = full_scale_kev();
  const double dark_kev = kDarkSpreads * electronic_rms_kev();
  const double dark = std::max(kDarkShare * most, most * dark_kev / (full_kev + dark_kev));
  return {static_cast<float>((most - dark) / full_kev), static_cast<float>(dark), static_cast<float>(most)};
}

/// From the absorbed energy to the detector's codes.
void Fluoroscope::State::read_out(bool leaves_traces) {
  const FluoroscopyDetector& detector = options.c_arm.detector;
  const Digitiser digitised = digitiser();
  const float codes_per_kev = digitised.codes_per_kev, dark = digitised.dark;
  const float rms_kev = electronic_rms_kev();
  display.set_codes(detector.bits, dark);
  for_rows(size, [&](int first, int end) {
    std::vector<const float*> rows;
    double sum = 0, pixels = 0;
    Plane before(static_cast<std::size_t>(size.width)), normals(static_cast<std::size_t>(size.width) + 1);
    for (int j = first; j < end; ++j) {
      const std::size_t at = size.row(j);
      float* const signal = frame.signal_kev.data() + at;
      std::fill_n(signal, size.width, 0.0f);
      rows_around(share, size, j, static_cast<int>(narrow_taps.size()) - 1, rows);
      add_filtered_column(rows.data(), narrow_taps, 1 - wide_share, size.width, signal);
      if (wide_share > 0) {
        rows_around(wide, size, j, static_cast<int>(wide_taps.size()) - 1, rows);
        add_filtered_column(rows.data(), wide_taps, wide_share, size.width, signal);
      }
      // The measuring field's sensor keeps no charge of earlier pulses.
      if (measured.has_row(j))
        for (int i = measured.first_column; i < measured.end_column; ++i) {
          const float weight = measured.weight(field[at + static_cast<std::size_t>(i)]);
          sum += weight * signal[i];
          pixels += weight * weight;
        }
      if (options.stages.lag && leaves_traces) {
        std::copy_n(signal, size.width, before.begin());
        for (std::size_t trap = 0; trap < kept.size(); ++trap) {
          const double decayed = -std::expm1(-1 / (options.pulses_per_s * detector.lag[trap].time_s));
          lag_row(static_cast<float>(detector.lag[trap].fraction), static_cast<float>(decayed), size.width,
                  before.data(), kept[trap].data() + at, signal);
        }
      }
      if (rms_kev > 0)
        electronic_noise_row(rms_kev, static_cast<std::uint32_t>(at), {keys.electronics, frame_number},
                             size.width, signal, normals.data());
      std::uint16_t* const codes = frame.codes.data() + at;
      digitise_row(digitised, size.width, signal, codes);
      display.take_logarithm(codes, size.width, frame.logarithm.data() + at);
      if (options.stages.electronics)
        for (int i = 0; i < size.width; ++i)
          signal[i] = (static_cast<float>(codes[i]) - dark) / codes_per_kev;
    }
    band_sums[static_cast<std::size_t>(first / kBand)] = sum;
    band_pixels[static_cast<std::size_t>(first / kBand)] = pixels;
  });
  const double pixels = std::accumulate(band_pixels.begin(), band_pixels.end(), 0.0);
  frame.mean_kev = std::accumulate(band_sums.begin(), band_sums.end(), 0.0) / pixels;
  display.set_level(std::log(std::max(1.0, frame.mean_kev * codes_per_kev)));
}

template <typename LookUp>
void Fluoroscope::State::expose(const LookUp& look_up, bool leaves_traces) {
  find_primary(look_up);
  find_scatter();
  absorb_quanta(open_quanta());
  read_out(leaves_traces);
  frame.technique = technique;
  if (!leaves_traces) return;
  const bool is_processed = options.stages.display;
  display.begin(options.dose == DoseLevel::cine, is_processed);
  for_rows(size, [&](int first, int end) {
    for (int j = first; j < end; ++j) display.show_row(frame.logarithm, j, frame.shown.data() + size.row(j));
  });
  display.end();
  count_dose();
  ++frame_number;
}

template <typename LookUp>
void Fluoroscope::State::settle(const LookUp& look_up) {
  constexpr int kMostPulses = 8;
  for (int pulse = 0; is_automatic() && pulse < kMostPulses; ++pulse) {
    expose(look_up, false);
    const Technique next = control().next(technique, frame.mean_kev);
    if (next == technique) return;
    technique = next;
  }
}

std::vector<float> measured_depths(const FluoroscopyFrame& frame) {
  std::vector<float> depths(frame.logarithm.size());
  std::ranges::transform(frame.logarithm, depths.begin(), std::negate{});
  return depths;
}

// ---- the class ------------------------------------------------------------------------------------------

Fluoroscope::Fluoroscope(FluoroscopyOptions options, const View& view, WaterPath path)
    : state_(std::make_unique<State>(std::move(options), view, std::move(path))) {}
Fluoroscope::~Fluoroscope() = default;
Fluoroscope::Fluoroscope(Fluoroscope&&) noexcept = default;
Fluoroscope& Fluoroscope::operator=(Fluoroscope&&) noexcept = default;

const FluoroscopyFrame& Fluoroscope::expose(std::span<const float> tau) {
  state_->expose(state_->looking_up(tau), true);
  if (state_->is_automatic() && !state_->is_held)
    state_->technique = state_->control().next(state_->technique, state_->frame.mean_kev);
  return state_->frame;
}

const FluoroscopyFrame& Fluoroscope::expose(const MaterialDepths& g_cm2) {
  state_->expose(state_->looking_up(g_cm2), true);
  if (state_->is_automatic() && !state_->is_held)
    state_->technique = state_->control().next(state_->technique, state_->frame.mean_kev);
  return state_->frame;
}

void Fluoroscope::settle(std::span<const float> tau) { state_->settle(state_->looking_up(tau)); }
void Fluoroscope::settle(const MaterialDepths& g_cm2) { state_->settle(state_->looking_up(g_cm2)); }

void Fluoroscope::set_view(const View& view) { state_->set_view(view); }
void Fluoroscope::set_dose(DoseLevel dose) { state_->set_dose(dose); }

void Fluoroscope::hold_technique(bool is_held) { state_->is_held = is_held; }

const FluoroscopyOptions& Fluoroscope::options() const { return state_->options; }
const DoseRecord& Fluoroscope::dose() const { return state_->dose; }
Technique Fluoroscope::technique() const { return state_->technique; }
double Fluoroscope::kerma_rate_mGy_min() const {
  const Technique& now = state_->technique;
  constexpr double kMilli = 1e-3;
  return kMilli * now.mas * state_->beam(now.kvp).reference_uGy_per_mas * state_->options.pulses_per_s *
         kSecondsPerMinute;
}
std::span<const float> Fluoroscope::field() const { return state_->field; }
double Fluoroscope::target_kev() const { return state_->target_kev(); }
double Fluoroscope::open_quanta() const { return state_->open_quanta(); }
int Fluoroscope::bits() const { return state_->options.c_arm.detector.bits; }

}  // namespace xraycast
