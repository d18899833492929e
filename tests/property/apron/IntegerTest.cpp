// Random programs on registers of int32, uint16 and uint8 against an interpreter that computes one cell at a
// time in 64 bits: for each instruction set, fused and not, with and without generated code, for any number
// of threads.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

using program::BoundaryRule;
using program::CellType;

constexpr CellType kIntegers[] = {CellType::kUint8, CellType::kUint16, CellType::kInt32};

// The value modulo 2^n.
double wrap(CellType type, std::int64_t value) {
  const int bits = static_cast<int>(8 * program::cell_bytes(type));
  const std::int64_t modulus = std::int64_t{1} << bits;
  std::int64_t rest = ((value % modulus) + modulus) % modulus;
  if (type == CellType::kInt32 && rest >= modulus / 2) rest -= modulus;
  return static_cast<double>(rest);
}

double limit(CellType type, double value) {
  return std::min(std::max(value, program::lowest_cell(type)), program::highest_cell(type));
}

// ---- the interpreter ----

struct Reference {
  const program::Program& program;
  std::vector<std::vector<double>> cells;
  std::vector<double> variables;
  std::vector<std::vector<bool>> masks;
  std::vector<bool> base;
  BoundaryRule rule = BoundaryRule::kZero;
  double boundary = 0.0;

  const program::Register& reg(const Operand& o) const { return program.registers[o.index]; }
  double scalar(const Operand& o) const {
    return o.kind == OperandKind::kLiteral ? program.literals[o.index] : variables[o.index];
  }
  double value(const Operand& o, std::size_t cell) const {
    return o.kind == OperandKind::kRegister ? cells[o.index][cell]
           : o.kind == OperandKind::kNone   ? 0.0
                                            : scalar(o);
  }
  bool is_active(const program::Instruction& in, std::size_t cell) const {
    if (!in.masked) return true;
    return (base.empty() || base[cell]) && (masks.empty() || masks.back()[cell]);
  }

  double shifted(const Operand& from, std::int64_t x, std::int64_t y) const {
    const std::int64_t w = reg(from).width, h = reg(from).height;
    const auto resolve = [&](std::int64_t i, std::int64_t n) -> std::int64_t {
      if (i >= 0 && i < n) return i;
      if (rule == BoundaryRule::kReplicate) return i < 0 ? 0 : n - 1;
      if (rule == BoundaryRule::kWrap) return ((i % n) + n) % n;
      if (rule != BoundaryRule::kReflect) return -1;
      while (i < 0 || i >= n) i = n == 1 ? 0 : i < 0 ? -i : 2 * (n - 1) - i;
      return i;
    };
    const std::int64_t column = resolve(x, w), row = resolve(y, h);
    if (column < 0 || row < 0) return rule == BoundaryRule::kValue ? boundary : 0.0;
    return cells[from.index][static_cast<std::size_t>(row * w + column)];
  }

  double near(const program::Instruction& in, CellType type, std::int64_t x, std::int64_t y) const {
    std::vector<double> all;
    for (int dy = -1; dy <= 1; ++dy)
      for (int dx = -1; dx <= 1; ++dx)
        if ((dx != 0 || dy != 0) && (scalar(in.operands[1]) == 8.0 || dx == 0 || dy == 0))
          all.push_back(shifted(in.operands[0], x + dx, y + dy));
    switch (in.op) {
      case Opcode::kNearMin:
        return *std::ranges::min_element(all);
      case Opcode::kNearMax:
        return *std::ranges::max_element(all);
      case Opcode::kNearAny:
        return std::ranges::any_of(all, [](double v) { return v != 0.0; }) ? 1.0 : 0.0;
      case Opcode::kNearAll:
        return std::ranges::all_of(all, [](double v) { return v != 0.0; }) ? 1.0 : 0.0;
      default: {
        double sum = 0.0;
        for (const double v : all) sum += v;
        return wrap(type, static_cast<std::int64_t>(sum));
      }
    }
  }

