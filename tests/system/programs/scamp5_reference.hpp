// The SCAMP-5 as C++ values: what a kernel's text computes when a compiler reads it. Compared with `apron import`.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <vector>

constexpr int kSize = 6, kCells = kSize * kSize;
enum news_t { north = 1, east = 2, south = 4, west = 8, alldir = 15 };
struct areg_t {
  mutable float c[kCells] = {};
  int kind = 0;  // 1: NEWS, 2 to 5: NEWS of a neighbour
};
struct dreg_t {
  mutable bool c[kCells] = {};
  bool is_gated = false;
};
using aref_t = areg_t;
using dref_t = dreg_t;
#define AREG const areg_t&
#define ASRC const areg_t&
#define DREG const dreg_t&
#define DSRC const dreg_t&
inline areg_t A, B, C, D, E, F, NEWS{{}, 1}, XN{{}, 2}, XE{{}, 3}, XS{{}, 4}, XW{{}, 5};
inline dreg_t R0, R1, R2, R3, R4, R5, R6, R7, R8, R9, R10, R11, R12{{}, true}, FLAG;
#define RF R0
#define RS R1
#define RW R2
#define RN R3
#define RE R4
#define S0 R5
#define S1 R6
#define S2 R7
#define S3 R8
#define S4 R9
#define S5 R10
#define S6 R11
#define RP R12

namespace model {
inline float at(const areg_t& a, int x, int y) {
  if (x < 0 || y < 0 || x >= kSize || y >= kSize) return 0;
  return a.c[y * kSize + x];
}
inline float read(const areg_t& a, int i) {
  const int x = i % kSize, y = i / kSize;
  switch (a.kind) {
    case 2: return at(NEWS, x, y - 1);
    case 3: return at(NEWS, x + 1, y);
    case 4: return at(NEWS, x, y + 1);
    case 5: return at(NEWS, x - 1, y);
    default: return a.c[i];
  }
}
inline float limited(const areg_t& y, float v) {
  const float high = &y == &NEWS ? 128.0F : 127.0F;
  return v < -128 ? -128 : v > high ? high : v;
}
inline void store(const areg_t& y, const std::vector<float>& v) {
  for (int i = 0; i < kCells; ++i)
    if (FLAG.c[i]) y.c[i] = limited(y, v[i]);
}
inline void store(const dreg_t& y, const std::function<bool(int)>& f) {
  bool out[kCells];
  for (int i = 0; i < kCells; ++i) out[i] = y.is_gated && !R0.c[i] ? y.c[i] : f(i);
  for (int i = 0; i < kCells; ++i) y.c[i] = out[i];
}
inline float moved(const std::vector<float>& v, int i, news_t d) {
  const int x = i % kSize + (d == east) - (d == west), y = i / kSize + (d == south) - (d == north);
  return x < 0 || y < 0 || x >= kSize || y >= kSize ? 0 : v[y * kSize + x];
}
template <class... S>
std::vector<float> sum(const S&... s) {
  std::vector<float> v(kCells);
  for (int i = 0; i < kCells; ++i) v[i] = (0.0F + ... + read(s, i));
  return v;
}
}  // namespace model

