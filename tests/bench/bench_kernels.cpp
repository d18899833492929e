// The kernels of bench_kernels.py, which compiles them, in plain C++: loops over rows that a compiler turns
// into vectors, without libraries and intrinsics. Arrays are row-major and do not overlap.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

namespace {

constexpr int kCircle[16][2] = {{0, -3}, {1, -3}, {2, -2}, {3, -1}, {3, 0},  {3, 1},   {2, 2},   {1, 3},
                                {0, 3},  {-1, 3}, {-2, 2}, {-3, 1}, {-3, 0}, {-3, -1}, {-2, -2}, {-1, -3}};

// Nine of the sixteen bits in a row, in a circle.
inline std::uint16_t has_arc(std::uint16_t bits) {
  for (const int k : {1, 2, 4}) bits &= static_cast<std::uint16_t>(bits << k | bits >> (16 - k));
  return bits & static_cast<std::uint16_t>(bits << 1 | bits >> 15);
}

int find_root(std::int32_t* parents, int k) {
  while (parents[k] != k) k = parents[k] = parents[parents[k]];
  return k;
}

struct Reaction {
  float feed, kill, spread_u, spread_v;
};

// One row of the reaction of Gray and Scott, from the rows above it, its own and below it of u and v.
void react(int n, Reaction of, const float* __restrict up, const float* __restrict u,
           const float* __restrict down, const float* __restrict v_up, const float* __restrict v,
           const float* __restrict v_down, float* __restrict to_u, float* __restrict to_v) {
  const auto at = [=](int c, int west, int east) {
    const float reaction = u[c] * v[c] * v[c];
    to_u[c] = u[c] + (of.spread_u * (up[c] + down[c] + u[west] + u[east] - 4 * u[c]) - reaction +
                      of.feed * (1 - u[c]));
    to_v[c] = v[c] + (of.spread_v * (v_up[c] + v_down[c] + v[west] + v[east] - 4 * v[c]) + reaction -
                      (of.feed + of.kill) * v[c]);
  };
  at(0, n - 1, 1);
#pragma GCC ivdep
  for (int c = 1; c < n - 1; ++c) at(c, c - 1, c + 1);
  at(n - 1, n - 2, 0);
}

constexpr int kChannels = 16, kSeen = 48, kHidden = 32;
constexpr int kBlock = 32;  // columns whose sums stay in registers

// Sums of products of `inputs` rows of a block: y = weights × x.
template <int outputs, int inputs>
void multiply(const float* __restrict weights, const float (*__restrict x)[kBlock],
              float (*__restrict y)[kBlock]) {
  for (int k = 0; k < outputs; ++k) {
    float sum[kBlock] = {};
    for (int j = 0; j < inputs; ++j)
      for (int c = 0; c < kBlock; ++c) sum[c] += weights[k * inputs + j] * x[j][c];
    std::memcpy(y[k], sum, sizeof sum);
  }
}

}  // namespace

