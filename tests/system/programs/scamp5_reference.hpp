// The SCAMP-5 and the interface of its controller as C++: what a kernel's text computes when a compiler reads it, by
// docs/scamp5.md. Compared with `apron import`, by import_test.py and scripts/check-kernels.
//
// Instructions are executed where they are called. The light is a file of frames (SCAMP5_LIGHT: one byte a cell), each
// image takes the next. What the host shows, sends or measures is 0.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#ifndef SCAMP5_SIZE
#define SCAMP5_SIZE 6
#endif
constexpr int kSize = SCAMP5_SIZE, kCells = kSize * kSize;
enum news_t { north = 1, east = 2, south = 4, west = 8, alldir = 15 };

// Names of registers: copies name the same one.
struct areg_t {
  int index;
};
struct dreg_t {
  int index;
};
using aref_t = areg_t;
using dref_t = dreg_t;
#define AREG const areg_t&
#define ASRC const areg_t&
#define DREG const dreg_t&
#define DSRC const dreg_t&
inline areg_t A{0}, B{1}, C{2}, D{3}, E{4}, F{5}, NEWS{6}, IN{7}, XN{8}, XE{9}, XS{10}, XW{11};
inline dreg_t R0{0}, R1{1}, R2{2}, R3{3}, R4{4}, R5{5}, R6{6}, R7{7}, R8{8}, R9{9}, R10{10}, R11{11}, R12{12}, FLAG{13},
    SELECT{14};
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
namespace SCAMP5_PE {}
namespace scamp5_kernel_api {}

