#include "apron/vm/jit/StageAssembler.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace apron::vm {

using program::Opcode;
using Xbyak::Reg64;

namespace {

constexpr std::size_t kInitialCodeBytes = 4096;
constexpr int kMaskRegisters = 8;       // k0 cannot be a predicate
constexpr std::size_t kMaxWindows = 5;  // row streams with a sliding window
constexpr int kHalfVectorBytes = 16;    // that a window of AVX2 covers west and east
constexpr int kMinScalarsForPairs = 4;
constexpr int kMaxSpillSlots = 32;
constexpr std::uint32_t kMaxUnrolledVectors = 8;
constexpr std::uint32_t kMaxUnrolledBodies = 16;  // vectors times rows per iteration of the inner loop

const std::array<Reg64, 6> kCalleeSaved{Xbyak::util::rbx, Xbyak::util::rbp, Xbyak::util::r12,
                                        Xbyak::util::r13, Xbyak::util::r14, Xbyak::util::r15};
const Reg64 kColumnRegister = Xbyak::util::rcx;
// The last register holds the address of the scalar slots if the loop needs it.
const std::array<Reg64, kMaxRowStreams> kRowPointerRegisters{
    Xbyak::util::rax, Xbyak::util::rbx, Xbyak::util::rbp, Xbyak::util::r8,  Xbyak::util::r9,
    Xbyak::util::r10, Xbyak::util::r11, Xbyak::util::r12, Xbyak::util::r13, Xbyak::util::r14,
    Xbyak::util::r15, Xbyak::util::rdx, Xbyak::util::rdi, Xbyak::util::rsi};

}  // namespace

StageAssembler::StageAssembler(const Stage& stage, InstructionSet isa, std::uint32_t rows,
                               std::uint32_t vectors)
    : CodeGenerator(kInitialCodeBytes, Xbyak::AutoGrow),
      stage_(stage),
      has_masks_(isa == InstructionSet::kAvx512),
      is_integer_(program::is_integer(stage.type)),
      cell_bytes_(static_cast<int>(program::cell_bytes(stage.type))),
      vector_bytes_(has_masks_ ? 64 : 32),
      vector_registers_(has_masks_ ? 32 : 16),
      window_step_bytes_(has_masks_ ? 64 : 16),
      rows_per_iteration_(rows) {
  find_row_streams();
  temps_.resize(stage_.ops.size());
  temp_uses_.resize(stage_.ops.size());
  for (std::uint32_t i = 0; i < stage_.ops.size(); ++i)
    for (const MicroOperand& arg : stage_.ops[i].operands) {
      if (arg.kind == MicroOperand::Kind::kScalar) scalars_[arg.index];
      if (arg.kind == MicroOperand::Kind::kTemp) temp_uses_[arg.index].push_back(i);
    }
  for (std::uint32_t i = 0; i < stage_.results.size(); ++i)
    temp_uses_[stage_.results[i].op].push_back(static_cast<std::uint32_t>(stage_.ops.size()) + i);
  count_load_uses();
  allocate_fixed_registers();
  allocate_windows();
  if (row_streams_.size() + (needs_scalar_pointer_ ? 1 : 0) > kMaxRowStreams) throw CannotCompile{};
  unroll_factor_ = unroll_factor(vectors * static_cast<std::uint32_t>(64 / vector_bytes_));
  emit_vectors_in_pairs_if_useful();
  emit_prologue();
  emit_loops();
  emit_epilogue();
  readyRE();
  entry_point_ = getCode<void (*)(const StageCall*)>();
}

void StageAssembler::find_row_streams() {
  for (std::uint32_t row = 0; row < rows_per_iteration_; ++row)
    for (const RowStream& stream : stage_.streams) {
      const RowStream wanted{stream.buffer, static_cast<std::int8_t>(stream.dy + static_cast<int>(row))};
      const auto found = std::ranges::find(row_streams_, wanted);
      row_stream_of_.push_back(static_cast<std::uint32_t>(found - row_streams_.begin()));
      if (found == row_streams_.end()) row_streams_.push_back(wanted);
    }
}

