// Register allocation of StageAssembler: assignment, loads, eviction and release.
#include <algorithm>

#include "apron/vm/PlaneStore.h"
#include "apron/vm/jit/StageAssembler.h"

namespace apron::vm {

StageAssembler::Zmm StageAssembler::allocate_vector() {
  if (free_vectors_.empty()) evict_load();
  const int v = free_vectors_.back();
  free_vectors_.pop_back();
  return Zmm(v);
}

// Evicts a loaded vector, which can be loaded again. Starts with the last row streams, which later rows read.
void StageAssembler::evict_load() {
  for (auto load = loads_.rbegin(); load != loads_.rend(); ++load) {
    if (load->second.vector_register < 0 || is_pinned(load->second.vector_register)) continue;
    free_vectors_.push_back(load->second.vector_register);
    load->second.vector_register = -1;
    return;
  }
  throw CannotCompile{};
}

bool StageAssembler::is_pinned(int vector) const {
  return std::find(pinned_vectors_.begin(), pinned_vectors_.end(), vector) != pinned_vectors_.end();
}

int StageAssembler::allocate_mask() {
  if (free_masks_.empty()) {
    const auto holder = std::find_if(temps_.begin(), temps_.end(), [&](const RegisterAssignment& t) {
      return t.mask_register >= 0 &&
             std::find(pinned_masks_.begin(), pinned_masks_.end(), t.mask_register) == pinned_masks_.end();
    });
    if (holder == temps_.end()) throw CannotCompile{};
    if (holder->vector_register < 0) materialize_mask(*holder);
    free_masks_.push_back(holder->mask_register);
    holder->mask_register = -1;
  }
  const int k = free_masks_.back();
  free_masks_.pop_back();
  return k;
}

// Converts a truth value in a mask register to 0 or 1 in a vector register.
void StageAssembler::materialize_mask(RegisterAssignment& temp) {
  const Zmm v = allocate_vector();
  vmovaps(v | Opmask(temp.mask_register) | T_z, one_register());
  temp.vector_register = v.getIdx();
}

StageAssembler::Address StageAssembler::address(std::uint32_t row_stream, int cells) const {
  return ptr[row_pointer(row_stream) + Xbyak::util::rcx +
             (displacement_bytes_ + cells * static_cast<int>(sizeof(float)))];
}

int StageAssembler::load_vector(std::uint32_t row_stream, int cells) {
  RegisterAssignment& load = loads_.at({row_stream, cells});
  const auto window = windows_.find(row_stream);
  if (window != windows_.end() && cells == 0) return window->second.centre;
  if (load.vector_register >= 0) return load.vector_register;
  const Zmm to = allocate_vector();
  load.vector_register = to.getIdx();
  if (window == windows_.end()) {
    vmovups(to, address(row_stream, cells));
  } else {
    const SlidingWindow& r = window->second;
    const bool west = cells < 0;
    valignd(to, Zmm(west ? r.centre : r.east), Zmm(west ? r.west : r.centre),
            static_cast<std::uint8_t>(west ? static_cast<int>(kLanes) + cells : cells));
  }
  return load.vector_register;
}

// Puts the operand into a vector register and pins it.
StageAssembler::Zmm StageAssembler::vector_operand(const MicroOperand& arg) {
  int v = -1;
  if (arg.kind == MicroOperand::Kind::kTemp) {
    RegisterAssignment& temp = temps_[arg.index];
    if (temp.vector_register < 0) materialize_mask(temp);
    v = temp.vector_register;
  } else if (arg.kind == MicroOperand::Kind::kStream) {
    v = load_vector(row_stream(arg.index), arg.dx);
  } else {
    v = scalars_.at(arg.index).vector_register;
    if (v < 0) {
      const Zmm to = allocate_vector();
      vbroadcastss(to, ptr[rsi + arg.index * sizeof(float)]);
      v = to.getIdx();
      temporaries_.push_back(v);
    }
  }
  pinned_vectors_.push_back(v);
  return Zmm(v);
}

bool StageAssembler::is_memory_operand(const MicroOperand& arg) const {
  if (arg.kind == MicroOperand::Kind::kScalar) return scalars_.at(arg.index).vector_register < 0;
  if (arg.kind != MicroOperand::Kind::kStream) return false;
  const std::uint32_t from = row_stream(arg.index);
  const RegisterAssignment& load = loads_.at({from, arg.dx});
  return load.vector_register < 0 && load.remaining_uses == 1 && windows_.count(from) == 0;
}

StageAssembler::Address StageAssembler::memory_operand(const MicroOperand& arg) const {
  if (arg.kind == MicroOperand::Kind::kScalar) return ptr_b[rsi + arg.index * sizeof(float)];
  return address(row_stream(arg.index), arg.dx);
}

// Puts the operand's truth value (non-zero) into a mask register and pins it.
int StageAssembler::mask_operand(const MicroOperand& arg) {
  RegisterAssignment* temp = arg.kind == MicroOperand::Kind::kTemp ? &temps_[arg.index] : nullptr;
  int k = temp != nullptr ? temp->mask_register : -1;
  if (k < 0) {
    k = allocate_mask();
    pinned_masks_.push_back(k);
    with_operand(arg, [&](const auto& x) { vcmpps(Opmask(k), zero_register(), x, kNotEqual); });
    if (temp != nullptr)
      temp->mask_register = k;
    else
      temporary_masks_.push_back(k);
  }
  pinned_masks_.push_back(k);
  return k;
}

void StageAssembler::release_use(const MicroOperand& arg) {
  if (arg.kind == MicroOperand::Kind::kTemp) {
    RegisterAssignment& temp = temps_[arg.index];
    if (--temp.remaining_uses > 0) return;
    if (temp.vector_register >= 0) free_vectors_.push_back(temp.vector_register);
    if (temp.mask_register >= 0) free_masks_.push_back(temp.mask_register);
    temp.vector_register = temp.mask_register = -1;
  } else if (arg.kind == MicroOperand::Kind::kStream) {
    RegisterAssignment& load = loads_.at({row_stream(arg.index), arg.dx});
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

StageAssembler::Zmm StageAssembler::allocate_result(RegisterAssignment& y) {
  const Zmm v = allocate_vector();
  y.vector_register = v.getIdx();
  pinned_vectors_.push_back(y.vector_register);
  return v;
}

StageAssembler::Zmm StageAssembler::allocate_temporary() {
  const Zmm v = allocate_vector();
  temporaries_.push_back(v.getIdx());
  pinned_vectors_.push_back(v.getIdx());
  return v;
}

}  // namespace apron::vm
