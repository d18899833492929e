// The active-cell masks: the base mask (mask.on) and the stack of `where` conditions, all of which must hold.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/vm/Executor.h"
#include "apron/vm/Plane.h"
#include "apron/vm/PlaneStore.h"

namespace apron::vm {

class MaskStack {
 public:
  explicit MaskStack(Executor& executor) : executor_(executor) {}

  // Makes room for `planes` more masks of a shape, so that they need no allocation later.
  void reserve(std::uint32_t width, std::uint32_t height, std::size_t planes);

  // False, and nothing changed, if the mask in force has another shape.
  [[nodiscard]] bool set_base(ConstPlane mask);
  void clear_base();

  [[nodiscard]] bool push(ConstPlane condition);
  void push(float condition);
  // The top condition becomes: the cells of the enclosing one that it left out.
  void invert_top();
  void pop();
  std::size_t depth() const noexcept { return levels_.size(); }

  enum class Active { kAll, kNone, kSome };
  Active active() const noexcept { return active_; }
  // With kSome: non-zero where a write is let through.
  const ConstPlane& mask() const noexcept { return mask_; }

 private:
  struct Level {
    bool uniform = false;  // a scalar condition
    bool enabled = false;  // its value
    Active active = Active::kAll;
    ConstPlane mask{};  // 0 or 1, with the enclosing levels ANDed in; with kSome
    Plane storage{};    // the storage of a condition that is a register
  };

  Active enclosing_active() const noexcept;  // below the top level
  ConstPlane enclosing_mask() const noexcept;
  void inherit_enclosing(Level& level, bool on);
  void update_effective_mask();
  Plane acquire_plane(std::uint32_t width, std::uint32_t height);
  void apply_kernel(program::Opcode op, Plane y, ConstPlane a, ConstPlane b);

  Executor& executor_;
  PlaneStore plane_store_;
  std::vector<Plane> free_planes_;
  std::vector<Level> levels_;
  bool has_base_ = false;
  Plane base_{};
  Plane combined_{};  // base AND top level, when there are both
  Active active_ = Active::kAll;
  ConstPlane mask_{};
};

}  // namespace apron::vm