void StageAssembler::count_load_uses() {
  for (current_row_ = 0; current_row_ < rows_per_iteration_; ++current_row_)
    for (const MicroOp& op : stage_.ops)
      for (const MicroOperand& arg : op.operands)
        if (arg.kind == MicroOperand::Kind::kStream)
          for (current_vector_ = 0; current_vector_ < vectors_together_; ++current_vector_)
            ++loads_[{row_stream(arg.index), column_of(arg)}].remaining_uses;
  current_vector_ = 0;
}

void StageAssembler::count_temp_uses() {
  for (std::size_t i = 0; i < temps_.size(); ++i)
    temps_[i].remaining_uses = temp_uses_[i % stage_.ops.size()].size();
}

// A filter on AVX2 has more coefficients than registers: each that is loaded serves two vectors. Rows share
// no loads then, because no registers are left to hold them.
void StageAssembler::emit_vectors_in_pairs_if_useful() {
  const auto unheld =
      std::ranges::count_if(scalars_, [](const auto& s) { return s.second.vector_register < 0; });
  if (has_masks_ || unheld < kMinScalarsForPairs || !windows_.empty() || unroll_factor_ % 2 != 0) return;
  if (rows_per_iteration_ > 1) throw CannotCompile{};
  vectors_together_ = 2;
  temps_.resize(2 * stage_.ops.size());
  loads_.clear();
  count_load_uses();
}

bool StageAssembler::needs_boolean_constants() const {
  return std::ranges::any_of(stage_.ops, [](const MicroOp& op) {
    return op.op == Opcode::kSign || op.op == Opcode::kSelect ||
           (op.op >= Opcode::kLt && op.op <= Opcode::kNot);
  });
}

// The highest vector registers hold constants and as many scalars as fit. Other constants are memory
// operands; 1 and the masks of abs and neg always fit.
void StageAssembler::allocate_fixed_registers() {
  const bool several_rows = rows_per_iteration_ > 1;
  const int max_registers = has_masks_ ? (several_rows ? 6 : 10) : (several_rows ? 3 : 5);
  int next = vector_registers_ - 1;
  const auto take = [&](RegisterAssignment& value) {
    if (value.vector_register < 0 && next > vector_registers_ - 1 - max_registers)
      value.vector_register = next--;
  };
  const auto take_constant = [&](std::uint32_t pattern) {
    take(constants_[pattern]);
    if (constants_[pattern].vector_register < 0) constant_pool_[pattern];
  };
  const bool boolean = needs_boolean_constants();
  if (boolean) {
    take_constant(one_bits());
    if (has_masks_) take_constant(kZeroBits);
  }
  for (const MicroOp& op : stage_.ops) {
    if (op.op == Opcode::kAbs && !is_integer_) take_constant(kMagnitudeMask);
    if (op.op == Opcode::kNeg && !is_integer_) take_constant(kSignMask);
  }
  if (is_integer_) take_integer_constants();
  for (auto& [slot, value] : scalars_) {
    take(value);
    needs_scalar_pointer_ = needs_scalar_pointer_ || value.vector_register < 0;
  }
  if (boolean && !has_masks_) {
    take_constant(kZeroBits);
    constant_pool_[kAllBits];
  }
  for (int v = 0; v <= next; ++v) free_vectors_.push_back(v);
  for (int k = 1; k < kMaskRegisters; ++k) free_masks_.push_back(k);
  for (int slot = 0; slot < kMaxSpillSlots; ++slot) free_spill_slots_.push_back(slot);
}

