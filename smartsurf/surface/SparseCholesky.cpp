#include "smartsurf/surface/SparseCholesky.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {

void SparseCholesky::analyse(const Eigen::SparseMatrix<double>& a) {
  factors_.analyzePattern(a);
  const auto& order = factors_.permutationP().indices();
  order_.assign(order.data(), order.data() + order.size());
  work_.assign(order_.size(), 0.0);
}

void SparseCholesky::factorise(const Eigen::SparseMatrix<double>& a) {
  factors_.factorize(a);
  const auto& l = factors_.matrixL().nestedExpression();
  entries_.clear();
  first_entry_.assign(1, 0);
  for (Eigen::Index j = 0; j < l.outerSize(); ++j) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(l, j); it; ++it)
      if (it.row() > j && it.value() != 0.0)
        entries_.push_back({static_cast<std::int32_t>(it.row()), it.value()});
    first_entry_.push_back(entries_.size());
  }
  inverse_d_.clear();
  inverse_root_d_.clear();
  for (const double d : factors_.vectorD()) {
    inverse_d_.push_back(1.0 / d);
    inverse_root_d_.push_back(1.0 / std::sqrt(d));
  }
}

void SparseCholesky::solve(std::span<double> b) noexcept {
  const std::size_t n = order_.size();
  double* const x = work_.data();
  for (std::size_t i = 0; i < n; ++i) x[order_[i]] = b[i];
  for (std::size_t j = 0; j < n; ++j)
    for (const Entry& e : column(j)) x[e.row] -= e.value * x[j];
  for (std::size_t j = n; j-- > 0;) {
    double sum = inverse_d_[j] * x[j];
    for (const Entry& e : column(j)) sum -= e.value * x[e.row];
    x[j] = sum;
  }
  for (std::size_t i = 0; i < n; ++i) b[i] = x[order_[i]];
  std::ranges::fill(work_, 0.0);
}

// The rows that a right side reaches are the ancestors of its own in the elimination tree, in which the parent of a column is
// its first entry (Gilbert and Peierls 1988).
void SparseCholesky::half_solve(std::span<const std::size_t> indices, std::span<const float> values,
                                HalfSolution& out) {
  out.row.clear();
  out.value.clear();
  for (std::size_t k = 0; k < indices.size(); ++k) {
    if (values[k] == 0.0F) continue;
    std::int32_t row = order_[indices[k]];
    work_[static_cast<std::size_t>(row)] += static_cast<double>(values[k]);
    while (true) {
      out.row.push_back(row);
      const std::span<const Entry> entries = column(static_cast<std::size_t>(row));
      if (entries.empty()) break;
      row = entries.front().row;
    }
  }
  std::ranges::sort(out.row);
  out.row.erase(std::ranges::unique(out.row).begin(), out.row.end());
  for (const std::int32_t row : out.row) {
    const auto j = static_cast<std::size_t>(row);
    const double x = work_[j];
    work_[j] = 0.0;
    out.value.push_back(x * inverse_root_d_[j]);
    for (const Entry& e : column(j)) work_[static_cast<std::size_t>(e.row)] -= e.value * x;
  }
}

void SparseCholesky::multiply(const HalfSolution& one, std::span<const HalfSolution> others,
                              std::span<double> out) noexcept {
  for (std::size_t i = 0; i < one.row.size(); ++i) work_[static_cast<std::size_t>(one.row[i])] = one.value[i];
  for (std::size_t k = 0; k < others.size(); ++k) {
    double sum = 0.0;
    for (std::size_t i = 0; i < others[k].row.size(); ++i)
      sum += others[k].value[i] * work_[static_cast<std::size_t>(others[k].row[i])];
    out[k] = sum;
  }
  for (const std::int32_t row : one.row) work_[static_cast<std::size_t>(row)] = 0.0;
}

}  // namespace smartsurf::surface
