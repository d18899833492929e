#include "apron/vm/MaskStack.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace apron::vm {

using program::Opcode;

void MaskStack::reserve(std::uint32_t width, std::uint32_t height, CellType type, std::size_t planes) {
  for (std::size_t i = 0; i < planes; ++i) free_planes_.push_back(plane_store_.allocate(width, height, type));
  levels_.reserve(program::kMaxMaskDepth);
}

Plane MaskStack::acquire_plane(std::uint32_t width, std::uint32_t height, CellType type) {
  const auto fits = [&](const Plane& p) { return p.width == width && p.height == height && p.type == type; };
  const auto found = std::ranges::find_if(free_planes_, fits);
  // Reached only by routines that recurse inside a where, and by masks over registers of another type.
  if (found == free_planes_.end()) return plane_store_.allocate(width, height, type);
  const Plane plane = *found;
  *found = free_planes_.back();
  free_planes_.pop_back();
  return plane;
}

void MaskStack::apply_kernel(Opcode op, Plane y, ConstPlane a, ConstPlane b) {
  Block block(y);
  block.source = {a.data, b.data, nullptr};
  executor_.run_kernel(
      executor_.kernels().kernel(op, b.data == nullptr && op != Opcode::kNot ? 2U : 0U, false, y.type),
      block);
}

// Like apply_kernel(), with a b of any type.
void MaskStack::combine(Opcode op, Plane y, ConstPlane a, ConstPlane b) {
  if (b.type == y.type) return apply_kernel(op, y, a, b);
  const Plane scratch = acquire_plane(y.width, y.height, y.type);
  convert_plane(executor_, scratch, b);
  apply_kernel(op, y, a, scratch);
  free_planes_.push_back(scratch);
}

ConstPlane MaskStack::mask_as(CellType type) {
  if (mask_.type == type) return mask_;
  Plane& converted = converted_[index_of(type)];
  if (converted.data == nullptr) {
    converted = acquire_plane(mask_.width, mask_.height, type);
    convert_plane(executor_, converted, mask_);
  }
  return converted;
}

bool MaskStack::set_base(ConstPlane mask) {
  const auto other_shape = [&](const Level& l) {
    return l.active == Active::kSome && !same_shape(l.mask, mask);
  };
  if (std::ranges::any_of(levels_, other_shape)) return false;
  if (!has_base_ || !same_shape_and_type(base_, mask)) {
    if (has_base_) free_planes_.push_back(base_);
    base_ = acquire_plane(mask.width, mask.height, mask.type);
  }
  has_base_ = true;
  apply_kernel(Opcode::kNe, base_, mask, {});
  update_effective_mask();
  return true;
}

void MaskStack::clear_base() {
  if (has_base_) free_planes_.push_back(base_);
  has_base_ = false;
  update_effective_mask();
}

MaskStack::Active MaskStack::enclosing_active() const noexcept {
  return levels_.size() < 2 ? Active::kAll : levels_[levels_.size() - 2].active;
}

ConstPlane MaskStack::enclosing_mask() const noexcept {
  return levels_.size() < 2 ? ConstPlane{} : levels_[levels_.size() - 2].mask;
}

void MaskStack::inherit_enclosing(Level& level, bool on) {
  level.active = on ? enclosing_active() : Active::kNone;
  level.mask = level.active == Active::kSome ? enclosing_mask() : ConstPlane{};
}

bool MaskStack::push(ConstPlane condition) {
  if (active_ == Active::kSome && !same_shape(mask_, condition)) return false;
  Level& level = levels_.emplace_back();
  level.storage = acquire_plane(condition.width, condition.height, condition.type);
  level.active = enclosing_active() == Active::kNone ? Active::kNone : Active::kSome;
  level.mask = level.storage;
  if (level.active == Active::kSome) {
    if (enclosing_active() == Active::kSome)
      combine(Opcode::kAnd, level.storage, condition, enclosing_mask());
    else
      apply_kernel(Opcode::kNe, level.storage, condition, {});
  }
  update_effective_mask();
  return true;
}

void MaskStack::push(float condition) {
  Level& level = levels_.emplace_back();
  level.uniform = true;
  level.enabled = condition != 0.0F;
  inherit_enclosing(level, level.enabled);
  update_effective_mask();
}

void MaskStack::invert_top() {
  assert(!levels_.empty());
  Level& level = levels_.back();
  if (level.uniform) {
    level.enabled = !level.enabled;
    inherit_enclosing(level, level.enabled);
  } else if (level.active == Active::kSome) {
    // Both masks are 0 or 1 and the level is a subset of the enclosing one, so != is set difference.
    if (enclosing_active() == Active::kSome)
      combine(Opcode::kNe, level.storage, level.storage, enclosing_mask());
    else
      apply_kernel(Opcode::kNot, level.storage, level.storage, level.storage);
  }
  update_effective_mask();
}

void MaskStack::pop() {
  assert(!levels_.empty());
  if (!levels_.back().uniform) free_planes_.push_back(levels_.back().storage);
  levels_.pop_back();
  update_effective_mask();
}

void MaskStack::clear() {
  while (!levels_.empty()) pop();
  clear_base();
}

// Recomputes the mask in force: the top level, combined with the base mask.
void MaskStack::update_effective_mask() {
  for (Plane& converted : converted_)
    if (converted.data != nullptr) free_planes_.push_back(std::exchange(converted, {}));
  active_ = levels_.empty() ? Active::kAll : levels_.back().active;
  mask_ = active_ == Active::kSome ? levels_.back().mask : ConstPlane{};
  if (!has_base_ || active_ == Active::kNone) return;
  if (active_ == Active::kAll) {
    mask_ = base_;
  } else {
    if (combined_.data == nullptr || !same_shape_and_type(combined_, base_)) {
      if (combined_.data != nullptr) free_planes_.push_back(combined_);
      combined_ = acquire_plane(base_.width, base_.height, base_.type);
    }
    combine(Opcode::kAnd, combined_, base_, mask_);
    mask_ = combined_;
  }
  active_ = Active::kSome;
}

}  // namespace apron::vm
