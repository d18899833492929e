// The assembler's registers: which holds what, what is loaded when, what makes room.
#include <algorithm>

#include "apron/vm/PlaneStore.h"
#include "apron/vm/StageAssembler.h"

namespace apron::vm {

StageAssembler::Zmm StageAssembler::new_vector() {
  if (free_.empty()) evict();
  const int v = free_.back();
  free_.pop_back();
  return Zmm(v);
}

// What was loaded can be loaded again; the last lines are those that later rows read.
void StageAssembler::evict() {
  for (auto load = loads_.rbegin(); load != loads_.rend(); ++load) {
    if (load->second.vector < 0 || pinned(load->second.vector)) continue;
    free_.push_back(load->second.vector);
    load->second.vector = -1;
    return;
  }
  throw DoesNotFit{};
}

bool StageAssembler::pinned(int vector) const {
  return std::find(pinned_.begin(), pinned_.end(), vector) != pinned_.end();
}

int StageAssembler::new_mask() {
  if (free_masks_.empty()) {
    const auto holder = std::find_if(temps_.begin(), temps_.end(), [&](const Value& t) {
      return t.mask >= 0 &&
             std::find(pinned_masks_.begin(), pinned_masks_.end(), t.mask) == pinned_masks_.end();
    });
    if (holder == temps_.end()) throw DoesNotFit{};
    if (holder->vector < 0) as_vector(*holder);
    free_masks_.push_back(holder->mask);
    holder->mask = -1;
  }
  const int k = free_masks_.back();
  free_masks_.pop_back();
  return k;
}

// A truth value as 0 or 1.
void StageAssembler::as_vector(Value& temp) {
  const Zmm v = new_vector();
  vmovaps(v | Opmask(temp.mask) | T_z, one());
  temp.vector = v.getIdx();
}

StageAssembler::Address StageAssembler::address(std::uint32_t line, int cells) const {
  return ptr[pointer(line) + Xbyak::util::rcx + (ahead_ + cells * static_cast<int>(sizeof(float)))];
}

int StageAssembler::loaded(std::uint32_t line, int cells) {
  Value& load = loads_.at({line, cells});
  const auto rolling = rolling_.find(line);
  if (rolling != rolling_.end() && cells == 0) return rolling->second.own;
  if (load.vector >= 0) return load.vector;
  const Zmm to = new_vector();
  load.vector = to.getIdx();
  if (rolling == rolling_.end()) {
    vmovups(to, address(line, cells));
  } else {
    const Rolling& r = rolling->second;
    const bool west = cells < 0;
    valignd(to, Zmm(west ? r.own : r.east), Zmm(west ? r.west : r.own),
            static_cast<std::uint8_t>(west ? static_cast<int>(kLanes) + cells : cells));
  }
  return load.vector;
}

// The operand in a vector register.
StageAssembler::Zmm StageAssembler::vector(const MicroArg& arg) {
  int v = -1;
  if (arg.kind == MicroArg::Kind::kTemp) {
    Value& temp = temps_[arg.index];
    if (temp.vector < 0) as_vector(temp);
    v = temp.vector;
  } else if (arg.kind == MicroArg::Kind::kStream) {
    v = loaded(line(arg.index), arg.dx);
  } else {
    v = scalars_.at(arg.index).vector;
    if (v < 0) {
      const Zmm to = new_vector();
      vbroadcastss(to, ptr[rsi + arg.index * sizeof(float)]);
      v = to.getIdx();
      loose_.push_back(v);
    }
  }
  pinned_.push_back(v);
  return Zmm(v);
}

bool StageAssembler::in_memory(const MicroArg& arg) const {
  if (arg.kind == MicroArg::Kind::kScalar) return scalars_.at(arg.index).vector < 0;
  if (arg.kind != MicroArg::Kind::kStream) return false;
  const std::uint32_t from = line(arg.index);
  const Value& load = loads_.at({from, arg.dx});
  return load.vector < 0 && load.uses == 1 && rolling_.count(from) == 0;
}

StageAssembler::Address StageAssembler::place(const MicroArg& arg) const {
  if (arg.kind == MicroArg::Kind::kScalar) return ptr_b[rsi + arg.index * sizeof(float)];
  return address(line(arg.index), arg.dx);
}

// The mask register that says where the operand is true.
int StageAssembler::truth(const MicroArg& arg) {
  Value* temp = arg.kind == MicroArg::Kind::kTemp ? &temps_[arg.index] : nullptr;
  int k = temp != nullptr ? temp->mask : -1;
  if (k < 0) {
    k = new_mask();
    pinned_masks_.push_back(k);
    with_operand(arg, [&](const auto& x) { vcmpps(Opmask(k), zero(), x, kNotEqual); });
    if (temp != nullptr)
      temp->mask = k;
    else
      loose_masks_.push_back(k);
  }
  pinned_masks_.push_back(k);
  return k;
}

void StageAssembler::used(const MicroArg& arg) {
  if (arg.kind == MicroArg::Kind::kTemp) {
    Value& temp = temps_[arg.index];
    if (--temp.uses > 0) return;
    if (temp.vector >= 0) free_.push_back(temp.vector);
    if (temp.mask >= 0) free_masks_.push_back(temp.mask);
    temp.vector = temp.mask = -1;
  } else if (arg.kind == MicroArg::Kind::kStream) {
    Value& load = loads_.at({line(arg.index), arg.dx});
    if (--load.uses > 0 || load.vector < 0) return;
    free_.push_back(load.vector);
    load.vector = -1;
  }
}

// What only the operation at hand needed.
void StageAssembler::release() {
  free_.insert(free_.end(), loose_.begin(), loose_.end());
  free_masks_.insert(free_masks_.end(), loose_masks_.begin(), loose_masks_.end());
  loose_.clear();
  loose_masks_.clear();
  pinned_.clear();
  pinned_masks_.clear();
}

StageAssembler::Zmm StageAssembler::result(Value& y) {
  const Zmm v = new_vector();
  y.vector = v.getIdx();
  pinned_.push_back(y.vector);
  return v;
}

StageAssembler::Zmm StageAssembler::loose() {
  const Zmm v = new_vector();
  loose_.push_back(v.getIdx());
  pinned_.push_back(v.getIdx());
  return v;
}

}  // namespace apron::vm
