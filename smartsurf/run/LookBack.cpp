#include "smartsurf/run/LookBack.h"

#include <algorithm>

namespace smartsurf::run {
namespace {

std::size_t bytes_of(const scene::Snapshot& s) {
  constexpr std::size_t kObject = sizeof(scene::ObjectId) + 13 * sizeof(float);
  return sizeof s + s.objects() * kObject + s.height.size() * sizeof(float);
}

}  // namespace

void LookBack::clear() {
  states_.clear();
  bytes_ = first_ = 0;
  full_ = false;
}

void LookBack::add(const scene::Snapshot& snapshot) {
  if (!full_) {
    bytes_ += bytes_of(snapshot);
    full_ = bytes_ > most_bytes_ && states_.size() >= 2;
  }
  if (!full_) {
    states_.push_back(snapshot);
    return;
  }
  states_[first_] = snapshot;  // keeps the arrays' memory
  first_ = (first_ + 1) % states_.size();
}

}  // namespace smartsurf::run