namespace model {
constexpr int kAnalogue = 8, kDigital = 15;
using Plane = std::vector<float>;
using Bits = std::vector<std::uint8_t>;
inline Plane analogue[kAnalogue];
inline Bits digital[kDigital];
inline Plane light;
inline int draws = -1;  // into that digital register
inline int frames = 0;

inline Plane& plane(areg_t a) {
  if (a.index >= kAnalogue) std::abort();
  return analogue[a.index];
}
inline Bits& bits(dreg_t d) { return digital[d.index]; }
inline const Bits& flag() { return digital[FLAG.index]; }
inline int x_of(int i) { return i % kSize; }
inline int y_of(int i) { return i / kSize; }
inline bool is_inside(int x, int y) { return x >= 0 && y >= 0 && x < kSize && y < kSize; }
inline int dx(int d) { return (d == east) - (d == west); }
inline int dy(int d) { return (d == south) - (d == north); }

template <class T>
T neighbour(const std::vector<T>& v, int i, int direction, T beyond = T()) {
  const int x = x_of(i) + dx(direction), y = y_of(i) + dy(direction);
  return is_inside(x, y) ? v[y * kSize + x] : beyond;
}
inline float read(areg_t a, int i) {
  switch (a.index - XN.index) {
    case 0: return neighbour(plane(NEWS), i, north);
    case 1: return neighbour(plane(NEWS), i, east);
    case 2: return neighbour(plane(NEWS), i, south);
    case 3: return neighbour(plane(NEWS), i, west);
    default: return plane(a)[i];
  }
}
inline float limited(areg_t y, float v) {
  const float high = y.index == NEWS.index ? 128.0F : 127.0F;
  return v < -128 ? -128 : v > high ? high : v;
}
inline void store(areg_t y, const Plane& v) {
  Plane& out = plane(y);
  for (int i = 0; i < kCells; ++i)
    if (flag()[i]) out[i] = limited(y, v[i]);
}
template <class Value>
void store_bits(dreg_t y, const Value& value) {
  Bits out(kCells);
  for (int i = 0; i < kCells; ++i) out[i] = y.index == R12.index && !bits(R0)[i] ? bits(y)[i] : static_cast<bool>(value(i));
  bits(y) = out;
}
template <class... S>
Plane sum(S... s) {
  Plane v(kCells);
  for (int i = 0; i < kCells; ++i) v[i] = (0.0F + ... + read(s, i));
  return v;
}
inline Plane minus(Plane v) {
  for (float& one : v) one = 0 - one;
  return v;
}
inline Plane moved(const Plane& v, int direction) {
  Plane out(kCells);
  for (int i = 0; i < kCells; ++i) out[i] = neighbour(v, i, direction);
  return out;
}
inline int from_of(areg_t y) {  // the cell whose sum bus(XN, …) takes
  static const int kFrom[] = {south, west, north, east};
  return kFrom[y.index - XN.index];
}
inline void split(areg_t y, areg_t z, Plane v) {
  for (float& one : v) one = one / 2;
  store(y, minus(v));
  store(z, minus(v));
}
// The two levels of a pixel: light / 2 - 128 exposed, -128 reset. Transfers negate.
inline Plane level(float gain = 1) {
  Plane v(kCells);
  for (int i = 0; i < kCells; ++i) v[i] = 128 - std::min(light[i] * gain, 255.0F) / 2;
  return v;
}
inline void expose() {
  static std::FILE* const file = std::getenv("SCAMP5_LIGHT") ? std::fopen(std::getenv("SCAMP5_LIGHT"), "rb") : nullptr;
  Bits frame(kCells);
  if (file == nullptr) return;
  if (std::fread(frame.data(), 1, kCells, file) != static_cast<std::size_t>(kCells)) {
    std::rewind(file);
    if (std::fread(frame.data(), 1, kCells, file) != static_cast<std::size_t>(kCells)) std::abort();
  }
  for (int i = 0; i < kCells; ++i) light[i] = frame[i];
}
// A step of the network: the mean of the cell and its neighbours along the axes.
inline void blur(areg_t y, areg_t a, int steps, bool vertical, bool horizontal) {
  Plane v = sum(a);
  for (int k = 0; k < steps; ++k) {
    Plane next(kCells);
    for (int i = 0; i < kCells; ++i) {
      const float n = neighbour(v, i, north), e = neighbour(v, i, east), s = neighbour(v, i, south), w = neighbour(v, i, west);
      if (vertical && horizontal)
        next[i] = (n + e + s + w + v[i]) / 5;
      else
        next[i] = vertical ? (s + v[i] + n) / 3 : (w + v[i] + e) / 3;
    }
    v = next;
  }
  store(y, v);
}
// R12 spreads through the cells where R0 is 1.
inline void propagate(bool edge) {
  const Bits& open = bits(R0);
  Bits& wet = bits(R12);
  std::vector<int> left;
  for (int i = 0; i < kCells; ++i) {
    const bool at_edge = x_of(i) == 0 || y_of(i) == 0 || x_of(i) == kSize - 1 || y_of(i) == kSize - 1;
    if (edge && open[i] && at_edge) wet[i] = 1;
    if (wet[i]) left.push_back(i);
  }
  while (!left.empty()) {
    const int i = left.back();
    left.pop_back();
    for (const int d : {north, east, south, west}) {
      const int x = x_of(i) + dx(d), y = y_of(i) + dy(d), k = y * kSize + x;
      if (!is_inside(x, y) || !open[k] || wet[k]) continue;
      wet[k] = 1;
      left.push_back(k);
    }
  }
}
inline bool matches(int i, std::uint8_t row, std::uint8_t col, std::uint8_t rowany, std::uint8_t colany) {
  return ((y_of(i) ^ row) & 255 & ~rowany) == 0 && ((x_of(i) ^ col) & 255 & ~colany) == 0;
}
inline double mean(areg_t a) {
  double total = 0;
  for (int i = 0; i < kCells; ++i) total += read(a, i);
  return total / kCells;
}
template <class Inside>
void draw(const Inside& inside) {
  if (draws < 0) std::abort();
  Bits& out = digital[draws];
  const Bits before = out;
  store_bits({draws}, [&](int i) { return before[i] || inside(x_of(i), y_of(i)); });
}

inline void reset() {
  for (Plane& one : analogue) one.assign(kCells, 0);
  for (Bits& one : digital) one.assign(kCells, 0);
  digital[FLAG.index].assign(kCells, 1);
  light.assign(kCells, 0);
}
// Registers as text: A to F, NEWS, R0 to R12, FLAG.
inline void print() {
  for (int k = 0; k < 7; ++k)
    for (float c : analogue[k]) std::printf("%.9g ", c);
  for (int k = 0; k < 14; ++k)
    for (int c : digital[k]) std::printf("%d ", c);
  std::printf("\n");
}
// The same as floats behind what SCAMP5_STATES has.
inline void save() {
  static std::FILE* const file = std::getenv("SCAMP5_STATES") ? std::fopen(std::getenv("SCAMP5_STATES"), "wb") : nullptr;
  if (file == nullptr) return;
  for (int k = 0; k < 7; ++k) std::fwrite(analogue[k].data(), sizeof(float), kCells, file);
  for (int k = 0; k < 14; ++k) std::fwrite(Plane(digital[k].begin(), digital[k].end()).data(), sizeof(float), kCells, file);
  std::fflush(file);
}
// An endless loop over the frames: `while (1)` becomes `while (model::next_frame(is_first))`. The state is saved after each of
// SCAMP5_FRAMES frames.
inline bool next_frame(bool& is_first) {
  static const int count = std::getenv("SCAMP5_FRAMES") ? std::atoi(std::getenv("SCAMP5_FRAMES")) : 1;
  if (!std::exchange(is_first, false)) {
    save();
    if (++frames == count) std::_Exit(0);
  }
  return true;
}
// Resets the chip, and saves the state of a program that ends.
struct Session {
  Session() { reset(); }
  ~Session() {
    if (frames == 0) save();
  }
};
inline Session session;
inline std::vector<int> controls{0, 1};  // values of sliders by handle
// An operand of any type of enumerators.
struct number {
  int value;
  template <class T> operator T() const { return static_cast<T>(value); }
};
}  // namespace model

