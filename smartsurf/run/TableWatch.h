// Tells which objects leave the table: their centre was over it, within the outline of its cells and above
// its lowest height, and is no more. Fixed objects, and those that never were over it, do not count.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/scene/TableOutline.h"

namespace smartsurf::run {

class TableWatch {
 public:
  explicit TableWatch(const scene::SurfaceSpec&);

  // Once for each snapshot, in the order of time. catalogue: every object ever created, index = id. Allocates
  // only when it has grown, or as many objects leave as never before.
  void watch(const scene::Snapshot&, const std::vector<scene::ObjectSpec>& catalogue);

  // Those that left between the last two snapshots, ascending.
  std::span<const scene::ObjectId> left() const noexcept { return left_; }
  std::uint64_t left_so_far() const noexcept { return left_so_far_; }
  // Objects of the last snapshot, fixed ones and all, that are not over the table.
  std::size_t off() const noexcept { return off_; }

 private:
  bool is_over(const std::array<float, 3>& position) const noexcept;

  scene::TableOutline outline_;
  double lowest_;
  std::vector<char> was_over_;  // by id
  std::vector<scene::ObjectId> left_;
  std::uint64_t left_so_far_ = 0;
  std::size_t off_ = 0;
};

}  // namespace smartsurf::run
