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

// c −= a·bᵀ
void subtract_product(const double* __restrict a, const double* __restrict b, double* __restrict c) {
  for (int j = 0; j < kSize; ++j) {
    BlockColumn sum{};
    for (int k = 0; k < kSize; ++k) sum = sum + BlockColumn::load(a + k * kSize) * b[k * kSize + j];
    (BlockColumn::load(c + j * kSize) - sum).store(c + j * kSize);
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
    column.store(a + j * kSize);
#pragma GCC unroll 6
    for (int k = j + 1; k < kSize; ++k)
      (BlockColumn::load(a + k * kSize) - column * a[j * kSize + k]).store(a + k * kSize);
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
  const bool is_below = at_i >= at_j;
  const Rows &down = is_below ? a : b, &across = is_below ? b : a;
  const int index = at_i == at_j ? diagonal(at_i) : is_below ? below(at_i, at_j) : below(at_j, at_i);
  double* const to = matrix_[index].data();
  const BlockColumn rows[3] = {BlockColumn::load(down[0]), BlockColumn::load(down[1]),
                               BlockColumn::load(down[2])};
  for (int c = 0; c < kSize; ++c) {
    const double w[3] = {weight[0] * across[0][c], weight[1] * across[1][c], weight[2] * across[2][c]};
    const BlockColumn sum = rows[0] * w[0] + rows[1] * w[1] + rows[2] * w[2];
    (BlockColumn::load(to + c * kSize) + sum).store(to + c * kSize);
  }
}

template <int max_rows>
bool BasicBlockCholesky<max_rows>::factor() {
  factor_.assign(matrix_.begin(), matrix_.end());
  for (int column = 0; column < rows_; ++column) {
    double* const pivot = factor_[diagonal(column)].data();
    if (!factor_block(pivot)) return false;
    Block* const blocks = factor_.data() + diagonal(column) + 1;
    const int count = count_bits(below_[column]);
    for (int k = 0; k < count; ++k) divide_by_factor(pivot, blocks[k].data());
    int from = 0;
    for_each_bit(below_[column], [&](int j) {
      subtract_product(blocks[from].data(), blocks[from].data(), factor_[diagonal(j)].data());
      int k = from + 1;
      for_each_bit(below_[column] & ~(bit(j) | (bit(j) - 1)), [&](int i) {
        subtract_product(blocks[k++].data(), blocks[from].data(), factor_[below(i, j)].data());
      });
      ++from;
    });
  }
  return true;
}

template <int max_rows>
void BasicBlockCholesky<max_rows>::solve(double* right_side) {
  double* const x = right_side_;
  for (int at = 0; at < rows_; ++at) std::copy_n(right_side + kSize * row_at_[at], kSize, x + kSize * at);
  for (int column = 0; column < rows_; ++column) {
    const double* block = factor_[diagonal(column)].data();
    double* const own = x + kSize * column;
    for (int j = 0; j < kSize; ++j) {
      own[j] *= block[j * kSize + j];
      for (int i = j + 1; i < kSize; ++i) own[i] -= block[j * kSize + i] * own[j];
    }
    for_each_bit(below_[column], [&](int row) {
      block += kSize * kSize;
      BlockColumn below = BlockColumn::load(x + kSize * row);
      for (int j = 0; j < kSize; ++j) below = below - BlockColumn::load(block + j * kSize) * own[j];
      below.store(x + kSize * row);
    });
  }
  for (int column = rows_ - 1; column >= 0; --column) {
    const double* block = factor_[diagonal(column)].data();
    double* const own = x + kSize * column;
    const double* next = block;
    for_each_bit(below_[column], [&](int row) {
      next += kSize * kSize;
      for (int j = 0; j < kSize; ++j)
        for (int i = 0; i < kSize; ++i) own[j] -= next[j * kSize + i] * x[kSize * row + i];
    });
    for (int j = kSize - 1; j >= 0; --j) {
      for (int i = j + 1; i < kSize; ++i) own[j] -= block[j * kSize + i] * own[i];
      own[j] *= block[j * kSize + j];
    }
  }
  for (int at = 0; at < rows_; ++at) std::copy_n(x + kSize * at, kSize, right_side + kSize * row_at_[at]);
}

template class BasicBlockCholesky<32>;
template class BasicBlockCholesky<128>;

}  // namespace smartsurf::world
