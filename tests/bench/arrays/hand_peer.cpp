// Hand-fused peer: each workload is one loop nest of AVX-512 intrinsics with skewed rows, intermediate rows
// in small rings, four rows per iteration, and neighbours taken from registers.
#include "tests/bench/arrays/Peers.h"

#if defined(__AVX512F__) && defined(__AVX512DQ__)

#include <immintrin.h>

#include <algorithm>
#include <type_traits>
#include <vector>

namespace arrays {
namespace {

using V = __m512;

V load(const float* p) { return _mm512_loadu_ps(p); }
void store(float* p, V v) { _mm512_storeu_ps(p, v); }
V smaller(V a, V b) { return _mm512_min_ps(a, b); }
V larger(V a, V b) { return _mm512_max_ps(a, b); }
V sum(V a, V b) { return _mm512_add_ps(a, b); }
const auto kMin = [](V a, V b) { return smaller(a, b); };
const auto kMax = [](V a, V b) { return larger(a, b); };
const auto kSum = [](V a, V b) { return sum(a, b); };

// Ring of rows: row r is stored at r mod `rows`, a power of two.
struct Ring {
  Image image;
  int mask;
  Ring(int rows, int width) : image(rows, width), mask(rows - 1) {}
  float* row(int r) { return image.row(r & mask); }
};

// Calls f(j, column, centre, north, south, west, east) for R rows of w cells; in[0] is the row north of the
// first.
template <int R, class F>
inline __attribute__((always_inline)) void block(const float* const* in, int w, const F& f) {
  V west[R], own[R], east[R];
  for (int j = 0; j < R; ++j) west[j] = load(in[j + 1] - 16), own[j] = load(in[j + 1]);
  for (int i = 0; i < w; i += 16) {
    for (int j = 0; j < R; ++j) east[j] = load(in[j + 1] + i + 16);
    const V north = load(in[0] + i), south = load(in[R + 1] + i);
    for (int j = 0; j < R; ++j) {
      const auto bits = [](V v) { return _mm512_castps_si512(v); };
      const V l = _mm512_castsi512_ps(_mm512_alignr_epi32(bits(own[j]), bits(west[j]), 15));
      const V r = _mm512_castsi512_ps(_mm512_alignr_epi32(bits(east[j]), bits(own[j]), 1));
      f(j, i, own[j], j > 0 ? own[j - 1] : north, j < R - 1 ? own[j + 1] : south, l, r);
    }
    for (int j = 0; j < R; ++j) west[j] = own[j], own[j] = east[j];
  }
}

template <class Op>
inline void reduce_row(float* o, const float* a, int w, const Op& op) {
  for (int i = 0; i < w; i += 16) store(o + i, op(op(load(a + i - 1), load(a + i + 1)), load(a + i)));
}
template <class Op>
inline void reduce_rows(float* o, const float* north, const float* own, const float* south, int w,
                        const Op& op) {
  for (int i = 0; i < w; i += 16) store(o + i, op(op(load(north + i), load(south + i)), load(own + i)));
}

struct HandFusedWorkspace {
  explicit HandFusedWorkspace(int size)
      : n(size), h(16, size), e(16, size), g(16, size), zero(1, size), strip(std::min(n, 1024) + 64) {
    for (Image& i : image) i = Image(n);
  }
  int n;
  Image image[4] = {Image(1), Image(1), Image(1), Image(1)};
  Ring h, e, g;
  Image zero;

  void addition() {
    for (int r = 0; r < n; ++r) {
      const float *a = image[0].row(r), *c = image[2].row(r);
      float* to = image[1].row(r);
      for (int i = 0; i < n; i += 16) store(to + i, sum(load(a + i), load(c + i)));
    }
  }

  void chain() {
    const V half = _mm512_set1_ps(0.5F);
    for (int r = 0; r < n; ++r) {
      float *a = image[0].row(r), *b = image[1].row(r), *c = image[2].row(r), *d = image[3].row(r);
      for (int i = 0; i < n; i += 16) {
        const V x = load(a + i), t = _mm512_mul_ps(sum(x, load(b + i)), half);
        const V y = _mm512_mask_mov_ps(load(b + i), _mm512_cmp_ps_mask(t, x, _CMP_GT_OQ), t);
        const V high = larger(x, y), low = smaller(x, y), apart = _mm512_sub_ps(high, low);
        store(a + i, low), store(b + i, y), store(d + i, apart), store(c + i, _mm512_mul_ps(high, apart));
      }
    }
  }

  float* row_or_zero(Ring& ring, int r) { return r < 0 || r >= n ? zero.row(0) : ring.row(r); }

