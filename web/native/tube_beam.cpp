// The beams of the page's tube, which `xraycast export` computed (viewer/xraycast/fluoroscope/tube_beam.cpp).
#include "tube_beam.hpp"

#include "xraycast/base/error.hpp"

#include <utility>

namespace xraycast {
namespace {

TubeBeams page_beams;

}  // namespace

void set_page_beams(TubeBeams beams) { page_beams = std::move(beams); }

FluoroscopyBeam::FluoroscopyBeam(const CArm&, int kvp) : FluoroscopyBeam(page_beams.at(kvp)) {}

FluoroscopyBeam::FluoroscopyBeam(const CArm&, const Spectrum&)
    : spectrum(std::vector<DetectedSpectrum::Bin>()) {
  throw Error("a page has the beams of its tube alone");
}

double absorbed_kev_per_uGy(const FluoroscopyDetector&) { return page_beams.absorbed_kev_per_uGy; }

}  // namespace xraycast
