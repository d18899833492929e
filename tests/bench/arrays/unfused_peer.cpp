// Unfused peer: one plain loop over the whole array per operation, with NEWS shifts as copies.
#include <algorithm>
#include <vector>

#include "tests/bench/arrays/Peers.h"

namespace arrays {
namespace {

template <class Op>
void each(Image& y, const Image& a, const Image& b, const Op& op) {
  const int n = y.n();
  for (int r = 0; r < n; ++r) {
    float* to = y.row(r);
    const float *x = a.row(r), *z = b.row(r);
#pragma GCC ivdep
    for (int c = 0; c < n; ++c) to[c] = op(x[c], z[c]);
  }
}

void shift_image(Image& y, const Image& a, int dx, int dy) {
  for (int r = 0; r < y.n(); ++r) std::copy_n(a.row(r + dy) + dx, y.n(), y.row(r));
}

float smaller(float a, float b) { return a < b ? a : b; }
float larger(float a, float b) { return a > b ? a : b; }

struct UnfusedWorkspace {
  explicit UnfusedWorkspace(int n) {
    for (int i = 0; i < 10; ++i) images.emplace_back(n);
  }
  std::vector<Image> images;

  template <class Op>
  void op(int y, int a, int b, const Op& f) {
    each(images[y], images[a], images[b], f);
  }
  void shift(int y, int a, int dx, int dy) { shift_image(images[y], images[a], dx, dy); }
  void copy(int y, int a) {
    op(y, a, a, [](float v, float) { return v; });
  }
  template <class Op>
  void nine(int a, int to, const Op& f) {
    shift(4, a, 1, 0), shift(5, a, -1, 0), op(6, 4, 5, f), op(6, 6, a, f);
    shift(4, 6, 0, -1), shift(5, 6, 0, 1), op(to, 4, 5, f), op(to, to, 6, f);
  }
  template <class Op>
  void four(int a, int to, const Op& f) {
    shift(4, a, 0, -1), shift(5, a, 0, 1), shift(6, a, 1, 0), shift(7, a, -1, 0);
    op(to, 4, 5, f), op(6, 6, 7, f), op(to, to, 6, f);
  }
  void copy_masked(int y, int mask, int a) {
    Image &to = images[y], &m = images[mask], &from = images[a];
    const int n = to.n();
    for (int r = 0; r < n; ++r) {
      float* t = to.row(r);
      const float *on = m.row(r), *v = from.row(r);
#pragma GCC ivdep
      for (int c = 0; c < n; ++c) {
        const float yes = v[c], no = t[c];
        t[c] = on[c] != 0.0F ? yes : no;
      }
    }
  }
};

const auto kSum = [](float a, float b) { return a + b; };

void chain(UnfusedWorkspace& m) {
  m.op(2, 0, 1, kSum);
  m.op(3, 2, 2, [](float a, float) { return a * 0.5F; });
  m.op(4, 3, 0, [](float a, float b) { return a > b ? 1.0F : 0.0F; });
  m.copy_masked(1, 4, 3);
  m.op(2, 0, 1, larger);
  m.op(0, 0, 1, smaller);
  m.op(3, 2, 0, [](float a, float b) { return a - b; });
  m.op(2, 2, 3, [](float a, float b) { return a * b; });
}

void life(UnfusedWorkspace& m) {
  m.nine(0, 8, kSum);
  m.op(4, 8, 8, [](float s, float) { return s == 3.0F ? 1.0F : 0.0F; });
  m.op(5, 8, 8, [](float s, float) { return s == 4.0F ? 1.0F : 0.0F; });
  m.op(5, 5, 0, [](float a, float b) { return a * b; });
  m.op(1, 4, 5, larger);
}

void diffusion(UnfusedWorkspace& m) {
  m.copy(1, 0);
  for (int i = 0; i < 16; ++i) {
    m.four(1, 8, kSum);
    m.op(8, 8, 8, [](float a, float) { return a * 0.2F; });
    m.op(4, 1, 1, [](float a, float) { return a * 0.2F; });
    m.op(1, 8, 4, kSum);
  }
}

void case_study(UnfusedWorkspace& m) {
  m.nine(0, 9, smaller);
  m.copy(2, 9);
  for (int i = 0; i < 8; ++i) {
    m.four(2, 8, smaller);
    m.op(8, 8, 8, [](float a, float) { return a + 1.0F; });
    m.copy_masked(2, 9, 8);
  }
  m.copy(3, 2);
  for (int i = 0; i < 16; ++i) {
    m.four(3, 8, larger);
    m.op(8, 8, 3, larger);
    m.copy_masked(3, 9, 8);
  }
  m.op(8, 2, 3, [](float a, float b) { return a >= b ? 1.0F : 0.0F; });
  m.op(8, 8, 9, [](float a, float b) { return a * b; });
  m.nine(8, 7, larger);
  m.op(1, 3, 7, [](float a, float on) { return on != 0.0F ? a : 0.0F; });
}

}  // namespace

std::optional<Job> make_unfused_job(int workload, int n) {
  auto m = std::make_shared<UnfusedWorkspace>(n);
  m->images[0] = input(workload, n, 0);
  if (inputs(workload) == 2) m->images[workload == 1 ? 2 : 1] = input(workload, n, 1);
  const auto run = [m, workload] {
    if (workload == 1) m->op(1, 0, 2, kSum);
    if (workload == 2) chain(*m);
    if (workload == 3) m->nine(0, 8, smaller), m->nine(8, 1, larger);
    if (workload == 4) life(*m);
    if (workload == 5) diffusion(*m);
    if (workload == 6) case_study(*m);
  };
  return Job{run, [m, workload] {
               double sum = 0;
               for (const std::size_t i : {0, 1, 2, 3})
                 if (workload == 2 || i == 1) sum += m->images[i].checksum();
               return sum;
             }};
}

}  // namespace arrays
