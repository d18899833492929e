// The active-cell masks: the base mask (mask.on) and the stack of `where` conditions, all of which must hold.
// A mask has the type of cells of its condition; it is converted where a register of another type is written.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "apron/vm/Plane.h"
#include "apron/vm/PlaneStore.h"
#include "apron/vm/kernels/Executor.h"

namespace apron::vm {

// Each push adds a level whose mask already includes the enclosing levels. Not thread-safe.
class MaskStack {
 public:
  explicit MaskStack(Executor& executor) : executor_(executor) {}

  // Allocates `planes` more mask planes of one shape, so that later calls need not allocate.
  void reserve(std::uint32_t width, std::uint32_t height, CellType type, std::size_t planes);

  // Copies `mask`. Returns false and changes nothing if an open level has another shape.
  [[nodiscard]] bool set_base(ConstPlane mask);
  void clear_base();

  // Non-zero is true. Returns false and changes nothing if the mask in force has another shape.
  [[nodiscard]] bool push(ConstPlane condition);
  void push(float condition);
  // Replaces the top level by its complement within the enclosing level.
  void invert_top();
  void pop();
  // Closes all levels and drops the base mask.
  void clear();
  std::size_t depth() const noexcept { return levels_.size(); }

  enum class Active { kAll, kNone, kSome };
  Active active() const noexcept { return active_; }
  // The mask in force, valid only with kSome: writes go to its non-zero cells.
  const ConstPlane& mask() const noexcept { return mask_; }
  // The same with cells of that type; valid until the masks change. The first call of a type may allocate.
  ConstPlane mask_as(CellType type);

 private:
  struct Level {
    bool uniform = false;  // a scalar condition
    bool enabled = false;  // its value
    Active active = Active::kAll;
    ConstPlane mask{};  // valid only with kSome: 0 or 1, includes the enclosing levels
    Plane storage{};    // owned plane of a register condition
  };

  Active enclosing_active() const noexcept;  // of the level below the top
  ConstPlane enclosing_mask() const noexcept;
  void inherit_enclosing(Level& level, bool on);
  void update_effective_mask();
  Plane acquire_plane(std::uint32_t width, std::uint32_t height, CellType type);
  void combine(program::Opcode op, Plane y, ConstPlane a, ConstPlane b);
  void apply_kernel(program::Opcode op, Plane y, ConstPlane a, ConstPlane b);

  Executor& executor_;
  PlaneStore plane_store_;
  std::vector<Plane> free_planes_;
  std::vector<Level> levels_;
  bool has_base_ = false;
  Plane base_{};
  Plane combined_{};  // base AND top level; used when both exist
  Active active_ = Active::kAll;
  ConstPlane mask_{};
  std::array<Plane, program::kCellTypeCount> converted_{};  // mask_ in other types; null: not yet
};

}  // namespace apron::vm
