// The last states of a run, to look back on. They are pictures of the past: the simulation stays where it is.
#pragma once

#include <cstddef>
#include <vector>

#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::run {

class LookBack {
 public:
  // most_bytes: that all states together may take; at least two are kept.
  explicit LookBack(std::size_t most_bytes = std::size_t{96} << 20) : most_bytes_(most_bytes) {}

  // Copies the state; the oldest make room. Allocates until the room is full.
  void add(const scene::Snapshot& snapshot);
  void clear();

  std::size_t size() const { return states_.size(); }
  // 0 is the oldest.
  const scene::Snapshot& at(std::size_t i) const { return states_[(first_ + i) % states_.size()]; }

 private:
  std::size_t most_bytes_, bytes_ = 0;
  std::size_t first_ = 0;
  bool full_ = false;
  std::vector<scene::Snapshot> states_;  // a ring once it is full
};

}  // namespace smartsurf::run