  static double elementwise(Opcode op, CellType type, double x, double y, double z) {
    const auto a = static_cast<std::int64_t>(x), b = static_cast<std::int64_t>(y),
               c = static_cast<std::int64_t>(z);
    const std::int64_t bits = 8 * static_cast<std::int64_t>(program::cell_bytes(type));
    const auto truth = [](bool t) { return t ? 1.0 : 0.0; };
    switch (op) {
      case Opcode::kCopy:
        return x;
      case Opcode::kAdd:
        return wrap(type, a + b);
      case Opcode::kSub:
        return wrap(type, a - b);
      case Opcode::kMul:
        return wrap(type, a * b);
      case Opcode::kDiv:
        return b == 0 ? 0.0 : wrap(type, a / b);
      case Opcode::kMod:
        return b == 0 ? x : wrap(type, a % b);
      case Opcode::kMin:
        return std::min(x, y);
      case Opcode::kMax:
        return std::max(x, y);
      case Opcode::kAbs:
        return wrap(type, a < 0 ? -a : a);
      case Opcode::kNeg:
        return wrap(type, -a);
      case Opcode::kSign:
        return wrap(type, (a > 0 ? 1 : 0) - (a < 0 ? 1 : 0));
      case Opcode::kClamp:
        return std::max(y, std::min(z, x));
      case Opcode::kMac:
        return wrap(type, c + static_cast<std::int64_t>(wrap(type, a * b)));
      case Opcode::kSelect:
        return a != 0 ? y : z;
      case Opcode::kLt:
        return truth(a < b);
      case Opcode::kLe:
        return truth(a <= b);
      case Opcode::kGt:
        return truth(a > b);
      case Opcode::kGe:
        return truth(a >= b);
      case Opcode::kEq:
        return truth(a == b);
      case Opcode::kNe:
        return truth(a != b);
      case Opcode::kAnd:
        return truth(a != 0 && b != 0);
      case Opcode::kOr:
        return truth(a != 0 || b != 0);
      case Opcode::kXor:
        return truth((a != 0) != (b != 0));
      case Opcode::kNand:
        return truth(a == 0 || b == 0);
      case Opcode::kNor:
        return truth(a == 0 && b == 0);
      case Opcode::kNot:
        return truth(a == 0);
      case Opcode::kBitAnd:
        return wrap(type, a & b);
      case Opcode::kBitOr:
        return wrap(type, a | b);
      case Opcode::kBitXor:
        return wrap(type, a ^ b);
      case Opcode::kBitNot:
        return wrap(type, ~a);
      case Opcode::kBitLeft:
        return b < 0 || b >= bits ? 0.0 : wrap(type, a * (std::int64_t{1} << b));
      case Opcode::kBitRight:
        return b < 0 || b >= bits ? (a < 0 ? -1.0 : 0.0) : static_cast<double>(a >> b);
      case Opcode::kAddSaturated:
        return limit(type, x + y);
      case Opcode::kSubSaturated:
        return limit(type, x - y);
      default:
        ADD_FAILURE() << "an opcode without a value";
        return 0.0;
    }
  }

  static double convert(CellType from, CellType to, bool saturated, double x) {
    if (!program::is_integer(to)) return static_cast<double>(static_cast<float>(x));
    if (!program::is_integer(from)) return std::isnan(x) ? 0.0 : limit(to, std::trunc(x));
    return saturated ? limit(to, x) : wrap(to, static_cast<std::int64_t>(x));
  }

  void run() {
    for (const program::Instruction& in : program.code) execute(in);
  }

