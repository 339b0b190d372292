#include "xraycast/phantom/phantom_motion.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/phantom/phantom_motion_file.hpp"
#include "xraycast/phantom/phantom_trunk.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <sstream>

namespace xraycast::phantom_motion_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

using Phases = std::map<std::string, double>;

Phantom thorax_at(const Phases& phase) {
  return make_phantom("thorax", {.coronaries = true, .phase = phase});
}

/// Where a place of the thorax at rest goes.
glm::dvec3 shift_of(const Phases& phase, const glm::dvec3& rest_mm) {
  return thorax_at(phase).motion().moved_mm(rest_mm) - rest_mm;
}

std::string message_of(const std::string& name, const PhantomOptions& options) {
  try {
    make_phantom(name, options);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(PhantomModes, AreThoseOfTheBodies) {
  const auto names = [](const std::string& phantom) {
    const Phantom made = make_phantom(phantom);
    std::vector<std::string> found;
    for (const PhantomMode& mode : made.modes()) found.push_back(mode.name);
    return found;
  };
  EXPECT_THAT(names("thorax"), ElementsAre("breath", "heart"));
  EXPECT_THAT(names("head"), ElementsAre("turn"));
  EXPECT_THAT(names("sphere"), ElementsAre());
}

TEST(PhantomModes, RefuseWhatThereIsNot) {
  EXPECT_EQ(message_of("thorax", {.phase = {{"cough", 0.5}}}),
            "`phase` cough: the phantom thorax has no such movement; choose one of breath, heart");
  EXPECT_EQ(message_of("box", {.phase = {{"breath", 0.5}}}),
            "`phase` breath: the phantom box does not move; make thorax or head, or give none");
  EXPECT_EQ(message_of("thorax", {.phase = {{"heart", 1.5}}}), "`phase` heart: 1.5 must be 0 to 1");
  EXPECT_EQ(message_of("thorax", {.phase = {{"heart", std::nan("")}}}), "`phase` heart: nan must be 0 to 1");
  EXPECT_EQ(message_of("head", {.coronaries = true}), "`coronaries`: the phantom head has none; make thorax");
}

TEST(PhantomModes, AreStillAtPhaseZero) {
  EXPECT_TRUE(thorax_at({}).motion().is_still());
  EXPECT_TRUE(thorax_at({{"breath", 0}, {"heart", 0}}).motion().is_still());
  EXPECT_FALSE(thorax_at({{"breath", 0.01}}).motion().is_still());
  // A beat ends as it begins.
  EXPECT_TRUE(thorax_at({{"heart", 1}}).motion().is_still());
}

TEST(PhantomMotion, InvertsAndComposesAffineModes) {
  // x -> 1.25 x + (0, 0, 0.5 y), then x -> x + (3, 0, 0).
  PhantomMode stretch{.name = "stretch", .share = [](double phase) { return phase; }};
  stretch.displacement_mm = [](const glm::dvec3& x) { return glm::dvec3(0.25 * x.x, 0, 0.5 * x.y); };
  PhantomMode shift{.name = "shift", .share = [](double phase) { return 2 * phase; }};
  shift.displacement_mm = [](const glm::dvec3&) { return glm::dvec3(3, 0, 0); };
  const PhantomMotion motion({stretch, shift}, {1, 0.5});
  // Sums of a few numbers in double precision.
  EXPECT_LT(glm::distance(motion.pulled_back_mm({8, 10, 1}), glm::dvec3(13, 10, 6)), 1e-12);
  // Newton's method ends below a nanometre.
  EXPECT_LT(glm::distance(motion.moved_mm({13, 10, 6}), glm::dvec3(8, 10, 1)), 1e-6);
  // Central differences of linear functions: rounding over the step.
  EXPECT_NEAR(motion.gradient({5, 6, 7}).determinant(), 1.25, 1e-9);
}

struct Held {
  std::string phantom;
  Phases phase;
};

class HeldPhantom : public testing::TestWithParam<Held> {
 protected:
  const Phantom phantom_ = make_phantom(
      GetParam().phantom, {.coronaries = GetParam().phantom == "thorax", .phase = GetParam().phase});
  const PhantomMotion& motion_ = phantom_.motion();

  /// In the body's box.
  std::vector<glm::dvec3> random_places(int count) const {
    std::mt19937 random(17);
    const auto within = [&](double low, double high) {
      return glm::mix(low, high, static_cast<double>(random()) / 0xffffffffu);
    };
    std::vector<glm::dvec3> places;
    for (int i = 0; i < count; ++i)
      places.emplace_back(within(-180, 180), within(-125, 125), within(-280, 280));
    return places;
  }
};
INSTANTIATE_TEST_SUITE_P(, HeldPhantom,
                         testing::Values(Held{"thorax", {{"breath", 1}}}, Held{"thorax", {{"heart", 0.4}}},
                                         Held{"thorax", {{"breath", 0.37}, {"heart", 0.23}}},
                                         Held{"thorax", {{"breath", 1}, {"heart", 0.4}}},
                                         Held{"head", {{"turn", 1}}}));

TEST_P(HeldPhantom, NeitherFoldsNorTears) {
  for (const glm::dvec3& p : random_places(40000)) {
    const double growth = motion_.gradient(p).determinant();
    // A fold has 0. Blood leaves the ventricles, and what lies behind the left atrium makes room.
    ASSERT_GT(growth, 0.25) << p.x << ' ' << p.y << ' ' << p.z;
    ASSERT_LT(growth, 3.5) << p.x << ' ' << p.y << ' ' << p.z;
    // A tear would be a jump: over a tenth of a millimetre nothing moves by half of one.
    const glm::dvec3 step(0.06, -0.06, 0.06);
    ASSERT_LT(glm::distance(motion_.pulled_back_mm(p + step), motion_.pulled_back_mm(p)), 0.5);
  }
}

TEST_P(HeldPhantom, IsInverted) {
  for (const glm::dvec3& p : random_places(5000))
    // Newton's method ends below a nanometre.
    ASSERT_LT(glm::distance(motion_.pulled_back_mm(motion_.moved_mm(p)), p), 1e-6)
        << p.x << ' ' << p.y << ' ' << p.z;
}

TEST_P(HeldPhantom, CarriesItsVesselsAlong) {
  ASSERT_EQ(phantom_.vessel_branches().size(), phantom_.resting_branches().size());
  for (std::size_t i = 0; i < phantom_.vessel_branches().size(); ++i) {
    const std::vector<VesselPoint>& points = phantom_.vessel_branches()[i].points;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const glm::dvec3 rest = phantom_.resting_branches()[i].points[k].position_mm;
      // As above.
      ASSERT_LT(glm::distance(motion_.pulled_back_mm(points[k].position_mm), rest), 1e-6);
      ASSERT_DOUBLE_EQ(phantom_.hu_at(points[k].position_mm), 350) << i << ' ' << k;
    }
  }
  // It is a tree.
  EXPECT_NO_THROW(VesselTree(phantom_.vessel_branches(), "moved"));
}

TEST_P(HeldPhantom, ModesEndAtTheirBoxes) {
  for (const PhantomMode& mode : phantom_.modes())
    for (const glm::dvec3& p : random_places(40000)) {
      const bool is_within =
          glm::all(glm::greaterThan(p, mode.lower_mm)) && glm::all(glm::lessThan(p, mode.upper_mm));
      if (is_within) continue;
      ASSERT_EQ(mode.displacement_mm(p), glm::dvec3(0))
          << mode.name << ' ' << p.x << ' ' << p.y << ' ' << p.z;
    }
}

// ---- breath ---------------------------------------------------------------------------------------

TEST(Breath, MovesTheDiaphragmAndWhatHangsOnIt) {
  const Phases inspired{{"breath", 1}};
  const auto caudal_mm = [&](const glm::dvec3& p) { return -shift_of(inspired, p).z; };
  // What was chosen: 12 mm, within the curvature of the share at the dome.
  EXPECT_NEAR(caudal_mm({-63, 2, 75}), 12, 0.2);
  // The left one lies beside the heart, which lags behind.
  EXPECT_NEAR(caudal_mm({62, 2, 61}), 10, 1);
  EXPECT_NEAR(caudal_mm({-63, 2, -10}), 11, 1);
  // Song et al., J. Magn. Reson. Imaging 2011: 0.6 to 0.7 of the diaphragm.
  for (const double side : {-1.0, 1.0}) EXPECT_NEAR(caudal_mm({side * 64, 40, -48}), 0.65 * 12, 1.2);
  // Keegan et al., Magn. Reson. Med. 2002: 0.26 caudally and 0.04 forwards.
  EXPECT_NEAR(caudal_mm({-12, -40, 148}), 0.26 * 12, 0.5);
  EXPECT_NEAR(-shift_of(inspired, {-12, -40, 148}).y, 0.04 * 12, 0.4);
}

TEST(Breath, MovesTheHeartAsMeasured) {
  const Phantom inspired = thorax_at({{"breath", 1}});
  glm::dvec3 sum_mm(0);
  int count = 0;
  for (const VesselBranch& vessel : inspired.resting_branches())
    for (const VesselPoint& point : vessel.points) {
      // Thinner than the other arteries within the box are the coronary ones.
      if (point.radius_mm > 2.3 || point.position_mm.z < 40 || point.position_mm.z > 150) continue;
      sum_mm += inspired.motion().moved_mm(point.position_mm) - point.position_mm;
      ++count;
    }
  ASSERT_GT(count, 300);
  // Shechter et al., IEEE Trans. Med. Imaging 2004, by coronary arteries: caudally 4.9 +- 1.9 mm, anteriorly
  // 1.3 +- 1.8 mm.
  EXPECT_NEAR(-sum_mm.z / count, 4.9, 1.9);
  EXPECT_NEAR(-sum_mm.y / count, 1.3, 1.8);
}

TEST(Breath, LeavesTheBackInPlaceAndRaisesTheFront) {
  const Phases inspired{{"breath", 1}};
  // Vertebral bodies and arches, ribs behind, the back's skin, arms.
  for (const glm::dvec3& p :
       {glm::dvec3(0, 43, 40), glm::dvec3(0, 17, -100), glm::dvec3(12, 60, 110), glm::dvec3(60, 97, 60),
        glm::dvec3(-60, 95, 100), glm::dvec3(0, 112, 0), glm::dvec3(205, -6, 360)})
    // Less than is seen in a picture.
    EXPECT_LT(glm::length(shift_of(inspired, p)), 0.1) << p.x << ' ' << p.y << ' ' << p.z;
  EXPECT_NEAR(-shift_of(inspired, {0, -95, 120}).y, 3, 0.5);
  EXPECT_NEAR(-shift_of(inspired, {0, -105, -50}).y, 6, 0.7);
  // Ribs in front move forwards with the wall, and not down with the lungs.
  EXPECT_LT(std::abs(shift_of(inspired, {-40, -92, 110}).z), 0.7);
}

TEST(Breath, InhalesAQuietBreath) {
  const Phantom inspired = thorax_at({{"breath", 1}});
  double inhaled_ml = 0;
  constexpr double kStep_mm = 8;
  for (double z = 20; z < 290; z += kStep_mm)
    for (double y = -110; y < 110; y += kStep_mm)
      for (double x = -150; x < 150; x += kStep_mm) {
        const double hu = inspired.hu_at({x, y, z});
        if (hu < -500 && hu > -950)
          inhaled_ml +=
              (1 - inspired.motion().gradient({x, y, z}).determinant()) * std::pow(kStep_mm, 3) / 1000;
      }
  // A man at rest breathes about half a litre. Here the lungs do not slide along the ribs and these do not
  // widen sideways: that is half of it.
  EXPECT_NEAR(inhaled_ml, 250, 50);
}

TEST(Breath, RestsForAQuarterOfItsTime) {
  const PhantomMode breath = make_phantom("thorax").modes()[0];
  double rest_s = 0;
  for (std::size_t i = 1; i < breath.waveform.size(); ++i)
    if (breath.waveform[i].second == 0 && breath.waveform[i - 1].second == 0)
      rest_s += breath.waveform[i].first - breath.waveform[i - 1].first;
  EXPECT_DOUBLE_EQ(rest_s, breath.period_s / 4);
  EXPECT_EQ(std::ranges::max(breath.waveform, {}, &std::pair<double, double>::second).second, 1);
}

// ---- heart ----------------------------------------------------------------------------------------

constexpr double kEndOfSystole = 0.4;

TEST(Heart, BaseDescendsAndApexStays) {
  const Phases systole{{"heart", kEndOfSystole}};
  const glm::dvec3 base = kHeartApex_mm - 95.0 * kHeartAxis;
  const glm::dvec3 descent = shift_of(systole, base);
  // What was chosen.
  EXPECT_NEAR(glm::dot(descent, kHeartAxis), 14, 1);
  EXPECT_LT(glm::length(shift_of(systole, kHeartApex_mm)), 0.5);
}

TEST(Heart, TwistsAnticlockwiseAtTheApexAsSeenFromThere) {
  const Phases systole{{"heart", kEndOfSystole}};
  const glm::dvec3 across = glm::normalize(glm::cross(kHeartAxis, glm::dvec3(0, 0, 1)));
  const auto turn_deg = [&](double height_mm) {
    const glm::dvec3 centre = kHeartApex_mm - height_mm * kHeartAxis, rest = 15.0 * across;
    const glm::dvec3 moved = centre + rest + shift_of(systole, centre + rest) - centre;
    const glm::dvec3 flat = moved - glm::dot(moved, kHeartAxis) * kHeartAxis;
    return std::asin(glm::dot(glm::cross(rest, flat), kHeartAxis) / (15 * glm::length(flat))) * 57.29578;
  };
  // Young and Cowan, J. Cardiovasc. Magn. Reson. 2012: 10 degrees, and 3 the other way at the base. The twist
  // is interpolated along the axis.
  EXPECT_NEAR(turn_deg(15), 10, 2);
  EXPECT_NEAR(turn_deg(95), -3, 1.5);
}

/// The share that an ellipsoid keeps of its volume, by a fine grid.
double kept_share(const PhantomMotion& motion, const glm::dvec3& centre, const glm::dvec3& half,
                  const ShapeAxes& axes) {
  double rest = 0, moved = 0;
  const glm::dvec3 w = glm::cross(axes.u, axes.v);
  const auto is_inside = [&](const glm::dvec3& p) {
    const glm::dvec3 q = p - centre;
    return glm::length(glm::dvec3(glm::dot(q, axes.u), glm::dot(q, axes.v), glm::dot(q, w)) / half) < 1;
  };
  constexpr double kReach_mm = 60, kStep_mm = 1.5;
  for (double z = -kReach_mm; z < kReach_mm; z += kStep_mm)
    for (double y = -kReach_mm; y < kReach_mm; y += kStep_mm)
      for (double x = -kReach_mm; x < kReach_mm; x += kStep_mm) {
        const glm::dvec3 p = centre + glm::dvec3(x, y, z);
        rest += is_inside(p);
        moved += is_inside(motion.pulled_back_mm(p));
      }
  return moved / rest;
}

TEST(Heart, LeftVentricleEjectsAsAHealthyOneDoes) {
  const Phantom systole = thorax_at({{"heart", kEndOfSystole}});
  const double kept =
      kept_share(systole.motion(), {40, -34, 92}, {20, 20, 42}, axes_along({0.66, -0.5, -0.56}));
  // Ejection fractions of healthy people are 0.52 to 0.74 (Lang et al., J. Am. Soc. Echocardiogr. 2015).
  EXPECT_GT(1 - kept, 0.52);
  EXPECT_LT(1 - kept, 0.74);
}

TEST(Heart, WallThickensInwards) {
  const Phantom systole = thorax_at({{"heart", kEndOfSystole}});
  // The side wall of the left ventricle at half its height, from the axis of the whole heart outwards.
  const glm::dvec3 centre = kHeartApex_mm - 50.0 * kHeartAxis;
  const glm::dvec3 q = glm::dvec3(40, -34, 92) - centre;
  const glm::dvec3 outwards = glm::normalize(q - glm::dot(q, kHeartAxis) * kHeartAxis);
  const auto radius_mm = [&](double rest_mm) {
    const glm::dvec3 moved = systole.motion().moved_mm(centre + rest_mm * outwards) - centre;
    return glm::length(moved - glm::dot(moved, kHeartAxis) * kHeartAxis);
  };
  constexpr double kCavity_mm = 29, kSurface_mm = 47;
  EXPECT_LT(radius_mm(kCavity_mm), kCavity_mm - 5);
  EXPECT_LT(radius_mm(kSurface_mm), kSurface_mm);
  // By a fifth or more: less than the third of a thin wall, for the phantom's is thick.
  EXPECT_GT(radius_mm(kSurface_mm) - radius_mm(kCavity_mm), 1.2 * (kSurface_mm - kCavity_mm));
}

TEST(Heart, LeavesChestWallAndSpineInPlace) {
  const Phases systole{{"heart", kEndOfSystole}};
  for (const glm::dvec3& p : {glm::dvec3(0, -95, 100), glm::dvec3(40, -92, 90), glm::dvec3(0, 43, 100),
                              glm::dvec3(27, 25, 100), glm::dvec3(24, 14, 100), glm::dvec3(-63, 2, 60)})
    // Less than is seen in a picture; the last but one is the aorta's wall behind the heart.
    EXPECT_LT(glm::length(shift_of(systole, p)), 0.5) << p.x << ' ' << p.y << ' ' << p.z;
}

// ---- coronary arteries ----------------------------------------------------------------------------

TEST(Coronaries, AreAddedToTheTreeThatThereIs) {
  const Phantom with = thorax_at({}), without = make_phantom("thorax");
  // Two leave the aorta at one place, and one of them forks: the aorta is cut once more.
  EXPECT_EQ(with.vessel_branches().size(), without.vessel_branches().size() + 5);
  EXPECT_EQ(with.vessel_branches()[1].points.back().position_mm,
            without.vessel_branches()[0].points.back().position_mm);
}

TEST(Coronaries, HaveMeasuredDiametersAndLieOnTheHeart) {
  const Phantom with = thorax_at({}), without = make_phantom("thorax");
  std::vector<const VesselBranch*> coronaries;
  for (const VesselBranch& vessel : with.vessel_branches())
    if (vessel.points.front().radius_mm < 2.3 && vessel.points.back().position_mm.z > 40 &&
        glm::distance(vessel.points[vessel.points.size() / 2].position_mm, glm::dvec3(20, -25, 105)) < 75)
      coronaries.push_back(&vessel);
  ASSERT_EQ(coronaries.size(), 4U);
  std::vector<double> diameters_mm;
  for (const VesselBranch* vessel : coronaries) diameters_mm.push_back(2 * vessel->points.front().radius_mm);
  // Dodge et al., Circulation 1992: left main 4.5, anterior descending 3.7, circumflex 3.4, right 3.9 mm.
  EXPECT_THAT(diameters_mm, testing::UnorderedElementsAre(4.5, 3.7, 3.4, 3.9));
  // The left main artery lies between the great arteries.
  coronaries.erase(std::ranges::find_if(
      coronaries, [](const VesselBranch* vessel) { return vessel->points.front().radius_mm == 2.25; }));
  for (const VesselBranch* vessel : coronaries)
    for (std::size_t k = vessel->points.size() / 5; k < vessel->points.size(); ++k) {
      const VesselPoint& point = vessel->points[k];
      // Muscle, fluid or blood within 6 mm: the heart's surface.
      bool is_near_heart = false;
      for (const double turn : {0.0, 0.8, 1.6, 2.4, 3.1, 3.9, 4.7, 5.5})
        for (const double tilt : {-1.0, 0.0, 1.0}) {
          const glm::dvec3 direction(std::cos(turn) * std::cos(tilt), std::sin(turn) * std::cos(tilt),
                                     std::sin(tilt));
          is_near_heart =
              is_near_heart || std::abs(without.hu_at(point.position_mm + 6.0 * direction) - 45) < 12;
        }
      ASSERT_TRUE(is_near_heart) << point.position_mm.x << ' ' << point.position_mm.y << ' '
                                 << point.position_mm.z;
      // Not in a chamber.
      ASSERT_NE(without.hu_at(point.position_mm), 55);
    }
}

// ---- files ----------------------------------------------------------------------------------------

struct Field {
  Index3 size;
  glm::dvec3 spacing_mm, origin_mm;
  std::vector<glm::vec3> vectors_mm;

  glm::dvec3 at(const glm::dvec3& p) const {
    const glm::dvec3 index =
        glm::clamp((p - origin_mm) / spacing_mm, glm::dvec3(0), glm::dvec3(size - Index3(1)));
    const Index3 first = glm::min(Index3(index), size - Index3(2));
    const glm::dvec3 t = index - glm::dvec3(first);
    glm::dvec3 sum(0);
    for (int corner = 0; corner < 8; ++corner) {
      const Index3 step(corner & 1, corner >> 1 & 1, corner >> 2);
      const Index3 node = first + step;
      const glm::dvec3 weight = glm::mix(1.0 - t, t, glm::dvec3(step));
      sum += weight.x * weight.y * weight.z *
             glm::dvec3(vectors_mm[static_cast<std::size_t>((node.z * size.y + node.y) * size.x + node.x)]);
    }
    return sum;
  }
};

/// A field as its header says it.
Field read_field(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  Field field;
  for (std::string line; std::getline(file, line) && !line.empty();) {
    std::ranges::replace_if(
        line, [](char c) { return c == '(' || c == ')' || c == ','; }, ' ');
    std::istringstream words(line.substr(line.find(':') + 1));
    std::string none;
    int three = 0;
    double zero = 0;
    if (line.starts_with("sizes:")) words >> three >> field.size.x >> field.size.y >> field.size.z;
    if (line.starts_with("space directions:"))
      words >> none >> field.spacing_mm.x >> zero >> zero >> zero >> field.spacing_mm.y >> zero >> zero >>
          zero >> field.spacing_mm.z;
    if (line.starts_with("space origin:"))
      words >> field.origin_mm.x >> field.origin_mm.y >> field.origin_mm.z;
  }
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  field.vectors_mm.resize(bytes.size() / sizeof(glm::vec3));
  std::memcpy(field.vectors_mm.data(), bytes.data(), bytes.size());
  EXPECT_EQ(std::ssize(field.vectors_mm), field.size.x * field.size.y * field.size.z);
  return field;
}

class PhantomMotionFile : public testing::Test {
 protected:
  nlohmann::json write(const Phantom& phantom, double spacing_mm) {
    Progress progress;
    write_motion(phantom, folder_.path(), spacing_mm, progress);
    return nlohmann::json::parse(std::ifstream(folder_.path() / "motion.json"));
  }
  TemporaryFolder folder_;
};

TEST_F(PhantomMotionFile, NamesModesInTheOrderInWhichTheyAreComposed) {
  const nlohmann::json written = write(make_phantom("thorax"), 12);
  EXPECT_EQ(written["version"], 1);
  ASSERT_EQ(written["modes"].size(), 2U);
  const nlohmann::json &breath = written["modes"][0], &heart = written["modes"][1];
  EXPECT_EQ(breath["name"], "breath");
  EXPECT_EQ(breath["waveform"].front(), nlohmann::json({0, 0}));
  EXPECT_EQ(breath["waveform"].back(), nlohmann::json({4, 0}));
  EXPECT_EQ(breath["phases"],
            nlohmann::json::parse(R"([{"phase": 0}, {"phase": 1, "field": "breath_1.nrrd"}])"));
  EXPECT_EQ(heart["name"], "heart");
  EXPECT_EQ(heart["phases"].size(), 10U);
  EXPECT_FALSE(heart["phases"][0].contains("field"));
  EXPECT_EQ(heart["phases"][4]["field"], "heart_0.4.nrrd");
}

TEST_F(PhantomMotionFile, HoldsWhatTheModesDo) {
  const Phantom thorax = make_phantom("thorax");
  write(thorax, 4);
  const Field breath = read_field(folder_.path() / "breath_1.nrrd"),
              heart = read_field(folder_.path() / "heart_0.3.nrrd");
  const PhantomMotion inspired = thorax_at({{"breath", 1}}).motion(),
                      beating = thorax_at({{"heart", 0.3}}).motion();
  std::mt19937 random(23);
  const auto within = [&](double low, double high) {
    return glm::mix(low, high, static_cast<double>(random()) / 0xffffffffu);
  };
  double breath_sum = 0, heart_sum = 0;
  constexpr int kPlaces = 20000;
  for (int i = 0; i < kPlaces; ++i) {
    const glm::dvec3 p(within(-150, 150), within(-110, 110), within(-250, 250));
    const double breath_mm = glm::distance(breath.at(p), inspired.pulled_back_mm(p) - p),
                 heart_mm = glm::distance(heart.at(p), beating.pulled_back_mm(p) - p);
    // Trilinear between nodes 4 mm apart: an eighth of 16 mm2 times the second derivative, which is 12 mm
    // over the square of a quarter of the narrowest ramp, 28 mm, in breath; and of the squeeze in the heart.
    ASSERT_LT(breath_mm, 0.5) << p.x << ' ' << p.y << ' ' << p.z;
    ASSERT_LT(heart_mm, 0.5) << p.x << ' ' << p.y << ' ' << p.z;
    breath_sum += breath_mm * breath_mm;
    heart_sum += heart_mm * heart_mm;
  }
  RecordProperty("breath_rms_um", static_cast<int>(1000 * std::sqrt(breath_sum / kPlaces)));
  RecordProperty("heart_rms_um", static_cast<int>(1000 * std::sqrt(heart_sum / kPlaces)));
  // Most places lie between the ramps.
  EXPECT_LT(std::sqrt(breath_sum / kPlaces), 0.1);
  EXPECT_LT(std::sqrt(heart_sum / kPlaces), 0.05);
  // On a node only the rounding to float is left.
  const glm::dvec3 node(-64, 0, 48);
  EXPECT_LT(glm::distance(breath.at(node), inspired.pulled_back_mm(node) - node), 1e-5);
}

TEST_F(PhantomMotionFile, IsRefusedForWhatDoesNotMoveFromRest) {
  const auto message = [](const Phantom& phantom, double spacing_mm) -> std::string {
    try {
      check_motion(phantom, spacing_mm);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message(make_phantom("sphere"), 4), HasSubstr("the phantom sphere does not move"));
  EXPECT_THAT(message(thorax_at({{"breath", 0.5}}), 4), HasSubstr("leave `phase` out"));
  EXPECT_THAT(message(make_phantom("thorax"), 0), HasSubstr("`motion_spacing_mm` 0: must be 0.5 to 50 mm"));
  EXPECT_THAT(message(make_phantom("thorax"), std::nan("")), HasSubstr("must be 0.5 to 50 mm"));
  EXPECT_THAT(message(make_phantom("thorax"), 0.5), HasSubstr("too large"));
  EXPECT_EQ(message(make_phantom("thorax"), 4), "");
}

}  // namespace
}  // namespace xraycast::phantom_motion_test
