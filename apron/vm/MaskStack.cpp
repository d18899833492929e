#include "apron/vm/MaskStack.h"

#include <algorithm>
#include <cassert>

namespace apron::vm {

using program::Opcode;

void MaskStack::reserve(std::uint32_t width, std::uint32_t height, std::size_t planes) {
  for (std::size_t i = 0; i < planes; ++i) free_.push_back(store_.add(width, height));
  levels_.reserve(program::kMaxMaskDepth);
}

Plane MaskStack::take(std::uint32_t width, std::uint32_t height) {
  const auto fits = [&](const Plane& p) { return p.width == width && p.height == height; };
  const auto found = std::find_if(free_.begin(), free_.end(), fits);
  if (found == free_.end()) return store_.add(width, height);  // only routines that recurse inside a where
  const Plane plane = *found;
  *found = free_.back();
  free_.pop_back();
  return plane;
}

void MaskStack::run(Opcode op, Plane y, ConstPlane a, ConstPlane b) {
  Block block;
  block.y = y.data;
  block.source = {a.data, b.data, nullptr};
  block.set_pitch(y.pitch);
  block.rows = y.height;
  block.columns = y.width;
  executor_.run(executor_.kernels().kernel(op, b.data == nullptr && op != Opcode::kCopy ? 2U : 0U, false),
                block);
}

bool MaskStack::set_base(ConstPlane mask) {
  const auto other_shape = [&](const Level& l) {
    return l.active == Active::kSome && !same_shape(l.mask, mask);
  };
  if (std::any_of(levels_.begin(), levels_.end(), other_shape)) return false;
  if (!has_base_ || !same_shape(base_, mask)) {
    if (has_base_) free_.push_back(base_);
    base_ = take(mask.width, mask.height);
  }
  has_base_ = true;
  run(Opcode::kCopy, base_, mask, {});
  combine();
  return true;
}

void MaskStack::clear_base() {
  if (has_base_) free_.push_back(base_);
  has_base_ = false;
  combine();
}

MaskStack::Active MaskStack::outer_active() const noexcept {
  return levels_.size() < 2 ? Active::kAll : levels_[levels_.size() - 2].active;
}

ConstPlane MaskStack::outer_mask() const noexcept {
  return levels_.size() < 2 ? ConstPlane{} : levels_[levels_.size() - 2].mask;
}

void MaskStack::inherit(Level& level, bool on) {
  level.active = on ? outer_active() : Active::kNone;
  level.mask = level.active == Active::kSome ? outer_mask() : ConstPlane{};
}

bool MaskStack::push(ConstPlane condition) {
  if (active_ == Active::kSome && !same_shape(mask_, condition)) return false;
  Level& level = levels_.emplace_back();
  level.own = take(condition.width, condition.height);
  level.active = outer_active() == Active::kNone ? Active::kNone : Active::kSome;
  level.mask = level.own;
  if (level.active == Active::kSome) {
    if (outer_active() == Active::kSome)
      run(Opcode::kAnd, level.own, condition, outer_mask());
    else
      run(Opcode::kNe, level.own, condition, {});
  }
  combine();
  return true;
}

void MaskStack::push(float condition) {
  Level& level = levels_.emplace_back();
  level.uniform = true;
  level.on = condition != 0.0F;
  inherit(level, level.on);
  combine();
}

void MaskStack::invert_top() {
  assert(!levels_.empty());
  Level& level = levels_.back();
  if (level.uniform) {
    level.on = !level.on;
    inherit(level, level.on);
  } else if (level.active == Active::kSome) {
    // The level is a subset of the enclosing one, both 0 or 1.
    if (outer_active() == Active::kSome)
      run(Opcode::kNe, level.own, level.own, outer_mask());
    else
      run(Opcode::kNot, level.own, level.own, level.own);
  }
  combine();
}

void MaskStack::pop() {
  assert(!levels_.empty());
  if (!levels_.back().uniform) free_.push_back(levels_.back().own);
  levels_.pop_back();
  combine();
}

void MaskStack::combine() {
  active_ = levels_.empty() ? Active::kAll : levels_.back().active;
  mask_ = active_ == Active::kSome ? levels_.back().mask : ConstPlane{};
  if (!has_base_ || active_ == Active::kNone) return;
  if (active_ == Active::kAll) {
    mask_ = base_;
  } else {
    if (both_.data == nullptr || !same_shape(both_, base_)) {
      if (both_.data != nullptr) free_.push_back(both_);
      both_ = take(base_.width, base_.height);
    }
    run(Opcode::kAnd, both_, base_, mask_);
    mask_ = both_;
  }
  active_ = Active::kSome;
}

}  // namespace apron::vm