  void execute(const program::Instruction& in) {
    const auto truths = [&](const Operand& o) {
      std::vector<bool> all;
      for (const double v : cells[o.index]) all.push_back(v != 0.0);
      return all;
    };
    switch (in.op) {
      case Opcode::kEnd:
        return;
      case Opcode::kBoundary:
        rule = static_cast<BoundaryRule>(scalar(in.operands[0]));
        boundary = scalar(in.operands[1]);
        return;
      case Opcode::kMaskOn:
        base = truths(in.operands[0]);
        return;
      case Opcode::kMaskOff:
        base.clear();
        return;
      case Opcode::kMaskPush: {
        std::vector<bool> mask = truths(in.operands[0]);
        for (std::size_t i = 0; i < mask.size() && !masks.empty(); ++i) mask[i] = mask[i] && masks.back()[i];
        masks.push_back(mask);
        return;
      }
      case Opcode::kMaskElse:
        for (std::size_t i = 0; i < masks.back().size(); ++i)
          masks.back()[i] = !masks.back()[i] && (masks.size() < 2 || masks[masks.size() - 2][i]);
        return;
      case Opcode::kMaskPop:
        masks.pop_back();
        return;
      default:
        break;
    }
    if (in.destination.kind == OperandKind::kVariable) return reduce(in);
    const program::Register& to = reg(in.destination);
    std::vector<double> result = cells[in.destination.index];
    for (std::size_t i = 0; i < result.size(); ++i) {
      const auto x = static_cast<std::int64_t>(i % to.width), y = static_cast<std::int64_t>(i / to.width);
      if (!is_active(in, i)) continue;
      if (in.op == Opcode::kShift)
        result[i] = shifted(in.operands[0], x - static_cast<std::int64_t>(scalar(in.operands[1])),
                            y - static_cast<std::int64_t>(scalar(in.operands[2])));
      else if (in.op >= Opcode::kNearSum && in.op <= Opcode::kNearAll)
        result[i] = near(in, to.type, x, y);
      else if (in.op == Opcode::kConvert || in.op == Opcode::kConvertSaturated)
        result[i] = convert(reg(in.operands[0]).type, to.type, in.op == Opcode::kConvertSaturated,
                            value(in.operands[0], i));
      else if (in.op == Opcode::kPixelSet)
        result[i] =
            x == scalar(in.operands[0]) && y == scalar(in.operands[1]) ? scalar(in.operands[2]) : result[i];
      else
        result[i] = elementwise(in.op, to.type, value(in.operands[0], i), value(in.operands[1], i),
                                value(in.operands[2], i));
    }
    cells[in.destination.index] = result;
  }

  void reduce(const program::Instruction& in) {
    double& to = variables[in.destination.index];
    if (in.op == Opcode::kCopy) {
      to = scalar(in.operands[0]);
      return;
    }
    const std::vector<double>& from = cells[in.operands[0].index];
    double sum = 0.0, count = 0.0;
    for (const double v : from) {
      sum += v;
      count += v != 0.0 ? 1.0 : 0.0;
    }
    to = in.op == Opcode::kGlobalSum     ? sum
         : in.op == Opcode::kGlobalMin   ? *std::ranges::min_element(from)
         : in.op == Opcode::kGlobalMax   ? *std::ranges::max_element(from)
         : in.op == Opcode::kGlobalCount ? count
                                         : (count > 0.0 ? 1.0 : 0.0);
  }
};

// ---- the programs ----

class IntegerProgram : public TestProgram {
 public:
  IntegerProgram(unsigned seed, Size size) : rng_(seed), main_type_(kIntegers[seed % 3]) {
    for (const CellType type : {CellType::kUint8, CellType::kUint16, CellType::kInt32, CellType::kFloat32})
      for (int i = 0; i < 4; ++i) {
        registers.push_back(reg(size.width, size.height));
        program.registers.back().type = type;
      }
    number_ = var(3.0F);
    for (int i = 0; i < 4; ++i) results_.push_back(var());
    if (rng_() % 2 == 0) add(Opcode::kBoundary, {}, lit(static_cast<float>(rng_() % 5)), lit(7));
    add_block(24, 0);
    static const Opcode kReductions[] = {Opcode::kGlobalSum, Opcode::kGlobalMin, Opcode::kGlobalMax,
                                         Opcode::kGlobalCount, Opcode::kGlobalAny};
    for (const Operand& result : results_) add(kReductions[rng_() % 5], result, any(kIntegers[rng_() % 3]));
  }