// ---- analogue registers
template <class... S> void bus(AREG y, const S&... s) {
  const auto v = model::sum(s...);
  if (y.index >= XN.index)
    model::store(NEWS, model::minus(model::moved(v, model::from_of(y))));
  else
    model::store(y, model::minus(v));
}
template <class... S> void bus2(AREG y, AREG z, const S&... s) { model::split(y, z, model::sum(s...)); }
inline void bus3(AREG y, AREG z, AREG u, ASRC a) {
  auto v = model::sum(a);
  for (float& one : v) one = one / 3;
  for (const areg_t one : {y, z, u}) model::store(one, model::minus(v));
}
inline void res(AREG y) { bus(NEWS); bus(y, NEWS); }
inline void res(AREG y, AREG z) { bus(NEWS); bus(y, NEWS); bus(z, NEWS); }
inline void mov(AREG y, ASRC a) { bus(NEWS, a); bus(y, NEWS); }
inline void neg(AREG y, ASRC a) { bus(NEWS); bus(y, NEWS, a); }
inline void sneg(AREG y, ASRC a) { bus(y, a); }
inline void add(AREG y, ASRC a, ASRC b) { bus(NEWS, a, b); bus(y, NEWS); }
inline void add(AREG y, ASRC a, ASRC b, ASRC c) { bus(NEWS, a, b, c); bus(y, NEWS); }
inline void addneg(AREG y, ASRC a, ASRC b) { bus(y, a, b); }
inline void sub(AREG y, ASRC a, ASRC b) { bus(NEWS, a); bus(y, NEWS, b); }
inline void where(ASRC a) { for (int i = 0; i < kCells; ++i) model::bits(FLAG)[i] = model::read(a, i) > 0; }
inline void where(ASRC a, ASRC b) { for (int i = 0; i < kCells; ++i) model::bits(FLAG)[i] = model::read(a, i) + model::read(b, i) > 0; }
inline void where(ASRC a, ASRC b, ASRC c) { for (int i = 0; i < kCells; ++i) model::bits(FLAG)[i] = model::read(a, i) + model::read(b, i) + model::read(c, i) > 0; }
inline void all() { model::bits(FLAG).assign(kCells, 1); }
inline void ALL() { all(); }
inline void abs(AREG y, ASRC a) { bus(NEWS); bus(y, NEWS, a); bus(NEWS, a); where(a); bus(y, NEWS); all(); }
inline void divq(AREG y, ASRC a) { bus2(y, NEWS, a); bus(y, NEWS); }
inline void div2(AREG y, ASRC a) { divq(y, a); }
inline void div(AREG y, AREG n, AREG c, ASRC a) { bus2(y, n, a); bus(NEWS, a, n); bus(c, NEWS, y); bus2(y, n, c); bus(y, n); }
inline void div(AREG y, AREG n, AREG a) { div(y, n, a, a); }
inline void diva(AREG y, AREG n, AREG m) { bus2(n, m, y); bus(NEWS, n, y); bus(y, NEWS, m); bus2(n, m, y); bus(y, n); }

