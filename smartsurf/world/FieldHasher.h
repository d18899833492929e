// Copies the field's heights into a snapshot and hashes heights and speeds, in blocks shared among threads.
#pragma once

#include <cstdint>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/world/StateHash.h"

namespace smartsurf::world {

class FieldHasher {
 public:
  // `pool` must outlive the hasher; null: everything runs on the caller.
  explicit FieldHasher(common::ThreadPool* pool) : pool_(pool) {}

  // Copies Field::height into `height` and adds every height and speed to the hash. The hash does not depend on
  // the number of threads. Allocates in the first call only.
  void copy_and_hash(const surface::Field&, std::vector<float>& height, StateHash&);

 private:
  common::ThreadPool* pool_;
  std::vector<std::uint64_t> block_hashes_;  // one per block
};

}  // namespace smartsurf::world
