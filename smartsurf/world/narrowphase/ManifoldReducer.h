// Reduces a manifold to the few points with the widest support.
#pragma once

#include "smartsurf/world/Vec.h"

namespace smartsurf::world {

// Candidate points as a structure of arrays.
class ReductionPoints {
 public:
  static constexpr int kCapacity = 96;

  int count() const { return count_; }
  void clear() { count_ = 0; }
  // Precondition: count() < kCapacity. A point with infinite separation is never selected.
  void add(const Vec3& point, float separation) { set(count_++, point, separation); }
  void set(int i, const Vec3& point, float separation) {
    x_[i] = point.x(), y_[i] = point.y(), z_[i] = point.z();
    separation_[i] = separation;
  }
  Vec3 at(int i) const { return {x_[i], y_[i], z_[i]}; }
  float separation(int i) const { return separation_[i]; }
  // Index of the least separation; the first one on ties. Precondition: count() > 0.
  int deepest() const;
  // Selects at most four: the deepest, the farthest from it, the farthest from their line, and the one that
  // extends the area most. Returns their number.
  int select(int (&chosen)[4]);

 private:
  // Index of the greatest measure(x, y, z) − separation, or −1 if none is significant.
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

// A list of candidates of fixed capacity.
class ManifoldReducer {
 public:
  // A full list is first reduced to the selected ones.
  void add(const ManifoldCandidate&);
  int count() const { return points_.count(); }
  void clear() { points_.clear(); }
  template <class Each>
  void for_each(Each each) const {
    for (int i = 0; i < count(); ++i) each(at(i));
  }
  // The mean position and separation, with the normal and tag of the first. Precondition: count() > 0.
  ManifoldCandidate average() const;
  // Infinity if empty.
  float min_separation() const;
  // Calls take(candidate) for the selected ones, at most four.
  template <class Take>
  void reduce(Take take) {
    int chosen[4];
    const int n = points_.select(chosen);
    for (int i = 0; i < n; ++i) take(at(chosen[i]));
  }

 private:
  void keep_selected();
  ManifoldCandidate at(int i) const { return {points_.at(i), normal_[i], points_.separation(i), tag_[i]}; }

  ReductionPoints points_;
  Vec3 normal_[ReductionPoints::kCapacity];
  int tag_[ReductionPoints::kCapacity];
};

}  // namespace smartsurf::world
