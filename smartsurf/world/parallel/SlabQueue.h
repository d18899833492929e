// The slabs that the members of a team have not begun yet.
#pragma once

#include <atomic>
#include <memory>

#include "smartsurf/world/parallel/IndexRange.h"

namespace smartsurf::world {

// A member takes the slabs of its own share and then what others have not begun, because shares are of equal
// estimated work only. Members of a pair work towards the boundary between their shares, so that what one
// takes from the other lies next to its own.
class SlabQueue {
 public:
  // Call from one thread before the members take slabs.
  void reset(int members) {
    if (members != members_) taken_ = std::make_unique<Taken[]>(members);
    members_ = members;
    for (int i = 0; i < members; ++i) taken_[i].count.store(0, std::memory_order_relaxed);
  }

  // The next slab for a member, or -1. share_of(m): the slabs of member m.
  template <class ShareOf>
  int take(int member, ShareOf share_of) {
    for (int k = 0; k < members_; ++k) {
      // The own share first, then that of the other of the pair.
      const int owner = (member % 2 == 0 ? member + k : member + members_ - k) % members_;
      const IndexRange slabs = share_of(owner);
      const int count = slabs.end - slabs.begin;
      std::atomic<int>& taken = taken_[owner].count;
      if (taken.load(std::memory_order_relaxed) >= count) continue;
      const int position = taken.fetch_add(1, std::memory_order_relaxed);
      if (position >= count) continue;
      return owner % 2 == 0 ? slabs.begin + position : slabs.end - 1 - position;
    }
    return -1;
  }

 private:
  struct alignas(64) Taken {
    std::atomic<int> count{0};
  };
  std::unique_ptr<Taken[]> taken_;
  int members_ = 0;
};

}  // namespace smartsurf::world
