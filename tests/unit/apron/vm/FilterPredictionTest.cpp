#include "apron/vm/fusion/FilterPrediction.h"

#include <gtest/gtest.h>

#include "apron/vm/PlaneStore.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

class FilterPrediction : public testing::Test, protected TestProgram {
 protected:
  FilterPrediction() { program.filters.push_back({"f", 3, 1, {0, 0, 0}}); }

  vm::FilterPrediction predict() {
    const program::Program finished = finish();
    RegisterFile registers;
    PlaneStore planes;
    for (const program::Register& r : finished.registers)
      registers.registers.push_back(planes.allocate(r.width, r.height));
    for (const program::Variable& v : finished.variables) registers.scalars.push_back(v.initial_value);
    registers.scalars.insert(registers.scalars.end(), finished.literals.begin(), finished.literals.end());
    std::vector<DecodedInstruction> decoded;
    for (const program::Instruction& instruction : finished.code)
      decoded.push_back(decode(finished, instruction, registers, *kernel_tables().front().table));
    return {finished, decoded, registers};
  }

  const Operand filter_{OperandKind::kFilter, 0};
};

// A loop sets each element to its index plus one half, then the main loop runs forever.
TEST_F(FilterPrediction, FollowsLoopsOfKnownLength) {
  const Operand i = var();
  const std::size_t top = add(Opcode::kUnlessLt, {}, i, lit(3), label(0));
  const Operand value = var();
  add(Opcode::kAdd, value, i, lit(0.5F));
  add(Opcode::kFilterSet, {}, filter_, i, value);
  add(Opcode::kAdd, i, i, lit(1));
  add(Opcode::kJump, {}, label(top));
  program.code[top].operands[2] = label(next_index());
  const std::size_t forever = next_index();
  add(Opcode::kSurfaceStep);
  add(Opcode::kJump, {}, label(forever));
  const vm::FilterPrediction prediction = predict();
  ASSERT_NE(prediction.find(0), nullptr);
  EXPECT_EQ(prediction.find(0)->coefficients, (std::vector<float>{0.5F, 1.5F, 2.5F}));
}

TEST_F(FilterPrediction, KnowsNothingOfValuesFromArrays) {
  const Operand a = reg(4, 4), sum = var();
  add(Opcode::kGlobalSum, sum, a);
  add(Opcode::kFilterSet, {}, filter_, lit(1), sum);
  EXPECT_EQ(predict().find(0), nullptr);
}

// What follows a branch on an unknown value is not executed.
TEST_F(FilterPrediction, StopsAtUnknownBranches) {
  const Operand a = reg(4, 4), sum = var();
  add(Opcode::kFilterSet, {}, filter_, lit(0), lit(2));
  add(Opcode::kGlobalSum, sum, a);
  const std::size_t branch = add(Opcode::kUnlessLt, {}, sum, lit(3), label(0));
  add(Opcode::kFilterSet, {}, filter_, lit(0), lit(9));
  program.code[branch].operands[2] = label(next_index());
  EXPECT_EQ(predict().find(0)->coefficients, (std::vector<float>{2, 0, 0}));
}

}  // namespace
}  // namespace apron::vm::test
