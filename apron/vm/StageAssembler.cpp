#include "apron/vm/StageAssembler.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace apron::vm {

using program::Opcode;
using Xbyak::Reg64;

namespace {

constexpr std::size_t kFirstCode = 4096;
constexpr int kVectors = 32;
constexpr int kMasks = 8;               // k0 cannot be a predicate
constexpr std::size_t kMaxRolling = 5;  // lines whose neighbouring vectors are kept
constexpr int kMaxFixed = 10;           // vectors that hold scalars and constants throughout
constexpr int kMaxFixedOfMany = 6;      // the same, of several rows at once
constexpr int kVectorBytes = 64;
constexpr std::uint32_t kMaxShortRow = 8;  // vectors
constexpr std::uint32_t kMaxBodies = 16;   // vectors times rows in one turn of the inner loop

// The call's address and the bytes of a row lie on the stack, to leave registers to the lines.
constexpr int kCallOnStack = 0, kRowBytesOnStack = 8, kTurnsOnStack = 16, kStackBytes = 24;

const std::array<Reg64, 6> kSaved{Xbyak::util::rbx, Xbyak::util::rbp, Xbyak::util::r12,
                                  Xbyak::util::r13, Xbyak::util::r14, Xbyak::util::r15};
const Reg64 kColumn = Xbyak::util::rcx;
// The last one holds the scalars' address where a loop needs it.
const std::array<Reg64, kMaxLines> kPointers{
    Xbyak::util::rax, Xbyak::util::rbx, Xbyak::util::rbp, Xbyak::util::r8,  Xbyak::util::r9,
    Xbyak::util::r10, Xbyak::util::r11, Xbyak::util::r12, Xbyak::util::r13, Xbyak::util::r14,
    Xbyak::util::r15, Xbyak::util::rdx, Xbyak::util::rdi, Xbyak::util::rsi};

}  // namespace

StageAssembler::StageAssembler(const Stage& stage, std::uint32_t rows, std::uint32_t vectors)
    : CodeGenerator(kFirstCode, Xbyak::AutoGrow), stage_(stage), rows_(rows) {
  find_lines();
  temps_.resize(stage_.ops.size());
  for (const MicroOp& op : stage_.ops)
    for (const MicroArg& arg : op.args)
      if (arg.kind == MicroArg::Kind::kScalar) scalars_[arg.index];
  count_loads();
  choose_fixed();
  choose_rolling();
  if (lines_.size() + (slots_used_ ? 1 : 0) > kMaxLines) throw DoesNotFit{};
  unroll_ = unroll(vectors);
  prologue();
  turns();
  epilogue();
  readyRE();
  code_ = getCode<void (*)(const StageCall*)>();
}

void StageAssembler::find_lines() {
  for (std::uint32_t row = 0; row < rows_; ++row)
    for (const Stream& stream : stage_.streams) {
      const Stream wanted{stream.store, static_cast<std::int8_t>(stream.dy + static_cast<int>(row))};
      const auto found = std::find(lines_.begin(), lines_.end(), wanted);
      line_of_.push_back(static_cast<std::uint32_t>(found - lines_.begin()));
      if (found == lines_.end()) lines_.push_back(wanted);
    }
}

void StageAssembler::count_loads() {
  for (row_ = 0; row_ < rows_; ++row_)
    for (const MicroOp& op : stage_.ops)
      for (const MicroArg& arg : op.args)
        if (arg.kind == MicroArg::Kind::kStream) ++loads_[{line(arg.index), arg.dx}].uses;
}

void StageAssembler::count_temps() {
  for (const MicroOp& op : stage_.ops)
    for (const MicroArg& arg : op.args)
      if (arg.kind == MicroArg::Kind::kTemp) ++temps_[arg.index].uses;
  for (const Stage::Result& result : stage_.results) ++temps_[result.op].uses;
}

bool StageAssembler::needs_truth() const {
  return std::any_of(stage_.ops.begin(), stage_.ops.end(), [](const MicroOp& op) {
    return op.op == Opcode::kSign || op.op == Opcode::kSelect ||
           (op.op >= Opcode::kLt && op.op <= Opcode::kNot);
  });
}

// The highest vectors keep the constants, then the scalars as far as they go.
void StageAssembler::choose_fixed() {
  const int most = rows_ > 1 ? kMaxFixedOfMany : kMaxFixed;
  int next = kVectors - 1;
  const auto take = [&](Value& value) {
    if (value.vector < 0 && next > kVectors - 1 - most) value.vector = next--;
  };
  if (needs_truth()) {
    take(bits(kZero));
    take(bits(kOne));
  }
  for (const MicroOp& op : stage_.ops) {
    if (op.op == Opcode::kAbs) take(bits(kMagnitude));
    if (op.op == Opcode::kNeg) take(bits(kSignBit));
  }
  for (auto& [slot, value] : scalars_) {
    take(value);
    slots_used_ = slots_used_ || value.vector < 0;
  }
  for (int v = 0; v <= next; ++v) free_.push_back(v);
  for (int k = 1; k < kMasks; ++k) free_masks_.push_back(k);
}

