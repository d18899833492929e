// The field's part of a snapshot: copies the heights, and hashes heights and speeds, in blocks that threads
// share.
#pragma once

#include <cstdint>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/surface/WorkerPool.h"
#include "smartsurf/world/StateHash.h"

namespace smartsurf::world {

class FieldCopy {
 public:
  // Without a pool the caller does it all.
  explicit FieldCopy(surface::WorkerPool* pool) : pool_(pool) {}

  // height becomes the field's, and the hash takes in every height and speed. Allocates at its first call
  // only.
  void take(const surface::Field&, std::vector<float>& height, StateHash&);

 private:
  surface::WorkerPool* pool_;
  std::vector<std::uint64_t> hashes_;  // one a block
};

}  // namespace smartsurf::world
