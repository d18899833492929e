#include "apron/debugger/Debugger.h"

#include <gtest/gtest.h>

#include "../vm/TestProgram.h"

namespace apron::vm::test {
namespace {

using debugger::Debugger;

// Lines 1 to 4: increment `count`, copy it to A, step the surface, loop.
TestProgram counting_program() {
  TestProgram b;
  const Operand v = b.var(), r = b.reg(2, 1);
  b.add(Opcode::kAdd, v, v, b.lit(1));
  b.add(Opcode::kCopy, r, v);
  b.add(Opcode::kSurfaceStep);
  b.add(Opcode::kJump, {}, TestProgram::label(0));
  b.program.variables[0] = {"count", 0.0F};
  b.program.registers[0] = {"A", 2, 1};
  return b;
}

TEST(Debugger, StepsRunsToLineAndInspectsByName) {
  FakeHost host;
  Vm vm(counting_program().finish(), {}, host);
  Debugger debugger(vm);
  EXPECT_EQ(debugger.position().line, 1U);
  EXPECT_EQ(debugger.position().file, "test.aps");
  EXPECT_EQ(debugger.step_instruction(), Status::kRunning);
  EXPECT_EQ(debugger.position().line, 2U);
  EXPECT_EQ(debugger.find_variable("count"), 1.0F);
  EXPECT_EQ(debugger.run_to_line("test.aps", 2), Status::kRunning);  // one iteration
  EXPECT_EQ(debugger.position().instruction, 1U);
  EXPECT_EQ(debugger.find_variable("count"), 2.0F);
  EXPECT_EQ(debugger.step_line(), Status::kRunning);
  EXPECT_EQ(debugger.position().line, 3U);
  ASSERT_TRUE(debugger.find_register("A"));
  EXPECT_EQ(Debugger::format_plane(*debugger.find_register("A")), "2 2\n");
  EXPECT_FALSE(debugger.find_register("B"));
  EXPECT_FALSE(debugger.find_variable("A"));
}

TEST(Debugger, RunsTicksAndRespectsBudget) {
  FakeHost host;
  Vm vm(counting_program().finish(), {}, host);
  Debugger debugger(vm);
  EXPECT_EQ(debugger.run_ticks(5), Status::kTick);
  EXPECT_EQ(host.step_count, 5);
  EXPECT_EQ(debugger.run_to_line("test.aps", 99, 10), Status::kRunning);
  host.step_status = HostStatus::kClosed;
  EXPECT_EQ(debugger.run_to_line("test.aps", 99), Status::kClosed);
}

}  // namespace
}  // namespace apron::vm::test