  std::vector<Operand> registers;

 private:
  Operand any(CellType type) {
    const std::size_t at = type == CellType::kUint8    ? 0
                           : type == CellType::kUint16 ? 4
                           : type == CellType::kInt32  ? 8
                                                       : 12;
    return registers[at + rng_() % 4];
  }
  CellType any_type() { return rng_() % 4 != 0 ? main_type_ : kIntegers[rng_() % 3]; }
  Operand any_operand(CellType type) {
    switch (rng_() % 6) {
      case 0:
        return lit(static_cast<float>(rng_() % 10));
      case 1:
        return rng_() % 3 == 0 ? number_ : lit(type == CellType::kInt32 ? -5.0F : 200.0F);
      default:
        return any(type);
    }
  }
  bool masked() { return rng_() % 3 != 0; }

  void add_block(int length, int depth) {
    for (int i = 0; i < length; ++i) add_one(depth);
  }

  void add_one(int depth) {
    const CellType type = any_type();
    switch (rng_() % 16) {
      case 0:
      case 1:
      case 2: {
        const Operand y = any(type), a = any(type);
        static const int kSteps[] = {1, -1, 0, 2, -3, 8, -9};
        if (y == a) return;
        add(Opcode::kShift, y, a, lit(static_cast<float>(kSteps[rng_() % 7])),
            lit(static_cast<float>(kSteps[rng_() % 7])), masked());
        return;
      }
      case 3: {
        const Operand y = any(type), a = any(type);
        if (y == a) return;
        add(static_cast<Opcode>(static_cast<unsigned>(Opcode::kNearSum) + rng_() % 5), y, a,
            lit(rng_() % 2 == 0 ? 4.0F : 8.0F), {}, masked());
        return;
      }
      case 4: {
        const CellType from = rng_() % 4 == 0 ? CellType::kFloat32 : kIntegers[rng_() % 3];
        const CellType to = rng_() % 4 == 0 ? CellType::kFloat32 : type;
        if (from != to)
          add(rng_() % 2 == 0 ? Opcode::kConvert : Opcode::kConvertSaturated, any(to), any(from), {}, {},
              masked());
        return;
      }
      case 5:
        if (depth < 3) {
          add(Opcode::kMaskPush, {}, any(rng_() % 5 == 0 ? CellType::kFloat32 : any_type()));
          add_block(3, depth + 1);
          if (rng_() % 2 == 0) {
            add(Opcode::kMaskElse);
            add_block(2, depth + 1);
          }
          add(Opcode::kMaskPop);
        }
        return;
      case 6:
        if (rng_() % 3 == 0) add(rng_() % 2 == 0 ? Opcode::kMaskOff : Opcode::kMaskOn, {}, {});
        if (!program.code.empty() && program.code.back().op == Opcode::kMaskOn)
          program.code.back().operands[0] = any(any_type());
        return;
      case 7:
        if (rng_() % 3 == 0) add(Opcode::kCopy, number_, lit(static_cast<float>(rng_() % 20)));
        if (rng_() % 3 == 0) add(Opcode::kPixelSet, any(type), lit(0), lit(0), number_, masked());
        return;
      default: {
        const auto op = static_cast<Opcode>(rng_() % (static_cast<unsigned>(Opcode::kSubSaturated) + 1));
        if (!program::takes_integers(op)) return;
        const std::size_t arity = program::opcode_info(op).signature.size() - 1;
        Operand from[3] = {};
        for (std::size_t k = 0; k < arity; ++k) from[k] = any_operand(type);
        add(op, any(type), from[0], from[1], from[2], masked());
      }
    }
  }

  std::mt19937 rng_;
  const CellType main_type_;
  Operand number_;
  std::vector<Operand> results_;
};

