// A 64-bit hash of a state's bits, equal for equal bits on every machine and instruction set: StateHash of
// the values added to it, FieldHasher of a field's heights and speeds on several threads.
//
// Not cryptographic. The result depends on how the values are split into calls.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/hash/Fnv.h"
#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/Field.h"

namespace smartsurf::world {

class StateHash {
 public:
  void add(std::span<const float> values) noexcept;
  void add(std::uint32_t word) noexcept;
  std::uint64_t value() const noexcept { return value_; }

  // Long arrays are hashed in this many independent chains: a single chain would be bound by the latency of
  // its multiplication.
  static constexpr std::size_t kChains = 32;

 private:
  std::uint64_t value_ = common::kFnvBasis;
};

// Hash of the ids and states of a snapshot's objects.
StateHash hash_objects(const scene::Snapshot&);

// Copies the field's heights into a snapshot and hashes heights and speeds, in blocks shared among threads.
class FieldHasher {
 public:
  // `pool` must outlive the hasher; null: everything runs on the caller.
  explicit FieldHasher(common::ThreadPool* pool) : pool_(pool) {}

  // Copies Field::height into `height` and adds every height and speed to the hash. The hash does not depend
  // on the number of threads. `changed`: whether any height or speed may differ from those of the last call.
  // Allocates in the first call only.
  void copy_and_hash(const surface::Field&, bool changed, std::vector<float>& height, StateHash&);

 private:
  common::ThreadPool* pool_;
  std::vector<std::uint64_t> block_hashes_;  // one per block
};

}  // namespace smartsurf::world
