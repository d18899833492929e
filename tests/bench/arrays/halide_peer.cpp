#ifdef ARRAYS_HALIDE

#include <Halide.h>

#include <algorithm>
#include <vector>

#include "tests/bench/arrays/Peers.h"

namespace arrays {
namespace {

using Halide::Buffer;
using Halide::cast;
using Halide::Expr;
using Halide::Func;
using Halide::Var;

// Schedule: one thread, tiles of 1024 or 512 columns and 64 rows, every stage computed per tile. The fastest
// of the schedules tried.
struct Pipeline {
  Pipeline(int workload, int size, Halide::Target wanted) : n(size), w(workload), target(wanted) {
    for (int i = 0; i < inputs(w); ++i) {
      const Image image = input(w, n, i);
      in.emplace_back(n, n);
      for (int r = 0; r < n; ++r)
        for (int c = 0; c < n; ++c) in.back()(c, r) = image.row(r)[c];
    }
    const Func result = w == 1   ? addition()
                        : w == 2 ? chain()
                        : w == 3 ? morphology()
                        : w == 4 ? life()
                        : w == 5 ? diffusion()
                                 : case_study();
    schedule(result);
  }

  // Computes zeros beyond the edge, so that reads need no boundary condition. This keeps compile times to
  // seconds.
  Expr within(const Expr& value) { return Halide::select(x >= 0 && x < n && y >= 0 && y < n, value, 0.0F); }
  Func stage(Func f) {
    stages.push_back(f);
    return f;
  }

  Func addition() {
    Func o;
    o(x, y) = in[0](x, y) + in[1](x, y);
    return o;
  }
  Func chain() {
    Func o;
    const Expr a = in[0](x, y), b = in[1](x, y), t = (a + b) * 0.5F, b2 = Halide::select(t > a, t, b);
    const Expr high = Halide::max(a, b2), low = Halide::min(a, b2), d = high - low;
    o(x, y) = Halide::Tuple(low, b2, high * d, d);
    return o;
  }
  Func nine(Func a, bool smallest) {
    Func h, e;
    const auto join = [&](const Expr& p, const Expr& q) {
      return smallest ? Halide::min(p, q) : Halide::max(p, q);
    };
    h(x, y) = within(join(join(a(x - 1, y), a(x + 1, y)), a(x, y)));
    stage(h);
    e(x, y) = within(join(join(h(x, y - 1), h(x, y + 1)), h(x, y)));
    return e;
  }
  Func source() { return Halide::BoundaryConditions::constant_exterior(in[0], 0.0F); }
  Func morphology() { return nine(stage(nine(source(), true)), false); }
  Func life() {
    Func a = source(), h, o;
    h(x, y) = within(a(x - 1, y) + a(x + 1, y) + a(x, y));
    stage(h);
    const Expr s = h(x, y - 1) + h(x, y + 1) + h(x, y);
    o(x, y) = Halide::select(s == 3.0F || (s == 4.0F && in[0](x, y) == 1.0F), 1.0F, 0.0F);
    return o;
  }
  Func diffusion() {
    Func c = source(), f;
    for (int t = 0; t < 16; ++t) {
      f = Func();
      f(x, y) = within(((c(x, y - 1) + c(x, y + 1)) + (c(x + 1, y) + c(x - 1, y))) * 0.2F + c(x, y) * 0.2F);
      if (t < 15) c = stage(f);
    }
    return f;
  }
  Func case_study() {
    Func e = stage(nine(source(), true)), d = e, m;
    for (int t = 0; t < 8; ++t) {
      Func c = d, f;  // zero beyond the edge, because e is
      f(x, y) = Halide::select(
          e(x, y) != 0.0F,
          Halide::min(Halide::min(c(x, y - 1), c(x, y + 1)), Halide::min(c(x + 1, y), c(x - 1, y))) + 1.0F,
          0.0F);
      d = stage(f);
    }
    m = d;
    for (int t = 0; t < 16; ++t) {
      Func c = m, f;
      const Expr four =
          Halide::max(Halide::max(c(x, y - 1), c(x, y + 1)), Halide::max(c(x + 1, y), c(x - 1, y)));
      f(x, y) = Halide::select(e(x, y) != 0.0F, Halide::max(four, c(x, y)), 0.0F);
      m = stage(f);
    }
    Func c, o;
    c(x, y) = Halide::select(d(x, y) >= m(x, y) && e(x, y) != 0.0F, 1.0F, 0.0F);
    Func near = nine(stage(c), false);
    o(x, y) = Halide::select(near(x, y) != 0.0F, m(x, y), 0.0F);
    return o;
  }

  void schedule(Func result) {
    out = result;
    out.bound(x, 0, n).bound(y, 0, n);
    if (w <= 2) {
      out.vectorize(x, kVector);
    } else {
      out.tile(x, y, xo, yo, xi, yi, std::min(n, w >= 5 ? 512 : 1024), std::min(n, 64))
          .vectorize(xi, kVector);
      for (Func& f : stages)
        f.compute_at(out, xo).vectorize(f.args()[0], kVector, Halide::TailStrategy::RoundUp);
    }
    out.compile_jit(target);
    std::vector<Buffer<>> buffers;
    for (int i = 0; i < (w == 2 ? 4 : 1); ++i) buffers.push_back(Buffer<float>(n, n));
    results = std::make_unique<Halide::Realization>(buffers);
  }

  double checksum() const {
    double sum = 0;
    for (std::size_t i = 0; i < results->size(); ++i) {
      const Buffer<float> b((*results)[i]);
      Image image(n);
      for (int r = 0; r < n; ++r)
        for (int c = 0; c < n; ++c) image.row(r)[c] = b(c, r);
      sum += image.checksum();
    }
    return sum;
  }

  static constexpr int kVector = 16;  // of AVX2 two registers, which is faster than one
  int n, w;
  Var x, y, xo, yo, xi, yi;
  std::vector<Buffer<float>> in;
  std::vector<Func> stages;
  Func out;
  const Halide::Target target;
  std::unique_ptr<Halide::Realization> results;
};

}  // namespace

std::optional<Job> make_halide_job(int workload, int n, apron::vm::InstructionSet isa) {
  using Halide::Target;
  Target target = Halide::get_jit_target_from_environment();
  for (const Target::Feature feature : {Target::AVX512, Target::AVX512_KNL, Target::AVX512_Skylake,
                                        Target::AVX512_Cannonlake, Target::AVX512_SapphireRapids})
    if (isa == apron::vm::InstructionSet::kAvx2) target = target.without_feature(feature);
  auto p = std::make_shared<Pipeline>(workload, n, target);
  return Job{[p] { p->out.realize(*p->results, p->target); }, [p] { return p->checksum(); }};
}

}  // namespace arrays

#else

#include "tests/bench/arrays/Peers.h"

namespace arrays {

std::optional<Job> make_halide_job(int, int, apron::vm::InstructionSet) { return std::nullopt; }

}  // namespace arrays

#endif