// A row that is also read at west or east offsets gets a sliding window of three registers, from which
// shifted vectors are assembled: an unaligned load that straddles two cache lines would cost two. With
// AVX-512 the window is three adjacent vectors, one aligned load each. With AVX2 it is the vector and those
// 16 bytes west and east of it, two loads; there is room for one.
void StageAssembler::allocate_windows() {
  if (has_masks_ && cell_bytes_ < 4) return;  // no instruction moves narrower cells across all of a vector
  std::map<std::uint32_t, int> widest;        // offset by row stream
  for (const auto& [key, load] : loads_)
    if (key.second != 0) widest[key.first] = std::max(widest[key.first], std::abs(key.second));
  if (!has_masks_ && (widest.size() != 1 || widest.begin()->second * cell_bytes_ > kHalfVectorBytes)) return;
  for (const auto& [stream, offset] : widest) {
    if (windows_.size() == kMaxWindows) break;
    SlidingWindow& r = windows_[stream];
    for (int* v : {&r.west, &r.centre, &r.east}) {
      *v = free_vectors_.front();
      free_vectors_.erase(free_vectors_.begin());
    }
  }
}

const Reg64& StageAssembler::row_pointer(std::uint32_t row_stream) const {
  return kRowPointerRegisters[row_stream];
}

void StageAssembler::emit_prologue() {
  for (const Reg64& reg : kCalleeSaved) push(reg);
  mov(rax, rsp);
  sub(rsp, kSpillStackOffset + kMaxSpillSlots * vector_bytes_);
  and_(rsp, -64);
  mov(ptr[rsp + kCallerStackOffset], rax);
  mov(ptr[rsp + kCallStackOffset], rdi);
  mov(rax, ptr[rdi + offsetof(StageCall, row_bytes)]);
  mov(ptr[rsp + kRowBytesStackOffset], rax);
  mov(rax, ptr[rdi + offsetof(StageCall, iterations)]);
  mov(ptr[rsp + kIterationsStackOffset], rax);
  for (const auto& [pattern, value] : constants_) {
    if (value.vector_register < 0) continue;
    const Vector to = vector(value.vector_register);
    mov(eax, pattern);
    vmovd(Xbyak::Xmm(to.getIdx()), eax);
    vbroadcastss(to, Xbyak::Xmm(to.getIdx()));
  }
  mov(rsi, ptr[rdi + offsetof(StageCall, scalar_slots)]);
  for (const auto& [slot, value] : scalars_)
    if (value.vector_register >= 0)
      vbroadcastss(vector(value.vector_register), ptr[rsi + slot * sizeof(float)]);
  mov(rcx, rdi);  // rdi and rsi may become row pointers
  for (std::uint32_t i = 0; i < row_streams_.size(); ++i)
    mov(row_pointer(i), ptr[rcx + offsetof(StageCall, row_start) + i * sizeof(std::byte*)]);
}

void StageAssembler::emit_loops() {
  Xbyak::Label row_loop, column_loop;
  L(row_loop);
  for (const auto& [line, r] : windows_) {
    vmovups(vector(r.west), ptr[row_pointer(line) - window_step_bytes_]);
    if (has_masks_) vmovups(vector(r.centre), ptr[row_pointer(line)]);
  }
  xor_(ecx, ecx);
  L(column_loop);
  const std::map<std::uint32_t, SlidingWindow> at_start = windows_;
  for (std::uint32_t i = 0; i < unroll_factor_; i += vectors_together_) {
    displacement_bytes_ = static_cast<int>(i) * vector_bytes_;
    if (i > 0) count_load_uses();
    emit_vectors();
  }
  for (const auto& [line, r] : at_start) emit_window_restore(r, windows_.at(line));
  windows_ = at_start;
  add(kColumnRegister, static_cast<int>(unroll_factor_) * vector_bytes_);
  cmp(kColumnRegister, ptr[rsp + kRowBytesStackOffset]);
  jb(column_loop, T_NEAR);
  mov(kColumnRegister, ptr[rsp + kCallStackOffset]);
  for (std::uint32_t i = 0; i < row_streams_.size(); ++i)
    add(row_pointer(i),
        ptr[kColumnRegister + offsetof(StageCall, row_step_bytes) + i * sizeof(std::ptrdiff_t)]);
  dec(qword[rsp + kIterationsStackOffset]);
  jnz(row_loop, T_NEAR);
}