extern "C" {

// Magnitude of the slopes; zeros beyond the edges.
void sobel(int n, const float* __restrict a, float* __restrict y) {
  const std::vector<float> zeros(static_cast<std::size_t>(n));
  for (int r = 0; r < n; ++r) {
    const float* const up = r > 0 ? a + (r - 1) * n : zeros.data();
    const float* const at = a + r * n;
    const float* const down = r < n - 1 ? at + n : zeros.data();
    const auto magnitude = [&](int c, float nw, float w, float sw, float ne, float e, float se) {
      const float east = (ne - nw) + 2 * (e - w) + (se - sw);
      const float south = (sw - nw) + 2 * (down[c] - up[c]) + (se - ne);
      return std::sqrt(east * east + south * south);
    };
    float* const to = y + r * n;
    to[0] = magnitude(0, 0, 0, 0, up[1], at[1], down[1]);
    for (int c = 1; c < n - 1; ++c)
      to[c] = magnitude(c, up[c - 1], at[c - 1], down[c - 1], up[c + 1], at[c + 1], down[c + 1]);
    to[n - 1] = magnitude(n - 1, up[n - 2], at[n - 2], down[n - 2], 0, 0, 0);
  }
}

// Correlation with 11×11 elements; zeros beyond the edges, in `padded`, of n + 10 rows and n + 10 + kBlock
// columns.
void filter11(int n, const float* __restrict a, const float* __restrict kernel, float* __restrict padded,
              float* __restrict y) {
  const int pitch = n + 10 + kBlock;
  for (int r = 0; r < n; ++r)
    std::memcpy(padded + (r + 5) * pitch + 5, a + r * n, sizeof(float) * static_cast<std::size_t>(n));
  for (int r = 0; r < n; ++r)
    for (int begin = 0; begin < n; begin += kBlock) {
      float sum[kBlock] = {};
      for (int j = 0; j < 11; ++j)
        for (int i = 0; i < 11; ++i) {
          const float* const from = padded + (r + j) * pitch + begin + i;
          for (int c = 0; c < kBlock; ++c) sum[c] += kernel[j * 11 + i] * from[c];
        }
      std::memcpy(y + r * n + begin, sum,
                  sizeof(float) * static_cast<std::size_t>(std::min(kBlock, n - begin)));
    }
}

// Corners, without those within three cells of an edge.
void fast9(int n, int threshold, const std::uint8_t* __restrict a, std::uint8_t* __restrict y) {
  std::memset(y, 0, static_cast<std::size_t>(n) * static_cast<std::size_t>(n));
  int offset[16];
  for (int k = 0; k < 16; ++k) offset[k] = kCircle[k][1] * n + kCircle[k][0];
  for (int r = 3; r < n - 3; ++r) {
    const std::uint8_t* const at = a + r * n;
    for (int c = 3; c < n - 3; ++c) {
      const auto high = static_cast<std::int16_t>(at[c] + threshold),
                 low = static_cast<std::int16_t>(at[c] - threshold);
      std::uint16_t brighter = 0, darker = 0;
#pragma GCC unroll 16
      for (int k = 0; k < 16; ++k) {
        const std::int16_t value = at[c + offset[k]];
        brighter |= static_cast<std::uint16_t>((value > high ? 1 : 0) << k);
        darker |= static_cast<std::uint16_t>((value < low ? 1 : 0) << k);
      }
      y[r * n + c] = (has_arc(brighter) | has_arc(darker)) != 0;
    }
  }
}

void histogram(int n, const std::uint8_t* __restrict a, std::int32_t* __restrict y) {
  std::int32_t counts[4][256] =
      {};  // four, because a sum that was just stored delays the next of the same value
  const std::size_t cells = static_cast<std::size_t>(n) * static_cast<std::size_t>(n);
  for (std::size_t i = 0; i + 4 <= cells; i += 4)
    for (std::size_t k = 0; k < 4; ++k) ++counts[k][a[i + k]];
  for (std::size_t i = cells / 4 * 4; i < cells; ++i) ++counts[0][a[i]];
  for (int v = 0; v < 256; ++v) y[v] = counts[0][v] + counts[1][v] + counts[2][v] + counts[3][v];
}

// 4-connected objects: a number to each, by union and find. parents: as many as n² / 2 + 2.
void labels(int n, const std::uint8_t* __restrict a, std::int32_t* __restrict parents,
            std::int32_t* __restrict y) {
  int count = 1;
  parents[0] = 0;
  for (int r = 0; r < n; ++r)
    for (int c = 0; c < n; ++c) {
      std::int32_t& to = y[r * n + c];
      if (a[r * n + c] == 0) {
        to = 0;
        continue;
      }
      const int north = r > 0 ? y[(r - 1) * n + c] : 0, west = c > 0 ? y[r * n + c - 1] : 0;
      if (north == 0 && west == 0) {
        parents[count] = count;
        to = count++;
      } else if (north == 0 || west == 0 || north == west) {
        to = std::max(north, west);
      } else {
        const int p = find_root(parents, north), q = find_root(parents, west);
        parents[std::max(p, q)] = std::min(p, q);
        to = std::min(p, q);
      }
    }
  for (int k = 1; k < count; ++k) parents[k] = parents[parents[k]];
  for (int i = 0; i < n * n; ++i) y[i] = parents[y[i]];
}

// The 4-connected cells of the mask from one cell on, span by span. stack: as many as n².
void flood(int n, const std::uint8_t* __restrict mask, int row, int column, std::int32_t* __restrict stack,
           std::uint8_t* __restrict y) {
  std::memset(y, 0, static_cast<std::size_t>(n) * static_cast<std::size_t>(n));
  std::size_t waiting = 0;
  stack[waiting++] = row * n + column;
  while (waiting > 0) {
    const int at = stack[--waiting], r = at / n;
    if (y[at] != 0) continue;
    int begin = at, end = at + 1;
    while (begin > r * n && mask[begin - 1] != 0) --begin;
    while (end < (r + 1) * n && mask[end] != 0) ++end;
    std::memset(y + begin, 1, static_cast<std::size_t>(end - begin));
    for (const int beside : {-n, n}) {
      if (r * n + beside < 0 || r * n + beside >= n * n) continue;
      bool is_open = false;
      for (int i = begin + beside; i < end + beside; ++i) {
        const bool opens = mask[i] != 0 && y[i] == 0;
        if (opens && !is_open) stack[waiting++] = i;
        is_open = opens;
      }
    }
  }
}

// An even number of steps of the reaction of Gray and Scott on a torus, in place. p, q: as large.
void gray_scott(int n, int steps, float feed, float kill, float spread_u, float spread_v, float* u, float* v,
                float* p, float* q) {
  for (int step = 0; step < steps; ++step) {
    for (int r = 0; r < n; ++r) {
      const int above = (r + n - 1) % n * n, here = r * n, below = (r + 1) % n * n;
      react(n, {feed, kill, spread_u, spread_v}, u + above, u + here, u + below, v + above, v + here,
            v + below, p + here, q + here);
    }
    std::swap(u, p);
    std::swap(v, q);
  }
}

// An even number of generations of Life on a torus, in place. b: as large.
void life(int n, int steps, std::uint8_t* a, std::uint8_t* b) {
  std::vector<std::uint8_t> sums(static_cast<std::size_t>(n) + 2);
  for (int step = 0; step < steps; ++step) {
    for (int r = 0; r < n; ++r) {
      const std::uint8_t* __restrict const up = a + (r + n - 1) % n * n;
      const std::uint8_t* __restrict const at = a + r * n;
      const std::uint8_t* __restrict const down = a + (r + 1) % n * n;
      std::uint8_t* __restrict const to = b + r * n;
      std::uint8_t* __restrict const sum = sums.data() + 1;  // of three rows
      for (int c = 0; c < n; ++c) sum[c] = static_cast<std::uint8_t>(up[c] + at[c] + down[c]);
      sum[-1] = sum[n - 1];
      sum[n] = sum[0];
      for (int c = 0; c < n; ++c) {
        const auto around = static_cast<std::uint8_t>(sum[c - 1] + sum[c] + sum[c + 1] - at[c]);
        to[c] = (around == 3) | ((around == 2) & at[c]);
      }
    }
    std::swap(a, b);
  }
}

// A step of the neural automaton; zeros beyond the edges. a, y: 16 planes.
void automaton(int n, const float* __restrict a, const float* __restrict inner, const float* __restrict outer,
               float* __restrict y) {
  const int cells = n * n, pitch = n + 2 + kBlock;
  std::vector<float> rows(
      static_cast<std::size_t>(3 * kChannels * pitch));  // of every channel, with a border
  float seen[kSeen][kBlock], hidden[kHidden][kBlock], change[kChannels][kBlock];
  const auto row = [&](int channel, int r) { return rows.data() + (channel * 3 + (r + 3) % 3) * pitch + 1; };
  const auto load = [&](int r) {
    for (int k = 0; k < kChannels; ++k) {
      if (r < n)
        std::memcpy(row(k, r), a + k * cells + r * n, sizeof(float) * static_cast<std::size_t>(n));
      else
        std::memset(row(k, r), 0, sizeof(float) * static_cast<std::size_t>(n));
    }
  };
  load(0);
  for (int r = 0; r < n; ++r) {
    load(r + 1);
    for (int begin = 0; begin < n; begin += kBlock) {
      for (int k = 0; k < kChannels; ++k) {
        const float* const up = row(k, r - 1) + begin;
        const float* const at = row(k, r) + begin;
        const float* const down = row(k, r + 1) + begin;
        for (int c = 0; c < kBlock; ++c) {
          seen[3 * k][c] = at[c];
          seen[3 * k + 1][c] =
              ((up[c + 1] - up[c - 1]) + 2 * (at[c + 1] - at[c - 1]) + (down[c + 1] - down[c - 1])) / 8;
          seen[3 * k + 2][c] =
              ((down[c - 1] - up[c - 1]) + 2 * (down[c] - up[c]) + (down[c + 1] - up[c + 1])) / 8;
        }
      }
      multiply<kHidden, kSeen>(inner, seen, hidden);
      for (auto& plane : hidden)
        for (float& value : plane) value = std::max(value, 0.0F);
      multiply<kChannels, kHidden>(outer, hidden, change);
      float largest[kBlock] = {};
      for (int d = -1; d <= 1; ++d)
        for (int c = 0; c < kBlock; ++c) {
          const float* const near = row(3, r + d) + begin + c;
          largest[c] = std::max(largest[c], std::max(near[0], std::max(near[-1], near[1])));
        }
      for (int k = 0; k < kChannels; ++k)
        for (int c = 0; c < std::min(kBlock, n - begin); ++c)
          y[k * cells + r * n + begin + c] =
              largest[c] > 0.1F ? std::clamp(seen[3 * k][c] + change[k][c], -1.0F, 1.0F) : 0.0F;
    }
  }
}

}  // extern "C"