std::vector<double> random_values(CellType type, std::size_t n, std::mt19937& rng) {
  std::vector<double> values(n);
  const bool small = rng() % 2 == 0, truths = rng() % 4 == 0;
  for (double& v : values) {
    const std::uint32_t bits = rng();
    v = truths                       ? (bits % 2 == 0 ? 1.0 : 0.0)
        : type == CellType::kFloat32 ? static_cast<double>(static_cast<float>(bits % 4096) * 0.25F - 300.0F)
        : small                      ? static_cast<double>(bits % 8)
                                     : wrap(type, static_cast<std::int64_t>(bits));
  }
  if (!truths && n > 2 && program::is_integer(type)) {
    values[0] = program::lowest_cell(type);
    values[1] = program::highest_cell(type);
  }
  if (!truths && n > 3 && !program::is_integer(type)) {
    values[0] = 3e9;
    values[1] = -3e9;
    values[2] = NAN;
  }
  return values;
}

struct Way {
  std::string name;
  VmOptions options;
};

std::vector<Way> ways() {
  std::vector<Way> all;
  const auto add = [&](std::string name) {
    Way& way = all.emplace_back();
    way.name = std::move(name);
    way.options.parallel_cells = 1;
    return &way.options;
  };
  add("unfused")->fusion.enabled = false;
  for (const InstructionSet isa :
       {InstructionSet::kPortable, InstructionSet::kAvx2, InstructionSet::kAvx512}) {
    if (!is_supported(isa)) continue;
    const std::string name(instruction_set_name(isa));
    add(name)->isa = isa;
    VmOptions* unfused = add(name + ", unfused, two threads");
    unfused->isa = isa;
    unfused->threads = 2;
    unfused->fusion.enabled = false;
    VmOptions* tiles = add(name + ", interpreted stages");
    tiles->isa = isa;
    tiles->fusion.enable_jit = false;
    VmOptions* strips = add(name + ", strips, rows of 3, two threads");
    strips->isa = isa;
    strips->threads = 2;
    strips->fusion.strip_columns = 16;
    strips->fusion.block_rows = 3;
    strips->fusion.rows_per_iteration = 2;
  }
  for (const NamedKernelTable& target : kernel_tables()) {
    VmOptions* options = add("kernels of " + std::string(target.name));
    options->kernels = target.table;
    options->fusion.enabled = false;
  }
  return all;
}

constexpr unsigned kIntegerPrograms = 240U;

TEST(Integers, ProgramsGiveWhatCellsGiveOneByOne) {
  const Size kShapes[] = {{64, 5}, {1, 1}, {3, 5}, {17, 33}, {128, 7}, {70, 3}, {1, 40}, {130, 9}, {33, 9}};
  const std::vector<Way> all = ways();
  const auto seeds = program_seeds(kIntegerPrograms);
  for (const unsigned seed : seeds) {
    IntegerProgram random(seed, kShapes[seed % std::size(kShapes)]);
    const program::Program program = random.finish();
    ASSERT_EQ(program::verify(program), "") << seed;
    std::mt19937 rng(seed);
    Reference reference{program, {}, {}, {}, {}};
    for (const program::Register& reg : program.registers)
      reference.cells.push_back(random_values(reg.type, std::size_t{reg.width} * reg.height, rng));
    for (const program::Variable& variable : program.variables)
      reference.variables.push_back(variable.initial_value);
    const std::vector<std::vector<double>> inputs = reference.cells;
    reference.run();
    for (const Way& way : all) {
      const std::string what = "seed " + std::to_string(seed) + ", " + way.name;
      FakeHost host;
      Vm vm(program, way.options, host);
      for (std::size_t r = 0; r < inputs.size(); ++r) {
        const Plane plane = vm.plane(r);
        for (std::size_t i = 0; i < inputs[r].size(); ++i)
          with_cell_type(plane.type, [&](auto cell) {
            using T = decltype(cell);
            plane.cells<T>(static_cast<std::uint32_t>(i / plane.width))[i % plane.width] =
                static_cast<T>(inputs[r][i]);
          });
      }
      ASSERT_EQ(vm.run(), Status::kEnded) << what << ": " << vm.error();
      for (std::size_t v = 0; v < reference.variables.size(); ++v)
        ASSERT_EQ(vm.variable(v), reference.variables[v]) << what << " variable " << v;
      for (std::size_t r = 0; r < inputs.size(); ++r) {
        const Plane plane = vm.plane(r);
        for (std::size_t i = 0; i < inputs[r].size(); ++i) {
          const double got = cell_value(plane, static_cast<std::uint32_t>(i % plane.width),
                                        static_cast<std::uint32_t>(i / plane.width));
          const double want = reference.cells[r][i];
          ASSERT_TRUE(got == want || (std::isnan(got) && std::isnan(want)))
              << what << " register " << r << " of " << program::cell_type_name(plane.type) << " column "
              << i % plane.width << " row " << i / plane.width << ": " << got << ", not " << want;
        }
      }
    }
  }
  count_cases(seeds.size());
}