void StageAssembler::emit_vectors() {
  for (const auto& [line, r] : windows_) {
    const auto at = row_pointer(line) + kColumnRegister + displacement_bytes_;
    if (!has_masks_) vmovups(vector(r.centre), ptr[at]);
    vmovups(vector(r.east), ptr[at + window_step_bytes_]);
  }
  for (std::uint32_t row = 0; row < rows_per_iteration_; ++row) emit_row(row);
  for (auto& [line, r] : windows_)
    r = has_masks_ ? SlidingWindow{r.centre, r.east, r.west} : SlidingWindow{r.east, r.centre, r.west};
}

void StageAssembler::emit_row(std::uint32_t row) {
  current_row_ = row;
  count_temp_uses();
  const auto for_each_vector = [&](const auto& emit) {
    for (current_vector_ = 0; current_vector_ < vectors_together_; ++current_vector_) emit();
    current_vector_ = 0;
    release_loaded_scalars();
  };
  for (current_op_ = 0; current_op_ < stage_.ops.size(); ++current_op_)
    for_each_vector([&] { emit_operation(current_op_); });
  for (const Stage::Result& result : stage_.results) {
    const MicroOperand value{MicroOperand::Kind::kTemp, 0, result.op};
    for_each_vector([&] {
      const Vector v = vector_operand(value);
      const Address to = address(row_stream(result.stream), column_of({}));
      if (result.non_temporal)
        vmovntps(to, v);
      else
        vmovups(to, v);
      release_use(value);
      release_temporaries();
    });
    ++current_op_;
  }
}

// Moves the vectors that the next iteration needs back to the registers of the loop start, after rotations of
// the window.
void StageAssembler::emit_window_restore(const SlidingWindow& start, const SlidingWindow& current) {
  if (!has_masks_) {
    if (current.west != start.west) vmovaps(vector(start.west), vector(current.west));
    return;
  }
  if (current.centre == start.centre) return;  // a multiple of three rotations
  if (current.west == start.centre) {          // one rotation: the centre is in the east register
    vmovaps(vector(start.west), vector(current.west));
    vmovaps(vector(start.centre), vector(current.centre));
  } else {  // two rotations: the centre is in the west register
    vmovaps(vector(start.centre), vector(current.centre));
    vmovaps(vector(start.west), vector(current.west));
  }
}

// Short rows are fully unrolled, longer ones by up to four vectors.
std::uint32_t StageAssembler::unroll_factor(std::uint32_t vectors) const {
  const std::uint32_t max_unrolled = std::min(kMaxUnrolledVectors, kMaxUnrolledBodies / rows_per_iteration_);
  if (vectors <= max_unrolled) return std::max(vectors, 1U);
  for (const std::uint32_t n : {4U, 3U, 2U})
    if (vectors % n == 0) return n;
  return 1;
}

void StageAssembler::emit_epilogue() {
  const bool has_non_temporal_stores =
      std::ranges::any_of(stage_.results, [](const Stage::Result& result) { return result.non_temporal; });
  if (has_non_temporal_stores) sfence();
  mov(rsp, ptr[rsp + kCallerStackOffset]);
  for (auto r = kCalleeSaved.rbegin(); r != kCalleeSaved.rend(); ++r) pop(*r);
  vzeroupper();
  ret();
  if (!constant_pool_.empty()) align(32);
  for (auto& [pattern, label] : constant_pool_) {
    L(label);
    for (int i = 0; i < vector_bytes_; i += 4) dd(pattern);
  }
}

}  // namespace apron::vm
