#include <Eigen/Core>

#include "tests/bench/arrays/Peers.h"

namespace arrays {
namespace {

using Array = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct EigenWorkspace {
  explicit EigenWorkspace(int size) : n(size) {
    for (Array& p : padded) p = Array::Zero(n + 2, n + 2);
    for (Array& w : whole) w = Array::Zero(n, n);
  }
  int n;
  Array padded[7], whole[4];

  auto interior(Array& p) const { return p.block(1, 1, n, n); }
  auto north(Array& p) const { return p.block(0, 1, n, n); }
  auto south(Array& p) const { return p.block(2, 1, n, n); }
  auto east(Array& p) const { return p.block(1, 2, n, n); }
  auto west(Array& p) const { return p.block(1, 0, n, n); }

  void chain() {
    Array &a = whole[0], &b = whole[1], &c = whole[2], &d = whole[3];
    d = (a + b) * 0.5F;
    b = (d > a).select(d, b);
    c = a.max(b);
    a = a.min(b);
    d = c - a;
    c = c * d;
  }
  void morphology() {
    Array &a = padded[0], &h = padded[1], &e = padded[2], &g = padded[3];
    interior(h) = east(a).min(west(a)).min(interior(a));
    interior(e) = north(h).min(south(h)).min(interior(h));
    interior(g) = east(e).max(west(e)).max(interior(e));
    whole[1] = north(g).max(south(g)).max(interior(g));
  }
  void life() {
    Array &a = padded[0], &h = padded[1];
    interior(h) = east(a) + west(a) + interior(a);
    whole[0] = north(h) + south(h) + interior(h);
    whole[1] = (whole[0] == 3.0F || (whole[0] == 4.0F && interior(a) != 0.0F)).cast<float>();
  }
  void diffusion() {
    for (int t = 0; t < 16; ++t) {
      Array &x = t == 0 ? padded[0] : padded[1 + t % 2], &y = padded[2 - t % 2];
      interior(y) = ((north(x) + south(x)) + (east(x) + west(x))) * 0.2F + interior(x) * 0.2F;
    }
    whole[1] = interior(padded[1]);
  }
  void case_study() {
    Array &a = padded[0], &h = padded[1], &e = padded[2];
    interior(h) = east(a).min(west(a)).min(interior(a));
    interior(e) = north(h).min(south(h)).min(interior(h));
    padded[3] = e;
    for (int t = 0; t < 8; ++t) {
      Array &x = padded[3 + t % 2], &y = padded[4 - t % 2];
      interior(y) =
          (interior(e) != 0.0F).select(north(x).min(south(x)).min(east(x).min(west(x))) + 1.0F, interior(x));
    }
    padded[5] = padded[3];
    for (int t = 0; t < 16; ++t) {
      Array &x = padded[5 + t % 2], &y = padded[6 - t % 2];
      interior(y) =
          (interior(e) != 0.0F)
              .select(north(x).max(south(x)).max(east(x).max(west(x))).max(interior(x)), interior(x));
    }
    Array &d = padded[3], &m = padded[5], &c = padded[4];
    interior(c) = (interior(d) >= interior(m)).cast<float>() * interior(e);
    interior(h) = east(c).max(west(c)).max(interior(c));
    whole[1] = (north(h).max(south(h)).max(interior(h)) != 0.0F).select(interior(m), 0.0F);
  }
};

double checksum(const Array& a) {
  Image image(static_cast<int>(a.rows()));
  for (int r = 0; r < image.n(); ++r)
    for (int c = 0; c < image.n(); ++c) image.row(r)[c] = a(r, c);
  return image.checksum();
}

}  // namespace

std::optional<Job> make_eigen_job(int workload, int n) {
  auto m = std::make_shared<EigenWorkspace>(n);
  for (int i = 0; i < inputs(workload); ++i) {
    const Image image = input(workload, n, i);
    for (int r = 0; r < n; ++r)
      for (int c = 0; c < n; ++c)
        (workload <= 2 ? m->whole[workload == 1 ? 2 * i : i](r, c) : m->padded[0](r + 1, c + 1)) =
            image.row(r)[c];
  }
  const auto run = [m, workload] {
    if (workload == 1) m->whole[1] = m->whole[0] + m->whole[2];
    if (workload == 2) m->chain();
    if (workload == 3) m->morphology();
    if (workload == 4) m->life();
    if (workload == 5) m->diffusion();
    if (workload == 6) m->case_study();
  };
  return Job{run, [m, workload] {
               double sum = 0;
               for (int i = 0; i < 4; ++i)
                 if (workload == 2 || i == 1) sum += checksum(m->whole[i]);
               return sum;
             }};
}

}  // namespace arrays
