#include "smartsurf/run/display/SnapshotHistory.h"

#include <algorithm>

namespace smartsurf::run {
namespace {

std::size_t snapshot_bytes(const scene::Snapshot& s) {
  constexpr std::size_t kBytesPerObject = sizeof(scene::ObjectId) + 13 * sizeof(float);
  return sizeof s + s.object_count() * kBytesPerObject + s.height.size() * sizeof(float);
}

}  // namespace

void SnapshotHistory::clear() {
  snapshots_.clear();
  bytes_ = oldest_ = 0;
  full_ = false;
}

void SnapshotHistory::add(const scene::Snapshot& snapshot) {
  if (!full_) {
    bytes_ += snapshot_bytes(snapshot);
    full_ = bytes_ > max_bytes_ && snapshots_.size() >= 2;
  }
  if (!full_) {
    snapshots_.push_back(snapshot);
    return;
  }
  snapshots_[oldest_] = snapshot;  // reuses the arrays' memory
  oldest_ = (oldest_ + 1) % snapshots_.size();
}

}  // namespace smartsurf::run