// ---- neighbours
namespace model {
template <class... S> void fetch(int direction, const S&... s) { store(NEWS, minus(moved(sum(s...), direction))); }
inline areg_t side(int direction) { return direction == north ? XN : direction == east ? XE : direction == south ? XS : XW; }
}  // namespace model
inline void movx(AREG y, ASRC a, news_t d) { model::fetch(d, a); bus(y, NEWS); }
inline void mov(AREG y, ASRC a, news_t d) { movx(y, a, d); }
inline void mov2x(AREG y, ASRC a, news_t d, news_t e) { model::fetch(d, a); bus(y, model::side(e)); }
inline void addx(AREG y, ASRC a, ASRC b, news_t d) { model::fetch(d, a, b); bus(y, NEWS); }
inline void add(AREG y, ASRC a, ASRC b, news_t d) { addx(y, a, b, d); }
inline void add2x(AREG y, ASRC a, ASRC b, news_t d, news_t e) { model::fetch(d, a, b); bus(y, model::side(e)); }
inline void subx(AREG y, ASRC a, news_t d, ASRC b) { model::fetch(d, a); bus(y, NEWS, b); }
inline void sub2x(AREG y, ASRC a, news_t d, news_t e, ASRC b) { model::fetch(d, a); bus(y, model::side(e), b); }
inline void sub(AREG y, ASRC a, news_t d, ASRC b) { bus(NEWS, a); bus(y, model::side(d), b); }
inline void newsblur(AREG y, ASRC a, int n = 1) { model::blur(y, a, n, true, true); }
inline void newsblurh(AREG y, ASRC a, int n = 1) { model::blur(y, a, n, false, true); }
inline void newsblurv(AREG y, ASRC a, int n = 1) { model::blur(y, a, n, true, false); }
inline void gauss(AREG y, ASRC a, int n = 3) { model::blur(y, a, 2 * n, true, true); }
inline void gaussh(AREG y, ASRC a, int n = 3) { model::blur(y, a, 2 * n, false, true); }
inline void gaussv(AREG y, ASRC a, int n = 3) { model::blur(y, a, 2 * n, true, false); }

// ---- light
inline void get_image(AREG y) {
  model::expose();
  model::store(NEWS, model::level());
  auto v = model::sum(NEWS);
  for (float& one : v) one = 128 - one;
  model::store(y, v);
}
inline void scamp5_get_image(AREG y, AREG h, int gain = 1) {
  model::expose();
  const auto level = model::level(gain);
  model::store(NEWS, level);
  model::store(h, level);
  auto v = model::sum(NEWS);
  for (int i = 0; i < kCells; ++i) v[i] = 128 - (v[i] + level[i]);
  model::store(y, v);
}
inline void get_image(AREG y, AREG h) { scamp5_get_image(y, h); }
inline void respix() {}
inline void rpix() {}
inline void respix(AREG y) { model::store(NEWS, model::Plane(kCells, 128)); bus(y, NEWS); }
inline void getpix(AREG y, ASRC r) { model::expose(); model::store(NEWS, model::level()); bus(y, NEWS, r); }
inline void getpix(AREG y, AREG h, ASRC r) {
  model::expose();
  const auto level = model::level();
  model::store(h, level);
  model::store(NEWS, level);
  auto v = model::sum(NEWS, r);
  for (int i = 0; i < kCells; ++i) v[i] = 0 - (v[i] + level[i]);
  model::store(y, v);
}