// A row that is read to the west or east too passes through three vectors, one load for each of its own: a
// load that straddles two cache lines costs two.
void StageAssembler::choose_rolling() {
  for (const auto& [key, load] : loads_) {
    if (key.second == 0 || rolling_.count(key.first) > 0 || rolling_.size() == kMaxRolling) continue;
    Rolling& r = rolling_[key.first];
    for (int* v : {&r.west, &r.own, &r.east}) {
      *v = free_.front();
      free_.erase(free_.begin());
    }
  }
}

const Reg64& StageAssembler::pointer(std::uint32_t line) const { return kPointers[line]; }

void StageAssembler::prologue() {
  for (const Reg64& r : kSaved) push(r);
  sub(rsp, kStackBytes);
  mov(ptr[rsp + kCallOnStack], rdi);
  mov(rax, ptr[rdi + offsetof(StageCall, row_bytes)]);
  mov(ptr[rsp + kRowBytesOnStack], rax);
  mov(rax, ptr[rdi + offsetof(StageCall, turns)]);
  mov(ptr[rsp + kTurnsOnStack], rax);
  for (const auto& [pattern, value] : constants_) {
    mov(eax, pattern);
    vpbroadcastd(Zmm(value.vector), eax);
  }
  mov(rsi, ptr[rdi + offsetof(StageCall, slots)]);
  for (const auto& [slot, value] : scalars_)
    if (value.vector >= 0) vbroadcastss(Zmm(value.vector), ptr[rsi + slot * sizeof(float)]);
  mov(rcx, rdi);  // two lines' pointers may take the place of these
  for (std::uint32_t i = 0; i < lines_.size(); ++i)
    mov(pointer(i), ptr[rcx + offsetof(StageCall, first) + i * sizeof(float*)]);
}

void StageAssembler::turns() {
  Xbyak::Label turn, column;
  L(turn);
  for (const auto& [line, r] : rolling_) {
    vmovups(Zmm(r.west), ptr[pointer(line) - kVectorBytes]);
    vmovups(Zmm(r.own), ptr[pointer(line)]);
  }
  xor_(ecx, ecx);
  L(column);
  const std::map<std::uint32_t, Rolling> at_start = rolling_;
  for (std::uint32_t i = 0; i < unroll_; ++i) {
    ahead_ = static_cast<int>(i) * kVectorBytes;
    if (i > 0) count_loads();
    one_vector();
  }
  for (const auto& [line, r] : at_start) restore(r, rolling_.at(line));
  rolling_ = at_start;
  add(kColumn, static_cast<int>(unroll_) * kVectorBytes);
  cmp(kColumn, ptr[rsp + kRowBytesOnStack]);
  jb(column, T_NEAR);
  mov(kColumn, ptr[rsp + kCallOnStack]);
  for (std::uint32_t i = 0; i < lines_.size(); ++i)
    add(pointer(i), ptr[kColumn + offsetof(StageCall, step_bytes) + i * sizeof(std::ptrdiff_t)]);
  dec(qword[rsp + kTurnsOnStack]);
  jnz(turn, T_NEAR);
}

void StageAssembler::one_vector() {
  for (const auto& [line, r] : rolling_)
    vmovups(Zmm(r.east), ptr[pointer(line) + kColumn + (ahead_ + kVectorBytes)]);
  for (std::uint32_t row = 0; row < rows_; ++row) one_row(row);
  for (auto& [line, r] : rolling_) r = {r.own, r.east, r.west};
}

void StageAssembler::one_row(std::uint32_t row) {
  row_ = row;
  count_temps();
  for (std::size_t i = 0; i < stage_.ops.size(); ++i) operation(i);
  for (const Stage::Result& result : stage_.results) {
    const MicroArg value{MicroArg::Kind::kTemp, 0, result.op};
    const Zmm v = vector(value);
    if (result.around_caches)
      vmovntps(address(line(result.stream), 0), v);
    else
      vmovups(address(line(result.stream), 0), v);
    used(value);
    pinned_.clear();
  }
}

// West and own of the next vector to where the loop's start has them; `now` has turned some times.
void StageAssembler::restore(const Rolling& start, const Rolling& now) {
  if (now.own == start.own) return;  // whole turns
  if (now.west == start.own) {       // one turn: own is where east was
    vmovaps(Zmm(start.west), Zmm(now.west));
    vmovaps(Zmm(start.own), Zmm(now.own));
  } else {  // two turns: own is where west was
    vmovaps(Zmm(start.own), Zmm(now.own));
    vmovaps(Zmm(start.west), Zmm(now.west));
  }
}

// Short rows are one piece of code, longer ones loops over four vectors.
std::uint32_t StageAssembler::unroll(std::uint32_t vectors) const {
  const std::uint32_t most = std::min(kMaxShortRow, kMaxBodies / rows_);
  if (vectors <= most) return std::max(vectors, 1U);
  for (const std::uint32_t n : {4U, 3U, 2U})
    if (vectors % n == 0) return n;
  return 1;
}

void StageAssembler::epilogue() {
  const bool around = std::any_of(stage_.results.begin(), stage_.results.end(),
                                  [](const Stage::Result& result) { return result.around_caches; });
  if (around) sfence();
  add(rsp, kStackBytes);
  for (auto r = kSaved.rbegin(); r != kSaved.rend(); ++r) pop(*r);
  vzeroupper();
  ret();
}

}  // namespace apron::vm
