// Every element-wise opcode, on every instruction set, against a scalar reference.
#include <gtest/gtest.h>

#include "TestProgram.h"
#include "apron/program/Mathematics.h"
#include "apron/program/ScalarArithmetic.h"

namespace apron::vm::test {
namespace {

// Written from opcodes.def, independently of the VM's implementation.
float reference_value(Opcode op, float a, float b, float c) {
  const auto truth = [](float v) { return v < 0.0F || v > 0.0F || std::isnan(v); };
  switch (op) {
    case Opcode::kCopy:
      return a;
    case Opcode::kAdd:
      return a + b;
    case Opcode::kSub:
      return a - b;
    case Opcode::kMul:
      return a * b;
    case Opcode::kDiv:
      return a / b;
    case Opcode::kMod: {
      const float quotient = std::floor(a / b);
      const float multiple = b * quotient;
      return a - multiple;
    }
    case Opcode::kMin:
      return a < b ? a : b;
    case Opcode::kMax:
      return a > b ? a : b;
    case Opcode::kAbs:
      return std::signbit(a) ? -a : a;
    case Opcode::kNeg:
      return -a;
    case Opcode::kSign:
      return a > 0 ? 1.0F : a < 0 ? -1.0F : 0.0F;
    case Opcode::kClamp: {
      const float below = c < a ? c : a;
      return b > below ? b : below;
    }
    case Opcode::kMac: {
      const float product = a * b;
      return c + product;
    }
    case Opcode::kSelect:
      return truth(a) ? b : c;
    case Opcode::kLt:
      return a < b;
    case Opcode::kLe:
      return a <= b;
    case Opcode::kGt:
      return a > b;
    case Opcode::kGe:
      return a >= b;
    case Opcode::kEq:
      return a == b;
    case Opcode::kNe:
      return a != b;
    case Opcode::kAnd:
      return truth(a) && truth(b);
    case Opcode::kOr:
      return truth(a) || truth(b);
    case Opcode::kXor:
      return truth(a) != truth(b);
    case Opcode::kNand:
      return !truth(a) || !truth(b);
    case Opcode::kNor:
      return !truth(a) && !truth(b);
    case Opcode::kNot:
      return !truth(a);
    case Opcode::kSqrt:
      return std::sqrt(a);
    case Opcode::kFloor:
      return std::floor(a);
    case Opcode::kCeil:
      return std::ceil(a);
    case Opcode::kRound:
      return std::round(a);
    default:  // MathematicsTest compares these with the C library's
      if (program::is_mathematics(op)) return program::evaluate_mathematics(op, a, b);
      ADD_FAILURE() << "no definition of " << program::opcode_info(op).mnemonic;
      return NAN;
  }
}

std::vector<Opcode> elementwise_opcodes() {
  std::vector<Opcode> all;
  for (std::size_t i = 0; i < program::opcode_count(); ++i) {
    const auto op = static_cast<Opcode>(i);
    const std::string_view signature = program::opcode_info(op).signature;
    if (signature[0] == 'D') all.push_back(op);
  }
  return all;
}

struct Case {
  Opcode op;
  Size size;
  unsigned scalars;  // bit k: operand k is a scalar
  bool masked;
  bool in_place;
};

void check(const Case& c, const NamedKernelTable& target, std::mt19937& rng) {
  const std::size_t arity = program::opcode_info(c.op).signature.size() - 1;
  const std::size_t n = std::size_t{c.size.width} * c.size.height;
  TestProgram b;
  const Operand mask = b.reg(c.size.width, c.size.height);
  Operand y = b.reg(c.size.width, c.size.height);
  std::array<Operand, 3> source{};
  std::array<Cells, 3> value;
  for (std::size_t k = 0; k < arity; ++k) {
    value[k] = random_cells(n, rng);
    if ((c.scalars >> k & 1U) != 0) {
      value[k].assign(n, value[k][0]);
      source[k] = k == 1 ? b.lit(value[k][0]) : b.var(value[k][0]);
    } else {
      source[k] = b.reg(c.size.width, c.size.height);
      if (c.in_place) y = source[k];
    }
  }
  if (c.masked) b.add(Opcode::kMaskOn, {}, mask);
  b.add(c.op, y, source[0], source[1], source[2]);

  FakeHost host;
  VmOptions options;
  options.kernels = target.table;
  Vm vm(b.finish(), options, host);
  const Cells active = c.masked ? random_mask(n, rng) : Cells(n, 1.0F);
  write_cells(vm.plane(mask.index), active);
  write_cells(vm.plane(y.index), random_cells(n, rng));
  for (std::size_t k = 0; k < arity; ++k)
    if (source[k].kind == OperandKind::kRegister) write_cells(vm.plane(source[k].index), value[k]);
  const Cells before = read_cells(vm.plane(y.index));
  ASSERT_EQ(vm.run(), Status::kEnded);
  const Cells after = read_cells(vm.plane(y.index));
  const auto at = [&](std::size_t k, std::size_t i) { return k < arity ? value[k][i] : 0.0F; };
  for (std::size_t i = 0; i < n; ++i) {
    const float want = active[i] != 0 ? reference_value(c.op, at(0, i), at(1, i), at(2, i)) : before[i];
    ASSERT_TRUE(bits_equal(after[i], want))
        << target.name << " " << program::opcode_info(c.op).mnemonic << " scalars " << c.scalars << " masked "
        << c.masked << " " << c.size.width << "x" << c.size.height << " cell " << i << ": " << after[i]
        << ", not " << want << " of " << at(0, i) << ", " << at(1, i) << ", " << at(2, i);
  }
}

TEST(Elementwise, RegistersMatchReferenceOnEveryTarget) {
  std::mt19937 rng(1 + first_program_seed());
  ASSERT_GE(kernel_tables().size(), 1U);
  std::size_t checked = 0;
  for (const NamedKernelTable& target : kernel_tables())
    for (const Opcode op : elementwise_opcodes()) {
      const std::size_t arity = program::opcode_info(op).signature.size() - 1;
      for (unsigned scalars = 0; scalars < 1U << arity; ++scalars)
        for (const Size size : kSizes)
          for (const bool masked : {false, true}) {
            check({op, size, scalars, masked, false}, target, rng);
            check({op, size, scalars, masked, true}, target, rng);
            if (HasFatalFailure()) return;
            checked += 2;
          }
    }
  count_cases(checked);
}

TEST(Elementwise, VariablesMatchReference) {
  std::mt19937 rng(2 + first_program_seed());
  for (const Opcode op : elementwise_opcodes()) {
    const Cells values = random_cells(300, rng);
    for (std::size_t i = 0; i + 2 < values.size(); i += 3) {
      TestProgram b;
      const std::size_t arity = program::opcode_info(op).signature.size() - 1;
      const Operand y = b.var();
      b.add(op, y, b.var(values[i]), arity > 1 ? b.lit(values[i + 1]) : Operand{},
            arity > 2 ? b.var(values[i + 2]) : Operand{});
      FakeHost host;
      Vm vm(b.finish(), {}, host);
      ASSERT_EQ(vm.run(), Status::kEnded);
      const float want = reference_value(op, values[i], values[i + 1], values[i + 2]);
      ASSERT_TRUE(bits_equal(vm.variable(y.index), want)) << program::opcode_info(op).mnemonic << " " << want;
    }
  }
}

}  // namespace
}  // namespace apron::vm::test
