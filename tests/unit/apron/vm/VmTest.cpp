// Control flow, calls, errors, the host interface, interruption, and independence of the number of threads.
#include <gtest/gtest.h>

#include "TestProgram.h"
#include "apron/vm/NumberFormat.h"

namespace apron::vm::test {
namespace {

TEST(Flow, ConditionalJumpsIncludingNaN) {
  const struct {
    Opcode op;
    bool less, equal, greater, nan;
  } kCases[] = {{Opcode::kJumpLt, true, false, false, false}, {Opcode::kJumpLe, true, true, false, false},
                {Opcode::kJumpGt, false, false, true, false}, {Opcode::kJumpGe, false, true, true, false},
                {Opcode::kJumpEq, false, true, false, false}, {Opcode::kJumpNe, true, false, true, true},
                {Opcode::kUnlessLt, false, true, true, true}, {Opcode::kUnlessLe, false, false, true, true},
                {Opcode::kUnlessGt, true, true, false, true}, {Opcode::kUnlessGe, true, false, false, true}};
  const auto jumps = [](Opcode op, float x, float y) {
    TestProgram b;
    const Operand stayed = b.var();
    b.add(op, {}, b.lit(x), b.lit(y), TestProgram::label(2));
    b.add(Opcode::kCopy, stayed, b.lit(1));
    FakeHost host;
    Vm vm(b.finish(), {}, host);
    EXPECT_EQ(vm.run(), Status::kEnded);
    return vm.variable(stayed.index) == 0.0F;
  };
  for (const auto& c : kCases) {
    EXPECT_EQ(jumps(c.op, 1, 2), c.less) << program::opcode_info(c.op).mnemonic;
    EXPECT_EQ(jumps(c.op, 2, 2), c.equal) << program::opcode_info(c.op).mnemonic;
    EXPECT_EQ(jumps(c.op, 3, 2), c.greater) << program::opcode_info(c.op).mnemonic;
    EXPECT_EQ(jumps(c.op, NAN, 2), c.nan) << program::opcode_info(c.op).mnemonic;
  }
}

TEST(Flow, CallReturnsToNextInstruction) {
  TestProgram b;
  const Operand v = b.var();
  b.add(Opcode::kCall, {}, TestProgram::label(4));  // 0
  b.add(Opcode::kMul, v, v, b.lit(10));             // 1
  b.add(Opcode::kCall, {}, TestProgram::label(4));  // 2
  b.add(Opcode::kEnd);                              // 3
  b.add(Opcode::kAdd, v, v, b.lit(1));              // 4
  b.add(Opcode::kReturn);                           // 5
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  EXPECT_EQ(vm.run(), Status::kEnded);
  EXPECT_EQ(vm.variable(v.index), 11.0F);
}

TEST(Flow, ReturnOutsideCallEndsProgram) {
  TestProgram b;
  const Operand v = b.var();
  b.add(Opcode::kReturn);
  b.add(Opcode::kCopy, v, b.lit(1));
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  EXPECT_EQ(vm.run(), Status::kEnded);
  EXPECT_EQ(vm.variable(v.index), 0.0F);
}

TEST(Flow, InfiniteRecursionFails) {
  TestProgram b;
  b.add(Opcode::kNop);
  b.add(Opcode::kCall, {}, TestProgram::label(1));
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  EXPECT_EQ(vm.run(), Status::kFailed);
  EXPECT_EQ(vm.error(),
            "test.aps:2: error: calls are nested more than 256 deep: does a routine call itself?");
  EXPECT_EQ(vm.run(), Status::kFailed);
}

TEST(Flow, WhereInInfiniteRecursionFails) {
  TestProgram b;
  const Operand m = b.reg(3, 3);
  b.add(Opcode::kMaskPush, {}, m);
  b.add(Opcode::kCall, {}, TestProgram::label(0));
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  EXPECT_EQ(vm.run(), Status::kFailed);
  EXPECT_EQ(vm.error(), "test.aps:1: error: where is nested more than 64 deep");
}

TEST(Flow, BudgetStopsAndResumes) {
  TestProgram b;
  const Operand v = b.var();
  b.add(Opcode::kAdd, v, v, b.lit(1));
  b.add(Opcode::kJump, {}, TestProgram::label(0));
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  EXPECT_EQ(vm.run(5), Status::kRunning);
  EXPECT_EQ(vm.variable(v.index), 3.0F);
  EXPECT_EQ(vm.program_counter(), 1U);
  EXPECT_EQ(vm.run(1), Status::kRunning);
  EXPECT_EQ(vm.program_counter(), 0U);
  EXPECT_EQ(vm.instructions_executed(), 6U);
}

TEST(Flow, StopFlagInterruptsInfiniteLoop) {
  TestProgram b;
  b.add(Opcode::kJump, {}, TestProgram::label(0));
  FakeHost host;
  std::atomic<bool> stop{false};
  VmOptions options;
  options.stop = &stop;
  Vm vm(b.finish(), options, host);
  EXPECT_EQ(vm.run(1000), Status::kRunning);
  std::thread other([&] { stop = true; });
  EXPECT_EQ(vm.run(), Status::kInterrupted);
  other.join();
}

TEST(Pixel, ReadsAndWritesAndRejectsOutOfBounds) {
  TestProgram b;
  const Operand v = b.var(), a = b.reg(3, 2), x = b.var(2), y = b.var(1);
  b.add(Opcode::kPixelSet, a, x, y, b.lit(5));
  b.add(Opcode::kPixelGet, v, a, x, y);
  b.add(Opcode::kPixelGet, v, a, b.lit(3), y);
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  EXPECT_EQ(vm.run(), Status::kFailed);
  EXPECT_EQ(vm.variable(v.index), 5.0F);
  EXPECT_EQ(read_cells(vm.plane(a.index)), (Cells{0, 0, 0, 0, 0, 5}));
  EXPECT_EQ(vm.error(), "test.aps:3: error: pixel.get at column 3, row 1 is outside a register of 3x2");
  for (const float bad : {-1.0F, 2.0F, NAN, INFINITY}) {
    TestProgram c;
    const Operand r = c.reg(3, 2);
    c.add(Opcode::kPixelSet, r, c.lit(0), c.lit(bad), c.lit(1));
    Vm other(c.finish(), {}, host);
    EXPECT_EQ(other.run(), Status::kFailed) << bad;
  }
}

TEST(Host, PrintsTextNumbersAndRegisters) {
  TestProgram b;
  const Operand a = b.reg(2, 2);
  b.add(Opcode::kPrintText, {}, b.text("v = "));
  b.add(Opcode::kPrintValue, {}, b.lit(0.1F));
  b.add(Opcode::kPrintLine);
  b.add(Opcode::kPrintValue, {}, a);
  b.add(Opcode::kPrintLine);
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  write_cells(vm.plane(a.index), {1, -2.5F, NAN, 1e6F});
  EXPECT_EQ(vm.run(), Status::kEnded);
  EXPECT_EQ(host.console, "v = 0.1\n1 -2.5\nnan 1000000\n");
}

TEST(Host, NumberFormatRoundTrips) {
  EXPECT_EQ(format_number(0.1F), "0.1");
  EXPECT_EQ(format_number(-3.0F), "-3");
  EXPECT_EQ(format_number(1e20F), "1e+20");
  EXPECT_EQ(format_number(0.001F), "0.001");
  EXPECT_EQ(format_number(-INFINITY), "-inf");
  EXPECT_EQ(format_number(-NAN), "nan");
  for (const float v : {1.0F / 3.0F, 16777216.0F, 1.17549435e-38F, 3.4028235e38F, 123456.789F})
    EXPECT_EQ(std::stof(format_number(v)), v);
}

TEST(Host, ParametersFallBackToDefault) {
  TestProgram b;
  const Operand speed = b.var(), gain = b.var();
  b.program.parameters = {{"speed", 2.5F, 0, 10}, {"gain", 1.0F, 0, 1}};
  b.add(Opcode::kParameter, speed, b.text("speed"));
  b.add(Opcode::kParameter, gain, b.text("gain"));
  FakeHost host;
  host.parameters["gain"] = 0.25F;
  Vm vm(b.finish(), {}, host);
  EXPECT_EQ(vm.run(), Status::kEnded);
  EXPECT_EQ(vm.variable(speed.index), 2.5F);
  EXPECT_EQ(vm.variable(gain.index), 0.25F);
}

TEST(Host, SurfaceLoopReturnsAfterEachTick) {
  TestProgram b;
  const Operand d = b.reg(2, 1), time = b.var(), dt = b.var(), tick = b.var(), has = b.var(),
                has_not = b.var();
  b.add(Opcode::kSurfaceHas, has, b.text("proximity"));
  b.add(Opcode::kSurfaceHas, has_not, b.text("pressure"));
  const std::size_t loop = b.next_index();
  b.add(Opcode::kSurfaceSense, d, b.text("proximity"));
  b.add(Opcode::kAdd, d, d, b.lit(1));
  b.add(Opcode::kSurfaceActuate, {}, b.text("height"), d);
  b.add(Opcode::kSurfaceActuate, {}, b.text("speed"), b.lit(3));
  b.add(Opcode::kSurfaceStep);
  b.add(Opcode::kSurfaceTime, time);
  b.add(Opcode::kSurfaceDt, dt);
  b.add(Opcode::kSurfaceTick, tick);
  b.add(Opcode::kJump, {}, TestProgram::label(loop));
  FakeHost host;
  host.sensors["proximity"] = {4, 6};
  Vm vm(b.finish(), {}, host);
  EXPECT_EQ(vm.run(), Status::kTick);
  EXPECT_EQ(host.step_count, 1);
  EXPECT_EQ(host.actuators["height"], (Cells{5, 7}));
  EXPECT_EQ(host.actuators["speed"], (Cells{3}));
  EXPECT_EQ(vm.run(), Status::kTick);
  EXPECT_EQ(vm.variable(time.index), 0.5F);
  EXPECT_EQ(vm.variable(dt.index), 0.5F);
  EXPECT_EQ(vm.variable(tick.index), 1.0F);
  EXPECT_EQ(vm.variable(has.index), 1.0F);
  EXPECT_EQ(vm.variable(has_not.index), 0.0F);
  for (const auto& [given, want] : {std::pair{HostStatus::kInterrupted, Status::kInterrupted},
                                    std::pair{HostStatus::kClosed, Status::kClosed}}) {
    host.step_status = given;
    EXPECT_EQ(vm.run(), want);
  }
}

TEST(Host, RefusalReportsSourceLocation) {
  TestProgram b;
  const Operand d = b.reg(2, 1);
  b.add(Opcode::kNop);
  b.add(Opcode::kSurfaceSense, d, b.text("smell"));
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  EXPECT_EQ(vm.run(), Status::kRefused);
  EXPECT_EQ(vm.error(), "test.aps:2: error: no channel smell");
}

// Runs a short random program on random data (long programs converge to constants) and returns all cells.
// They must be bit-identical for any number of threads and instruction set.
Cells run_random(unsigned seed, unsigned threads, const KernelTable* kernels) {
  const Size size{100, 37};
  std::mt19937 rng(seed);
  TestProgram b;
  std::vector<Operand> r;
  for (int i = 0; i < 6; ++i) r.push_back(b.reg(size.width, size.height));
  const Operand mask = b.reg(size.width, size.height), v = b.var(0.75F);
  const Opcode kOps[] = {Opcode::kAdd, Opcode::kSub, Opcode::kMul,    Opcode::kMin, Opcode::kMax,
                         Opcode::kLt,  Opcode::kMac, Opcode::kSelect, Opcode::kSin, Opcode::kXor};
  for (int i = 0; i < 24; ++i) {
    const Operand y = r[rng() % 6], a = r[rng() % 6], c = r[rng() % 6];
    const Opcode op = kOps[rng() % std::size(kOps)];
    const std::size_t arity = program::opcode_info(op).signature.size() - 1;
    b.add(op, y, a, arity > 1 ? (rng() % 2 ? c : v) : Operand{}, arity > 2 ? r[rng() % 6] : Operand{});
    if (i % 5 == 0 && y != a) b.add(Opcode::kShift, y, a, b.lit(static_cast<float>(i % 7 - 3)), b.lit(1));
    if (i % 11 == 7) b.add(Opcode::kGlobalMean, v, y);
    if (i == 4) b.add(Opcode::kMaskOn, {}, mask);
    if (i == 8) b.add(Opcode::kMaskPush, {}, a);
    if (i == 14) b.add(Opcode::kMaskElse);
    if (i == 18) b.add(Opcode::kMaskPop);
  }
  FakeHost host;
  VmOptions options;
  options.threads = threads;
  options.parallel_cells = 1;
  options.kernels = kernels;
  Vm vm(b.finish(), options, host);
  std::mt19937 data(seed + 1000);
  std::uniform_real_distribution<float> real(-2, 2);
  const std::size_t n = std::size_t{size.width} * size.height;
  for (const Operand& o : r) {
    Cells cells(n);
    for (float& c : cells) c = std::max(real(data), 0.0F);  // half are zero
    write_cells(vm.plane(o.index), cells);
  }
  write_cells(vm.plane(mask.index), random_mask(n, data));
  EXPECT_EQ(vm.run(), Status::kEnded);
  Cells all;
  for (const Operand& o : r) {
    const Cells cells = read_cells(vm.plane(o.index));
    all.insert(all.end(), cells.begin(), cells.end());
  }
  return all;
}

TEST(Threads, ResultsAreBitIdentical) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Cells one = run_random(seed, 1, nullptr);
    const auto expect_same = [&](const Cells& other, std::string_view what) {
      ASSERT_EQ(one.size(), other.size());
      for (std::size_t i = 0; i < one.size(); ++i)
        ASSERT_TRUE(bits_equal(one[i], other[i])) << what << " seed " << seed << " cell " << i;
    };
    expect_same(run_random(seed, 2, nullptr), "two threads");
    expect_same(run_random(seed, 3, nullptr), "three threads");
    for (const NamedKernelTable& target : kernel_tables())
      expect_same(run_random(seed, 2, target.table), target.name);
    if (HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace apron::vm::test