// ---- digital registers
inline void SET(DREG d) { model::store_bits(d, [](int) { return true; }); }
inline void CLR(DREG d) { model::store_bits(d, [](int) { return false; }); }
template <class... S> void SET(DREG d, const S&... rest) { SET(d); SET(rest...); }
template <class... S> void CLR(DREG d, const S&... rest) { CLR(d); CLR(rest...); }
inline void MOV(DREG d, DSRC a) { model::store_bits(d, [&](int i) { return model::bits(a)[i]; }); }
inline void NOT(DREG d, DSRC a) { model::store_bits(d, [&](int i) { return !model::bits(a)[i]; }); }
inline void NOT(DREG d) { NOT(d, d); }
template <class... S> void OR(DREG d, DSRC a, const S&... s) { model::store_bits(d, [&](int i) { return (model::bits(a)[i] || ... || model::bits(s)[i]); }); }
template <class... S> void NOR(DREG d, DSRC a, const S&... s) { model::store_bits(d, [&](int i) { return !(model::bits(a)[i] || ... || model::bits(s)[i]); }); }
inline void OR(DREG d, DSRC a) { OR(d, d, a); }
inline void NOR(DREG d, DSRC a) { NOR(d, d, a); }
inline void AND(DREG d, DSRC a, DSRC b) { SET(R0); NOT(R12, a); NOT(R0, b); NOR(d, R0, R12); }
inline void NAND(DREG d, DSRC a, DSRC b) { SET(R0); NOT(R12, a); NOT(R0, b); OR(d, R0, R12); }
inline void ANDX(DREG d, DREG a, DSRC b) { NOT(R0, a); NOT(a, b); NOR(d, R0, a); }
inline void NANDX(DREG d, DREG a, DSRC b) { NOT(R0, a); NOT(a, b); OR(d, R0, a); }
inline void IMP(DREG d, DSRC a, DSRC b) { NOT(R0, b); OR(d, a, R0); }
inline void NIMP(DREG d, DSRC a, DSRC b) { NOT(R0, b); NOR(d, a, R0); }
inline void XORX(DREG d, DREG a, DSRC b) { NOT(R0, b); NOR(d, a, R0); NOT(R0, a); NOR(a, b, R0); OR(d, a); }
inline void XOR(DREG d, DREG a, DSRC b) { XORX(d, a, b); }
inline void MUX(DREG d, DSRC a, DSRC b, DSRC c) { SET(R0); MOV(R12, c); MOV(R0, a); MOV(R12, b); MOV(d, R12); }
inline void CLR_IF(DREG d, DSRC a) { NOT(R0, d); NOR(d, R0, a); }
inline void REFRESH(DREG) {}
template <class... S> void WHERE(DSRC a, const S&... s) { OR(FLAG, a, s...); }
inline void WHERE(DSRC a) { MOV(FLAG, a); }
namespace model {
inline void neighbours(dreg_t d, dreg_t a, std::uint8_t edge) {
  const Bits v = bits(a);
  store_bits(d, [&](int i) {
    return (bits(R1)[i] && neighbour(v, i, south, edge)) || (bits(R2)[i] && neighbour(v, i, west, edge)) ||
           (bits(R3)[i] && neighbour(v, i, north, edge)) || (bits(R4)[i] && neighbour(v, i, east, edge));
  });
}
}  // namespace model
inline void DNEWS0(DREG d, DSRC a) { model::neighbours(d, a, 0); }
inline void DNEWS1(DREG d, DSRC a) { model::neighbours(d, a, 1); }
inline void DNEWS(DREG d, DSRC a, int dirs, bool edge = false) {
  CLR(R1, R2, R3, R4);
  if (dirs & south) SET(R1);
  if (dirs & west) SET(R2);
  if (dirs & north) SET(R3);
  if (dirs & east) SET(R4);
  model::neighbours(d, a, edge);
}
inline void PROP0() { model::propagate(false); }
inline void PROP1() { model::propagate(true); }

