#include "smartsurf/surface/SparseCholesky.h"

#include <algorithm>

namespace smartsurf::surface {

void SparseCholesky::analyse(const Matrix& a) {
  factors_.analyzePattern(a);
  work_.setZero(a.rows());
}

void SparseCholesky::factorise(const Matrix& a) {
  factors_.factorize(a);
  lower_ = factors_.matrixL().nestedExpression();
  lower_.prune(
      [](Eigen::Index row, Eigen::Index column, double value) { return row > column && value != 0.0; });
  inverse_d_ = factors_.vectorD().cwiseInverse();
  inverse_root_d_ = factors_.vectorD().cwiseSqrt().cwiseInverse();
}

void SparseCholesky::solve(std::span<double> b) noexcept {
  Eigen::Map<Eigen::VectorXd> values(b.data(), std::ssize(b));
  work_.noalias() = factors_.permutationP() * values;
  lower_.triangularView<Eigen::UnitLower>().solveInPlace(work_);
  work_.array() *= inverse_d_.array();
  lower_.transpose().triangularView<Eigen::UnitUpper>().solveInPlace(work_);
  values.noalias() = factors_.permutationPinv() * work_;
  work_.setZero();
}

// The rows that a right side reaches are the ancestors of its own in the elimination tree, in which the
// parent of a column is its first entry (Gilbert and Peierls 1988).
void SparseCholesky::half_solve(std::span<const std::size_t> indices, std::span<const float> values,
                                HalfSolution& out) {
  const auto& order = factors_.permutationP().indices();
  out.row.clear();
  out.value.clear();
  for (std::size_t k = 0; k < indices.size(); ++k) {
    if (values[k] == 0.0F) continue;
    std::int32_t row = order[indices[k]];
    work_[row] += static_cast<double>(values[k]);
    while (row >= 0) {
      out.row.push_back(row);
      const Matrix::InnerIterator parent(lower_, row);
      row = parent ? static_cast<std::int32_t>(parent.row()) : -1;
    }
  }
  std::ranges::sort(out.row);
  out.row.erase(std::ranges::unique(out.row).begin(), out.row.end());
  for (const std::int32_t row : out.row) {
    const double x = work_[row];
    work_[row] = 0.0;
    out.value.push_back(x * inverse_root_d_[row]);
    for (Matrix::InnerIterator entry(lower_, row); entry; ++entry) work_[entry.row()] -= entry.value() * x;
  }
}

void SparseCholesky::multiply(const HalfSolution& one, std::span<const HalfSolution> others,
                              std::span<double> out) noexcept {
  for (std::size_t i = 0; i < one.row.size(); ++i) work_[one.row[i]] = one.value[i];
  for (std::size_t k = 0; k < others.size(); ++k) {
    out[k] = 0.0;
    for (std::size_t i = 0; i < others[k].row.size(); ++i)
      out[k] += others[k].value[i] * work_[others[k].row[i]];
  }
  for (const std::int32_t row : one.row) work_[row] = 0.0;
}

}  // namespace smartsurf::surface