  void morphology() {
    for (int r = 0; r < n + 2; ++r) {
      if (r < n) reduce_row(h.row(r), image[0].row(r), n, kMin);
      if (const int m = r - 1; m >= 0 && m < n) {
        reduce_rows(e.row(m), row_or_zero(h, m - 1), h.row(m), row_or_zero(h, m + 1), n, kMin);
        reduce_row(g.row(m), e.row(m), n, kMax);
      }
      if (const int o = r - 2; o >= 0)
        reduce_rows(image[1].row(o), row_or_zero(g, o - 1), g.row(o), row_or_zero(g, o + 1), n, kMax);
    }
  }

  void life() {
    const V one = _mm512_set1_ps(1), three = _mm512_set1_ps(3), four = _mm512_set1_ps(4);
    for (int r = 0; r < n + 1; ++r) {
      if (r < n) reduce_row(h.row(r), image[0].row(r), n, kSum);
      const int o = r - 1;
      if (o < 0) continue;
      const float *north = row_or_zero(h, o - 1), *own = h.row(o), *south = row_or_zero(h, o + 1),
                  *a = image[0].row(o);
      float* to = image[1].row(o);
      for (int i = 0; i < n; i += 16) {
        const V s = sum(sum(load(north + i), load(south + i)), load(own + i));
        const __mmask16 alive = _mm512_cmp_ps_mask(load(a + i), one, _CMP_EQ_OQ);
        const auto k = static_cast<__mmask16>(_mm512_cmp_ps_mask(s, three, _CMP_EQ_OQ) |
                                              _mm512_mask_cmp_ps_mask(alive, s, four, _CMP_EQ_OQ));
        store(to + i, _mm512_maskz_mov_ps(k, one));
      }
    }
  }

  // 16 diffusion steps between two images, each one row behind the previous step.
  void diffusion() {
    const V k = _mm512_set1_ps(0.2F);
    const auto step = [&](auto rows, const Image& x, Image& y, int r) {
      constexpr int kRows = decltype(rows)::value;
      const float* in[kRows + 2];
      for (int j = 0; j < kRows + 2; ++j) in[j] = x.row(r + j - 1);
      float* to = y.row(r);
      const std::ptrdiff_t pitch = y.pitch();
      block<kRows>(in, n, [&](int j, int i, V own, V north, V south, V west, V east) {
        store(to + j * pitch + i,
              sum(_mm512_mul_ps(sum(sum(north, south), sum(east, west)), k), _mm512_mul_ps(own, k)));
      });
    };
    for (int b = 0; b < n + 16; b += 4)
      for (int t = 0; t < 16; ++t) {
        const int first = std::max(0, b - t), last = std::min(n, b - t + 4);
        const Image& x = t == 0 ? image[0] : image[t % 2 == 0 ? 1 : 2];
        Image& y = image[t % 2 == 0 ? 2 : 1];
        if (last - first == 4)
          step(std::integral_constant<int, 4>{}, x, y, first);
        else
          for (int r = first; r < last; ++r) step(std::integral_constant<int, 1>{}, x, y, r);
      }
  }

  // ---- the case study's kernel, in column strips with a halo of 32 columns ----
  struct Strip {
    explicit Strip(int w)
        : h(16, w), e(64, w), da(32, w), db(16, w), ma(32, w), mb(32, w), c(16, w), zero(1, w) {}
    Ring h, e, da, db, ma, mb, c;
    Image zero;
  } strip;

  float* row_or_zero(Ring& ring, int r, bool) { return r < 0 || r >= n ? strip.zero.row(0) : ring.row(r); }

  template <class Body>
  void stage(int b, int lag, const Body& body) {
    const int first = std::max(0, b - lag), last = std::min(n, b - lag + 4);
    if (last - first == 4)
      body(std::integral_constant<int, 4>{}, first);
    else
      for (int r = first; r < last; ++r) body(std::integral_constant<int, 1>{}, r);
  }

  template <class Rows, class Cell>
  void neighbours(Rows, Ring& from, int r, int w, const Cell& cell) {
    constexpr int kRows = Rows::value;
    const float* in[kRows + 2];
    for (int j = 0; j < kRows + 2; ++j) in[j] = row_or_zero(from, r - 1 + j, true);
    block<kRows>(in, w, cell);
  }

  void case_study() {
    for (int c0 = 0; c0 < n; c0 += 1024) {
      const int c1 = std::min(n, c0 + 1024), x0 = std::max(0, c0 - 32), x1 = std::min(n, c1 + 32);
      // Cells beyond the array's edge are zero; those beyond a strip's edge are arbitrary.
      for (Ring* ring : {&strip.h, &strip.e, &strip.da, &strip.db, &strip.ma, &strip.mb, &strip.c})
        for (int r = 0; x1 == n && r <= ring->mask; ++r) store(ring->row(r) + (x1 - x0), _mm512_setzero_ps());
      for (int b = 0; b < n + 28; b += 4) case_study_block(b, c0, c1, x0, x1 - x0);
    }
  }

