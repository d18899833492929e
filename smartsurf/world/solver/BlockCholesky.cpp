#include "smartsurf/world/solver/BlockCholesky.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>

namespace smartsurf::world {
namespace {

constexpr int kSize = BlockCholesky::kSize;

template <class Mask>
int count_bits(Mask mask) {
  if constexpr (sizeof(Mask) <= sizeof(std::uint64_t)) {
    return std::popcount(mask);
  } else {
    return std::popcount(static_cast<std::uint64_t>(mask)) +
           std::popcount(static_cast<std::uint64_t>(mask >> 64));
  }
}

template <class Mask>
int lowest_bit(Mask mask) {
  if constexpr (sizeof(Mask) <= sizeof(std::uint64_t)) {
    return std::countr_zero(mask);
  } else {
    const auto low = static_cast<std::uint64_t>(mask);
    return low != 0 ? std::countr_zero(low) : 64 + std::countr_zero(static_cast<std::uint64_t>(mask >> 64));
  }
}

// Calls each(i) for the bits of a mask, ascending.
template <class Mask, class Each>
void for_each_bit(Mask mask, Each each) {
  for (; mask != 0; mask &= mask - 1) each(lowest_bit(mask));
}

using Double2 [[gnu::vector_size(16)]] = double;
Double2 load2(const double* from) {
  Double2 v;
  std::memcpy(&v, from, sizeof(v));
  return v;
}
void store2(const Double2& v, double* to) { std::memcpy(to, &v, sizeof(v)); }

// A column of a block as compiler vectors, because GCC does not vectorise loops of six at -O2. They round as
// the scalars do. Members, not an array, which GCC would keep in memory.
struct BlockColumn {
  Double2 low, middle, high;

