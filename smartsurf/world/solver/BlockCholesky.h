// Sparse Cholesky factor of a symmetric, positive definite matrix of 6×6 blocks: a row and a column of blocks
// for each body of an island, a block off the diagonal for each pair of bodies that touch.
//
// Bodies are eliminated by least degree. A body of a heap touches a few others, so that the factor of 32
// bodies takes a tenth of the work that it takes with all blocks.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace smartsurf::world {

template <int max_rows>
class BasicBlockCholesky {
 public:
  static constexpr int kMaxRows = max_rows, kSize = 6;
  // Three rows of a Jacobian matrix, along the three axes of a point.
  using Rows = double[3][kSize];

  // ---- the pattern: reset(), then connect() for the blocks that are not 0, then analyse(), after which all
  // blocks are 0
  void reset(int rows);
  void connect(int i, int j) { neighbours_[i] |= bit(j), neighbours_[j] |= bit(i); }
  void analyse();
  // Makes all blocks 0 again.
  void clear() { matrix_.assign(first_block_[rows_], Block{}); }

  // Adds Σ weight[k]·a[k]·b[k]ᵀ to block (i, j), and its transpose to (j, i) if i ≠ j; a = b if i = j. The
  // blocks must be connected.
  void add(int i, int j, const double (&weight)[3], const Rows& a, const Rows& b);
  // Adds to an element of a block on the diagonal; `row` ≥ `column`.
  void add_to_diagonal(int i, int row, int column, double value) {
    matrix_[diagonal(position_[i])][column * kSize + row] += value;
  }

  // Factors the matrix, which stays as it is. False if it is not positive definite.
  bool factor();
  // Replaces the right side, kSize elements for each row, by the solution. Call after factor().
  void solve(double* right_side);
  // Both: faster, because a column is eliminated from the right side while the next one is factored.
  bool factor_and_solve(double* right_side);

 private:
  using Block = std::array<double, kSize * kSize>;  // column by column
  __extension__ using Mask128 = unsigned __int128;
  using Mask = std::conditional_t<max_rows <= 32, std::uint32_t, Mask128>;  // a bit for each row
  static_assert(max_rows <= 128);
  static Mask bit(int i) { return Mask{1} << i; }
  int diagonal(int position) const { return first_block_[position]; }
  int below(int row, int column) const;
  template <class Each>
  bool factor_columns(Each each_column);
  void load_right_side(const double*);
  // Takes a factored column out of the rows of the right side below.
  void eliminate(int column);
  void substitute_back(double* solution);

  int rows_ = 0;
  Mask neighbours_[kMaxRows];  // by row
  // By position in the order of elimination: the row, the positions of the blocks below the diagonal, and the
  // first block of the column, on the diagonal. position_: by row.
  int row_at_[kMaxRows], position_[kMaxRows], first_block_[kMaxRows + 1];
  Mask below_[kMaxRows];
  std::vector<Block> matrix_, factor_;
  double right_side_[kMaxRows * kSize];  // by position
};

using BlockCholesky = BasicBlockCholesky<32>;
using LargeBlockCholesky = BasicBlockCholesky<128>;

}  // namespace smartsurf::world
