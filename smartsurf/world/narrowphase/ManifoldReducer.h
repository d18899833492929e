// Of many points of contact the few that hold a body best.
#pragma once

#include "smartsurf/world/Vec.h"

namespace smartsurf::world {

// Points of contact, side by side, from which those that hold a body best are chosen.
class ReductionPoints {
 public:
  static constexpr int kCapacity = 96;

  int count() const { return count_; }
  void clear() { count_ = 0; }
  // There must be room. A point with an infinite gap is never chosen.
  void add(const Vec3& point, float separation) { set(count_++, point, separation); }
  void set(int i, const Vec3& point, float separation) {
    x_[i] = point.x(), y_[i] = point.y(), z_[i] = point.z();
    separation_[i] = separation;
  }
  Vec3 at(int i) const { return {x_[i], y_[i], z_[i]}; }
  float separation(int i) const { return separation_[i]; }
  // The first one of the least or the widest gap; there must be any.
  int deepest() const;
  int most_separated() const;
  // At most four: the deepest, the one farthest from it, the one farthest from their line, and the one that
  // widens them most. Returns how many.
  int select(int (&chosen)[4]);

 private:
  // The point of the greatest spread(x, y, z) less its gap: −1 where none is noticeable.
  template <class Spread>
  int argmax(Spread measure) const;

  alignas(16) float x_[kCapacity];
  alignas(16) float y_[kCapacity];
  alignas(16) float z_[kCapacity];
  alignas(16) float separation_[kCapacity];
  int count_ = 0;
};

struct ManifoldCandidate {
  Vec3 point, normal;
  float separation;
  int tag;
};

// Candidates in a list of fixed size, from which those that hold a body best are chosen.
class ManifoldReducer {
 public:
  // When the list is full, the widest gap gives way.
  void add(const ManifoldCandidate&);
  int count() const { return points_.count(); }
  void clear() { points_.clear(); }
  template <class Each>
  void for_each(Each each) const {
    for (int i = 0; i < count(); ++i) each(at(i));
  }
  // One in the middle of all, with the first one's normal and tag. There must be any.
  ManifoldCandidate average() const;
  // Infinity where there is none.
  float min_separation() const;
  // Those that hold the body best, at most four.
  template <class Take>
  void reduce(Take take) {
    int chosen[4];
    const int n = points_.select(chosen);
    for (int i = 0; i < n; ++i) take(at(chosen[i]));
  }

 private:
  ManifoldCandidate at(int i) const { return {points_.at(i), normal_[i], points_.separation(i), tag_[i]}; }

  ReductionPoints points_;
  Vec3 normal_[ReductionPoints::kCapacity];
  int tag_[ReductionPoints::kCapacity];
};

}  // namespace smartsurf::world
