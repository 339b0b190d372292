#include "xraycast/registration/evolution_search.hpp"

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace xraycast {
namespace {

/// Standard normal numbers, the same on every machine (Box and Muller).
class Normals {
 public:
  explicit Normals(std::uint64_t seed) : random_(seed) {}
  double next() {
    const double a = uniform(), b = uniform();
    return std::sqrt(-2 * std::log(a)) * std::cos(2 * 3.14159265358979323846 * b);
  }

 private:
  double uniform() { return (static_cast<double>(random_() >> 11) + 0.5) * 0x1p-53; }
  std::mt19937_64 random_;
};

/// The strategy's state, with the names of Hansen's tutorial.
class Strategy {
 public:
  Strategy(int n, int lambda, double sigma)
      : n_(n),
        weights_(lambda / 2),
        mean_(Eigen::VectorXd::Zero(n)),
        sigma_path_(Eigen::VectorXd::Zero(n)),
        covariance_path_(Eigen::VectorXd::Zero(n)),
        covariance_(Eigen::MatrixXd::Identity(n, n)),
        sigma_(sigma) {
    for (int i = 0; i < weights_.size(); ++i) weights_[i] = std::log(0.5 * lambda + 0.5) - std::log(i + 1.0);
    weights_ /= weights_.sum();
    effective_ = 1 / weights_.squaredNorm();
    decompose();
  }

  Eigen::VectorXd sample(Normals& normals) const {
    Eigen::VectorXd z(n_);
    for (int i = 0; i < n_; ++i) z[i] = normals.next();
    return mean_ + sigma_ * (axes_ * lengths_.cwiseProduct(z));
  }

  /// `best` first.
  void learn(const std::vector<Eigen::VectorXd>& best) {
    const double n = n_, c_sigma = (effective_ + 2) / (n + effective_ + 5),
                 d_sigma = 1 + 2 * std::max(0.0, std::sqrt((effective_ - 1) / (n + 1)) - 1) + c_sigma,
                 c_c = (4 + effective_ / n) / (n + 4 + 2 * effective_ / n),
                 c_1 = 2 / ((n + 1.3) * (n + 1.3) + effective_),
                 c_mu = std::min(1 - c_1,
                                 2 * (effective_ - 2 + 1 / effective_) / ((n + 2) * (n + 2) + effective_)),
                 expected = std::sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n));
    const Eigen::VectorXd before = mean_;
    mean_.setZero();
    for (int i = 0; i < weights_.size(); ++i) mean_ += weights_[i] * best[static_cast<std::size_t>(i)];
    const Eigen::VectorXd step = (mean_ - before) / sigma_;
    const Eigen::VectorXd white = axes_ * (axes_.transpose() * step).cwiseQuotient(lengths_);
    sigma_path_ = (1 - c_sigma) * sigma_path_ + std::sqrt(c_sigma * (2 - c_sigma) * effective_) * white;
    ++generation_;
    const bool is_short = sigma_path_.norm() / std::sqrt(1 - std::pow(1 - c_sigma, 2 * generation_)) <
                          (1.4 + 2 / (n + 1)) * expected;
    covariance_path_ *= 1 - c_c;
    if (is_short) covariance_path_ += std::sqrt(c_c * (2 - c_c) * effective_) * step;
    covariance_ *= 1 - c_1 - c_mu + (is_short ? 0 : c_1 * c_c * (2 - c_c));
    covariance_ += c_1 * covariance_path_ * covariance_path_.transpose();
    for (int i = 0; i < weights_.size(); ++i) {
      const Eigen::VectorXd y = (best[static_cast<std::size_t>(i)] - before) / sigma_;
      covariance_ += c_mu * weights_[i] * y * y.transpose();
    }
    sigma_ *= std::exp(c_sigma / d_sigma * (sigma_path_.norm() / expected - 1));
    decompose();
  }

  double spread() const { return sigma_ * lengths_.maxCoeff(); }

 private:
  void decompose() {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance_);
    axes_ = solver.eigenvectors();
    lengths_ = solver.eigenvalues().cwiseMax(1e-20).cwiseSqrt();
  }

  int n_;
  Eigen::VectorXd weights_, mean_, sigma_path_, covariance_path_;
  Eigen::MatrixXd covariance_, axes_;
  Eigen::VectorXd lengths_;
  double sigma_, effective_ = 1;
  int generation_ = 0;
};

}  // namespace

std::vector<Optimum> search_by_evolution(const EvolutionOptions& options, const ValuesAt& values_at) {
  Normals normals(options.seed);
  Strategy strategy(options.dimensions, options.samples, options.sigma);
  std::vector<Optimum> optima;
  for (int generation = 0; generation < options.generations && strategy.spread() > options.precision;
       ++generation) {
    std::vector<Eigen::VectorXd> samples;
    std::vector<std::vector<double>> points;
    for (int i = 0; i < options.samples; ++i) {
      samples.push_back(strategy.sample(normals));
      const Eigen::VectorXd within = samples.back().cwiseMax(-1).cwiseMin(1);
      points.emplace_back(within.begin(), within.end());
    }
    std::vector<double> values = values_at(points);
    std::vector<std::size_t> order(samples.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::vector<double> reduced = values;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const Eigen::Map<const Eigen::VectorXd> within(points[i].data(), options.dimensions);
      reduced[i] -= (samples[i] - within).squaredNorm();
    }
    std::ranges::sort(order, [&](std::size_t a, std::size_t b) { return reduced[a] > reduced[b]; });
    optima.push_back({points[order[0]], values[order[0]]});
    std::vector<Eigen::VectorXd> best;
    for (const std::size_t i : order) best.push_back(samples[i]);
    strategy.learn(best);
  }
  std::ranges::sort(optima, [](const Optimum& a, const Optimum& b) { return a.value > b.value; });
  return optima;
}

}  // namespace xraycast