// A number that a cell cannot hold stops the program, fused or not, and whether its result is read or not.
TEST(Integers, NumbersOutsideOfTheTypeFail) {
  for (const bool fused : {false, true}) {
    TestProgram build;
    const Operand a = build.reg(64, 4), y = build.reg(64, 4), n = build.var();
    for (const Operand& r : {a, y}) build.program.registers[r.index].type = CellType::kUint8;
    build.add(Opcode::kCopy, n, build.lit(256));
    build.add(Opcode::kAdd, y, a, build.lit(1));
    build.add(Opcode::kAdd, y, y, n);
    const program::Program program = build.finish();
    ASSERT_EQ(program::verify(program), "");
    VmOptions options;
    options.fusion.enabled = fused;
    FakeHost host;
    VmOptions unread = options;
    unread.fusion.observed.all_named = false;
    EXPECT_EQ(Vm(program, unread, host).run(), Status::kFailed);
    Vm vm(program, options, host);
    EXPECT_EQ(vm.run(), Status::kFailed);
    EXPECT_NE(vm.error().find("test.aps:3: error: 256 is no uint8"), std::string::npos) << vm.error();
    EXPECT_EQ(cell_value(vm.plane(y.index), 3, 2), 1.0);
  }
}

// What the verifier refuses.
TEST(Integers, VerifierKnowsTypes) {
  const auto error_of = [](Opcode op, CellType to, CellType from, double number) {
    TestProgram build;
    const Operand y = build.reg(8, 4), a = build.reg(8, 4);
    build.program.registers[y.index].type = to;
    build.program.registers[a.index].type = from;
    const std::size_t arity = program::opcode_info(op).signature.size() - 1;
    build.add(op, y, a, arity > 1 ? build.lit(static_cast<float>(number)) : Operand{});
    return program::verify(build.finish());
  };
  EXPECT_EQ(error_of(Opcode::kAdd, CellType::kUint8, CellType::kUint8, 255), "");
  EXPECT_NE(error_of(Opcode::kAdd, CellType::kUint8, CellType::kUint8, 256).find("no uint8"),
            std::string::npos);
  EXPECT_NE(error_of(Opcode::kAdd, CellType::kInt32, CellType::kInt32, 0.5).find("no int32"),
            std::string::npos);
  EXPECT_NE(error_of(Opcode::kAdd, CellType::kUint8, CellType::kUint16, 1).find("differ in type"),
            std::string::npos);
  EXPECT_NE(error_of(Opcode::kPow, CellType::kUint8, CellType::kUint8, 1).find("takes no"),
            std::string::npos);
  EXPECT_NE(
      error_of(Opcode::kBitAnd, CellType::kFloat32, CellType::kFloat32, 1).find("takes registers of int"),
      std::string::npos);
  EXPECT_NE(error_of(Opcode::kConvert, CellType::kUint8, CellType::kUint8, 0).find("its own type"),
            std::string::npos);
}

}  // namespace
}  // namespace apron::vm::test
