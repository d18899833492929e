// A symmetric positive definite system, A = PᵀL·D·LᵀP, factorised by Eigen.
//
// Eigen's own solve() would give the same bits for a whole right side, but it allocates, and the tick path
// must not. For a right side with few values, of which each contact of a skin has one, Eigen has no solution
// that costs in proportion to the columns of L that it reaches.
#pragma once

#include <Eigen/SparseCholesky>
#include <cstdint>
#include <span>
#include <vector>

namespace smartsurf::surface {

class SparseCholesky {
 public:
  // Both read the lower triangle. factorise() may follow with other values in the same places; zeros in these
  // cost nothing afterwards.
  void analyse(const Eigen::SparseMatrix<double>&);
  void factorise(const Eigen::SparseMatrix<double>&);

  // Replaces b by A⁻¹b.
  void solve(std::span<double> b) noexcept;

  // D^(−1/2)·L⁻¹·P·b: the product of two of them is that of b with A⁻¹ times the other.
  struct HalfSolution {
    std::vector<std::int32_t> row;
    std::vector<double> value;
  };
  // Solves for a right side with values at few indices. Allocates while `out` grows.
  void half_solve(std::span<const std::size_t> indices, std::span<const float> values, HalfSolution& out);
  // The products of one half solution with others: out[i] = one·others[i].
  void multiply(const HalfSolution& one, std::span<const HalfSolution> others,
                std::span<double> out) noexcept;

 private:
  using Matrix = Eigen::SparseMatrix<double>;

  Eigen::SimplicialLDLT<Matrix> factors_;
  Matrix lower_;  // L below its diagonal, without zeros
  Eigen::VectorXd inverse_d_, inverse_root_d_;
  Eigen::VectorXd work_;  // by row; zero between calls
};

}  // namespace smartsurf::surface