template <class... S> void bus(const areg_t& y, const S&... s) {
  auto v = model::sum(s...);
  for (float& one : v) one = 0 - one;
  model::store(y, v);
}
template <class... S> void add(const areg_t& y, const S&... s) { bus(NEWS, s...); bus(y, NEWS); }
inline void mov(const areg_t& y, const areg_t& a) { bus(NEWS, a); bus(y, NEWS); }
inline void res(const areg_t& y) { bus(NEWS); bus(y, NEWS); }
inline void neg(const areg_t& y, const areg_t& a) { bus(NEWS); bus(y, NEWS, a); }
inline void sub(const areg_t& y, const areg_t& a, const areg_t& b) { bus(NEWS, a); bus(y, NEWS, b); }
inline void where(const areg_t& a) { for (int i = 0; i < kCells; ++i) FLAG.c[i] = model::read(a, i) > 0; }
inline void where(const areg_t& a, const areg_t& b) { for (int i = 0; i < kCells; ++i) FLAG.c[i] = model::read(a, i) + model::read(b, i) > 0; }
inline void all() { for (bool& c : FLAG.c) c = true; }
inline void divq(const areg_t& y, const areg_t& a) {
  auto v = model::sum(a);
  for (float& one : v) one = 0 - one / 2;
  model::store(y, v);
  model::store(NEWS, v);
  bus(y, NEWS);
}
inline void movx(const areg_t& y, const areg_t& a, news_t d) {
  const auto v = model::sum(a);
  std::vector<float> w(kCells);
  for (int i = 0; i < kCells; ++i) w[i] = 0 - model::moved(v, i, d);
  model::store(NEWS, w);
  bus(y, NEWS);
}
inline void SET(const dreg_t& d) { model::store(d, [](int) { return true; }); }
inline void CLR(const dreg_t& d) { model::store(d, [](int) { return false; }); }
template <class... D> void SET(const dreg_t& d, const D&... rest) { SET(d); SET(rest...); }
template <class... D> void CLR(const dreg_t& d, const D&... rest) { CLR(d); CLR(rest...); }
inline void MOV(const dreg_t& d, const dreg_t& a) { model::store(d, [&](int i) { return a.c[i]; }); }
inline void NOT(const dreg_t& d, const dreg_t& a) { model::store(d, [&](int i) { return !a.c[i]; }); }
inline void OR(const dreg_t& d, const dreg_t& a, const dreg_t& b) { model::store(d, [&](int i) { return a.c[i] || b.c[i]; }); }
inline void NOR(const dreg_t& d, const dreg_t& a, const dreg_t& b) { model::store(d, [&](int i) { return !(a.c[i] || b.c[i]); }); }
inline void AND(const dreg_t& d, const dreg_t& a, const dreg_t& b) { SET(R0); NOT(R12, a); NOT(R0, b); NOR(d, R0, R12); }
inline void WHERE(const dreg_t& a) { for (int i = 0; i < kCells; ++i) FLAG.c[i] = a.c[i]; }
inline void ALL() { all(); }
inline void DNEWS(const dreg_t& d, const dreg_t& a, int dirs, bool edge = false) {
  CLR(R1, R2, R3, R4);
  if (dirs & south) SET(R1);
  if (dirs & west) SET(R2);
  if (dirs & north) SET(R3);
  if (dirs & east) SET(R4);
  const auto get = [&](int x, int y) { return x < 0 || y < 0 || x >= kSize || y >= kSize ? edge : a.c[y * kSize + x]; };
  model::store(d, [&](int i) {
    const int x = i % kSize, y = i / kSize;
    return (R1.c[i] && get(x, y + 1)) || (R2.c[i] && get(x - 1, y)) || (R3.c[i] && get(x, y - 1)) || (R4.c[i] && get(x + 1, y));
  });
}
inline void scamp5_in(const areg_t& y, int8_t v) { model::store(y, std::vector<float>(kCells, v)); }
inline void scamp5_load_rect(const dreg_t& d, uint8_t r, uint8_t c, uint8_t r2, uint8_t c2) {
  model::store(d, [=](int i) { const int x = i % kSize, y = i / kSize; return y >= r && y <= r2 && x >= c && x <= c2; });
}
inline int scamp5_global_count(const dreg_t& d) { int n = 0; for (bool c : d.c) n += c; return n; }
inline int scamp5_global_or(const dreg_t& d) { return scamp5_global_count(d) > 0; }
#define scamp5_kernel_begin() do {} while (0)
#define scamp5_kernel_end() do {} while (0)
inline void vs_init() {}

namespace model {
inline void reset() {
  for (areg_t* a : {&A, &B, &C, &D, &E, &F, &NEWS}) for (float& c : a->c) c = 0;
  for (dreg_t* d : {&R0, &R1, &R2, &R3, &R4, &R5, &R6, &R7, &R8, &R9, &R10, &R11, &R12}) for (bool& c : d->c) c = false;
  all();
}
inline void print() {
  for (const areg_t* a : {&A, &B, &C, &D, &E, &F, &NEWS}) for (float c : a->c) std::printf("%.9g ", c);
  for (const dreg_t* d : {&R0, &R1, &R2, &R3, &R4, &R5, &R6, &R7, &R8, &R9, &R10, &R11, &R12, &FLAG}) for (bool c : d->c) std::printf("%d ", c);
  std::printf("\n");
}
}  // namespace model
