// Programs of random instructions, and cells for them.
#pragma once

#include <array>
#include <string>

#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {

using program::BoundaryRule;

// A program of random instructions. kLocal: one that boards can execute, which senses, actuates and steps,
// with scalars, branches and loops that depend on the tick. kLocalTyped: also with registers of integers.
enum class Reach { kAnywhere, kLocal, kLocalTyped };

class RandomProgram : public TestProgram {
 public:
  RandomProgram(unsigned seed, Size size, Reach reach = Reach::kAnywhere)
      : rng_(seed), local_(reach != Reach::kAnywhere), typed_(reach == Reach::kLocalTyped) {
    // Half of the registers are temporaries, which fusion may leave out of date at the end.
    for (int i = 0; i < kRegisters; ++i) {
      registers.push_back(reg(size.width, size.height));
      if (i >= kRegisters / 2) program.registers.back().name[0] = '$';
    }
    for (int i = 0; i < 3; ++i) variables.push_back(var(static_cast<float>(i) - 0.5F));
    if (typed_) add_integer_registers(size);
    const std::uint32_t smallest = local_ ? 1 : 3;
    for (std::uint32_t side = smallest; side < smallest + 3; ++side)
      filters.push_back(make_filter(side, one_in(2) ? side : 2));
    if (one_in(2)) add(Opcode::kBoundary, {}, any_rule(), typed_ ? lit(7) : lit(1.75F));
    if (local_) {
      add_ticks();
      return;
    }
    add_block(static_cast<int>(rng_() % 40) + 10, 0);
    // Read all temporaries, so that values which the program may not drop are observable.
    for (int i = kRegisters / 2; i < kRegisters; ++i)
      add(Opcode::kAdd, registers[0], registers[0], registers[i]);
  }

  std::vector<Operand> registers, variables, filters;

 private:
  static constexpr int kRegisters = 8;

  Operand any_rule() {
    auto rule = static_cast<BoundaryRule>(rng_() % 5);
    if (local_ && rule == BoundaryRule::kWrap) rule = BoundaryRule::kReflect;
    return lit(static_cast<float>(rule));
  }

  // Senses into two registers, computes, and actuates all registers, tick by tick.
  void add_ticks() {
    if (one_in(2)) add_block(static_cast<int>(rng_() % 8), 0);
    const std::size_t top = next_index();
    add(Opcode::kSurfaceSense, registers[0], text("numbers"));
    add(Opcode::kSurfaceSense, registers[1], text("truths"));
    if (one_in(2)) add(Opcode::kNe, registers[1], registers[1], lit(0));
    if (typed_) {
      for (const auto& of_type : integers_) add(Opcode::kSurfaceSense, of_type[0], text("numbers"));
      add(Opcode::kSurfaceTick, whole_);
      add(Opcode::kBitAnd, whole_, whole_, lit(7));
    }
    add_block(static_cast<int>(rng_() % 30) + 8, 0);
    for (std::size_t i = 0; i < registers.size(); ++i)
      add(Opcode::kSurfaceActuate, {}, text("r" + std::to_string(i)), registers[i]);
    for (std::size_t t = 0; typed_ && t < integers_.size(); ++t)
      for (std::size_t i = 0; i < integers_[t].size(); ++i)
        add(Opcode::kSurfaceActuate, {}, text("i" + std::to_string(t) + std::to_string(i)), integers_[t][i]);
    add(Opcode::kSurfaceActuate, {}, text("scalar"), variables[0]);
    add(Opcode::kSurfaceStep);
    add(Opcode::kJump, {}, label(top));
  }

  bool one_in(unsigned one_in) { return rng_() % one_in == 0; }
  Operand any_register() { return registers[rng_() % registers.size()]; }
  Operand any_literal() { return lit(static_cast<float>(static_cast<int>(rng_() % 9)) * 0.5F - 2.0F); }
  Operand any_scalar() { return one_in(2) ? variables[rng_() % variables.size()] : any_literal(); }
  Operand any_operand() { return one_in(5) ? any_scalar() : any_register(); }

  void add_block(int length, int depth) {
    for (int i = 0; i < length; ++i) add_instruction(depth);
  }