  void case_study_block(int b, int c0, int c1, int x0, int w) {
    const V one = _mm512_set1_ps(1), zero_v = _mm512_setzero_ps();
    const auto on = [&](const float* p) { return _mm512_cmp_ps_mask(load(p), zero_v, _CMP_NEQ_UQ); };
    const auto each = [](auto rows, int r, const auto& f) {
      for (int j = 0; j < decltype(rows)::value; ++j) f(r + j);
    };
    stage(b, 0, [&](auto rows, int r0) {
      each(rows, r0, [&](int r) { reduce_row(strip.h.row(r), image[0].row(r) + x0, w, kMin); });
    });
    stage(b, 1, [&](auto rows, int r0) {
      each(rows, r0, [&](int r) {
        const float *u = row_or_zero(strip.h, r - 1, true), *m = strip.h.row(r),
                    *d = row_or_zero(strip.h, r + 1, true);
        float *e_row = strip.e.row(r), *d_row = strip.da.row(r);
        for (int i = 0; i < w; i += 16) {
          const V v = smaller(smaller(load(u + i), load(d + i)), load(m + i));
          store(e_row + i, v), store(d_row + i, v);
        }
      });
    });
    for (int t = 1; t <= 8; ++t) {
      Ring &x = t % 2 == 1 ? strip.da : strip.db, &y = t % 2 == 1 ? strip.db : strip.da;
      stage(b, 1 + t, [&](auto rows, int r) {
        neighbours(rows, x, r, w, [&](int j, int i, V, V north, V south, V west, V east) {
          const V least = smaller(smaller(north, south), smaller(east, west));
          const V v = _mm512_maskz_add_ps(on(strip.e.row(r + j) + i), least, one);
          store(y.row(r + j) + i, v);
          if (t == 8) store(strip.ma.row(r + j) + i, v);
        });
      });
    }
    for (int t = 1; t <= 16; ++t) {
      Ring &x = t % 2 == 1 ? strip.ma : strip.mb, &y = t % 2 == 1 ? strip.mb : strip.ma;
      stage(b, 9 + t, [&](auto rows, int r) {
        neighbours(rows, x, r, w, [&](int j, int i, V own, V north, V south, V west, V east) {
          const V most = larger(larger(larger(north, south), larger(east, west)), own);
          const __mmask16 k = on(strip.e.row(r + j) + i);
          const V v = _mm512_maskz_mov_ps(k, most);
          store(y.row(r + j) + i, v);
          if (t == 16) {
            const __mmask16 top = _mm512_mask_cmp_ps_mask(k, load(strip.da.row(r + j) + i), v, _CMP_GE_OQ);
            store(strip.c.row(r + j) + i, _mm512_maskz_mov_ps(top, one));
          }
        });
      });
    }
    stage(b, 26, [&](auto rows, int r0) {
      each(rows, r0, [&](int r) {
        const float *u = row_or_zero(strip.c, r - 1, true), *m = strip.c.row(r),
                    *d = row_or_zero(strip.c, r + 1, true), *size = strip.ma.row(r);
        const auto three = [](const float* p) { return larger(larger(load(p - 1), load(p + 1)), load(p)); };
        float* to = image[1].row(r) + x0;
        for (int i = c0 - x0; i < c1 - x0; i += 16) {
          const V near = larger(larger(three(u + i), three(d + i)), three(m + i));
          store(to + i, _mm512_maskz_mov_ps(_mm512_cmp_ps_mask(near, zero_v, _CMP_NEQ_UQ), load(size + i)));
        }
      });
    });
  }
};

}  // namespace

std::optional<Job> make_hand_fused_job(int workload, int n) {
  auto m = std::make_shared<HandFusedWorkspace>(n);
  m->image[0] = input(workload, n, 0);
  if (inputs(workload) == 2) m->image[workload == 1 ? 2 : 1] = input(workload, n, 1);
  const auto run = [m, workload] {
    if (workload == 1) m->addition();
    if (workload == 2) m->chain();
    if (workload == 3) m->morphology();
    if (workload == 4) m->life();
    if (workload == 5) m->diffusion();
    if (workload == 6) m->case_study();
  };
  return Job{run, [m, workload] {
               double total = 0;
               for (int i = 0; i < 4; ++i)
                 if (workload == 2 || i == 1) total += m->image[i].checksum();
               return total;
             }};
}

}  // namespace arrays

#else

namespace arrays {

std::optional<Job> make_hand_fused_job(int, int) { return std::nullopt; }

}  // namespace arrays

#endif
