// The latest snapshots of a run, for scrubbing back. The simulation itself is not rewound.
#pragma once

#include <cstddef>
#include <vector>

#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::run {

class SnapshotHistory {
 public:
  // max_bytes: limit of all snapshots together; at least two are kept.
  explicit SnapshotHistory(std::size_t max_bytes = std::size_t{96} << 20) : max_bytes_(max_bytes) {}

  // Copies the snapshot, replacing the oldest one once the limit is reached; allocates until then.
  void add(const scene::Snapshot& snapshot);
  void clear();

  std::size_t size() const { return snapshots_.size(); }
  // 0 is the oldest.
  const scene::Snapshot& at(std::size_t i) const { return snapshots_[(oldest_ + i) % snapshots_.size()]; }

 private:
  std::size_t max_bytes_, bytes_ = 0;
  std::size_t oldest_ = 0;
  bool full_ = false;
  std::vector<scene::Snapshot> snapshots_;  // a ring buffer once full
};

}  // namespace smartsurf::run
