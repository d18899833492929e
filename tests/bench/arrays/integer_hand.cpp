// The workloads of bench_integers in vectors of bytes and of 16-bit words, 64 bytes at a time.
#include <cstring>

#include "tests/bench/arrays/IntegerPeers.h"

namespace arrays {
namespace {

using Bytes = std::uint8_t __attribute__((vector_size(64)));
using HalfBytes = std::uint8_t __attribute__((vector_size(32)));
using Words = std::uint16_t __attribute__((vector_size(64)));

template <class Vector>
Vector load(const std::uint8_t* from) {
  Vector v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
Words load_words(const std::uint8_t* from) { return __builtin_convertvector(load<HalfBytes>(from), Words); }
template <class Vector>
void store(const Vector& v, std::uint8_t* to) {
  std::memcpy(to, &v, sizeof v);
}

Words turned(const Words& v, int by) { return v << by | v >> (16 - by); }
Words nine_of_sixteen(const Words& m) {
  Words n = m & turned(m, 1);
  n = n & turned(n, 2);
  n = n & turned(n, 4);
  return n & turned(m, 8);
}

}  // namespace

void hand_life(const ByteImage& a, ByteImage& y) {
  for (int r = 0; r < a.n; ++r) {
    const std::uint8_t *n = a.row(r - 1), *c = a.row(r), *s = a.row(r + 1);
    for (int x = 0; x < a.n; x += 64) {
      const Bytes own = load<Bytes>(c + x);
      const Bytes count = load<Bytes>(n + x - 1) + load<Bytes>(n + x) + load<Bytes>(n + x + 1) +
                          load<Bytes>(c + x - 1) + load<Bytes>(c + x + 1) + load<Bytes>(s + x - 1) +
                          load<Bytes>(s + x) + load<Bytes>(s + x + 1);
      store<Bytes>(((count == 3) | ((own != 0) & (count == 2))) & 1, y.row(r) + x);
    }
    y.clear_margin(r);
  }
}

void hand_census(const ByteImage& a, ByteImage& y) {
  for (int r = 0; r < a.n; ++r) {
    const std::uint8_t *n = a.row(r - 1), *c = a.row(r), *s = a.row(r + 1);
    for (int x = 0; x < a.n; x += 64) {
      const Bytes own = load<Bytes>(c + x);
      const auto bit = [&](const std::uint8_t* from, std::uint8_t value) {
        return Bytes(load<Bytes>(from) < own) & (Bytes{} + value);
      };
      store<Bytes>(bit(n + x - 1, 1) | bit(n + x, 2) | bit(n + x + 1, 4) | bit(c + x - 1, 8) |
                       bit(c + x + 1, 16) | bit(s + x - 1, 32) | bit(s + x, 64) | bit(s + x + 1, 128),
                   y.row(r) + x);
    }
    y.clear_margin(r);
  }
}

void hand_fast9(const ByteImage& a, ByteImage& y, int threshold) {
  constexpr int kRing[16][2] = {{0, -3}, {1, -3}, {2, -2}, {3, -1}, {3, 0},  {3, 1},   {2, 2},   {1, 3},
                                {0, 3},  {-1, 3}, {-2, 2}, {-3, 1}, {-3, 0}, {-3, -1}, {-2, -2}, {-1, -3}};
  const auto t = static_cast<std::uint16_t>(threshold);
  for (int r = 0; r < a.n; ++r) {
    const std::uint8_t* ring[16];
    for (int k = 0; k < 16; ++k) ring[k] = a.row(r + kRing[k][1]) + kRing[k][0];
    for (int x = 0; x < a.n; x += 32) {
      const Words centre = load_words(a.row(r) + x), high = centre + t;
      Words brighter{}, darker{};
#pragma GCC unroll 16
      for (int k = 0; k < 16; ++k) {
        const Words p = load_words(ring[k] + x), bit = Words{} + static_cast<std::uint16_t>(1U << k);
        brighter |= Words(p > high) & bit;
        darker |= Words(p + t < centre) & bit;
      }
      const Words corner = Words((nine_of_sixteen(brighter) | nine_of_sixteen(darker)) != 0) & 1;
      store<HalfBytes>(__builtin_convertvector(corner, HalfBytes), y.row(r) + x);
    }
    y.clear_margin(r);
  }
}

}  // namespace arrays
