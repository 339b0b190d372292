#pragma once

#include "xraycast/motion/displacement.hpp"

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// A displacement at a phase of a mode.
struct KeyPhase {
  double phase = 0;                           ///< 0 to 1
  std::shared_ptr<const Displacement> moves;  ///< null: the scan itself
};

/// A phase at a time.
struct PhaseSample {
  double time_s = 0;
  double phase = 0;
};

/// One movement of the body, such as breath or heart: displacements at phases from 0 to 1.
///
/// A mode wraps unless it has keys at both phase 0 and phase 1 and they differ: its last key leads to its
/// first one, and its phase is the share of the cycle that is over. A mode that does not wrap goes there and
/// back.
///
/// Between keys the displacements are interpolated by Catmull-Rom splines over the phase, through the last
/// and the first one where the mode wraps: without jumps in place or speed. The two keys of a mode that does
/// not wrap are interpolated linearly.
struct MotionMode {
  std::string name;
  double period_s = 0;                ///< of one cycle, or there and back; 0 where there is a waveform
  std::vector<PhaseSample> waveform;  ///< at least two, ascending in time; repeats from the last on
  std::vector<KeyPhase> keys;         ///< at least two, ascending in phase

  bool wraps() const;

  /// At a time before or after any number of repetitions, 0 to 1. With a period: of a mode that wraps, the
  /// share of the period that is over; of any other (1 - cos(2 pi time / period)) / 2. Of a waveform:
  /// monotone cubic (Fritsch and Carlson, SIAM J. Numer. Anal. 1980) between its samples. Where the mode
  /// wraps, its phases may grow beyond 1, and whole numbers do not count.
  double phase_at(double time_s) const;

  /// The first time at or after another at which the phase, 0 to 1, is this one; nothing where a waveform
  /// never has it. Where the mode wraps, phases 0 and 1 are the same.
  std::optional<double> next_time_s(double phase, double from_s) const;

  /// Whether a phase is another, but for rounding.
  bool is_same_phase(double a, double b) const;
  /// How long until the phase is this one, from a time of the mode's own on that goes on `rate` times as fast
  /// as the clock; nothing where it never is, as of rate 0 at another phase.
  std::optional<double> wait_s(double phase, double own_s, double rate) const;

  /// How much each key counts at a phase.
  std::vector<double> weights_at(double phase) const;
};

/// A place that was sought by the inverse of a displacement.
struct InverseResult {
  glm::dvec3 x_mm;
  double residual_mm;  ///< |x + d(x) - y|
  bool is_found;       ///< the residual is below kInverseResidual_mm
};
inline constexpr double kInverseResidual_mm = 0.05;

/// The body's displacement while all modes are held at one phase each. Cheap to copy; thread-safe.
class HeldMotion {
 public:
  /// A displacement and its share.
  struct Part {
    double weight;
    std::shared_ptr<const Displacement> moves;
  };

  /// Of a body that does not move.
  HeldMotion() = default;

  /// Of modes one after the other, the parts of each summed.
  explicit HeldMotion(std::vector<std::vector<Part>> modes) : modes_(std::move(modes)) {}

  /// No displacement anywhere.
  bool is_still() const { return modes_.empty(); }

  /// d(x): the place x of the moved body shows what lies at x + d(x) in the scan. Modes are composed: the
  /// place goes through the first mode of the file first.
  glm::dvec3 displacement_mm(const glm::dvec3& x_mm) const;

  /// The same of many places, one for one: x + d(x) takes the place of x.
  void displace(std::span<glm::dvec3> x_mm) const;

  /// Whether the displacement is known at x, of every mode.
  bool covers(const glm::dvec3& x_mm) const;

  /// Of the modes that move, in order, what is summed.
  const std::vector<std::vector<Part>>& modes() const { return modes_; }

  /// The place x of the moved body that shows what lies at y in the scan: where a part of the scan, a vessel
  /// or an instrument, goes. Solved for by fixed points and Newton's method; where the displacement folds
  /// there may be several, of which one near the guess is found, or none.
  InverseResult inverse_mm(const glm::dvec3& y_mm) const { return inverse_mm(y_mm, y_mm); }

  /// The same, starting at a guess such as the place of the instant before.
  InverseResult inverse_mm(const glm::dvec3& y_mm, const glm::dvec3& guess_mm) const;

  /// Of x -> x + d(x), by differences across a tenth of a millimetre.
  glm::dmat3 jacobian(const glm::dvec3& x_mm) const;

 private:
  std::vector<std::vector<Part>> modes_;
};

/// How a body moves.
class Motion {
 public:
  /// Throws InputError, with `name` in front, for modes without a name or with that of another, fewer than
  /// two keys, keys out of order, a period that is not above 0, a waveform that jumps.
  Motion(std::vector<MotionMode> modes, std::string name, std::vector<std::string> warnings = {});

  const std::string& name() const { return name_; }
  const std::vector<MotionMode>& modes() const { return modes_; }
  const std::vector<std::string>& warnings() const {
    return warnings_;
  }  ///< of the files, and folds, one line each

  /// The phase of each mode, in order, at a time.
  std::vector<double> phases_at(double time_s) const;

  /// The phase of each mode, in order: those that are named, 0 of the others. Throws InputError, which lists
  /// the modes, for another name, and for a phase that is not 0 to 1; it names the field `phase`.
  std::vector<double> phases_of(const std::map<std::string, double>& named) const;

  /// The number of a mode. Throws as refuse_mode for another name than those of the modes.
  std::size_t number_of(const std::string& mode, const std::string& asked) const;

  /// One phase a mode, in order, 0 to 1.
  HeldMotion held_at(std::span<const double> phases) const;

  /// One mode alone, by its number, as if there were no other.
  HeldMotion mode_held_at(std::size_t mode, double phase) const;

 private:
  std::string name_;
  std::vector<MotionMode> modes_;
  std::vector<std::string> warnings_;
};

/// Throws the InputError for a mode that a body does not have: `asked` is what was asked for, as in
/// "`gate` cough", and `names` are those of its modes.
[[noreturn]] void refuse_mode(const std::string& asked, const std::string& body,
                              const std::vector<std::string>& names);

/// Reads `motion.json` and the fields that it names, relative to it:
///
///     {"version": 1, "modes": [{"name": "breath", "period_s": 4,
///                               "phases": [{"phase": 0}, {"phase": 1, "field": "f.nrrd"}]},
///                              {"name": "heart", "waveform": [[0, 0], [0.8, 1], [1.7, 2]],
///                               "phases": [{"phase": 0}, {"phase": 0.35, "field": ["a.tfm", "b.nii.gz"]}]}]}
///
/// A field is a file of vectors in mm, LPS (NRRD, MetaImage, NIfTI), an ITK transform (.tfm, .h5, .mat), or a
/// list of these, which are composed: the place goes through the first of them first. Throws InputError,
/// naming file and field.
Motion read_motion(const std::filesystem::path& path);

}  // namespace xraycast
