// The solutions of a banded system against those of a dense one.
#include "xraycast/mechanics/block_band_matrix.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <vector>

namespace xraycast::band_matrices_test {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

/// Symmetric, with its diagonal above the sum of the rest of each row, and zero where `is_zero` (row, column)
/// says.
template <typename IsZero>
MatrixXd random_matrix(Index size, std::mt19937& random, const IsZero& is_zero) {
  std::uniform_real_distribution<double> entry(-1, 1);
  MatrixXd matrix = MatrixXd::Zero(size, size);
  for (Index c = 0; c < size; ++c)
    for (Index r = c + 1; r < size; ++r)
      if (!is_zero(r, c)) matrix(r, c) = matrix(c, r) = entry(random);
  for (Index k = 0; k < size; ++k)
    matrix(k, k) = matrix.row(k).cwiseAbs().sum() + 0.1 + std::abs(entry(random));
  return matrix;
}

void expect_solution(const MatrixXd& matrix, const VectorXd& right, const double* solved) {
  const VectorXd expected = matrix.ldlt().solve(right);
  // Rounding, times the condition of such a matrix, some hundred.
  for (Index k = 0; k < matrix.rows(); ++k) EXPECT_NEAR(solved[k], expected[k], 1e-12) << k;
}

/// L D L^T of pivots from 1e-6 to 1e6, in any order: the diagonal's entries cancel in elimination. L is small
/// beside its diagonal, so that rounding, 1e-10 beside 1e6, does not grow up to the least pivots. What is
/// zero in L, down to a column's reach, is so in the product.
template <typename IsZero>
MatrixXd badly_scaled_matrix(Index size, std::mt19937& random, const IsZero& is_zero) {
  std::uniform_real_distribution<double> entry(-1, 1);
  MatrixXd lower = MatrixXd::Identity(size, size);
  VectorXd pivots(size);
  for (Index c = 0; c < size; ++c) {
    pivots[c] = std::pow(10, 6 * entry(random));
    for (Index r = c + 1; r < size; ++r)
      if (!is_zero(r, c)) lower(r, c) = 0.25 * entry(random);
  }
  if (size > 1) pivots[0] = 1e6, pivots[size / 2] = 1e-6;
  return lower * pivots.asDiagonal() * lower.transpose();
}

/// Elimination in any order leaves residuals of its rounding times the roots of both diagonal entries
/// (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., 2002, theorem 10.5).
void expect_small_residual(const MatrixXd& matrix, const VectorXd& right, const double* solved) {
  const VectorXd x = Eigen::Map<const VectorXd>(solved, matrix.rows()), scale = matrix.diagonal().cwiseSqrt();
  const double sum = scale.dot(x.cwiseAbs());
  // Rounding of some ten operations for each of up to 20 entries in a row.
  for (Index k = 0; k < matrix.rows(); ++k)
    EXPECT_LT(std::abs(matrix.row(k) * x - right[k]), 4e-14 * scale[k] * sum) << k;
}

/// An indefinite matrix is refused, whatever pivot is negative, and one with a NaN anywhere.
template <typename Filled>
void expect_refused(const MatrixXd& definite, const Filled& filled) {
  const Index size = definite.rows();
  for (Index k = 0; k < size; ++k) {
    MatrixXd indefinite = definite;
    indefinite(k, k) = -1;
    EXPECT_FALSE(filled(indefinite).factorise()) << size << ", " << k;
    // On the diagonal, and beside it.
    for (const Index r : {k, k + 1}) {
      if (r >= size || definite(r, k) == 0) continue;
      MatrixXd undefined = definite;
      undefined(r, k) = undefined(k, r) = std::numeric_limits<double>::quiet_NaN();
      EXPECT_FALSE(filled(undefined).factorise()) << size << ", " << r << ", " << k;
    }
  }
}

VectorXd counting(Index size) { return VectorXd::LinSpaced(size, -1, 1); }

TEST(BandMatrices, BlocksAreSolvedAsADenseMatrix) {
  constexpr Index kBlock = BlockBandMatrix::kBlock;
  std::mt19937 random(2);
  for (const std::size_t columns : {1, 2, 5, 30}) {
    // A reach that is zero here and five blocks there, and never falls below that of a column before.
    std::vector<std::size_t> reaches;
    for (std::size_t j = 0; j < columns; ++j) {
      const std::size_t reach = std::max(j + random() % 6, reaches.empty() ? 0 : reaches.back());
      reaches.push_back(std::min(columns - 1, reach));
    }
    const Index size = kBlock * static_cast<Index>(columns);
    const auto is_zero = [&](Index r, Index c) {
      return r / kBlock > static_cast<Index>(reaches[static_cast<std::size_t>(c / kBlock)]);
    };
    const MatrixXd dense = random_matrix(size, random, is_zero);
    const auto filled = [&](const MatrixXd& from) {
      BlockBandMatrix blocks;
      blocks.reset(reaches);
      for (std::size_t j = 0; j < columns; ++j)
        for (std::size_t i = j; i <= reaches[j]; ++i)
          for (Index c = 0; c < kBlock; ++c)
            for (Index r = 0; r < kBlock; ++r)
              blocks.at(i, j)[static_cast<std::size_t>(kBlock * c + r)] =
                  from(kBlock * static_cast<Index>(i) + r, kBlock * static_cast<Index>(j) + c);
      return blocks;
    };
    BlockBandMatrix blocks = filled(dense);
    ASSERT_TRUE(blocks.factorise());
    const VectorXd right = counting(size);
    std::vector<double> x(right.begin(), right.end());
    blocks.solve(x.data());
    expect_solution(dense, right, x.data());

    expect_refused(dense, filled);
    const MatrixXd scaled = badly_scaled_matrix(size, random, is_zero);
    blocks = filled(scaled);
    ASSERT_TRUE(blocks.factorise());
    x.assign(right.begin(), right.end());
    blocks.solve(x.data());
    expect_small_residual(scaled, right, x.data());
  }
}

}  // namespace
}  // namespace xraycast::band_matrices_test