// ---- the controller's interface
inline void scamp5_in(AREG y, std::int8_t v) { model::store(y, model::Plane(kCells, v)); }
inline void scamp5_in(AREG y, std::int8_t v, AREG t) { model::store(t, model::Plane(kCells, 0.0F - v)); model::store(y, model::Plane(kCells, v)); }
inline void scamp5_load_in(std::int8_t v) { model::plane(IN).assign(kCells, v); }
inline void scamp5_load_in(AREG y, std::int8_t v) { scamp5_load_in(v); mov(y, IN); }
inline void scamp5_load_in(AREG y, std::int8_t v, AREG t) { scamp5_load_in(v); bus(t, IN); bus(y, t); }
inline void scamp5_shift(AREG a, int h, int v) {
  for (int k = 0; k < std::abs(h); ++k) movx(a, a, h > 0 ? west : east);
  for (int k = 0; k < std::abs(v); ++k) movx(a, a, v > 0 ? south : north);
}
inline void scamp5_shift(DREG a, int h, int v, int edge = 0, int = 2) {
  for (int k = 0; k < std::abs(h); ++k) DNEWS(a, a, h > 0 ? west : east, edge);
  for (int k = 0; k < std::abs(v); ++k) DNEWS(a, a, v > 0 ? south : north, edge);
}
inline void scamp5_diffuse(AREG a, int n, bool vertical = true, bool horizontal = true) {
  if (vertical || horizontal) model::blur(a, a, n, vertical, horizontal);
}
inline void scamp5_diffuse(AREG a, int n, bool vertical, bool horizontal, AREG) { scamp5_diffuse(a, n, vertical, horizontal); }
inline void scamp5_load_pattern(DREG d, std::uint8_t r, std::uint8_t c, std::uint8_t rx, std::uint8_t cx) {
  model::store_bits(d, [=](int i) { return model::matches(i, r, c, rx, cx); });
}
inline void scamp5_load_point(DREG d, std::uint8_t r, std::uint8_t c) {
  model::store_bits(d, [=](int i) { return model::y_of(i) == r && model::x_of(i) == c; });
}
inline void scamp5_load_rect(DREG d, std::uint8_t r, std::uint8_t c, std::uint8_t r2, std::uint8_t c2) {
  model::store_bits(d, [=](int i) { const int x = model::x_of(i), y = model::y_of(i); return y >= r && y <= r2 && x >= c && x <= c2; });
}
inline void scamp5_select_pattern(std::uint8_t r, std::uint8_t c, std::uint8_t rx, std::uint8_t cx) { scamp5_load_pattern(SELECT, r, c, rx, cx); }
inline void scamp5_select_point(std::uint8_t r, std::uint8_t c) { scamp5_load_point(SELECT, r, c); }
inline void scamp5_flood(DREG y, DSRC mask, int edge, int = 5, bool = false) {
  SET(R0);
  MOV(R12, y);
  MOV(R0, mask);
  model::propagate(edge != 0);
  MOV(y, R12);
}
inline void scamp5_draw_begin(DREG d) { model::draws = d.index; }
inline void scamp5_draw_end() { model::draws = -1; }
inline bool scamp5_draw_point(int r, int c) { model::draw([=](int x, int y) { return y == r && x == c; }); return model::is_inside(c, r); }
inline void scamp5_draw_pixel(std::uint8_t r, std::uint8_t c) { scamp5_draw_point(r % kSize, c % kSize); }
inline void scamp5_draw_rect(std::uint8_t r, std::uint8_t c, std::uint8_t r2, std::uint8_t c2) {
  model::draw([=](int x, int y) { return y >= std::min(r, r2) && y <= std::max(r, r2) && x >= std::min(c, c2) && x <= std::max(c, c2); });
}
inline void scamp5_draw_line(int r, int c, int r2, int c2, bool repeat = false) {
  const int steps = std::max({std::abs(r2 - r), std::abs(c2 - c), 1});
  const auto within = [=](double a, double b, int k) {
    const int cell = static_cast<int>(std::floor(a + k * (b - a) / steps + 0.5));
    return repeat ? (cell % kSize + kSize) % kSize : cell;
  };
  for (int k = 0; k <= steps; ++k) {
    const int row = within(r, r2, k), col = within(c, c2, k);
    if (model::is_inside(col, row)) model::bits({model::draws})[row * kSize + col] = 1;
  }
}
inline void scamp5_draw_circle(int r, int c, int radius) {
  model::draw([=](int x, int y) { return std::floor(std::sqrt(static_cast<float>((y - r) * (y - r) + (x - c) * (x - c))) + 0.5F) == radius; });
}
inline void scamp5_draw_negate() { NOT({model::draws}); }
inline int scamp5_global_or(DSRC d, std::uint8_t r = 0, std::uint8_t c = 0, std::uint8_t rx = 255, std::uint8_t cx = 255) {
  for (int i = 0; i < kCells; ++i)
    if (model::bits(d)[i] && model::matches(i, r, c, rx, cx)) return 1;
  return 0;
}
inline int scamp5_global_count(DSRC d) { int n = 0; for (int c : model::bits(d)) n += c; return n; }
inline int scamp5_global_count(DSRC d, AREG t, int = 0) {
  WHERE(d);
  scamp5_in(t, 127);
  NOT(FLAG, d);
  res(t);
  all();
  return static_cast<int>(std::floor(model::mean(t) * 4095 / 127 + 0.5));
}
inline std::uint8_t scamp5_global_sum_fast(ASRC a) { return static_cast<std::uint8_t>(std::floor(model::mean(a) + 128.5)); }
inline std::uint32_t scamp5_global_sum_16(ASRC a) { return static_cast<std::uint32_t>(std::floor((model::mean(a) + 128) * 16 + 0.5)); }
inline std::uint32_t scamp5_global_sum_64(ASRC a) { return static_cast<std::uint32_t>(std::floor((model::mean(a) + 128) * 64 + 0.5)); }
inline std::uint8_t scamp5_global_sum_sparse(ASRC a, std::uint8_t r = 2, std::uint8_t c = 2, std::uint8_t rx = 254, std::uint8_t cx = 254) {
  double total = 0;
  int count = 0;
  scamp5_select_pattern(r, c, rx, cx);
  for (int i = 0; i < kCells; ++i)
    if (model::bits(SELECT)[i]) total += model::read(a, i), ++count;
  return static_cast<std::uint8_t>(std::floor(total / std::max(count, 1) + 128.5));
}
inline std::uint8_t scamp5_read_areg(ASRC a, std::uint8_t r, std::uint8_t c) {
  if (!model::is_inside(c, r)) return 0;
  return static_cast<std::uint8_t>(std::clamp(std::floor(model::read(a, r * kSize + c) + 128.5F), 0.0F, 255.0F));
}
inline void scamp5_scan_events(DSRC d, std::uint8_t* out, std::uint16_t most = 1, std::uint8_t h = 0, std::uint8_t v = 0) {
  std::memset(out, 0, 2 * most);
  for (int i = 0, n = 0; i < kCells && n < most; ++i) {
    const int x = h ? kSize - 1 - model::x_of(i) : model::x_of(i), y = v ? kSize - 1 - model::y_of(i) : model::y_of(i);
    if (!model::bits(d)[y * kSize + x]) continue;
    out[2 * n] = x;
    out[2 * n++ + 1] = y;
  }
}
inline void scamp5_scan_boundingbox(DSRC d, std::uint8_t* out) {
  int box[4] = {kSize, kSize, 0, 0};
  for (int i = 0; i < kCells; ++i)
    if (model::bits(d)[i])
      box[0] = std::min(box[0], model::y_of(i)), box[1] = std::min(box[1], model::x_of(i)), box[2] = std::max(box[2], model::y_of(i)),
      box[3] = std::max(box[3], model::x_of(i));
  for (int k = 0; k < 4; ++k) out[k] = box[k];
}