  void add_instruction(int depth) {
    if (typed_ && one_in(2)) return add_integer(depth);
    switch (rng_() % 17) {
      case 16:
        return add_filter();
      case 0:
        return add_scalar_operation();
      case 1:
      case 2:
      case 3:
      case 4:
        return add_shift();
      case 5:
        return depth < 3 ? add_where(depth) : add_elementwise();
      case 6:
        return depth < 2 ? add_loop(depth) : add_elementwise();
      case 7:
        return add_other(depth);
      case 8:
        return add_neighbours();
      default:
        return add_elementwise();
    }
  }

  void add_elementwise() {
    static const Opcode kOps[] = {
        Opcode::kCopy, Opcode::kAdd,    Opcode::kSub,    Opcode::kMul,    Opcode::kMin,  Opcode::kMax,
        Opcode::kDiv,  Opcode::kMod,    Opcode::kAbs,    Opcode::kNeg,    Opcode::kSign, Opcode::kClamp,
        Opcode::kMac,  Opcode::kSelect, Opcode::kLt,     Opcode::kLe,     Opcode::kGt,   Opcode::kGe,
        Opcode::kEq,   Opcode::kNe,     Opcode::kAnd,    Opcode::kOr,     Opcode::kXor,  Opcode::kNand,
        Opcode::kNor,  Opcode::kNot,    Opcode::kSqrt,   Opcode::kFloor,  Opcode::kCeil, Opcode::kRound,
        Opcode::kSin,  Opcode::kAtan2,  Opcode::kMin,    Opcode::kMax,    Opcode::kAdd,  Opcode::kMul,
        Opcode::kSub,  Opcode::kAdd,    Opcode::kSelect, Opcode::kSelect, Opcode::kMin,  Opcode::kMax};
    const Opcode op = kOps[rng_() % std::size(kOps)];
    const std::size_t arity = program::opcode_info(op).signature.size() - 1;
    Operand from[3] = {};
    for (std::size_t k = 0; k < arity; ++k) from[k] = any_operand();
    add(op, any_register(), from[0], from[1], from[2], !one_in(3));
  }

  void add_shift() {
    const Operand y = any_register(), a = any_register();
    if (y == a) return add_elementwise();
    static const int kFar[] = {1, 1, 1, -1, -1, -1, 0, 0, 2, -2, 3, 8, -8, 9, -17};
    int dx = kFar[rng_() % std::size(kFar)], dy = one_in(3) ? kFar[rng_() % std::size(kFar)] : 0;
    if (local_) {
      dx = dx == 0 ? 0 : dx < 0 ? -1 : 1;
      dy = 0;
    }
    const bool turned = one_in(2);
    add(!local_ && one_in(12) ? Opcode::kRotate : Opcode::kShift, y, a,
        lit(static_cast<float>(turned ? dy : dx)), lit(static_cast<float>(turned ? dx : dy)), !one_in(3));
  }

  void add_neighbours() {
    const Operand y = any_register(), a = any_register();
    if (y == a) return add_elementwise();
    const auto op = static_cast<Opcode>(static_cast<unsigned>(Opcode::kNearSum) + rng_() % 5);
    add(op, y, a, lit(one_in(2) ? 4.0F : 8.0F), {}, !one_in(3));
  }

  Operand make_filter(std::uint32_t width, std::uint32_t height) {
    program::Filter f{"f", width, height, {}};
    for (std::uint32_t i = 0; i < width * height; ++i)
      f.coefficients.push_back(static_cast<float>(static_cast<int>(rng_() % 5)) * 0.25F - 0.5F);
    program.filters.push_back(f);
    return {program::OperandKind::kFilter, static_cast<std::uint32_t>(program.filters.size() - 1)};
  }

  // Programs modify only the last filter.
  void add_filter() {
    const Operand y = any_register(), a = any_register();
    if (y == a) return add_elementwise();
    if (one_in(6))
      add(Opcode::kFilterSet, {}, filters.back(), lit(static_cast<float>(rng_() % 5)), any_scalar());
    add(Opcode::kFilterDo, y, a, filters[rng_() % filters.size()], {}, !one_in(3));
  }

  void add_scalar_operation() {
    static const Opcode kOps[] = {Opcode::kCopy, Opcode::kAdd, Opcode::kSub, Opcode::kMul, Opcode::kMin};
    const Opcode op = kOps[rng_() % std::size(kOps)];
    add(op, variables[rng_() % variables.size()], any_scalar(),
        op == Opcode::kCopy ? Operand{} : any_scalar());
  }

