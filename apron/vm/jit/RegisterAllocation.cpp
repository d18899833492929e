// Register allocation of StageAssembler: assignment, loads, eviction and release.
#include <algorithm>

#include "apron/vm/PlaneStore.h"
#include "apron/vm/jit/StageAssembler.h"

namespace apron::vm {

StageAssembler::Vector StageAssembler::allocate_vector() {
  if (free_vectors_.empty() && !evict_load() && !evict_duplicate_mask()) spill_temp();
  const int v = free_vectors_.back();
  free_vectors_.pop_back();
  return vector(v);
}

// Evicts a loaded vector, which can be loaded again. Starts with the last row streams, which later rows read.
bool StageAssembler::evict_load() {
  for (auto load = loads_.rbegin(); load != loads_.rend(); ++load) {
    if (load->second.vector_register < 0 || is_pinned(load->second.vector_register)) continue;
    free_vectors_.push_back(load->second.vector_register);
    load->second.vector_register = -1;
    return true;
  }
  return false;
}

// Evicts a mask that follows from the number in another register. Of AVX2 only: others have mask registers.
bool StageAssembler::evict_duplicate_mask() {
  if (has_masks_) return false;
  for (RegisterAssignment& temp : temps_) {
    if (temp.vector_register < 0 || temp.mask_register < 0 || is_pinned(temp.mask_register)) continue;
    free_vectors_.push_back(temp.mask_register);
    temp.mask_register = -1;
    return true;
  }
  return false;
}

// The operation that uses the value next, from the current one on; the largest number if none does.
std::uint32_t StageAssembler::next_use(std::size_t temp) const {
  const std::vector<std::uint32_t>& uses = temp_uses_[temp % stage_.ops.size()];
  const auto next = std::lower_bound(uses.begin(), uses.end(), current_op_);
  return next != uses.end() ? *next : UINT32_MAX;
}

// Moves the value that is used last to the stack. With several rows per iteration, fewer rows are better.
void StageAssembler::spill_temp() {
  if (rows_per_iteration_ > 1) throw CannotCompile{};
  RegisterAssignment* farthest = nullptr;
  std::uint32_t use = 0;
  for (std::size_t i = 0; i < temps_.size(); ++i) {
    RegisterAssignment& temp = temps_[i];
    const int held = temp.vector_register >= 0 || has_masks_ ? temp.vector_register : temp.mask_register;
    if (held < 0 || is_pinned(held) || (farthest != nullptr && next_use(i) <= use)) continue;
    farthest = &temp;
    use = next_use(i);
  }
  if (farthest == nullptr) throw CannotCompile{};
  const bool as_mask = farthest->vector_register < 0;
  int& held = as_mask ? farthest->mask_register : farthest->vector_register;
  // A value is written once, so that an earlier copy is still valid.
  if (farthest->spill_slot < 0) {
    if (free_spill_slots_.empty()) throw CannotCompile{};
    farthest->spill_slot = free_spill_slots_.back();
    free_spill_slots_.pop_back();
    farthest->spilled_mask = as_mask;
    vmovups(spill_address(farthest->spill_slot), vector(held));
  }
  free_vectors_.push_back(held);
  held = -1;
}

StageAssembler::Address StageAssembler::spill_address(int slot) const {
  return ptr[rsp + (kSpillStackOffset + slot * vector_bytes_)];
}

// Loads a spilled value that no register holds.
void StageAssembler::reload(RegisterAssignment& temp) {
  const Vector to = allocate_vector();
  vmovups(to, spill_address(temp.spill_slot));
  (temp.spilled_mask ? temp.mask_register : temp.vector_register) = to.getIdx();
}

bool StageAssembler::is_pinned(int vector) const {
  const auto holds = [&](const std::vector<int>& pinned) {
    return std::ranges::find(pinned, vector) != pinned.end();
  };
  return holds(pinned_vectors_) || (!has_masks_ && holds(pinned_masks_));
}

int StageAssembler::allocate_mask() {
  if (!has_masks_) {
    const int v = allocate_vector().getIdx();
    pinned_masks_.push_back(v);
    return v;
  }
  if (free_masks_.empty()) {
    const auto holder = std::ranges::find_if(temps_, [&](const RegisterAssignment& t) {
      return t.mask_register >= 0 && std::ranges::find(pinned_masks_, t.mask_register) == pinned_masks_.end();
    });
    if (holder == temps_.end()) throw CannotCompile{};
    if (holder->vector_register < 0 && holder->spill_slot < 0) materialize_mask(*holder);
    free_masks_.push_back(holder->mask_register);
    holder->mask_register = -1;
  }
  const int k = free_masks_.back();
  free_masks_.pop_back();
  return k;
}

// Converts a truth value in a mask register to 0 or 1 in a vector register.
void StageAssembler::materialize_mask(RegisterAssignment& temp) {
  pinned_masks_.push_back(temp.mask_register);
  const Vector v = allocate_vector();
  emit_mask_as_number(v, temp.mask_register);
  temp.vector_register = v.getIdx();
}

StageAssembler::Address StageAssembler::address(std::uint32_t row_stream, int cells) const {
  return ptr[row_pointer(row_stream) + Xbyak::util::rcx + (displacement_bytes_ + cells * cell_bytes_)];
}

int StageAssembler::load_vector(std::uint32_t row_stream, int cells) {
  RegisterAssignment& load = loads_.at({row_stream, cells});
  const auto window = windows_.find(row_stream);
  if (window != windows_.end() && cells == 0) return window->second.centre;
  if (load.vector_register >= 0) return load.vector_register;
  const Vector to = allocate_vector();
  load.vector_register = to.getIdx();
  if (window == windows_.end()) {
    vmovups(to, address(row_stream, cells));
  } else {
    const SlidingWindow& r = window->second;
    const bool west = cells < 0;
    const Vector high = vector(west ? r.centre : r.east), low = vector(west ? r.west : r.centre);
    const int step = window_step_bytes_ / cell_bytes_;
    const auto from_low = static_cast<std::uint8_t>(west ? step + cells : cells);
    if (has_masks_)
      valignd(to, high, low, from_low);
    else  // in each half of 16 bytes
      vpalignr(to, high, low, static_cast<std::uint8_t>(from_low * cell_bytes_));
  }
  return load.vector_register;
}

// Puts the operand into a vector register and pins it.
StageAssembler::Vector StageAssembler::vector_operand(const MicroOperand& arg) {
  int v = -1;
  if (arg.kind == MicroOperand::Kind::kTemp) {
    RegisterAssignment& temp = temp_of(arg.index);
    if (temp.vector_register < 0 && temp.spill_slot >= 0 && !(temp.spilled_mask && temp.mask_register >= 0))
      reload(temp);
    if (temp.vector_register < 0) materialize_mask(temp);
    v = temp.vector_register;
  } else if (arg.kind == MicroOperand::Kind::kStream) {
    v = load_vector(row_stream(arg.index), column_of(arg));
  } else {
    RegisterAssignment& scalar = scalars_.at(arg.index);
    if (scalar.vector_register < 0) {
      const Vector to = allocate_vector();
      vbroadcastss(to, ptr[rsi + arg.index * sizeof(float)]);
      scalar.vector_register = to.getIdx();
      loaded_scalars_.push_back(arg.index);
    }
    v = scalar.vector_register;
  }
  pinned_vectors_.push_back(v);
  return vector(v);
}

bool StageAssembler::is_memory_operand(const MicroOperand& arg) const {
  if (arg.kind == MicroOperand::Kind::kScalar)
    return has_masks_ && cell_bytes_ == 4 && scalars_.at(arg.index).vector_register < 0;
  if (arg.kind != MicroOperand::Kind::kStream) return false;
  const std::uint32_t from = row_stream(arg.index);
  const RegisterAssignment& load = loads_.at({from, column_of(arg)});
  return load.vector_register < 0 && load.remaining_uses == 1 && windows_.count(from) == 0;
}

StageAssembler::Address StageAssembler::memory_operand(const MicroOperand& arg) const {
  if (arg.kind == MicroOperand::Kind::kScalar) return ptr_b[rsi + arg.index * sizeof(float)];
  return address(row_stream(arg.index), column_of(arg));
}

// Puts the operand's truth value (non-zero) into a mask register and pins it.
int StageAssembler::mask_operand(const MicroOperand& arg) {
  RegisterAssignment* temp = arg.kind == MicroOperand::Kind::kTemp ? &temp_of(arg.index) : nullptr;
  if (temp != nullptr && temp->mask_register < 0 && temp->spilled_mask && temp->vector_register < 0)
    reload(*temp);
  int k = temp != nullptr ? temp->mask_register : -1;
  if (k < 0) {
    k = allocate_mask();
    pinned_masks_.push_back(k);
    if (is_integer_) {
      emit_nonzero(k, vector_operand(arg));
    } else if (has_masks_) {
      with_operand(arg, [&](const Operand& x) {
        vcmpps(Opmask(k), vector(constants_.at(kZeroBits).vector_register), x, kNotEqual);
      });
    } else {
      const Vector x = vector_operand(arg);
      with_constant(kZeroBits, [&](const Operand& zero) { emit_mask_compare(k, x, zero, kNotEqual); });
    }
    if (temp != nullptr)
      temp->mask_register = k;
    else
      (has_masks_ ? temporary_masks_ : temporaries_).push_back(k);
  }
  pinned_masks_.push_back(k);
  return k;
}

void StageAssembler::release_use(const MicroOperand& arg) {
  if (arg.kind == MicroOperand::Kind::kTemp) {
    RegisterAssignment& temp = temp_of(arg.index);
    if (--temp.remaining_uses > 0) return;
    if (temp.vector_register >= 0) free_vectors_.push_back(temp.vector_register);
    if (temp.mask_register >= 0) release_mask(temp.mask_register);
    if (temp.spill_slot >= 0) free_spill_slots_.push_back(temp.spill_slot);
    temp = {};
  } else if (arg.kind == MicroOperand::Kind::kStream) {
    RegisterAssignment& load = loads_.at({row_stream(arg.index), column_of(arg)});
    if (--load.remaining_uses > 0 || load.vector_register < 0) return;
    free_vectors_.push_back(load.vector_register);
    load.vector_register = -1;
  }
}

// Releases the registers that only the current operation needed, and all pins.
void StageAssembler::release_temporaries() {
  free_vectors_.insert(free_vectors_.end(), temporaries_.begin(), temporaries_.end());
  free_masks_.insert(free_masks_.end(), temporary_masks_.begin(), temporary_masks_.end());
  temporaries_.clear();
  temporary_masks_.clear();
  pinned_vectors_.clear();
  pinned_masks_.clear();
}

// Releases the registers of scalars that only the current operation needed, of all its vectors.
void StageAssembler::release_loaded_scalars() {
  for (const std::uint32_t slot : loaded_scalars_) {
    free_vectors_.push_back(scalars_.at(slot).vector_register);
    scalars_.at(slot).vector_register = -1;
  }
  loaded_scalars_.clear();
}

StageAssembler::Vector StageAssembler::allocate_result(RegisterAssignment& y) {
  const Vector v = allocate_vector();
  y.vector_register = v.getIdx();
  pinned_vectors_.push_back(y.vector_register);
  return v;
}

StageAssembler::Vector StageAssembler::allocate_temporary() {
  const Vector v = allocate_vector();
  temporaries_.push_back(v.getIdx());
  pinned_vectors_.push_back(v.getIdx());
  return v;
}

}  // namespace apron::vm
