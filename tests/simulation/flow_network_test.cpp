#include "xraycast/blood_flow/flow_network.hpp"

#include "xraycast/base/error.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
#include <random>

namespace xraycast::flow_network_test {
namespace {

FlowNode resistor(int parent, double resistance) { return {.parent = parent, .resistance = resistance}; }

FlowNode ground(int parent, double resistance) {
  return {.parent = parent, .resistance = resistance, .is_held = true};
}

TEST(FlowNetwork, DividesAFlowAsKirchhoffDoes) {
  // 2 in series with 3 to the ground beside 6 to the ground: 2.5 ml/s each of 5 by 5 beside 5.
  FlowNetwork network({{}, resistor(0, 2), ground(1, 3), ground(0, 6)});
  network.set_inflow(0, 5);
  network.settle();
  const double first = 5 * 6.0 / (6 + 5);
  // The bar is 0.1 %; the equations are linear and solved to rounding.
  EXPECT_NEAR(network.flow(1), first, 1e-9);
  EXPECT_NEAR(network.flow(2), first, 1e-9);
  EXPECT_NEAR(network.flow(3), 5 - first, 1e-9);
  EXPECT_NEAR(network.pressure(0), 6 * (5 - first), 1e-9);
}

TEST(FlowNetwork, DischargesACapacitorExponentially) {
  constexpr double kR = 2, kC = 0.7, kStep = 0.01;
  FlowNetwork network({{.compliance = kC}, ground(0, kR)});
  network.set_inflow(0, 10 / kR);
  network.settle();
  network.set_inflow(0, 0);
  for (int i = 1; i <= 500; ++i) {
    network.step(kStep);
    // The bar is 1 %; a second-order scheme with steps of 1/140 of the time constant errs by its square.
    EXPECT_NEAR(network.pressure(0), 10 * std::exp(-i * kStep / (kR * kC)), 10 * 1e-4) << i;
  }
}

TEST(FlowNetwork, SpeedsUpAgainstAnInertance) {
  constexpr double kR = 2, kL = 0.5, kStep = 0.002;
  FlowNetwork network({{.is_held = true}, {.parent = 0, .resistance = kR, .inertance = kL, .is_held = true}});
  network.set_outside(0, 8);
  network.step(1e-12);  // the pressure jumps
  for (int i = 1; i <= 300; ++i) {
    network.step(kStep);
    // As above.
    EXPECT_NEAR(network.flow(1), 4 * (1 - std::exp(-i * kStep * kR / kL)), 4 * 1e-4) << i;
  }
}

TEST(FlowNetwork, IsOfSecondOrder) {
  const auto error = [](double step) {
    // Two masses and a spring: q'' + q' + 4 q = 0 of a discharge through an inertance.
    FlowNetwork network(
        {{.compliance = 0.25}, {.parent = 0, .resistance = 1, .inertance = 1, .is_held = true}});
    network.set_inflow(0, 1);
    network.settle();
    network.set_inflow(0, 0);
    const double end = 2;
    for (int i = 0; i < static_cast<int>(std::lround(end / step)); ++i) network.step(step);
    const double omega = std::sqrt(4 - 0.25);
    const double exact = std::exp(-0.5 * end) * (std::cos(omega * end) + 0.5 / omega * std::sin(omega * end));
    // At 0 s the flow is 1, and its rate (P - R q) / L is 0.
    return std::abs(network.flow(1) - exact);
  };
  EXPECT_NEAR(error(0.02) / error(0.01), 4, 0.2);
}

TEST(FlowNetwork, LosesPressureByTheSquareOfTheFlow) {
  for (const double flow : {5.0, -5.0, 1e-6}) {
    FlowNetwork network({{}, {.parent = 0, .resistance = 0.5, .quadratic_loss = 3}, ground(1, 2)});
    network.set_inflow(0, flow);
    network.settle();
    // Newton's method to 1e-11 of the flow.
    EXPECT_NEAR(network.pressure(0), 2.5 * flow + 3 * std::abs(flow) * flow, 1e-8 * std::abs(flow));
  }
  // Of two ways with a quadratic loss each, the flow finds the right shares.
  FlowNetwork network({{},
                       {.parent = 0, .resistance = 0.5, .quadratic_loss = 3},
                       ground(1, 2),
                       {.parent = 0, .resistance = 1, .quadratic_loss = 1},
                       ground(3, 1)});
  network.set_inflow(0, 10);
  network.settle();
  const auto drop = [](double q, double r, double k) { return r * q + k * q * q; };
  EXPECT_NEAR(drop(network.flow(1), 2.5, 3), drop(network.flow(3), 2, 1), 1e-8);
  EXPECT_NEAR(network.flow(1) + network.flow(3), 10, 1e-12);
}

/// The impedance of a rigid pipe relative to its steady one, by the series of the Bessel functions.
std::complex<double> womersley(double alpha) {
  using Complex = std::complex<double>;
  const Complex z = alpha * std::exp(Complex(0, 0.75 * std::numbers::pi)), quarter = -0.25 * z * z;
  Complex j0 = 0, j1 = 0, term = 1;
  for (int k = 0; k < 100; ++k) {
    j0 += term;
    j1 += term * 0.5 * z / (k + 1.0);
    term *= quarter / ((k + 1.0) * (k + 1.0));
  }
  return Complex(0, alpha * alpha / 8) / (1.0 - 2.0 * j1 / (z * j0));
}

class Womersley : public testing::TestWithParam<double> {};

TEST_P(Womersley, IsTheImpedanceOfAPipe) {
  // A pipe of resistance 1 with its inertance rho L / A = R r2 / (8 nu), driven by a pressure of frequency 1.
  const double alpha = GetParam();
  FlowNetwork network(
      {{.is_held = true},
       {.parent = 0, .resistance = 1, .inertance = alpha * alpha / 8, .is_pipe = true, .is_held = true}});
  constexpr int kSteps = 2000;
  constexpr double kStep = 2 * std::numbers::pi / kSteps;
  std::complex<double> flow = 0;
  // The slowest mode, whose time constant is alpha^2 / z^2, is at rest after this many periods.
  const int periods = 2 + static_cast<int>(alpha * alpha / 2);
  for (int i = 0; i < periods * kSteps; ++i) {
    network.set_outside(0, std::cos(kStep * (i + 1)));
    network.step(kStep);
    if (i >= (periods - 1) * kSteps)
      flow += network.flow(1) * std::exp(std::complex<double>(0, -kStep * (i + 1))) * (2.0 / kSteps);
  }
  const std::complex<double> impedance = 1.0 / flow;
  // The bar is 5 %; three modes stay within 1.7 %.
  EXPECT_LT(std::abs(impedance / womersley(alpha) - 1.0), 0.02);
}

INSTANTIATE_TEST_SUITE_P(Alphas, Womersley, testing::Values(0.1, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0));

/// A tree of everything by the toss of dice.
FlowNetwork tossed(std::uint32_t seed) {
  std::mt19937 dice(seed);
  const auto uniform = [&] { return static_cast<double>(dice()) / 4294967296.0; };
  std::vector<FlowNode> nodes{{.compliance = 1}};
  for (int i = 1; i < 80; ++i) {
    const bool is_pipe = dice() % 2 == 0;
    nodes.push_back({.parent = std::max(0, i - 1 - static_cast<int>(dice() % 4)),
                     .resistance = std::exp(8 * uniform() - 6),
                     .inertance = dice() % 3 == 0 && !is_pipe ? 0 : 0.01 * uniform(),
                     .quadratic_loss = dice() % 4 == 0 ? 0.1 * uniform() : 0,
                     .is_pipe = is_pipe,
                     .compliance = dice() % 3 == 0 ? 0.1 * uniform() : 0});
    if (i > 60) nodes.back().is_held = true;
  }
  for (int i = 61; i < 80; ++i)
    nodes[static_cast<std::size_t>(i)].parent = 20 + static_cast<int>(dice() % 40);
  return FlowNetwork(nodes);
}

class TossedNetworks : public testing::TestWithParam<std::uint32_t> {};

TEST_P(TossedNetworks, KeepTheirVolumeWhateverHappens) {
  FlowNetwork network = tossed(GetParam());
  std::mt19937 dice(GetParam());
  network.set_inflow(0, 5);
  network.settle();
  double stored = 0, gained = 0, passed = 0;
  const auto in_store = [&] {
    double sum = 0;
    for (std::size_t i = 0; i < network.size(); ++i) sum += network.stored(i);
    return sum;
  };
  stored = in_store();
  for (int n = 0; n < 400; ++n) {
    const double time = 1e-4 * static_cast<double>(1 + dice() % 40);
    const double flow = static_cast<double>(dice() % 200) / 10,
                 source = static_cast<double>(dice() % 100) / 10;
    network.set_inflow(0, flow);
    network.set_inflow(30, source);
    if (n % 40 == 20) network.set_conductance(25, dice() % 2 == 0 ? 0 : 0.3);
    if (n % 40 == 39) network.set_conductance(25, 1);
    network.step(time);
    gained += (flow + source) * time;
    passed += (flow + source) * time;
    for (std::size_t i = 0; i < network.size(); ++i) {
      ASSERT_TRUE(std::isfinite(network.pressure(i))) << i;
      if (network.is_held(i)) gained -= network.mean_flow(i) * time;
    }
    // The bar; what is left is the rounding of some thousand sums.
    ASSERT_NEAR(in_store() - stored, gained, 1e-9 * passed) << n;
  }
}

TEST_P(TossedNetworks, AreNotChangedByAnInjectionOfNothing) {
  FlowNetwork still = tossed(GetParam()), injected = tossed(GetParam());
  for (FlowNetwork* network : {&still, &injected}) {
    network->set_inflow(0, 5);
    network->settle();
  }
  for (int n = 0; n < 100; ++n) {
    injected.set_inflow(30, 0);
    still.step(1e-3);
    injected.step(1e-3);
    for (std::size_t i = 0; i < still.size(); ++i) ASSERT_EQ(still.pressure(i), injected.pressure(i));
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, TossedNetworks, testing::Range(1u, 9u));

TEST(FlowNetwork, StandsStillBehindAClosedElement) {
  FlowNetwork network(
      {{.compliance = 1}, {.parent = 0, .resistance = 1, .inertance = 0.1}, ground(1, 2), ground(0, 4)});
  network.set_inflow(0, 6);
  network.settle();
  network.set_conductance(1, 0);
  network.step(0.01);
  EXPECT_EQ(network.flow(1), 0);
  EXPECT_NEAR(network.flow(2), 0, 1e-12);
  network.settle();
  EXPECT_NEAR(network.flow(3), 6, 1e-6) << "all of it goes the other way";
  network.set_conductance(1, 1);
  network.settle();
  EXPECT_NEAR(network.flow(1), 6 * 4.0 / 7, 1e-6);
}

TEST(FlowNetwork, RefusesWhatHasNoSolution) {
  const auto message = [](std::vector<FlowNode> nodes) -> std::string {
    try {
      const FlowNetwork network(std::move(nodes));
    } catch (const InputError& error) {
      return error.what();
    }
    return "nothing";
  };
  EXPECT_EQ(message({}), "a network without nodes; give at least one");
  EXPECT_EQ(message({{}, resistor(0, 1)}),
            "a network without an outlet; hold a pressure behind a resistance, or give a compliance");
  EXPECT_EQ(message({{}, ground(0, 0)}), "node 1: neither `resistance` nor `inertance`; give one above 0");
  EXPECT_EQ(message({{}, ground(0, -1)}), "node 1: `resistance` -1; give a finite number of 0 or more");
  EXPECT_EQ(message({{}, ground(1, 1)}), "node 1: `parent` 1; give the index of an earlier node");
  EXPECT_EQ(message({{.parent = 0}}), "node 0: `parent` 0; the first node has none, -1");
  EXPECT_EQ(message({{.compliance = std::nan("")}}),
            "node 0: `compliance` nan; give a finite number of 0 or more");
}

}  // namespace
}  // namespace xraycast::flow_network_test