  void add_where(int depth) {
    add(Opcode::kMaskPush, {}, any_condition());
    add_block(static_cast<int>(rng_() % 6), depth + 1);
    if (one_in(2)) {
      add(Opcode::kMaskElse);
      add_block(static_cast<int>(rng_() % 5), depth + 1);
    }
    add(Opcode::kMaskPop);
  }

  // A counted loop; the count is a constant or a variable known only at run time.
  void add_loop(int depth) {
    const Operand counter = var();
    if (one_in(3))
      add(Opcode::kMin, counter, any_scalar(), lit(3));
    else
      add(Opcode::kCopy, counter, lit(static_cast<float>(rng_() % 5)));
    const std::size_t top = add(Opcode::kUnlessGt, {}, counter, lit(0), label(0));
    add_block(static_cast<int>(rng_() % 6) + 1, depth + 1);
    add(Opcode::kSub, counter, counter, lit(1));
    add(Opcode::kJump, {}, label(top));
    program.code[top].operands[2] = label(next_index());
  }

  void add_other(int depth) {
    if (local_ && one_in(2)) return add_local(depth);
    switch (rng_() % 7) {
      case 0:
        add(Opcode::kMaskOn, {}, any_condition());
        break;
      case 1:
        add(Opcode::kMaskOff);
        break;
      case 2:
        if (!local_) add(Opcode::kGlobalSum, variables[0], any_register());
        break;
      case 3:
        add(Opcode::kBoundary, {}, any_rule(), typed_ ? any_whole() : any_scalar());
        break;
      case 4:
        add(Opcode::kMaskPush, {}, any_scalar());
        add_elementwise();
        add(Opcode::kMaskPop);
        break;
      case 5:
        add(one_in(2) ? Opcode::kCellX : Opcode::kCellY, any_register());
        break;
      default:
        if (!local_) add(Opcode::kPixelSet, any_register(), lit(0), lit(0), any_scalar());
        break;
    }
  }

  // ---- integers ----

  static constexpr std::array kIntegers{program::CellType::kUint8, program::CellType::kUint16,
                                        program::CellType::kInt32};

  void add_integer_registers(Size size) {
    whole_ = var(3);
    for (std::size_t t = 0; t < kIntegers.size(); ++t)
      for (Operand& one : integers_[t]) {
        one = reg(size.width, size.height);
        program.registers.back().type = kIntegers[t];
      }
  }
  Operand any_integer(std::size_t type) { return integers_[type][rng_() % integers_[type].size()]; }
  Operand any_condition() { return typed_ && one_in(2) ? any_integer(rng_() % 3) : any_register(); }
  // A number that every type holds; known at compile time or not.
  Operand any_whole() { return one_in(3) ? whole_ : lit(static_cast<float>(rng_() % 20)); }
  Operand any_integer_operand(std::size_t type) {
    if (!one_in(4)) return any_integer(type);
    return one_in(2) ? any_whole() : lit(type == 2 ? -5.0F : 200.0F);
  }

  void add_integer(int depth) {
    const std::size_t type = rng_() % 3;
    const Operand y = any_integer(type), a = any_integer(type);
    const bool masked = !one_in(3);
    switch (rng_() % 12) {
      case 0:
      case 1:
        if (y == a) return;
        return (void)add(Opcode::kShift, y, a, lit(static_cast<float>(static_cast<int>(rng_() % 3) - 1)),
                         lit(0), masked);
      case 2:
        if (y == a) return;
        return (void)add(static_cast<Opcode>(static_cast<unsigned>(Opcode::kNearSum) + rng_() % 5), y, a,
                         lit(one_in(2) ? 4.0F : 8.0F), {}, masked);
      case 3:
      case 4: {
        const Opcode op = one_in(2) ? Opcode::kConvert : Opcode::kConvertSaturated;
        if (one_in(3)) return (void)add(op, any_register(), a, {}, {}, masked);
        if (one_in(3)) return (void)add(op, y, any_register(), {}, {}, masked);
        return (void)add(op, y, any_integer((type + 1 + rng_() % 2) % 3), {}, {}, masked);
      }
      case 5:
        if (depth > 2) return;
        add(Opcode::kStackPush, {}, a);
        add_block(static_cast<int>(rng_() % 4), depth + 1);
        return (void)add(Opcode::kStackPop, y, {}, {}, {}, masked);
      case 6: {
        const auto op = static_cast<Opcode>(static_cast<unsigned>(Opcode::kBitAnd) + rng_() % 6);
        return (void)add(op, variables[rng_() % variables.size()], any_scalar(),
                         op == Opcode::kBitNot ? Operand{} : any_scalar());
      }
      default: {
        auto op = Opcode::kPow;
        while (!program::takes_integers(op))
          op = static_cast<Opcode>(rng_() % (static_cast<unsigned>(Opcode::kSubSaturated) + 1));
        const std::size_t arity = program::opcode_info(op).signature.size() - 1;
        Operand from[3] = {};
        for (std::size_t k = 0; k < arity; ++k) from[k] = any_integer_operand(type);
        add(op, y, from[0], from[1], from[2], masked);
      }
    }
  }