  static BlockColumn load(const double* from) { return {load2(from), load2(from + 2), load2(from + 4)}; }
  void store(double* to) const { store2(low, to), store2(middle, to + 2), store2(high, to + 4); }
  // Stores the elements from `row` on, of a column whose others have no meaning.
  [[gnu::always_inline]] void store_from(int row, double* to) const {
    if (row < 2) store2(low, to);
    if (row < 4) store2(middle, to + 2);
    store2(high, to + 4);
  }
};
BlockColumn operator*(const BlockColumn& c, double factor) {
  return {c.low * factor, c.middle * factor, c.high * factor};
}
BlockColumn operator+(const BlockColumn& a, const BlockColumn& b) {
  return {a.low + b.low, a.middle + b.middle, a.high + b.high};
}
BlockColumn operator-(const BlockColumn& a, const BlockColumn& b) {
  return {a.low - b.low, a.middle - b.middle, a.high - b.high};
}

// to += Σ weight[k]·down[k]·across[k]ᵀ; of a block on the diagonal the lower triangle.
template <bool is_diagonal>
void add_product(const double (&weight)[3], const double (&down)[3][kSize], const double (&across)[3][kSize],
                 double* to) {
  const BlockColumn rows[3] = {BlockColumn::load(down[0]), BlockColumn::load(down[1]),
                               BlockColumn::load(down[2])};
#pragma GCC unroll 6
  for (int c = 0; c < kSize; ++c) {
    const double w[3] = {weight[0] * across[0][c], weight[1] * across[1][c], weight[2] * across[2][c]};
    const BlockColumn sum = rows[0] * w[0] + rows[1] * w[1] + rows[2] * w[2];
    (BlockColumn::load(to + c * kSize) + sum).store_from(is_diagonal ? c : 0, to + c * kSize);
  }
}

// c −= a·bᵀ
void subtract_product(const double* __restrict a, const double* __restrict b, double* __restrict c) {
  for (int j = 0; j < kSize; ++j) {
    BlockColumn sum{};
    for (int k = 0; k < kSize; ++k) sum = sum + BlockColumn::load(a + k * kSize) * b[k * kSize + j];
    (BlockColumn::load(c + j * kSize) - sum).store(c + j * kSize);
  }
}

// The lower triangle of c −= a·aᵀ; what is above has no meaning.
void subtract_square(const double* __restrict a, double* __restrict c) {
#pragma GCC unroll 6
  for (int j = 0; j < kSize; ++j) {
    BlockColumn sum{};
#pragma GCC unroll 6
    for (int k = 0; k < kSize; ++k) sum = sum + BlockColumn::load(a + k * kSize) * a[k * kSize + j];
    (BlockColumn::load(c + j * kSize) - sum).store_from(j, c + j * kSize);
  }
}

// Replaces the lower triangle by its factor, with the inverse of the diagonal; what is above has no meaning.
// Each column is subtracted from those after it as a vector. False if it has none.
bool factor_block(double* a) {
  bool is_positive = true;
#pragma GCC unroll 6
  for (int j = 0; j < kSize; ++j) {
    const double pivot = a[j * kSize + j], inverse = 1.0 / std::sqrt(pivot);
    is_positive &= pivot > 0.0;
    const BlockColumn column = BlockColumn::load(a + j * kSize) * inverse;
    column.store_from(j, a + j * kSize);
#pragma GCC unroll 6
    for (int k = j + 1; k < kSize; ++k)
      (BlockColumn::load(a + k * kSize) - column * a[j * kSize + k]).store_from(k, a + k * kSize);
    a[j * kSize + j] = inverse;
  }
  return is_positive;
}

// a := a·l⁻ᵀ
void divide_by_factor(const double* __restrict l, double* __restrict a) {
  for (int j = 0; j < kSize; ++j) {
    BlockColumn column = BlockColumn::load(a + j * kSize);
    for (int k = 0; k < j; ++k) column = column - BlockColumn::load(a + k * kSize) * l[k * kSize + j];
    (column * l[j * kSize + j]).store(a + j * kSize);
  }
}

}  // namespace

template <int max_rows>
void BasicBlockCholesky<max_rows>::reset(int rows) {
  assert(rows <= kMaxRows);
  rows_ = rows;
  std::fill_n(neighbours_, rows, 0);
}

// Eliminates the row with the fewest neighbours, which become neighbours of each other.
template <int max_rows>
void BasicBlockCholesky<max_rows>::analyse() {
  Mask left = rows_ == kMaxRows ? ~Mask{0} : bit(rows_) - 1;
  Mask fill[kMaxRows], below_row[kMaxRows];
  int degree[kMaxRows];
  for (int i = 0; i < rows_; ++i) {
    fill[i] = neighbours_[i] & ~bit(i);
    degree[i] = count_bits(fill[i]);
  }
  for (int at = 0; at < rows_; ++at) {
    int next = lowest_bit(left);
    for_each_bit(left, [&](int i) {
      if (degree[i] < degree[next]) next = i;
    });
    left &= ~bit(next);
    row_at_[at] = next, position_[next] = at;
    below_row[at] = fill[next];
    for_each_bit(fill[next], [&](int i) {
      fill[i] = (fill[i] | fill[next]) & ~bit(i) & ~bit(next);
      degree[i] = count_bits(fill[i]);
    });
  }
  first_block_[0] = 0;
  for (int at = 0; at < rows_; ++at) {
    below_[at] = 0;
    for_each_bit(below_row[at], [&](int i) { below_[at] |= bit(position_[i]); });
    first_block_[at + 1] = first_block_[at] + 1 + count_bits(below_[at]);
  }
  clear();
}

// Index of the block at two positions, `row` after `column`.
template <int max_rows>
int BasicBlockCholesky<max_rows>::below(int row, int column) const {
  assert(below_[column] & bit(row));
  return first_block_[column] + 1 + count_bits(below_[column] & (bit(row) - 1));
}

template <int max_rows>
void BasicBlockCholesky<max_rows>::add(int i, int j, const double (&weight)[3], const Rows& a,
                                       const Rows& b) {
  const int at_i = position_[i], at_j = position_[j];
  if (at_i == at_j)
    add_product<true>(weight, a, b, matrix_[diagonal(at_i)].data());
  else if (at_i > at_j)
    add_product<false>(weight, a, b, matrix_[below(at_i, at_j)].data());
  else
    add_product<false>(weight, b, a, matrix_[below(at_j, at_i)].data());
}

// Factors the columns in their order. Calls each_column(column) once its blocks have their values.
template <int max_rows>
template <class Each>
[[gnu::always_inline]] inline bool BasicBlockCholesky<max_rows>::factor_columns(Each each_column) {
  factor_.assign(matrix_.begin(), matrix_.end());
  for (int column = 0; column < rows_; ++column) {
    double* const pivot = factor_[diagonal(column)].data();
    if (!factor_block(pivot)) return false;
    Block* const blocks = factor_.data() + diagonal(column) + 1;
    const int count = count_bits(below_[column]);
    for (int k = 0; k < count; ++k) divide_by_factor(pivot, blocks[k].data());
    int from = 0;
    for_each_bit(below_[column], [&](int j) {
      subtract_square(blocks[from].data(), factor_[diagonal(j)].data());
      int k = from + 1;
      for_each_bit(below_[column] & ~(bit(j) | (bit(j) - 1)), [&](int i) {
        subtract_product(blocks[k++].data(), blocks[from].data(), factor_[below(i, j)].data());
      });
      ++from;
    });
    each_column(column);
  }
  return true;
}

template <int max_rows>
bool BasicBlockCholesky<max_rows>::factor() {
  return factor_columns([](int) {});
}

template <int max_rows>
bool BasicBlockCholesky<max_rows>::factor_and_solve(double* right_side) {
  load_right_side(right_side);
  if (!factor_columns([this](int column) { eliminate(column); })) return false;
  substitute_back(right_side);
  return true;
}

template <int max_rows>
void BasicBlockCholesky<max_rows>::solve(double* right_side) {
  load_right_side(right_side);
  for (int column = 0; column < rows_; ++column) eliminate(column);
  substitute_back(right_side);
}

template <int max_rows>
void BasicBlockCholesky<max_rows>::load_right_side(const double* right_side) {
  for (int at = 0; at < rows_; ++at)
    std::copy_n(right_side + kSize * row_at_[at], kSize, right_side_ + kSize * at);
}

template <int max_rows>
void BasicBlockCholesky<max_rows>::eliminate(int column) {
  const double* block = factor_[diagonal(column)].data();
  double own[kSize];
  std::copy_n(right_side_ + kSize * column, kSize, own);
#pragma GCC unroll 6
  for (int j = 0; j < kSize; ++j) {
    own[j] *= block[j * kSize + j];
#pragma GCC unroll 6
    for (int i = j + 1; i < kSize; ++i) own[i] -= block[j * kSize + i] * own[j];
  }
  std::copy_n(own, kSize, right_side_ + kSize * column);
  for_each_bit(below_[column], [&](int row) {
    block += kSize * kSize;
    double* const to = right_side_ + kSize * row;
    BlockColumn below = BlockColumn::load(to);
    for (int j = 0; j < kSize; ++j) below = below - BlockColumn::load(block + j * kSize) * own[j];
    below.store(to);
  });
}

template <int max_rows>
void BasicBlockCholesky<max_rows>::substitute_back(double* solution) {
  for (int column = rows_ - 1; column >= 0; --column) {
    const double *const pivot = factor_[diagonal(column)].data(), *block = pivot;
    double own[kSize];
    std::copy_n(right_side_ + kSize * column, kSize, own);
    for_each_bit(below_[column], [&](int row) {
      block += kSize * kSize;
      const double* const x = right_side_ + kSize * row;
#pragma GCC unroll 6
      for (int i = 0; i < kSize; ++i)
#pragma GCC unroll 6
        for (int j = 0; j < kSize; ++j) own[j] -= block[j * kSize + i] * x[i];
    });
#pragma GCC unroll 6
    for (int j = kSize - 1; j >= 0; --j) {
#pragma GCC unroll 6
      for (int i = j + 1; i < kSize; ++i) own[j] -= pivot[j * kSize + i] * own[i];
      own[j] *= pivot[j * kSize + j];
    }
    std::copy_n(own, kSize, right_side_ + kSize * column);
    std::copy_n(own, kSize, solution + kSize * row_at_[column]);
  }
}

template class BasicBlockCholesky<32>;
template class BasicBlockCholesky<128>;

}  // namespace smartsurf::world