// ---- kernels and frames
#define scamp5_kernel_begin() {
#define scamp5_kernel_end() }
#define scamp5_dynamic_kernel_begin() {
#define scamp5_dynamic_kernel_end() }
struct scamp5_kernel {
  std::function<void()> body;
  scamp5_kernel() = default;
  template <class Body> scamp5_kernel(Body b) : body(b) {}
  template <class Body> scamp5_kernel& operator()(Body b) { body = b; return *this; }
};
inline void scamp5_launch_kernel(scamp5_kernel& kernel) { kernel.body(); }

// ---- the host
using vs_handle = int;
constexpr int VS_GUI_FRAME_RATE = 0, VS_GUI_FRAME_GAIN = 1;
#define VS_M0_PROJECT_INFO_STRING ""
#define VS_GUI_DISPLAY_STYLE(name, text) const char* name = text
template <class... T> vs_handle vs_gui_add_slider(const char*, int, int, int first) { model::controls.push_back(first); return model::controls.size() - 1; }
template <class V> vs_handle vs_gui_add_slider(const char*, int, int, int first, V* value) { *value = first; model::controls.push_back(first); return model::controls.size() - 1; }
template <class... T> vs_handle vs_gui_add_slider_latched(T... t) { return vs_gui_add_slider(t...); }
inline vs_handle vs_gui_add_switch(const char*, int first) { model::controls.push_back(first); return model::controls.size() - 1; }
template <class V> vs_handle vs_gui_add_switch(const char*, int first, V* value) { *value = first; model::controls.push_back(first); return model::controls.size() - 1; }
inline std::int32_t vs_gui_read_slider(vs_handle h) { return model::controls.at(h); }
inline void vs_gui_move_slider(vs_handle h, std::int32_t v, bool = true) { model::controls.at(h) = v; }
inline void vs_gui_set_slider(vs_handle h, std::int32_t v) { model::controls.at(h) = v; }
inline bool vs_gui_is_on() { return false; }
inline std::uint32_t vs_loop_counter_get() { return 0; }
#define VS_LC 0
struct vs_stopwatch {
  void reset() {}
  std::uint32_t get_usec() { return 1; }
};
#define SCAMP5_STUB(name) template <class... T> inline int name(T&&...) { return 0; }
SCAMP5_STUB(vs_init) SCAMP5_STUB(vs_frame_loop_control) SCAMP5_STUB(vs_wait_frame_trigger) SCAMP5_STUB(vs_process_message)
SCAMP5_STUB(vs_loop_counter_inc) SCAMP5_STUB(vs_loop_counter_reset) SCAMP5_STUB(vs_disable_frame_trigger) SCAMP5_STUB(vs_enable_frame_trigger)
SCAMP5_STUB(vs_frame_trigger_set) SCAMP5_STUB(vs_configure_frame_trigger) SCAMP5_STUB(vs_wait) SCAMP5_STUB(vs_gui_set_info)
SCAMP5_STUB(vs_gui_add_display) SCAMP5_STUB(vs_gui_add_button) SCAMP5_STUB(vs_on_gui_update) SCAMP5_STUB(vs_on_host_connect)
SCAMP5_STUB(vs_on_host_disconnect) SCAMP5_STUB(vs_on_user_value) SCAMP5_STUB(vs_on_shutdown) SCAMP5_STUB(vs_post_text)
SCAMP5_STUB(vs_post_set_channel) SCAMP5_STUB(vs_post_int8) SCAMP5_STUB(vs_post_int16) SCAMP5_STUB(vs_post_int32) SCAMP5_STUB(vs_post_float)
SCAMP5_STUB(vs_post_bind_io_agent) SCAMP5_STUB(vs_gui_set_scope) SCAMP5_STUB(vs_gui_set_barplot) SCAMP5_STUB(vs_gui_set_lineplot)
SCAMP5_STUB(vs_gui_display_text) SCAMP5_STUB(vs_led_on) SCAMP5_STUB(vs_led_off) SCAMP5_STUB(vs_led_toggle)
SCAMP5_STUB(vs_scamp5_configure_voltage) SCAMP5_STUB(vs_scamp5_get_parameter) SCAMP5_STUB(scamp5_bind_io_agent)
SCAMP5_STUB(scamp5_output_image) SCAMP5_STUB(scamp5_output_areg) SCAMP5_STUB(scamp5_output_events) SCAMP5_STUB(scamp5_output_boundingbox)
SCAMP5_STUB(scamp5_output_bitstack_begin) SCAMP5_STUB(scamp5_output_bitstack_bit) SCAMP5_STUB(scamp5_output_bitstack_end)
SCAMP5_STUB(scamp5_display_boundingbox) SCAMP5_STUB(scamp5_display_events) SCAMP5_STUB(scamp5_display_image)
#undef SCAMP5_STUB
namespace vs_sim {
inline bool is_simulation() { return false; }
template <class... T> void reset_model(T&&...) {}
}  // namespace vs_sim
enum { SCAMP5_GLOBAL_SUM_16_FLOOR, SCAMP5_GLOBAL_SUM_16_SPAN, SCAMP5_GLOBAL_SUM_64_FLOOR, SCAMP5_GLOBAL_SUM_64_SPAN };
enum { VS_LED_1, VS_LED_2, VS_FRAME_TRIGGER_CONST_LOOP, VS_FRAME_TRIGGER_CONST_PIX, vs_usb, vs_spi };