  // What only the programs of boards are tried with.
  void add_local(int depth) {
    static const Opcode kDraws[] = {Opcode::kRandomFloat, Opcode::kRandomGauss, Opcode::kRandomInt};
    const Operand variable = variables[rng_() % variables.size()];
    switch (rng_() % 11) {
      case 0:
        add(one_in(2) ? Opcode::kSurfaceTick : Opcode::kSurfaceTime, variable);
        break;
      case 1:
        add(kDraws[rng_() % 3], one_in(2) ? any_register() : variable, any_scalar(), lit(3), {}, !one_in(3));
        break;
      case 2:
        add(Opcode::kRandomSeed, {}, any_scalar());
        break;
      case 3: {
        add(Opcode::kStackPush, {}, any_register());
        add_block(static_cast<int>(rng_() % 4), depth + 1);
        add(Opcode::kStackPop, any_register(), {}, {}, {}, !one_in(3));
        break;
      }
      case 4:
        add(Opcode::kSurfaceStep);
        break;
      case 5:
      case 6:
        add_branch(depth);
        break;
      case 7:
        if (depth < 2) add_call(depth);
        break;
      case 8: {
        add(Opcode::kMaskPush, {}, any_scalar());
        add_block(static_cast<int>(rng_() % 4), depth + 1);
        add(Opcode::kMaskElse);
        add_block(static_cast<int>(rng_() % 4), depth + 1);
        add(Opcode::kMaskPop);
        break;
      }
      case 9:
        add(one_in(2) ? Opcode::kDiv : Opcode::kMod, variable, any_scalar(), any_scalar());
        break;
      default:
        add(one_in(2) ? Opcode::kExp : Opcode::kPow, any_register(), any_operand(), any_operand());
        if (program.code.back().op == Opcode::kExp) program.code.back().operands[1] = {};
        break;
    }
  }

  void add_branch(int depth) {
    static const Opcode kJumps[] = {Opcode::kJumpLt, Opcode::kJumpGe, Opcode::kJumpEq, Opcode::kUnlessLe,
                                    Opcode::kUnlessGe};
    const std::size_t jump =
        add(kJumps[rng_() % std::size(kJumps)], {}, any_scalar(), any_scalar(), label(0));
    if (depth < 3) add_block(static_cast<int>(rng_() % 4), depth + 1);
    program.code[jump].operands[2] = label(next_index());
  }

  // A routine that is called twice.
  void add_call(int depth) {
    const std::size_t over = add(Opcode::kJump, {}, label(0));
    const std::size_t routine = next_index();
    add_block(static_cast<int>(rng_() % 5), depth + 1);
    add(Opcode::kReturn);
    program.code[over].operands[0] = label(next_index());
    add(Opcode::kCall, {}, label(routine));
    add_elementwise();
    add(Opcode::kCall, {}, label(routine));
  }

  std::mt19937 rng_;
  const bool local_, typed_;
  std::array<std::array<Operand, 3>, 3> integers_;  // by type
  Operand whole_;
};

// Mostly finite values: NaN propagates and hides differences.
inline Cells random_input(std::size_t n, unsigned seed, std::mt19937& rng) {
  if (rng() % 3 == 0) return random_mask(n, rng);
  if (seed % 3 == 0) return random_cells(n, rng);
  Cells cells(n);
  for (float& c : cells) c = static_cast<float>(rng() % 64) * 0.125F - 3.0F;
  return cells;
}

}  // namespace apron::vm::test
