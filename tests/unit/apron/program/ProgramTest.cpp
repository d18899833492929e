// Verifier errors, disassembly and locality, on hand-written programs.
#include "apron/program/Program.h"

#include <gtest/gtest.h>

#include <functional>
#include <sstream>
#include <string>
#include <string_view>

#include "apron/program/LocalityCheck.h"
#include "apron/program/Reachability.h"

namespace apron::program {
namespace {

Operand reg(std::uint32_t index) { return {OperandKind::kRegister, index}; }
Operand var(std::uint32_t index) { return {OperandKind::kVariable, index}; }
Operand lit(std::uint32_t index) { return {OperandKind::kLiteral, index}; }
Operand txt(std::uint32_t index) { return {OperandKind::kText, index}; }
Operand label(std::uint32_t index) { return {OperandKind::kLabel, index}; }

Instruction make(Opcode op, Operand destination = {}, Operand a = {}, Operand b = {}, Operand c = {}) {
  Instruction instruction;
  instruction.op = op;
  instruction.destination = destination;
  instruction.operands = {a, b, c};
  return instruction;
}

// Registers 0 and 1 have one shape, register 2 another; the literals are 0, 1, 0.5.
Program with(std::vector<Instruction> code) {
  Program program;
  program.registers = {{"A", 4, 3}, {"B", 4, 3}, {"C", 2, 2}};
  program.variables = {{"x", 0.0F}, {"y", 0.0F}};
  program.literals = {0.0F, 1.0F, 0.5F};
  program.texts = {"gain", "height"};
  program.parameters = {{"gain", 0.0F, 0.0F, 1.0F}};
  program.files = {"p.aps"};
  program.source_locations = {{0, 7, 1}};
  program.code = std::move(code);
  program.code.push_back(make(Opcode::kEnd));
  return program;
}

TEST(Verify, AcceptsEachOperandKind) {
  EXPECT_EQ(verify(with({})), "");
  EXPECT_EQ(
      verify(with({make(Opcode::kAdd, reg(0), reg(0), lit(1)), make(Opcode::kAdd, var(0), var(1), lit(1)),
                   make(Opcode::kShift, reg(0), reg(1), lit(1), lit(0)), make(Opcode::kMaskPush, {}, reg(0)),
                   make(Opcode::kCopy, reg(1), lit(0)), make(Opcode::kMaskElse), make(Opcode::kMaskPop),
                   make(Opcode::kGlobalSum, var(0), reg(2)), make(Opcode::kParameter, var(0), txt(0)),
                   make(Opcode::kJumpLt, {}, var(0), lit(0), label(0))})),
      "");
}

TEST(Verify, RejectsInvalidOperands) {
  const std::string at = "instruction 0 ";
  EXPECT_EQ(verify(with({make(Opcode::kAdd, reg(9), reg(0), lit(0))})),
            at + "(add): the destination is out of range");
  EXPECT_EQ(verify(with({make(Opcode::kAdd, lit(0), reg(0), lit(0))})),
            at + "(add): the destination is not of kind 'D'");
  EXPECT_EQ(verify(with({make(Opcode::kAdd, reg(0), reg(0))})), at + "(add): operand 2 is not of kind 'x'");
  EXPECT_EQ(verify(with({make(Opcode::kAbs, reg(0), reg(0), reg(1))})),
            at + "(abs): operand 2 is not of kind '-'");
  EXPECT_EQ(verify(with({make(Opcode::kAdd, var(0), reg(0), lit(0))})),
            at + "(add): a register cannot go into a variable");
  EXPECT_EQ(verify(with({make(Opcode::kAdd, reg(0), reg(1), reg(2))})),
            at + "(add): its registers differ in shape");
  EXPECT_EQ(verify(with({make(Opcode::kCopy, reg(2), reg(1))})),
            at + "(copy): its registers differ in shape");
  EXPECT_EQ(verify(with({make(Opcode::kJump, {}, label(2))})), at + "(jump): operand 1 is out of range");
  EXPECT_EQ(verify(with({make(Opcode::kGlobalSum, reg(0), reg(1))})),
            at + "(globalsum): the destination is not of kind 'V'");
  EXPECT_EQ(verify(with({make(Opcode::kShift, reg(0), reg(0), lit(1), lit(0))})),
            at + "(shift): it is not out of place");
  EXPECT_EQ(verify(with({make(Opcode::kShift, reg(0), reg(1), lit(2), lit(0))})),
            at + "(shift): its offset is not whole");
  EXPECT_EQ(verify(with({make(Opcode::kRotate, reg(0), reg(1), lit(0), lit(2))})),
            at + "(rotate): its offset is not whole");
  EXPECT_EQ(verify(with({make(Opcode::kRotate, reg(0), reg(1), var(0), lit(0))})), "");
  EXPECT_EQ(verify(with({make(Opcode::kBoundary, {}, lit(2), lit(0))})),
            at + "(boundary): its rule is not a whole literal");
  EXPECT_EQ(verify(with({make(Opcode::kParameter, var(0), txt(1))})),
            at + "(parameter): no parameter is called 'height'");
}

TEST(Verify, RejectsInvalidPrograms) {
  Program program = with({});
  program.code.clear();
  EXPECT_EQ(verify(program), "the program has no instructions");
  program.code = {make(Opcode::kNop)};
  EXPECT_EQ(verify(program), "the program does not end with 'end'");
  program.code = {make(static_cast<Opcode>(250)), make(Opcode::kEnd)};
  EXPECT_EQ(verify(program), "instruction 0: unknown opcode");
  program = with({});
  program.registers[1].height = 0;
  EXPECT_EQ(verify(program), "register 'B' has no cells");
  program.registers[1] = {"B", 1U << 20U, 1U << 20U};
  EXPECT_EQ(verify(program), "register 'B' has more than 67108864 cells");
  program.registers.assign(40, {"B", 1U << 13U, 1U << 13U});
  EXPECT_EQ(verify(program), "the registers take more than 8589934592 bytes");
  program.registers.assign(1, {"B", 1, 1U << 26U});
  EXPECT_EQ(verify(program), "the registers take more than 8589934592 bytes")
      << "rows of a cell take 128 bytes";
  program = with({make(Opcode::kNop)});
  program.code[0].source_location = 3;
  EXPECT_EQ(verify(program), "instruction 0 (nop): its source is out of range");
}

TEST(Verify, TracksMasksAlongEveryPath) {
  const Instruction push = make(Opcode::kMaskPush, {}, reg(0));
  const Instruction pop = make(Opcode::kMaskPop);
  const Instruction turn = make(Opcode::kMaskElse);
  EXPECT_EQ(verify(with({pop})), "instruction 0 (mask.pop): no mask is open");
  EXPECT_EQ(verify(with({turn})), "instruction 0 (mask.else): no mask is open that it could turn round");
  EXPECT_EQ(verify(with({push, turn, turn, pop})),
            "instruction 2 (mask.else): no mask is open that it could turn round");
  // Only one path pushes.
  EXPECT_EQ(verify(with({make(Opcode::kJumpLt, {}, var(0), lit(0), label(2)), push, make(Opcode::kNop)})),
            "instruction 2 (nop): masks do not balance on every path to it");
  // A loop that pushes in every iteration.
  EXPECT_EQ(verify(with({push, make(Opcode::kJump, {}, label(0))})),
            "instruction 0 (mask.push): masks do not balance on every path to it");
  // Unreachable code is not checked.
  EXPECT_EQ(verify(with({make(Opcode::kJump, {}, label(2)), pop})), "");
  EXPECT_EQ(verify(with({push, make(Opcode::kReturn)})), "instruction 1 (return): a mask is still open");
  std::vector<Instruction> deep(kMaxMaskDepth, push);
  EXPECT_EQ(verify(with(deep)), "");
  deep.push_back(push);
  EXPECT_EQ(verify(with(deep)), "instruction 64 (mask.push): more than 64 masks are open");
}

TEST(Verify, MaskAndDestinationMustHaveTheSameShape) {
  const Instruction push = make(Opcode::kMaskPush, {}, reg(0));
  EXPECT_EQ(verify(with({push, make(Opcode::kCopy, reg(2), lit(0))})),
            "instruction 1 (copy): its destination differs in shape from the open mask");
  Instruction unmasked = make(Opcode::kCopy, reg(2), lit(0));
  unmasked.masked = false;
  EXPECT_EQ(verify(with({push, unmasked})), "");
  EXPECT_EQ(verify(with({push, make(Opcode::kMaskPush, {}, reg(2))})),
            "instruction 1 (mask.push): its shape differs from the open mask's");
  // Through a call.
  EXPECT_EQ(verify(with({push, make(Opcode::kCall, {}, label(4)), make(Opcode::kMaskPop), make(Opcode::kEnd),
                         make(Opcode::kCopy, reg(2), lit(0)), make(Opcode::kReturn)})),
            "instruction 4: the routine here is called under a mask of another shape");
}

TEST(Verify, AddsMasksOfRoutinesToThoseOfCallers) {
  const Instruction push = make(Opcode::kMaskPush, {}, reg(0));
  const Instruction pop = make(Opcode::kMaskPop);
  const Instruction back = make(Opcode::kReturn);
  EXPECT_EQ(verify(with({push, make(Opcode::kCall, {}, label(4)), pop, make(Opcode::kEnd), push, pop, back})),
            "");
  EXPECT_EQ(verify(with({make(Opcode::kCall, {}, label(2)), make(Opcode::kEnd), pop, back})),
            "instruction 2 (mask.pop): no mask is open");
  // A routine that calls itself inside its mask can open any number of masks.
  EXPECT_EQ(verify(with({make(Opcode::kCall, {}, label(2)), make(Opcode::kEnd), push,
                         make(Opcode::kCall, {}, label(2)), pop, back})),
            "instruction 2: calls from here may open more than 64 masks");
  EXPECT_EQ(verify(with({make(Opcode::kCall, {}, label(2)), make(Opcode::kEnd),
                         make(Opcode::kCall, {}, label(2)), back})),
            "");
}

TEST(Disassemble, PrintsOperandsAndSourceLocations) {
  const Program program =
      with({make(Opcode::kMac, reg(0), reg(1), lit(2), var(0)),
            make(Opcode::kJumpLe, {}, var(1), lit(1), label(0)), make(Opcode::kPrintText, {}, txt(1))});
  EXPECT_EQ(disassemble(program),
            "    0  mac             A, B, 0.5, x                     ; p.aps:7\n"
            "    1  jump.le         y, 1, @0                         ; p.aps:7\n"
            "    2  print.text      'height'                         ; p.aps:7\n"
            "    3  end                                              ; p.aps:7\n");
  EXPECT_EQ(disassemble(program, 1), "    1  jump.le         y, 1, @0                         ; p.aps:7");
}

TEST(Locality, ClassifiesShiftsByOffset) {
  Program program = with({});
  program.literals = {0.0F, 1.0F, -1.0F, 2.0F};
  const auto of = [&](std::uint32_t dx, std::uint32_t dy) {
    return locality(program, make(Opcode::kShift, reg(0), reg(1), lit(dx), lit(dy)));
  };
  EXPECT_EQ(of(1, 0), Locality::News);
  EXPECT_EQ(of(0, 2), Locality::News);
  EXPECT_EQ(of(0, 0), Locality::News);
  EXPECT_EQ(of(1, 2), Locality::Far);
  EXPECT_EQ(of(3, 0), Locality::Far);
  EXPECT_EQ(locality(program, make(Opcode::kAdd, reg(0), reg(1), lit(1))), Locality::Cell);
  EXPECT_EQ(locality(program, make(Opcode::kRotate, reg(0), reg(1), lit(1), lit(0))), Locality::Far);
}

TEST(Verify, RejectsInvalidNeighbourhoodsTablesAndClasses) {
  const auto wrong = [](Instruction instruction, const std::function<void(Program&)>& change = {}) {
    Program program = with({std::move(instruction)});
    program.filters = {{"k", 3, 1, {1, 2, 3}}};
    program.groups = {{"pe", false, {0, 1}}, {"n", true, {0}}};
    program.modules = {{"m", {}}};
    if (change) change(program);
    return verify(program);
  };
  const Operand filter{OperandKind::kFilter, 0}, no_filter{OperandKind::kFilter, 1};
  const Operand registers{OperandKind::kGroup, 0}, scalars{OperandKind::kGroup, 1};
  EXPECT_EQ(wrong(make(Opcode::kFilterDo, reg(0), reg(1), filter)), "");
  EXPECT_EQ(wrong(make(Opcode::kFilterDo, reg(0), reg(0), filter)),
            "instruction 0 (filter.do): it is not out of place");
  EXPECT_EQ(wrong(make(Opcode::kFilterDo, reg(0), reg(1), no_filter)),
            "instruction 0 (filter.do): operand 2 is out of range");
  EXPECT_EQ(wrong(make(Opcode::kFlood, reg(0), reg(1), reg(0))),
            "instruction 0 (flood): it is not out of place");
  EXPECT_EQ(wrong(make(Opcode::kFlood, reg(0), reg(1), reg(2))),
            "instruction 0 (flood): its registers differ in shape");
  EXPECT_EQ(wrong(make(Opcode::kNearSum, reg(0), reg(1), lit(1))),
            "instruction 0 (near.sum): its neighbourhood is not 4 or 8");
  EXPECT_EQ(wrong(make(Opcode::kNearSum, reg(0), reg(1), var(0))),
            "instruction 0 (near.sum): its neighbourhood is not a whole literal");
  EXPECT_EQ(wrong(make(Opcode::kResGetReg, reg(0), registers, var(0))), "");
  EXPECT_EQ(wrong(make(Opcode::kResGetReg, reg(0), scalars, var(0))),
            "instruction 0 (res.getreg): its class is of another kind");
  EXPECT_EQ(wrong(make(Opcode::kNop), [](Program& p) { p.groups[0].members.push_back(3); }),
            "the class 'pe' has an element out of range");
  EXPECT_EQ(wrong(make(Opcode::kNop), [](Program& p) { p.filters[0].width = 2; }),
            "the filter 'k' is not of 1x1 to 255x255 elements");
  EXPECT_EQ(wrong(make(Opcode::kPlugin, var(0), {OperandKind::kModule, 1}, lit(0))),
            "instruction 0 (plugin): operand 1 is out of range");
}

TEST(Verify, RejectsInvalidSourceLocationsAndExpansions) {
  const auto wrong = [](const std::function<void(Program&)>& change) {
    Program program = with({make(Opcode::kNop)});
    change(program);
    return verify(program);
  };
  EXPECT_EQ(wrong([](Program& p) {
              p.source_locations.push_back({99, 1, 1, 0});
            }),
            "a source names a file out of range");
  EXPECT_EQ(wrong([](Program& p) {
              p.source_locations.push_back({99, 0, 0, 0});
            }),
            "a source names a file out of range");
  EXPECT_EQ(wrong([](Program& p) {
              p.source_locations.push_back({0, 0, 0, 2});
            }),
            "a source names an expansion out of range");
  const auto expands = [](std::uint32_t within) {
    return [within](Program& p) { p.expansions = {{}, {"m", {0, 0, 0, within}}}; };
  };
  EXPECT_EQ(wrong(expands(0)), "");
  EXPECT_EQ(wrong(expands(1)), "an expansion's call is out of range");
  EXPECT_EQ(wrong(expands(7)), "an expansion's call is out of range");
}

TEST(Locality, ClassifiesFiltersBySize) {
  Program program =
      with({make(Opcode::kFilterDo, reg(0), reg(1), {OperandKind::kFilter, 0}),
            make(Opcode::kFilterDo, reg(0), reg(1), {OperandKind::kFilter, 1}),
            make(Opcode::kDistance, reg(0), reg(1)), make(Opcode::kNearSum, reg(0), reg(1), lit(1))});
  program.filters = {{"near", 3, 3, std::vector<float>(9)}, {"far", 5, 1, std::vector<float>(5)}};
  const std::vector<NonLocalInstruction> beyond = find_nonlocal_instructions(program);
  ASSERT_EQ(beyond.size(), 2U);
  EXPECT_EQ(beyond[0].reason, "a filter of 5x1 reaches beyond the neighbours");
  EXPECT_EQ(beyond[1].reason, "distance propagates through the array until nothing changes");
}

TEST(Locality, OpcodeSignaturesAreWellFormed) {
  for (std::size_t i = 0; i < opcode_count(); ++i) {
    const OpcodeInfo& one = opcode_info(static_cast<Opcode>(i));
    ASSERT_FALSE(one.signature.empty()) << one.mnemonic;
    EXPECT_NE(std::string("RVDIE-").find(one.signature.front()), std::string::npos) << one.mnemonic;
    EXPECT_LE(one.signature.size(), kMaxOperands + 1) << one.mnemonic;
    EXPECT_EQ(one.signature.substr(1).find_first_not_of("rasxtlkgm"), std::string_view::npos) << one.mnemonic;
  }
}

TEST(Reachability, FollowsJumpsCallsAndBothBranches) {
  const auto program = [](std::vector<Instruction> code) {
    Program p = with({});
    p.code = std::move(code);
    p.code.push_back(make(Opcode::kEnd));
    return p;
  };
  EXPECT_TRUE(can_reach(program({make(Opcode::kSurfaceStep)}), Opcode::kSurfaceStep));
  EXPECT_FALSE(can_reach(program({make(Opcode::kJump, {}, label(0)), make(Opcode::kSurfaceStep)}),
                         Opcode::kSurfaceStep));
  EXPECT_TRUE(
      can_reach(program({make(Opcode::kJumpLt, {}, var(0), var(0), label(0)), make(Opcode::kSurfaceStep)}),
                Opcode::kSurfaceStep));
  EXPECT_TRUE(
      can_reach(program({make(Opcode::kCall, {}, label(2)), make(Opcode::kEnd), make(Opcode::kSurfaceStep)}),
                Opcode::kSurfaceStep));
  EXPECT_FALSE(can_reach(program({make(Opcode::kReturn), make(Opcode::kSurfaceStep)}), Opcode::kSurfaceStep));
}

TEST(InstructionTable, HasALineForEachInstruction) {
  static constexpr std::string_view kReach[] = {"Cell", "News", "Far", "Global", "Control", "Host"};
  const std::string table = instruction_table();
  std::istringstream lines(table.substr(table.find("\n\n") + 2));
  std::string line, mnemonic, signature, reach, description;
  for (std::size_t i = 0; i < opcode_count(); ++i) {
    const OpcodeInfo& one = opcode_info(static_cast<Opcode>(i));
    ASSERT_TRUE(std::getline(lines, line)) << "the table ends before " << one.mnemonic;
    std::istringstream words(line);
    words >> mnemonic >> signature >> reach >> std::ws;
    std::getline(words, description);
    EXPECT_EQ(mnemonic, one.mnemonic);
    EXPECT_EQ(signature, one.signature);
    EXPECT_EQ(reach, kReach[static_cast<std::size_t>(one.locality)]);
    EXPECT_EQ(description, one.description);
  }
  EXPECT_FALSE(std::getline(lines, line)) << line;
}

}  // namespace
}  // namespace apron::program
