// The field's part of a snapshot: copies the heights, and hashes heights and speeds, in blocks that threads
// share.
#pragma once

#include <cstdint>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/world/StateHash.h"

namespace smartsurf::world {

class FieldHasher {
 public:
  // Without a pool the caller does it all.
  explicit FieldHasher(common::ThreadPool* pool) : pool_(pool) {}

  // height becomes the field's, and the hash takes in every height and speed. Allocates at its first call
  // only.
  void copy_and_hash(const surface::Field&, std::vector<float>& height, StateHash&);

 private:
  common::ThreadPool* pool_;
  std::vector<std::uint64_t> block_hashes_;  // one a block
};

}  // namespace smartsurf::world
