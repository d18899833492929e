// Reduces a sphere's contacts with the field to at most four: the deepest of each quadrant and the one
// straight below. They support a sphere in a pocket from all sides; the four deepest could all lie on one
// side.
#pragma once

#include "smartsurf/world/body/Vec.h"

namespace smartsurf::world {

// Candidate has a `normal` and a `separation`; the one of least kOrder is kept.
template <class Candidate, float Candidate::*kOrder = &Candidate::separation>
class SphereManifoldReducer {
 public:
  void add(const Candidate& t) {
    const bool below = t.normal.z() > 0.9999F;
    const int slot = below ? 4 : (t.normal.x() >= 0 ? 1 : 0) + (t.normal.y() >= 0 ? 2 : 0);
    if (!used_[slot] || t.*kOrder < best_[slot].*kOrder) best_[slot] = t, used_[slot] = true;
  }
  template <class Take>
  void reduce(Take take) const {
    int skip = -1;
    if (used_[0] && used_[1] && used_[2] && used_[3] && used_[4]) {
      skip = 0;
      for (int i = 1; i < 5; ++i)
        if (best_[i].*kOrder > best_[skip].*kOrder) skip = i;
    }
    for (int i = 0; i < 5; ++i)
      if (used_[i] && i != skip) take(best_[i]);
  }

 private:
  Candidate best_[5];
  bool used_[5] = {};
};

}  // namespace smartsurf::world
