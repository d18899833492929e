// Benchmarks of the VM on n x n float registers.
//   Chain: 8 element-wise instructions with a selection.
//   Case study: the kernel of the sorting case study in NEWS steps (erode, 8 distance steps, 16 spread steps,
//   dilate, threshold).
#include <benchmark/benchmark.h>

#include <random>

#include "tests/unit/apron/vm/TestProgram.h"

namespace {

using apron::program::Opcode;
using apron::program::Operand;
using apron::vm::test::FakeHost;
using apron::vm::test::TestProgram;

struct Kernel : TestProgram {
  explicit Kernel(std::uint32_t size) {
    for (Operand& r : registers) r = reg(size, size);
  }
  void op(Opcode o, int y, int a, int b = -1) {
    add(o, registers[y], registers[a], b < 0 ? Operand{} : registers[b], {}, false);
  }
  void op(Opcode o, int y, int a, float b) { add(o, registers[y], registers[a], lit(b), {}, false); }
  void select(int y, int mask, int a, int b) {
    add(Opcode::kSelect, registers[y], registers[mask], registers[a], registers[b], false);
  }
  void move(int y, int a, float dx, float dy) {
    add(Opcode::kShift, registers[y], registers[a], lit(dx), lit(dy), false);
  }
  // Separable 3x3 reduction: east-west, then north-south.
  void nine(Opcode o, int a, int to) {
    move(4, a, -1, 0), move(5, a, 1, 0), op(o, 6, a, 4), op(o, 6, 6, 5);
    move(4, 6, 0, 1), move(5, 6, 0, -1), op(o, to, 6, 4), op(o, to, to, 5);
  }
  void four(Opcode o, int a, int to) {
    move(4, a, 0, 1), move(5, a, 0, -1), move(6, a, -1, 0), move(7, a, 1, 0);
    op(o, to, 4, 5), op(o, 6, 6, 7), op(o, to, to, 6);
  }

  Operand registers[10];
};

TestProgram chain(std::uint32_t size) {
  Kernel k(size);
  k.op(Opcode::kAdd, 2, 0, 1);
  k.op(Opcode::kMul, 3, 2, 0.5F);
  k.op(Opcode::kGt, 4, 3, 0);
  k.select(1, 4, 3, 1);
  k.op(Opcode::kMax, 2, 0, 1);
  k.op(Opcode::kMin, 0, 0, 1);
  k.op(Opcode::kSub, 3, 2, 0);
  k.op(Opcode::kMul, 2, 2, 3);
  return k;
}

// `where` replaces the selections inside the eroded shape by masked writes.
TestProgram case_study(std::uint32_t size, bool where) {
  Kernel k(size);
  k.nine(Opcode::kMin, 0, 1);
  k.op(Opcode::kCopy, 2, 1);
  if (where) k.add(Opcode::kMaskPush, {}, k.registers[1]);
  for (int i = 0; i < 8; ++i) {
    k.four(Opcode::kMin, 2, 8);
    if (where) {
      k.add(Opcode::kAdd, k.registers[2], k.registers[8], k.lit(1));
    } else {
      k.op(Opcode::kAdd, 8, 8, 1.0F);
      k.select(2, 1, 8, 2);
    }
  }
  k.op(Opcode::kCopy, 3, 2);
  for (int i = 0; i < 16; ++i) {
    k.four(Opcode::kMax, 3, 8);
    if (where) {
      k.add(Opcode::kMax, k.registers[3], k.registers[8], k.registers[3]);
    } else {
      k.op(Opcode::kMax, 8, 8, 3);
      k.select(3, 1, 8, 3);
    }
  }
  if (where) k.add(Opcode::kMaskPop);
  k.op(Opcode::kGe, 8, 2, 3);
  k.op(Opcode::kMul, 8, 8, 1);
  k.nine(Opcode::kMax, 8, 7);
  k.op(Opcode::kMul, 9, 3, 7);
  return k;
}

// One iteration executes the program once, including the jump that closes its loop.
void measure(benchmark::State& state, TestProgram build, unsigned threads) {
  const auto instructions = static_cast<std::int64_t>(build.next_index());
  build.add(Opcode::kJump, {}, TestProgram::label(0));
  FakeHost host;
  apron::vm::VmOptions options;
  options.threads = threads;
  apron::vm::Vm vm(build.finish(), options, host);
  std::mt19937 rng(1);
  std::bernoulli_distribution inside(0.8);
  apron::vm::Plane image = vm.plane(0);
  for (std::uint32_t y = 0; y < image.height; ++y)
    for (std::uint32_t x = 0; x < image.width; ++x)
      image.row(y)[x] = (x / 12 + y / 12) % 3 != 0 || inside(rng) ? 1.0F : 0.0F;
  for (auto _ : state) {
    if (vm.run(static_cast<std::uint64_t>(instructions) + 1) != apron::vm::Status::kRunning)
      state.SkipWithError("");
  }
  state.counters["instructions"] = static_cast<double>(instructions);
  state.SetItemsProcessed(state.iterations() * instructions);
}

void Chain(benchmark::State& state) { measure(state, chain(static_cast<std::uint32_t>(state.range(0))), 1); }
void CaseStudy(benchmark::State& state) {
  measure(state, case_study(static_cast<std::uint32_t>(state.range(0)), false), 1);
}
void CaseStudyWhere(benchmark::State& state) {
  measure(state, case_study(static_cast<std::uint32_t>(state.range(0)), true), 1);
}
void CaseStudyTwoThreads(benchmark::State& state) {
  measure(state, case_study(static_cast<std::uint32_t>(state.range(0)), false), 2);
}

BENCHMARK(Chain)->RangeMultiplier(4)->Range(64, 1024)->Unit(benchmark::kMicrosecond);
BENCHMARK(CaseStudy)->RangeMultiplier(4)->Range(64, 1024)->Unit(benchmark::kMicrosecond);
BENCHMARK(CaseStudyWhere)->RangeMultiplier(4)->Range(64, 1024)->Unit(benchmark::kMicrosecond);
BENCHMARK(CaseStudyTwoThreads)
    ->RangeMultiplier(4)
    ->Range(64, 1024)
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime();

}  // namespace
