// A symmetric positive definite system, A = PᵀL·D·LᵀP, factorised by Eigen. Its solutions allocate nothing, unlike
// Eigen's, and one for few loads costs in proportion to the columns of L that they reach.
#pragma once

#include <Eigen/SparseCholesky>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace smartsurf::surface {

class SparseCholesky {
 public:
  // Both read the lower triangle. factorise() may follow with other values in the same places; zeros in these cost nothing
  // afterwards.
  void analyse(const Eigen::SparseMatrix<double>&);
  void factorise(const Eigen::SparseMatrix<double>&);

  // Replaces b by A⁻¹b.
  void solve(std::span<double> b) noexcept;

  // D^(−1/2)·L⁻¹·P·b: the product of two of them is that of b with A⁻¹ times the other.
  struct HalfSolution {
    std::vector<std::int32_t> row;
    std::vector<double> value;
  };
  // Of a right side with values at few indices. Allocates while `out` grows.
  void half_solve(std::span<const std::size_t> indices, std::span<const float> values, HalfSolution& out);
  // The products of one half solution with others: out[i] = one·others[i].
  void multiply(const HalfSolution& one, std::span<const HalfSolution> others,
                std::span<double> out) noexcept;

 private:
  struct Entry {
    std::int32_t row;
    double value;
  };
  std::span<const Entry> column(std::size_t j) const {
    return std::span(entries_).subspan(first_entry_[j], first_entry_[j + 1] - first_entry_[j]);
  }

  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors_;
  std::vector<Entry> entries_;            // of L below its diagonal, by columns, without zeros
  std::vector<std::size_t> first_entry_;  // by column
  std::vector<double> inverse_d_, inverse_root_d_;
  std::vector<std::int32_t> order_;  // row of each index
  std::vector<double> work_;         // by row; zero between calls
};

}  // namespace smartsurf::surface
