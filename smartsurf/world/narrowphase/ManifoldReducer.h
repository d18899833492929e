// Reduces a manifold to the few points with the widest support.
#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "smartsurf/world/body/Vec.h"

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
  static constexpr int kMaxSelected = 8;
  // Selects four at first: the deepest, the farthest from it, the farthest from their line, and the one that
  // extends the area most. Then those that extend the polygon on the sides near load_point(), where the load
  // acts, because a body on too small a polygon rocks, on other points in each step; on all sides if it
  // returns std::nullopt. Then the deepest ones whose normals, normal(i), are unlike those of
  // all selected: a body that is wedged must be held from all sides. Returns their number.
  template <class Normal, class LoadPoint>
  int select(int (&chosen)[kMaxSelected], Normal normal, LoadPoint load_point);

 private:
  // Index of the greatest measure(x, y, z) − separation, or −1 if none is significant.
  template <class Spread>
  int argmax(Spread measure) const;

  int select_widest(int (&chosen)[kMaxSelected]);
  // Extends a selection of four. Without a load point on all sides.
  int extend(const Vec3* load_point, const Vec3& normal, int candidates, int (&chosen)[kMaxSelected]) const;

  // Contacts deeper than that count as wedging, u. Normals at a smaller cosine are unlike.
  static constexpr float kWedgedDepth = 2e-3F, kLikeCosine = 0.8F;

  alignas(16) float x_[kCapacity];
  alignas(16) float y_[kCapacity];
  alignas(16) float z_[kCapacity];
  alignas(16) float separation_[kCapacity];
  int count_ = 0;
};

template <class Normal, class LoadPoint>
int ReductionPoints::select(int (&chosen)[kMaxSelected], Normal normal, LoadPoint load_point) {
  const int candidates = count_;
  int count = select_widest(chosen);
  if (count == candidates) return count;
  if (count == 4) {
    const std::optional<Vec3> at = load_point();
    count = extend(at ? &*at : nullptr, normal(chosen[0]), candidates, chosen);
  }
  const auto is_unlike = [&](int i) {
    for (int k = 0; k < count; ++k)
      if (normal(chosen[k]).dot(normal(i)) >= kLikeCosine) return false;
    return true;
  };
  while (count < kMaxSelected) {
    int best = -1;
    for (int i = 0; i < candidates; ++i)
      if (separation_[i] < (best < 0 ? -kWedgedDepth : separation_[best]) && is_unlike(i)) best = i;
    if (best < 0) break;
    chosen[count++] = best;
  }
  return count;
}

struct ManifoldCandidate {
  Vec3 point, normal;
  float separation;
  int tag;
  bool is_apart_twice = false;  // beyond the normal, it is apart in another direction: they may never touch
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
  // Calls take(candidate) for the selected ones, at most ReductionPoints::kMaxSelected. See select().
  template <class Take>
  void reduce(Take take, const std::optional<Vec3>& load_point = std::nullopt) {
    int chosen[ReductionPoints::kMaxSelected];
    const int n = points_.select(
        chosen, [this](int i) -> const Vec3& { return normal_[i]; }, [&] { return load_point; });
    for (int i = 0; i < n; ++i) take(at(chosen[i]));
  }
  // The candidates are the corners of a face patch in their order, or the ends of an edge, and `corners`
  // those that are left of them: Contact::twist_friction_loss, for an even load.
  float twist_friction_loss(std::span<const Vec3> corners) const;

 private:
  void keep_selected();
  ManifoldCandidate at(int i) const { return {points_.at(i), normal_[i], points_.separation(i), tag_[i]}; }

  ReductionPoints points_;
  Vec3 normal_[ReductionPoints::kCapacity];
  int tag_[ReductionPoints::kCapacity];
};

// ---- planes: candidates with one normal and one offset of the surface that they touch

// The planes of candidates in the order of their first ones: `plane[i]` is that of candidates[i]. Returns
// their number.
int find_planes(std::span<const ManifoldCandidate>, std::vector<int>& plane);

// Calls each(candidate, plane) plane by plane.
template <class Each>
void sort_by_plane(std::span<const ManifoldCandidate> candidates, Each each) {
  thread_local std::vector<int> plane;
  const int count = find_planes(candidates, plane);
  for (int p = 0; p < count; ++p)
    for (std::size_t i = 0; i < candidates.size(); ++i)
      if (plane[i] == p) each(candidates[i], p);
}

// Calls take(candidate) for the candidates that are left when those of each plane are reduced by themselves.
template <class Take>
void reduce_planes(std::span<const ManifoldCandidate> candidates, Take take) {
  ManifoldReducer reducer;
  int current = 0;
  sort_by_plane(candidates, [&](const ManifoldCandidate& c, int plane) {
    if (plane != current) reducer.reduce(take), reducer.clear();
    current = plane;
    reducer.add(c);
  });
  reducer.reduce(take);
}

}  // namespace smartsurf::world
