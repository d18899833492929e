// Of many points of contact the few that hold a body best.
#pragma once

#include "smartsurf/world/Vec.h"

namespace smartsurf::world {

// Points of contact, side by side, from which those that hold a body best are chosen.
class SupportPoints {
 public:
  static constexpr int kCapacity = 96;

  int count() const { return count_; }
  void clear() { count_ = 0; }
  // There must be room. A point with an infinite gap is never chosen.
  void add(const Vec3& at, float gap) { put(count_++, at, gap); }
  void put(int i, const Vec3& at, float gap) {
    x_[i] = at.x(), y_[i] = at.y(), z_[i] = at.z();
    gap_[i] = gap;
  }
  Vec3 at(int i) const { return {x_[i], y_[i], z_[i]}; }
  float gap(int i) const { return gap_[i]; }
  // The first one of the least or the widest gap; there must be any.
  int deepest() const;
  int widest() const;
  // At most four: the deepest, the one farthest from it, the one farthest from their line, and the one that
  // widens them most. Returns how many.
  int choose(int (&chosen)[4]);

 private:
  // The point of the greatest spread(x, y, z) less its gap: −1 where none is noticeable.
  template <class Spread>
  int best(Spread spread) const;

  alignas(16) float x_[kCapacity];
  alignas(16) float y_[kCapacity];
  alignas(16) float z_[kCapacity];
  alignas(16) float gap_[kCapacity];
  int count_ = 0;
};

struct Candidate {
  Vec3 point, normal;
  float gap;
  int tag;
};

// Candidates in a list of fixed size, from which those that hold a body best are chosen.
class Candidates {
 public:
  // When the list is full, the widest gap gives way.
  void add(const Candidate&);
  int count() const { return points_.count(); }
  void clear() { points_.clear(); }
  template <class Each>
  void each(Each each) const {
    for (int i = 0; i < count(); ++i) each(at(i));
  }
  // One in the middle of all, with the first one's normal and tag. There must be any.
  Candidate mean() const;
  // Infinity where there is none.
  float least_gap() const;
  // Those that hold the body best, at most four.
  template <class Take>
  void pick(Take take) {
    int chosen[4];
    const int n = points_.choose(chosen);
    for (int i = 0; i < n; ++i) take(at(chosen[i]));
  }

 private:
  Candidate at(int i) const { return {points_.at(i), normal_[i], points_.gap(i), tag_[i]}; }

  SupportPoints points_;
  Vec3 normal_[SupportPoints::kCapacity];
  int tag_[SupportPoints::kCapacity];
};

}  // namespace smartsurf::world
